"""What every planned day must keep, checked straight from the template and not by the planner."""

from datetime import date
from itertools import pairwise

from fleet2d.routines.interruptions import without_interruptions
from fleet2d.routines.templates import REACH

DAY_S = 86_400
MONDAY = date(2026, 1, 5).toordinal()


def violations(persona, ordinal, day, next_day):
    """Say in words what a day breaks, needs and errands left out."""
    day = without_interruptions(day)
    template = persona.days[persona.day(date.fromordinal(ordinal))]
    faults = [f"gap or overlap before {b}" for a, b in pairwise(day) if a.end != b.begin]
    faults += [f"{episode} takes no time" for episode in day if episode.end <= episode.begin]
    if day[-1].end != next_day[0].begin + DAY_S:
        faults.append("the next day doesn't follow")
    if "sleep" != day[-1].activity:
        faults.append("it doesn't end asleep")
    faults += _outside("wake", template.wake, day[0].begin)
    faults += _outside("sleep", template.sleep, day[-1].begin)
    if day[-1].end - day[-1].begin < template.sleep.at_least.total_seconds():
        faults.append("too short a night")
    return faults + _broken_tasks(persona, template, day)


def _broken_tasks(persona, template, day):
    faults = []
    at = {episode.task: episode for episode in day if episode.task}
    if len(at) != sum(1 for episode in day if episode.task):
        faults.append("a task is done twice")
    for name, task in template.do.items():
        if name not in at:
            if task.fixed or (task.probability == 1 and not task.after):
                faults.append(f"{name} is left out")
            continue
        episode = at[name]
        faults += _outside(name, task, episode.begin)
        takes = task.takes or persona.activity(task.activity or name).takes
        lasts = episode.end - episode.begin
        if takes.at_least is not None and lasts < takes.at_least.total_seconds():
            faults.append(f"{name} is too short")
        if takes.at_most is not None and lasts > takes.at_most.total_seconds():
            faults.append(f"{name} is too long")
        if task.until is not None:
            until = task.until.total_seconds()
            if episode.end > until + DAY_S * (until < day[0].begin - 3600):
                faults.append(f"{name} ends after {task.until}")
        faults += [
            f"{name} before {o}" for o in task.after if o in at and at[o].end > episode.begin
        ]
    return faults


def _outside(name, timing, begin):
    at, between = timing.at, timing.between
    if between is not None:
        first, last = (t.total_seconds() for t in between)
        last += DAY_S * (last < first)
    elif at is not None:
        reach = 0 if getattr(timing, "fixed", False) else REACH * timing.spread.total_seconds()
        first, last = at.total_seconds() - reach, at.total_seconds() + reach
    else:
        return []
    inside = any(first <= begin - shift <= last for shift in (0, DAY_S, -DAY_S))
    return [] if inside else [f"{name} begins at {begin}, outside {first} to {last}"]
