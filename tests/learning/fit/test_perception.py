"""From a log to a scenario: what is fitted, what is left out, and that a run errs as the log says."""

from pathlib import Path

import numpy as np
import pytest
import yaml
from tests.learning.fit.detection_logs import TRUE, falling, simulated, write
from tests.scenes import run
from tests.sight.watching import LATTICE, Watch, agree, around
from tests.thorough import THOROUGH, examples

from fleet2d.errors import InputError
from fleet2d.kernels import SightingColumn as Column
from fleet2d.learning.fit.command import calibrate_perception, fragment, report
from fleet2d.learning.fit.perception import DetectionLog, calibrate, read_detections
from fleet2d.scenario.load import load_scenario
from fleet2d.sight.camera import Camera, TableContext, error_tables
from fleet2d.sight.perception import Curve, Perception


def test_factors_without_effect_are_left_out_and_named():
    log = simulated(7, 4000)
    nothing = np.random.default_rng(8).uniform(0, 60, 4000)
    calibration = calibrate(DetectionLog(log.path, log.distance, log.detected, bearing=nothing))
    assert {"bearing"} == calibration.detection.omitted.keys()
    assert {"top", "distance midpoint", "distance width"} == calibration.detection.estimates.keys()
    assert any("bearing: left out" in line for line in report(calibration))


def test_a_model_that_fits_says_so_and_one_that_does_not_too():
    log = simulated(9, 5000)
    assert calibrate(log).detection.p_value > 0.01
    gap = (log.distance > 1) & (log.distance < 2)  # blind at arm's length: no logistic
    odd = DetectionLog(log.path, log.distance, log.detected & ~gap)
    calibration = calibrate(odd)
    assert calibration.detection.p_value < 1e-6
    assert any("the model misses something" in line for line in report(calibration))


@pytest.mark.slow
def test_the_goodness_of_fit_of_true_models_is_uniform():
    """Ten groups of fitted rows: p values below 0.1 in about a tenth of the logs."""
    logs = examples(120)
    low = sum(calibrate(simulated(500 + s, 1500)).detection.p_value < 0.1 for s in range(logs))
    assert low <= (25 if THOROUGH else 8)  # 3.7 deviations above the mean


def identified(seed, rows, names, top, width, mistaken) -> DetectionLog:
    """Return a log in which ana is mistaken for ben four times in five, and the others for ana."""
    rng = np.random.default_rng(seed)
    distance = rng.uniform(0.3, 6, rows)
    true = rng.choice(names, rows)
    right = rng.random(rows) < top * falling(distance, 3.5, width)
    of_ana = np.where(rng.random(rows) < 0.8, "ben", names[-1])
    other = np.where(true == "ana", of_ana, "ana")
    perceived = np.where(right, true, np.where(rng.random(rows) < mistaken, other, ""))
    detected = rng.random(rows) < 0.8
    return DetectionLog(Path("x.csv"), distance, detected, true_identity=true, identity=perceived)


def test_identities_are_fitted_by_distance_with_their_confusion():
    calibration = calibrate(identified(11, 20_000, ["ana", "ben", "cleo"], 0.9, 0.5, 0.3))
    estimates = calibration.identity.right.estimates
    for name, value in (("top", 0.9), ("distance midpoint", 3.5), ("distance width", 0.5)):
        assert value == pytest.approx(estimates[name].value, rel=0.05)
    assert 0.3 == pytest.approx(calibration.identity.mistaken.value, abs=0.02)
    assert calibration.identity.confusion["ana"] == pytest.approx(
        {"ben": 0.8, "cleo": 0.2}, abs=0.03
    )
    assert {"ana": 1.0} == calibration.identity.confusion["ben"]


def test_a_table_of_identities_follows_the_fit_and_never_adds_up_to_more_than_1():
    """Nobody is unknown here, so that right and mistaken add up to 1 everywhere."""
    calibration = calibrate(identified(15, 8000, ["ana", "ben"], 0.97, 0.3, 1.0))
    perception = Perception.model_validate(calibration.section())
    identity, estimates = perception.identity, calibration.identity.right.estimates
    top, midpoint, width = (
        estimates[name].value for name in ("top", "distance midpoint", "distance width")
    )
    for x in np.linspace(0, 6, 601).tolist():
        right_share, mistaken = identity.right.at(x), identity.mistaken.at(x)
        assert top * falling(x, midpoint, width) == pytest.approx(right_share, abs=0.006)
        assert 0.99 < right_share + mistaken <= 1 + 1e-12
    error_tables(
        [Camera().lens(1280, 10**6)], [perception],
        TableContext(["ana", "ben"], [256.0] * 2, LATTICE, 10**6, "robots.r"),
    )  # fmt: skip
    assert any("ana, ben" in note for note in calibration.notes)


@pytest.mark.slow
def test_the_log_of_a_run_calibrates_to_the_settings_of_the_run():
    """The whole circle: a simulated camera, its log, and the parameters again."""
    rng = np.random.default_rng(12)
    n = 30_000
    distance, bearing, facing = (
        rng.uniform(0.5, 8, n),
        rng.uniform(-54, 54, n),
        rng.uniform(0, 360, n),
    )
    detection = {
        "distance": {"midpoint": TRUE["distance midpoint"], "width": TRUE["distance width"], "top": TRUE["top"]},
        "bearing": {"midpoint": TRUE["bearing midpoint"], "width": TRUE["bearing width"]},
        "orientation": [[0, 1], [90, TRUE["side"]], [180, TRUE["back"]]],
    }  # fmt: skip
    rows = Watch(around(distance, bearing, facing), perception={"detection": detection}).look()
    detected = np.zeros(n, bool)
    detected[rows[rows[:, Column.USER] == 0, Column.STEP]] = True
    away = np.abs((facing - (bearing + 180) + 180) % 360 - 180)
    calibration = calibrate(DetectionLog(Path("x.csv"), distance, detected, np.abs(bearing), away))
    for name, estimate in calibration.detection.estimates.items():
        assert TRUE[name] == pytest.approx(estimate.value, rel=0.08), name
    rerun = Watch(
        around(distance, bearing, facing), perception=calibration.section(), seed=2
    ).look()
    hits = np.zeros(n, bool)
    hits[rerun[rerun[:, Column.USER] == 0, Column.STEP]] = True
    assert agree(hits, detected.mean())


@pytest.mark.slow
def test_a_fragment_runs_and_so_does_a_scenario_that_extends_it(tmp_path):
    log = simulated(13, 2000, bearing=True, turned=True)
    path = write(
        tmp_path / "detections.csv",
        distance=log.distance, bearing_deg=log.bearing, orientation_deg=log.orientation,
        detected=log.detected.astype(int),
    )  # fmt: skip
    alone, part = tmp_path / "alone.yaml", tmp_path / "part.yaml"
    lines = calibrate_perception(path, alone, tmp_path / "fit.png", extends="bundled:paper")
    assert f"wrote {alone}" in lines
    assert (tmp_path / "fit.png").read_bytes()[:4] == b"\x89PNG"
    calibrate_perception(path, part)
    both = tmp_path / "both.yaml"
    both.write_text("extends: [bundled:paper, part.yaml]\n")
    for file in (alone, both):
        loaded = load_scenario(file)
        robot = loaded.robots["astro"]
        assert 1 == robot.camera.detection
        assert isinstance(robot.perception.detection.bearing, Curve)
        assert 4 == pytest.approx(robot.perception.detection.distance.midpoint, rel=0.1)
    stored = run(load_scenario(alone, "simulation.duration=2 h").resolved())
    assert "true_user" in stored.tables["observations"].column_names


def test_a_fragment_is_plain_yaml_with_a_note_of_where_it_comes_from():
    text = fragment(calibrate(simulated(14, 1000)), "bolt", None)
    assert text.startswith("# Fitted to 1000 rows of log.csv")
    assert {"camera", "perception"} == yaml.safe_load(text)["robots"]["bolt"].keys()


ROWS = 60
GOOD = {"distance": [1.0] * ROWS, "detected": [0, 1] * (ROWS // 2)}


def test_angles_are_read_in_the_unit_that_their_column_tells(tmp_path):
    degrees = read_detections(
        write(tmp_path / "a.csv", **GOOD, bearing_deg=[-30, 350] * (ROWS // 2))
    )
    radians = read_detections(
        write(tmp_path / "b.csv", **GOOD, bearing_rad=[-np.pi / 6, np.pi] * (ROWS // 2))
    )
    assert [30, 10] == pytest.approx(degrees.bearing[:2].tolist())
    assert [30, 180] == pytest.approx(radians.bearing[:2].tolist())


def test_tables_are_read_as_other_logs_are(tmp_path):
    path = tmp_path / "log.csv"
    rows = [f"{k % 3},5;{'yes' if k % 2 else 'no'}" for k in range(ROWS)]
    path.write_text("\n".join(["Distance;detected", *rows]))

    log = read_detections(path)

    assert [0.5, 1.5, 2.5] == log.distance[:3].tolist()
    assert [False, True] == log.detected[:2].tolist()


@pytest.mark.parametrize(
    ("columns", "words"),
    [
        ({"detected": GOOD["detected"]}, ["no column 'distance'", "it has: detected. Rename"]),
        ({"distance": GOOD["distance"]}, ["no column 'detected'", "Rename the one that it is"]),
        (
            GOOD | {"distance": ["near"] + [1] * (ROWS - 1)},
            ["log.csv, line 2", "distance", "'near'", "number"],
        ),
        (
            GOOD | {"distance": [1] * (ROWS - 1) + [-1]},
            ["log.csv, line 61", "distance", "'-1'", "0 to 100 m"],
        ),
        (GOOD | {"distance": ["nan"] + [1] * (ROWS - 1)}, ["log.csv, line 2", "'nan'"]),
        (GOOD | {"detected": [2] * ROWS}, ["log.csv, line 2", "detected", "'2'", "0 or 1"]),
        (GOOD | {"detected": [1] * ROWS}, ["all of 60 rows are detected", "nothing to fit"]),
        (GOOD | {"detected": [0] * ROWS}, ["none of 60 rows"]),
        (GOOD | {"bearing": [0] * ROWS}, ["'bearing'", "bearing_deg or bearing_rad"]),
        ({k: v[:3] for k, v in GOOD.items()}, ["3 rows", "50"]),
        (GOOD | {"distance": [1200] * ROWS}, ["log.csv, line 2", "'1200'", "0 to 100 m"]),
        (GOOD | {"bearing_deg": [3350] * ROWS}, ["log.csv, line 2", "bearing_deg", "-360 to 360"]),
        (
            GOOD | {"bearing_rad": [30] * ROWS},
            ["log.csv, line 2", "bearing_rad", "-6.283 to 6.283"],
        ),
        (GOOD | {"detected ": GOOD["detected"]}, ["columns of detected", "rename the others"]),
        (
            GOOD | {"identity": ["ana"] * ROWS, "true_identity": [""] * ROWS},
            ["log.csv, line 2", "true_identity is empty"],
        ),
    ],
)
def test_wrong_logs_are_errors_that_say_where_and_what(tmp_path, columns, words):
    with pytest.raises(InputError) as caught:
        read_detections(write(tmp_path / "log.csv", **columns))
    for word in words:
        assert word in str(caught.value)


def test_a_picture_of_the_smallest_log_is_drawn_and_one_of_another_kind_refused(tmp_path):
    log = simulated(16, 50, bearing=True)
    path = write(
        tmp_path / "log.csv",
        distance=log.distance, bearing_deg=log.bearing, detected=log.detected.astype(int),
    )  # fmt: skip
    calibrate_perception(path, tmp_path / "a.yaml", tmp_path / "fit.svg")
    assert (tmp_path / "fit.svg").read_text().startswith("<?xml")
    with pytest.raises(InputError, match=r"as \.png, \.svg or \.pdf, not as '\.tex'"):
        calibrate_perception(path, tmp_path / "b.yaml", tmp_path / "fit.tex")
    assert not (tmp_path / "b.yaml").exists()


def test_a_file_that_is_no_text_is_an_error(tmp_path):
    (tmp_path / "log.csv").write_bytes(b"distance,detected\n\xe9,1\n")
    with pytest.raises(InputError, match="not text in UTF-8"):
        read_detections(tmp_path / "log.csv")


def test_a_log_that_is_not_there_is_an_error(tmp_path):
    with pytest.raises(InputError, match="can't be read"):
        read_detections(tmp_path / "none.csv")
