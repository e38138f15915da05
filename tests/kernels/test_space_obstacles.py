"""Where furniture cuts the space of a body: the kernels beside their slow twins."""

import numpy as np
import shapely
from hypothesis import given
from hypothesis import strategies as st
from shapely.geometry import Polygon
from tests.reference import obstacles as slow
from tests.strategies import homes, quick

from fleet2d.kernels import add_obstacles, wall_obstacles

coordinate = st.integers(0, 24).map(lambda n: 32 * n)
box = st.tuples(coordinate, coordinate, coordinate, coordinate).map(
    lambda b: (min(b[0], b[2]), min(b[1], b[3]), max(b[0], b[2]), max(b[1], b[3]))
)
octagons = st.sampled_from([(2, 2), (16, 6), (64, 26), (100, 0)])


def rings_of(polygons):
    corners, ring_of = shapely.get_coordinates(shapely.get_rings(polygons), return_index=True)
    return corners.astype(np.int64), ring_of.astype(np.int64)


def corners_of(box):
    x0, y0, x1, y1 = box
    return [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]


@quick
@given(homes(), octagons, st.lists(box, max_size=4))
def test_obstacles_and_cuts_equal_the_slow_ones(polygons, octagon, boxes):
    corners, ring_of = rings_of(polygons)
    walls = slow.walls_of(corners, ring_of)
    extents = [slow.grown(wall, *octagon) for wall in walls]
    slanted = [slow.is_slanted(wall) for wall in walls]

    table = wall_obstacles(corners, ring_of, *octagon)
    assert slow.table_of(extents, slanted) == slow.table_read(table)

    expected = 0
    for each in boxes:
        shapes = [slow.shape_of(known) for known in extents]
        extents.append(slow.grown(corners_of(each), *octagon))
        expected += slow.cuts_by(shapes, slanted, slow.shape_of(extents[-1]))
        slanted.append(False)
    further = np.array(boxes, np.int64).reshape(-1, 4)
    table, cuts = add_obstacles(table, further, *octagon)
    assert expected == cuts
    assert slow.table_of(extents, slanted) == slow.table_read(table)


@quick
@given(st.lists(box, min_size=1, max_size=8), octagons)
def test_no_cut_leaves_as_many_pieces_or_fewer(boxes, octagon):
    room = shapely.box(-64, -64, 900, 900)
    table = wall_obstacles(*rings_of([room]), *octagon)
    walls = [slow.shape_of(row) for row in table[:, :8].tolist()]
    space = shapely.difference(room, shapely.union_all(walls))
    for each in boxes:
        table, cuts = add_obstacles(table, np.array([each]), *octagon)
        shape = slow.shape_of(slow.grown(corners_of(each), *octagon))
        pieces, left = (
            sum(part.area > 0 for part in shapely.get_parts(polygons))
            for polygons in (space, shapely.difference(space, shape))
        )
        assert cuts or left <= pieces
        assert left <= pieces + cuts
        space = shapely.difference(space, shape)


def test_a_box_between_a_slanted_wall_and_another_may_cut():
    """Their octagons don't meet at the slanted wall itself, but may where it is at most."""
    tent = wall_obstacles(*rings_of([Polygon([(0, 0), (400, 0), (400, 300)])]), 20, 8)

    assert 1 == add_obstacles(tent, np.array([[110, 0, 130, 20]]), 20, 8)[1]
    assert 0 == add_obstacles(tent, np.array([[340, 0, 400, 20]]), 20, 8)[1]
