"""Training: fewer losses than before, the same weights again, and no other setting changed."""

import shutil
from pathlib import Path

import numpy as np
import pytest
import yaml
from tests.learning.datasets import small
from tests.learning.datasets.test_tasks import made, models

from fleet2d.algorithms.presence.learned import (
    GAP,
    PLACE_FEATURES,
    TRUSTS,
    Weights,
    shipped_weights,
)
from fleet2d.errors import InputError
from fleet2d.kernels import TRACE_FEATURES
from fleet2d.learning.datasets.tasks import Networks, leaderboard
from fleet2d.learning.datasets.windows import Windows, predict

torch = pytest.importorskip("torch", reason="torch isn't installed")
from fleet2d.learning.datasets.training import TrainingSettings, fine_tune, train  # noqa: E402


@pytest.fixture
def data():
    """A small data set, made once."""
    return small.made()


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


def test_what_can_be_learned_is_learned():
    seen, unseen = random_windows(1), random_windows(2)
    settings = TrainingSettings(hidden=8, epochs=30, batch=64, trust=(1.0,) * TRUSTS)

    weights = train([seen, random_windows(3, places=7)], [unseen], settings)

    assert loss(weights, unseen) < 0.6 * np.log(4)


def test_the_same_seed_gives_the_same_weights_on_any_number_of_threads():
    settings = TrainingSettings(hidden=32, epochs=2)
    before = torch.get_num_threads()
    made = []
    for threads in (1, 2, 2):
        torch.set_num_threads(threads)
        made.append(train([random_windows(1, count=2000)], settings=settings))
    torch.set_num_threads(before)
    other = train([random_windows(1, count=2000)], settings=TrainingSettings(epochs=2, seed=1))

    for weights in made[1:]:
        assert np.array_equal(made[0].network.first, weights.network.first)
    assert not np.array_equal(made[0].network.first, other.network.first)


def test_settings_of_torch_neither_matter_nor_change():
    windows, settings = random_windows(1), TrainingSettings(hidden=4, epochs=2)
    expected = train([windows], settings=settings)
    threads = torch.get_num_threads()
    state = torch.get_rng_state()
    torch.set_num_threads(2)
    torch.set_default_dtype(torch.float64)
    try:
        with torch.no_grad(), torch.device("meta"):
            weights = train([windows], [windows], settings)
            assert torch.zeros(1).is_meta
            assert not torch.is_grad_enabled()
        assert (2, torch.float64) == (torch.get_num_threads(), torch.get_default_dtype())
    finally:
        torch.set_default_dtype(torch.float32)
        torch.set_num_threads(threads)

    assert np.array_equal(expected.network.first, weights.network.first)
    assert torch.equal(state, torch.get_rng_state())


def test_windows_stay_as_they_are():
    windows, same = random_windows(1), random_windows(1)
    train([windows], [windows], TrainingSettings(hidden=4, epochs=1))

    assert np.array_equal(windows.features, same.features)


def test_what_is_told_is_the_loss_of_the_weights_as_they_are_used():
    """Those that PyTorch computes with scaled features, and those that the core computes with."""
    seen, unseen = random_windows(1), random_windows(2)
    told = []
    settings = TrainingSettings(hidden=8, epochs=10, batch=64)
    weights = train([seen], [unseen], settings, on_epoch=lambda *line: told.append(line))

    assert [*range(10)] == [epoch for epoch, *_ in told]
    assert loss(weights, unseen) == pytest.approx(told[-1][2], abs=1e-5)


def test_weights_that_learn_nothing_more_are_those_they_began_with():
    start = shipped_weights()
    weights = train([random_windows(1)], settings=TrainingSettings(epochs=1, rate=0.0), start=start)

    for old, new in zip(start.network, weights.network, strict=True):
        assert np.abs(old - new).max() < 1e-5 * np.abs(old).max()
    assert np.array_equal(start.trust, weights.trust)


def test_decay_pulls_new_weights_to_zero_and_tuned_ones_to_their_start():
    """Without a gradient, as nothing of the correction is trusted."""
    untrusted = shipped_weights()._replace(trust=np.zeros(TRUSTS))
    settings = TrainingSettings(epochs=200, rate=0.1, decay=1.0, trust=(0.0,) * TRUSTS)
    tuned = train([random_windows(1)], settings=settings, start=untrusted)
    assert np.abs(tuned.network.second - untrusted.network.second).max() < 1e-5

    gentle, strong = (
        train([random_windows(1)], settings=TrainingSettings(epochs=100, rate=0.02, decay=decay))
        for decay in (0.0, 10.0)
    )
    assert np.abs(strong.network.second).mean() < 0.5 * np.abs(gentle.network.second).mean()


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
    (tmp_path / "small.yaml").write_text(yaml.safe_dump(small.SOURCE))
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


@pytest.mark.slow
def test_tuned_networks_are_scored_on_the_days_after_those_that_tuned_them(tmp_path):
    data = made(tmp_path, "2 d", ["retired"], beliefs=["routine"], every="1 h")

    entries = leaderboard(data, split="part0", networks=Networks(tune=1))

    assert models(entries) == [("routine", 24), ("learned", 24), ("learned, tuned", 24)]
    assert entries[1].scores != entries[2].scores
    assert leaderboard(data, split="part0", networks=Networks(tune=2)) == []


@pytest.mark.slow
def test_the_small_example_of_transfer_tells_its_result_of_real_homes(
    tmp_path, shared_data, fleet2d
):
    pytest.importorskip("sklearn", reason="needs the extra transfer")
    source = Path(__file__).parents[2] / "examples" / "transfer"
    folder = shutil.copytree(source, tmp_path / "examples")
    shutil.copytree(shared_data / "activity", folder / "logs")
    code, out, _ = fleet2d("transfer", folder / "small.yaml", "--out", folder / "small")
    assert 0 == code
    *sentences, last = out.splitlines()
    assert last.startswith("44 of 44 cells, 0 left out")
    assert ["room in 60 min", "presence"] == list(
        dict.fromkeys(s.partition(",")[0] for s in sentences)
    )
    assert (folder / "small" / "presence.png").exists()
