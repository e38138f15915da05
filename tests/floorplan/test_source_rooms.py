import pytest
import shapely
from pydantic import ValidationError

from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.native import Bundled
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.floorplan.source import RoomCorrection, correct_rooms

LEFT, RIGHT, DOOR = (1.0, 1.0, 4.0, 4.0), (4.1, 1.0, 7.6, 4.0), (4.0, 2.0, 4.1, 2.9)


@pytest.fixture
def plan():
    """Two rooms: `room_1` on the right, and the smaller `room_2` on the left."""
    free = shapely.union_all([shapely.box(*box) for box in (LEFT, RIGHT, DOOR)])
    assert isinstance(free, shapely.Polygon)
    return FloorPlan.build("flat", free, doorways=None, regions_are="none")


def names(plan):
    return [(room.name, room.type) for room in plan.rooms]


def test_place_names_and_retypes_its_room_and_its_doorway(plan):
    result = correct_rooms(plan, [RoomCorrection(at=(2, 2), name="den", type="Home Office")])

    assert [("room_1", "room"), ("den", "office")] == names(result)
    assert ("office",) == result.room("den").labels
    assert {"den-room_1", "room_1-den"} & {doorway.name for doorway in result.doorways}
    assert [("room_1", "room"), ("room_2", "room")] == names(plan)


def test_room_that_is_only_retyped_is_named_after_its_type(plan):
    result = correct_rooms(
        plan, [RoomCorrection(at=(2, 2), type="Küche"), RoomCorrection(at=(5, 2), type="kitchen")]
    )

    assert [("kitchen_1", "kitchen"), ("kitchen_2", "kitchen")] == names(result)


def test_polygon_takes_its_cells_from_other_rooms(plan):
    corners = ((5.6, 0.0), (9.0, 0.0), (9.0, 9.0), (5.6, 9.0))

    result = correct_rooms(plan, [RoomCorrection(polygon=corners, type="bedroom")])

    assert [("room_1", "room"), ("room_2", "room"), ("bedroom_1", "bedroom")] == names(result)
    assert 6.0 == pytest.approx(result.room("bedroom_1").area_m2)
    assert plan.area_m2 == pytest.approx(sum(room.area_m2 for room in result.rooms), abs=0.2)
    assert ["bedroom_1"] == [
        result.rooms[link.rooms[1]].name for link in result.room_graph if link.kind == "open"
    ]


def test_polygon_over_a_whole_room_replaces_it(plan):
    corners = ((0.0, 0.0), (4.05, 0.0), (4.05, 9.0), (0.0, 9.0))

    result = correct_rooms(plan, [RoomCorrection(polygon=corners, name="studio")])

    assert [("room_1", "room"), ("studio", "room")] == names(result)


@pytest.mark.parametrize(
    ("correction", "message"),
    [
        (
            RoomCorrection(at=(-3, 2), name="den"),
            r"floorplan.rooms\[0\]: \(-3, 2\) m is in no room of flat: the nearest free place",
        ),
        (
            RoomCorrection(polygon=((20, 20), (22, 20), (22, 22)), type="office"),
            r"floorplan.rooms\[0\]: no free cell of flat is inside the polygon from \(20, 20\)",
        ),
        (RoomCorrection(at=(2, 2), name="room_1"), "two rooms are named 'room_1'"),
    ],
)
def test_correction_that_fits_nowhere_is_an_error(plan, correction, message):
    with pytest.raises(FloorPlanError, match=message):
        correct_rooms(plan, [correction])


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({"name": "den"}, "needs either 'at'"),
        ({"at": [1, 1]}, "needs a name or a type"),
        ({"at": [1, 1], "polygon": [[0, 0], [1, 0], [1, 1]], "name": "x"}, "needs either 'at'"),
        ({"polygon": [[0, 0], [1, 1]], "type": "office"}, "at least 3 corners"),
        ({"polygon": [[0, 0], [1, 1], [1, 0], [0, 1]], "type": "office"}, "no crossing sides"),
        ({"at": [1, 1], "nmae": "den"}, "did you mean 'name'"),
    ],
)
def test_incomplete_correction_is_refused(content, message):
    with pytest.raises(ValidationError, match=message):
        RoomCorrection.model_validate(content)


def test_scenario_corrects_the_rooms_of_any_source():
    x, y = Bundled().load().room("kitchen_1").anchor_xy

    source = Bundled.model_validate({"rooms": [{"at": [x, y], "name": "galley"}]})

    room = source.plan().room_at(x, y)
    assert ("galley", "kitchen") == (room.name, room.type)
