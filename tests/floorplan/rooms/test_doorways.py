"""Door lines fitted to walls, and the names of doorways."""

import numpy as np
import pytest
import shapely
from hypothesis import example, given, settings
from tests.meshed_homes import all_homes
from tests.strategies import homes, seeds
from tests.thorough import examples

from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.lattice import Lattice
from fleet2d.floorplan.plan import FloorPlan, LabelledRegion
from fleet2d.floorplan.rooms.doorways import DoorLine, _with_corner, fit_lines

FREE = shapely.union_all(
    [shapely.box(0, 0, 2, 3), shapely.box(2.1, 0, 5, 3), shapely.box(2, 1, 2.1, 1.9)]
)
ROOMS = [
    LabelledRegion(("Kitchen",), shapely.box(0, 0, 2.05, 3)),
    LabelledRegion(("Bathroom",), shapely.box(2.05, 0, 5, 3)),
]


def flat(*lines):
    return FloorPlan.build("flat", FREE, ROOMS, doorways=lines)


def test_doorway_ends_exactly_at_the_jambs():
    (doorway,) = flat(DoorLine((2.05, 1.1), (2.05, 1.8))).doorways
    assert ((2.05, 1.0), (2.05, 1.9)) == (doorway.start, doorway.end)
    assert doorway.width_m == pytest.approx(0.9)


def test_doorway_is_named_after_the_rooms_on_its_left_and_right():
    plan = flat(DoorLine((2.05, 1.0), (2.05, 1.9)))
    assert "kitchen_1-bathroom_1" == plan.doorways[0].name
    assert (plan.room("kitchen_1").index, plan.room("bathroom_1").index) == plan.doorways[0].rooms
    assert plan.doorway("kitchen_1-bathroom_1") is plan.doorways[0]


@pytest.mark.parametrize(
    "line",
    [
        DoorLine((0.5, 0.5), (1.0, 0.5)),  # in the middle of a room, walls too far
        DoorLine((2.05, 2.2), (2.05, 2.8)),  # inside the wall
        DoorLine((9.0, 1.0), (9.0, 2.0)),  # outside
        DoorLine((2.05, 1.5), (2.05, 1.5)),  # no length
    ],
)
def test_line_in_no_passage_is_noted_and_left_out(line):
    plan = flat(line)
    assert () == plan.doorways
    assert any("ends at no wall: left out" in note for note in plan.notes)


def test_second_of_two_lines_that_cross_is_left_out():
    plan = flat(DoorLine((0, 0.5), (2, 0.5)), DoorLine((1, 0), (1, 3)))
    assert 1 == len(plan.doorways)
    assert any("touches another one" in note for note in plan.notes)


def test_line_between_slanted_walls_gives_them_a_corner_less_than_a_millimetre_off():
    room = shapely.Polygon([(0, 0), (4, 0.37), (4.11, 2.93), (0.13, 3.0)])
    plan = FloorPlan.build("slanted", room, doorways=[DoorLine((2, 0.2), (2, 2.95))])
    (doorway,) = plan.doorways
    walls = shapely.union_all([polygon.boundary for polygon in plan.polygons])
    for end in (doorway.start, doorway.end):
        assert walls.intersects(shapely.Point(plan.lattice.to_lattice(end)))
    before = FloorPlan.build("slanted", room)
    change = shapely.hausdorff_distance(
        shapely.MultiPolygon(plan.polygons), shapely.MultiPolygon(before.polygons)
    )
    assert change / plan.lattice.units_per_m < 0.001


@settings(max_examples=examples(100))
@given(homes(), seeds())
@example([shapely.box(192, 128, 256, 192)], 455)  # the corner lies beyond the end of its wall
def test_corner_beside_a_wall_keeps_a_polygon_valid_where_no_other_wall_is_near(polygons, seed):
    draw = np.random.default_rng(seed)
    for polygon in polygons:
        corners = shapely.get_coordinates(polygon)
        start = draw.integers(len(corners) - 1)
        place = corners[start] + draw.random() * (corners[start + 1] - corners[start])
        point = 2.0 * np.rint((place + draw.integers(-6, 7, 2)) / 2)
        changed, is_alone = _with_corner(polygon, point)
        assert changed.is_valid or not is_alone
        assert (shapely.get_coordinates(changed) == point).all(axis=1).any()


@pytest.mark.parametrize(("tip", "is_alone"), [(1.0, False), (3.0, True)])
def test_corner_is_alone_unless_its_wall_moves_over_another(tip, is_alone):
    wedge = [(50, tip), (52, 90), (48, 90)]
    polygon = shapely.Polygon([(0, 0), (100, 0), (100, 100), (0, 100)], [wedge])
    changed, was_alone = _with_corner(polygon, np.array([10.0, 4.0]))
    assert is_alone == was_alone == changed.is_valid


def test_unknown_doorway_is_refused_with_the_known_ones():
    with pytest.raises(FloorPlanError, match=r"no doorway 'kitchen'.*kitchen_1-bathroom_1"):
        flat(DoorLine((2.05, 1.0), (2.05, 1.9))).doorway("kitchen")


def check_fitted(polygons, columns, rows, seed):
    """Fit random lines; return how many stood from wall to wall."""
    rng = np.random.default_rng(seed)
    lattice = Lattice(0.05, (0.0, 0.0), columns, rows)
    ends = rng.integers(0, [columns * 64, rows * 64], (12, 2, 2))
    lines = [DoorLine(tuple(a), tuple(b)) for a, b in lattice.to_metres(ends).tolist()]
    walls, segments, notes = fit_lines(lattice, polygons, lines)
    free = shapely.MultiPolygon(walls)
    assert free.is_valid
    fitted_lines = [shapely.LineString(segment) for segment in segments if segment is not None]
    for line in fitted_lines:
        assert shapely.relate_pattern(line, free, "1FFF0F***")
        assert (np.asarray(line.coords) % 2 == 0).all()
    assert len(lines) == len(fitted_lines) + len(notes)
    return len(fitted_lines)


@given(homes(), seeds())
@settings(max_examples=examples(60))
def test_fitted_lines_cross_free_space_alone(polygons, seed):
    _, _, x1, y1 = shapely.total_bounds(polygons).astype(int).tolist()
    check_fitted(polygons, x1 // 64 + 2, y1 // 64 + 2, seed)


def test_lines_in_real_homes_are_fitted_or_noted(shared_data):
    fitted = [check_fitted(h.polygons, h.columns, h.rows, 3) for h in all_homes(shared_data)]
    assert sum(fitted) > len(fitted)
