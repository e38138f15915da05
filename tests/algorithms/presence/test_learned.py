"""The learned model: any home, no leak, better than what it corrects, and files that aren't its own."""

import copy
import io
from collections.abc import Callable
from datetime import datetime, timedelta

import numpy as np
import pytest
from tests.algorithms.presence.worlds import MONDAY, any_evidence, evidence_of, home_of

import fleet2d
from fleet2d.algorithms.presence.belief import BeliefSeries
from fleet2d.algorithms.presence.learned import WEIGHTS, LearnedModel, Weights, shipped_weights
from fleet2d.errors import Fleet2DError, InputError
from fleet2d.kernels import F64
from fleet2d.learning.datasets.specification import plan_dataset
from fleet2d.learning.datasets.tables import tables_of
from fleet2d.learning.datasets.training import predict
from fleet2d.learning.datasets.windows import windows_of
from fleet2d.metrics.rtp_score import calibration_error

LEARNED = {"rtp": {"type": "real_time_presence", "model": "learned"}}


def begun(rooms: int = 3, users: int = 2) -> LearnedModel:
    model = LearnedModel()
    model.begin(home_of(rooms), [f"u{i}" for i in range(users)], MONDAY)
    return model


@pytest.mark.parametrize("rooms", [1, 2, 40])
@pytest.mark.parametrize("users", [0, 1, 8])
def test_homes_and_households_of_any_size(rooms, users):
    model = begun(rooms, users)
    bins = any_evidence(1, users=users, bins=150, rooms=rooms)

    home, away = model.observe(bins)

    assert (150, users + 1, rooms) == home.shape
    assert np.abs(home.sum(axis=2) - 1).max() < 1e-9
    assert ((away >= 0) & (away <= 1)).all()


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


@pytest.fixture(scope="module")
def unseen_error():
    """Return the calibration error of changed beliefs in unseen homes with unseen people."""
    people = {
        "runs": 6,
        "homes": [{"synthetic": 6, "first": 4100, "settings": {"furnish": True}}],
        "households": [["works_from_home"], ["night_shift"]],
    }
    base = {
        "extends": "bundled:paper",
        "simulation": {"duration": {"days": 3}},
        "robots": {
            "astro": {"behaviors": [{"type": "patrol", "order": "random", "dwell": "10 min"}]}
        },
        "algorithms": {"ltp": None},
    }
    plan = plan_dataset({"base": base, "splits": {"test": people}, "beliefs": ["routine"]})
    parts = [
        (predict(shipped_weights(), part), part.truth)
        for planned in plan.runs("test")
        for part in windows_of(tables_of(fleet2d.run(planned.scenario), planned, plan.file.labels))
    ]

    def error(change: Callable[[F64], F64]) -> float:
        width = max(belief.shape[1] for belief, _ in parts)
        changed = [change(belief) for belief, _ in parts]
        beliefs = [np.pad(b, ((0, 0), (0, width - b.shape[1]))) for b in changed]
        return calibration_error(np.concatenate(beliefs), np.concatenate([t for _, t in parts]))

    return error


def tempered(belief: F64, temperature: float) -> F64:
    power = belief ** (1 / temperature)
    return np.asarray(power / power.sum(axis=1, keepdims=True))


@pytest.mark.slow
def test_it_is_calibrated_in_unseen_homes_with_unseen_people(unseen_error):
    assert unseen_error(lambda belief: belief) < 0.05


@pytest.mark.slow
def test_beliefs_that_are_too_sure_too_unsure_or_late_are_not_calibrated(unseen_error):
    assert unseen_error(lambda belief: tempered(belief, 1.5)) > 0.08
    assert unseen_error(lambda belief: tempered(belief, 1 / 1.5)) > 0.08
    assert unseen_error(lambda belief: np.roll(belief, 5, axis=0)) > 0.08


def test_a_branch_and_a_learned_state_go_on_alike(tmp_path):
    simulation = fleet2d.Simulation(
        "bundled:paper", "simulation.duration=8 h", seed=3, algorithms=LEARNED
    )
    simulation.run_until(timedelta(hours=5))
    branch = copy.deepcopy(simulation)

    assert simulation.run().digest == branch.run().digest


def test_its_file_is_small():
    assert WEIGHTS.stat().st_size < 1_000_000


def changed(**arrays: object) -> bytes:
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


def test_a_damaged_file_is_refused_before_the_run(tmp_path):
    (tmp_path / "own.npz").write_bytes(b"not a model")
    model = {"type": "learned", "weights": str(tmp_path / "own.npz")}
    with pytest.raises(Fleet2DError, match="can't be read as weights"):
        fleet2d.Simulation(
            "bundled:paper",
            "simulation.duration=1 h",
            seed=1,
            algorithms={"rtp": {"type": "real_time_presence", "model": model}},
        )


def test_weights_are_read_as_they_were_saved(tmp_path):
    weights = Weights.read(WEIGHTS)

    weights.save(tmp_path / "copy.npz")

    again = Weights.read(tmp_path / "copy.npz")
    assert np.array_equal(weights.network.first, again.network.first)
    assert np.array_equal(weights.places, again.places)


def test_a_run_names_a_missing_file(tmp_path):
    missing = {
        "type": "real_time_presence",
        "model": {"type": "learned", "weights": str(tmp_path / "no.npz")},
    }
    with pytest.raises(InputError, match=r"no\.npz"):
        fleet2d.run("bundled:paper", "simulation.duration=1 h", seed=1, algorithms={"rtp": missing})


def test_the_time_of_the_run_is_no_leak():
    """Evidence is dated by its own bins: the start of the run is only where it begins."""
    bins = any_evidence(7, users=1, bins=50)
    one, other = LearnedModel(), LearnedModel()
    one.begin(home_of(3), ["u0"], MONDAY)
    other.begin(home_of(3), ["u0"], datetime(2020, 1, 1))

    assert np.array_equal(one.observe(bins)[0], other.observe(bins)[0])
