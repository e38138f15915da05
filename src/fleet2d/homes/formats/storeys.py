"""Storeys of a home in one plan: side by side, and joined by the stairs and lifts of the file."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely
from shapely import LineString, MultiLineString
from shapely.geometry.base import BaseGeometry

from fleet2d.errors import FloorPlanError
from fleet2d.homes.formats.enclosure import LEAST_M2, enclosed_space, parts_of
from fleet2d.homes.formats.features import Feature
from fleet2d.kernels import F64

# Space between storeys in the plan [m].
APART_M = 2.0
# How far before the first step of stairs people stand [m].
BEFORE_M = 0.3
# A tread is so high [m], and people take it in such a time [s].
RISE_M = 0.17
TREAD_S = 0.7
SPACES = frozenset({"room", "free"})
LINKS = ("stairs", "lift")


@dataclass(frozen=True)
class Storey:
    """A storey in a file.

    Attributes:
        key: What the features on it have as their level.
        name: Its name.
        elevation: How high its floor is [m]; also its rank.
        also: Other names that it has.
    """

    key: str
    name: str
    elevation: float
    also: tuple[str, ...] = ()


def arrange(
    features: Sequence[Feature],
    storeys: Sequence[Storey],
    level: str | None,
    notes: list[str],
    *,
    metre: float = 1.0,
) -> list[Feature]:
    """Return the features of all storeys side by side, or of one of them.

    Features without a level are on the ground storey: the lowest that is not below the ground.
    A feature of kind `stairs` or `lift` leads to the storey above, or to the one that its property
    `upper` names; its properties `foot` and `head` are the ends of stairs, if the file tells them.

    Args:
        features: The features, each with the key of its storey.
        storeys: The storeys, in any order.
        level: The key or name of the storey to read; None for all.
        notes: A note is added on storeys that lie side by side or are left out.
        metre: A metre in the units of the features.

    Raises:
        FloorPlanError: There is no such storey, or several have that name.
    """
    in_order = sorted(storeys, key=lambda storey: storey.elevation)
    if level is not None:
        chosen = choose_storey(in_order, level)
        others = ", ".join(s.name for s in in_order if s is not chosen)
        if others:
            notes.append(f"of its levels, {chosen.name} is used, not {others}")
        return _alone(features, {None, chosen.key})
    of_storey = {storey.key: _on(storey.key, features) for storey in in_order}
    used = _used(in_order, of_storey)
    if len(used) < 2:
        return _alone(features, {None, *(s.key for s in used)} if used else None)
    ground = min(used, key=lambda s: (s.elevation < 0, abs(s.elevation)))
    of_storey[ground.key] += _on(None, features)
    without_rooms = [s for s in used if not _kinds(of_storey[s.key]) & SPACES]
    if len(without_rooms) < len(used):
        for storey in without_rooms:
            own = of_storey[storey.key]
            of_storey[storey.key] = [*own, *_enclosed_rooms(own, storey.key)]
    notes.append(f"its storeys lie side by side: {', '.join(s.name for s in used)}")
    left_out = ", ".join(s.name for s in in_order if s not in used)
    if left_out:
        notes.append(f"storeys without rooms, which are left out: {left_out}")
    return _side_by_side(used, of_storey, ground, notes, metre)


def _on(key: str | None, features: Sequence[Feature]) -> list[Feature]:
    return [feature for feature in features if feature.level == key]


def _kinds(features: Sequence[Feature]) -> set[str]:
    return {feature.kind for feature in features}


def _used(storeys: Sequence[Storey], of_storey: Mapping[str, Sequence[Feature]]) -> list[Storey]:
    """Return the storeys with rooms: those that the file draws, or walls with doors enclose."""
    kinds = {key: _kinds(features) for key, features in of_storey.items()}
    if not any(own & SPACES for own in kinds.values()):
        return [s for s in storeys if "wall" in kinds[s.key]]
    return [s for s in storeys if kinds[s.key] & SPACES or kinds[s.key] >= {"wall", "door"}]


def _alone(features: Sequence[Feature], keys: set[str | None] | None) -> list[Feature]:
    """Return the features on some storeys, None for all, without ways to others."""
    here = [f for f in features if keys is None or f.level in keys]
    return [closed for f in here for closed in _without_way(f)]


def _side_by_side(
    storeys: Sequence[Storey],
    of_storey: Mapping[str, Sequence[Feature]],
    ground: Storey,
    notes: list[str],
    metre: float,
) -> list[Feature]:
    """Return the features of storeys, from the lowest to the highest, from left to right."""
    shifts = dict(zip(storeys, _shifts([of_storey[s.key] for s in storeys], metre), strict=True))
    by_key = {storey.key: storey for storey in storeys}
    reached = {ground.key}
    placed: list[Feature] = []
    for number, storey in enumerate(storeys):
        above = storeys[number + 1] if number + 1 < len(storeys) else None
        for feature in of_storey[storey.key]:
            upper = by_key.get(str(feature.properties.get("upper")), above)
            if feature.kind in LINKS and upper is not None:
                placed += _way(feature, (storey, upper), (shifts[storey], shifts[upper]), metre)
                reached |= {storey.key, upper.key}
            elif feature.kind in LINKS:
                placed += [_moved(closed, shifts[storey]) for closed in _without_way(feature)]
            else:
                placed.append(_moved(feature, shifts[storey]))
    apart = ", ".join(s.name for s in storeys if s.key not in reached)
    if apart:
        notes.append(
            f"the file has no stairs to {apart}: join storeys by floorplan.portals, or read one by"
            " floorplan.level"
        )
    return placed


def choose_storey(storeys: Sequence[Storey], level: str) -> Storey:
    """Return the storey of a name or key.

    Raises:
        FloorPlanError: There is no such storey, or several have that name.

    Example:
        >>> choose_storey([Storey("a", "Cellar", -2.5), Storey("b", "Ground", 0)], "Ground").key
        'b'
    """
    called = [storey.name for storey in storeys]
    names = [
        " or ".join(dict.fromkeys((*s.also, s.name)))
        if called.count(s.name) == 1
        else f"{s.name} (id {s.key}, at {s.elevation:g})"
        for s in storeys
    ]
    matches = [s for s in storeys if level == s.key]
    matches = matches or [s for s in storeys if level in (s.name, *s.also)]
    if len(matches) == 1:
        return matches[0]
    known = ", ".join(names) or "none"
    problem = f"{len(matches)} levels are called" if matches else "there is no level"
    raise FloorPlanError(f"{problem} {level!r}; its levels are: {known}")


def _enclosed_rooms(features: Sequence[Feature], key: str) -> Iterator[Feature]:
    """Yield what the walls of a storey enclose as rooms without a name."""
    walls = shapely.union_all([f.shape for f in features if f.kind == "wall"])
    space = enclosed_space(walls, [f.shape for f in features if f.kind == "door"], [])
    for number, part in enumerate(parts_of(space.difference(walls)), 1):
        if part.area >= LEAST_M2:
            yield Feature("room", f"space {number} of level {key}", part, {}, key)


def _shifts(storeys: Sequence[Sequence[Feature]], metre: float) -> list[float]:
    """Return how far each storey moves along x: whole metres, so that it begins beside another."""
    shifts = [0.0]
    right = shapely.total_bounds([f.shape for f in storeys[0]])[2]
    for features in storeys[1:]:
        left, _, own_right, _ = shapely.total_bounds([f.shape for f in features]).tolist()
        shift = float(np.ceil((right + APART_M * metre - left) / metre)) * metre
        shifts.append(shift)
        right = own_right + shift
    return shifts


def _moved(feature: Feature, shift: float) -> Feature:
    shape = shapely.transform(feature.shape, lambda xy: xy + np.array([shift, 0.0]))
    return replace(feature, shape=shape, shift=shift)


def _without_way(feature: Feature) -> Iterator[Feature]:
    """Yield a feature of a single storey: of stairs, that robots keep off them."""
    if feature.kind == "stairs":
        yield replace(feature, kind="no_go", properties={})
    elif feature.kind != "lift":
        yield feature


def _way(
    feature: Feature, storeys: tuple[Storey, Storey], shifts: tuple[float, float], metre: float
) -> Iterator[Feature]:
    """Yield the portal of stairs or a lift, and where robots keep off stairs on both storeys."""
    foot = feature.properties.get("foot")
    head = feature.properties.get("head")
    lift = feature.kind == "lift"
    if lift:
        at = np.asarray(feature.shape.representative_point().coords)[0]
        ways = [(at, at)]
    elif foot is not None and head is not None:
        ways = [(np.array(foot), np.array(head))]
    else:
        first, second = _short_sides(feature.shape, metre)
        ways = [(first, second), (second, first)]
    lower, upper = storeys
    away = np.array([[shifts[0], 0.0], [shifts[1], 0.0]])
    lines = [LineString(np.stack(way) + away) for way in ways]
    rise = abs(upper.elevation - lower.elevation)
    takes = max(rise / RISE_M * TREAD_S, 2.0) if rise > 1 else None  # else the numbers are ranks
    properties = {"type": feature.kind, "takes": None if lift else takes}
    yield Feature("portal", feature.where, MultiLineString(lines), properties, lower.key)
    if not lift:
        for shift in shifts:
            yield _moved(replace(feature, kind="no_go", properties={}), shift)


def _short_sides(shape: BaseGeometry, metre: float) -> tuple[F64, F64]:
    """Return the places before the two short sides of stairs, its front first where it has one.

    The front of a box is the side from its second to its first corner, as formats draw furniture.
    """
    corners = shapely.get_coordinates(shape.minimum_rotated_rectangle)[:4]
    middle = corners.mean(axis=0)
    ends = np.roll(corners, -1, axis=0)
    sides = (corners + ends) / 2
    lengths = np.hypot(*(ends - corners).T)
    first = 0 if lengths[0] <= lengths[1] else 1
    before = []
    for side in (sides[first], sides[first + 2]):
        out = side - middle
        before.append(side + out / max(float(np.hypot(*out)), 1e-9) * BEFORE_M * metre)
    return before[0], before[1]
