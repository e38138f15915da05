"""Layouts of logs of rooms and activities, and reading a log of any layout."""

import re
from bisect import bisect_right
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from datetime import date, datetime
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Literal, NamedTuple

from fleet2d.bounds import one_line
from fleet2d.logs.layouts import aras, home_assistant, kasteren, mit, openshs, states
from fleet2d.logs.layouts.casas import read_casas, shows_casas
from fleet2d.logs.layouts.clock import placed_in_order
from fleet2d.logs.layouts.intervals import is_leaving, label_by_activities
from fleet2d.logs.log import (
    AWAY,
    ActivityLog,
    LogError,
    PositionLog,
    Reading,
    in_order,
    log_lines,
    parse_local_time,
    since,
)
from fleet2d.runtime.clock import DAY_MINUTES, DAY_US
from fleet2d.runtime.local_time import Zone
from fleet2d.storage.bags import is_bag

AGENDA = re.compile(r"(\w+) \((\d{1,9}):(\d\d) - (?:(\d{1,9})\s?days? - )?(\d{1,9}):(\d\d)\)")
SCRIPT = re.compile(r"### (\w+?)-\w+\.txt")
ACTION = re.compile(r"\[(\w+)\]((?: <\w+> \(\d+\))*) \[\d+\]")
THING = re.compile(r"<(\w+)> \((\d{1,9})\d*\)")
MINUTE = re.compile(r"\d+(?:\.\d+)?")
ROOM = re.compile(r"bathroom|bedroom|dining_room|home_office|kitchen|living_?room|hallway")
ADDED = 1000  # objects from this number on were added later, in any room
MINUTE_US = 60_000_000
MAX_MINUTES = 1e6  # later times are cut to the end of their activity in any case
_TIME = r"(\d{4}-\d\d?-\d\d?\s+\d+:\S+)"
UCI_ADL = rf"{_TIME}\s+{_TIME}\s+(.*)"  # an interval
HEAD = r"Start time\s+End time.*|[-\s]+"  # a line of the head of a table
UCI_ADL_FILES = {"sensors": "_Sensors", "activities": "_ADLs"}
FIRST_LINES = 20


@dataclass
class _ScriptedActivity:
    """An activity of a day.

    Attributes:
        activity: Its name.
        begin_us: Its beginning on the agenda [us since midnight].
        end_us: Its end on the agenda [us since midnight].
        line: The line of the agenda.
        steps: Its script: time [us], objects by name and number, and line.
    """

    activity: str
    begin_us: int
    end_us: int
    line: int
    steps: list[tuple[int, list[tuple[str, int]], int]] = field(default_factory=list)


def read_homer(
    path: Path,
    *,
    sort: bool = False,
    zone: Zone | None = None,  # noqa: ARG001 - its days have no dates
) -> ActivityLog:
    """Read the days of a household: one file, or a folder whose files follow each other by name.

    ::

        brushing_teeth (06:10 - 06:13)

        ### brushing_teeth-07.txt

        [WALK] <bathroom> (1) [1]
        370.25

    The number after one or several actions is the minute of the day at which they are done. Walking
    to a room names it. Objects with a number below 1000 are numbered room by room, as in
    VirtualHome, which the scripts come from: number 16, a shower, belongs to the bathroom, number
    1, if the next room is number 41. Actions without such a number happen in the room of the action
    before.

    Raises:
        LogError: A line is damaged, times run backwards, or a day's end is beyond the next.
    """
    files = sorted(path.glob("*.txt")) if path.is_dir() else [path]
    if not files:
        raise LogError(f"{path} holds no .txt file")
    days = [_day(file) for file in files]
    steps = [step for day in days for block in day for step in block.steps]
    things = {(n, name) for _, named, _ in steps for name, n in named if n < ADDED}
    rooms = sorted((n, name) for n, name in things if ROOM.fullmatch(name))
    readings: list[Reading] = []
    notes: list[str] = []
    for number, (file, blocks) in enumerate(zip(files, days, strict=True)):
        of_day = [reading for block in blocks for reading in _readings(block, rooms)]
        of_day, order_notes = in_order(of_day, file, sort=sort)
        notes += [f"{file.name}: {note}" for note in order_notes]
        if without_room := {block.activity for block in blocks} - {r.activity for r in of_day}:
            names = ", ".join(sorted(without_room))
            notes.append(f"{file.name}: in no room, or in no time: {names}")
        midnight_us = number * DAY_US
        readings += [
            r._replace(begin_us=r.begin_us + midnight_us, end_us=r.end_us + midnight_us)
            for r in of_day
        ]
    return ActivityLog(path, "homer", None, tuple(readings), tuple(notes))


def _day(path: Path) -> list[_ScriptedActivity]:
    blocks: list[_ScriptedActivity] = []
    block = -1
    objects: list[tuple[str, int]] = []  # of the actions since the last time
    for number, line in log_lines(path):
        if match := AGENDA.fullmatch(line):
            blocks.append(_agenda(match, path, number))
        elif match := SCRIPT.fullmatch(line):
            block += 1
            if block >= len(blocks) or blocks[block].activity != match[1]:
                raise LogError(
                    f"{path}, line {number}: the script of {one_line(match[1])} isn't next on the"
                    " agenda"
                )
            objects = []
        elif match := ACTION.fullmatch(line):
            objects += [(name, int(n)) for name, n in THING.findall(match[2])]
        elif MINUTE.fullmatch(line):
            if block < 0:
                raise LogError(f"{path}, line {number}: an action before any '### activity'")
            # Rounded to the microsecond, as sums of thirds of minutes end in …33332.
            at = round(min(float(line), MAX_MINUTES) * MINUTE_US)
            blocks[block].steps.append((at, objects, number))
            objects = []
    if not blocks:
        raise LogError(f"{path}: no line like 'breakfast (08:35 - 09:02)'; is it a day of HOMER+?")
    return blocks


def _agenda(match: re.Match[str], path: Path, line: int) -> _ScriptedActivity:
    begin = int(match[2]) * 60 + int(match[3])
    end = (int(match[4] or 0) * 24 + int(match[5])) * 60 + int(match[6])
    if begin >= DAY_MINUTES or int(match[5]) > 24:
        raise LogError(
            f"{path}, line {line}: expected a time within 24 hours, got {one_line(match[0])!r}"
        )
    if end < begin:
        raise LogError(f"{path}, line {line}: it ends before it begins, {one_line(match[0])!r}")
    return _ScriptedActivity(match[1], begin * MINUTE_US, end * MINUTE_US, line)


def _readings(block: _ScriptedActivity, rooms: list[tuple[int, str]]) -> list[Reading]:
    """Return the readings of an activity, one for each stay in a room."""
    numbers = [number for number, _ in rooms]
    pieces: list[tuple[int, int, str, int]] = []  # begin, end, room or "", line
    begin = block.begin_us
    for at, things, line in block.steps:
        end = min(max(at, begin), block.end_us)
        named_room = ""
        for _name, number in things:
            if number < ADDED and (count := bisect_right(numbers, number)):
                named_room = rooms[count - 1][1]
        pieces.append((begin, end, named_room, line))
        begin = end
    pieces.append((begin, block.end_us, "", block.line))
    room = next((named_room for _, _, named_room, _ in pieces if named_room), "")
    readings: list[Reading] = []
    for first, last, named_room, line in pieces:
        room = named_room or room
        if last == first:
            continue  # without a duration, it is not a reading
        if readings and readings[-1].room == room:
            readings[-1] = readings[-1]._replace(end_us=last)
        elif room:
            readings.append(Reading(first, last, room, block.activity, line))
    return readings


class _Row(NamedTuple):
    """A line of a file; `words` are an activity, or a sensor with its type and place."""

    begin: datetime
    end: datetime
    words: list[str]
    line: int

    def reading(self, first_day: date) -> Reading:
        """Return the reading of an activity or a sensor."""
        label = self.words[-1]
        activity = label if len(self.words) == 1 else ""
        room = AWAY if is_leaving(activity) else label
        begin_us = since(first_day, self.begin)
        end_us = since(first_day, self.end)
        return Reading(begin_us, end_us, room, activity, self.line)


def read_uci_adl(path: Path, *, sort: bool = False, zone: Zone | None = None) -> ActivityLog:
    """Read a home's sensors and activities.

    ::

        2011-11-28 10:21:44    2011-11-28 10:23:31    Basin    PIR    Bathroom      (…_Sensors.txt)
        2011-11-28 10:21:24    2011-11-28 10:23:36    Toileting                     (…_ADLs.txt)

    The two files of a home are read together, whichever is named: the sensors show in which room a
    person is, the activities what is done there and when the home is left. In a file of activities
    alone, each activity stands for the room that it is done in.

    Raises:
        LogError: A line is damaged, or times run backwards.
    """
    files = {kind: (file, _rows(file)) for kind, file in _pair(path).items()}
    first_day = min(row.begin.date() for _, rows in files.values() for row in rows)
    notes: list[str] = []
    parts: dict[str, list[Reading]] = {"sensors": [], "activities": []}
    for kind, (file, rows) in files.items():
        readings = [row.reading(first_day) for row in rows]
        parts[kind], of_file = placed_in_order(readings, first_day, zone, file, sort=sort)
        notes += [f"{file.name}: {note}" for note in of_file]
    readings = parts["activities"]
    if parts["sensors"]:
        readings = label_by_activities(parts["sensors"], readings)
    by_sensors = tuple(parts["sensors"])
    return ActivityLog(path, "uci_adl", first_day, tuple(readings), tuple(notes), by_sensors)


def _pair(path: Path) -> dict[str, Path]:
    """Return the files of a home: of sensors, of activities, or both."""
    if path.is_dir():
        by_kind = {kind: sorted(path.glob(f"*{end}.txt")) for kind, end in UCI_ADL_FILES.items()}
        for kind, files in by_kind.items():
            if len(files) > 1:
                raise LogError(f"{path} holds {len(files)} files of {kind}: name the one to read")
        return {kind: files[0] for kind, files in by_kind.items() if files}
    kinds = list(UCI_ADL_FILES)
    kind, other = kinds if len(_rows(path)[0].words) >= 3 else reversed(kinds)
    twin = path.with_name(path.name.replace(UCI_ADL_FILES[kind], UCI_ADL_FILES[other]))
    return {kind: path, **({other: twin} if twin != path and twin.is_file() else {})}


def _rows(path: Path) -> list[_Row]:
    rows = []
    for number, text in log_lines(path):
        if re.fullmatch(HEAD, text):
            continue
        match = re.fullmatch(UCI_ADL, text)
        if match is None or not match[3].strip():
            raise LogError(
                f"{path}, line {number}: expected a start time, an end time, and an activity or a"
                f" sensor with its type and place, got {one_line(text)!r}"
            )
        begin = parse_local_time(" ".join(match[1].split()), path, number)
        end = parse_local_time(" ".join(match[2].split()), path, number)
        rows.append(_Row(begin, end, match[3].split(), number))
    if not rows:
        raise LogError(f"{path} holds no reading: is it the right file?")
    return rows


class LogLayout(NamedTuple):
    """A layout.

    Attributes:
        matches: Returns something true if a stripped line shows this layout, and no other.
        read: Reads a file, or a folder of files of one home; `sort` sorts its lines by time.
        reads_folders: Whether it reads folders, too.
        keys: Which other keys it takes: id, time_zone.
    """

    matches: Callable[[str], object]
    read: Callable[..., ActivityLog]
    reads_folders: bool = False
    keys: tuple[str, ...] = ()


LAYOUTS = {
    "casas": LogLayout(shows_casas, read_casas),
    "homer": LogLayout(AGENDA.fullmatch, read_homer, reads_folders=True),
    "uci_adl": LogLayout(
        re.compile(f"{UCI_ADL}|{HEAD}").fullmatch, read_uci_adl, reads_folders=True
    ),
    "kasteren": LogLayout(kasteren.LINE.fullmatch, kasteren.read_kasteren, reads_folders=True),
    "mit": LogLayout(mit.HEAD.fullmatch, mit.read_mit, reads_folders=True),
    "aras": LogLayout(aras.LINE.fullmatch, aras.read_aras, reads_folders=True, keys=("id",)),
    "openshs": LogLayout(openshs.HEAD.fullmatch, openshs.read_openshs),
    "states": LogLayout(states.HEAD.fullmatch, states.read_states, keys=("id", "time_zone")),
}
"""The layouts of rooms and activities, by name."""

if TYPE_CHECKING:
    Layout = str
else:
    Layout = Literal[("auto", *LAYOUTS, "bag", "positions")]


def read_log(  # noqa: PLR0913 - each is a key of a scenario
    path: str | Path,
    layout: Layout = "auto",
    *,
    id: str | None = None,  # noqa: A002 - the name of the column
    frame: str | None = None,
    columns: Mapping[str, str] | None = None,
    time_zone: Zone | str | None = None,
    sort: bool = False,
    decimal_comma: bool | None = None,
    day_first: bool | None = None,
) -> ActivityLog | PositionLog:
    """Read a log: a smart home's events, an activity script, or position fixes.

    Args:
        path: The file; or the folder, for a home that has several.
        layout: The layout; "auto" recognizes it by its content.
        id: The tag to read, of positions; the topic or frame, of a bag, see `read_bag`; the
            person, of layouts with several.
        frame: The frame of a bag in which positions are returned; None: the map.
        columns: The names of the columns of positions; see `read_positions`.
        time_zone: The time zone of the home, for positions and bags; see `read_positions`.
        sort: Sort lines whose time runs backwards instead of refusing them.
        decimal_comma: Whether numbers of positions have a comma as decimal mark; None: shown by the
            file.
        day_first: Whether 03/04/2026 is in April, for positions; None: shown by the file.

    Raises:
        LogError: It is of no known layout, damaged, or contradicts itself.
    """
    path = Path(path)
    if not path.exists():
        raise LogError(f"no such file: {path}")
    layout = _recognize(path) if layout == "auto" else layout
    if frame is not None and layout != "bag":
        raise LogError(f"{path} is no bag: the name of a frame is for bags")
    if layout == "positions":
        # Imported here, as no other layout needs pyarrow.
        from fleet2d.logs.positions import read_positions

        return read_positions(
            path,
            id=id,
            columns=columns,
            time_zone=time_zone,
            sort=sort,
            decimal_comma=decimal_comma,
            day_first=day_first,
        )
    if columns or decimal_comma is not None or day_first is not None:
        raise LogError(
            f"{path} is of the layout {layout}: decimal_comma, day_first and columns are for tables"
            " of positions"
        )
    if layout == "bag":
        from fleet2d.logs.bags import read_bag

        return read_bag(path, id=id, frame=frame or "map", time_zone=time_zone, sort=sort)
    chosen = LAYOUTS[layout]
    is_zone = isinstance(time_zone, Zone)
    given = {"id": id, "time_zone": None if is_zone else time_zone}
    keys = {name: value for name, value in given.items() if value is not None}
    if unused := [name for name in keys if name not in chosen.keys]:
        raise LogError(
            f"{path} is of the layout {layout}, which takes no {' or '.join(unused)}: that is for"
            " positions, bags and a few layouts"
        )
    return chosen.read(path, sort=sort, zone=time_zone if is_zone else None, **keys)


def _recognize(path: Path) -> str:
    """Return the layout of a file or folder.

    Raises:
        LogError: It is of no known layout.
    """
    if is_bag(path):
        return "bag"
    if path.is_dir():
        files = [file for suffix in ("txt", "csv") for file in sorted(path.glob(f"*.{suffix}"))]
        layouts = map(_recognize_lines, files)
        layout = next((name for name in layouts if name and LAYOUTS[name].reads_folders), None)
        if layout is None:
            several = [name for name, layout in LAYOUTS.items() if layout.reads_folders]
            raise LogError(
                f"{path}: no .txt or .csv file in this folder is of a layout with several files"
                f" ({', '.join(several)}): for other layouts name the file"
            )
        return layout
    if home_assistant.reader_of(path):
        return "states"
    suffix = path.suffix.lower()
    if suffix in (".parquet", ".pq", ".jsonl", ".ndjson"):
        return "positions"
    # Of a table with tabs, the first line tells: others may look like events.
    layout = _recognize_lines(path, 1 if suffix in (".csv", ".tsv") else FIRST_LINES)
    if layout is None and suffix in (".csv", ".tsv"):
        return "positions"
    if layout is None:
        names = ", ".join(LAYOUTS)
        raise LogError(f"{path} has no known layout: give 'format' ({names} or positions)")
    return layout


def _recognize_lines(file: Path, count: int = FIRST_LINES) -> str | None:
    """Return the layout that one of the first lines of a file shows, if one does."""
    lines = (line for _, line in islice(log_lines(file), count))
    shown = (name for line in lines for name, layout in LAYOUTS.items() if layout.matches(line))
    return next(shown, None)
