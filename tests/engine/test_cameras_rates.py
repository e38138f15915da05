"""What a scenario's file says about perception is what a run stores, part by part.

Robots of one place look at the same people in one run. One of them sees everything as it is, so it
tells who was in view when; each other one errs in one way. Rates are compared with the numbers in
the file within 4.5 standard deviations of the binomial, in each bin of what they depend on, so that
a sign error of the bearing, a wrong unit or a transposed confusion would be far outside.
"""

import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
import yaml
from tests.scenes import OWN, table
from tests.sight.watching import agree

import fleet2d
from fleet2d.kernels import F64, Bool

Rows = dict[str, npt.NDArray[Any]]

EYE, HEADING_DEG, MOUNT_DEG = (5.0, 5.0), 30, 20
STEP_S = 2
USERS = ("ana", "ben")

SCENARIO = f"""
simulation: {{start: 2026-01-05, duration: 20 h, step: {STEP_S} s, seed: 11, ghosts: true}}
floorplan: {{type: native, path: hall.json}}
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
  keeps:
    <<: *robot
    perception: {{detection: {{distance: 0.6, memory: 10 s}}}}
  mistakes:
    <<: *robot
    perception:
      identity: {{right: [[0, 0.9], [6, 0.3]], mistaken: [[0, 0.05], [6, 0.5]], confusion: {{ana: {{ben: 1}}}}}}
  blurs:
    <<: *robot
    perception:
      attributes:
        range_noise: 4 cm
        range_noise_share: 2 %
        bearing_noise_deg: 2
        heading_noise_deg: 12
        posture: {{sit: {{stand: 0.2, lie: 0.05}}, lie: {{sit: 0.3}}}}
        activity: {{cook: {{read: 0.25}}, sleep: {{read: 0.1, rest: 0.15}}}}
  imagines:
    <<: *robot
    perception:
      false_positives:
        per_hour: 120
        spots: [{{at: [7, 8], per_hour: 60, spread: 10 cm}}, {{at: [2, 3], per_hour: 500}}]
        looks_like: {{ben: 0.4}}
  late:
    <<: *robot
    camera: {{<<: *camera, period: 6 s, latency: 5 s, lost_after: 10 s}}
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return a folder with the scenario and its home: a hall of 10 m by 10 m."""
    made = tmp_path_factory.mktemp("hall")
    outline = [[0, 0], [10, 0], [10, 10], [0, 10]]
    (made / "hall.json").write_text(
        json.dumps(
            {
                "format": "fleet2d-floorplan", "version": 1, "name": "hall",
                "free": [{"outline": outline, "holes": []}],
                "rooms": [{"type": "hall", "polygon": outline}],
                "entrance": [0.5, 0.5],
            }
        )
    )  # fmt: skip
    (made / "scenario.yaml").write_text(SCENARIO)
    return made


@cache
def observations(file: Path) -> tuple[Rows, fleet2d.Run]:
    """Return all rows of a run of the scenario, and the run."""
    run = fleet2d.run(file)
    return table(run, "observations"), run


@pytest.fixture(scope="module")
def rows(folder):
    return observations(folder / "scenario.yaml")[0]


def of(rows: Rows, robot: str, **where: str) -> Rows:
    """Return the rows of one robot."""
    keep = rows["robot"] == robot
    for column, value in where.items():
        keep = keep & (rows[column] == value)
    return {name: values[keep] for name, values in rows.items()}


def from_eye(x: F64, y: F64) -> tuple[F64, F64]:
    """Return distances [m] and bearings off the optical axis, left positive [deg]."""
    dx, dy = x - EYE[0], y - EYE[1]
    bearing = np.rad2deg(np.arctan2(dy, dx)) - HEADING_DEG - MOUNT_DEG
    return np.hypot(dx, dy), (bearing + 180) % 360 - 180


def hits(rows: Rows, robot: str, user: str) -> tuple[Rows, Bool]:
    """Return the looks at which a user was in view, and in which of them a robot noticed."""
    looks = of(rows, "sharp", true_user=user)
    result = of(rows, robot, true_user=user)["step"]
    assert np.isin(result, looks["step"]).all()
    return looks, np.isin(looks["step"], result)


def check_by(values: F64, edges: npt.ArrayLike, happened: Bool, share: F64) -> None:
    """Check rates in each bin of a quantity; each bin must be there."""
    group = np.digitize(values, np.asarray(edges))
    for g in range(len(np.asarray(edges)) + 1):
        inside = group == g
        result, expected = happened[inside].mean(), share[inside].mean()
        assert agree(happened[inside], share[inside]), (g, result, expected)


@pytest.mark.slow
def test_who_was_in_view_is_within_range_and_angle(rows):
    looks = of(rows, "sharp")
    distance, bearing = from_eye(looks["x"], looks["y"])
    assert 0.29 < distance.min() < 1 < 5.9 < distance.max() < 6.01
    assert -135.1 < bearing.min() < -130 < 130 < bearing.max() < 135.1
    assert {"stand", "sit", "lie"} == set(looks["true_posture"])


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


def test_misses_come_in_runs_of_the_memory_in_seconds(rows):
    looks, noticed = hits(rows, "keeps", "ana")
    assert agree(noticed[::50], 0.6)
    following = np.diff(looks["step"]) == 1
    before, after = noticed[:-1][following], noticed[1:][following]
    stay = np.exp(-STEP_S / 10)
    assert agree(after[before], stay + (1 - stay) * 0.6)
    assert agree(after[~before], (1 - stay) * 0.6)


@pytest.mark.parametrize("user", USERS)
def test_users_are_taken_for_each_other_as_often_as_told_by_distance(rows, user):
    result = of(rows, "mistakes", true_user=user)
    distance, _ = from_eye(result["true_x"], result["true_y"])
    right = np.interp(distance, [0, 6], [0.9, 0.3])
    mistaken = np.interp(distance, [0, 6], [0.05, 0.5])
    other = USERS[user == "ana"]
    unknown = np.array([not isinstance(name, str) for name in result["user"]])
    edges = [2, 3, 4, 5]
    for taken, share in (
        (result["user"] == user, right),
        (result["user"] == other, mistaken),
        (unknown, 1 - right - mistaken),
    ):
        check_by(distance, edges, taken, share)


def test_positions_are_blurred_along_and_across_the_line_of_sight(rows):
    result = of(rows, "blurs")
    true, seen = (from_eye(result[f"{of}x"], result[f"{of}y"]) for of in ("true_", ""))
    along = (seen[0] - true[0]) / (0.04 + 0.02 * true[0])
    across = ((seen[1] - true[1] + 180) % 360 - 180) / 2
    facing = np.rad2deg(result["heading"] - result["true_heading"])
    turned = ((facing + 180) % 360 - 180) / 12
    for z in (along, across, turned):
        assert abs(z.mean()) < 4.5 / np.sqrt(len(z))
        assert abs(z.std() - 1) < 4.5 / np.sqrt(2 * len(z)) + 2e-3
        assert agree(np.abs(z) < 1, 0.6827, z=6)
    for low, high in ((0.3, 2), (2, 4), (4, 6)):
        inside = (low <= true[0]) & (true[0] < high)
        assert abs(along[inside].std() - 1) < 4.5 / np.sqrt(2 * inside.sum()) + 2e-3


POSTURES = {
    "stand": {"stand": 1.0}, "sit": {"stand": 0.2, "lie": 0.05, "sit": 0.75},
    "lie": {"sit": 0.3, "lie": 0.7},
}  # fmt: skip
ACTIVITIES = {
    "cook": {"read": 0.25, "cook": 0.75}, "read": {"read": 1.0},
    "sleep": {"read": 0.1, "rest": 0.15, "sleep": 0.75},
}  # fmt: skip


@pytest.mark.parametrize(("column", "confusion"), [("posture", POSTURES), ("activity", ACTIVITIES)])
def test_postures_and_activities_are_confused_as_told(rows, column, confusion):
    result = of(rows, "blurs")
    every = {name for others in confusion.values() for name in others}
    for true, others in confusion.items():
        mine = result[column][result[f"true_{column}"] == true]
        assert set(mine) <= every
        for name in every:
            assert agree(mine == name, others.get(name, 0.0)), (true, name)


def test_activities_are_true_at_the_look_and_unknown_to_cameras_that_do_not_tell_them(folder, rows):
    events = table(observations(folder / "scenario.yaml")[1], "events", event="activity")
    for user in USERS:
        mine = events["entity"] == user
        begun, names = events["step"][mine], events["detail"][mine]
        for robot, late in (("blurs", 0), ("late", 3)):
            result = of(rows, robot, true_user=user)
            at = np.searchsorted(begun, result["step"] - late, side="right") - 1
            assert (result["true_activity"][at >= 0] == names[at[at >= 0]]).all()
    for robot in ("sharp", "late"):
        assert not any(isinstance(name, str) for name in of(rows, robot)["activity"])


def test_false_positives_come_at_their_rate_where_and_as_whom_they_are_told(rows):
    result = of(rows, "imagines")
    false = np.array([not isinstance(name, str) for name in result["true_user"]])
    x, y = result["x"][false], result["y"][false]
    at_spot = np.hypot(x - 7, y - 8) < 0.6
    area = (
        np.pi * 0.6**2 / (0.75 * np.pi * (6**2 - 0.3**2))
    )  # all but the hall's corners is in view
    # The spot at (2, 3) is behind the robot: never.
    expected = 20 * (60 + 120 * area)
    assert abs(at_spot.sum() - expected) < 4.5 * np.sqrt(expected)
    # Points of the wedge that are in view: those in the hall, so none of the rate is lost.
    assert abs((~at_spot).sum() - 20 * 120 * (1 - area)) < 4.5 * np.sqrt(20 * 120)
    distance, bearing = from_eye(x, y)
    assert distance.max() < 6.01
    assert np.abs(bearing[~at_spot]).max() < 135.1
    assert agree(result["user"][false] == "ben", 0.4)
    assert not (result["user"][false] == "ana").any()
    real = of(rows, "imagines", true_user="ana")
    assert (real["user"] == "ana").all()


def test_false_positives_of_a_camera_before_a_wall_come_at_their_rate(folder):
    """Nearly all of what it could see is hidden: with 64 draws of a point, two of five failed."""
    robot = {
        "start": [0.6, 5.0], "start_heading_deg": 180,
        "camera": {"range": [0.2, 6.0], "angle_deg": 90},
        "perception": {"false_positives": {"per_hour": 60}},
    }  # fmt: skip
    content = {
        "simulation": {"start": "2026-01-05", "duration": "10 h", "seed": 4, "step": "2 s"},
        "floorplan": {"type": "native", "path": str(folder / "hall.json")},
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


def test_the_file_is_what_yaml_says_and_a_run_by_overrides_is_the_same(folder):
    """A key of a perception can be set from the command line, in any unit."""
    content = yaml.safe_load(SCENARIO)
    del content["robots"]["blurs"]["perception"]["attributes"]["range_noise"]
    (folder / "other.yaml").write_text(yaml.safe_dump(content, sort_keys=False))
    key = "robots.blurs.perception.attributes.range_noise"
    short = "simulation.duration=10 min"
    told = fleet2d.run(folder / "other.yaml", short, f"{key}=0.04").digest
    assert fleet2d.run(folder / "scenario.yaml", short).digest == told
    assert fleet2d.run(folder / "other.yaml", short).digest != told
