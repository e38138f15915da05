"""From readings to visits: where a body is from which step to which, and what nobody knows."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from fleet2d.logs.log import AWAY, ActivityLog, Reading
from fleet2d.logs.rooms import DOOR, RoomChoice

UNKNOWN = "unknown"


class Rule(NamedTuple):
    """How readings are made into visits.

    Attributes:
        step_us: Length of a step [us].
        begin_us: The moment of the log that is step 0 [us].
        steps: Number of steps.
        gap_us: A silence between two rooms that lasts longer is a gap.
        still_us: A silence in one room up to this long is no gap: who sleeps trips no sensor.
        unknown: Whether nobody is said to be anywhere in a gap.
        door_us: A silence at the front door that lasts longer is being out.
    """

    step_us: int
    begin_us: int
    steps: int
    gap_us: int
    still_us: int
    unknown: bool
    door_us: int


class Claim(NamedTuple):
    """A reading in steps: the body is in a room from one step to another, both included."""

    first: int
    last: int
    place: str
    activity: str


class Visit(NamedTuple):
    """A time in one room.

    Attributes:
        first: The step at which the body is there.
        keep: The step up to which it must stay: a reading of an instant, or the begin of one that
            lasts, of which the end may be cut for the way to what comes next.
        last: The last step at which the log says that it is there.
        place: The room or kind of room, "away", "door" or "unknown".
        activities: What it does from which step on.
    """

    first: int
    keep: int
    last: int
    place: str
    activities: tuple[tuple[int, str], ...] = ()


class Told(NamedTuple):
    """The visits of a run, and the number of readings that lost against others at their step."""

    visits: list[Visit]
    unmapped: int
    overruled: int


def visits_of(log: ActivityLog, rooms: Mapping[str, RoomChoice | None], rule: Rule) -> Told:
    """Return where a log says that the body is, from step 0 on.

    At each step the reading that began last holds; when it ends before an earlier one does, that
    one holds again. What a single reading of an instant says counts for the step that holds it.
    """
    claims, unmapped = [], 0
    for reading in log.readings:
        choice = rooms[reading.room]
        if choice is None:
            unmapped += 1
        else:
            claims.append(_claim(reading, choice[0], rule))
    pieces, overruled = _sweep(claims)
    return Told(_without_gaps(_merged(pieces, rule), rule), unmapped, overruled)


def _claim(reading: Reading, place: str, rule: Rule) -> Claim:
    first = (reading.begin_us - rule.begin_us) // rule.step_us
    last = -(-(reading.end_us - rule.begin_us) // rule.step_us) - 1
    return Claim(first, max(first, last), place, reading.activity)


def _sweep(claims: Sequence[Claim]) -> tuple[list[tuple[Claim, bool]], int]:
    """Return disjoint pieces of claims in order, each with whether it is an instant."""
    pieces: list[tuple[Claim, bool]] = []
    under_way: list[tuple[Claim, int]] = []
    shown: set[int] = set()
    now = 0

    def advance(end: int | None) -> None:
        nonlocal now
        while under_way and (end is None or now < end):
            top, number = under_way[-1]
            last = top.last if end is None else min(top.last, end - 1)
            if last >= now:
                pieces.append((top._replace(first=now, last=last), top.first == top.last))
                shown.add(number)
                now = last + 1
            if end is not None and top.last >= end:
                break
            under_way.pop()

    for number, claim in enumerate(claims):
        advance(claim.first)
        under_way.append((claim, number))
        now = claim.first
    advance(None)
    # Who is in the same room anyway isn't overruled.
    where = {claim.first: claim.place for claim, _ in pieces}
    lost = [c for i, c in enumerate(claims) if i not in shown and where.get(c.first) != c.place]
    return pieces, len(lost)


def _merged(pieces: Sequence[tuple[Claim, bool]], rule: Rule) -> list[Visit]:
    """Join pieces in one room to visits; a long silence after the front door is being away."""
    visits: list[Visit] = []
    for claim, instant in pieces:
        keep = claim.last if instant else claim.first
        visit = Visit(claim.first, keep, claim.last, claim.place, ((claim.first, claim.activity),))
        before = visits[-1] if visits else None
        if before is None or before.place != claim.place:
            visits.append(visit)
            continue
        silence_us = (claim.first - before.last - 1) * rule.step_us
        if claim.place == DOOR and silence_us > rule.door_us:
            out = Visit(before.last + 1, claim.first - 1, claim.first - 1, AWAY)
            visits += [out, visit]
        elif silence_us > rule.still_us:
            visits.append(visit)
        else:
            done = before.activities
            if not done or claim.activity != done[-1][1]:
                done = (*done, *visit.activities)
            visits[-1] = Visit(before.first, keep, claim.last, claim.place, done)
    return visits


def _without_gaps(visits: Sequence[Visit], rule: Rule) -> list[Visit]:
    """Return the visits within the run, with those nowhere known in between."""
    filled: list[Visit] = []
    end = -1  # the last step that is told
    for number, visit in enumerate(visits):
        silence = visit.first - end - 1
        gap = silence * rule.step_us > rule.gap_us and rule.unknown
        if (number == 0 and silence > 0) or gap:
            filled.append(Visit(end + 1, visit.first - 1, visit.first - 1, UNKNOWN))
        filled.append(visit)
        end = visit.last
    if end + 1 < rule.steps:
        filled.append(Visit(end + 1, rule.steps, rule.steps, UNKNOWN))
    begun = [visit for visit in filled if visit.first < rule.steps]
    earlier = [number for number, visit in enumerate(begun) if visit.first <= 0]
    return begun[max(earlier, default=0) :]
