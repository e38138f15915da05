"""The days of a person: each is drawn as a function of its date alone."""

from collections.abc import Sequence
from datetime import date

from fleet2d.routines.interruptions import interrupt
from fleet2d.routines.persona import Persona
from fleet2d.routines.planner import (
    DAY_S,
    DayPlan,
    Doing,
    PrivateRooms,
    draw_recorded,
    draw_source,
    in_free_rooms,
    plan_day,
    with_jobs,
)
from fleet2d.runtime.determinism import Draws, stream_key

# The number of days that are kept after they were drawn.
CACHED_DAYS = 3


class Life:
    """The days of a persona.

    A day is identified by the ordinal of its date, and drawn from it: no day depends on when a run
    begins, or on which days were drawn before.

    Example:
        >>> from fleet2d.routines.persona import bundled_persona
        >>> life = Life(bundled_persona("retired"), seed=4, path="users.ana")
        >>> day = life.day(date(2026, 1, 5).toordinal())
        >>> [doing.activity for doing in day[:3]], day[-1].activity
        (['toilet', 'wash_hands', 'wash'], 'sleep')
    """

    def __init__(self, persona: Persona, seed: int, path: str) -> None:
        self.persona = persona
        self._wake = stream_key(seed, path, "wake")
        self._day = stream_key(seed, path, "day")
        self._needs = stream_key(seed, path, "needs")
        self._cache: dict[int, Sequence[Doing]] = {}
        self._templates: dict[int, DayPlan] = {}

    def __getstate__(self) -> dict[str, object]:
        """Leave out the days, which are drawn again: they are most of the state of many people."""
        return {**self.__dict__, "_cache": {}, "_templates": {}}

    def template(self, ordinal: int) -> DayPlan:
        """Return the plan of the template that a day is drawn from."""
        if ordinal not in self._templates:
            if len(self._templates) >= CACHED_DAYS:
                del self._templates[next(iter(self._templates))]
            name = self.persona.day(date.fromordinal(ordinal))
            self._templates[ordinal] = self.persona.plans[name]
        return self._templates[ordinal]

    def wake(self, ordinal: int) -> int:
        """Return when a day begins [s since its midnight]."""
        plan, draws = self.template(ordinal), Draws(self._wake, ordinal)
        if plan.recorded is not None:
            return plan.recorded.days[draw_source(plan.recorded, draws)].begins[0]
        return plan.wake.draw(draws)

    def draws(self, ordinal: int) -> Draws:
        """Return the random draws of a day."""
        return Draws(self._day, ordinal)

    def day(self, ordinal: int) -> Sequence[Doing]:
        """Return the doings of a day, from waking to the next waking [s since its midnight]."""
        if ordinal not in self._cache:
            if len(self._cache) >= CACHED_DAYS:
                del self._cache[next(iter(self._cache))]
            self._cache[ordinal] = self.draw_day(ordinal, self.template(ordinal))
        return self._cache[ordinal]

    def draw_day(
        self, ordinal: int, plan: DayPlan, private: PrivateRooms | None = None
    ) -> Sequence[Doing]:
        """Draw a day from a plan, which may differ from its template's, with interruptions."""
        day = self.draw_uninterrupted(ordinal, plan, private)
        if not (self.persona.needs or self.persona.errands):
            return day
        return interrupt(self.persona.interruptions, Draws(self._needs, ordinal), day, private)

    def draw_uninterrupted(
        self, ordinal: int, plan: DayPlan, private: PrivateRooms | None = None
    ) -> Sequence[Doing]:
        """Draw a day from a plan, without interruptions."""
        next_wake = self.wake(ordinal + 1) + DAY_S
        if plan.recorded is not None:
            first = draw_source(plan.recorded, Draws(self._wake, ordinal))
            day = draw_recorded(plan.recorded, first, self.draws(ordinal), next_wake)
            exclusive = self.persona.interruptions.exclusive
            return in_free_rooms(with_jobs(day, plan.jobs), exclusive, private)
        return plan_day(plan, self.draws(ordinal), self.wake(ordinal), next_wake, private)
