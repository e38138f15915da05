"""Visits: the rooms that a body is in according to a log, step by step, and the gaps between."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from fleet2d.logs.log import AWAY, ActivityLog, Reading
from fleet2d.logs.rooms import DOOR, RoomChoice

UNKNOWN = "unknown"


class VisitRule(NamedTuple):
    """How readings are turned into visits.

    Attributes:
        step_us: Length of a step [us].
        begin_us: The moment of the log that is step 0 [us].
        steps: The number of steps.
        gap_us: A longer silence between two rooms is a gap [us].
        still_us: A silence in one room up to this long is not a gap, as of sleepers [us].
        unknown: Whether the position in a gap is unknown; else the last visit lasts through it.
        door_us: A longer silence at the front door means that the person is out [us].
    """

    step_us: int
    begin_us: int
    steps: int
    gap_us: int
    still_us: int
    unknown: bool
    door_us: int


class RoomInterval(NamedTuple):
    """A reading in steps: the body is in a room from one step to another, both included.

    Attributes:
        first: The first step.
        last: The last step.
        place: The room or kind of room, "away" or "door".
        activity: What it does there, "" if unknown.
    """

    first: int
    last: int
    place: str
    activity: str


class LoggedVisit(NamedTuple):
    """A time in one room.

    Attributes:
        first: The first step at which the body is there.
        keep: The step up to which the body must stay. Of a reading that lasts, only the first
            moment must be kept: its end may be cut for the way to the next visit.
        last: The last step of the visit according to the log.
        place: The room or kind of room, "away", "door" or "unknown".
        activities: Pairs of a step and the activity from that step on.
    """

    first: int
    keep: int
    last: int
    place: str
    activities: tuple[tuple[int, str], ...] = ()


class LoggedVisits(NamedTuple):
    """The visits of a run.

    Attributes:
        visits: The visits, in order.
        unmapped: The number of readings whose label stands for no room.
        overruled: The number of readings without effect, as a later one of another room holds from
            their first step on.
    """

    visits: list[LoggedVisit]
    unmapped: int
    overruled: int


def visits_of(
    log: ActivityLog, rooms: Mapping[str, RoomChoice | None], rule: VisitRule
) -> LoggedVisits:
    """Return the visits of a log, from step 0 on.

    At each step the reading that began last holds; if it ends before an earlier one, that one holds
    again. A reading of an instant holds for the step that the instant lies in.
    """
    intervals, unmapped = [], 0
    for reading in log.readings:
        choice = rooms[reading.room]
        if choice is None:
            unmapped += 1
        else:
            intervals.append(_interval(reading, choice[0], rule))
    pieces, overruled = _sweep(intervals)
    return LoggedVisits(_without_gaps(_merge_pieces(pieces, rule), rule), unmapped, overruled)


def _interval(reading: Reading, place: str, rule: VisitRule) -> RoomInterval:
    first = (reading.begin_us - rule.begin_us) // rule.step_us
    last = -(-(reading.end_us - rule.begin_us) // rule.step_us) - 1
    return RoomInterval(first, max(first, last), place, reading.activity)


def _sweep(intervals: Sequence[RoomInterval]) -> tuple[list[tuple[RoomInterval, bool]], int]:
    """Cut overlapping intervals into disjoint pieces, in order: the one that began last wins.

    Args:
        intervals: The intervals, in the order of their beginnings.

    Returns:
        The pieces, each with whether its interval is an instant, and the number of intervals that
        lost all their time to those of other rooms.
    """
    pieces: list[tuple[RoomInterval, bool]] = []
    active: list[tuple[RoomInterval, int]] = []  # a stack: the last one began last
    shown: set[int] = set()
    now = 0

    def advance(end: int | None) -> None:
        nonlocal now
        while active and (end is None or now < end):
            top, number = active[-1]
            last = top.last if end is None else min(top.last, end - 1)
            if last >= now:
                pieces.append((top._replace(first=now, last=last), top.first == top.last))
                shown.add(number)
                now = last + 1
            if end is not None and top.last >= end:
                break
            active.pop()

    for number, interval in enumerate(intervals):
        advance(interval.first)
        active.append((interval, number))
        now = interval.first
    advance(None)
    # An interval without a piece isn't overruled if the piece at its beginning is of the same room.
    place_at = {piece.first: piece.place for piece, _ in pieces}
    overruled = [
        interval
        for number, interval in enumerate(intervals)
        if number not in shown and place_at.get(interval.first) != interval.place
    ]
    return pieces, len(overruled)


def _merge_pieces(
    pieces: Sequence[tuple[RoomInterval, bool]], rule: VisitRule
) -> list[LoggedVisit]:
    """Merge consecutive pieces in a room to a visit.

    A long silence after the front door counts as absence.
    """
    visits: list[LoggedVisit] = []
    for piece, is_instant in pieces:
        keep = piece.last if is_instant else piece.first
        activity = (piece.first, piece.activity)
        visit = LoggedVisit(piece.first, keep, piece.last, piece.place, (activity,))
        before = visits[-1] if visits else None
        if before is None or before.place != piece.place:
            visits.append(visit)
            continue
        silence_us = (piece.first - before.last - 1) * rule.step_us
        if piece.place == DOOR and silence_us > rule.door_us:
            out = LoggedVisit(before.last + 1, piece.first - 1, piece.first - 1, AWAY)
            visits += [out, visit]
        elif silence_us > rule.still_us:
            visits.append(visit)
        else:
            activities = before.activities
            if not activities or piece.activity != activities[-1][1]:
                activities = (*activities, activity)
            visits[-1] = LoggedVisit(before.first, keep, piece.last, piece.place, activities)
    return visits


def _without_gaps(visits: Sequence[LoggedVisit], rule: VisitRule) -> list[LoggedVisit]:
    """Return the visits within the run, with visits to "unknown" in the gaps between them."""
    filled: list[LoggedVisit] = []
    end = -1  # the last known step
    for number, visit in enumerate(visits):
        silence = visit.first - end - 1
        is_gap = silence * rule.step_us > rule.gap_us and rule.unknown
        if (number == 0 and silence > 0) or is_gap:
            filled.append(LoggedVisit(end + 1, visit.first - 1, visit.first - 1, UNKNOWN))
        filled.append(visit)
        end = visit.last
    if end + 1 < rule.steps:
        filled.append(LoggedVisit(end + 1, rule.steps, rule.steps, UNKNOWN))
    of_run = [visit for visit in filled if visit.first < rule.steps]
    earlier = [number for number, visit in enumerate(of_run) if visit.first <= 0]
    return of_run[max(earlier, default=0) :]
