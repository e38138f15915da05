"""Heights of cameras, bodies and furniture: in runs, for every span and by every exact method."""

import pytest
from tests.engine.test_cameras_hiding import WALK, seen
from tests.scenes import digests, run, scenario
from tests.thorough import some

import fleet2d

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


def test_who_stands_behind_a_sofa_is_seen_and_who_lies_there_is_not():
    content = behind(SOFA)

    assert {"ana": ALL} == seen(content)
    assert {} == seen({**content, "script": [LIES]})
    assert {"ana": ALL} == seen({**content, "script": [LIES], "sight": {}})
    assert {"ana": ALL} == seen({**behind(None), "script": [LIES]})


# The line rises from the camera over the back of the sofa, 0.85 m high, which begins at 2.15 m: 1.55 m from the camera,
# where ana is at 3.4 m. Her head is at 15/16 of her height.
HIDDEN_BELOW_M = 0.4 + (0.85 - 0.4) * 3.4 / 1.55


@pytest.mark.parametrize(("above_m", "expected"), [(0.005, {"ana": ALL}), (-0.005, {})])
def test_a_head_is_seen_from_the_height_on_at_which_the_line_clears_the_sofa(above_m, expected):
    assert expected == seen(behind(SOFA, height=(HIDDEN_BELOW_M + above_m) * 16 / 15))


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


@pytest.mark.parametrize(
    ("piece", "expected"),
    [
        ({"type": "table", "size": [1.2, 0.9]}, {"ana": ALL}),
        ({**SOFA, "height": 0}, {"ana": ALL}),
        ({**SOFA, "height": 2.0}, {}),
        ({"type": "wardrobe", "size": [1.2, 0.6]}, {}),
    ],
    ids=["on legs", "flat", "high", "up to the ceiling"],
)
def test_furniture_hides_as_high_as_it_is(piece, expected):
    assert expected == seen(behind(piece))


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


def test_a_pet_is_low_and_a_height_of_its_own_counts():
    pet = {"type": "pet", "nap": "1 h", "start": [4.0, 3.2]}

    for of_body, is_seen in (({}, False), ({"height": 1.7}, True)):
        content = behind(SOFA)
        content["users"] = {"ana": {**pet, **of_body}}
        simulation = fleet2d.Simulation(content)
        assert (1.7 if is_seen else 0.3) == simulation.actors["ana"].entity.tall
        assert ("ana" in seen(content)) == is_seen


def walkers():
    """People who walk, sit and lie among furniture, and a robot with two cameras."""
    content = behind(SOFA)
    content["simulation"]["duration"] = "10 min"
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
    wardrobe = {"type": "wardrobe", "height": 0.9, "size": [1.2, 0.6]}

    with pytest.raises(fleet2d.InputError, match="blocks: path"):
        run(behind(wardrobe))
    assert {"ana": ALL} == seen(behind({**wardrobe, "blocks": "path"}))


def test_a_height_without_effect_is_a_note():
    content = behind(SOFA)
    notes = fleet2d.Simulation({**content, "sight": {}}).notes

    assert any("sight.heights" in note and "robots.astro.camera.height" in note for note in notes)
    assert not any("sight.heights" in note for note in fleet2d.Simulation(content).notes)
