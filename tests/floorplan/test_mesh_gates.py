"""Doors in the mesh: shut ones are walls to every kernel, open ones are nothing."""

import numpy as np
import pytest
import shapely
from hypothesis import assume, given, settings
from tests.meshed_homes import all_homes, awkward_points, home_of
from tests.reference.line_of_sight import is_inside, touches_any_wall
from tests.strategies import homes, seeds
from tests.thorough import examples

from fleet2d._core import region_contains
from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.lattice import Lattice
from fleet2d.floorplan.mesh import Gates, build_mesh
from fleet2d.floorplan.rooms.doorways import DoorLine, fit_lines
from fleet2d.kernels import line_of_sight, locate, visible_region

ROOM = [shapely.box(0, 0, 640, 640)]
MIDDLE = ((320, 0), (320, 640))


def with_gates(home, rng, count):
    """Return the home with doors from wall to wall at random places and angles, and these."""
    lattice = Lattice(0.05, (0.0, 0.0), home.columns, home.rows)
    cells = home.cells
    lines = []
    for x, y in cells[rng.integers(len(cells), size=count)].tolist():
        dx, dy = rng.integers(-3, 4, 2).tolist()
        if (dx, dy) == (0, 0):
            dx = 1
        ends = lattice.to_metres([(x - 99 * dx, y - 99 * dy), (x + 99 * dx, y + 99 * dy)])
        lines.append(DoorLine(tuple(ends[0].tolist()), tuple(ends[1].tolist())))
    polygons, segments, _ = fit_lines(lattice, home.polygons, lines)
    home, segments = home_of(polygons), [segment for segment in segments if segment is not None]
    corners = [end for segment in segments for end in segment]
    return home, segments, Gates(build_mesh(polygons, home.columns, home.rows, corners), segments)


def verdicts(mesh, eye, points):
    """Return whether each point is visible, by the walk through the mesh."""
    x, y = eye.tolist()
    triangle = locate(mesh, x, y)
    return np.array(
        [triangle >= 0 and line_of_sight(mesh, x, y, triangle, *p) for p in points.tolist()]
    )


def truth(home, shut, eye, points):
    """Return whether each point is visible, by looking at every wall and every shut door."""
    walls = home.walls
    if shut:
        walls = np.concatenate([walls, np.array(shut, np.int64).reshape(-1, 4)])
    inside = is_inside(home.walls, np.concatenate([eye[None], points]))
    return inside[1:] & inside[0] & ~touches_any_wall(walls, eye, points)


def compare(home, rng, doors, eyes, points):
    """Compare all verdicts with some doors shut; return how many there were."""
    home, segments, gates = with_gates(home, rng, doors)
    pairs = 0
    for _ in range(eyes):
        shut = set(np.flatnonzero(rng.integers(2, size=len(segments))).tolist())
        mesh = gates.shut(shut)
        lines = [segments[i] for i in sorted(shut)]
        eye = home.cells[rng.integers(len(home.cells))]
        targets = awkward_points(home, rng, points)
        on_doors = np.array(segments, np.int64).reshape(-1, 2, 2).sum(axis=1) // 2
        targets = np.concatenate([targets, on_doors])
        answers = verdicts(mesh, eye, targets)
        np.testing.assert_array_equal(truth(home, lines, eye, targets), answers)
        pairs += len(targets)
    return pairs


@given(homes(), seeds())
@settings(max_examples=examples(60))
def test_sight_past_shut_and_open_doors_equals_a_test_of_every_wall(polygons, seed):
    assume(len(home_of(polygons).cells))
    compare(home_of(polygons), np.random.default_rng(seed), doors=4, eyes=3, points=40)


def test_doors_of_real_homes_end_sight_exactly_as_walls(shared_data):
    rng = np.random.default_rng(5)
    pairs = [compare(home, rng, doors=6, eyes=4, points=250) for home in all_homes(shared_data)]
    assert sum(pairs) > 800 * len(pairs)


@given(homes(), seeds())
@settings(max_examples=examples(40))
def test_regions_follow_doors_as_single_sight_lines_do(polygons, seed):
    rng = np.random.default_rng(seed)
    assume(len(home_of(polygons).cells))
    home, segments, gates = with_gates(home_of(polygons), rng, 3)
    mesh = gates.shut(range(len(segments)))
    eye = home.cells[rng.integers(len(home.cells))]
    points = awkward_points(home, rng, 60)
    x, y = eye.tolist()
    pieces = visible_region(mesh, x, y)
    inside = [region_contains(mesh, x, y, *pieces, *p) for p in points.tolist()]
    assert inside == truth(home, segments, eye, points).tolist()


def test_shutting_changes_nothing_of_the_mesh_that_was_handed_out():
    gates = Gates(build_mesh(ROOM, 10, 10, MIDDLE), [MIDDLE])
    before = gates.mesh.neighbors.copy()
    assert (gates.shut({0}).neighbors != before).sum() == 2
    np.testing.assert_array_equal(before, gates.mesh.neighbors)


def test_segment_that_ends_at_no_wall_is_refused():
    with pytest.raises(FloorPlanError, match=r"ends at \(320, 300\)"):
        Gates(build_mesh(ROOM, 10, 10), [((320, 300), (0, 0))])


def test_segment_through_a_wall_is_refused():
    room = [shapely.box(0, 0, 640, 640).difference(shapely.box(200, 0, 300, 400))]
    with pytest.raises(FloorPlanError, match="does not cross free space alone"):
        Gates(build_mesh(room, 10, 10, ((0, 100), (640, 100))), [((0, 100), (640, 100))])
