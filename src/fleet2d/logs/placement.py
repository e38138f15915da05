"""How a log lies in a home: the frame of its positions, the rooms of its labels, and the visits."""

import difflib
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import pairwise
from typing import NamedTuple, Self

import numpy as np
from pydantic import Field

from fleet2d.configuration.components import Settings
from fleet2d.configuration.problems import problem, suggest
from fleet2d.configuration.units import AngleDeg, Length
from fleet2d.floorplan.plan import Room
from fleet2d.floorplan.rooms.room import room_type, usual_type
from fleet2d.kernels import F64
from fleet2d.logs.log import AWAY, ActivityLog, LogError, Reading
from fleet2d.runtime.determinism import sum_in_order

Pair = tuple[float, float]
# Coordinates are clipped to this, far outside of any home [m].
COORDINATE_LIMIT_M = 1e6
# If more positions than this are outside of the home, the frame of the log is wrong.
MAX_OUTSIDE = 0.5
RoomChoice = tuple[str, ...]

DOOR = "door"
"""The front door: after a long silence there, the person is out."""
_MEANINGS: tuple[tuple[str, RoomChoice], ...] = (
    ("away", (AWAY,)),
    ("outsidedoor outside_door maindoor frontdoor front_door entrance", (DOOR,)),
    ("livingroom living lounge loungechair spare_time_tv", ("living_room",)),
    ("diningroom dining_room dining", ("dining_room", "kitchen")),
    ("workarea home_office office", ("office", "living_room")),
    ("toilet", ("toilet", "bathroom")),
    ("bathroom toileting", ("bathroom", "toilet")),
    ("showering grooming", ("bathroom",)),
    ("hallway", ("hallway", "hall")),
    ("hall", ("hall", "hallway")),
    ("sleeping", ("bedroom",)),
    ("breakfast lunch dinner snack", ("kitchen",)),
    ("supper", ("living_room",)),
)
USUAL_ROOMS = {label: rooms for labels, rooms in _MEANINGS for label in labels.split()}
"""Meanings of the labels of known data sets, rooms and activities: rooms to be tried in turn."""
_KITCHEN = ("kitchen", "dining_room")
_BATH = ("bathroom", "toilet")
THINGS: dict[str, RoomChoice] = {
    **dict.fromkeys(("front", "main", "entrance"), (DOOR,)),
    **dict.fromkeys(("fridge", "refrigerator", "freezer", "microwave", "oven", "stove"), _KITCHEN),
    **dict.fromkeys(("dishwasher", "kettle", "cupboard", "cutlery", "pans", "cups"), _KITCHEN),
    **dict.fromkeys(("drink", "cook", "cooking", "meal"), _KITCHEN),
    **dict.fromkeys(("shower", "bathtub", "bath", "basin", "teeth"), _BATH),
    **dict.fromkeys(("bed", "dresser", "wardrobe"), ("bedroom",)),
    **dict.fromkeys(("couch", "sofa", "tv"), ("living_room",)),
    **dict.fromkeys(("desk", "computer"), ("office", "living_room")),
    "washing_machine": ("laundry", "bathroom"),
}
"""The rooms in which things usually are."""
UNKNOWN = "unknown"


class Match(Settings):
    """One place in both frames.

    Attributes:
        log: Its coordinates in the log, in the log's units.
        plan: Its coordinates in the floor plan [m].
    """

    log: Pair
    plan: Pair


class LogFrame(Settings):
    """How the positions of a log lie in the floor plan: mirrored, scaled, turned, then moved.

    Attributes:
        name: The frame of a bag in which positions are read, such as odom; left out: map.
        scale: Metres in one unit of the log.
        rotation_deg: Direction of the log's x axis in the plan, counter-clockwise.
        flip_y: Whether the log's y axis is the other way, as in pictures.
        origin: Where the log's (0, 0) is in the plan [m].
        matches: Places in both frames, two or more, instead of scale, rotation and origin: fitted
            to them by least squares.

    Example:
        >>> feet = LogFrame(scale=0.3048, rotation_deg=90, origin=(1, 2))
        >>> feet.to_plan(np.array([[10.0, 0.0]])).round(3).tolist()
        [[1.0, 5.048]]
        >>> corners = [{"log": (0, 0), "plan": (1, 2)}, {"log": (10, 0), "plan": (1, 5.048)}]
        >>> LogFrame(matches=corners).to_plan(np.array([[10.0, 10.0]])).round(3).tolist()
        [[-2.048, 5.048]]
    """

    name: str | None = None
    scale: float = Field(default=1.0, gt=0)
    rotation_deg: AngleDeg = 0.0
    flip_y: bool = False
    origin: tuple[Length, Length] = (0.0, 0.0)
    matches: tuple[Match, ...] = ()

    def model_post_init(self, _: object, /) -> None:
        """Require one definition of the frame."""
        if self.matches and {"scale", "rotation_deg", "origin"} & self.model_fields_set:
            raise problem("give matches, or scale, rotation_deg and origin, and not both")
        if self.matches and len({match.log for match in self.matches}) < 2:
            raise problem("matches: two different places are needed at least")

    def in_unit(self, unit_m: float | None) -> Self:
        """Return the frame of a log whose own unit is known [m].

        Raises:
            LogError: `scale` is another one.
        """
        if unit_m is None or self.matches or self.scale == unit_m:
            return self
        if "scale" in self.model_fields_set:
            raise LogError(
                f"frame.scale is {self.scale:g} m, but by the names of its columns the unit of the"
                f" log is {unit_m:g} m: leave out one of them"
            )
        return self.model_copy(update={"scale": unit_m})

    def to_plan(self, xy: F64) -> F64:
        """Return positions of the log, float64 (n, 2), as positions in the plan [m]."""
        (ax, ay), (bx, by) = self._factor()
        x = xy[:, 0]
        y = -xy[:, 1] if self.flip_y else xy[:, 1]
        return np.stack([ax * x - ay * y + bx, ay * x + ax * y + by], 1)

    def turn_headings(self, heading: F64) -> F64:
        """Return headings of the log [turns], float64 (n,), as headings in the plan [turns]."""
        ax, ay = self._factor()[0]
        turn = np.arctan2(ay, ax) / (2 * np.pi)  # callers round headings to 1/4096 turn
        sign = -1.0 if self.flip_y else 1.0
        return np.asarray(sign * heading + turn)

    def errors(self) -> F64:
        """Return the distance between each match's place in the plan and its fit [m], (n,)."""
        log = np.array([match.log for match in self.matches], np.float64).reshape(-1, 2)
        plan = np.array([match.plan for match in self.matches], np.float64).reshape(-1, 2)
        residuals = self.to_plan(log) - plan
        return np.sqrt(residuals[:, 0] ** 2 + residuals[:, 1] ** 2)

    def notes(self) -> list[str]:
        """Return a line about how well it fits its matches, if it has some."""
        if not self.matches:
            return []
        worst = float(self.errors().max())
        return [f"the frame fits its {len(self.matches)} matches to {worst:.2f} m"]

    def _factor(self) -> tuple[Pair, Pair]:
        """Return the complex numbers a and b of plan = a * log + b, as pairs."""
        if not self.matches:
            cosine, sine = _direction(self.rotation_deg)
            return (self.scale * cosine, self.scale * sine), self.origin
        sign = -1.0 if self.flip_y else 1.0
        log = [(match.log[0], sign * match.log[1]) for match in self.matches]
        plan = [match.plan for match in self.matches]
        lx, ly = _mean(log)
        px, py = _mean(plan)
        ax = ay = size = 0.0
        for (x, y), (u, v) in zip(log, plan, strict=True):
            x = x - lx
            y = y - ly
            u = u - px
            v = v - py
            ax += x * u + y * v
            ay += x * v - y * u
            size += x * x + y * y
        ax, ay = ax / size, ay / size
        return (ax, ay), (px - (ax * lx - ay * ly), py - (ay * lx + ax * ly))


def _mean(points: list[Pair]) -> Pair:
    x, y = (sum_in_order(axis) / len(points) for axis in zip(*points, strict=True))
    return x, y


def _direction(degrees: float) -> Pair:
    """Return the cosine and sine of an angle, the same on every machine.

    They are computed by their series, as the sines of C libraries differ in the last digit.
    """
    quarters, rest = divmod(degrees, 90.0)
    angle = rest * (3.141592653589793 / 180.0)
    cosine = sine = 0.0
    term = 1.0
    for n in range(24):  # later terms are below 1e-18
        if n % 2 == 0:
            cosine += term if n % 4 == 0 else -term
        else:
            sine += term if n % 4 == 1 else -term
        term = term * angle / (n + 1)
    for _ in range(int(quarters) % 4):
        cosine, sine = -sine, cosine
    return cosine, sine


def map_rooms(
    labels: Mapping[str, int], overrides: Mapping[str, RoomChoice | None], rooms: Sequence[Room]
) -> dict[str, RoomChoice | None]:
    """Return the candidate rooms of each label of a log, best first.

    `("away",)` means absent and `("door",)` the front door; None leaves the readings out.

    Args:
        labels: How many readings each label has.
        overrides: The user's choices for some labels; they take precedence over the usual meaning.
        rooms: The rooms of the home.

    Raises:
        LogError: A label is unknown, or stands for no room of this home.
    """
    _check_overrides(labels, overrides, rooms)
    mapped: dict[str, RoomChoice | None] = {}
    for label, count in labels.items():
        wish = overrides.get(label)
        usual = None if label in overrides else _usual(label, rooms)
        choice = usual if wish is None else _first_fit(wish, rooms)
        if choice is None and label not in overrides:
            raise LogError(
                f"no room of this home stands for {label!r} (readings in the log: {count}); choose"
                f" one by rooms: {{{label}: {_nearest(label, rooms)}}}, or another:"
                f" {', '.join(_names(rooms))}, away, door, or null to leave these readings out"
            )
        mapped[label] = choice
    return mapped


def _check_overrides(
    labels: Mapping[str, int], overrides: Mapping[str, RoomChoice | None], rooms: Sequence[Room]
) -> None:
    """Refuse labels that are not in the log, and rooms that are not in the home."""
    for label, choice in overrides.items():
        if label not in labels:
            raise LogError(
                f"rooms: the log has no room {label!r}{suggest(label, sorted(labels), 'It has')}"
            )
        if choice is not None and _first_fit(choice, rooms) is None:
            raise LogError(
                f"rooms: {label!r} is mapped to {' or '.join(choice)}, but there is no such room"
                f"{suggest(choice[0], _names(rooms))}, away, door"
            )


def _usual(label: str, rooms: Sequence[Room]) -> RoomChoice | None:
    """Return the usual meaning of a label in this home, if it has one."""
    if any(room.name == label for room in rooms):
        return (label,)
    kind = room_type(label)
    whole = _first_fit(USUAL_ROOMS.get(kind, (kind,)), rooms)
    return whole or _by_words(label, rooms)


def _by_words(label: str, rooms: Sequence[Room]) -> RoomChoice | None:
    """Return the room that a part of a label names, or the one in which a thing usually is."""
    fits = (_first_fit(choice, rooms) for choice in meanings(label))
    return next((fit for fit in fits if fit is not None), None)


def meanings(label: str) -> Iterator[RoomChoice]:
    """Yield the kinds of rooms that parts of a label may mean, the likeliest first.

    The last words count most: `binary_sensor.kitchen_motion` is in the kitchen, and the
    `Hall-Bedroom door` at the bedroom.

    Example:
        >>> next(meanings("binary_sensor.kitchen_motion_2"))
        ('kitchen_motion',)
        >>> ("kitchen",) in meanings("binary_sensor.kitchen_motion_2")
        True
    """
    words = re.findall(r"[A-Z]?[a-z]+|[A-Z]+|[^\W\d_]+", label)
    words = [word.lower() for word in words if word.lower() not in (DOOR, AWAY)]
    pairs = [f"{first}_{second}" for first, second in pairwise(words)]
    for word in (*reversed(pairs), *reversed(words)):
        yield THINGS.get(word) or USUAL_ROOMS.get(word) or (word,)


# Kinds of rooms in which much the same is done, the nearest first.
SIMILAR_ROOMS: dict[str, RoomChoice] = {
    "kitchen": ("dining_room", "living_room"),
    "dining_room": ("kitchen", "living_room"),
    "living_room": ("family_room", "lobby", "dining_room", "bedroom"),
    "bedroom": ("child_room", "guest_room", "living_room"),
    "child_room": ("bedroom", "living_room"),
    "guest_room": ("bedroom", "living_room"),
    "office": ("bedroom", "living_room"),
    "bathroom": ("toilet", "laundry", "bedroom"),
    "toilet": ("bathroom", "laundry", "bedroom"),
    "laundry": ("bathroom", "storage", "kitchen"),
    "storage": ("garage", "laundry", "hallway"),
    "garage": ("storage", "hallway"),
    "hallway": ("entryway", "lobby", "living_room"),
    "entryway": ("hallway", "lobby", "living_room"),
    "lobby": ("entryway", "hallway", "living_room"),
}


def _nearest(label: str, rooms: Sequence[Room]) -> str:
    """Return the name or the kind of the room that is most like a label's."""
    kinds = list(dict.fromkeys(room.type for room in rooms))
    kind = usual_type(room_type(label))
    close = difflib.get_close_matches(room_type(label), [*kinds, *(r.name for r in rooms)], 1)
    similar = (other for other in SIMILAR_ROOMS.get(kind, ()) if other in kinds)
    usual = "living_room" if "living_room" in kinds else kinds[0]
    return close[0] if close else next(similar, usual)


def _first_fit(choice: RoomChoice, rooms: Sequence[Room]) -> RoomChoice | None:
    """Return the first of some names that is a room, a function of one, away or door; else None."""
    names = {AWAY, DOOR, "any", *_names(rooms)}
    return next(((name,) for name in choice if name in names), None)


def _names(rooms: Collection[Room]) -> list[str]:
    names = [room.name for room in rooms]
    return names + sorted({word for room in rooms for word in room.words} - set(names))


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
    choices = [(reading, rooms[reading.room]) for reading in log.readings]
    intervals = [_interval(reading, choice[0], rule) for reading, choice in choices if choice]
    pieces, overruled = _sweep(intervals)
    visits = _without_gaps(_merge_pieces(pieces, rule), rule)
    return LoggedVisits(visits, len(choices) - len(intervals), overruled)


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
