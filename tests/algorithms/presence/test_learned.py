"""The learned model: any home, no leak, better than what it corrects, and files that aren't its own."""

import copy
import io
from datetime import datetime, timedelta

import numpy as np
import pytest
from tests.algorithms.presence.worlds import MONDAY, any_evidence, evidence_of, home_of

import fleet2d
from fleet2d.algorithms.presence.belief import BeliefSeries
from fleet2d.algorithms.presence.learned import WEIGHTS, LearnedModel, Weights, shipped_weights
from fleet2d.errors import Fleet2DError, InputError
from fleet2d.learning.datasets.specification import plan_dataset
from fleet2d.learning.datasets.tables import tables_of
from fleet2d.learning.datasets.windows import predict, windows_of
from fleet2d.metrics.rtp_score import calibration_error

LEARNED = {"rtp": {"type": "real_time_presence", "model": "learned"}}


def begun(rooms=3, users=2):
    model = LearnedModel()
    model.begin(home_of(rooms), [f"u{i}" for i in range(users)], MONDAY)
    return model


def test_a_robot_that_never_looks_is_sure_of_nothing():
    bins = evidence_of(np.zeros((1440, 5)), np.zeros((1440, 2, 5), np.int64))

    home, away = begun(5, 1).observe(bins)

    belief = np.append(home[-1, 0] * (1 - away[-1, 0]), away[-1, 0])
    assert belief.max() < 0.9


def test_forecasts_begin_with_the_present_belief():
    model = begun(4, 1)
    home, away = model.observe(any_evidence(5, users=1, bins=300, rooms=4))
    now = model.presence(["u0"], MONDAY, 60_000_000, BeliefSeries(0, 1, home, away))

    soon, late = (now.at(MONDAY + timedelta(minutes=minutes)) for minutes in (1, 10_000))

    assert np.abs(soon.with_away("u0") - now.with_away("u0")).max() < 0.2
    assert np.abs(late.with_away("u0") - now.with_away("u0")).max() > 0.01


@pytest.mark.slow
def test_it_is_better_than_what_it_corrects_in_an_unseen_home():
    routine = {"type": "real_time_presence", "model": "routine"}
    run = fleet2d.run(
        "bundled:paper",
        "simulation.duration=5 d",
        "floorplan={type: synthetic, seed: 77, furnish: true}",
        "robots.astro.behaviors=[{type: patrol, order: random, dwell: 10 min}]",
        seed=5,
        algorithms={**LEARNED, "routine": routine},
        metrics={"rtp_score": {"of": "rtp", "reference": "routine"}},
    )
    scores = run.metrics["rtp_score"]["ana"]["all"]

    assert scores["log_loss"] < 0.9 * scores["reference_log_loss"]
    assert scores["ece"] < 0.1


def tempered(belief, temperature):
    power = belief ** (1 / temperature)
    return np.asarray(power / power.sum(axis=1, keepdims=True))


@pytest.mark.slow
def test_it_is_calibrated_in_unseen_homes_with_unseen_people():
    """Beliefs that are too sure, too unsure or late are not."""
    people = {
        "runs": 6,
        "homes": [{"synthetic": 6, "first": 4100, "settings": {"furnish": True}}],
        "households": [["works_from_home"], ["night_shift"]],
    }
    patrol = {"type": "patrol", "order": "random", "dwell": "10 min"}
    base = {
        "extends": "bundled:paper",
        "simulation": {"duration": {"days": 3}},
        "robots": {"astro": {"behaviors": [patrol]}},
        "algorithms": {"ltp": None},
    }
    plan = plan_dataset({"base": base, "splits": {"test": people}, "beliefs": ["routine"]})
    parts = [
        part
        for planned in plan.runs("test")
        for part in windows_of(tables_of(fleet2d.run(planned.scenario), planned, plan.file.labels))
    ]
    beliefs = [predict(shipped_weights(), part) for part in parts]
    truth = np.concatenate([part.truth for part in parts])
    width = max(belief.shape[1] for belief in beliefs)

    def error(change):
        rows = [np.pad(change(b), ((0, 0), (0, width - b.shape[1]))) for b in beliefs]
        return calibration_error(np.concatenate(rows), truth)

    assert error(lambda belief: belief) < 0.05
    assert error(lambda belief: tempered(belief, 1.5)) > 0.08
    assert error(lambda belief: tempered(belief, 1 / 1.5)) > 0.08
    assert error(lambda belief: np.roll(belief, 5, axis=0)) > 0.08


def test_a_branch_and_a_learned_state_go_on_alike(tmp_path):
    simulation = fleet2d.Simulation(
        "bundled:paper", "simulation.duration=8 h", seed=3, algorithms=LEARNED
    )
    simulation.run_until(timedelta(hours=5))
    branch = copy.deepcopy(simulation)

    assert simulation.run().digest == branch.run().digest


def changed(**arrays):
    """The shipped file with other arrays."""
    with np.load(WEIGHTS) as file:
        content = {**{name: file[name] for name in file.files}, **arrays}
    buffer = io.BytesIO()
    np.savez(buffer, **{name: value for name, value in content.items() if value is not None})
    return buffer.getvalue()


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (WEIGHTS.read_bytes()[:-40], "can't be read as weights"),
        (b"not a model", r"can.t be read as weights .*it is no .npz archive.*type: onnx"),
        (b"", "can't be read as weights"),
        (changed(format=np.array("fleet2d presence network 1")), "train it again"),
        (changed(format=None), "holds 'nothing'"),
        (changed(bias=np.zeros(3, np.float32)), "it is damaged"),
        (changed(score=np.full(32, np.nan, np.float32)), "lacks finite weights 'score'"),
        (changed(places=np.array([{}], object)), "can't be read as weights"),
    ],
)
def test_files_that_are_damaged_or_foreign_are_refused(tmp_path, content, words):
    (tmp_path / "own.npz").write_bytes(content)

    with pytest.raises(InputError, match=words):
        Weights.read(tmp_path / "own.npz")


@pytest.mark.parametrize(
    ("content", "message"), [(b"not a model", "can't be read as weights"), (None, r"own\.npz")]
)
def test_a_damaged_or_missing_file_is_refused_before_the_run(tmp_path, content, message):
    path = tmp_path / "own.npz"
    if content is not None:
        path.write_bytes(content)
    model = {"type": "learned", "weights": str(path)}
    rtp = {"type": "real_time_presence", "model": model}
    with pytest.raises(Fleet2DError, match=message):
        fleet2d.Simulation("bundled:paper", algorithms={"rtp": rtp})


def test_weights_are_read_as_they_were_saved(tmp_path):
    weights = Weights.read(WEIGHTS)

    weights.save(tmp_path / "copy.npz")

    again = Weights.read(tmp_path / "copy.npz")
    assert np.array_equal(weights.network.first, again.network.first)
    assert np.array_equal(weights.places, again.places)


def test_the_time_of_the_run_is_no_leak():
    """Evidence is dated by its own bins: the start of the run is only where it begins."""
    bins = any_evidence(7, users=1, bins=50)
    one, other = LearnedModel(), LearnedModel()
    one.begin(home_of(3), ["u0"], MONDAY)
    other.begin(home_of(3), ["u0"], datetime(2020, 1, 1))

    assert np.array_equal(one.observe(bins)[0], other.observe(bins)[0])
