"""Training: right gradients, the same weights again, and fewer losses than before."""

import shutil

import numpy as np
import pytest
import yaml
from scipy.optimize import check_grad
from tests.learning.datasets.small import SOURCE

from fleet2d.algorithms.presence.learned import (
    GAP,
    PLACE_FEATURES,
    TRUSTS,
    Weights,
    shipped_weights,
)
from fleet2d.errors import InputError
from fleet2d.kernels import TRACE_FEATURES
from fleet2d.learning.datasets import training
from fleet2d.learning.datasets.training import TrainingSettings, fine_tune, predict, train
from fleet2d.learning.datasets.windows import Windows


def random_windows(seed, places=4, count=300) -> Windows:
    """People who are where the first feature is largest, and a model that doesn't know."""
    random = np.random.default_rng(seed)
    features = random.normal(size=(count, places, TRACE_FEATURES)).astype(np.float32)
    features[..., -1] = np.log(1 / places)
    truth = features[..., 0].argmax(axis=1)
    belief = {"routine": np.full((count, places), 1 / places)}
    facts = np.zeros((places, PLACE_FEATURES))  # say nothing of a place
    steps = np.arange(count)
    return Windows(
        seed, "home", ("people",), "ana", facts, features, truth, steps, steps // 60, belief
    )


def loss(weights: Weights, windows: Windows):
    belief = predict(weights, windows)[np.arange(len(windows.truth)), windows.truth]
    return float(-np.log(np.maximum(belief, 1e-6)).mean())


def test_gradients_equal_differences():
    random = np.random.default_rng(1)
    [batch] = training._batches([random_windows(1, count=7)], 7)
    batch = training.WindowBatch(*(np.asarray(part, float) for part in batch[:2]), *batch[2:])
    trust = random.uniform(size=TRUSTS)
    initial = training._initial(random, 3)
    ends = np.cumsum([part.size for part in initial.values()])

    def at(flat):
        parts = zip(initial.items(), np.split(flat, ends[:-1]), strict=True)
        values = {name: part.reshape(like.shape) for (name, like), part in parts}
        loss, gradient = training._gradient(values, batch, trust)
        return loss, np.concatenate([gradient[name].ravel() for name in initial])

    flat = random.normal(size=ends[-1])
    assert check_grad(lambda x: at(x)[0], lambda x: at(x)[1], flat) < 1e-4


def test_what_can_be_learned_is_learned():
    seen, unseen = random_windows(1), random_windows(2)
    settings = TrainingSettings(hidden=8, epochs=30, batch=64, trust=(1.0,) * TRUSTS)

    weights = train([seen, random_windows(3, places=7)], [unseen], settings)

    assert loss(weights, unseen) < 0.6 * np.log(4)


def test_the_same_seed_gives_the_same_weights():
    settings = TrainingSettings(hidden=4, epochs=2)
    one, other = (train([random_windows(1)], settings=settings) for _ in range(2))

    assert np.array_equal(one.network.first, other.network.first)


def test_untrained_weights_leave_the_belief_as_it_is():
    windows = random_windows(1)
    weights = train([windows], settings=TrainingSettings(epochs=1, rate=0.0))

    assert np.abs(predict(weights, windows) - windows.beliefs["routine"]).max() < 1e-6


def test_fine_tuning_helps_and_stays_near():
    start = train([random_windows(1)], settings=TrainingSettings(hidden=8, epochs=10, batch=64))
    home = random_windows(5)

    tuned = fine_tune(start, [home])

    assert loss(tuned, home) < loss(start, home)
    change = np.abs(tuned.network.second - start.network.second).mean()
    assert change < 0.1 * np.abs(start.network.second).mean()


def test_the_correction_counts_by_the_gap_as_far_as_it_is_trusted():
    """Trusted for short gaps only: longer ones keep the belief that is corrected."""
    windows = random_windows(1)
    windows.features[:, :, GAP] = np.where(np.arange(300) < 150, 0.0, 6.0)[:, None]
    settings = TrainingSettings(hidden=8, epochs=10, batch=64, trust=(1.0, *[0.0] * (TRUSTS - 1)))
    weights = train([windows], settings=settings)

    change = np.abs(predict(weights, windows) - windows.beliefs["routine"]).max(axis=1)

    assert change[:150].max() > 0.1
    assert change[150:].max() < 1e-6


def test_nothing_to_train_on_is_an_error():
    with pytest.raises(InputError, match="no windows"):
        train([])


def test_a_data_set_trains_weights_that_a_run_uses(tmp_path, data, fleet2d):
    folder = str(data.root)
    own, tuned = tmp_path / "own.npz", tmp_path / "tuned.npz"

    code, out, err = fleet2d(
        "dataset", "train", f"--on={folder}", f"--out={own}", "--epochs=2", "--hidden=4"
    )
    assert (0, "epoch 2" in err) == (code, True), err
    assert "windows" in out
    assert Weights.read(own).network.bias.shape == (4,)

    code, _, err = fleet2d("dataset", "train", "--from=learned", f"--on={folder}", f"--out={tuned}")
    assert 0 == code, err
    assert Weights.read(tuned).network.bias.shape == shipped_weights().network.bias.shape

    code, out, err = fleet2d("dataset", "score", folder, f"--weights={tuned}")
    assert 0 == code, err
    for word in ("rtp (", "tuned.npz\n", "next_room (", "time_to_return (", "activity (", "ltp ("):
        assert word in out


def test_the_file_of_a_data_set_is_made_and_the_weights_compared_with_the_shipped(
    tmp_path, data, fleet2d
):
    """The data set is there already, beside the weights, so it is opened."""
    (tmp_path / "small.yaml").write_text(yaml.safe_dump(SOURCE))
    shutil.copytree(data.root, tmp_path / "learned_data")
    options = (f"--on={tmp_path / 'small.yaml'}", f"--out={tmp_path / 'learned.npz'}")

    code, out, err = fleet2d("dataset", "train", *options, "--epochs=1", "--hidden=4")

    assert 0 == code, err
    assert "learned_data: train 3, test 1 runs" in out
    heads, *_ = out.split("rtp (")[1].splitlines()[1:]
    assert ["routine", "last_seen", "learned", "learned.npz"] == heads.split()


def test_weights_that_could_not_be_written_are_refused_before_training(data, tmp_path, fleet2d):
    code, _, err = fleet2d(
        "dataset", "train", "--on", str(data.root), "--out", str(tmp_path / "x/own.npz")
    )

    assert code == 2
    assert err == f"error: --out {tmp_path}/x/own.npz: there is no folder {tmp_path}/x\n"
