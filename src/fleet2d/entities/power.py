"""Power of robots: crashes and updates, and the memory that outlasts being off."""

from datetime import timedelta
from typing import Any, Literal

import numpy as np

from fleet2d.configuration.components import Settings
from fleet2d.configuration.problems import problem, problem_at
from fleet2d.configuration.units import PositiveDuration
from fleet2d.entities.behavior import Hours
from fleet2d.runtime.clock import DAY, Clock, midnights
from fleet2d.runtime.determinism import Draws
from fleet2d.sight.failures import Failures

PowerState = Literal["off", "crash", "update", "empty", "on"]
EMPTY = "empty"
"""Why a robot is off whose battery is empty."""
MAP = "map"
PLACE = "place"
KEPT = (MAP, PLACE)
"""What a robot may keep beside what algorithms have learned: the map, and where it is."""


class Updates(Settings):
    """Updates of a robot's software, during which it is off, at a drawn time within some hours.

    Attributes:
        during: The hours, like 02:00-04:00; on the days of the week that they name.
        lasts: Time for which the robot is off.
        every: Time between updates, in whole days; the first is in the first such hours.

    Example:
        >>> Updates(during="02:00-04:00", every="7 d").lasts
        datetime.timedelta(seconds=900)
    """

    during: Hours
    lasts: PositiveDuration = timedelta(minutes=15)
    every: PositiveDuration = DAY

    def model_post_init(self, _: object, /) -> None:
        """Refuse several or too short hours, and parts of days."""
        if len(self.during) != 1:
            raise problem_at(("during",), "give the hours of one span, like '02:00-04:00'")
        if self.lasts > self.during[0].end - self.during[0].begin:
            raise problem("'during' is shorter than an update 'lasts'")
        if self.every % DAY:
            raise problem_at(("every",), "updates are whole days apart, like '7 d'")

    def steps(self, clock: Clock, key: np.uint64) -> list[int]:
        """Return the steps of a run at which an update begins, in order."""
        hours = self.during[0]
        free = hours.end - hours.begin - self.lasts
        steps: list[int] = []
        due = None
        for number, midnight in enumerate(midnights(clock.start, clock.time(clock.steps))):
            if midnight.weekday() not in hours.days or (due is not None and midnight < due):
                continue
            moment = midnight + hours.begin + Draws(key, number).uniform() * free
            step = clock.step_at_or_after(clock.elapsed(moment))
            if 0 <= step < clock.steps:
                steps.append(step)
                due = midnight + self.every
        return steps


class Power(Settings):
    """The crashes and updates of a robot, and the memory that outlasts them.

    Without these settings, a robot is off only when its battery is empty, or when somebody switches
    it off; it keeps all that it has learned, but nothing about the present.

    Attributes:
        persists: The memory that outlasts being off: names of algorithms, `map` (the seen cells)
            and `place` (where it is); left out: all. All others begin anew. Algorithms of the
            present, such as `rtp`, keep only what they have learned in any case.
        crashes: The crashes, and the time until it is on again.
        updates: The updates of its software.

    Example:
        >>> Power(persists=["ltp", "map"], crashes={"per_day": 0.2, "lasts": "1 min"}).persists
        ('ltp', 'map')
    """

    persists: tuple[str, ...] | None = None
    crashes: Failures | None = None
    updates: Updates | None = None

    def keeps(self, name: str) -> bool:
        """Return whether something outlasts being off."""
        return self.persists is None or name in self.persists


KEEPS_ALL = Power()
"""The power of a robot whose scenario says nothing about it."""


def power_of(entity: Any) -> Power:
    """Return the power settings of a body."""
    power: Power | None = getattr(entity, "power", None)
    return power or KEEPS_ALL
