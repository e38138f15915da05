"""Bodies that hide people from cameras: in runs, for every span and by every method."""

import pytest
from tests.engine.test_cameras_points import with_odd_cameras
from tests.reference.detections import hides
from tests.scenes import digests, each_step, run, scenario
from tests.thorough import some

HIDE = {"sight": {"people_occlude": True}}
UNITS_PER_M = 1280
RADII = {"ana": 256, "ben": 256, "cleo": 256, "dora": 512}
"""Of the people in the crowd [lattice units]."""
WALK = {"type": "tests.own_components:Scripted", "speed": 0.3}


def row_of_people(**users):
    """A robot that looks along the living room, ana behind ben, for 40 s."""
    people = {"ana": {"start": [4, 3.5]}, "ben": {"start": [2.5, 3.5], "radius": 0.25}, **users}
    robot = {"start": [1, 3.5], "start_heading_deg": 0, "camera": {"lost_after": "1 s"}}
    return scenario("40 s", users=people, robots={"astro": robot}) | HIDE


def seen(content):
    """Return the steps at which each person is perceived."""
    rows = run(content).pandas("observations")
    return {name: group["step"].tolist() for name, group in rows.groupby("user", observed=True)}


def test_a_robot_hides_people_from_another_and_not_from_itself():
    content = row_of_people()
    del content["users"]["ben"]
    content["robots"]["bolt"] = {"start": [2.5, 3.5], "start_heading_deg": 0}
    rows = run(content).pandas("observations")

    assert {"bolt"} == set(rows["robot"])
    assert 40 == len(rows)


@pytest.mark.parametrize(("sight", "sees"), [(HIDE["sight"], False), ({}, True)])
def test_people_who_look_and_expectations_know_what_bodies_hide(sight, sees):
    content = row_of_people(ana={"start": [4, 3.5], "start_heading_deg": 180, "camera": {}})
    stored = run({**content, "sight": sight, "expect": {"it": "never(in_view(ana, by=astro))"}})

    assert sees == ("robot_seen" in set(stored.pandas("events")["event"]))
    assert sees != stored.manifest["expectations"]["it"]["holds"]


def crowd():
    """The scenario with everything, odd cameras, and two more people in it."""
    content = with_odd_cameras()
    content["simulation"]["duration"] = "10 min"
    content["users"]["cleo"] = {"type": "meander", "speed": 0.4, "camera": {"angle_deg": 200}}
    content["users"]["dora"] = {"start": [3, 3], "radius": 0.4}
    return content | HIDE


@pytest.mark.parametrize("span", some([7, 1, 61], 3))
def test_spans_do_not_show_where_bodies_hide_people(span):
    content = crowd()

    assert digests(run(content)) == digests(run(content, max_span=span))


def test_those_are_perceived_whom_no_body_hides():
    """Against the rule in fractions, step by step, of those whom walls alone leave in view."""
    content = crowd()
    content["robots"] = {"curio": {**content["robots"]["curio"], "cameras": {"plain": {}}}}
    clear, users = perceived({**content, "sight": {}}), content["users"]
    poses = {name: each_step(content, name) for name in ("curio", *users)}

    def from_eye(name, step):
        (x, y), (eye_x, eye_y) = (
            (poses[n]["x"][step], poses[n]["y"][step]) for n in (name, "curio")
        )
        return round((x - eye_x) * UNITS_PER_M), round((y - eye_y) * UNITS_PER_M)

    def is_hidden(step, user):
        return any(
            hides(from_eye(user, step), from_eye(other, step), radius)
            for other, radius in RADII.items()
            if other != user and not poses[other]["away"][step]
        )

    expected = {(step, user) for step, user in clear if not is_hidden(step, user)}

    assert expected == perceived(content)
    assert 20 < len(expected) < len(clear)


def perceived(content):
    """Return who is perceived when."""
    return {(step, user) for user, steps in seen(content).items() for step in steps}
