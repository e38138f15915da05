"""Furnish a home by rule: pieces by the type of each room, at sensible places."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from types import MappingProxyType

import numpy as np

from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.furniture import FURNITURE
from fleet2d.floorplan.furniture_places import FurnitureGroup, Interior, Piece
from fleet2d.floorplan.placed_objects import number_objects
from fleet2d.floorplan.plan import FloorPlan, Room
from fleet2d.floorplan.rooms.room import LIVING_ROOM, day_room
from fleet2d.kernels import I64
from fleet2d.runtime.determinism import Draws, stream_key

# Sizes are drawn in steps of this [m].
STEP = 0.05
# Smallest and largest distance of the television from the sofa's back [m].
TV_DISTANCES_M = (2.0, 6.5)
# Types of rooms for a robot's charger, the best first.
CHARGER_ROOMS = ("hallway", "hall", "entryway", "lobby", "living_room", "dining_room", "office")
CHAIR_M = 0.45
# Distance between a sofa and its table [m].
LEG_ROOM = 0.35

GroupMaker = Callable[[Draws], list[FurnitureGroup]]


@dataclass(frozen=True)
class FurnitureRule:
    """A rule that puts a piece of furniture into a room.

    Attributes:
        type: The type of the piece; a room that has one gets no other.
        groups: Makes groups with the piece, the best first; None: the piece alone.
        min_m2: Smallest area of a room that gets it [m²].
        chance: Probability [%].
        unless: Types of rooms that make the piece unnecessary if the home has one.
    """

    type: str
    groups: GroupMaker | None = None
    min_m2: float = 0.0
    chance: int = 100
    unless: tuple[str, ...] = ()


# What a studio gets first.
ESSENTIAL = ("bed", "stove", "sink", "fridge")


def furnish(plan: FloorPlan, seed: int = 0, density: float = 1.0) -> FloorPlan:
    """Return a plan with furniture in its rooms, by their types.

    No piece stands within 0.9 m before a doorway, or where it would cut a route: free places that
    a body of 0.1 m to 0.25 m radius could walk between stay connected, and each piece is reachable.
    A room that has furniture already, or an unknown type, stays as it is, unless it serves as the
    living room of a home with rooms of known types. The same plan and seed
    give the same furniture on every machine.

    Args:
        plan: The home.
        seed: The seed of the choice and the places of pieces.
        density: Factor for the probability of optional pieces, 0 to 10.

    Raises:
        FloorPlanError: No body fits into the home; density is negative.

    Example:
        >>> import shapely
        >>> from fleet2d.floorplan.plan import FloorPlan, LabelledRegion
        >>> box = shapely.box(0, 0, 4, 3)
        >>> plan = FloorPlan.build("cabin", box, [LabelledRegion(("Bedroom",), box)])
        >>> [thing.name for thing in furnish(plan, density=0).objects]
        ['bed_1', 'nightstand_1', 'nightstand_2', 'wardrobe_1']
    """
    if not 0 <= density <= 10:
        raise FloorPlanError(
            f"the density of furniture is {density:g}: choose 0 (bare), 1 (usual) to 10"
        )
    interior = Interior(plan)
    kinds = {label for room in plan.rooms for label in (room.type, *room.labels)}
    serving = day_room(plan.rooms) if kinds.intersection(RULES) else None
    furnished = {room.index for room in plan.rooms if plan.objects_in(room)}
    for room in plan.rooms:
        if room.index not in furnished:
            uses = (LIVING_ROOM,) if room == serving else ()
            _furnish_room(interior, room, seed, density, kinds, uses)
    if all(thing.type != "charger" for thing in plan.objects):
        _place_charger(interior, seed)
    interior.remove_obstructions()
    return replace(plan, objects=number_objects(interior.objects))


def _furnish_room(
    interior: Interior,
    room: Room,
    seed: int,
    density: float,
    kinds: set[str],
    further_uses: tuple[str, ...] = (),
) -> None:
    first_uses = _first_uses(interior.plan, room)
    labels = dict.fromkeys((*first_uses, room.type, *room.labels, *further_uses))
    rules = [rule for label in labels for rule in RULES.get(label, ())]
    if first_uses:
        rules.sort(key=lambda rule: rule.type not in ESSENTIAL)
    draws = Draws(stream_key(seed, f"floorplan.{room.name}", "furniture"), room.index)
    first = len(interior.objects)
    for rule in rules:
        is_drawn = draws.below(100) < (100 if rule.chance == 100 else rule.chance * density)
        groups = rule.groups(draws) if rule.groups else _alone(rule.type, draws)
        present = {thing.type for thing in interior.objects[first:]}
        is_needless = any(kind in kinds and kind not in labels for kind in rule.unless)
        if not is_drawn or rule.type in present or is_needless or room.area_m2 < rule.min_m2:
            continue
        for group in groups:
            if interior.place(room, group, draws):
                break
        if rule.type == "sofa":
            _place_tv(interior, room, first, draws)


def _first_uses(plan: FloorPlan, room: Room) -> tuple[str, ...]:
    """Return what a room is furnished for before its type: a studio to sleep and to cook in."""
    lived_in = {other.type for other in plan.rooms}
    if room.type != "living_room" or "bedroom" not in room.labels or "bedroom" in lived_in:
        return ()
    return tuple(kind for kind in ("bedroom", "kitchen") if kind in room.labels)


def _place_tv(interior: Interior, room: Room, first: int, draws: Draws) -> None:
    """Put a television against the wall that the sofa faces, as near to its middle as possible."""
    things = {thing.type: thing for thing in interior.objects[first:]}
    sofa = things.get("sofa")
    if sofa is None or "tv" in things:
        return
    cell = interior.plan.lattice.cell
    turn_of_sofa = round(sofa.heading / (np.pi / 2)) - 1
    turn_of_tv = (turn_of_sofa + 2) % 4
    middle = sofa.footprint.centroid
    view = interior.view(room)
    u, v = view.turn_place(turn_of_tv, middle.x, middle.y)
    group = replace(_alone("tv", draws)[0], corner=0, away=0)

    def score(places: I64, size: tuple[int, int]) -> I64:
        turn, row, column = places.T
        off = np.abs(2 * column + size[0] - round(2 * u))  # in half cells
        ahead = (v - row) * cell
        is_far = (ahead > TV_DISTANCES_M[0]) & (ahead < TV_DISTANCES_M[1])
        faces = turn == turn_of_tv
        return np.where(faces & is_far & (off * cell < 2.0), 4000 - 10 * off, -1).astype(np.int64)

    interior.place(room, group, draws, score)


def _place_charger(interior: Interior, seed: int) -> None:
    rooms = interior.plan.rooms
    candidates = [room for kind in CHARGER_ROOMS for room in rooms if room.type == kind]
    draws = Draws(stream_key(seed, "floorplan", "charger"), 0)
    for room in candidates:
        if interior.place(room, replace(_alone("charger", draws)[0], away=0), draws):
            return


# --- Groups of pieces ---------------------------------------------------------------------


def _size(kind: str, draws: Draws) -> tuple[float, float]:
    """Draw the width and depth of a type [m]."""
    model = FURNITURE[kind]
    width, depth = (
        low + STEP * draws.below(round((high - low) / STEP) + 1)
        for low, high in (model.width, model.depth)
    )
    return width, depth


def _alone(kind: str, draws: Draws) -> list[FurnitureGroup]:
    """Return one piece as two groups to try: of a drawn size, and of its smallest size.

    The smallest is for rooms in which the first finds no place.
    """
    model = FURNITURE[kind]
    width, depth = _size(kind, draws)
    small = (model.width[0], model.depth[0])
    sizes = [(width, depth)] if (width, depth) == small else [(width, depth), small]
    return [
        FurnitureGroup(w, d, (Piece(kind, 0, 0, w, d),), wall=model.wall, front=model.front_m)
        for w, d in sizes
    ]


def _row(kinds: tuple[str, ...], draws: Draws) -> FurnitureGroup:
    """Return pieces side by side along a wall."""
    at = 0.0
    pieces = []
    for kind in kinds:
        width, depth = _size(kind, draws)
        pieces.append(Piece(kind, at, 0, width, depth))
        at += width
    deepest = max(piece.depth for piece in pieces)
    front = max(FURNITURE[kind].front_m for kind in kinds)
    return FurnitureGroup(at, deepest, tuple(pieces), front=front)


def _bed(draws: Draws, kind: str, side: float) -> list[FurnitureGroup]:
    """Make beds with floor on one side or both (`side` [m] wide), and nightstands there."""
    width, depth = _size(kind, draws)
    least = FURNITURE[kind].width[0]
    stand = (0.45, 0.4)
    left = Piece("nightstand", side - stand[0], 0, *stand)
    groups = []
    for wide in (width, least):
        bed = Piece(kind, side, 0, wide, depth)
        right = Piece("nightstand", side + wide, 0, *stand)
        if kind == "bed":
            groups.append(FurnitureGroup(wide + 2 * side, depth, (bed, left, right), front=0.4))
        groups.append(FurnitureGroup(wide + side, depth, (bed, left), front=0.3))
        groups.append(FurnitureGroup(wide + side, depth, (replace(bed, left=0.0),)))
    groups.append(FurnitureGroup(least, depth, (Piece(kind, 0, 0, least, depth),)))
    return groups


def _beds(draws: Draws) -> list[FurnitureGroup]:
    return [*_bed(draws, "bed", 0.55), *_bed(draws, "single_bed", 0.5)]


def _lounge(draws: Draws) -> list[FurnitureGroup]:
    """Make a sofa with a table before it and an armchair beside the table; or with less."""
    width, depth = _size("sofa", draws)
    table_w, table_d = _size("coffee_table", draws)
    seat, _ = _size("armchair", draws)
    sofa = Piece("sofa", 0, 0, width, depth)
    ahead = depth + LEG_ROOM
    table = Piece("coffee_table", (width - table_w) / 2, ahead, table_w, table_d)
    beside = Piece("armchair", width + 0.1, ahead - 0.1, seat, seat, turn=1)
    large = partial(FurnitureGroup, front=0.5, corner=15)
    smallest = (FURNITURE["sofa"].width[0], FURNITURE["sofa"].depth[0])
    small = Piece("sofa", 0, 0, *smallest)
    return [
        large(width + 0.1 + seat, ahead + max(table_d, seat), (sofa, table, beside)),
        large(width, ahead + table_d, (sofa, table)),
        large(width, depth, (sofa,)),
        FurnitureGroup(*smallest, (small,), front=0.4),
    ]


def _cinema(draws: Draws) -> list[FurnitureGroup]:
    """Make a television at a wall and, in the middle of a large room, a lounge that faces it."""
    width, depth = _size("sofa", draws)
    table_w, table_d = _size("coffee_table", draws)
    tv_w, tv_d = _size("tv", draws)
    table = Piece("coffee_table", (width - table_w) / 2, tv_d + 1.2, table_w, table_d)
    sofa = Piece("sofa", 0, table.ahead + table_d + LEG_ROOM, width, depth, turn=2)
    tv = Piece("tv", (width - tv_w) / 2, 0, tv_w, tv_d)
    return [FurnitureGroup(width, sofa.ahead + depth, (tv, table, sofa), corner=0)]


def _dining(draws: Draws, seats: int) -> list[FurnitureGroup]:
    """Make tables with chairs along their long sides, the largest first."""
    width, depth = _size("table", draws)
    groups = []
    for wide, deep, chairs in ((width, depth, seats), (1.2, 0.8, min(seats, 4)), (1.2, 0.8, 2)):
        gap = CHAIR_M + 0.05
        pieces = [Piece("table", 0, gap, wide, deep)]
        a_side = (chairs if wide >= 1.6 else min(chairs, 4)) // 2
        for k in range(a_side):
            # The outer chairs stand at the places of the catalogue where people sit.
            left = wide * (0.2 + 0.6 * k / max(a_side - 1, 1)) - CHAIR_M / 2
            pieces.append(Piece("chair", left, 0, CHAIR_M, CHAIR_M))
            pieces.append(Piece("chair", left, deep + gap + 0.05, CHAIR_M, CHAIR_M, turn=2))
        size = (wide, deep + 2 * gap)
        groups.append(FurnitureGroup(*size, tuple(pieces), wall=False, corner=0, away=30))
    return groups


def _desk(draws: Draws) -> list[FurnitureGroup]:
    """Make a desk with its chair."""
    groups = []
    for width, depth in (_size("desk", draws), (1.2, 0.6)):
        chair = Piece("chair", width / 2 - CHAIR_M / 2, depth + 0.05, CHAIR_M, CHAIR_M, turn=2)
        pieces = (Piece("desk", 0, 0, width, depth), chair)
        groups.append(FurnitureGroup(width, depth + CHAIR_M + 0.05, pieces, front=0.2))
    return groups


def _kitchen(draws: Draws) -> list[FurnitureGroup]:
    """Make kitchens along a wall, the longest first."""
    counter = "kitchen_counter"
    rows = (
        ("fridge", counter, "sink", counter, "stove", counter),
        ("fridge", counter, "sink", counter, "stove"),
        ("fridge", "sink", counter, "stove"),
        ("sink", counter, "stove"),
        ("sink", "stove"),
    )
    groups = [_row(row, draws) for row in rows]
    if not draws.below(2):
        return groups
    return [_mirrored(group) for group in groups]


def _mirrored(group: FurnitureGroup) -> FurnitureGroup:
    """Return a group whose pieces stand from right to left."""
    pieces = [replace(p, left=group.width - p.left - p.width) for p in group.pieces]
    return replace(group, pieces=tuple(pieces))


_DINE = partial(_dining, seats=4)
_SLEEP = (
    FurnitureRule("wardrobe", min_m2=6),
    FurnitureRule("desk", _desk, min_m2=11, chance=35, unless=("office",)),
    FurnitureRule("dresser", min_m2=12, chance=50),
    FurnitureRule("bookshelf", min_m2=14, chance=30),
)
_WASH = (FurnitureRule("toilet"), FurnitureRule("washbasin"))
_STORE = (FurnitureRule("shelf"), FurnitureRule("dresser", min_m2=5, chance=60))
_ENTER = (
    FurnitureRule("shoe_rack", min_m2=3, chance=80),
    FurnitureRule("bench", min_m2=7, chance=40),
)

RULES = MappingProxyType(
    {
        "bedroom": (FurnitureRule("bed", _beds, min_m2=4), *_SLEEP),
        "guest_room": (FurnitureRule("bed", _beds, min_m2=4), *_SLEEP[:3]),
        "child_room": (
            FurnitureRule("single_bed", partial(_bed, kind="single_bed", side=0.5), min_m2=4),
            FurnitureRule("desk", _desk, min_m2=8),
            *_SLEEP[:1],
            FurnitureRule("bookshelf", min_m2=10, chance=60),
        ),
        "living_room": (
            FurnitureRule("sofa", _cinema, min_m2=30),
            FurnitureRule("sofa", _lounge, min_m2=6),
            FurnitureRule("table", _DINE, min_m2=18, chance=80, unless=("dining_room", "kitchen")),
            FurnitureRule("bookshelf", min_m2=14, chance=70),
            FurnitureRule("dresser", min_m2=20, chance=60),
        ),
        "dining_room": (
            FurnitureRule("table", partial(_dining, seats=6), min_m2=5),
            FurnitureRule("dresser", min_m2=12, chance=60),
        ),
        "kitchen": (
            FurnitureRule("stove", _kitchen),
            FurnitureRule("fridge"),
            FurnitureRule("sink"),
            FurnitureRule("stove"),
            FurnitureRule("table", _DINE, min_m2=12, unless=("dining_room",)),
        ),
        "bathroom": (
            *_WASH,
            FurnitureRule("bathtub", min_m2=5.5, chance=60),
            FurnitureRule("shower", min_m2=2.5),
            FurnitureRule("washing_machine", min_m2=5, unless=("laundry",)),
        ),
        "toilet": _WASH,
        "office": (
            FurnitureRule("desk", _desk, min_m2=3),
            FurnitureRule("bookshelf", min_m2=6),
            FurnitureRule("armchair", min_m2=12, chance=50),
        ),
        "laundry": (
            FurnitureRule("washing_machine"),
            FurnitureRule("sink", min_m2=4),
            FurnitureRule("shelf", min_m2=4, chance=70),
        ),
        "gym": (FurnitureRule("treadmill", min_m2=6), FurnitureRule("bench", min_m2=8)),
        "garage": (FurnitureRule("workbench", min_m2=10), FurnitureRule("shelf", min_m2=10)),
        "storage": _STORE,
        "boiler_room": _STORE[:1],
        "wardrobe": (FurnitureRule("wardrobe"), FurnitureRule("dresser", min_m2=5)),
        "entryway": _ENTER,
        "lobby": _ENTER,
        "hallway": (FurnitureRule("shoe_rack", min_m2=5, chance=50, unless=("entryway",)),),
        "hall": (FurnitureRule("bench", min_m2=8, chance=50),),
    }
)
"""The rules of each type of room, in order; other types get no furniture."""
