"""Furnish a home by rule: what belongs in each type of room, in sensible places."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.arrangement import number_objects
from fleet2d.floorplan.furniture.catalogue import FURNITURE
from fleet2d.floorplan.furniture.interior import Interior
from fleet2d.floorplan.furniture.room_view import Group, Piece
from fleet2d.floorplan.plan import FloorPlan, Room
from fleet2d.streams import Draws, stream_key

# Sizes are drawn in steps of this [m].
STEP = 0.05
# The television is this far from the sofa's back, least and most [m].
WATCHING = (2.0, 6.5)
# Where a robot's charger stands: the first of these that the home has.
CHARGER_ROOMS = ("hallway", "hall", "entryway", "lobby", "living_room", "dining_room", "office")
CHAIR_M = 0.45
# Between a sofa and its table; between a thing and the next beside it.
LEG_ROOM = 0.35

Makers = Callable[[Draws], list[Group]]


@dataclass(frozen=True)
class Step:
    """Something that a room is given.

    Attributes:
        type: The piece that it is about: a room that has one is not given another.
        groups: Makes the ways to place it, the best first.
        least_m2: Smallest room that gets it [m²].
        chance: How likely it is there, per cent.
        unless: Room types that make it needless here if the home has one.
    """

    type: str
    groups: Makers
    least_m2: float = 0.0
    chance: int = 100
    unless: tuple[str, ...] = ()


def furnish(plan: FloorPlan, seed: int = 0, density: float = 1.0) -> FloorPlan:
    """Return a plan with furniture in its rooms, by their types.

    Nothing is put before a doorway (0.9 m) or where it would cut a way: whatever two places a body
    of 0.25 m radius could walk between, it still can where both are still free, and each piece can
    be got to. A room that holds furniture already, or is of no known type, is left as it is. The
    same plan and seed give the same furniture on every machine.

    Args:
        plan: The home.
        seed: Which of the many ways to furnish it.
        density: How likely what is not essential is there, from 0 (never) through 1 (usual).

    Raises:
        FloorPlanError: No body fits into the home; density is negative.

    Example:
        >>> import shapely
        >>> from fleet2d.floorplan.plan import FloorPlan, LabelledRegion
        >>> box = shapely.box(0, 0, 4, 3)
        >>> plan = FloorPlan.build("cabin", box, [LabelledRegion(("Bedroom",), box)])
        >>> [thing.name for thing in furnish(plan, density=0).objects]
        ['bed_0', 'nightstand_0', 'wardrobe_0']
    """
    if not 0 <= density <= 10:
        raise FloorPlanError(
            f"the density of furniture is {density:g}: choose 0 (bare), 1 (usual) to 10"
        )
    interior = Interior(plan)
    kinds = {label for room in plan.rooms for label in (room.type, *room.labels)}
    held = {room.index for room in plan.rooms if plan.objects_in(room)}
    for room in plan.rooms:
        if room.index not in held:
            _furnish_room(interior, room, seed, density, kinds)
    if all(thing.type != "charger" for thing in plan.objects):
        _place_charger(interior, seed)
    return replace(plan, objects=number_objects(interior.objects))


def _furnish_room(
    interior: Interior, room: Room, seed: int, density: float, kinds: set[str]
) -> None:
    labels = dict.fromkeys((room.type, *room.labels))
    steps = [step for label in labels for step in RULES.get(label, ())]
    draws = Draws(stream_key(seed, f"floorplan.{room.name}", "furniture"), room.index)
    first = len(interior.objects)
    for step in steps:
        lucky = draws.below(100) < (100 if step.chance == 100 else step.chance * density)
        groups = step.groups(draws)
        has = {thing.type for thing in interior.objects[first:]}
        needless = any(kind in kinds and kind not in labels for kind in step.unless)
        if not lucky or step.type in has or needless or room.area_m2 < step.least_m2:
            continue
        for group in groups:
            if interior.place(room, group, draws):
                break
        if step.type == "sofa":
            _place_tv(interior, room, first, draws)


def _place_tv(interior: Interior, room: Room, first: int, draws: Draws) -> None:
    """Put a television against the wall that the sofa faces, as far in the middle as can be."""
    here = {thing.type: thing for thing in interior.objects[first:]}
    sofa = here.get("sofa")
    if sofa is None or "tv" in here:
        return
    cell = interior.plan.lattice.cell
    turn_of_sofa = round(sofa.heading / (np.pi / 2)) - 1
    middle = sofa.footprint.centroid
    group = replace(_alone("tv", draws)[0], corner=0, away=0)

    def opposite(
        turn: int, shape: tuple[int, int], size: tuple[int, int]
    ) -> NDArray[np.int64] | None:
        if turn != (turn_of_sofa + 2) % 4:
            return None
        u, v = view.turned(turn, middle.x, middle.y)
        rows, columns = np.indices(shape)
        off = np.abs(2 * columns + size[0] - round(2 * u))  # in half cells
        ahead = (v - rows) * cell
        seen = (ahead > WATCHING[0]) & (ahead < WATCHING[1]) & (off * cell < 2.0)
        return np.where(seen, 4000 - 10 * off, -1).astype(np.int64)

    view = interior.view(room)
    interior.place(room, group, draws, opposite)


def _place_charger(interior: Interior, seed: int) -> None:
    rooms = interior.plan.rooms
    wanted = [room for kind in CHARGER_ROOMS for room in rooms if room.type == kind]
    draws = Draws(stream_key(seed, "floorplan", "charger"), 0)
    for room in wanted:
        if interior.place(room, replace(_alone("charger", draws)[0], away=0), draws):
            return


# --- What belongs together ---------------------------------------------------------------------


def _size(kind: str, draws: Draws) -> tuple[float, float]:
    """Draw the width and depth of a type [m]."""
    model = FURNITURE[kind]
    width, depth = (
        low + STEP * draws.below(round((high - low) / STEP) + 1)
        for low, high in (model.width, model.depth)
    )
    return width, depth


def _alone(kind: str, draws: Draws) -> list[Group]:
    """Return a piece by itself; if that doesn't fit, the smallest that there is."""
    model = FURNITURE[kind]
    width, depth = _size(kind, draws)
    small = (model.width[0], model.depth[0])
    sizes = [(width, depth)] if (width, depth) == small else [(width, depth), small]
    return [
        Group(w, d, (Piece(kind, 0, 0, w, d),), wall=model.wall, front=model.front_m)
        for w, d in sizes
    ]


def _row(kinds: tuple[str, ...], draws: Draws) -> Group:
    """Return pieces side by side along a wall."""
    at, pieces = 0.0, []
    for kind in kinds:
        width, depth = _size(kind, draws)
        pieces.append(Piece(kind, at, 0, width, depth))
        at += width
    deepest = max(piece.depth for piece in pieces)
    front = max(FURNITURE[kind].front_m for kind in kinds)
    return Group(at, deepest, tuple(pieces), front=front)


def _of(kind: str) -> Makers:
    return lambda draws: _alone(kind, draws)


def _bed(kind: str, side: float) -> Makers:
    """Make a bed with floor (`side` [m]) to one or both sides, and nightstands there."""

    def make(draws: Draws) -> list[Group]:
        width, depth = _size(kind, draws)
        least = FURNITURE[kind].width[0]
        stand = (0.45, 0.4)
        left = Piece("nightstand", side - stand[0], 0, *stand)
        groups = []
        for wide in (width, least):
            bed = Piece(kind, side, 0, wide, depth)
            right = Piece("nightstand", side + wide, 0, *stand)
            if kind == "bed":
                groups.append(Group(wide + 2 * side, depth, (bed, left, right), front=0.4))
            groups.append(Group(wide + side, depth, (bed, left), front=0.3))
            groups.append(Group(wide + side, depth, (replace(bed, left=0.0),)))
        groups.append(Group(least, depth, (Piece(kind, 0, 0, least, depth),)))
        return groups

    return make


def _beds(draws: Draws) -> list[Group]:
    return [*_bed("bed", 0.55)(draws), *_bed("single_bed", 0.5)(draws)]


def _lounge(draws: Draws) -> list[Group]:
    """Make a sofa with its table before it, and an armchair beside that."""
    width, depth = _size("sofa", draws)
    table_w, table_d = _size("coffee_table", draws)
    seat, _ = _size("armchair", draws)
    sofa = Piece("sofa", 0, 0, width, depth)
    ahead = depth + LEG_ROOM
    table = Piece("coffee_table", (width - table_w) / 2, ahead, table_w, table_d)
    beside = Piece("armchair", width + 0.1, ahead - 0.1, seat, seat, turn=1)
    both = Group(width, ahead + table_d, (sofa, table), front=0.5, corner=15)
    small = Piece("sofa", 0, 0, FURNITURE["sofa"].width[0], FURNITURE["sofa"].depth[0])
    return [
        Group(
            width + 0.1 + seat,
            ahead + max(table_d, seat),
            (sofa, table, beside),
            front=0.5,
            corner=15,
        ),
        both,
        Group(width, depth, (sofa,), front=0.5, corner=15),
        Group(small.width, small.depth, (small,), front=0.4),
    ]


def _cinema(draws: Draws) -> list[Group]:
    """Make a television at a wall and, facing it in the middle of a large room, a lounge."""
    width, depth = _size("sofa", draws)
    table_w, table_d = _size("coffee_table", draws)
    tv_w, tv_d = _size("tv", draws)
    table = Piece("coffee_table", (width - table_w) / 2, tv_d + 1.2, table_w, table_d)
    sofa = Piece("sofa", 0, table.ahead + table_d + LEG_ROOM, width, depth, turn=2)
    tv = Piece("tv", (width - tv_w) / 2, 0, tv_w, tv_d)
    return [Group(width, sofa.ahead + depth, (tv, table, sofa), corner=0)]


def _dining(seats: int) -> Makers:
    """Make a table with chairs along its long sides; smaller if that doesn't fit."""

    def make(draws: Draws) -> list[Group]:
        width, depth = _size("table", draws)
        groups = []
        for wide, deep, chairs in ((width, depth, seats), (1.2, 0.8, min(seats, 4)), (1.2, 0.8, 2)):
            gap = CHAIR_M + 0.05
            table = Piece("table", 0, gap, wide, deep)
            chairs = chairs if wide >= 1.6 else min(chairs, 4)
            pieces = [table]
            for k in range(chairs // 2):
                # The outer ones stand where the catalogue has people sit.
                left = wide * (0.2 + 0.6 * k / max(chairs // 2 - 1, 1)) - CHAIR_M / 2
                pieces.append(Piece("chair", left, 0, CHAIR_M, CHAIR_M))
                pieces.append(Piece("chair", left, deep + gap + 0.05, CHAIR_M, CHAIR_M, turn=2))
            groups.append(Group(wide, deep + 2 * gap, tuple(pieces), wall=False, corner=0, away=30))
        return groups

    return make


def _desk(draws: Draws) -> list[Group]:
    """Make a desk with its chair."""
    groups = []
    for width, depth in (_size("desk", draws), (1.2, 0.6)):
        chair = Piece("chair", width / 2 - CHAIR_M / 2, depth + 0.05, CHAIR_M, CHAIR_M, turn=2)
        pieces = (Piece("desk", 0, 0, width, depth), chair)
        groups.append(Group(width, depth + CHAIR_M + 0.05, pieces, front=0.2))
    return groups


def _kitchen(draws: Draws) -> list[Group]:
    """Make a kitchen along a wall, as long as there is room for."""
    counter = "kitchen_counter"
    rows = (
        ("fridge", counter, "sink", counter, "stove", counter),
        ("fridge", counter, "sink", counter, "stove"),
        ("fridge", "sink", counter, "stove"),
        ("sink", counter, "stove"),
        ("sink", "stove"),
    )
    groups = [_row(row, draws) for row in rows]
    if draws.below(2):
        groups = [_mirrored(group) for group in groups]
    return groups


def _mirrored(group: Group) -> Group:
    """Return a group with left and right exchanged; nothing in it may face sideways."""
    pieces = [replace(p, left=group.width - p.left - p.width) for p in group.pieces]
    return replace(group, pieces=tuple(pieces))


_SLEEP = (
    Step("wardrobe", _of("wardrobe"), least_m2=6),
    Step("desk", _desk, least_m2=11, chance=35, unless=("office",)),
    Step("dresser", _of("dresser"), least_m2=12, chance=50),
    Step("bookshelf", _of("bookshelf"), least_m2=14, chance=30),
)
_WASH = (
    Step("toilet", _of("toilet")),
    Step("washbasin", _of("washbasin")),
)
_STORE = (
    Step("shelf", _of("shelf")),
    Step("dresser", _of("dresser"), least_m2=5, chance=60),
)
_ENTER = (
    Step("shoe_rack", _of("shoe_rack"), least_m2=3, chance=80),
    Step("bench", _of("bench"), least_m2=7, chance=40),
)

RULES = MappingProxyType(
    {
        "bedroom": (Step("bed", _beds, least_m2=4), *_SLEEP),
        "guest_room": (Step("bed", _beds, least_m2=4), *_SLEEP[:3]),
        "child_room": (
            Step("single_bed", _bed("single_bed", 0.5), least_m2=4),
            Step("desk", _desk, least_m2=8),
            *_SLEEP[:1],
            Step("bookshelf", _of("bookshelf"), least_m2=10, chance=60),
        ),
        "living_room": (
            Step("sofa", _cinema, least_m2=30),
            Step("sofa", _lounge, least_m2=6),
            Step("table", _dining(4), least_m2=18, chance=80, unless=("dining_room", "kitchen")),
            Step("bookshelf", _of("bookshelf"), least_m2=14, chance=70),
            Step("dresser", _of("dresser"), least_m2=20, chance=60),
        ),
        "dining_room": (
            Step("table", _dining(6), least_m2=5),
            Step("dresser", _of("dresser"), least_m2=12, chance=60),
        ),
        "kitchen": (
            Step("stove", _kitchen),
            Step("fridge", _of("fridge")),
            Step("sink", _of("sink")),
            Step("stove", _of("stove")),
            Step("table", _dining(4), least_m2=12, unless=("dining_room",)),
        ),
        "bathroom": (
            *_WASH,
            Step("bathtub", _of("bathtub"), least_m2=5.5, chance=60),
            Step("shower", _of("shower"), least_m2=2.5),
            Step("washing_machine", _of("washing_machine"), least_m2=5, unless=("laundry",)),
        ),
        "toilet": _WASH,
        "office": (
            Step("desk", _desk, least_m2=3),
            Step("bookshelf", _of("bookshelf"), least_m2=6),
            Step("armchair", _of("armchair"), least_m2=12, chance=50),
        ),
        "laundry": (
            Step("washing_machine", _of("washing_machine")),
            Step("sink", _of("sink"), least_m2=4),
            Step("shelf", _of("shelf"), least_m2=4, chance=70),
        ),
        "gym": (
            Step("treadmill", _of("treadmill"), least_m2=6),
            Step("bench", _of("bench"), least_m2=8),
        ),
        "garage": (
            Step("workbench", _of("workbench"), least_m2=10),
            Step("shelf", _of("shelf"), least_m2=10),
        ),
        "storage": _STORE,
        "boiler_room": _STORE[:1],
        "wardrobe": (
            Step("wardrobe", _of("wardrobe")),
            Step("dresser", _of("dresser"), least_m2=5),
        ),
        "entryway": _ENTER,
        "lobby": _ENTER,
        "hallway": (
            Step("shoe_rack", _of("shoe_rack"), least_m2=5, chance=50, unless=("entryway",)),
        ),
        "hall": (Step("bench", _of("bench"), least_m2=8, chance=50),),
    }
)
"""What each type of room is given, in order; other types get nothing."""
