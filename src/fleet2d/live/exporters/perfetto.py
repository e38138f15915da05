"""A run as trace events for Perfetto: a process for each body, with its tracks.

The format is the JSON of Chrome's Trace Event Format, which https://ui.perfetto.dev opens: objects
with `ph` (X: a slice of duration `dur`, i: an instant, C: a counter, M: a name), `ts` [us], `pid`,
`tid`, `name` and `args`.
"""

import json
from collections.abc import Iterable, Iterator, Mapping
from itertools import groupby, pairwise
from pathlib import Path
from typing import Any, NamedTuple

from fleet2d.engine.repeat import decisions_of
from fleet2d.errors import Fleet2DError, InputError
from fleet2d.interactions.interaction import OUTCOMES
from fleet2d.live.exporters import Records, Selection, new_file, words_of
from fleet2d.runs.robot_log import Move, decision_text, moves_of, rows_of
from fleet2d.runs.run import Run
from fleet2d.runtime.events import EventKind

TRACKS = ("plan", "motion", "people", "sight", "power", "events")
"""The tracks of a body, in order; the thread of each is its place, from 1 on."""

# Events that begin a slice of a track, and that end it; the next slice of the track also ends it.
_ANSWERED = frozenset({*OUTCOMES, EventKind.WITHDRAWS, EventKind.BROKEN_OFF, EventKind.DELIVERED})
_SLICES: Mapping[str, tuple[str, frozenset[str]]] = {
    EventKind.ACTIVITY: ("plan", frozenset({EventKind.LEFT_HOME})),
    EventKind.LEFT_HOME: ("plan", frozenset({EventKind.CAME_HOME, EventKind.ACTIVITY})),
    EventKind.ASKS: ("people", _ANSWERED),
    EventKind.INTERACTS: ("people", frozenset({EventKind.INTERACTION_OVER})),
    EventKind.FIND_BEGINS: (
        "people",
        frozenset({EventKind.FOUND, EventKind.GAVE_UP, EventKind.NOT_AT_HOME}),
    ),
    EventKind.POWER_OFF: ("power", frozenset({EventKind.POWER_ON})),
}
_CHARGES = frozenset({EventKind.BATTERY, EventKind.DOCKS, EventKind.CHARGED})


class Slice(NamedTuple):
    """A stretch of steps on a track of a body, with a name and arguments."""

    track: str
    first: int
    end: int
    name: str
    args: Mapping[str, Any]


def export_perfetto(run: Run, path: Path, part: Selection) -> str:
    """Write plans, moves, people in view, interactions, power, events and battery of each body.

    Plans of robots come from the table of decisions; for a run that didn't store it, the run is
    repeated. Times are microseconds since the start of the run.

    Args:
        run: A run with events.
        path: The file to write.
        part: The part of the run.

    Returns:
        A line with the number of trace events.

    Raises:
        InputError: The run stored no events.
        RunDirectoryError: The file can't be written.
    """
    if "events" not in run.tables:
        raise InputError("the run stored no events: run it with artifacts.events=true")
    decisions = None
    note = ""
    try:
        decisions = run.tables["decisions"] if "decisions" in run.tables else decisions_of(run)
    except Fleet2DError as error:
        note = f"; without plans, as the run can't be repeated: {error}"
    count = 0
    start = run.clock.start.isoformat()
    head = {"displayTimeUnit": "ms", "otherData": {"start": start, "clock": "us since start"}}
    with new_file(path) as file:
        file.write((json.dumps(head)[:-1] + ', "traceEvents": [').encode())
        for event in _trace(Records(run, part), decisions):
            file.write((",\n" if count else "\n").encode() + json.dumps(event).encode())
            count += 1
        file.write(b"\n]}\n")
    return f"{count:,} trace events in {path}{note}"


def _trace(records: Records, decisions: Any) -> Iterator[dict[str, Any]]:
    """Yield the trace events of a part of a run, body by body."""
    run = records.run
    part = records.part
    us = run.clock.step_us
    for pid, name in enumerate([*records.users, *records.robots], 1):
        kind = "robot" if name in records.robots else "person"
        yield _named(pid, 0, "process_name", f"{name} ({kind})")
        yield {"ph": "M", "pid": pid, "tid": 0, "ts": 0, "name": "process_sort_index",
               "args": {"sort_index": pid}}  # fmt: skip
        for tid, track in enumerate(TRACKS, 1):
            yield _named(pid, tid, "thread_name", track)
        rows = rows_of(run.tables["events"], name, part.first, part.end)
        slices = [*_event_slices(rows, part.end), *_sights(rows, part.end)]
        if decisions is not None and kind == "robot":
            slices += _plans(rows_of(decisions, name, part.first, part.end), part.end)
        if "key_frames" in run.tables:
            slices += map(_motion, moves_of(run, name, part.first, part.end))
        for each in sorted(slices, key=lambda each: (each.first, each.track)):
            yield {
                "ph": "X", "pid": pid, "tid": TRACKS.index(each.track) + 1,
                "ts": each.first * us, "dur": (each.end - each.first) * us,
                "name": each.name, "cat": each.track, "args": dict(each.args),
            }  # fmt: skip
        yield from _instants(rows, pid, us)


def _motion(move: Move) -> Slice:
    args = {"from": move.begins_in, "to": move.ends_in, "metres": round(move.metres, 2)}
    return Slice("motion", move.first, move.end, f"to {move.ends_in or 'outside'}", args)


def _named(pid: int, tid: int, what: str, name: str) -> dict[str, Any]:
    return {"ph": "M", "pid": pid, "tid": tid, "ts": 0, "name": what, "args": {"name": name}}


def _event_slices(rows: Iterable[Mapping[str, Any]], end: int) -> Iterator[Slice]:
    """Yield the slices between events that begin and end something."""
    open_slices: dict[str, tuple[Mapping[str, Any], frozenset[str]]] = {}
    for row in rows:
        kind = row["event"]
        for track in [t for t, (_, ends) in open_slices.items() if kind in ends]:
            yield _closed(track, open_slices.pop(track)[0], row["step"], kind)
        if kind in _SLICES:
            track, ends = _SLICES[kind]
            if track in open_slices:
                yield _closed(track, open_slices.pop(track)[0], row["step"], kind)
            open_slices[track] = row, ends
    for track, (row, _) in open_slices.items():
        yield _closed(track, row, end, "")


def _closed(track: str, row: Mapping[str, Any], end: int, ended_by: str) -> Slice:
    kind = row["event"]
    words = words_of(row)
    name = words if kind == EventKind.ACTIVITY else f"{kind} {words}".strip()
    args = {"step": row["step"], "detail": words}
    if ended_by:
        args["ended_by"] = ended_by
    return Slice(track, row["step"], end, name, args)


def _sights(rows: Iterable[Mapping[str, Any]], end: int) -> Iterator[Slice]:
    """Yield a slice while anybody is in view, with the names of those who are."""
    since: dict[str, int] = {}
    begin = 0
    for row in rows:
        kind = row["event"]
        if kind not in (EventKind.USER_SEEN, EventKind.USER_LOST):
            continue
        who = words_of(row) or "unknown"
        if since and row["step"] > begin:
            yield Slice("sight", begin, row["step"], ", ".join(since), {"step": begin})
        begin = row["step"]
        if kind == EventKind.USER_SEEN:
            since[who] = begin
        else:
            since.pop(who, None)
    if since and end > begin:
        yield Slice("sight", begin, end, ", ".join(since), {"step": begin})


def _plans(rows: list[dict[str, Any]], end: int) -> Iterator[Slice]:
    """Yield a slice for each decision of a robot, up to one that differs."""
    begun = [next(same) for _, same in groupby(rows, decision_text)]
    begins = [row["step"] for row in begun]
    for row, (begin, until) in zip(begun, pairwise([*begins, end]), strict=True):
        args = {"step": begin, "reason": row["reason"]}
        yield Slice("plan", begin, until, decision_text(row), args)


def _instants(rows: Iterable[Mapping[str, Any]], pid: int, us: int) -> Iterator[dict[str, Any]]:
    """Yield every event as an instant, and the charge as a counter."""
    for row in rows:
        words = words_of(row)
        common = {"pid": pid, "tid": TRACKS.index("events") + 1, "ts": row["step"] * us}
        yield {
            **common, "ph": "i", "s": "t", "name": f"{row['event']} {words}".strip(),
            "cat": "events", "args": {"step": row["step"], "event": row["event"], "detail": words},
        }  # fmt: skip
        if row["event"] in _CHARGES:
            percent = float(words.removesuffix(" %"))
            yield {**common, "ph": "C", "name": "battery [%]", "args": {"charge": percent}}
