"""Meshes of outlines: their triangles fill the free space, also where outlines touch."""

import numpy as np
import pytest
import shapely
from hypothesis import given
from shapely.geometry import Polygon
from tests.meshed_homes import all_homes, home_of
from tests.strategies import homes, quick

from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.mesh import build_mesh, snap_polygon
from fleet2d.homes.formats.occupancy import outline

SQUARE = [(0, 0), (640, 0), (640, 640), (0, 640)]


def doubled_area(mesh):
    """Return twice the area of all triangles, each of which must count positively."""
    a, b, c = (mesh.vertices[mesh.triangles[:, k]] for k in range(3))
    (ux, uy), (vx, vy) = (b - a).T, (c - a).T
    areas = ux * vy - uy * vx
    assert (areas > 0).all()
    return int(areas.sum())


def check_mesh(mesh, polygons):
    """Check everything that the kernels rely on."""
    keys = [tuple(vertex) for vertex in mesh.vertices.tolist()]
    assert keys == sorted(set(keys))
    assert 2 * sum(polygon.area for polygon in polygons) == doubled_area(mesh)
    for triangle, neighbors in enumerate(mesh.neighbors.tolist()):
        corners = mesh.triangles[triangle].tolist()
        for k, neighbor in enumerate(neighbors):
            if neighbor == -1:
                continue
            back = mesh.neighbors[neighbor].tolist().index(triangle)
            across = mesh.triangles[neighbor].tolist()
            assert (corners[k], corners[(k + 1) % 3]) == (across[(back + 1) % 3], across[back])
    walls = shapely.union_all([polygon.boundary for polygon in polygons])
    triangle, k = np.nonzero(mesh.neighbors == -1)
    ends = mesh.triangles[triangle, k], mesh.triangles[triangle, (k + 1) % 3]
    lines = shapely.linestrings(np.stack([mesh.vertices[end] for end in ends], axis=1))
    assert shapely.covers(walls, lines).all()
    assert shapely.length(lines).sum() == pytest.approx(walls.length)


@quick
@given(homes())
def test_mesh_fills_the_free_space_and_ends_at_walls(polygons):
    check_mesh(home_of(polygons).mesh, polygons)


def test_mesh_fills_real_homes(shared_data):
    for home in all_homes(shared_data):
        assert 2 * sum(polygon.area for polygon in home.polygons) == doubled_area(home.mesh)


@pytest.mark.parametrize(
    "holes",
    [
        pytest.param([[(0, 0), (200, 100), (100, 200)]], id="hole at a corner of the room"),
        pytest.param([[(0, 320), (200, 200), (200, 400)]], id="hole at the middle of a wall"),
        pytest.param(
            [
                [(100, 100), (200, 100), (200, 200), (100, 200)],
                [(200, 200), (300, 200), (300, 300), (200, 300)],
            ],
            id="two holes corner to corner",
        ),
        pytest.param(
            [
                [(100, 100), (200, 100), (200, 300), (100, 300)],
                [(200, 200), (300, 150), (300, 250)],
            ],
            id="corner of a hole at the middle of another",
        ),
        pytest.param(
            [[(100, 100), (200, 100), (300, 100), (300, 200), (100, 200)]], id="flat corner"
        ),
    ],
)
def test_rings_may_touch(holes):
    polygon = Polygon(SQUARE, holes)
    assert polygon.is_valid

    check_mesh(build_mesh([polygon], 10, 10), [polygon])


def test_map_in_which_geos_fails_has_a_mesh_all_the_same():
    """A 70th of maps with thin slanted walls couldn't be read: "Unable to find a convex corner"."""
    pixels = np.ones((14, 18), np.bool_)
    for row, columns in ((6, "9-12"), (9, "9 17"), (10, "10-16"), (11, "11-14"), (12, "8-10")):
        for span in columns.split():
            first, _, last = span.partition("-")
            pixels[row, int(first) : int(last or first) + 1] = False
    polygon = shapely.transform(outline(pixels), lambda corners: corners * 64)
    with pytest.raises(shapely.GEOSException):
        shapely.constrained_delaunay_triangles(polygon)

    check_mesh(build_mesh([polygon], 18, 14), [polygon])


def test_polygons_may_touch_at_corners_and_at_walls():
    polygons = [
        shapely.box(0, 0, 200, 200),
        shapely.box(200, 200, 400, 400),
        Polygon([(400, 300), (500, 250), (500, 350)]),
    ]

    check_mesh(build_mesh(polygons, 10, 10), polygons)


@pytest.mark.parametrize(
    ("polygons", "message"),
    [
        ([], "no free space"),
        ([shapely.box(0, 0, 63, 64)], "even lattice units"),
        ([shapely.box(0, 0, 64.5, 64)], "even lattice units"),
        ([shapely.box(-2, 0, 64, 64)], "the plan covers"),
        ([shapely.box(0, 0, 642, 64)], "the plan covers"),
        ([shapely.box(0, 0, 200, 200), shapely.box(100, 100, 300, 300)], "overlap"),
        ([Polygon([(0, 0), (200, 200), (200, 0), (0, 300)])], "outlines cross"),
        ([shapely.box(0, 0, 200, 200), shapely.box(200, 0, 300, 200)], "share a piece of wall"),
        ([shapely.box(0, 0, 200, 200), shapely.box(50, 50, 100, 100)], "overlap"),
    ],
)
def test_wrong_free_space_is_an_error(polygons, message):
    with pytest.raises(FloorPlanError, match=message):
        build_mesh(polygons, 10, 10)


def test_snapping_moves_walls_to_even_units_within_the_tolerance(shared_data):
    rng = np.random.default_rng(5)
    for _ in range(50):
        outline = shapely.convex_hull(shapely.multipoints(rng.uniform(0, 3000, (9, 2))))

        snapped = snap_polygon(outline)

        points = shapely.get_coordinates(snapped.polygons)
        assert np.array_equal(points % 2, np.zeros_like(points))
        assert snapped.area_change == pytest.approx(snapped.polygons[0].area - outline.area)
        assert abs(snapped.area_change) <= snapped.tolerance


def test_snapping_drops_what_is_thinner_than_the_lattice():
    boxes = [(0, 0, 100, 100), (100, 50, 200, 50.5), (200, 0, 300, 100)]
    rooms = shapely.union_all([shapely.box(*box) for box in boxes])

    snapped = snap_polygon(rooms)

    assert [10000, 10000] == [part.area for part in snapped.polygons]
    assert snapped.area_change == pytest.approx(-50)
    assert snap_polygon(shapely.box(0, 0, 500, 0.3)).polygons == []


def test_crossed_outline_becomes_its_loops_and_changes_the_area():
    bow_tie = Polygon([(0, 0), (200, 200), (200, 0), (0, 200)])

    snapped = snap_polygon(bow_tie)

    assert [10000, 10000] == [part.area for part in snapped.polygons]
    assert abs(snapped.area_change) > snapped.tolerance
