"""The stays and activities of a body: sums of a run by room, activity, hour or day."""

from collections.abc import Iterator
from datetime import datetime, timedelta
from itertools import groupby, pairwise
from typing import Any, Literal, NamedTuple

import numpy as np

from fleet2d.configuration.problems import check_known
from fleet2d.errors import InputError
from fleet2d.runs.run import Run

By = Literal["room", "activity", "hour", "day"]
AWAY = "away"
_LONGEST_FIRST = ("room", "activity")


class Stay(NamedTuple):
    """A stay: in a room, or during an activity, without a break."""

    what: str
    begin: int  # steps
    end: int

    @property
    def steps(self) -> int:
        """The length [steps]."""
        return self.end - self.begin


def stays_of(run: Run, who: str, what: Literal["room", "activity"]) -> list[Stay]:
    """Return the stays of a person or robot, in order of time.

    Raises:
        ArtifactError: The run stored no key frames, or there is nobody of that name.
    """
    if what == "activity":
        return _activities(run, who)
    path = run.path(who, timedelta(microseconds=run.clock.step_us))
    names = [room.name for room in run.plan.rooms]
    room = np.where(path.away, len(names), path.room)
    begins = np.flatnonzero(np.diff(room, prepend=-2)).tolist()
    words = [*names, AWAY, "between rooms"]
    return [Stay(words[room[begin]], begin, end) for begin, end in pairwise([*begins, len(room)])]


def _activities(run: Run, who: str) -> list[Stay]:
    events = run.tables["events"].select(["step", "entity", "event", "detail"]).to_pylist()
    own = [e for e in events if e["entity"] == who and e["event"] == "activity"]
    begins = [event["step"] for event in own]
    ends = [*begins[1:], run.clock.steps]
    rows = zip(own, begins, ends, strict=True)
    return [Stay(event["detail"], begin, end) for event, begin, end in rows]


def summary(run: Run, who: str, by: By = "room", of: str = "") -> list[dict[str, Any]]:
    """Return sums of a run, a row for each room, activity, hour of the day, or day.

    Args:
        run: A run with key frames.
        who: A person or robot.
        by: The unit of a row.
        of: The room or activity that is summed by hour or day; a kind of room counts all of it.

    Returns:
        For rooms and activities: hours, number of stays, first begin, last end, the longest stay in
        hours and its begin. For hours and days: the share of the hour, or hours of the day.

    Raises:
        InputError: There is nobody, no room and no activity of that name.
        ArtifactError: The run stored no key frames.
    """
    scenario = run.manifest["scenario"]
    bodies = [*scenario["users"], *scenario["robots"]]
    check_known(who, "person or robot", bodies, InputError)
    if by in _LONGEST_FIRST:
        return _by_name(run, stays_of(run, who, by))  # type: ignore[arg-type]
    chosen = _chosen(run, who, of)
    return list(_by_hour(run, chosen) if by == "hour" else _by_day(run, chosen))


def _by_name(run: Run, stays: list[Stay]) -> list[dict[str, Any]]:
    rows = []
    by_name = sorted(stays, key=lambda stay: stay.what)  # the sort keeps the order of time
    for what, group in groupby(by_name, key=lambda stay: stay.what):
        own = list(group)
        longest = max(own, key=lambda stay: stay.steps)
        row = {
            "name": what,
            "hours": _hours(run, sum(stay.steps for stay in own)),
            "stays": len(own),
            "first": _time(run, own[0].begin),
            "last": _time(run, own[-1].end),
            "longest_hours": _hours(run, longest.steps),
            "longest_from": _time(run, longest.begin),
        }
        rows.append(row)
    return sorted(rows, key=lambda row: -row["hours"])


def _chosen(run: Run, who: str, of: str) -> list[Stay]:
    """Return the stays in a room, or in rooms of a kind, or of an activity.

    Raises:
        InputError: There is no room or activity of that name.
    """
    if not of:
        raise InputError("name a room, a kind of room or an activity by `of`, or 'away'")
    rooms = {room.name for room in run.plan.rooms if of in (room.name, room.type)}
    if of == AWAY:
        rooms = {AWAY}
    if rooms:
        return [stay for stay in stays_of(run, who, "room") if stay.what in rooms]
    activities = stays_of(run, who, "activity")
    known = [room.name for room in run.plan.rooms]
    known += [stay.what for stay in activities]
    check_known(of, "room or activity", list(dict.fromkeys([*known, AWAY])), InputError)
    return [stay for stay in activities if stay.what == of]


def _by_hour(run: Run, stays: list[Stay]) -> Iterator[dict[str, Any]]:
    """Yield each hour of the day with the share of it in such stays, over all days."""
    inside = np.zeros(run.clock.steps, bool)
    for stay in stays:
        inside[stay.begin : stay.end] = True
    start = run.clock.start
    since = (start - start.replace(hour=0, minute=0, second=0, microsecond=0)).total_seconds()
    seconds = since + np.arange(run.clock.steps) * (run.clock.step_us / 1e6)
    hours = (seconds // 3600 % 24).astype(np.int64)
    spent = np.bincount(hours, inside, 24)
    passed = np.bincount(hours, minlength=24)
    for hour in np.flatnonzero(passed).tolist():
        yield {"hour": hour, "share": round(float(spent[hour] / passed[hour]), 4)}


def _by_day(run: Run, stays: list[Stay]) -> Iterator[dict[str, Any]]:
    """Yield each day with the hours in such stays, and their first and last moment."""
    pieces: dict[str, list[Stay]] = {}
    for stay in stays:
        begin = stay.begin
        while begin < stay.end:
            day = run.clock.time(begin).date()
            midnight = datetime.combine(day + timedelta(days=1), datetime.min.time())
            end = min(stay.end, run.clock.step_at_or_after(run.clock.elapsed(midnight)))
            piece = Stay(stay.what, begin, end)
            pieces.setdefault(day.isoformat(), []).append(piece)
            begin = end
    for name, own in pieces.items():
        yield {
            "day": name,
            "hours": _hours(run, sum(piece.steps for piece in own)),
            "stays": len(own),
            "first": _time(run, own[0].begin),
            "last": _time(run, own[-1].end),
        }


def _hours(run: Run, steps: int) -> float:
    return round(steps * run.clock.step_us / 3.6e9, 3)


def _time(run: Run, step: int) -> str:
    return run.clock.time(step).isoformat(sep=" ")
