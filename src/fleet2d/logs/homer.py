"""The HOMER+ layout: a file per day, an agenda of activities and then each one's timed actions.

::

    brushing_teeth (06:10 - 06:13)

    ### brushing_teeth-07.txt

    [WALK] <bathroom> (1) [1]
    370.25

The number after one or several actions is the minute of the day at which they are done. A room is
named by walking to it. Things with a number below 1000 are numbered room by room, as in
VirtualHome, whose scripts these are: number 16, a shower, belongs to the bathroom, number 1, if the
next room is number 41. What can't be told so happens where the last thing did.
"""

import re
from bisect import bisect_right
from dataclasses import dataclass, field
from pathlib import Path

from fleet2d.bounds import one_line
from fleet2d.logs.log import DAY_US, ActivityLog, LogError, Reading, in_order, log_lines

AGENDA = re.compile(r"(\w+) \((\d{1,9}):(\d\d) - (?:(\d{1,9})\s?days? - )?(\d{1,9}):(\d\d)\)")
SCRIPT = re.compile(r"### (\w+?)-\w+\.txt")
ACTION = re.compile(r"\[(\w+)\]((?: <\w+> \(\d+\))*) \[\d+\]")
THING = re.compile(r"<(\w+)> \((\d{1,9})\d*\)")
MINUTE = re.compile(r"\d+(?:\.\d+)?")
ROOM = re.compile(r"bathroom|bedroom|dining_room|home_office|kitchen|living_?room|hallway")
ADDED = 1000  # things from this number on were added later, anywhere
MINUTE_US = 60_000_000
MOST_MINUTES = 1e6  # what is later is at the end of its activity anyway


@dataclass
class _Block:
    """An activity of a day: its times on the agenda and what its script does when."""

    activity: str
    begin_us: int
    end_us: int
    line: int
    steps: list[tuple[int, list[tuple[str, int]], int]] = field(default_factory=list)


def read_homer(path: Path, *, sort: bool = False) -> ActivityLog:
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
        found = [reading for block in blocks for reading in _placed(block, rooms)]
        found, amiss = in_order(found, file, sort=sort)
        notes += [f"{file.name}: {note}" for note in amiss]
        placed = {reading.activity for reading in found}
        lost = sorted({block.activity for block in blocks} - placed)
        if lost:
            notes.append(f"{file.name}: in no room, or in no time: {', '.join(lost)}")
        readings += [
            r._replace(begin_us=r.begin_us + number * DAY_US, end_us=r.end_us + number * DAY_US)
            for r in found
        ]
    return ActivityLog(path, "homer", None, tuple(readings), tuple(notes))


def _day(path: Path) -> list[_Block]:
    blocks: list[_Block] = []
    block = -1
    waiting: list[tuple[str, int]] = []
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
            waiting = []
        elif match := ACTION.fullmatch(line):
            waiting += [(name, int(n)) for name, n in THING.findall(match[2])]
        elif MINUTE.fullmatch(line):
            if block < 0:
                raise LogError(f"{path}, line {number}: an action before any '### activity'")
            # To the microsecond: sums of thirds of minutes end in …33332.
            at = round(min(float(line), MOST_MINUTES) * MINUTE_US)
            blocks[block].steps.append((at, waiting, number))
            waiting = []
    if not blocks:
        raise LogError(f"{path}: no line like 'breakfast (08:35 - 09:02)'; is it a day of HOMER+?")
    return blocks


def _agenda(match: re.Match[str], path: Path, line: int) -> _Block:
    begin = int(match[2]) * 60 + int(match[3])
    end = (int(match[4] or 0) * 24 + int(match[5])) * 60 + int(match[6])
    if begin >= 24 * 60 or int(match[5]) > 24:
        raise LogError(f"{path}, line {line}: a day has 24 hours, found {one_line(match[0])!r}")
    if end < begin:
        raise LogError(f"{path}, line {line}: it ends before it begins, {one_line(match[0])!r}")
    return _Block(match[1], begin * MINUTE_US, end * MINUTE_US, line)


def _placed(block: _Block, rooms: list[tuple[int, str]]) -> list[Reading]:
    """Return an activity's readings: one for each time in one room."""
    numbers = [number for number, _ in rooms]
    pieces: list[tuple[int, int, str, int]] = []  # begin, end, room or "", line
    begin = block.begin_us
    for at, things, line in block.steps:
        end = min(max(at, begin), block.end_us)
        said = ""
        for _name, number in things:
            if number < ADDED and (known := bisect_right(numbers, number)):
                said = rooms[known - 1][1]
        pieces.append((begin, end, said, line))
        begin = end
    pieces.append((begin, block.end_us, "", block.line))
    room = next((said for _, _, said, _ in pieces if said), "")
    readings: list[Reading] = []
    for first, last, said, line in pieces:
        room = said or room
        if last == first:
            continue  # done in no time: nobody was ever there
        if readings and readings[-1].room == room:
            readings[-1] = readings[-1]._replace(end_us=last)
        elif room:
            readings.append(Reading(first, last, room, block.activity, line))
    return readings
