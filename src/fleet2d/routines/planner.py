"""The planner of days: from a template to a day that keeps every constraint, drawn at random.

A day goes from waking to the next waking. It is a chain of jobs in a drawn order. With windows for
their beginnings and bounds on their durations that is a simple temporal network, which two passes
solve: forward for the earliest beginnings, backward for the latest. Beginnings and durations are
then drawn from left to right, cut to what the backward pass leaves, so that no draw makes the rest
impossible. (In the manner of Idrees, Singh, Xu and Glas: "A Framework for Realistic Simulation of
Daily Human Activity", 2023, arXiv 2311.15400, who propagate constraints both ways through a day.)

Where the jobs of a day don't fit, another order is drawn, a few times; then one is left out by a
rule: of those that needn't be done every day, the one that is done on the fewest days.
"""

from collections.abc import Collection, Sequence
from typing import TYPE_CHECKING, NamedTuple

from fleet2d.routines.busy import ANY_ROOM, Busy
from fleet2d.routines.laws import Law, weighted
from fleet2d.streams import Draws

if TYPE_CHECKING:
    from fleet2d.routines.recorded import Recording

DAY_S = 86_400
ORDERS = 5  # drawn before a job is left out
# A wait shorter than this isn't worth starting something else: what is next begins at once.
NO_GAP_S = 300
MILLION = 1_000_000
NEVER = 1 << 40  # a time that nobody sees [s]
PLANNED, INTERRUPTS, RESUMES, FINISHES = 0, 1, 2, 3
REST = "rest"
SLEEP = "sleep"


class Doing(NamedTuple):
    """A stretch of a day in which one thing is done.

    Attributes:
        activity: What.
        begin: When [s since the midnight of the day's date].
        end: When it is over, and the next one begins.
        task: The task that it is in the template; empty for what fills the time, and for sleep.
        room: The room where it is done, by index, if its household has chosen one; else -1.
        role: Whether it was PLANNED, INTERRUPTS what was, RESUMES that afterwards, or FINISHES it.
    """

    activity: str
    begin: int
    end: int
    task: str = ""
    room: int = ANY_ROOM
    role: int = PLANNED


class Job(NamedTuple):
    """A task as the planner uses it; times in seconds since the day's midnight.

    Attributes:
        task: Its name.
        activity: What is done.
        starts: When it begins; None: at once after what it follows, on waking or before bed.
        takes: How long.
        until: It is over by then.
        after: The jobs before it, by index; all have lower ones.
        chance: On how many of a million days it is done.
        needed: Whether it must not be left out where a day is too full.
        exclusive: Whether it has to wait while others of the household do the like.
        place: -1 on waking, 1 before bed, else 0.
    """

    task: str
    activity: str
    starts: Law | None
    takes: Law
    until: int
    after: tuple[int, ...] = ()
    chance: int = MILLION
    needed: bool = True
    exclusive: bool = False
    place: int = 0

    @property
    def follows(self) -> bool:
        """Whether it begins as soon as another is over."""
        return self.starts is None and self.place == 0


class Fill(NamedTuple):
    """A pastime as the planner uses it: it may begin from `first` to `last`."""

    activity: str
    weight: int
    takes: Law
    first: int
    last: int


class DayPlan(NamedTuple):
    """A template as the planner uses it; days are drawn from `recorded` ones where it has them."""

    name: str
    wake: Law
    sleep: Law
    least_sleep: int
    jobs: tuple[Job, ...]
    fills: tuple[Fill, ...]
    recorded: "Recording | None" = None


class Chain(NamedTuple):
    """Jobs in order, when each would like to begin, and the latest that it can; sleep last."""

    jobs: list[Job]
    wished: list[int]
    latest: list[int]


def plan_day(
    plan: DayPlan,
    draws: Draws,
    wake: int,
    next_wake: int,
    busy: Busy | None = None,
) -> list[Doing]:
    """Draw a day.

    Args:
        plan: The day's template.
        draws: Its random draws.
        wake: When it begins [s since its midnight].
        next_wake: When the next day begins [s since its midnight].
        busy: When the rooms that only one can use are in use by others; None: never.

    Returns:
        What is done from `wake` to `next_wake`, without a gap.
    """
    chain = _feasible_chain(plan, draws, wake, next_wake)
    day: list[Doing] = []
    now = wake
    for i, job in enumerate(chain.jobs):
        end_by = min(job.until, chain.latest[i + 1])
        begin = min(_next_begin(job, now, chain.wished[i]), chain.latest[i])
        room = ANY_ROOM
        if busy is not None and (job.exclusive or job.activity in busy.rooms):
            free = busy.free(job.activity, begin, chain.latest[i], job.takes.shortest, end_by)
            if free is None:  # others are in there all the time: the day goes on without
                continue
            begin, end_by, room = free
        end = begin + job.takes.draw(draws, None, end_by - begin)
        _fill(plan.fills, day, draws, now, begin)
        day.append(Doing(job.activity, begin, end, job.task, room))
        now = end
    bed = min(max(now, chain.wished[-1]), chain.latest[-1])
    bed = now if bed - now < NO_GAP_S and now >= plan.sleep.shortest else bed
    _fill(plan.fills, day, draws, now, bed)
    day.append(Doing(SLEEP, bed, next_wake))
    return day


def _next_begin(job: Job, now: int, wished: int) -> int:
    """Return when a job would begin: as wished, and at once rather than after a short wait."""
    begin = max(now, wished)
    at_once = begin - now < NO_GAP_S and (job.starts is None or job.starts.shortest <= now)
    return now if at_once else begin


def _feasible_chain(plan: DayPlan, draws: Draws, wake: int, next_wake: int) -> Chain:
    """Draw what is done and in which order until it fits."""
    chosen = {i for i, job in enumerate(plan.jobs) if draws.below(MILLION) < job.chance}
    tries = 0
    while True:
        chain = draw_chain(plan, draws, chosen, wake, next_wake, tries % ORDERS == ORDERS - 1)
        if fits(plan, chain, wake):
            return chain
        tries += 1
        if tries % ORDERS == 0:
            left_out = _least_needed(plan.jobs, chosen)
            if left_out is None:
                raise RuntimeError(f"no order of the tasks of day {plan.name!r} fits")
            chosen.remove(left_out)


def _least_needed(jobs: Sequence[Job], chosen: Collection[int]) -> int | None:
    """Return the job to leave out first: done on the fewest days, of equal ones the last."""
    return min(
        (i for i in chosen if not jobs[i].needed), key=lambda i: (jobs[i].chance, -i), default=None
    )


def draw_chain(
    plan: DayPlan,
    draws: Draws,
    chosen: Collection[int],
    wake: int,
    next_wake: int,
    by_deadline: bool = False,
) -> Chain:
    """Order the chosen jobs by the times at which they would like to begin.

    Args:
        plan: The day's template.
        draws: Its random draws.
        chosen: The jobs to do, by index.
        wake: When the day begins [s].
        next_wake: When the next one begins [s].
        by_deadline: Order them by the latest times at which they may begin instead.
    """
    latest_bed = min(plan.sleep.longest, next_wake - plan.least_sleep)
    bed = plan.sleep.draw(draws, None, latest_bed)
    wished: dict[int, int] = {}
    ranks: dict[int, tuple[int, int, int]] = {}  # part of the day, time, index
    for i, job in enumerate(plan.jobs):
        before = [k for k in job.after if k in wished]
        if i not in chosen or (job.follows and not before):
            continue
        part, wish = job.place, wake
        if job.starts is not None:
            wish = job.starts.draw(draws)
        elif job.place > 0:
            wish = bed - job.takes.knots[len(job.takes.knots) // 2]
        elif before:
            part = -1
        wished[i] = max([wish, *(wished[k] for k in before)])
        rank = job.starts.longest if by_deadline and job.starts is not None else wish
        ranks[i] = (
            max([part, *(ranks[k][0] for k in before)]),
            max([rank, *(ranks[k][1] for k in before)]),
            i,
        )
    order = sorted(wished, key=lambda i: ranks[i])
    jobs = [plan.jobs[i] for i in order]
    return Chain(jobs, [*(wished[i] for i in order), bed], _latest(jobs, latest_bed))


def _latest(jobs: Sequence[Job], bed: int) -> list[int]:
    """Return how late each job may begin so that the rest still fits before `bed`; that last."""
    latest = [bed]
    for job in reversed(jobs):
        last = min(job.until, latest[-1]) - job.takes.shortest
        latest.append(last if job.starts is None else min(last, job.starts.longest))
    return latest[::-1]


def fits(plan: DayPlan, chain: Chain, wake: int) -> bool:
    """Tell whether every job of a chain can begin as late as it has to, in a day from `wake`."""
    earliest = wake
    for job, last in zip(chain.jobs, chain.latest, strict=False):
        if job.starts is not None:
            earliest = max(earliest, job.starts.shortest)
        if earliest > last:
            return False
        earliest += job.takes.shortest
    return max(earliest, plan.sleep.shortest) <= chain.latest[-1]


def _fill(fills: Sequence[Fill], day: list[Doing], draws: Draws, begin: int, end: int) -> None:
    """Fill the time from `begin` to `end` with pastimes; with rest where none fits."""
    while begin < end:
        last = day[-1].activity if day else ""
        options = [
            fill
            for fill in fills
            if fill.first <= begin <= fill.last
            and fill.takes.shortest <= end - begin
            and fill.activity != last
        ]
        if not options:
            over = min(end, begin + NO_GAP_S)
            if last == REST and not day[-1].task:
                day[-1] = day[-1]._replace(end=over)
            else:
                day.append(Doing(REST, begin, over))
            begin = over
            continue
        fill = options[weighted(draws, [fill.weight for fill in options])]
        over = begin + fill.takes.draw(draws, None, end - begin)
        if end - over < NO_GAP_S and end - begin <= fill.takes.longest:
            over = end
        day.append(Doing(fill.activity, begin, over))
        begin = over
