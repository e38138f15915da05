"""Plans of the templates of a persona, in the form of the planner, and checks that they work."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from fleet2d.configuration.problems import problem_at
from fleet2d.routines.activity import seconds
from fleet2d.routines.distributions import Distribution, normal, uniform
from fleet2d.routines.planner import MILLION, NEVER, DayPlan, Job, PastimeOption, to_recording
from fleet2d.runtime.clock import DAY_S
from fleet2d.runtime.determinism import Draws

if TYPE_CHECKING:
    from datetime import timedelta

    from fleet2d.routines.persona import DayTemplate, Pastime, Persona, Task, Timing

# Half the width of a window that isn't given, in standard deviations.
REACH = 2.5
# The number of orders that are tried before a template is refused.
TRIALS = 60


def clock(time_s: int) -> str:
    """Format a time since midnight as 'HH:MM', with the number of days if it isn't the same day.

    >>> clock(27_000), clock(90_000)
    ('07:30', '01:00 on the next day')
    """
    days, rest = divmod(time_s, DAY_S)
    text = f"{rest // 3600:02}:{rest // 60 % 60:02}"
    if not days:
        return text
    return f"{text} on the next day" if days == 1 else f"{text} {days} days on"


def span(time_s: int) -> str:
    """Format a duration in hours and minutes.

    >>> span(5400), span(300)
    ('1 h 30 min', '5 min')
    """
    hours, minutes = divmod(-(-time_s // 60), 60)
    return " ".join([f"{hours} h"] * (hours > 0) + [f"{minutes} min"] * (minutes > 0 or not hours))


def day_plans(persona: "Persona", days: "Mapping[str, DayTemplate]") -> dict[str, DayPlan]:
    """Return the plans of some templates, by the template's name."""
    return {name: _day_plan(persona, name, day) for name, day in days.items()}


def _day_plan(persona: "Persona", name: str, day: "DayTemplate") -> DayPlan:
    if day.recorded:
        wakes = [recorded.begins[0] for recorded in day.recorded]
        beds = [recorded.begins[-1] for recorded in day.recorded]
        wake = uniform(min(wakes), max(wakes))
        sleep = uniform(min(beds), max(beds))
        return DayPlan(name, wake, sleep, 0, (), (), to_recording(day.recorded))
    wake = starts(day.wake, 0)
    dawn = wake.shortest
    sleep = starts(day.sleep, dawn)
    order = in_order(day.do)
    jobs = tuple(_job(persona, task, day.do[task], order, dawn) for task in order)
    leisure = persona.leisure if day.leisure is None else day.leisure
    pastimes = tuple(
        _pastime(persona, name, activity, pastime, dawn) for activity, pastime in leisure.items()
    )
    return DayPlan(name, wake, sleep, seconds(day.sleep.at_least), jobs, pastimes)


def in_order(tasks: dict[str, "Task"]) -> list[str]:
    """Return the names of the tasks of a day, each after those that come before it.

    Raises:
        ValidationError: Some wait for each other.
    """
    order: list[str] = []
    while len(order) < len(tasks):
        ready = [n for n, t in tasks.items() if n not in order and set(t.after) <= set(order)]
        if not ready:
            waiting = ", ".join(name for name in tasks if name not in order)
            raise problem_at(("do",), f"these tasks wait for each other: {waiting}")
        order += ready
    return order


def _job(persona: "Persona", name: str, task: "Task", order: list[str], dawn: int) -> Job:
    activity = persona.activity(task.activity or name)
    place = int(task.before_bed) - int(task.on_waking)
    has_time = task.at is not None or task.between is not None
    begin = None if place or (task.after and not has_time) else starts(task, dawn)
    if task.fixed and task.at is not None:
        begin = uniform(seconds_of_day(task.at, dawn), seconds_of_day(task.at, dawn))
    return Job(
        task=name,
        activity=task.activity or name,
        starts=begin,
        takes=(task.takes or activity.takes).table(),
        until=NEVER if task.until is None else seconds_of_day(task.until, dawn),
        after=tuple(sorted(order.index(other) for other in task.after)),
        chance=round(task.probability * MILLION),
        needed=task.fixed or task.probability == 1,
        exclusive=activity.exclusive,
        place=place,
    )


def _pastime(
    persona: "Persona", day: str, activity: str, pastime: "Pastime", dawn: int
) -> PastimeOption:
    first, last = (0, NEVER) if pastime.between is None else window(pastime.between, dawn)
    takes = persona.activity(activity).takes.table()
    if takes.shortest < 1 and takes.longest < 2:  # time would stand still
        own = day in persona.days and persona.days[day].leisure is not None
        inside = ("days", day, "leisure") if own else ("leisure",)
        raise problem_at((*inside, activity), f"{activity!r} may take 0 s: let it take a second")
    return PastimeOption(activity, max(1, round(pastime.weight * 1000)), takes, first, last)


def starts(timing: "Timing", dawn: int) -> Distribution:
    """Return the distribution of the time at which an activity begins [s since midnight].

    The day begins at `dawn` or later.
    """
    first, last = (dawn, dawn + DAY_S) if timing.between is None else window(timing.between, dawn)
    if timing.at is None:
        return uniform(first, last)
    spread = seconds(timing.spread)
    at = seconds_of_day(timing.at, first)
    if timing.between is None:
        reach = int(REACH * spread)
        first = max(at - reach, 0)
        last = at + reach
    begin = normal(at, spread) if spread else uniform(at, at)
    return begin.within(first, last)


def window(between: "tuple[timedelta, timedelta]", dawn: int) -> tuple[int, int]:
    """Return a window of times of day [s]; one that ends before it begins lasts past midnight."""
    first = seconds_of_day(between[0], dawn)
    return first, first + seconds(between[1] - between[0]) % DAY_S


def seconds_of_day(time: "timedelta", dawn: int) -> int:
    """Return a time of day [s]; one before `dawn` belongs to the next date."""
    at = seconds(time)
    return at + DAY_S if at < dawn else at


def check(persona: "Persona") -> None:
    """Check that the days of a persona are possible, for all random draws.

    The worst day begins as late as possible, and the day after it as early as possible.

    Raises:
        ValidationError: A template is impossible; the message names the tasks in conflict.
    """
    plans = persona.plans
    for name, plan in plans.items():
        if plan.recorded is not None:  # recorded days are possible
            continue
        _check_appointments(name, plan)
        next_wake = DAY_S + min(plans[n].wake.shortest for n in _plans_after(persona, name))
        if next_wake - plan.min_sleep < plan.sleep.shortest:
            raise problem_at(
                ("days", name, "sleep"),
                f"sleep begins at {clock(plan.sleep.shortest)} at the earliest, lasts"
                f" {span(plan.min_sleep)} at least, and the next day may begin at"
                f" {clock(next_wake)}: that is too short a night",
            )
        _check_room(name, plan, next_wake)


def _plans_after(persona: "Persona", name: str) -> set[str]:
    """Return the plans of days that may follow one of them, the events of the year included."""
    after = {event.days for event in persona.year.values() if event.days is not None}
    own = set(persona.days) if name in after else set[str]()
    for change, event in persona.year.items():
        if event.becomes is not None:
            plans = {f"{change}.{day}" for day in event.becomes.plans}
            after |= plans
            if name in plans:
                own = set() if event.lasts is None else set(persona.days)
                break
    else:
        own = own or _days_after(persona, name)
    return after | own


def _days_after(persona: "Persona", name: str) -> set[str]:
    """Return the templates of days that may follow one: by weekday; all if any has dates."""
    days = persona.days
    if any(day.dates for day in days.values()):
        return set(days)
    of_week = [""] * 7
    for each, day in days.items():  # a later one precedes
        for weekday in day.weekdays:
            of_week[weekday] = each
    after = {of_week[(i + 1) % 7] for i in range(7) if of_week[i] == name}
    return after or {name}


def _check_appointments(name: str, plan: DayPlan) -> None:
    """Refuse fixed appointments that overlap."""
    fixed = sorted(
        (job.starts.shortest, job.task, job.takes.shortest)
        for job in plan.jobs
        if job.starts is not None and job.needed and job.starts.shortest == job.starts.longest
    )
    for (begin, task, takes), (after, other, _) in pairwise(fixed):
        if begin + takes > after:
            raise problem_at(
                ("days", name, "do", other),
                f"{other!r} begins at {clock(after)}, but {task!r} begins at {clock(begin)} and"
                f" takes {span(takes)} at least: they overlap",
            )


def _check_room(name: str, plan: DayPlan, next_wake: int) -> None:
    """Refuse a template whose needed tasks don't fit in the shortest day."""
    needed = [job.needed for job in plan.jobs]
    wake = plan.wake.longest
    key = np.uint64(0)
    first: tuple[list[int], list[int]] | None = None
    for trial in range(TRIALS):
        order, latest, fits = plan.core.draw_order(
            Draws(key, trial), needed, wake, next_wake, trial == 0
        )
        if fits:
            return
        first = first or (order, latest)
    assert first is not None
    key_path, message = _conflict([plan.jobs[i] for i in first[0]], first[1], wake)
    raise problem_at(("days", name, *key_path), message)


def _conflict(jobs: Sequence[Job], latest: Sequence[int], wake: int) -> tuple[tuple[str, ...], str]:
    """Return the key of the first impossible one of some jobs, and a message with the reason.

    Args:
        jobs: The jobs in order.
        latest: The latest beginning of each, and of going to bed [s].
        wake: When the day begins [s].
    """
    names = [*(job.task for job in jobs), "sleep"]
    now = wake
    for i, job in enumerate(jobs):
        now = now if job.starts is None else max(now, job.starts.shortest)
        if now > latest[i]:
            # the first job from here on whose own window limits its beginning
            until = i
            takes = 0
            while latest[until] == latest[until + 1] - jobs[until].takes.shortest:
                takes += jobs[until].takes.shortest
                until += 1
                if until == len(jobs):
                    break
            path = ("do", job.task)
            day = f"on a day that begins at {clock(wake)}"
            if until == i:
                return path, (
                    f"{job.task!r} has to begin by {clock(latest[i])}, but what comes before"
                    f" it is over at {clock(now)} at the earliest, {day}"
                )
            between = " and ".join(repr(name) for name in names[i:until])
            return path, (
                f"{day} {job.task!r} can begin at {clock(now)} at the earliest, and {between}"
                f" {'takes' if until == i + 1 else 'take'} {span(takes)} at least, but"
                f" {names[until]!r} has to begin by {clock(latest[until])}: widen a window,"
                " shorten what is done, or give a task a probability below 1"
            )
        now += job.takes.shortest
    return ("sleep",), (
        f"what has to be done in the day takes until {clock(now)}, but sleep begins at"
        f" {clock(latest[-1])} at the latest"
    )
