"""Windows for PyTorch, and data sets loaded by the library of the Hugging Face Hub."""

import itertools
import re
import runpy
from pathlib import Path

import pytest
from tests.learning.datasets.small import SOURCE, make

from fleet2d.learning.datasets.reader import open_dataset
from fleet2d.learning.datasets.tasks import windows

torch = pytest.importorskip("torch", reason="torch isn't installed")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return make(tmp_path_factory.mktemp("data") / "small").root


def test_workers_share_the_windows(folder):
    from torch.utils.data import DataLoader

    import fleet2d
    from fleet2d.learning.datasets.torch_data import torch_windows

    data = fleet2d.open_dataset(folder)
    parts = list(windows(data, "train"))
    loaded = list(DataLoader(torch_windows(data, "train"), batch_size=None, num_workers=2))

    assert sum(len(part.truth) for part in parts) == len(loaded)
    assert sorted(int(w["truth"]) for w in loaded) == sorted(int(t) for p in parts for t in p.truth)
    assert loaded[0]["features"].dtype == torch.float32
    assert loaded[0]["features"].shape[0] == loaded[0]["places"].shape[0]


def test_shuffled_windows_are_the_same_ones_in_another_order(folder):
    import fleet2d
    from fleet2d.learning.datasets.torch_data import torch_windows

    data = fleet2d.open_dataset(folder)
    plain, shuffled, again = (
        [float(w["features"].sum()) for w in torch_windows(data, "train", shuffle=n, seed=3)]
        for n in (0, 50, 50)
    )

    assert shuffled == again
    assert plain != shuffled
    assert sorted(plain) == sorted(shuffled)


def test_fresh_windows_have_no_end_and_other_people():
    from fleet2d.learning.datasets.torch_data import fresh_windows

    first, other = (
        [
            float(w["features"].sum())
            for w in itertools.islice(fresh_windows(SOURCE, "test", seed=s), 120)
        ]
        for s in (0, 1)
    )

    assert 120 == len(first)  # of three runs, though the split has one
    assert first != other


def test_a_recurrent_reference_is_trained_and_scored(folder, monkeypatch, capsys):
    benchmark = Path(__file__).parents[2] / "benchmarks" / "gru.py"
    monkeypatch.setattr("sys.argv", ["gru.py", str(folder), "--epochs", "3"])
    made = runpy.run_path(str(benchmark), run_name="__main__")

    out = capsys.readouterr().out
    first, *_, last = re.findall(r"epoch \d: log loss ([\d.]+)", out)
    assert float(last) < float(first)
    assert {"routine", "learned", "gru"} <= {line.split()[0] for line in out.splitlines()}

    # Persons are read alike alone, and beside one of a home with more places and windows.
    one, other = sorted(windows(open_dataset(folder), "train"), key=lambda w: len(w.places))[::2]
    network = made["train"]([one, other], 1, 0)
    (alone, _), (both, _) = (next(made["read"](network, parts)) for parts in ([one], [one, other]))
    assert torch.allclose(alone[0], both[0, : len(one.places), : alone.shape[2]], atol=1e-5)


def test_the_hubs_library_loads_each_table(folder, tmp_path):
    hub = pytest.importorskip("datasets", reason="datasets isn't installed")

    labels = hub.load_dataset(str(folder), "labels", cache_dir=str(tmp_path))

    assert {"train", "test"} == set(labels)
    assert {"run", "step", "place"} <= set(labels["test"].column_names)
    assert 360 == labels["test"].num_rows
