"""Interruptions of a day in plain Python: what `src/core/interruptions.hpp` says."""

from collections.abc import Sequence
from typing import NamedTuple

from fleet2d._core import Bits

DAY_S = 86_400
CHANCE_BITS, QUANTILE_BITS = 10, 8
CERTAIN = 1 << CHANCE_BITS
PLANNED, INTERRUPTS, RESUMES, FINISHES = 0, 1, 2, 3
# The least duration of the rest of an activity after an interruption [s].
SHORTEST_REST_S = 60
# Within this time before waking, no need interrupts sleep [s].
LAST_SLEEP_S = 1800
# The most parts of a day.
MOST = 480

Quantiles = Sequence[int]
Step = tuple[int, int, Quantiles]
"""Activity, chance of CERTAIN, and quantiles of the duration [s]."""


class CoreNeed(NamedTuple):
    """A row of `needs` of `fleet2d.kernels.Interruptions`."""

    steps: Sequence[Step]
    every: Quantiles
    asleep: Quantiles | None
    chances: tuple[int, int, int, int]  # on waking, before bed, before leaving, on return
    patience: int
    hours: tuple[int, int] | None
    met_by: Sequence[int]


class CoreErrand(NamedTuple):
    """A row of `errands` of `fleet2d.kernels.Interruptions`."""

    step: Step
    after: Sequence[int] | None
    before: Sequence[int] | None


class PlannedRow(NamedTuple):
    """A planned episode."""

    activity: int
    begin: int
    end: int
    room: int


class PartRow(NamedTuple):
    """A part of the interrupted day; `planned` is the number of the episode, -1 of none."""

    planned: int
    activity: int
    begin: int
    end: int
    role: int
    room: int


class SlowInterruptions:
    """Interrupts days, as `fleet2d.kernels.Interruptions`."""

    def __init__(
        self,
        needs,
        errands,
        away,
        uninterruptible,
        sleep,
        activities,
    ):
        self.needs = [CoreNeed(*need) for need in needs]
        self.errands = [CoreErrand(*errand) for errand in errands]
        self.away, self.uninterruptible, self.sleep = set(away), set(uninterruptible), sleep

    def interrupt(
        self,
        draws,
        day,
        use=None,
        rooms=(),
    ):
        rows = [PlannedRow(*row) for row in day]
        return [tuple(part) for part in _InterruptedDay(self, draws, rows, use, rooms).result]


class _InterruptedDay:
    """A day to which interruptions are added, episode by episode.

    Attributes:
        result: The parts so far.
        due: When each need occurs next [s].
        has_waited: Whether each need has waited for the end of an activity since it was due.
        episode: The planned episode to which interruptions are added.
        now: The end of its last part so far [s].
        end: Its end [s].
        is_fresh: Whether no interruption was added to it so far.
    """

    def __init__(
        self,
        rules,
        draws,
        day,
        use,
        rooms,
    ):
        self.rules, self.bits, self.use, self.rooms = rules, Bits(draws), use, rooms
        self.result = []
        begin = day[0].begin
        self.due = [begin + self._draw_part(need.every) for need in rules.needs]
        self.has_waited = [False] * len(rules.needs)
        for k, episode in enumerate(day):
            self.now, self.end, self.episode, self.is_fresh = (
                episode.begin,
                episode.end,
                episode,
                True,
            )
            self.number = k
            before = day[k - 1].activity if k else rules.sleep
            after = day[k + 1].activity if k + 1 < len(day) else rules.sleep
            if episode.activity in rules.away:
                self._skip_needs()
            elif episode.activity == rules.sleep:
                self._interrupt_sleep(before)
            else:
                self._interrupt_activity(before, after)
            if self.now == episode.begin or self.now < self.end:
                self._continue(self.end)
            else:
                self._mark_finishing()

    def _mark_finishing(self):
        """Mark the last interruptions as the end of their activity, which isn't resumed."""
        i = len(self.result) - 1
        while self.result[i].role == INTERRUPTS:
            self.result[i] = self.result[i]._replace(role=FINISHES)
            i -= 1

    def _skip_needs(self):
        """Let needs that occur out of the home be met there."""
        for i, need in enumerate(self.rules.needs):
            if self.due[i] < self.end:
                self.due[i] = self.end + self._draw_part(need.every)

    def _interrupt_sleep(self, before):
        """Add errands and needs before sleep, and needs in the night."""
        if before != self.rules.sleep:
            self._do_errands(before)
            for i, need in enumerate(self.rules.needs):
                if self._happens(need.chances[1]):
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

    def _interrupt_activity(self, before, after):
        """Add errands and needs to an activity at home, in order of time."""
        needs, away, activity = self.rules.needs, self.rules.away, self.episode.activity
        if before != activity and before != self.rules.sleep:
            self._do_errands(before)
        wakes, begins_anew = (
            before == self.rules.sleep,
            before == self.rules.sleep or before in away,
        )
        for i, need in enumerate(needs):
            if begins_anew and self._happens(need.chances[0 if wakes else 3]):
                self._meet(i, self.now)
            if activity in need.met_by:
                self.due[i] = self.end + self._draw_time(need.every)
        self._meet_due_needs(after)
        if after in away:
            for i, need in enumerate(needs):
                if self._happens(need.chances[2]):
                    self._meet(i, self.end)

    def _meet_due_needs(self, after):
        """Meet the needs that are due before the activity ends, or put them off until its end."""
        needs = self.rules.needs
        is_uninterruptible = self.episode.activity in self.rules.uninterruptible
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

    def _happens(self, chance):
        """Draw whether something of a probability happens, given in parts of CERTAIN."""
        return chance > 0 and (chance >= CERTAIN or self.bits.take(CHANCE_BITS) < chance)

    def _draw_time(self, quantiles):
        """Draw a time from a law [s]."""
        return quantiles[self.bits.take(QUANTILE_BITS)]

    def _draw_part(self, quantiles):
        """Draw a time from a law, and a uniform part of it [s]."""
        return (self._draw_time(quantiles) * self.bits.take(QUANTILE_BITS)) >> QUANTILE_BITS

    def _do_errands(self, before):
        """Add the errands between the activity before and the present one."""
        for errand in self.rules.errands:
            fits = (errand.after is None or before in errand.after) and (
                errand.before is None or self.episode.activity in errand.before
            )
            activity, chance, takes = errand.step
            if fits and self._happens(chance):
                self._insert([(activity, self._draw_time(takes))], self.now)

    def _meet(self, number, at):
        """Meet a need at a time, or shortly before the end of the activity, if there is time."""
        need = self.rules.needs[number]
        self.due[number] = max(at, self.now) + self._draw_time(need.every)
        self.has_waited[number] = False
        if need.hours and (at - need.hours[0]) % DAY_S > need.hours[1]:
            return
        activity = self.episode.activity
        steps = [
            (step, self._draw_time(takes))
            for step, chance, takes in need.steps
            if step != activity and self._happens(chance)
        ]
        if steps and not self._insert(steps, at):
            self.due[number] = self.end

    def _insert(self, steps, at):
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
        private = [step for step, _ in steps if self._private_rooms(step)]
        if private:
            slot = self._free_room(self._private_rooms(private[0]), at, latest, duration)
            if slot is None:
                return False
            at, room = slot
        if at > self.now:
            self._continue(at)
        for step, takes in steps:
            self.result.append(PartRow(-1, step, at, at + takes, INTERRUPTS, room))
            at += takes
        self.now = at
        return True

    def _private_rooms(self, activity):
        return () if self.use is None else self.rooms[activity]

    def _free_room(self, rooms, at, latest, duration):
        """Return the first time at which one of the rooms is free for long enough, and the room."""
        if self._private_rooms(self.episode.activity) and self.episode.room in rooms:
            return at, self.episode.room  # the person is already alone in it
        assert self.use is not None
        slot = self.use.free(rooms, at, latest, duration, self.end)
        return None if slot is None else (slot[0], slot[2])

    def _continue(self, until):
        """Add the planned episode up to a time."""
        activity, _, _, room = self.episode
        role = PLANNED if self.is_fresh else RESUMES
        self.result.append(PartRow(self.number, activity, self.now, until, role, room))
        self.now, self.is_fresh = until, False
