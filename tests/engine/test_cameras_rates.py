"""What a scenario's file says about perception is what a run stores, part by part.

Robots of one place look at the same people in one run. One of them sees everything as it is, so it
tells who was in view when; each other one errs in one way. Rates are compared with the numbers in
the file within 4.5 standard deviations of the binomial, in each bin of what they depend on, so that
a sign error of the bearing, a wrong unit or a transposed confusion would be far outside.
"""

from functools import cache

import numpy as np
import pytest
from tests.scenes import OWN, box, table, write_plan
from tests.sight.watching import agree

import fleet2d

EYE, HEADING_DEG, MOUNT_DEG = (5.0, 5.0), 30, 20
STEP_S = 2
USERS = ("ana", "ben")

SCENARIO = f"""
simulation: {{start: 2026-01-05, duration: 20 h, step: {STEP_S} s, seed: 11, ghosts: true}}
floorplan: {{type: native, path: home.json}}
users:
  ana: {{type: "{OWN}:Fidget"}}
  ben: {{type: "{OWN}:Fidget"}}
robots:
  sharp: &robot
    start: [5, 5]
    start_heading_deg: {HEADING_DEG}
    camera: &camera {{range: [0.3, 6], angle_deg: 270, heading_deg: {MOUNT_DEG}}}
  misses:
    <<: *robot
    perception:
      detection:
        distance: [[1, 1], [5, 0.5]]
        bearing: [[-120, 0.5], [0, 0.8], [120, 1]]
        orientation: [[0, 1], [180, 0.6]]
        posture: {{sit: 0.9, lie: 0.6}}
        light: [[6, 0.7], [9, 1], [16, 1], [19, 0.7]]
  confuses:
    <<: *robot
    perception:
      attributes: {{activity: {{cook: {{read: 0.25}}, sleep: {{read: 0.1, rest: 0.15}}}}}}
  late:
    <<: *robot
    camera: {{<<: *camera, period: 6 s, latency: 5 s, lost_after: 10 s}}
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return a folder with the scenario and its home: a hall of 10 m by 10 m."""
    made = tmp_path_factory.mktemp("hall")
    hall = box(0, 0, 10, 10)
    write_plan(made, hall, {"hall": hall}, entrance=[0.5, 0.5])
    (made / "scenario.yaml").write_text(SCENARIO)
    return made


@cache
def observations(file):
    """Return all rows of a run of the scenario, and the run."""
    run = fleet2d.run(file)
    return table(run, "observations"), run


@pytest.fixture(scope="module")
def rows(folder):
    return observations(folder / "scenario.yaml")[0]


def of(rows, robot, **where):
    """Return the rows of one robot."""
    keep = rows["robot"] == robot
    for column, value in where.items():
        keep = keep & (rows[column] == value)
    return {name: values[keep] for name, values in rows.items()}


def from_eye(x, y):
    """Return distances [m] and bearings off the optical axis, left positive [deg]."""
    dx, dy = x - EYE[0], y - EYE[1]
    bearing = np.rad2deg(np.arctan2(dy, dx)) - HEADING_DEG - MOUNT_DEG
    return np.hypot(dx, dy), (bearing + 180) % 360 - 180


def hits(rows, robot, user):
    """Return the looks at which a user was in view, and in which of them a robot noticed."""
    looks = of(rows, "sharp", true_user=user)
    result = of(rows, robot, true_user=user)["step"]
    assert np.isin(result, looks["step"]).all()
    return looks, np.isin(looks["step"], result)


def check_by(values, edges, happened, share):
    """Check rates in each bin of a quantity; each bin must be there."""
    group = np.digitize(values, np.asarray(edges))
    for g in range(len(np.asarray(edges)) + 1):
        inside = group == g
        result, expected = happened[inside].mean(), share[inside].mean()
        assert agree(happened[inside], share[inside]), (g, result, expected)


@pytest.mark.parametrize("user", USERS)
def test_users_are_noticed_as_often_as_every_factor_says(rows, user):
    looks, noticed = hits(rows, "misses", user)
    distance, bearing = from_eye(looks["true_x"], looks["true_y"])
    towards = bearing + HEADING_DEG + MOUNT_DEG
    away = np.abs((np.rad2deg(looks["true_heading"]) - towards) % 360 - 180)
    hour = looks["step"] * STEP_S / 3600
    posture = np.select([looks["true_posture"] == p for p in ("sit", "lie")], [0.9, 0.6], 1.0)
    light = np.interp(hour, [6, 9, 16, 19], [0.7, 1, 1, 0.7])
    share = np.interp(distance, [1, 5], [1, 0.5]) * np.interp(away, [0, 180], [1, 0.6])
    share = share * np.interp(bearing, [-120, 0, 120], [0.5, 0.8, 1]) * posture * light
    check_by(distance, [1.5, 2, 2.5, 3, 3.5, 4, 4.5, 5], noticed, share)
    check_by(bearing, [-100, -60, -20, 20, 60, 100], noticed, share)
    check_by(away, [45, 90, 135], noticed, share)
    check_by(hour, [3, 6, 7.5, 9, 16, 17.5, 19], noticed, share)
    check_by(posture, [0.7, 0.95], noticed, share)


ACTIVITIES = {
    "cook": {"read": 0.25, "cook": 0.75},
    "read": {"read": 1.0},
    "sleep": {"read": 0.1, "rest": 0.15, "sleep": 0.75},
}


def test_activities_are_true_at_the_look_and_unknown_to_cameras_that_do_not_tell_them(folder, rows):
    events = table(observations(folder / "scenario.yaml")[1], "events", event="activity")
    for user in USERS:
        mine = events["entity"] == user
        begun, names = events["step"][mine], events["detail"][mine]
        for robot, late in (("confuses", 0), ("late", 3)):
            result = of(rows, robot, true_user=user)
            at = np.searchsorted(begun, result["step"] - late, side="right") - 1
            assert (result["true_activity"][at >= 0] == names[at[at >= 0]]).all()
    for robot in ("sharp", "late"):
        assert not any(isinstance(name, str) for name in of(rows, robot)["activity"])
    for true, others in ACTIVITIES.items():
        perceived = of(rows, "confuses", true_activity=true)["activity"]
        for name in ("cook", "read", "sleep", "rest"):
            assert agree(perceived == name, others.get(name, 0.0)), (true, name)


def test_false_positives_of_a_camera_before_a_wall_come_at_their_rate(folder):
    """Nearly all of what it could see is hidden: with 64 draws of a point, two of five failed."""
    robot = {
        "start": [0.6, 5.0], "start_heading_deg": 180,
        "camera": {"range": [0.2, 6.0], "angle_deg": 90},
        "perception": {"false_positives": {"per_hour": 60}},
    }  # fmt: skip
    content = {
        "simulation": {"start": "2026-01-05", "duration": "10 h", "seed": 4, "step": "2 s"},
        "floorplan": {"type": "native", "path": str(folder / "home.json")},
        "users": {"ana": {"type": "guest"}},
        "robots": {"astro": robot},
    }
    count = len(table(fleet2d.run(content), "observations")["x"])
    assert abs(count - 600) < 4.5 * np.sqrt(600)


def test_looks_come_at_their_period_and_rows_after_their_latency(rows):
    """6 s are 3 steps of 2 s; 5 s are rounded up to 3."""
    for user in USERS:
        looks, result = of(rows, "sharp", true_user=user), of(rows, "late", true_user=user)
        due = looks["step"] % 3 == 0
        due &= looks["step"] + 3 < 20 * 3600 // STEP_S
        assert (looks["step"][due] + 3).tolist() == result["step"].tolist()
        assert looks["x"][due].tolist() == result["x"].tolist()
