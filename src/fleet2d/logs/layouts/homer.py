"""The HOMER+ layout: a file per day, an agenda of activities and then each one's timed actions.

::

    brushing_teeth (06:10 - 06:13)

    ### brushing_teeth-07.txt

    [WALK] <bathroom> (1) [1]
    370.25

The number after one or several actions is the minute of the day at which they are done. Walking to
a room names it. Objects with a number below 1000 are numbered room by room, as in VirtualHome,
which the scripts come from: number 16, a shower, belongs to the bathroom, number 1, if the next
room is number 41. Actions without such a number happen in the room of the action before.
"""

import re
from bisect import bisect_right
from dataclasses import dataclass, field
from pathlib import Path

from fleet2d.bounds import one_line
from fleet2d.logs.log import ActivityLog, LogError, Reading, in_order, log_lines
from fleet2d.runtime.clock import DAY_MINUTES, DAY_US

AGENDA = re.compile(r"(\w+) \((\d{1,9}):(\d\d) - (?:(\d{1,9})\s?days? - )?(\d{1,9}):(\d\d)\)")
SCRIPT = re.compile(r"### (\w+?)-\w+\.txt")
ACTION = re.compile(r"\[(\w+)\]((?: <\w+> \(\d+\))*) \[\d+\]")
THING = re.compile(r"<(\w+)> \((\d{1,9})\d*\)")
MINUTE = re.compile(r"\d+(?:\.\d+)?")
ROOM = re.compile(r"bathroom|bedroom|dining_room|home_office|kitchen|living_?room|hallway")
FOLDERS = True
ADDED = 1000  # objects from this number on were added later, in any room
MINUTE_US = 60_000_000
MAX_MINUTES = 1e6  # later times are cut to the end of their activity in any case


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


def matches(line: str) -> bool:
    """Return whether a line is of an agenda."""
    return AGENDA.fullmatch(line) is not None


def read(path: Path, *, sort: bool = False) -> ActivityLog:
    """Read the days of a household: one file, or a folder whose files follow each other by name.

    Raises:
        LogError: A line is damaged, times run backwards, or a day's end is beyond the next.
    """
    files = sorted(path.glob("*.txt")) if path.is_dir() else [path]
    if not files:
        raise LogError(f"{path} holds no .txt file")
    days = [_day(file) for file in files]
    rooms = sorted(
        {(n, name) for day in days for b in day for _, things, _ in b.steps for name, n in things
         if ROOM.fullmatch(name) and n < ADDED}
    )  # fmt: skip
    readings: list[Reading] = []
    notes: list[str] = []
    for number, (file, blocks) in enumerate(zip(files, days, strict=True)):
        of_day = [reading for block in blocks for reading in _readings(block, rooms)]
        of_day, order_notes = in_order(of_day, file, sort=sort)
        notes += [f"{file.name}: {note}" for note in order_notes]
        without_room = {block.activity for block in blocks} - {r.activity for r in of_day}
        if without_room:
            names = ", ".join(sorted(without_room))
            notes.append(f"{file.name}: in no room, or in no time: {names}")
        readings += [
            r._replace(begin_us=r.begin_us + number * DAY_US, end_us=r.end_us + number * DAY_US)
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
