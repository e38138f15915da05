"""Failures of a camera, a sensor or a robot, at given moments or at random."""

from collections.abc import Iterator
from datetime import datetime, timedelta
from typing import Annotated, Any

import numpy as np
from pydantic import BeforeValidator, Field, PlainSerializer, WithJsonSchema

from fleet2d.configuration.components import Settings
from fleet2d.configuration.problems import problem
from fleet2d.configuration.units import PositiveDuration, micros
from fleet2d.errors import ScenarioError
from fleet2d.floorplan.home import format_moment, parse_moment
from fleet2d.runtime.clock import DAY, Clock, midnights
from fleet2d.runtime.determinism import Draws

Moment = Annotated[
    datetime | timedelta,
    BeforeValidator(parse_moment),
    PlainSerializer(format_moment),
    WithJsonSchema(
        {
            "description": "a local time like 2026-01-07T14:00, or the time since the start like"
            " '2 d 14 h'",
            "type": ["string", "number", "object"],
            "examples": ["2026-01-07T14:00", "2 d"],
        }
    ),
]


def _as_list(value: Any) -> Any:
    return value if isinstance(value, list | tuple) else (value,)


class Failures(Settings):
    """The times at which something fails: given moments, random ones, or both.

    Attributes:
        at: The moments: a local time, or the time since the start; one, or a list.
        per_day: Mean number of further failures a day, at random times.
        lasts: Duration of a failure.

    Example:
        >>> Failures(at="2 h", lasts="10 min").at
        (datetime.timedelta(seconds=7200),)
    """

    at: Annotated[tuple[Moment, ...], BeforeValidator(_as_list)] = ()
    per_day: float = Field(default=0.0, ge=0, le=1000)
    lasts: PositiveDuration = timedelta(minutes=10)

    def model_post_init(self, _: object, /) -> None:
        """Refuse failures that never happen."""
        if not self.at and not self.per_day:
            raise problem("it never fails: give 'at' (moments) or 'per_day' (how often)")

    def steps(self, clock: Clock, key: np.uint64) -> list[int]:
        """Return the steps of a run at which a failure begins, in order.

        Args:
            clock: The steps of the run.
            key: The key of the random stream of this purpose.

        Raises:
            ScenarioError: A given moment isn't within the run.
        """
        given = [_step_of(moment, clock) for moment in self.at]
        drawn = _random_steps(self.per_day, clock, key)
        return sorted({*given, *(step for step in drawn if 0 <= step < clock.steps)})


def _step_of(moment: datetime | timedelta, clock: Clock) -> int:
    """Return the step of a moment.

    Raises:
        ScenarioError: The moment isn't within the run.
    """
    elapsed_us = micros(moment) if isinstance(moment, timedelta) else clock.elapsed(moment)
    step = clock.step_at_or_after(elapsed_us)
    if not 0 <= step < clock.steps:
        ends = clock.time(clock.steps)
        raise ScenarioError(
            f"at: {format_moment(moment)} is not within the run, which goes from"
            f" {clock.start:%Y-%m-%d %H:%M:%S} to {ends:%Y-%m-%d %H:%M:%S}"
        )
    return step


def _random_steps(per_day: float, clock: Clock, key: np.uint64) -> Iterator[int]:
    """Yield random steps for each day of a run, some before its start or after its end."""
    if not per_day:
        return
    for number, midnight in enumerate(midnights(clock.start, clock.time(clock.steps))):
        draws = Draws(key, number)
        count = int(per_day) + (draws.uniform() < per_day - int(per_day))
        for _ in range(count):
            moment = midnight + draws.uniform() * DAY
            yield clock.step_at_or_after(clock.elapsed(moment))
