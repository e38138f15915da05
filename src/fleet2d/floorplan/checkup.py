"""The check-up of a floor plan: errors and anomalies, and their places."""

from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import shapely
from shapely import affinity
from shapely.geometry.base import BaseGeometry

from fleet2d.configuration.problems import counted, did_you_mean
from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.home import Home
from fleet2d.floorplan.lattice import UNITS
from fleet2d.floorplan.placed_objects import PlacedObject, Point
from fleet2d.floorplan.plan import FloorPlan, Room
from fleet2d.floorplan.rooms.doorways import DoorLine, Doorway
from fleet2d.floorplan.rooms.room import PRIORITY, UNKNOWN, LabelledRegion
from fleet2d.floorplan.space import Space, grown_cells, with_approaches
from fleet2d.kernels import Bool
from fleet2d.runtime.determinism import sum_in_order

Severity = Literal["unlivable", "wrong", "odd"]

PERSON_RADIUS = 0.2
"""The radius of a person who uses the furniture [m], which is the default of users."""

# Rooms that a finding names one by one.
FEW_NAMES = 6
HOME_M2 = (8.0, 2000.0)
"""Least and largest area of a home."""

LIKELY_M2 = (25.0, 400.0)
# Area of a home and median area of its rooms from which on it may be in feet, unless doors are as
# wide as usual.
LARGE_M2 = 350.0
LARGE_ROOM_M2 = 40.0
ROOM_M2 = (0.8, 200.0)  # median area of a home's rooms
TINY_ROOM_M2 = 0.5
SPECK_M2 = 0.02  # minimum area of a pillar
PART_M2 = 0.5  # minimum area of floor whose loss matters
NEARLY_JOINED_M = 0.05  # parts so near to each other were likely meant to touch
MAX_NO_GO_SHARE = 0.5  # share of the floor that robots keep out of, from which on it is reported
DOOR_M = (0.5, 1.6)  # median width of a home's doors
# Usual median, the fewest doors that tell a scale, and how near to the usual width they must be.
USUAL_DOOR_M = 0.85
FEWEST_DOORS = 3
DOOR_FACTOR = 1.4
WIDEST_DOOR_M = 2.0
# How far labels may reach over the outer walls, and which share of them may lie farther out.
MAX_OVER_WALLS_M = 0.3
MAX_OUTSIDE_SHARE = 0.25
# Share of the smaller of two labels, and area, from which on their overlap is reported.
MAX_OVERLAP_SHARE = 0.25
MAX_OVERLAP_M2 = 1.0
# Largest distance from which furniture without places of use must be reachable [m].
BESIDE_M = 0.5
MAX_UNLABELLED_SHARE = 0.5  # share of the floor without a known use from which on it is reported

_ORDER: tuple[Severity, ...] = ("unlivable", "wrong", "odd")


@dataclass(frozen=True)
class Finding:
    """Something that is wrong or odd with a home.

    Attributes:
        kind: Its subject, such as `parts` or `room`.
        severity: `unlivable`: no body fits into the home; `wrong`: something will not work;
            `odd`: worth a look.
        text: A sentence that describes it.
        at: The place (x, y) [m], or None for the whole home.
        shape: The extent [m], if there is one.
    """

    kind: str
    severity: Severity
    text: str
    at: Point | None = None
    shape: BaseGeometry | None = None


def checkup(plan: FloorPlan, radius: float = 0.15) -> list[Finding]:
    """Return the errors and anomalies of a home, the worst first.

    Args:
        plan: The home.
        radius: The radius of the robot that drives in it [m].

    Example:
        >>> import shapely
        >>> from fleet2d.floorplan.plan import LabelledRegion
        >>> gap = shapely.box(4, 0, 4.2, 0.25)
        >>> free = shapely.union_all([shapely.box(0, 0, 4, 4), gap, shapely.box(4.2, 0, 8, 4)])
        >>> kitchen = LabelledRegion(("Kitchen",), shapely.box(0, 0, 4.1, 4))
        >>> office = LabelledRegion(("Office",), shapely.box(4.1, 0, 8, 4))
        >>> for finding in checkup(FloorPlan.build("flat", free, [kitchen, office])):
        ...     print(finding.severity, finding.text)
        wrong a body of radius 0.15 m can't get to office_1 (15.2 m2)
    """
    of_plan = (_scale, _parts, _storeys, _no_go, _specks, _labels, _doors, _standing_in_walls)
    findings = [finding for find in of_plan for finding in find(plan)]
    findings += [*_routes(Home(plan), radius), *_unreachable_objects(plan)]
    return sorted(findings, key=lambda finding: _ORDER.index(finding.severity))


def errors_in(home: Home, radii: Iterable[float]) -> list[str]:
    """Return the sentences of a check-up about what will not work in a run, without anomalies.

    Parts that nothing joins are left out, since the plan has a note on them.

    Args:
        home: The home of the run.
        radii: The radii of its robots [m].
    """
    plan = home.plan
    open_home = Home(plan, home.doors)
    findings = [*_scale(plan), *_no_go(plan), *_doors(plan), *_standing_in_walls(plan)]
    for radius in sorted(set(radii)):
        findings += _routes(open_home, radius)
    return [finding.text for finding in findings if finding.severity != "odd"]


def _scale(plan: FloorPlan) -> Iterator[Finding]:
    """Find an unlikely size of the home, its rooms or its doors, and the unit that explains it."""
    area = plan.area_m2
    widths = sorted(door.width_m for door in plan.doorways if door.leaf)
    rooms = sorted(room.area_m2 for room in plan.rooms if room.type != UNKNOWN)
    door = widths[len(widths) // 2] if len(widths) >= FEWEST_DOORS else None
    room = rooms[len(rooms) // 2] if len(rooms) >= FEWEST_DOORS else None
    severity: Severity = "odd"
    if not HOME_M2[0] <= area <= HOME_M2[1]:
        text = f"{area:,.1f} m2 is very {'small' if area < HOME_M2[0] else 'large'} for a home"
        severity = "wrong"
    elif door is not None and not DOOR_M[0] <= door <= DOOR_M[1]:
        text = f"half of the doors are about {door:.2f} m wide or {'less' if door < 1 else 'more'}"
    elif room is not None and not ROOM_M2[0] <= room <= ROOM_M2[1]:
        text = f"half of the rooms are {'smaller' if rooms[0] < 1 else 'larger'} than {room:.1f} m2"
    elif door is None and area > LARGE_M2 and (room or area) > LARGE_ROOM_M2:
        text = f"{area:,.1f} m2 without three doors is large for a home"
    else:
        return
    likely = _unit_by_doors(plan, door)
    if likely is not None:
        unit, doors = likely
        text += f": by the width of {doors} doors the plan is in {unit}: {_rescaled(plan, unit)}"
        yield Finding("scale", "wrong", text)
    else:
        fits = [f"if in {u}: {_rescaled(plan, u)}" for u in UNITS if _is_likely(plan, u)]
        guess = "".join(f"; {fit}" for fit in fits)
        yield Finding("scale", severity, f"{text}: is the plan in metres?{guess}")


def _rescaled(plan: FloorPlan, unit: str) -> str:
    scale = UNITS[unit]
    area = plan.area_m2 * scale**2
    return f"floorplan.scale={scale:g} (or --scale {scale:g}) makes it {area:.0f} m2"


def _is_likely(plan: FloorPlan, unit: str) -> bool:
    return LIKELY_M2[0] <= plan.area_m2 * UNITS[unit] ** 2 <= LIKELY_M2[1]


def _unit_by_doors(plan: FloorPlan, door: float | None) -> tuple[str, int] | None:
    """Return the unit in which doors are as wide as usual, and the number of these doors.

    Args:
        plan: The plan.
        door: The median width of its doors in the present unit; None if it has too few: then they
            are sought in the walls, in units that make the plan a home.
    """
    found: list[tuple[float, str, int]] = []
    for unit, metres in UNITS.items():
        widths = [door.width_m * metres for door in plan.doorways if door.leaf]
        if door is None and _is_likely(plan, unit):
            free = affinity.scale(plan.free_space, metres, metres, origin=(0, 0))
            with suppress(FloorPlanError):
                scaled = FloorPlan.build(plan.name, free, doorways=None, regions_are="none")
                widths = [doorway.width_m for doorway in scaled.doorways]
        if len(widths) >= FEWEST_DOORS:
            times = sorted(widths)[len(widths) // 2] / USUAL_DOOR_M
            found.append((max(times, 1 / times), unit, len(widths)))
    error, unit, doors = min(found, default=(DOOR_FACTOR, "", 0))
    return (unit, doors) if error < DOOR_FACTOR else None


def _found(
    kind: str, severity: Severity, text: str, at: shapely.Point, shape: BaseGeometry, rest: str = ""
) -> Finding:
    """Return a finding about a shape [m]; the place stands between the text and the rest of it."""
    return Finding(kind, severity, f"{text} at {_place(at)}{rest}", (at.x, at.y), shape)


def _parts(plan: FloorPlan) -> Iterator[Finding]:
    parts = sorted(shapely.get_parts(plan.free_space).tolist(), key=lambda part: -part.area)[1:]
    ends = shapely.MultiPoint([at for p in plan.portals for at in (p.start, p.end)])
    parts = [part for part in parts if not part.intersects(ends)]
    for part in parts:
        if part.area >= PART_M2:
            text = f"nothing joins a part of {part.area:.2f} m2"
            rest = " to the rest"
            others = shapely.difference(plan.free_space, part)
            if (apart := shapely.distance(part, others)) <= NEARLY_JOINED_M:
                near = shapely.get_point(shapely.shortest_line(part, others), 0)
                rest += f", though they are only {apart:.3f} m apart at {_place(near)}"
            yield _found("parts", "wrong", text, part.representative_point(), part, rest)
    small = [part for part in parts if part.area < PART_M2]
    if small:
        text = (
            f"nothing joins {counted(len(small), 'part')} smaller than {PART_M2:g} m2 to the rest,"
        )
        if len(small) > 1:
            text += " the largest"
        shape = shapely.MultiPolygon(small)
        yield _found("parts", "odd", text, small[0].representative_point(), shape)


def _storeys(plan: FloorPlan) -> Iterator[Finding]:
    """Tell what a robot that climbs no stairs doesn't get to."""
    if not plan.portals:
        return
    parts = shapely.get_parts(plan.free_space).tolist()
    at = shapely.Point(plan.entrance or plan.portals[0].start)
    own = next((part for part in parts if part.intersects(at)), parts[0])
    others = [part for part in parts if part is not own]
    away = [r for r in plan.rooms if not own.intersects(shapely.Point(r.anchor_xy))]
    names = ", ".join(room.name for room in away[:FEW_NAMES])
    names += f" and {len(away) - FEW_NAMES} more" if len(away) > FEW_NAMES else ""
    area = sum_in_order(room.area_m2 for room in away)
    text = (
        f"a robot that starts at ({at.x:.2f}, {at.y:.2f}) m and climbs no stairs can't get to"
        f" {area:.1f} m2 of {plan.area_m2:.1f} m2: {names}"
    )
    yield Finding("storeys", "odd", text, away[0].anchor_xy, shapely.MultiPolygon(others))


def _no_go(plan: FloorPlan) -> Iterator[Finding]:
    covered = shapely.intersection(shapely.union_all(plan.no_go), plan.free_space)
    if covered.area > MAX_NO_GO_SHARE * plan.area_m2:
        share = 100 * covered.area / plan.area_m2
        text = f"robots keep out of {share:.0f} % of the floor: no_go covers it,"
        yield _found("no_go", "wrong", text, covered.representative_point(), covered)


def _specks(plan: FloorPlan) -> Iterator[Finding]:
    holes = [hole for part in shapely.get_parts(plan.free_space) for hole in part.interiors]
    specks = [s for s in map(shapely.Polygon, holes) if s.area < SPECK_M2]
    if specks:
        size = f"of wall smaller than {SPECK_M2:g} m2 inside the home"
        text = f"{counted(len(specks), 'piece')} {size}, the first"
        at = specks[0]
        shape = shapely.MultiPolygon(specks)
        yield _found("specks", "odd", text, at.representative_point(), shape)


# --- Labels --------------------------------------------------------------------------------------


def _labels(plan: FloorPlan) -> Iterator[Finding]:
    for room in plan.rooms:
        if room.area_m2 < TINY_ROOM_M2 and room.type != UNKNOWN:
            text = f"{room.name} has only {room.area_m2:.2f} m2"
            yield Finding("room", "odd", text, room.anchor_xy)
        meant = did_you_mean(room.type, PRIORITY)
        if room.type not in (UNKNOWN, "room", *PRIORITY) and "?" in meant:
            text = f"{room.name} has the unusual type {room.type!r}{meant}"
            yield Finding("labels", "odd", text, room.anchor_xy)
    unlabelled = sum_in_order(room.area_m2 for room in plan.rooms if room.type == UNKNOWN)
    share = unlabelled / sum_in_order(room.area_m2 for room in plan.rooms)
    if share > MAX_UNLABELLED_SHARE:
        text = f"{100 * share:.0f} % of the floor belongs to no room with a known use"
        yield Finding("labels", "odd", text)
    regions = _by_shape(plan)
    yield from _outside(plan, regions)
    yield from _overlaps(regions)


def _by_shape(plan: FloorPlan) -> list[LabelledRegion]:
    """Return the regions with an extent, those of one shape joined to one with all labels."""
    joined: dict[bytes, LabelledRegion] = {}
    for region in plan.regions:
        key = shapely.to_wkb(shapely.normalize(region.shape))
        if key in joined:
            region = replace(joined[key], labels=joined[key].labels + region.labels)
        if region.shape.area > 0:
            joined[key] = region
    return list(joined.values())


def _outside(plan: FloorPlan, regions: list[LabelledRegion]) -> Iterator[Finding]:
    filled = [shapely.Polygon(part.exterior) for part in shapely.get_parts(plan.free_space)]
    reach = shapely.union_all(filled).buffer(MAX_OVER_WALLS_M, join_style="mitre")
    for region in regions:
        outside = shapely.difference(region.shape, reach)
        if outside.area > MAX_OUTSIDE_SHARE * region.shape.area:
            share = f"{100 * outside.area / region.shape.area:.0f} %"
            text = f"{share} of what is labelled {_called(region)} lies outside the home,"
            yield _found("outside", "odd", text, outside.representative_point(), outside)


def _overlaps(regions: list[LabelledRegion]) -> Iterator[Finding]:
    shapes = np.array([region.shape for region in regions], dtype=object)
    first, second = shapely.STRtree(shapes).query(shapes, predicate="intersects")
    for i, j in sorted(zip(first.tolist(), second.tolist(), strict=True)):
        one = regions[i]
        other = regions[j]
        if i >= j or set(one.types) == set(other.types):
            continue
        both = shapely.intersection(one.shape, other.shape)
        smaller = min(one.shape.area, other.shape.area)
        if both.area > max(MAX_OVERLAP_M2, MAX_OVERLAP_SHARE * smaller):
            text = f"the labels {_called(one)} and {_called(other)} overlap by {both.area:.1f} m2"
            rest = ": the smaller one counts there"
            yield _found("overlap", "odd", text, both.representative_point(), both, rest)


def _called(region: LabelledRegion) -> str:
    return region.name or "/".join(region.types) or UNKNOWN


def _doors(plan: FloorPlan) -> Iterator[Finding]:
    for line in plan.lost_doorways:
        (x0, y0), (x1, y1) = line.start, line.end
        called = f"{line.name + ' ' if line.name else ''}from ({x0:.2f}, {y0:.2f}) to"
        text = f"the door {called} ({x1:.2f}, {y1:.2f}) m is in no wall: it doesn't close a passage"
        yield Finding("door", "wrong", text, *_along(line))
    for door in plan.doorways:
        if door.leaf and door.width_m > WIDEST_DOOR_M:
            text = f"the door {door.name} is {door.width_m:.2f} m wide"
            yield Finding("door", "odd", text, *_along(door))


def _along(door: DoorLine | Doorway) -> tuple[Point, shapely.LineString]:
    """Return the middle of a door, and its line [m]."""
    (x0, y0), (x1, y1) = door.start, door.end
    return ((x0 + x1) / 2, (y0 + y1) / 2), shapely.LineString([door.start, door.end])


# --- Routes ---------------------------------------------------------------------------------------


def _routes(home: Home, radius: float) -> Iterator[Finding]:
    """Find the places that a robot can't get to, because of walls or of furniture."""
    plan = home.plan
    body = f"a body of radius {radius:g} m"
    try:
        # A robot that is put on another storey lives there.
        space = home.space(radius, uses_portals=True)
    except FloorPlanError:
        yield Finding("space", "unlivable", f"{body} fits nowhere in {plan.name}")
        return
    main = main_part(plan, space)
    if plan.entrance is not None and main is None:
        x, y = plan.entrance
        text = f"{body} can't stand at the entrance at ({x:.2f}, {y:.2f}) m"
        yield Finding("entrance", "wrong", text, plan.entrance)
    reached = space.part_of_cell == (0 if main is None else main)
    empty = Space(plan, radius) if plan.objects else None
    for room in plan.rooms:
        in_room = plan.room_of_cell == room.index
        if not (in_room & reached).any():
            yield _closed_room(room, body, empty, space, in_room)
            continue
        for part in range(space.parts):
            lost = in_room & (space.part_of_cell == part) & ~reached
            if np.count_nonzero(lost) * plan.lattice.cell**2 >= PART_M2:
                yield _corner(plan, room, lost, body, empty)


def main_part(plan: FloorPlan, space: Space) -> int | None:
    """Return the part of a space with the entrance, or the largest; None if no part has it."""
    if plan.entrance is None:
        return 0
    x, y = plan.lattice.point_at(plan.entrance)
    part = space.part_at(x, y)
    return part if part >= 0 else None


def _closed_room(room: Room, body: str, empty: Space | None, space: Space, cells: Bool) -> Finding:
    severity: Severity = "wrong" if room.area_m2 >= TINY_ROOM_M2 else "odd"
    size = f"{room.name} ({room.area_m2:.1f} m2)"
    if empty is not None and (cells & (empty.part_of_cell == 0)).any():
        text = f"furniture keeps {body} out of {size}"
    elif (cells & (space.part_of_cell >= 0)).any():
        text = f"{body} can't get to {size}"
    else:
        text = f"{body} fits nowhere in {size}"
    return Finding("room", severity, text, room.anchor_xy)


def _corner(plan: FloorPlan, room: Room, lost: Bool, body: str, empty: Space | None) -> Finding:
    rows, columns = np.nonzero(lost)
    nearest = int(np.argmin((rows - rows.mean()) ** 2 + (columns - columns.mean()) ** 2))
    cell = plan.lattice.cell_centre(int(rows[nearest]), int(columns[nearest]))
    x, y = plan.lattice.to_metres(cell).tolist()
    corner = f"{len(rows) * plan.lattice.cell**2:.1f} m2 of {room.name}, at ({x:.2f}, {y:.2f}) m"
    text = f"{body} can't get to {corner}"
    if empty is not None and empty.part_of_cell[rows[nearest], columns[nearest]] == 0:
        text = f"furniture keeps {body} out of {corner}"
    return Finding("room", "wrong", text, (x, y))


# --- Objects -------------------------------------------------------------------------------------


def _standing_in_walls(plan: FloorPlan) -> Iterator[Finding]:
    free = plan.free_space
    for thing in plan.objects:
        inside = shapely.intersection(thing.footprint, free).area
        if thing.blocks == "nothing" and shapely.distance(thing.footprint, free) < BESIDE_M:
            continue  # a charger in its niche, a mat half under a door
        if inside < 0.95 * thing.footprint.area:
            lost = 100 * (1 - inside / thing.footprint.area)
            text = f"{lost:.0f} % of {thing.name} is in a wall or outside the home"
            yield Finding("object", "wrong", text, _centre(thing), thing.footprint)
    solid = [thing for thing in plan.objects if thing.blocks != "nothing"]
    for i, thing in enumerate(solid):
        for other in solid[:i]:
            both = shapely.intersection(thing.footprint, other.footprint)
            if both.area > SPECK_M2:
                text = f"{thing.name} and {other.name} stand in each other ({both.area:.2f} m2)"
                yield Finding("object", "odd", text, _centre(thing), both)


def _unreachable_objects(plan: FloorPlan) -> Iterator[Finding]:
    """Find the objects that nobody can get to."""
    if not plan.objects:
        return
    try:
        space = Home(plan).space(PERSON_RADIUS, uses_portals=True)
    except FloorPlanError:
        return  # reported for the robot; for a doll's house it doesn't matter
    standing = space.part_of_cell == (main_part(plan, space) or 0)
    for thing in plan.objects:
        if thing.uses:
            reached = bool(with_approaches(plan, thing, standing, plan.objects).uses)
        else:
            reach = PERSON_RADIUS + BESIDE_M
            window, beside = grown_cells(plan.lattice, thing.footprint, reach)
            reached = bool((standing[window] & beside).any())
        if not reached:
            text = f"nobody can get to {thing.name}: there is no free place to use it from"
            yield Finding("object", "wrong", text, _centre(thing), thing.footprint)


def _place(at: shapely.Point) -> str:
    return f"({at.x:.2f}, {at.y:.2f}) m"


def _centre(thing: PlacedObject) -> Point:
    middle = thing.footprint.centroid
    return middle.x, middle.y
