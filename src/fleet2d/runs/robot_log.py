"""The log of a robot, like one that it wrote itself: decisions, moves, sightings and failures."""

from collections.abc import Iterable, Iterator, Mapping
from datetime import timedelta
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fleet2d.configuration.problems import check_known
from fleet2d.configuration.units import format_duration
from fleet2d.errors import InputError
from fleet2d.kernels import I64
from fleet2d.runs.run import Run
from fleet2d.runs.trajectory import PathReader
from fleet2d.runtime.clock import DAY_US, Clock, midnight_of
from fleet2d.runtime.events import EventKind

if TYPE_CHECKING:
    import pyarrow as pa

INFO = "INFO"
WARN = "WARN"
ERROR = "ERROR"

SOURCES: Mapping[str, frozenset[str]] = {
    "power": frozenset({EventKind.POWER_OFF, EventKind.POWER_ON}),
    "battery": frozenset({EventKind.BATTERY, EventKind.DOCKS, EventKind.CHARGED}),
    "sight": frozenset({EventKind.USER_SEEN, EventKind.USER_LOST}),
    "place": frozenset(
        {
            EventKind.LOCALIZATION_LOST, EventKind.RELOCALIZED, EventKind.WAY_BLOCKED,
            EventKind.GIVES_WAY, EventKind.GIVES_UP,
        }
    ),
    "people": frozenset(
        {
            EventKind.ACCEPTED, EventKind.ALLOWED, EventKind.APPROACHES, EventKind.ASKS,
            EventKind.BANNED, EventKind.BROKEN_OFF, EventKind.CALLED, EventKind.COLLECTS,
            EventKind.DECLINED, EventKind.DEFERRED, EventKind.DELIVERED, EventKind.DUE,
            EventKind.EXPIRED, EventKind.GIVEN_UP, EventKind.IGNORED,
            EventKind.INTERACTION_OVER, EventKind.INTERACTS,
            EventKind.MISTAKEN, EventKind.OPPORTUNITY, EventKind.QUESTION, EventKind.REPLIES,
            EventKind.SENT_AWAY, EventKind.SWITCHED_OFF, EventKind.TOLD, EventKind.WITHDRAWS,
        }
    ),
}  # fmt: skip
"""The part of a robot that writes each kind of events; all other kinds are of its `task`."""

_SOURCE_OF = {kind: source for source, kinds in SOURCES.items() for kind in kinds}
_LEVELS = {
    **dict.fromkeys((EventKind.LOCALIZATION_LOST, EventKind.BROKEN_OFF), ERROR),
    **dict.fromkeys(
        (
            EventKind.EXPIRED, EventKind.GAVE_UP, EventKind.GIVEN_UP, EventKind.GIVES_UP,
            EventKind.IGNORED,
            EventKind.LOST, EventKind.MISTAKEN, EventKind.POWER_OFF, EventKind.SENT_AWAY,
            EventKind.SWITCHED_OFF, EventKind.WAY_BLOCKED,
        ),
        WARN,
    ),
}  # fmt: skip
# For these reasons a robot goes off without anybody wanting it.
_UNWANTED = frozenset({"crash", "empty"})
# Of interventions, a robot can only notice these.
_FAULTS = frozenset({"fault", "switch_off"})
_FIELDS_OF_RECORDS = frozenset({"do", "step", "entity", "by", "duration"})
# Sources in order within a step: causes of a decision come before it, its effects after it.
_ORDER = ("power", "fault", "place", "sight", "decision")
# A move shorter than this is a turn on the spot [m].
LEAST_MOVE_M = 0.05


class LogEntry(NamedTuple):
    """A line of a log.

    Attributes:
        step: The step.
        level: INFO, WARN or ERROR.
        source: The part of the robot that writes it: a name in `SOURCES`, `decision`, `drive`,
            `fault` or `task`.
        text: The message.
    """

    step: int
    level: str
    source: str
    text: str


class Move(NamedTuple):
    """A move of a body from one rest to the next, turns included.

    Attributes:
        first: The step at which it begins.
        end: The step at which the body rests again.
        metres: The length of the path [m].
        begins_in: The room where it begins; empty outside of rooms.
        ends_in: The room where it ends.
    """

    first: int
    end: int
    metres: float
    begins_in: str
    ends_in: str


def robot_log(
    run: Run, robot: str, first: int, end: int, decisions: "pa.Table | None" = None
) -> list[LogEntry]:
    """Return the log of a robot for the steps from `first` to `end` - 1, in order.

    The log has only what the robot could know: its own decisions, events and faults. Rooms are
    those where the robot is, not where it believes itself to be.

    Args:
        run: A stored run.
        robot: The name of the robot.
        first: The first step.
        end: The step after the last one.
        decisions: The table of decisions, if the run didn't store one.

    Raises:
        InputError: There is no such robot, or the run stored no events.
        ArtifactError: A table is damaged.

    Example:
        >>> import fleet2d
        >>> run = fleet2d.run("bundled:paper", "simulation.duration=2 h", seed=4)
        >>> [entry.text for entry in robot_log(run, "astro", 0, 1800)][:2]
        ['sets out from hallway_1', 'user_seen ana']
    """
    check_known(robot, "robot", run.manifest["entities"]["robots"], InputError)
    if "events" not in run.tables:
        raise InputError("the run stored no events: run it with artifacts.events=true")
    entries: list[LogEntry] = []
    table = run.tables.get("decisions", decisions)
    if table is not None:
        entries += _of_decisions(rows_of(table, robot, first, end))
    # The robot may have gone off before `first`, so read from the start of the run.
    events = _of_events(rows_of(run.tables["events"], robot, 0, end), run.clock)
    entries += (entry for entry in events if entry.step >= first)
    entries += _of_faults(run.manifest["interventions"], robot, first, end)
    if "key_frames" in run.tables:
        for move in moves_of(run, robot, first, end):
            entries += _of_move(move, run.clock)
    return sorted(entries, key=_rank)


def _rank(entry: LogEntry) -> tuple[int, int]:
    """Return the key by which the lines of a log are sorted."""
    is_ranked = entry.source in _ORDER
    return entry.step, _ORDER.index(entry.source) if is_ranked else len(_ORDER)


def day_of(run: Run, number: int) -> tuple[int, int]:
    """Return the first step of a day of a run, and the step after its last one.

    Args:
        run: The run.
        number: The day; 1 is the date of the start.

    Raises:
        InputError: The run has no such day.
    """
    clock = run.clock
    begins_us = clock.elapsed(midnight_of(clock.start)) + (number - 1) * DAY_US
    first = max(clock.step_at_or_after(begins_us), 0)
    end = min(clock.step_at_or_after(begins_us + DAY_US), clock.steps)
    if first >= end:
        last_date = clock.time(clock.steps - 1).date()
        last = (last_date - clock.start.date()).days + 1
        raise InputError(f"the run has no day {number}: its days are 1 to {last}")
    return first, end


def log_lines(entries: Iterable[LogEntry], clock: Clock) -> Iterator[str]:
    """Yield the lines of a log as text: a head for each day, then time, level, source and text."""
    today = None
    for entry in entries:
        time = clock.time(entry.step)
        if time.date() != today:
            today = time.date()
            yield f"-- day {(today - clock.start.date()).days + 1}, {time:%A %Y-%m-%d}"
        yield f"{time:%H:%M:%S}  {entry.level:<5}  {entry.source:<8}  {entry.text}"


def moves_of(run: Run, name: str, first: int, end: int) -> Iterator[Move]:
    """Yield the moves of a body in the steps from `first` to `end` - 1, cut off at both ends.

    Raises:
        ArtifactError: The run stored no key frames, or damaged ones.
    """
    reader = PathReader(run, run.plan, name)
    step = timedelta(microseconds=run.clock.step_us)
    rooms = [*(room.name for room in run.plan.rooms), ""]
    steps_of_day = max(1, DAY_US // run.clock.step_us)
    last: Move | None = None  # a move may go on in the next part
    for begin in range(first, end, steps_of_day):
        way = reader.read(begin, min(begin + steps_of_day + 1, end), step)
        legs = np.hypot(np.diff(way.x), np.diff(way.y))
        is_moving = (legs > 0) | (np.diff(way.heading) != 0)
        edges: I64 = np.flatnonzero(np.diff(is_moving, prepend=False, append=False))
        for i, j in edges.reshape(-1, 2).tolist():
            metres = float(legs[i:j].sum())
            places = rooms[way.room[i]], rooms[way.room[j]]
            move = Move(begin + i, begin + j, metres, *places)
            if last is not None and last.end == move.first:
                metres += last.metres
                last = last._replace(end=move.end, metres=metres, ends_in=move.ends_in)
                continue
            if last is not None and last.metres >= LEAST_MOVE_M:
                yield last
            last = move
    if last is not None and last.metres >= LEAST_MOVE_M:
        yield last


def rows_of(table: "pa.Table", name: str, first: int, end: int) -> list[dict[str, Any]]:
    """Return the rows of a table that are about a body and in a stretch of steps."""
    import pyarrow as pa
    from pyarrow import compute

    step = table["step"]
    is_in = compute.and_(compute.greater_equal(step, first), compute.less(step, end))
    is_own = compute.equal(compute.cast(table["entity"], pa.string()), name)
    own = table.filter(compute.and_(is_in, is_own))
    rows: list[dict[str, Any]] = own.to_pylist()
    return rows


def decision_text(row: Mapping[str, Any]) -> str:
    """Return a row of the table of decisions in words: who decided, and why."""
    behavior = row["behavior"] or "no behavior"
    reason = row["reason"]
    is_told = reason in ("", behavior) or reason.startswith(f"{EventKind.BATTERY} ")
    return str(behavior) if is_told else f"{behavior}: {reason}"


def _of_decisions(rows: Iterable[Mapping[str, Any]]) -> Iterator[LogEntry]:
    """Yield a line for each decision that differs from the one before."""
    last = ""
    for row in rows:
        text = decision_text(row)
        if text != last:
            yield LogEntry(row["step"], INFO, "decision", text)
        last = text


def _of_events(rows: Iterable[Mapping[str, Any]], clock: Clock) -> Iterator[LogEntry]:
    off_at: int | None = None
    for row in rows:
        kind = row["event"]
        step = row["step"]
        parts = (kind, row.get("user"), row["detail"])
        text = " ".join(filter(None, parts))
        level = _LEVELS.get(kind, INFO)
        if kind == EventKind.POWER_OFF:
            off_at = step
            level = ERROR if row["detail"] in _UNWANTED else WARN
        elif kind == EventKind.POWER_ON and off_at is not None:
            lasted = timedelta(microseconds=(step - off_at) * clock.step_us)
            text += f", was off for {format_duration(lasted)}"
        yield LogEntry(step, level, _SOURCE_OF.get(kind, "task"), text)


def _of_faults(
    records: Iterable[Mapping[str, Any]], robot: str, first: int, end: int
) -> Iterator[LogEntry]:
    """Yield a line for each fault of the robot in the manifest."""
    for record in records:
        is_own = record.get("entity") == robot and record["do"] in _FAULTS
        if is_own and first <= record.get("step", 0) < end:
            parts = [key for key in record if key not in _FIELDS_OF_RECORDS]
            says = [key if record[key] is True else f"{key} {record[key]}" for key in parts]
            what = ", ".join(says)
            lasts = f" for {record['duration']}" if "duration" in record else ""
            yield LogEntry(record.get("step", 0), ERROR, "fault", f"{record['do']} {what}{lasts}")


def _of_move(move: Move, clock: Clock) -> Iterator[LogEntry]:
    """Yield a line for the beginning of a move, and one for its end."""
    seconds = (move.end - move.first) * clock.step_us / 1e6
    yield LogEntry(move.first, INFO, "drive", f"sets out from {move.begins_in or 'outside'}")
    text = f"stops in {move.ends_in or 'outside'} after {move.metres:.1f} m in {seconds:g} s"
    yield LogEntry(move.end, INFO, "drive", text)
