"""The planner of days: draws a random day that satisfies all constraints of a template.

A day lasts from waking to the next waking. It is a chain of jobs in a drawn order. With windows for
their begins and bounds on their durations, it is a simple temporal network, which two passes solve:
forward for the earliest begins, backward for the latest. Begins and durations are then drawn in
order, within the bounds of the backward pass, so that no draw makes the rest impossible. (Similar
to Idrees, Singh, Xu and Glas: "A Framework for Realistic Simulation of Daily Human Activity", 2023,
arXiv 2311.15400, who propagate constraints both ways through a day.)

If the jobs of a day don't fit, another order is drawn, a few times; then one job is left out: of
those that aren't needed every day, the one that is done on the fewest days.
"""

from collections.abc import Callable, Collection, Sequence
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

from fleet2d.kernels.motion import DayPlanner
from fleet2d.routines.laws import Law, draw_weighted
from fleet2d.routines.occupancy import ANY_ROOM, Occupancy
from fleet2d.runtime.determinism import Draws

if TYPE_CHECKING:
    from fleet2d.routines.recorded import Recording

DAY_S = 86_400
ORDERS = 5  # drawn before a job is left out
# A gap shorter than this is not filled: the next doing begins at once [s].
NO_GAP_S = 300
MILLION = 1_000_000
NEVER = 1 << 40  # later than any time [s]
PLANNED, INTERRUPTS, RESUMES, FINISHES = 0, 1, 2, 3
REST = "rest"
SLEEP = "sleep"


class Doing(NamedTuple):
    """A part of a day in which one activity is done.

    Attributes:
        activity: The activity.
        begin: Its beginning [s since the midnight of the day's date].
        end: Its end, which is the beginning of the next doing.
        task: The template's task; empty for pastimes and sleep.
        room: The index of its room, if its household has chosen one; else -1.
        role: PLANNED, or of an interruption: INTERRUPTS a planned doing, RESUMES it afterwards, or
            FINISHES it, so that it isn't resumed.
    """

    activity: str
    begin: int
    end: int
    task: str = ""
    room: int = ANY_ROOM
    role: int = PLANNED


# Makes a doing from a tuple of its fields without calling Python code, as days have many.
new_doing: Callable[[tuple[str, int, int, str, int, int]], Doing] = partial(tuple.__new__, Doing)


class Job(NamedTuple):
    """A task in the form that the planner uses; times in seconds since the day's midnight.

    Attributes:
        task: The name of the task.
        activity: Its activity.
        starts: The law of its beginning; None: right after the job before it,
            on waking or before bed.
        takes: The law of its duration.
        until: Its latest end.
        after: The indices of the jobs before it, all lower than its own.
        chance: Its probability on a day [per million].
        needed: Whether it must not be left out if a day is too full.
        exclusive: Whether it needs a room that no other member of the household uses.
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
        """Whether it begins right after another job."""
        return self.starts is None and self.place == 0


class Fill(NamedTuple):
    """A pastime in the form that the planner uses; it may begin from `first` to `last` [s]."""

    activity: str
    weight: int
    takes: Law
    first: int
    last: int


class DayPlan(NamedTuple):
    """A template in the form that the planner uses; with `recorded` days, new ones resemble those.

    Attributes:
        name: The name of the template.
        wake: The law of waking [s].
        sleep: The law of going to bed [s].
        least_sleep: The least duration of sleep [s].
        jobs: The tasks.
        fills: The pastimes.
        recorded: The recorded days, if the template has some.
        core: The same plan by numbers of activities, for days in which nobody else uses private
            rooms; None: there is none.
        names: The activities by number.
    """

    name: str
    wake: Law
    sleep: Law
    least_sleep: int
    jobs: tuple[Job, ...]
    fills: tuple[Fill, ...]
    recorded: "Recording | None" = None
    core: DayPlanner | None = None
    names: tuple[str, ...] = ()

    def in_core(self) -> "DayPlan":
        """Return the plan with what draws days in the core."""
        if any(fill.takes.shortest < 1 for fill in self.fills):
            return self._replace(core=None)
        activities = [*(job.activity for job in self.jobs), *(fill.activity for fill in self.fills)]
        names = tuple(dict.fromkeys((REST, SLEEP, *activities)))
        number = {name: number for number, name in enumerate(names)}
        jobs = [
            (
                number[job.activity], job.starts, job.takes, job.until, job.after, job.chance,
                job.needed, job.place,
            )
            for job in self.jobs
        ]  # fmt: skip
        fills = [(number[f.activity], f.weight, f.takes, f.first, f.last) for f in self.fills]
        core = DayPlanner(self.sleep, self.least_sleep, jobs, fills, number[REST], number[SLEEP])
        return self._replace(core=core, names=names)


class Chain(NamedTuple):
    """Jobs in order, with sleep as an additional last one in `preferred` and `latest`.

    Attributes:
        jobs: The jobs.
        preferred: The drawn beginning of each [s].
        latest: The latest possible beginning of each [s].
    """

    jobs: list[Job]
    preferred: list[int]
    latest: list[int]


def plan_day(
    plan: DayPlan, draws: Draws, wake: int, next_wake: int, occupancy: Occupancy | None = None
) -> list[Doing]:
    """Draw a day.

    Args:
        plan: The plan of the day's template.
        draws: The day's random draws.
        wake: When the day begins [s since its midnight].
        next_wake: When the next day begins [s since its midnight].
        occupancy: When others use private rooms; None: never.

    Returns:
        The doings from `wake` to `next_wake`, without a gap.
    """
    if occupancy is None and plan.core is not None:
        rows = plan.core.plan(draws, wake, next_wake)
        if not rows:
            raise _too_full(plan)
        return [
            new_doing((plan.names[activity], begin, end, _task(plan, job), ANY_ROOM, PLANNED))
            for activity, begin, end, job in rows
        ]
    chain = _feasible_chain(plan, draws, wake, next_wake)
    day: list[Doing] = []
    now = wake
    for i, job in enumerate(chain.jobs):
        end_by = min(job.until, chain.latest[i + 1])
        begin = min(_next_begin(job, now, chain.preferred[i]), chain.latest[i])
        room = ANY_ROOM
        if occupancy is not None and (job.exclusive or job.activity in occupancy.rooms):
            shortest = job.takes.shortest
            slot = occupancy.free(job.activity, begin, chain.latest[i], shortest, end_by)
            if slot is None:  # others use its rooms all the time: it is left out
                continue
            begin, end_by, room = slot
        end = begin + job.takes.draw(draws, None, end_by - begin)
        _fill(plan.fills, day, draws, now, begin)
        day.append(Doing(job.activity, begin, end, job.task, room))
        now = end
    bed = min(max(now, chain.preferred[-1]), chain.latest[-1])
    bed = now if bed - now < NO_GAP_S and now >= plan.sleep.shortest else bed
    _fill(plan.fills, day, draws, now, bed)
    day.append(Doing(SLEEP, bed, next_wake))
    return day


def _task(plan: DayPlan, job: int) -> str:
    """Return the name of a job by its number; none below 0."""
    return plan.jobs[job].task if job >= 0 else ""


def _too_full(plan: DayPlan) -> RuntimeError:
    return RuntimeError(
        f"the tasks of day {plan.name!r} fit in no order between waking and bedtime:"
        " shorten some, widen their times, or give some a probability below 1"
    )


def _next_begin(job: Job, now: int, preferred: int) -> int:
    """Return when a job begins: at the preferred time, or `now` if that is a little earlier."""
    begin = max(now, preferred)
    is_soon = begin - now < NO_GAP_S and (job.starts is None or job.starts.shortest <= now)
    return now if is_soon else begin


def _feasible_chain(plan: DayPlan, draws: Draws, wake: int, next_wake: int) -> Chain:
    """Draw jobs and their order, until they fit into the day."""
    chosen = {i for i, job in enumerate(plan.jobs) if draws.below(MILLION) < job.chance}
    tries = 0
    while True:
        chain = draw_chain(plan, draws, chosen, wake, next_wake, tries % ORDERS == ORDERS - 1)
        if fits(plan, chain, wake):
            return chain
        tries += 1
        if tries % ORDERS == 0:
            job = _least_needed(plan.jobs, chosen)
            if job is None:
                raise _too_full(plan)
            chosen.remove(job)


def _least_needed(jobs: Sequence[Job], chosen: Collection[int]) -> int | None:
    """Return the index of the job to leave out: the least probable, of equal ones the last."""
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
    """Draw preferred begins of the chosen jobs, and order the jobs by them.

    Args:
        plan: The plan of the day's template.
        draws: The day's random draws.
        chosen: The indices of the jobs to do.
        wake: When the day begins [s].
        next_wake: When the next day begins [s].
        by_deadline: Order them by their latest begins instead.
    """
    latest_bed = min(plan.sleep.longest, next_wake - plan.least_sleep)
    bed = plan.sleep.draw(draws, None, latest_bed)
    preferred: dict[int, int] = {}
    ranks: dict[int, tuple[int, int, int]] = {}  # part of the day, time, index
    for i, job in enumerate(plan.jobs):
        before = [k for k in job.after if k in preferred]
        if i not in chosen or (job.follows and not before):
            continue
        part, begin = job.place, wake
        if job.starts is not None:
            begin = job.starts.draw(draws)
        elif job.place > 0:
            begin = bed - job.takes.knots[len(job.takes.knots) // 2]
        elif before:
            part = -1
        preferred[i] = max([begin, *(preferred[k] for k in before)])
        rank = job.starts.longest if by_deadline and job.starts is not None else begin
        ranks[i] = (
            max([part, *(ranks[k][0] for k in before)]),
            max([rank, *(ranks[k][1] for k in before)]),
            i,
        )
    order = sorted(preferred, key=lambda i: ranks[i])
    jobs = [plan.jobs[i] for i in order]
    return Chain(jobs, [*(preferred[i] for i in order), bed], _latest(jobs, latest_bed))


def _latest(jobs: Sequence[Job], bed: int) -> list[int]:
    """Return the latest begin of each job so that all later ones fit before `bed`, and `bed`."""
    latest = [bed]
    for job in reversed(jobs):
        last = min(job.until, latest[-1]) - job.takes.shortest
        latest.append(last if job.starts is None else min(last, job.starts.longest))
    return latest[::-1]


def fits(plan: DayPlan, chain: Chain, wake: int) -> bool:
    """Return whether all jobs of a chain fit into a day that begins at `wake`."""
    earliest = wake
    for job, last in zip(chain.jobs, chain.latest, strict=False):
        if job.starts is not None:
            earliest = max(earliest, job.starts.shortest)
        if earliest > last:
            return False
        earliest += job.takes.shortest
    return max(earliest, plan.sleep.shortest) <= chain.latest[-1]


def _fill(fills: Sequence[Fill], day: list[Doing], draws: Draws, begin: int, end: int) -> None:
    """Fill the time from `begin` to `end` with pastimes, and with rest where no pastime fits."""
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
        fill = options[draw_weighted(draws, [fill.weight for fill in options])]
        over = begin + fill.takes.draw(draws, None, end - begin)
        if end - over < NO_GAP_S and end - begin <= fill.takes.longest:
            over = end
        day.append(Doing(fill.activity, begin, over))
        begin = over
