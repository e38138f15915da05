"""Interruptions: needs and errands put into a planned day, which they leave as it is otherwise.

Each interruption lies within one activity, which goes on afterwards: no activity of the plan begins
or ends at another time. A day's interruptions are a function of its date and its plan alone.
"""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

from fleet2d.kernels.random import Bits
from fleet2d.routines.activity import seconds
from fleet2d.routines.busy import Busy
from fleet2d.routines.laws import Law
from fleet2d.routines.planner import DAY_S, FINISHES, INTERRUPTS, RESUMES, SLEEP, Doing
from fleet2d.streams import Draws

if TYPE_CHECKING:
    from fleet2d.routines.activity import Activity
    from fleet2d.routines.needs import Errand, Need

# Chances are of that, and laws are drawn from so many quantiles: a few bits of a draw do.
CHANCE_BITS, QUANTILE_BITS = 10, 8
CERTAIN = 1 << CHANCE_BITS
# Nobody goes on with something for less than this [s].
SHORTEST_REST_S = 60
# Nobody gets up in the night shortly before waking [s].
LAST_SLEEP_S = 1800
# So many stretches a day has at most: what is done has its random draws by its number in the day.
MOST = 480


Quantiles = tuple[int, ...]


class Step(NamedTuple):
    """One thing done in an interruption.

    Attributes:
        activity: What.
        chance: On how many of CERTAIN occasions.
        takes: How long: quantiles [s].
        exclusive: Whether it has to wait while others of the household do the like.
    """

    activity: str
    chance: int
    takes: Quantiles
    exclusive: bool


class Urge(NamedTuple):
    """A need as the planner uses it; chances are of CERTAIN, times in seconds."""

    steps: tuple[Step, ...]
    every: Quantiles
    asleep: Quantiles | None
    on_waking: int
    before_bed: int
    before_leaving: int
    on_return: int
    patience: int
    window: tuple[int, int] | None
    met_by: frozenset[str]


class Chore(NamedTuple):
    """An errand as the planner uses it."""

    step: Step
    after: frozenset[str]
    before: frozenset[str]


class Body(NamedTuple):
    """What interrupts somebody's days.

    Attributes:
        urges: Their needs.
        chores: Their errands.
        away: Activities out of the home.
        kept: Activities that a need does not interrupt.
        private: Activities that one does alone in their room.
    """

    urges: tuple[Urge, ...]
    chores: tuple[Chore, ...]
    away: frozenset[str]
    kept: frozenset[str]
    private: frozenset[str]


def body_of(
    needs: Mapping[str, "Need"],
    errands: Mapping[str, "Errand"],
    activities: Mapping[str, "Activity"],
) -> Body:
    """Return what the planner uses of needs and errands.

    Args:
        needs: By name.
        errands: By name.
        activities: All that a day may hold, those of needs and errands among them.
    """
    urges = tuple(_urge(name, need, activities) for name, need in needs.items())
    chores = tuple(
        Chore(
            _step(errand.activity or name, errand.probability, errand.takes, activities),
            frozenset(errand.after),
            frozenset(errand.before),
        )
        for name, errand in errands.items()
    )
    return Body(
        urges,
        chores,
        frozenset(name for name, activity in activities.items() if activity.away),
        frozenset(n for n, a in activities.items() if a.exclusive or not a.interruptible),
        frozenset(name for name, activity in activities.items() if activity.exclusive),
    )


def _urge(name: str, need: "Need", activities: Mapping[str, "Activity"]) -> Urge:
    steps = [_step(need.activity or name, 1.0, need.takes, activities)]
    steps += [_step(what, chance, None, activities) for what, chance in need.then.items()]
    window = None
    if need.between is not None:
        first = seconds(need.between[0])
        window = first, (seconds(need.between[1]) - first) % DAY_S
    return Urge(
        tuple(steps),
        _quantiles(need.every.table()),
        None if need.asleep is None else _quantiles(need.asleep.table()),
        _chance(need.on_waking),
        _chance(need.before_bed),
        _chance(need.before_leaving),
        _chance(need.on_return),
        seconds(need.patience),
        window,
        frozenset(need.met_by),
    )


def _chance(share: float) -> int:
    """Return a probability in parts of CERTAIN."""
    return round(share * CERTAIN)


def _step(name: str, chance: float, takes: object, activities: Mapping[str, "Activity"]) -> Step:
    activity = activities[name]
    law = (takes or activity.takes).table()  # type: ignore[attr-defined]
    return Step(name, _chance(chance), _quantiles(law), activity.exclusive)


def _quantiles(law: Law) -> Quantiles:
    """Return quantiles of a law between its bounds [s]."""
    return tuple(max(1, value) for value in law.quantiles(1 << QUANTILE_BITS))


def interrupted(
    body: Body, draws: Draws, day: Sequence[Doing], busy: Busy | None = None
) -> list[Doing]:
    """Return a day with what comes up in it.

    Args:
        body: What comes up.
        draws: The random draws of the day's interruptions.
        day: The planned day, without a gap.
        busy: When the rooms that only one can use are in use by others; None: never.
    """
    return _Interruptions(body, draws, day, busy).result


def uninterrupted(day: Sequence[Doing]) -> list[Doing]:
    """Return a day as it was planned, before anything came up in it."""
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


class _Interruptions:
    """A day in the making."""

    def __init__(self, body: Body, draws: Draws, day: Sequence[Doing], busy: Busy | None) -> None:
        self.body, self.bits, self.busy = body, Bits(draws), busy
        self.result: list[Doing] = []
        begin = day[0].begin
        self.due = [begin + self._part_of(urge.every) for urge in body.urges]
        self.waited = [False] * len(body.urges)
        for k, doing in enumerate(day):
            self.now, self.end, self.doing, self.fresh = doing.begin, doing.end, doing, True
            before = day[k - 1].activity if k else SLEEP
            after = day[k + 1].activity if k + 1 < len(day) else SLEEP
            if doing.activity in body.away:
                self._go_out()
            elif doing.activity == SLEEP:
                self._sleep(before)
            else:
                self._be_at_home(before, after)
            if self.now == doing.begin:
                self.result.append(doing)
            elif self.now < self.end:
                self._go_on(self.end)
            else:
                self._finish()

    def _finish(self) -> None:
        """Let the last interruption be over when the activity is, which isn't gone on with."""
        i = len(self.result) - 1
        while self.result[i].role == INTERRUPTS:
            self.result[i] = self.result[i]._replace(role=FINISHES)
            i -= 1

    def _go_out(self) -> None:
        """Let needs that come up out of the home be met there."""
        for i, urge in enumerate(self.body.urges):
            if self.due[i] < self.end:
                self.due[i] = self.end + self._part_of(urge.every)

    def _sleep(self, before: str) -> None:
        """Go to bed, and get up in the night."""
        if before != SLEEP:
            self._errands(before)
            for i, urge in enumerate(self.body.urges):
                if self._happens(urge.before_bed):
                    self._meet(i, self.now)
        for i, urge in enumerate(self.body.urges):
            self.due[i] = max(self.due[i], self.end)
            if urge.asleep is None:
                continue
            at = self.now + self._time(urge.asleep)
            while at < self.end - LAST_SLEEP_S:
                self._meet(i, at)
                at = max(at, self.now) + self._time(urge.asleep)
            self.due[i] = self.end + self._part_of(urge.every)

    def _be_at_home(self, before: str, after: str) -> None:
        """Meet the needs that come up while one does something at home, in order of time."""
        urges, body = self.body.urges, self.body
        if before != self.doing.activity and before != SLEEP:
            self._errands(before)
        for i, urge in enumerate(urges):
            chance = urge.on_waking if before == SLEEP else urge.on_return
            if (before == SLEEP or before in body.away) and self._happens(chance):
                self._meet(i, self.now)
            if self.doing.activity in urge.met_by:
                self.due[i] = self.end + self._time(urge.every)
        self._meet_those_due(after)
        if after in body.away:
            for i, urge in enumerate(urges):
                if self._happens(urge.before_leaving):
                    self._meet(i, self.end)

    def _meet_those_due(self, after: str) -> None:
        """Meet the needs that come up before one is done, or put them off until then."""
        urges, body = self.body.urges, self.body
        kept = self.doing.activity in body.kept
        while urges:
            i = min(range(len(urges)), key=self.due.__getitem__)
            at = max(self.due[i], self.now)
            if at >= self.end:
                return
            waits = kept or (not self.waited[i] and self.end - at <= urges[i].patience)
            if waits and after not in body.away:
                self.due[i], self.waited[i] = self.end, True
            else:
                self._meet(i, self.end if waits else at)

    def _happens(self, chance: int) -> bool:
        return chance > 0 and (chance >= CERTAIN or self.bits.take(CHANCE_BITS) < chance)

    def _time(self, quantiles: Quantiles) -> int:
        """Draw a time from a law [s]."""
        return quantiles[self.bits.take(QUANTILE_BITS)]

    def _part_of(self, quantiles: Quantiles) -> int:
        """Draw what is left of a time drawn from a law, of which some is over [s]."""
        return (self._time(quantiles) * self.bits.take(QUANTILE_BITS)) >> QUANTILE_BITS

    def _errands(self, before: str) -> None:
        """Do errands where one activity follows another."""
        for chore in self.body.chores:
            fits = (not chore.after or before in chore.after) and (
                not chore.before or self.doing.activity in chore.before
            )
            if fits and self._happens(chore.step.chance):
                self._insert([(chore.step, self._time(chore.step.takes))], self.now)

    def _meet(self, number: int, at: int) -> None:
        """Meet a need at a time or a little before the activity is over, if there is time."""
        urge = self.body.urges[number]
        self.due[number] = max(at, self.now) + self._time(urge.every)
        self.waited[number] = False
        if urge.window and (at - urge.window[0]) % DAY_S > urge.window[1]:
            return
        here = self.doing.activity
        steps = [
            (step, self._time(step.takes))
            for step in urge.steps
            if step.activity != here and self._happens(step.chance)
        ]
        if steps and not self._insert(steps, at):
            self.due[number] = self.end

    def _insert(self, steps: Sequence[tuple[Step, int]], at: int) -> bool:
        """Put something into the activity from about a time on; tell whether there was room."""
        long = sum(takes for _, takes in steps)
        latest = self.end - long
        if latest < self.end and latest >= at > latest - SHORTEST_REST_S:
            at = latest
        at = min(at, latest)
        first = self.now + SHORTEST_REST_S if self.fresh else self.now
        if latest < first or len(self.result) > MOST - 2 * len(steps):
            return False
        room = -1
        if self.busy is not None and any(step.exclusive for step, _ in steps):
            found = self._free_room(steps, at, latest, long)
            if found is None:
                return False
            at, room = found
        if at > self.now:
            self._go_on(at)
        for step, takes in steps:
            self.result.append(Doing(step.activity, at, at + takes, "", room, INTERRUPTS))
            at += takes
        self.now = at
        return True

    def _free_room(
        self, steps: Sequence[tuple[Step, int]], at: int, latest: int, long: int
    ) -> tuple[int, int] | None:
        """Return the first time at which one of the rooms is free for long enough, and the room."""
        assert self.busy is not None
        name = next(step.activity for step, _ in steps if step.exclusive)
        if self.doing.activity in self.body.private and self.doing.room in self.busy.rooms_of(name):
            return at, self.doing.room  # one has it to oneself
        found = self.busy.free(name, at, latest, long, self.end)
        return None if found is None else (found.begin, found.room)

    def _go_on(self, until: int) -> None:
        """Do what was planned up to a time."""
        activity, _, _, task, room, role = self.doing
        role = role if self.fresh else RESUMES
        self.result.append(Doing(activity, self.now, until, task, room, role))
        self.now, self.fresh = until, False
