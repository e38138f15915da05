"""Heights of cameras, bodies and furniture: in runs, for every span and by every exact method."""

import numpy as np
import pytest
import shapely
from tests.engine.test_cameras_hiding import WALK, seen
from tests.scenes import digests, run, scenario
from tests.thorough import some

import fleet2d
from fleet2d.engine.heights import prisms_of
from fleet2d.floorplan.furniture import stand_furniture
from fleet2d.floorplan.home import Home
from fleet2d.kernels import QUARTER

LIES = {"hold": "ana", "posture": "lie", "duration": "1 h", "at": "0 s"}
ALL = [*range(10)]


def behind(piece, camera_m=0.4, *, x=4.0, **ana):
    """A robot at the west end of the living room, ana at x, and furniture at 2.6 m between them."""
    users = {"ana": {"start": [x, 3.2], **ana}}
    camera = {"height": camera_m, "range": [0, 6]}
    robot = {"start": [0.6, 3.2], "start_heading_deg": 0, "camera": camera}
    content = scenario("10 s", users=users, robots={"astro": robot}) | {"sight": {"heights": True}}
    if piece is not None:
        content["floorplan"]["furniture"] = [{"at": [2.6, 3.3], "heading_deg": 0, **piece}]
    return content


SOFA = {"type": "sofa", "size": [1.2, 0.9]}
WARDROBE = {"type": "wardrobe", "size": [1.2, 0.6]}


# The line rises from the camera over the back of the sofa, 0.85 m high, which begins at 2.15 m: 1.55 m from the camera,
# where ana is at 3.4 m. Her head is at 15/16 of her height.
HIDDEN_BELOW_M = 0.4 + (0.85 - 0.4) * 3.4 / 1.55


ON_THE_FLOOR = {"script": [LIES]}
CASES = {
    "who stands": (SOFA, {}, {}, True),
    "who lies": (SOFA, {}, ON_THE_FLOOR, False),
    "who lies, where heights don't count": (SOFA, {}, ON_THE_FLOOR | {"sight": {}}, True),
    "who lies behind nothing": (None, {}, ON_THE_FLOOR, True),
    "a head just above the line": (SOFA, {"height": (HIDDEN_BELOW_M + 0.005) * 16 / 15}, {}, True),
    "a head just below it": (SOFA, {"height": (HIDDEN_BELOW_M - 0.005) * 16 / 15}, {}, False),
    "below a high camera": (SOFA, {"camera_m": 2.5, "x": 4.7, "height": 0.3}, {}, True),
    "below a lower one": (SOFA, {"camera_m": 1.0, "x": 4.7, "height": 0.3}, {}, False),
    "behind a table on legs": ({"type": "table", "size": [1.2, 0.9]}, {}, {}, True),
    "behind a flat sofa": ({**SOFA, "height": 0}, {}, {}, True),
    "behind a high one": ({**SOFA, "height": 2.0}, {}, {}, False),
    "behind a wardrobe": (WARDROBE, {}, {}, False),
    "behind a low one": ({**WARDROBE, "height": 0.9, "blocks": "path"}, {}, {}, True),
}


@pytest.mark.parametrize("name", CASES)
def test_who_is_seen_behind_furniture(name):
    piece, ana, sections, is_seen = CASES[name]
    assert seen(behind(piece, **ana) | sections) == ({"ana": ALL} if is_seen else {})


@pytest.mark.parametrize(("of_body", "is_seen"), [({}, False), ({"height": 1.7}, True)])
def test_a_pet_is_low_and_a_height_of_its_own_counts(of_body, is_seen):
    content = behind(SOFA, type="pet", nap="1 h", **of_body)
    assert is_seen == ("ana" in seen(content))


@pytest.mark.parametrize(("height_cm", "expected"), [(80, {}), (15, {"ana": ALL})])
def test_a_sofa_of_sweet_home_3d_hides_as_high_as_its_file_says(tmp_path, height_cm, expected):
    """Ana lies behind it; its back is to the right."""
    home = tmp_path / "Home.xml"
    home.write_text(
        '<home><room name="Living room"><point x="0" y="0"/><point x="600" y="0"/>'
        '<point x="600" y="-600"/><point x="0" y="-600"/></room><pieceOfFurniture name="Sofa"'
        f' x="260" y="-330" width="120" depth="90" height="{height_cm}" angle="1.5707963"/></home>'
    )
    content = behind(None) | {"floorplan": {"type": "sweethome", "path": str(home)}}

    assert expected == seen({**content, "script": [LIES]})


def test_the_share_in_view_counts_parts_of_the_body_behind_furniture():
    content = behind(SOFA)
    robot = content["robots"]["astro"]
    robot["camera"]["body_points"] = 6
    robot["perception"] = {"detection": {"visible_share": [[0.5, 0], [0.51, 1]]}}

    assert {} == seen(content)
    assert {"ana": ALL} == seen({**content, "sight": {}})


@pytest.mark.parametrize(("height_m", "expected"), [(1.1, [*ALL]), (1.9, [])])
def test_a_child_does_not_hide_an_adult(height_m, expected):
    content = behind(None, 1.6)
    content["users"]["ben"] = {"start": [2.5, 3.2], "height": height_m}
    content["sight"]["people_occlude"] = True

    assert expected == seen(content).get("ana", [])


def test_moved_furniture_no_longer_hides():
    move = {"at": "5 s", "move": "sofa_1", "to": [2.6, 1.0]}
    content = {**behind({**SOFA, "height": 2.0, "size": [0.6, 0.9]}), "script": [move]}

    assert [5, 6, 7, 8, 9] == seen(content)["ana"]


def walkers():
    """People who walk, sit and lie among furniture, and a robot with two cameras."""
    content = behind(SOFA)
    content["simulation"]["duration"] = "5 min"
    content["users"] = {
        "ana": {**WALK, "start": [4, 3.2], "script": [[1.2, 3.6], 20.0, [4.6, 0.6], 60.0]},
        "ben": {"type": "meander", "speed": 0.4, "camera": {"angle_deg": 200}},
        "cleo": {"type": "pet", "stop": "5 s", "nap": "20 s"},
    }
    content["robots"]["astro"] |= {"type": "patrol", "dwell": "0 s"}
    del content["robots"]["astro"]["camera"]
    content["robots"]["astro"]["cameras"] = {
        "low": {"height": 0.2, "body_points": 5, "range": [0, 6]},
        "high": {"height": 1.3, "heading_deg": 180},
    }
    content["sight"]["people_occlude"] = True
    return content


@pytest.mark.parametrize("span", some([37, 1], 2))
def test_spans_do_not_show_where_heights_matter(span):
    content = walkers()

    assert digests(run(content)) == digests(run(content, max_span=span))


def test_heights_are_the_same_by_every_exact_method_and_change_what_is_seen():
    content = walkers()
    expected = digests(run(content))
    by_polygon = {**content["sight"], "method": {"type": "visibility_polygon"}}

    result = digests(run({**content, "sight": by_polygon}))

    assert expected["observations"] == result["observations"]
    assert expected["observations"] != digests(run({**content, "sight": {}}))["observations"]


def test_a_height_of_what_blocks_sight_is_refused():
    with pytest.raises(fleet2d.InputError, match="blocks: path"):
        run(behind({**WARDROBE, "height": 0.9}))


def test_the_back_of_a_sofa_is_high_and_its_seat_low():
    plan = fleet2d.load_floorplan()
    home = Home(plan)
    units = plan.lattice.units_per_m
    for heading in range(0, 4 * QUARTER, 300):
        sofa = stand_furniture("sofa", (13.0, 3.0), heading, (2.0, 0.9))
        (seat, seat_m), (back, back_m) = prisms_of(home, sofa)
        whole, rear = shapely.Polygon(seat), shapely.Polygon(back)

        assert (0.45, 0.85) == (seat_m, back_m)
        assert abs(rear.area / units**2 - 2.0 * 0.25) < 0.02
        assert shapely.area(shapely.difference(rear, whole.buffer(2))) == 0
        ahead = np.array([np.cos(sofa.heading), np.sin(sofa.heading)])
        middle = shapely.get_coordinates(rear.centroid)[0] / units - np.array([13.0, 3.0])
        origin = plan.lattice.to_lattice((13.0, 3.0)) / units - np.array([13.0, 3.0])
        assert abs((middle - origin) @ ahead + 0.325) < 0.02


def test_a_height_without_effect_is_a_note():
    content = behind(SOFA)
    notes = fleet2d.Simulation({**content, "sight": {}}).notes

    assert any("sight.heights" in note and "robots.astro.camera.height" in note for note in notes)
    assert not any("sight.heights" in note for note in fleet2d.Simulation(content).notes)
