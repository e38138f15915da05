"""Interruptions: needs and errands that are inserted into a planned day.

Each interruption lies within one activity, which is resumed afterwards: all activities of the plan
begin and end as planned. A day's interruptions are a function of its date and its plan alone.
"""

from collections.abc import Sequence

from fleet2d.kernels.numbers import Bits
from fleet2d.routines.interruption_rules import (
    CERTAIN,
    CHANCE_BITS,
    QUANTILE_BITS,
    InterruptionRules,
    InterruptionStep,
    Quantiles,
)
from fleet2d.routines.occupancy import ANY_ROOM, Occupancy
from fleet2d.routines.planner import (
    DAY_S,
    FINISHES,
    INTERRUPTS,
    PLANNED,
    RESUMES,
    SLEEP,
    Doing,
    new_doing,
)
from fleet2d.runtime.determinism import Draws

# The least duration of the rest of an activity after an interruption [s].
SHORTEST_REST_S = 60
# Within this time before waking, no need interrupts sleep [s].
LAST_SLEEP_S = 1800
# The most doings of a day, whose numbers are part of the addresses of random draws.
MOST = 480


def interrupt(
    rules: InterruptionRules, draws: Draws, day: Sequence[Doing], occupancy: Occupancy | None = None
) -> list[Doing]:
    """Return a day with interruptions.

    Args:
        rules: The needs and errands of the person.
        draws: The random draws of the day's interruptions.
        day: The planned day, without a gap.
        occupancy: When others use private rooms; None: never.
    """
    if occupancy is not None:
        return _InterruptedDay(rules, draws, day, occupancy).result
    rows = [(rules.numbers[doing.activity], doing.begin, doing.end) for doing in day]
    return [
        new_doing((rules.names[activity], begin, end, "", ANY_ROOM, role))
        if planned < 0
        else _part(day[planned], begin, end, role)
        for planned, activity, begin, end, role in rules.core.interrupt(draws, rows)
    ]


def _part(doing: Doing, begin: int, end: int, role: int) -> Doing:
    """Return a part of a planned doing."""
    if begin == doing.begin and end == doing.end:
        return doing
    role = doing.role if role == PLANNED else role
    return new_doing((doing.activity, begin, end, doing.task, doing.room, role))


def without_interruptions(day: Sequence[Doing]) -> list[Doing]:
    """Return a day as it was planned, without its interruptions."""
    planned: list[Doing] = []
    begin = day[0].begin
    for doing in day:
        if doing.role == INTERRUPTS:
            continue
        resumes = doing.role == RESUMES and planned and planned[-1].activity == doing.activity
        if doing.role == FINISHES or resumes:
            planned[-1] = planned[-1]._replace(end=doing.end)
        else:
            planned.append(doing._replace(begin=begin))
        begin = doing.end
    return planned


class _InterruptedDay:
    """A day of a member of a household to which interruptions are added, doing by doing.

    Attributes:
        result: The doings so far.
        due: When each need occurs next [s].
        has_waited: Whether each need has waited for the end of an activity since it was due.
        doing: The planned doing to which interruptions are added.
        now: The end of its last part so far [s].
        end: Its end [s].
        is_fresh: Whether no interruption was added to it so far.
    """

    def __init__(
        self,
        rules: InterruptionRules,
        draws: Draws,
        day: Sequence[Doing],
        occupancy: Occupancy | None,
    ) -> None:
        self.rules, self.bits, self.occupancy = rules, Bits(draws), occupancy
        self.result: list[Doing] = []
        begin = day[0].begin
        self.due = [begin + self._draw_part(need.every) for need in rules.needs]
        self.has_waited = [False] * len(rules.needs)
        for k, doing in enumerate(day):
            self.now, self.end, self.doing, self.is_fresh = doing.begin, doing.end, doing, True
            before = day[k - 1].activity if k else SLEEP
            after = day[k + 1].activity if k + 1 < len(day) else SLEEP
            if doing.activity in rules.away:
                self._skip_needs()
            elif doing.activity == SLEEP:
                self._interrupt_sleep(before)
            else:
                self._interrupt_activity(before, after)
            if self.now == doing.begin:
                self.result.append(doing)
            elif self.now < self.end:
                self._continue(self.end)
            else:
                self._mark_finishing()

    def _mark_finishing(self) -> None:
        """Mark the last interruptions as the end of their activity, which isn't resumed."""
        i = len(self.result) - 1
        while self.result[i].role == INTERRUPTS:
            self.result[i] = self.result[i]._replace(role=FINISHES)
            i -= 1

    def _skip_needs(self) -> None:
        """Let needs that occur out of the home be met there."""
        for i, need in enumerate(self.rules.needs):
            if self.due[i] < self.end:
                self.due[i] = self.end + self._draw_part(need.every)

    def _interrupt_sleep(self, before: str) -> None:
        """Add errands and needs before sleep, and needs in the night."""
        if before != SLEEP:
            self._do_errands(before)
            for i, need in enumerate(self.rules.needs):
                if self._happens(need.before_bed):
                    self._meet(i, self.now)
        for i, need in enumerate(self.rules.needs):
            self.due[i] = max(self.due[i], self.end)
            if need.asleep is None:
                continue
            at = self.now + self._draw_time(need.asleep)
            while at < self.end - LAST_SLEEP_S:
                self._meet(i, at)
                at = max(at, self.now) + self._draw_time(need.asleep)
            self.due[i] = self.end + self._draw_part(need.every)

    def _interrupt_activity(self, before: str, after: str) -> None:
        """Add errands and needs to an activity at home, in order of time."""
        needs, away, activity = self.rules.needs, self.rules.away, self.doing.activity
        if before != activity and before != SLEEP:
            self._do_errands(before)
        wakes, begins_anew = before == SLEEP, before == SLEEP or before in away
        for i, need in enumerate(needs):
            if begins_anew and self._happens(need.on_waking if wakes else need.on_return):
                self._meet(i, self.now)
            if activity in need.met_by:
                self.due[i] = self.end + self._draw_time(need.every)
        self._meet_due_needs(after)
        if after in away:
            for i, need in enumerate(needs):
                if self._happens(need.before_leaving):
                    self._meet(i, self.end)

    def _meet_due_needs(self, after: str) -> None:
        """Meet the needs that are due before the activity ends, or put them off until its end."""
        needs = self.rules.needs
        is_uninterruptible = self.doing.activity in self.rules.uninterruptible
        while needs:
            first = min(self.due)
            i, at = self.due.index(first), max(first, self.now)
            if at >= self.end:
                return
            waits = is_uninterruptible or (
                not self.has_waited[i] and self.end - at <= needs[i].patience
            )
            if waits and after not in self.rules.away:
                self.due[i], self.has_waited[i] = self.end, True
            else:
                self._meet(i, self.end if waits else at)

    def _happens(self, chance: int) -> bool:
        """Draw whether something of a probability happens, given in parts of CERTAIN."""
        return chance > 0 and (chance >= CERTAIN or self.bits.take(CHANCE_BITS) < chance)

    def _draw_time(self, quantiles: Quantiles) -> int:
        """Draw a time from a law [s]."""
        return quantiles[self.bits.take(QUANTILE_BITS)]

    def _draw_part(self, quantiles: Quantiles) -> int:
        """Draw a time from a law, and a uniform part of it [s]."""
        return (self._draw_time(quantiles) * self.bits.take(QUANTILE_BITS)) >> QUANTILE_BITS

    def _do_errands(self, before: str) -> None:
        """Add the errands between the activity before and the present one."""
        for errand in self.rules.errands:
            fits = (not errand.after or before in errand.after) and (
                not errand.before or self.doing.activity in errand.before
            )
            if fits and self._happens(errand.step.chance):
                self._insert([(errand.step, self._draw_time(errand.step.takes))], self.now)

    def _meet(self, number: int, at: int) -> None:
        """Meet a need at a time, or shortly before the end of the activity, if there is time."""
        need = self.rules.needs[number]
        self.due[number] = max(at, self.now) + self._draw_time(need.every)
        self.has_waited[number] = False
        if need.window and (at - need.window[0]) % DAY_S > need.window[1]:
            return
        activity = self.doing.activity
        steps = [
            (step, self._draw_time(step.takes))
            for step in need.steps
            if step.activity != activity and self._happens(step.chance)
        ]
        if steps and not self._insert(steps, at):
            self.due[number] = self.end

    def _insert(self, steps: Sequence[tuple[InterruptionStep, int]], at: int) -> bool:
        """Insert steps into the activity at about a time; return whether there is room for them."""
        duration = sum(takes for _, takes in steps)
        latest = self.end - duration
        if latest < self.end and latest >= at > latest - SHORTEST_REST_S:
            at = latest
        at = min(at, latest)
        first = self.now + SHORTEST_REST_S if self.is_fresh else self.now
        if latest < first or len(self.result) > MOST - 2 * len(steps):
            return False
        room = -1
        if self.occupancy is not None and any(step.exclusive for step, _ in steps):
            slot = self._free_room(steps, at, latest, duration)
            if slot is None:
                return False
            at, room = slot
        if at > self.now:
            self._continue(at)
        for step, takes in steps:
            self.result.append(Doing(step.activity, at, at + takes, "", room, INTERRUPTS))
            at += takes
        self.now = at
        return True

    def _free_room(
        self, steps: Sequence[tuple[InterruptionStep, int]], at: int, latest: int, duration: int
    ) -> tuple[int, int] | None:
        """Return the first time at which one of the rooms is free for long enough, and the room."""
        assert self.occupancy is not None
        name = next(step.activity for step, _ in steps if step.exclusive)
        room, rooms = self.doing.room, self.occupancy.rooms_of(name)
        if self.doing.activity in self.rules.private and room in rooms:
            return at, room  # the person is already alone in it
        slot = self.occupancy.free(name, at, latest, duration, self.end)
        return None if slot is None else (slot.begin, slot.room)

    def _continue(self, until: int) -> None:
        """Add the planned doing up to a time."""
        activity, _, _, task, room, role = self.doing
        role = role if self.is_fresh else RESUMES
        self.result.append(Doing(activity, self.now, until, task, room, role))
        self.now, self.is_fresh = until, False
