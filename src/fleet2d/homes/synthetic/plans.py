"""Layouts of synthetic homes: rooms in groups, in wings, as rectangles."""

from collections import defaultdict
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from math import fsum, sqrt

import numpy as np

from fleet2d.homes.synthetic.program import Brief, Choices
from fleet2d.homes.synthetic.slicing import (
    MAX_DEPTH,
    MIN_DEPTH,
    UNITS_PER_M,
    UNITS_PER_M2,
    WALL,
    Areas,
    Box,
    Cut,
    LayoutRequest,
    Leaf,
    MisfitError,
    Slot,
    Strip,
    Tree,
    TreeWays,
    Wall,
    Wing,
    are_promising,
    gross_area,
    limits_of,
    row,
)
from fleet2d.kernels import CorridorRule
from fleet2d.runtime.determinism import sum_in_order

RoomGroup = list[Slot]
"""Slots that stay next to each other in this order."""
Placing = Callable[[Areas], list[Box]]
"""Places the rooms of a plan by their gross areas [units²]; MisfitError: they do not fit."""

# Minimum depth of the core [units].
MIN_CORE_DEPTH = 70
# Minimum depth of a column of rooms beside the core [units].
MIN_COLUMN_DEPTH = 40
# Times that a part of a layout is drawn before it is given up.
TRIES = 3
# Length of rows, squared, over the area of their rooms [%].
LENGTH_RATIOS = (55, 70, 85, 105, 130, 160, 195)


@dataclass(frozen=True)
class Service:
    """A block of garage and what is beside it.

    Attributes:
        ways: Ways to divide it.
        width: Its width, where the core is high enough [units].
        whole: Whether it is as high as the core in any case.
        at_high: Whether it is flush with the core's high side, else with its low one.
        out: How far it stands out there [units].
    """

    ways: TreeWays
    width: int
    whole: bool
    at_high: bool
    out: int

    def boxes(self, areas: Areas, right: int, low: int, high: int) -> list[Box]:
        """Return its rooms left of a core between two heights [units]."""
        area = self.ways.area(areas)
        height = min(int(area / self.width + 0.5), high - low)
        if self.whole or height > high - low - 20:
            height = high - low
        if not self.whole:
            low, high = (low, high + self.out) if self.at_high else (low - self.out, high)
        low, high = (high - height, high) if self.at_high else (low, low + height)
        width = int(area / height + 0.5)
        return self.ways.squarest(areas, (right - width, low, right, high))


class Sketch:
    """The rooms of a home while their layout is drawn, in groups by where they may go.

    Attributes:
        briefs: The rooms, and the hallways that the layout adds.
        entry: The group with the entryway, or None; its first slot is the entryway.
        private: Groups for strips; the first is that of the main bedroom, which comes last in it.
        service: Rooms for a block of their own: garage, gym and what goes with them.
        pantry: Small rooms beside the kitchen.
        closet: A small room for the end of a corridor, or None.
    """

    def __init__(self, request: LayoutRequest, choices: Choices) -> None:
        """Group the rooms by where they may go."""
        self.request = request
        self.choices = choices
        self.briefs = list(request.briefs)
        self.areas = {i: brief.area for i, brief in enumerate(self.briefs)}  # [m²]
        self.gross = np.array([gross_area(area) for area in self.areas.values()])
        self.of_kind: defaultdict[str, list[int]] = defaultdict(list)
        for i, brief in enumerate(self.briefs):
            self.of_kind[brief.kind].append(i)
        self.entry: RoomGroup | None = None
        self.closet: int | None = None
        self.private: list[RoomGroup] = []
        self.pantry: list[int] = []
        with_garage = bool(self.of_kind["garage"])
        self.service = self.of_kind["garage"] + self.of_kind["gym"] * with_garage
        small = self._small_rooms()
        shared = [i for i in self.of_kind["bathroom"] if self.briefs[i].partner is None]
        fronts = choices.shuffled(shared + small)
        for bed in self.of_kind["bedroom"]:
            owned = [i for i, brief in enumerate(self.briefs) if brief.partner == bed]
            self.private.append([*self._beside(owned, fronts), (bed,)])
        if self.of_kind["entryway"]:
            self.entry = [(self.of_kind["entryway"][0],), *self._coat_room(fronts)]
        for room in fronts:
            if self.briefs[room].kind == "bathroom":
                self.private.append([(room,)])
            elif self.closet is None and self.briefs[room].kind in ("storage", "toilet"):
                self.closet = room
            else:
                self.pantry.append(room)
        others = self.of_kind["office"] + self.of_kind["gym"] * (not with_garage)
        self.private += [[(room,)] for room in others]

    def _small_rooms(self) -> list[int]:
        """Return the small rooms for strips; the others go to the service block or the kitchen."""
        strip_rooms = list(self.of_kind["toilet"])
        for room in self.of_kind["laundry"] + self.of_kind["storage"]:
            place = self.choices.weighted((("service", 60), ("pantry", 25), ("strip", 15)))
            if place == "service" and self.service:
                self.service.append(room)
            elif place == "strip" or self.pantry:
                strip_rooms.append(room)
            else:
                self.pantry.append(room)
        return strip_rooms

    def _beside(self, owned: list[int], fronts: list[int]) -> list[Slot]:
        """Return the slots beside a bedroom: its own room at the back, a shared one before it."""
        if len(owned) >= 2:
            first, second = sorted(owned, key=self.areas.__getitem__)[:2]
            return [(first, second)]
        if owned and fronts and self.choices.chance(60):
            return [(fronts.pop(), owned[0])]
        return [(room,) for room in owned]

    def _coat_room(self, fronts: list[int]) -> list[Slot]:
        """Return, for some homes, a toilet for beside the entryway and a coat room behind that."""
        toilets = [i for i in fronts if self.briefs[i].kind == "toilet"]
        closets = [i for i in fronts if self.briefs[i].kind == "storage"]
        if toilets and closets and self.choices.chance(75):
            fronts.remove(toilets[0])
            fronts.remove(closets[0])
            return [(toilets[0], closets[0])]
        return []

    def add_hallway(self) -> int:
        """Add a hallway and return its index."""
        self.briefs.append(Brief("hallway", 0.0))
        return len(self.briefs) - 1

    # --- Core and service block ------------------------------------------------------------------

    def core_trees(self) -> list[Tree]:
        """Draw trees of living room, dining room and kitchen; wings join at high x or high y."""
        choices = self.choices
        living = Leaf(self.of_kind["living_room"][-1])
        trees: list[Tree] = []
        for across in (True, False):
            kitchen = self._kitchen(across)
            if self.of_kind["dining_room"]:
                dining = Leaf(self.of_kind["dining_room"][-1])
                sides = (Cut(not across, (dining, kitchen)), Cut(not across, (kitchen, dining)))
                trees += [Cut(across, (side, living)) for side in sides]
                trees += [Cut(across, (living, side)) for side in sides]
                trees.append(Cut(across, (kitchen, dining, living)))
                trees.append(Cut(across, (living, dining, kitchen)))
                continue
            trees += [Cut(across, (kitchen, living)), Cut(across, (living, kitchen))]
            share = choices.between(45, 65)
            low = Leaf(living.room, share)
            high = Leaf(living.room, 100 - share)
            trees.append(Cut(across, (low, Cut(not across, (kitchen, high)))))
        return choices.shuffled(trees)[: max(5, len(trees) * 5 // 6)]

    def _kitchen(self, across: bool) -> Tree:
        """Return the kitchen, with small rooms at one end of it."""
        kitchen = Leaf(self.of_kind["kitchen"][-1])
        pantry = tuple(map(Leaf, self.pantry))
        if not pantry:
            return kitchen
        pair = (Cut(across, pantry) if len(pantry) > 1 else pantry[0], kitchen)
        return Cut(not across, pair if self.choices.chance(50) else pair[::-1])

    def service_block(self) -> Service | None:
        """Draw a block of garage and what is beside it."""
        if not self.service:
            return None
        choices = self.choices
        garage, *others = map(Leaf, self.service)
        trees: list[Tree] = []
        for across in (True, False):
            rest = others[0] if len(others) == 1 else Cut(not across, tuple(others))
            trees += [Cut(across, (garage, rest)), Cut(across, (rest, garage))]
        if not others:
            trees = [garage]
        return Service(
            TreeWays(choices.shuffled(trees)),
            choices.between(72, 130),
            self.request.outline is not None,
            choices.chance(50),
            choices.choice((0, 0, 20, 40)),
        )

    # --- Wings -----------------------------------------------------------------------------------

    def wing(
        self, groups: Sequence[RoomGroup], hall: int, outline: str | None, is_main: bool = True
    ) -> Wing:
        """Draw a wing.

        Args:
            groups: Its rooms; the first group is that of its main bedroom.
            hall: Its hallway.
            outline: Outline of the home.
            is_main: Whether the entry and the closet are in it.

        Raises:
            MisfitError: No try fits.
        """
        entry, closet = (self.entry, self.closet) if is_main else (None, None)
        limits = limits_of(self.briefs)
        for _ in range(TRIES):
            suite = closet is None and self.choices.chance(55)
            sides = self._sides(groups, entry, suite)
            if not all(sides):
                continue
            fore, aft = self._strips(sides, outline, bool(entry))
            rooms = [self.areas[slot[0]] for slot in aft.slots if len(slot) == 1]
            middle = fsum(rooms) / len(rooms) if rooms else 14.0
            corridor = self._corridor(hall, suite, closet)
            depths = [
                min(max(int(UNITS_PER_M * sqrt(middle) * percent / 100), 56), 112)
                for percent in (78, 90, 102, 114)
            ]
            wing = Wing(fore, aft, corridor)
            depth = wing.squarest_depth(self.gross, depths, limits)
            if depth is not None:
                return replace(wing, back_depth=depth)
        raise MisfitError

    def _corridor(self, hall: int, suite: bool, closet: int | None) -> CorridorRule:
        width = self.request.corridor + WALL
        return CorridorRule(hall, width, suite, -1 if closet is None else closet)

    def _strips(
        self, sides: Sequence[Sequence[RoomGroup]], outline: str | None, entry: bool
    ) -> tuple[Strip, Strip]:
        """Draw the strips on the two sides of a corridor, with bays."""
        fore, aft = map(_strip, sides)
        if outline is None and self.choices.chance(45):
            fore = self._add_bays(fore, entry)
        if outline is None and self.choices.chance(35):
            aft = self._add_bays(aft)
        if outline == "U" and entry:  # a porch
            fore = replace(fore, bays=(-self.choices.between(28, 40), *fore.bays[1:]))
        return fore, aft

    def _sides(
        self, groups: Sequence[RoomGroup], entry: RoomGroup | None, suite: bool
    ) -> tuple[list[RoomGroup], list[RoomGroup]]:
        """Divide groups of rooms among the front and the back of a corridor.

        Args:
            groups: The rooms, those of the main bedroom first.
            entry: The group that begins the front, or None.
            suite: Whether the main bedroom ends the back.
        """
        choices = self.choices
        main, *others = groups
        first = [entry] if entry else []
        front: list[RoomGroup] = []
        back: list[RoomGroup] = []
        weights = [self._area(first), self._area([main])]
        for group in choices.shuffled(others):
            # Mostly to the side with less in it, so that both come out about as deep.
            to_back = (weights[0] > weights[1]) != choices.chance(15)
            (back if to_back else front).append(group if choices.chance(50) else group[::-1])
            weights[to_back] += self._area([group])
        if suite:
            back.append(main)
            # The front room beside the suite must still reach the corridor: the largest does.
            front.sort(key=lambda group: self._area([group[-1:]]))
        else:
            back.insert(choices.below(len(back) + 1), main if choices.chance(50) else main[::-1])
        return [*first, *front], back

    def _area(self, groups: Sequence[RoomGroup]) -> float:
        return fsum(self.areas[room] for group in groups for slot in group for room in slot)

    def _add_bays(self, strip: Strip, entry: bool = False) -> Strip:
        """Move one end of a strip, or the entryway, outwards or inwards."""
        count = len(strip.slots)
        if count < 2:
            return strip
        step = self.choices.between(10, 34) * (1 if self.choices.chance(60) else -1)
        if entry and self.choices.chance(40):
            return replace(strip, bays=(-self.choices.between(16, 30), *[0] * (count - 1)))
        moved = self.choices.between(1, count - 1)
        return replace(strip, bays=(*[0] * (count - moved), *[step] * moved))

    # --- Plans -----------------------------------------------------------------------------------

    def inline(self) -> Placing:
        """Core in the middle, a wing in line with it, the service block on its other side."""
        wing = self.wing(self.private, self.add_hallway(), self.request.outline)
        core = TreeWays(self.core_trees())
        below, above = self._offsets(self.request.outline)
        service = self.service_block()
        mouth = (0, 0, 0, wing.corridor.width)

        def place(areas: Areas) -> list[Box]:
            rooms = wing.place(areas)
            low = rooms.low - below
            high = rooms.high + above
            left = -_core_width(core, areas, high - low)
            boxes = rooms.boxes + core.squarest(areas, (left, low, 0, high), [mouth])
            return boxes + (service.boxes(areas, left, low, high) if service else [])

        return place

    def _offsets(self, outline: str | None) -> tuple[int, int]:
        """Draw how far the core reaches beyond the wing at its low and its high side [units].

        Between two wings it protrudes on one side (`bar`), or is set back there (`court`).
        """
        choices = self.choices
        step = choices.between(30, 84)
        side = choices.below(2)
        if outline in ("rectangle", "U"):  # a wing's porch makes the U
            return 0, 0
        if outline == "T":
            return choices.between(18, 34), choices.between(18, 34)
        if outline in ("L", "bar", "court"):
            if outline == "L":
                out = step if choices.chance(60) else -step
            else:
                out = choices.between(24, 44) * (1 if outline == "bar" else -1)
            return (out, 0) if side else (0, out)
        steps = ((0, 30), (1, 35), (-1, 35))
        low = choices.weighted(steps)
        high = choices.weighted(steps)
        if low == -1 and high == -1:
            low = 0
        return low * step, high * choices.between(24, 64)

    def across(self) -> Placing:
        """A long core with a wing at a right angle to it, and the service block at its end."""
        outline = self.request.outline
        choices = self.choices
        wing = self.wing(self.private, self.add_hallway(), outline)
        core = TreeWays(self.core_trees())
        service = self.service_block()
        at = {"L": choices.choice((0, 100)), "T": 50}.get(outline or "")
        if at is None:
            at = choices.weighted(((0, 40), (100, 40), (50, 20)))
        height = choices.between(86, 150)
        mouth = (0, 0, wing.corridor.width, 0)

        def place(areas: Areas) -> list[Box]:
            rooms = wing.place(areas)
            area = core.area(areas)
            depth = max(rooms.high - rooms.low, 1)
            length = max(int(area / height + 0.5), depth if outline == "rectangle" else 0)
            left = rooms.low + (depth - length) * at // 100
            high = int(area / length + 0.5)
            if high < MIN_CORE_DEPTH:
                raise MisfitError
            boxes = [box.turned() for box in rooms.boxes]
            boxes += core.squarest(areas, (left, -high, left + length, 0), [mouth])
            return boxes + (service.boxes(areas, left, -high, 0) if service else [])

        return place

    def two_wings(self) -> Placing:
        """A core between two wings."""
        choices = self.choices
        outline = self.request.outline
        self.private += [[(room,)] for room in self.service]
        main, *others = choices.shuffled(self.private)
        half = (len(others) + choices.below(2)) // 2
        if half < 1 or len(others) - half < 2:
            raise MisfitError
        plain = outline and "rectangle"  # without a porch
        halls = self.add_hallway(), self.add_hallway()
        first = self.wing([main, *others[:half]], halls[0], plain)
        second = self.wing(others[half:], halls[1], plain, is_main=False)
        core = TreeWays(self.core_trees())
        shape = {"T": "bar", "U": "court"}.get(outline or "", outline)
        below, above = self._offsets(shape)
        as_core = choices.chance(50) if shape is None else shape in ("rectangle", "L")

        def place(areas: Areas) -> list[Box]:
            east = first.place(areas)
            low = east.low - below
            high = east.high + above
            # The second wing is as deep as the core, or else as the first wing.
            west = _fit_wing(second, areas, *((low, high) if as_core else (east.low, east.high)))
            left = -_core_width(core, areas, high - low)
            other = next(box for box in west if box.room == halls[1])
            mouths = [(0, 0, 0, first.corridor.width), (left, other.y0, left, other.y1)]
            boxes = east.boxes + core.squarest(areas, (left, low, 0, high), mouths)
            return boxes + [box.mirrored().moved(left, 0) for box in west]

        return place

    def columns(self) -> Placing:
        """A small home without a corridor: rooms in a column beside the core open to it."""
        choices = self.choices
        outline = self.request.outline
        slots = [*(self.entry or [])]
        for group in choices.shuffled(self.private):
            slots += group if choices.chance(50) else group[::-1]
        column = _strip([slots])
        if outline == "U":
            if len(slots) < 3:
                raise MisfitError
            at = choices.between(1, len(slots) - 2)
            column = replace(column, bays=tuple(-30 * (i == at) for i in range(len(slots))))
        elif outline is None and choices.chance(35):
            column = self._add_bays(column)
        core = TreeWays(self.core_trees())
        service = self.service_block()
        ratio = choices.between(62, 110)
        below, above = self._offsets(outline)

        def place(areas: Areas) -> list[Box]:
            height = int(sqrt(fsum(areas) * 100 / (1.45 * ratio)))
            low, high = -below, height + above
            left = -_core_width(core, areas, high - low)
            boxes = core.squarest(areas, (left, low, 0, high))
            boxes += [box.turned() for box in column.boxes(areas, height, MIN_COLUMN_DEPTH)]
            return boxes + (service.boxes(areas, left, low, high) if service else [])

        return place

    def rows(self, count: int) -> Placing:
        """A compact home: the core and service block, along it a corridor and a strip of rooms.

        With two rows there is such a strip on both of its sides.
        """
        halls = [self.add_hallway() for _ in range(count)]
        strips = self._row_strips(count)
        choices = self.choices
        trees = self.core_trees()
        service = self.service_block()
        if service is not None:
            blocks = service.ways.trees
            pairs = [(tree, blocks[choices.below(len(blocks))]) for tree in trees]
            trees = [Cut(True, pair if choices.chance(50) else pair[::-1]) for pair in pairs]
        core = TreeWays(trees)
        closets = [self.closet, None]
        suites = [closet is None and choices.chance(65) for closet in closets]
        corridors = [
            self._corridor(hall, suite and len(strip.slots) > 1, closet)
            for hall, suite, closet, strip in zip(halls, suites, closets, strips, strict=False)
        ]

        def place(ratio: int, areas: Areas) -> list[Box]:
            length = int(sqrt(fsum(areas) * ratio / 100))
            depth = int(core.area(areas) / length + 0.5)
            if depth < MIN_CORE_DEPTH:
                raise MisfitError
            first, *others = (
                row(strip, corridor, areas, length)
                for strip, corridor in zip(strips, corridors, strict=True)
            )
            boxes = [box.moved(0, depth) for box in first]
            boxes += [box.flipped() for other in others for box in other]
            return boxes + core.squarest(areas, (0, 0, length, depth))

        # Most other lengths make a strip too shallow or too deep.
        total = fsum(self.gross)
        strip_areas = [strip.area(self.gross) for strip in strips]
        low = max(strip_areas) / MAX_DEPTH
        high = min(strip_areas) / MIN_DEPTH
        ratios = [r for r in LENGTH_RATIOS if low <= sqrt(total * r / 100) <= high]
        limits = limits_of(self.briefs)
        for ratio in choices.shuffled(ratios)[:TRIES]:
            with suppress(MisfitError):
                if are_promising(place(ratio, self.gross), limits):
                    return partial(place, ratio)
        raise MisfitError

    def _row_strips(self, count: int) -> list[Strip]:
        """Divide the private rooms among strips.

        Raises:
            MisfitError: A strip has no rooms.
        """
        choices = self.choices
        parts = [list[RoomGroup]() for _ in range(count)]
        # Groups of about one area share a strip, so that none is much narrower than it is deep.
        ordered = sorted(choices.shuffled(self.private), key=lambda group: self._area([group]))
        half = self._area(ordered) / count
        for group in ordered if choices.chance(50) else ordered[::-1]:
            part = next((part for part in parts if self._area(part) < half), parts[-1])
            part.append(group if choices.chance(50) else group[::-1])
        parts = [choices.shuffled(part) for part in parts]
        if not all(parts):
            raise MisfitError
        if self.entry:
            parts[-1].insert(0, self.entry)
        strips = [_strip(part) for part in parts]
        if self.request.outline is None:
            strips = [self._add_bays(s) if choices.chance(40) else s for s in strips]
        return strips


def _strip(groups: Sequence[RoomGroup]) -> Strip:
    slots = tuple(slot for group in groups for slot in group)
    return Strip(slots, (0,) * len(slots))


def _core_width(core: TreeWays, areas: Areas, depth: int) -> int:
    """Return the width of a core of a depth [units].

    Raises:
        MisfitError: It is not deep enough.
    """
    if depth < MIN_CORE_DEPTH:
        raise MisfitError
    return int(core.area(areas) / depth + 0.5)


def _fit_wing(wing: Wing, areas: Areas, low: int, high: int) -> list[Box]:
    """Return a wing's rooms, moved and deepened to fill a span along y [units]."""
    rooms = wing.place(areas)
    width = wing.corridor.width
    for _ in range(2):
        depth = wing.back_depth * (high - low - width) / (rooms.high - rooms.low - width)
        wing = replace(wing, back_depth=int(depth + 0.5))
        rooms = wing.place(areas)
    shift = low - rooms.low
    rest = high - rooms.high - shift
    if abs(rest) > 6:
        raise MisfitError
    moved = [box.moved(0, shift) for box in rooms.boxes]
    return [box._replace(y1=high) if box.y1 == rooms.high + shift else box for box in moved]


# Share of the home's clear area that is in rooms; the rest is in door gaps.
ROOMS_SHARE = 0.992
# How far the area may be from the requested one, as a share of it, and the tries to get there.
TOLERANCE = 0.012
ROUNDS = 7
# Probabilities [%] by the number of bedrooms up to four: that a home is made of rows,
# and has rooms on both sides of its core.
TWO_WINGS_PERCENT = 65
INLINE_PERCENT = 20
ROWS_PERCENT = {1: 5, 2: 10, 3: 25, 4: 40}
TWO_ROWS_PERCENT = {1: 5, 2: 20, 3: 55, 4: 75}


@dataclass(frozen=True)
class RoomLayout:
    """A home's rooms, placed.

    Attributes:
        briefs: The rooms, hallways included.
        boxes: The places of the rooms [units]; a room may have several.
    """

    briefs: list[Brief]
    boxes: list[Box]

    def rooms(self, wall: Wall) -> tuple[int, int]:
        """Return the rooms on the two sides of an inner wall, the lower first."""
        a, b = sorted((self.boxes[wall.first].room, self.boxes[wall.second].room))
        return a, b

    def kinds(self, wall: Wall) -> set[str]:
        """Return the types of the rooms on the two sides of an inner wall."""
        return {self.briefs[room].kind for room in self.rooms(wall)}

    def room_inside(self, wall: Wall) -> int:
        """Return the room on the inner side of an outer wall."""
        return self.boxes[max(wall.first, wall.second)].room


def draw_layout(request: LayoutRequest, choices: Choices) -> RoomLayout:
    """Draw one layout.

    Raises:
        MisfitError: The rooms do not fit as drawn.
    """
    if all(brief.kind != "bedroom" for brief in request.briefs):
        return RoomLayout(request.briefs, _studio(request.briefs, choices))
    bedrooms = sum(brief.kind == "bedroom" for brief in request.briefs)
    if request.outline in (None, "rectangle") and choices.chance(ROWS_PERCENT[min(bedrooms, 4)]):
        sketch = Sketch(request, choices)
        rows = 1 + choices.chance(TWO_ROWS_PERCENT[min(bedrooms, 4)])
        with suppress(MisfitError):
            return _place_at_scale(sketch, sketch.rows(rows))
    sketch = Sketch(request, choices)
    if sketch.closet is None and bedrooms <= 2 and choices.chance(35 if bedrooms == 1 else 10):
        placing = sketch.columns()
    elif bedrooms > 3 and choices.chance(TWO_WINGS_PERCENT):
        placing = sketch.two_wings()
    elif choices.chance(INLINE_PERCENT):
        placing = sketch.inline()
    else:
        placing = sketch.across()
    return _place_at_scale(sketch, placing)


def _studio(briefs: Sequence[Brief], choices: Choices) -> list[Box]:
    """Return the boxes of a studio: its second and third room in a strip beside the first."""
    (living, first, second) = (brief.area * UNITS_PER_M**2 for brief in briefs)
    width = choices.between(32, 46)
    bath = round(first / width)
    third = round(second / width)
    height = bath + WALL + third
    end = width + WALL + round(living / height) + WALL
    return [
        Box(0, width + WALL, 0, end, height + WALL),
        Box(1, 0, 0, width + WALL, bath + WALL),
        Box(2, 0, bath + WALL, width + WALL, height + WALL),
    ]


def _place_at_scale(sketch: Sketch, placing: Placing) -> RoomLayout:
    """Place the rooms at the scale at which their clear areas add up to the requested area."""
    briefs = sketch.briefs
    target = sketch.request.area_m2 * UNITS_PER_M2 * ROOMS_SHARE
    limits = limits_of(briefs)
    factor = 1.0
    for _ in range(ROUNDS):
        areas = np.array([gross_area(b.area * factor) if b.area else 0.0 for b in briefs])
        boxes = placing(areas)
        if not are_promising(boxes, limits):
            break
        area = sum_in_order(box.clear_area for box in boxes)
        if abs(area - target) <= TOLERANCE * target:
            return RoomLayout(briefs, boxes)
        factor *= target / area
    raise MisfitError
