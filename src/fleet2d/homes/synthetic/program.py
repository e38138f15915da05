"""The program of a synthetic home: its rooms and their sizes, drawn to fit the request."""

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import accumulate, pairwise
from math import fsum
from typing import NamedTuple, TypeVar

from fleet2d.configuration.problems import counted
from fleet2d.errors import FloorPlanError
from fleet2d.runtime.determinism import Draws, stream_key

T = TypeVar("T")


class Choices(Draws):
    """A stream of random choices, addressed by a seed and a purpose.

    Example:
        >>> choices = Choices(7, "example")
        >>> [choices.below(6) for _ in range(5)] == [Choices(7, "example").below(6)] * 5
        False
        >>> Choices(7, "a").between(2, 2)
        2
    """

    __slots__ = ()

    def __init__(self, seed: int, purpose: str) -> None:
        # Its draws are those of the stream itself, which has no steps.
        self.__setstate__((int(stream_key(seed, "synthetic home", purpose)), 0))

    def between(self, low: int, high: int) -> int:
        """Return an integer from low to high, both possible; `low` where high is less."""
        return low + self.below(max(high - low, 0) + 1)

    def chance(self, percent: int) -> bool:
        """Return True with a probability of `percent` in a hundred."""
        return self.below(100) < percent

    def weighted(self, items: Sequence[tuple[T, int]]) -> T:
        """Return an item with probability in proportion to its weight."""
        ends = list(accumulate(weight for _, weight in items))
        return items[bisect_right(ends, self.below(ends[-1]))][0]


# Area of a home over that of its rooms: corridors and door gaps add to it.
TYPICAL_AREA_FACTOR = 1.10
MAX_ROOMS_PER_TYPE = 8
SMALLEST_M2 = 18.0
# A home that is smaller is a studio, unless it must have a bedroom.
STUDIO_M2 = 30.0
# From this area on a studio may have a kitchen of its own, with this probability [%].
STUDIO_KITCHEN_M2 = 24.0
STUDIO_KITCHEN_PERCENT = 50
LARGEST_M2 = 450.0

# Deciles and tails of the area of HouseExpo's plans [%, m2]; between them it is linear.
AREA_QUANTILES = (
    (0, 38), (10, 69), (25, 89), (40, 113), (50, 141), (60, 163), (75, 206), (90, 285), (97, 360),
    (100, 420),
)  # fmt: skip


class Size(NamedTuple):
    """The sizes of a type of room.

    Attributes:
        min_area: Smallest area [m²].
        typical_area: Typical area [m²].
        max_area: Largest area [m²].
        side: Minimum length of the shorter side [m].
        slender: Largest ratio of the sides.
    """

    min_area: float
    typical_area: float
    max_area: float
    side: float
    slender: float


SIZES = {
    "living_room": Size(10, 23.5, 90, 3.0, 2.2),
    "dining_room": Size(6.5, 11.5, 44, 2.4, 2.2),
    "kitchen": Size(4.5, 14, 44, 1.8, 2.3),
    "bedroom": Size(7.5, 16, 44, 2.5, 2.1),
    "bathroom": Size(3.2, 7, 8.6, 1.5, 3.0),
    "toilet": Size(1.6, 2.8, 5, 1.0, 3.0),
    "wardrobe": Size(2.2, 5, 12, 1.2, 3.0),
    "office": Size(6.5, 13, 32, 2.3, 2.1),
    "laundry": Size(2.8, 6.5, 14, 1.4, 3.0),
    "storage": Size(1.8, 5, 14, 1.1, 3.2),
    "entryway": Size(2.6, 7.5, 18, 1.3, 3.0),
    "garage": Size(16, 26, 64, 2.9, 2.4),
    "gym": Size(11, 21, 44, 2.8, 2.1),
    "hallway": Size(0, 0, 1e9, 0.9, 1e9),
}


# Smallest and largest area, in percent of the typical one.
SPREAD: dict[str, tuple[int, int]] = {
    "kitchen": (70, 185),
    "bathroom": (50, 165),
    "living_room": (75, 140),
    "bedroom": (62, 134),
    "garage": (72, 130),
}
DEFAULT_SPREAD = (78, 130)
# Of all but small homes; their bedrooms are either small or large, as those of real plans.
WIDE_SPREAD: dict[str, tuple[int, int]] = {
    "kitchen": (60, 240),
    "bathroom": (50, 120),
    "living_room": (60, 150),
}
# The largest room in percent of the living room.
MAX_OF_LIVING_ROOM = 90
# The largest part of a home that is kitchen [%].
MAX_KITCHEN_SHARE = 22
WIDE_FROM_M2 = 60.0  # in smaller flats hardly any rooms would fit beside a large one
SMALL_BEDROOM = (46, 72)
LARGE_BEDROOM = (95, 145)
SMALL_BEDROOM_PERCENT = 40
# Probability of each bedroom to have a wardrobe [%].
WARDROBE_PERCENT = 40


@dataclass(frozen=True)
class Brief:
    """The brief of a room: its type and size.

    Attributes:
        kind: Its type.
        area: How large it should be [m²].
        partner: Index of the one room that it opens from (a bedroom), or None.
    """

    kind: str
    area: float
    partner: int | None = None


@dataclass(frozen=True)
class Wishes:
    """The user's request for a home; None where it is left to the generator.

    Attributes:
        area_m2: Area of the free space.
        bedrooms: Number of bedrooms; once settled, 0 in a studio.
        bathrooms: Number of bathrooms.
        garage: Whether there is one.
    """

    area_m2: float | None = None
    bedrooms: int | None = None
    bathrooms: int | None = None
    garage: bool | None = None


@dataclass(frozen=True)
class Style:
    """The user's request for the shape of a home; None where it is left to the generator.

    Attributes:
        outline: `rectangle`, `L`, `T` or `U`.
        open_plan: Whether living, dining and kitchen are open to each other.
        corridor: Clear width of corridors [units].
        door: Width of doors between rooms [units].
        variety: How much rooms, links and layouts differ from the usual ones [percent].
    """

    outline: str | None = None
    open_plan: bool | None = None
    corridor: int | None = None
    door: int | None = None
    variety: int = 0


def minimum_area(bedrooms: int, bathrooms: int, garage: bool) -> float:
    """Return the minimum area [m²] of a home with these rooms."""
    kinds = [*_base(bedrooms, bathrooms), *["garage"] * garage]
    # All but the smallest homes need a corridor, and some room for fitting walls to each other.
    spare = 1.15 if bedrooms == bathrooms == 1 else min(1.5 + 0.05 * (bedrooms + bathrooms), 2.0)
    return round(spare * fsum(SIZES[kind].min_area for kind in kinds), 1)


def maximum_area(bedrooms: int, bathrooms: int) -> float:
    """Return the largest area [m²] of a home with these rooms and all optional ones."""
    kinds = [*_base(bedrooms, bathrooms), "garage", *(kind for kind, _, _ in OPTIONAL)]
    return round(0.56 * fsum(SIZES[kind].max_area for kind in kinds), 1)


# What else a home may have: the type of room, from how large a home [m²], and how probably [%].
OPTIONAL = (
    ("dining_room", 62, 70),
    ("entryway", 70, 62),
    ("wardrobe", 110, 40),
    ("laundry", 100, 42),
    ("office", 100, 45),
    ("toilet", 120, 38),
    ("storage", 90, 35),
    ("gym", 200, 30),
    ("office", 240, 30),
    ("storage", 240, 30),
)


def settle_wishes(wishes: Wishes, choices: Choices, style: Style) -> Wishes:
    """Draw what the wishes leave open.

    Args:
        wishes: The wishes.
        choices: The stream to draw from.
        style: The wishes for its shape. `variety` is by how many percent more the number of
            bedrooms for an area varies.

    Raises:
        FloorPlanError: The wishes contradict each other.
    """
    baths = wishes.bathrooms or 1
    beds = wishes.bedrooms or max(baths - 2, 1)
    garage = bool(wishes.garage)
    area = wishes.area_m2
    asks_more = wishes.bedrooms or baths > 1 or garage
    if area is not None and area < STUDIO_M2 and not asks_more:
        return Wishes(area, 0, 1, False)
    if area is None:
        area = _draw_area(choices)
        most = maximum_area(wishes.bedrooms or MAX_ROOMS_PER_TYPE, baths)
        area = round(min(max(area, 1.25 * minimum_area(beds, baths, garage)), most), 1)
    _check(area, beds, baths, garage, wishes)
    if wishes.bedrooms is None:
        least = beds
        most_off = 36 + 36 * style.variety // 100
        usual = (round(area) + choices.between(-most_off, most_off) + 38) // 66
        beds = min(max(usual, least), 6)
        # Two small bedrooms fit 50 m2, if tightly.
        full = 0.8 + 0.3 * style.variety / 100 if beds == 2 else 0.8
        while beds > least and minimum_area(beds, baths, garage) > full * area:
            beds -= 1
        while beds < MAX_ROOMS_PER_TYPE and maximum_area(beds, baths) < area:
            beds += 1
    if wishes.bathrooms is None:
        baths = min(max((45 * beds + round(area) // 3 + choices.between(-45, 45)) // 100, 1), 4)
        while baths > 1 and minimum_area(beds, baths, garage) > 0.8 * area:
            baths -= 1
    if wishes.garage is None:
        garage = area > 95 and choices.chance(42) and minimum_area(beds, baths, True) < 0.8 * area
    return Wishes(area, beds, baths, garage)


def _draw_area(choices: Choices) -> float:
    """Draw an area [m²] from the distribution in HouseExpo's plans."""
    share = choices.below(1000) / 10
    for (low, least), (high, most) in pairwise(AREA_QUANTILES):
        if share <= high:
            return least + (most - least) * (share - low) / (high - low)
    return float(AREA_QUANTILES[-1][1])


def _check(area: float, beds: int, baths: int, garage: bool, wishes: Wishes) -> None:
    if baths > beds + 2:
        raise FloorPlanError(
            f"a synthetic home with {counted(beds, 'bedroom')} has at most {beds + 2} bathrooms,"
            f" not {baths}: give it more bedrooms (floorplan.bedrooms) or fewer bathrooms"
        )
    least = minimum_area(beds, baths, garage)
    most = maximum_area(beds, baths)
    rooms = f"{counted(beds, 'bedroom')} and {counted(baths, 'bathroom')}"
    if garage:
        rooms += " and a garage"
    if area < least:
        fits = [n for n in range(1, beds) if minimum_area(n, 1, garage=False) <= area]
        at_most = f"; {area:g} m2 fits {counted(max(fits), 'bedroom')}" if fits else ""
        raise FloorPlanError(
            f"a synthetic home of {area:g} m2 can't have {rooms}: they need at least {least:g} m2"
            f"{at_most}. Change floorplan.area_m2, or the rooms"
        )
    if area > most and wishes.bedrooms is not None:
        raise FloorPlanError(
            f"a synthetic home with {rooms} has at most {most:g} m2, not {area:g} m2: its rooms"
            " would be halls. Give it more bedrooms (floorplan.bedrooms), or less area"
        )


def _base(bedrooms: int, bathrooms: int) -> list[str]:
    return ["living_room", "kitchen", *["bedroom"] * bedrooms, *["bathroom"] * bathrooms]


def choose_rooms(wishes: Wishes, choices: Choices, style: Style, is_wide: bool) -> list[Brief]:
    """Return the rooms of a home, largest uses first, with areas that add up.

    Args:
        wishes: Settled wishes.
        choices: The stream to draw from.
        style: The wishes for its shape. With `variety` further rooms may make others smaller than
            typical, up to what their least sizes allow.
        is_wide: Whether sizes differ widely and bedrooms may have wardrobes.
    """
    variety = style.variety

    def needed(kinds: Sequence[str]) -> float:
        sizes = [SIZES[kind] for kind in kinds]
        spare = fsum(size.typical_area - size.min_area for size in sizes)
        return fsum(size.typical_area for size in sizes) - spare * variety / 100

    if wishes.bedrooms == 0:
        return _studio_rooms(wishes.area_m2 or 0.0, choices)
    area = wishes.area_m2 or 0.0
    beds = wishes.bedrooms or 1
    baths = wishes.bathrooms or 1
    kinds = _base(beds, baths) + ["garage"] * bool(wishes.garage)
    total = area / TYPICAL_AREA_FACTOR
    # Another room is added only while the typical sizes of all leave space for it.
    fill = choices.between(70, 104) / 100
    for kind, from_area, percent in OPTIONAL:
        if style.outline == "U" and kind == "entryway":  # its porch makes the U
            kinds.append(kind)
            continue
        is_likely = 100 * area >= (100 - variety) * from_area and choices.chance(percent)
        if is_likely and needed([*kinds, kind]) <= fill * total:
            kinds.append(kind)
    for kind, _, _ in OPTIONAL:  # a very large home takes more rooms
        if 0.85 * fsum(SIZES[k].max_area for k in kinds) < total and kinds.count(kind) < 2:
            kinds.append(kind)
    wardrobes = beds if is_wide else 0
    chosen = [choices.chance(WARDROBE_PERCENT) for _ in range(wardrobes)]
    kinds += ["wardrobe"] * sum(chosen)
    briefs = [Brief(kind, SIZES[kind].typical_area) for kind in kinds]
    return scale_areas(_assign_partners(briefs), total, choices, is_wide)


def _studio_rooms(area: float, choices: Choices) -> list[Brief]:
    """Return the rooms of a studio: a room to live and sleep in, a bathroom, and a third.

    That is a kitchen or, if one cooks in the large room, an entryway.
    """
    has_kitchen = area >= STUDIO_KITCHEN_M2 and choices.chance(STUDIO_KITCHEN_PERCENT)
    kind, (low, high) = ("kitchen", (45, 62)) if has_kitchen else ("entryway", (26, 36))
    bath = choices.between(33, 46) / 10
    third = choices.between(low, high) / 10
    return [Brief("living_room", area - bath - third), Brief("bathroom", bath), Brief(kind, third)]


def _assign_partners(briefs: Sequence[Brief]) -> list[Brief]:
    """Assign bathrooms beyond the first, and wardrobes, to bedrooms."""
    paired = list(briefs)
    beds = [i for i, brief in enumerate(paired) if brief.kind == "bedroom"]
    baths = [i for i, brief in enumerate(paired) if brief.kind == "bathroom"]
    wardrobes = [i for i, brief in enumerate(paired) if brief.kind == "wardrobe"]
    paired[beds[0]] = replace(paired[beds[0]], area=SIZES["bedroom"].typical_area * 1.25)
    # A home with many bathrooms has a second shared one.
    shared = 1 + (len(baths) > 3)
    for bath, bed in zip(baths[shared:], beds, strict=False):
        paired[bath] = replace(paired[bath], partner=bed)
    for number, wardrobe in enumerate(wardrobes):
        paired[wardrobe] = replace(paired[wardrobe], partner=beds[number % len(beds)])
    return paired


def scale_areas(
    briefs: Sequence[Brief], total: float, choices: Choices, is_wide: bool
) -> list[Brief]:
    """Draw areas that add up to `total` [m²] as far as the sizes of the types allow."""
    spread_of = WIDE_SPREAD if is_wide else SPREAD
    spreads = [spread_of.get(brief.kind, DEFAULT_SPREAD) for brief in briefs]
    if is_wide:
        for i, brief in enumerate(briefs):
            if brief.kind == "bedroom":
                is_small = choices.chance(SMALL_BEDROOM_PERCENT)
                spreads[i] = SMALL_BEDROOM if is_small else LARGE_BEDROOM
    usual = [
        brief.area * choices.between(*spread) / 100
        for brief, spread in zip(briefs, spreads, strict=True)
    ]
    at = {brief.kind: i for i, brief in enumerate(briefs)}
    # People live in the living room, not in the kitchen.
    usual[at["kitchen"]] = min(usual[at["kitchen"]], 0.9 * usual[at["living_room"]])
    most = MAX_OF_LIVING_ROOM / 100 * usual[at["living_room"]]
    usual = [
        area if brief.kind in ("living_room", "garage") else min(area, most)
        for area, brief in zip(usual, briefs, strict=True)
    ]
    sizes = [SIZES[brief.kind] for brief in briefs]
    kitchen = sizes[at["kitchen"]]
    most = max(MAX_KITCHEN_SHARE / 100 * total, kitchen.min_area)
    sizes[at["kitchen"]] = kitchen._replace(max_area=min(kitchen.max_area, most))

    def areas(factor: float) -> list[float]:
        return [
            min(max(area * factor, size.min_area), size.max_area)
            for area, size in zip(usual, sizes, strict=True)
        ]

    low, high = 0.1, 10.0
    for _ in range(24):
        middle = (low + high) / 2
        if fsum(areas(middle)) < total:
            low = middle
        else:
            high = middle
    return [replace(b, area=area) for b, area in zip(briefs, areas(low), strict=True)]
