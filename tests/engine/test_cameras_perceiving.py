"""Runs in which perception errs: spans never show, truth stands beside it, algorithms don't see it."""

from typing import Any, ClassVar

import numpy as np
import pandas as pd
import pytest
from tests.scenes import digests, everything, run, scenario, table
from tests.thorough import some

import fleet2d
from fleet2d import Algorithm, Metric
from fleet2d.errors import ComponentError, InputError, ScenarioError

PERCEPTION = {
    "detection": {
        "distance": {"midpoint": 3, "width": 0.5, "top": 0.9},
        "bearing": [[0, 1], [60, 0.5]],
        "orientation": [[0, 1], [180, 0.6]],
        "posture": {"lie": 0.3},
        "visible_share": [[0, 0], [1, 1]],
        "light": [[6, 0.5], [8, 1]],
        "memory": "10 s",
    },
    "false_positives": {
        "per_hour": 60,
        "spots": [{"at": [1.5, 2.5], "per_hour": 200, "spread": "20 cm"}],
        "looks_like": {"ben": 0.3},
    },
    "identity": {
        "right": [[0, 0.8], [4, 0.4]],
        "mistaken": 0.2,
        "confusion": {"ana": {"ben": 1}},
        "per_track": True,
    },
    "attributes": {
        "range_noise": "5 cm",
        "range_noise_share": "3 %",
        "bearing_noise_deg": 2,
        "heading_noise_deg": 10,
        "posture": {"stand": {"sit": 0.1}},
        "activity": {"wash": {"read": 0.5}, "breakfast": {"unknown": 0.2}},
    },
}
CAMERAS = {
    "front": {"angle_deg": 100, "offset": [0.1, 0.02], "body_points": 6, "latency": "2 s"},
    "rear": {"heading_deg": 180, "range": [0.2, 3], "period": "3 s", "perception": {}},
    "mast": {"pan": {"headings_deg": [-60, 0, 60], "dwell": "4 s"}, "latency": "1 s"},
}


class Peek(Algorithm):
    """Keeps what an algorithm is told, and tries to get at the truth."""

    seen: ClassVar[list[Any]] = []

    def update(self, history, state):
        for name in ("truth", "looks"):
            with pytest.raises(ComponentError, match=f"'{name}' is ground truth"):
                getattr(history, name)
        self.seen.append(history.observations)


class Both(Metric):
    """Keeps observations beside the truth."""

    seen: ClassVar[list[Any]] = []

    def update(self, history, state):
        self.seen.append((history.observations, history.truth, history.looks))


def full(duration="1 h", **changes):
    """Every behavior, and robots of which two err, one of them with three cameras."""
    content = everything(duration)
    robots = content["robots"]
    astro = {**robots["astro"], "cameras": CAMERAS, "perception": PERCEPTION}
    del astro["camera"]
    robots["astro"] = astro
    robots["curio"] = {**robots["curio"], "perception": PERCEPTION}
    content["metrics"]["detections"] = {"period": "11 min"}
    return content | changes


@pytest.fixture(scope="module")
def whole():
    return run(full())


@pytest.mark.parametrize("span", some([7, 1, 3600], 3))
def test_every_table_is_the_same_for_every_max_span(whole, span):
    other = run(full(), max_span=span)
    assert digests(whole) == digests(other)
    assert whole.metrics == other.metrics


def test_every_table_is_the_same_when_watchers_take_in_few_steps_at_once(whole, monkeypatch):
    monkeypatch.setattr("fleet2d.engine.state.MAX_STEPS", 1)
    monkeypatch.setattr("fleet2d.engine.state.MIN_STEPS", 50)
    assert digests(whole) == digests(run(full()))


def test_rows_tell_false_from_true_and_who_from_whom(whole):
    rows = table(whole, "observations")
    assert not pd.isna(rows["room"]).any(), "also within walls"
    astro = rows["robot"] == "astro"
    assert {"front", "rear", "mast"} == set(rows["camera"][astro])
    assert {"camera"} == set(rows["camera"][~astro])
    false, unknown = pd.isna(rows["true_user"]), pd.isna(rows["user"])
    assert false.any()
    assert unknown.any()
    assert (np.isnan(rows["true_x"]) == false).all()
    assert (rows["user"] != rows["true_user"])[~false & ~unknown].any()
    sharp = np.isin(rows["robot"], ["bolt", "drift"]) | (rows["camera"] == "rear")
    for column in ("user", "x", "y", "heading", "posture"):
        assert (rows[column] == rows[f"true_{column}"])[sharp].all()
    off = np.hypot(rows["x"] - rows["true_x"], rows["y"] - rows["true_y"])[~sharp & ~false]
    assert 0.02 < np.median(off) < 0.3


def test_the_truth_is_where_users_were_when_they_were_looked_at():
    stored = run(full(), "artifacts.trajectories=every step")
    rows = table(stored, "observations", robot="astro", true_user="ben")
    truth = table(stored, "trajectories", entity="ben")
    for camera, late in (("front", 2), ("rear", 0), ("mast", 1)):
        mine = rows["camera"] == camera
        assert mine.sum() > 10
        at = rows["step"][mine] - late
        assert truth["x"][at].tolist() == rows["true_x"][mine].tolist()
        if camera == "rear":
            assert (at % 3 == 0).all()


def test_where_nothing_errs_no_column_is_added_and_no_row_changes():
    plain, told = everything("20 min"), everything("20 min")
    for robot in told["robots"].values():
        robot["perception"] = {}
    assert run(plain).digest == run(told).digest


def test_events_are_about_whom_somebody_was_taken_for(whole):
    """Somebody unknown is seen, too; the event names nobody then."""
    users = table(whole, "events", entity="curio")["user"]
    assert {"ana", "ben"} == set(users[~pd.isna(users)])
    assert pd.isna(users).any()


def test_algorithms_get_what_was_perceived_and_metrics_the_truth_beside_it():
    content = full("30 min", algorithms={"peek": Peek(period="10 min")})
    content["metrics"] = {"both": Both(period="10 min")}
    Peek.seen.clear()
    Both.seen.clear()
    stored = run(content)
    rows = table(stored, "observations")
    told, truths, _ = zip(*Both.seen, strict=True)
    for column in ("step", "x", "y", "heading", "activity"):
        expected = ["" if each is None or each != each else each for each in rows[column]]
        for parts in (told, Peek.seen):
            handed = np.concatenate([getattr(part, column) for part in parts]).tolist()
            assert expected == ["" if each is None else each for each in handed]
    assert {"wash", "read", "breakfast"} <= set(rows["activity"])
    true = np.concatenate([truth.x[truth.user >= 0] for truth in truths])
    assert rows["true_x"][~np.isnan(rows["true_x"])].tolist() == true.tolist()


def test_looks_and_rows_agree():
    """Without latency, each look that noticed somebody is a row at its step."""
    content = full("30 min")
    del content["robots"]["astro"]
    content["metrics"] = {"both": Both(period="7 min")}
    Both.seen.clear()
    run(content)
    for observed, truth, looks in Both.seen:
        assert (looks.detected <= looks.in_view).all()
        for camera, robot in enumerate(looks.robot.tolist()):
            for user in (0, 1):
                rows = (observed.robot == robot) & (truth.user == user)
                assert looks.detected[camera, user] == rows.sum()


def test_a_camera_that_its_offset_puts_into_a_wall_sees_nothing():
    content = scenario(
        "1 min",
        users={"ana": {"start": [1.0, 1.0]}},
        robots={"r": {"start": [0.3, 1.0], "start_heading_deg": 180, "camera": {"angle_deg": 360}}},
    )
    assert table(run(content), "observations")["step"].size
    content["robots"]["r"]["camera"]["offset"] = [0.4, 0]
    assert not table(run(content), "observations")["step"].size


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"camera": {}, "cameras": {"a": {}}}, ["robots.r.cameras", "'camera' or 'cameras'"]),
        ({"camera": {"period": "10 s"}}, ["period", "10 s is longer than lost_after"]),
        ({"camera": {"period": "1.5 s"}}, ["robots.r", "not a multiple of simulation.step"]),
        ({"camera": {"pan": {"headings_deg": []}}}, ["pan.headings_deg"]),
        (
            {"perception": {"detection": {"distance": [[2, 1], [1, 0]]}}},
            ["distance", "must ascend"],
        ),
        ({"perception": {"detection": {"distance": {"midpoint": 3}}}}, ["distance", "width"]),
        ({"perception": {"detection": {"distance": 1.2}}}, ["distance", "0 to 1"]),
        ({"perception": {"detection": {"range": 3}}}, ["unknown key 'range'"]),
        ({"perception": {"detection": {"light": [[-2, 1], [26, 0]]}}}, ["light", "-2", "0 to 24"]),
        (
            {"perception": {"identity": {"confusion": {"ana": {"ana": 1}}}}},
            ["confusion.ana", "leave it out"],
        ),
        (
            {"perception": {"identity": {"confusion": {"ana": {"bem": 1}}}}},
            ["'bem'", "did you mean 'ben'"],
        ),
        ({"perception": {"identity": {"confusion": {"ana": {"ben": 0.4}}}}}, ["0.4", "not to 1"]),
        ({"perception": {"identity": {"right": 0.9, "mistaken": 0.2}}}, ["0.9", "more than 1"]),
        ({"perception": {"false_positives": {"looks_like": {"zoe": 1}}}}, ["'zoe'", "ana, ben"]),
        ({"perception": {"false_positives": {"per_hour": 4000}}}, ["4000 per hour", "3600"]),
        ({"perception": {"attributes": {"posture": {"sit": {"sit": 1}}}}}, ["posture.sit"]),
        (
            {"perception": {"attributes": {"activity": {"cook": {"read": 0.6, "eat": 0.6}}}}},
            ["activity.cook", "1.2"],
        ),
    ],
)
def test_wrong_settings_are_errors_that_say_what_is_wanted(change, words):
    content = scenario(users={"ana": {}, "ben": {}}, robots={"r": change})
    with pytest.raises(InputError) as caught:
        fleet2d.Simulation(content)
    assert isinstance(caught.value, ScenarioError)
    for word in words:
        assert word in str(caught.value)


def test_a_list_of_cameras_is_numbered():
    robot = fleet2d.load_scenario(
        scenario(robots={"r": {"cameras": [{}, {"heading_deg": 180}]}})
    ).robots["r"]
    assert ["camera_00", "camera_01"] == list(robot.eyes)
