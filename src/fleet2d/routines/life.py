"""The life of somebody: one drawn day after another, each a function of its date alone."""

from collections.abc import Sequence
from datetime import date

from fleet2d.routines.busy import Busy
from fleet2d.routines.interruptions import interrupted
from fleet2d.routines.persona import Persona
from fleet2d.routines.planner import DAY_S, DayPlan, Doing, plan_day
from fleet2d.routines.recorded import draw_recorded, in_free_rooms, source, with_jobs
from fleet2d.streams import Draws, stream_key

# So many days are remembered, of those that were asked for.
REMEMBERED = 8


class Life:
    """The days that a persona lives.

    A day is known by the ordinal of its date, and drawn from it: no day depends on when a run
    begins, nor on which days were asked for before.

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
        self._known: dict[int, Sequence[Doing]] = {}

    def template(self, ordinal: int) -> DayPlan:
        """Return what a day is drawn from."""
        return self.persona.plans[self.persona.day(date.fromordinal(ordinal))]

    def wake(self, ordinal: int) -> int:
        """Return when a day begins [s since its midnight]."""
        plan, draws = self.template(ordinal), Draws(self._wake, ordinal)
        if plan.recorded is not None:
            return plan.recorded.days[source(plan.recorded, draws)].begins[0]
        return plan.wake.draw(draws)

    def draws(self, ordinal: int) -> Draws:
        """Return the random draws of a day."""
        return Draws(self._day, ordinal)

    def day(self, ordinal: int) -> Sequence[Doing]:
        """Return what is done on a day, from waking to the next waking [s since its midnight]."""
        if ordinal not in self._known:
            if len(self._known) >= REMEMBERED:
                self._known.clear()
            self._known[ordinal] = self.draw_day(ordinal, self.template(ordinal))
        return self._known[ordinal]

    def draw_day(self, ordinal: int, plan: DayPlan, busy: Busy | None = None) -> Sequence[Doing]:
        """Draw a day from a template that may differ from its own, and what comes up in it."""
        day = self.planned(ordinal, plan, busy)
        body = self.persona.body
        if not (body.urges or body.chores):
            return day
        return interrupted(body, Draws(self._needs, ordinal), day, busy)

    def planned(self, ordinal: int, plan: DayPlan, busy: Busy | None = None) -> Sequence[Doing]:
        """Draw a day from a template, without what comes up in it."""
        next_wake = self.wake(ordinal + 1) + DAY_S
        if plan.recorded is not None:
            first = source(plan.recorded, Draws(self._wake, ordinal))
            day = draw_recorded(plan.recorded, first, self.draws(ordinal), next_wake)
            return in_free_rooms(with_jobs(day, plan.jobs), self.persona.body.private, busy)
        return plan_day(plan, self.draws(ordinal), self.wake(ordinal), next_wake, busy)
