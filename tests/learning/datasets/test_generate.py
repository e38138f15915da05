"""Making data sets: the same content always, resumable, and read by other programs."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from tests.learning.datasets.small import SOURCE, make

import fleet2d
from fleet2d.errors import InputError, ScenarioError
from fleet2d.learning.datasets.reader import Dataset
from fleet2d.learning.datasets.tasks import windows
from fleet2d.studies.design import code_version


def records(data: Dataset):
    return {name: file.sha256 for name, file in data.manifest.files.items()}


@pytest.mark.slow
def test_tables_are_there_for_every_split(data):
    assert ("train", "test") == data.splits
    runs = data.arrow("runs", "train").to_pydict()
    assert [0, 1, 2] == runs["run"]
    assert [0.25] * 3 == runs["days"]
    labels = data.arrow("labels", "train").to_pydict()
    users = sum(len(names) for names in runs["users"])
    assert users * 360 == len(labels["place"])
    assert {"routine", "last_seen"} == set(data.arrow("beliefs", "test")["model"].to_pylist())


def test_labels_are_the_truth_of_their_step(data):
    labels = data.polars("labels", "test").collect()
    places, following = labels["place"].to_list(), labels["next_place"].to_list()
    steps, next_steps = labels["step"].to_list(), labels["next_step"].to_list()

    for k in range(len(places) - 1):
        if next_steps[k] is None or next_steps[k] > steps[k + 1]:
            assert places[k] == places[k + 1]
        elif next_steps[k + 1] != next_steps[k]:
            assert following[k] != places[k]
    assert following[-1] is None
    assert labels["utc_offset_min"].is_null().all()  # the home has no time zone


@pytest.mark.slow
def test_moments_of_the_doubled_hour_are_told_apart_by_their_offset(tmp_path):
    """The hour from two to three came twice, and one couldn't tell which of them a label meant."""
    autumn = {
        "start": "2026-10-25T00:00",
        "duration": {"hours": 4},
        "time_zone": "Europe/Berlin",
    }
    source = {
        "name": "autumn",
        "base": {"extends": "bundled:paper", "simulation": autumn},
        "splits": {"train": {"runs": 1, "homes": [{"synthetic": 1}], "households": [["retired"]]}},
    }
    labels = fleet2d.dataset(source, tmp_path / "autumn", workers=1).polars("labels", "train")
    moments = labels.select("time", "utc_offset_min").collect()
    assert moments["time"].is_duplicated().sum() == 120
    assert not moments.is_duplicated().any()
    assert moments["utc_offset_min"].unique().sort().to_list() == [60, 120]


@pytest.mark.slow
def test_the_content_is_the_same_for_any_number_of_workers(data, tmp_path):
    assert records(data) == records(make(tmp_path / "again", workers=2))


@pytest.mark.slow
def test_an_interrupted_data_set_goes_on(data, tmp_path):
    out = tmp_path / "killed"
    source = tmp_path / "small.json"
    source.write_text(json.dumps(SOURCE))
    code = (
        "import fleet2d, json, sys;"
        " fleet2d.dataset(json.load(open(sys.argv[1])), sys.argv[2], workers=1)"
    )
    process = subprocess.Popen([sys.executable, "-c", code, str(source), str(out)])
    for _ in range(2000):
        if list((out / "unfinished").glob("*.arrow")) or process.poll() is not None:
            break
        time.sleep(0.01)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    with pytest.raises(InputError, match="run the same command again"):
        fleet2d.open_dataset(out)
    for change in ({"seed": 5}, {"runs_per_shard": 3}):
        with pytest.raises(InputError, match="of another file"):
            fleet2d.dataset({**SOURCE, **change}, out)

    assert records(data) == records(make(out))
    assert not (out / "unfinished").exists()


@pytest.mark.slow
def test_damaged_parts_and_records_of_an_unfinished_one_are_made_again(data, tmp_path):
    out, parts = tmp_path / "damaged", tmp_path / "damaged" / "unfinished"
    shutil.copytree(data.root, out)
    (out / "dataset.json").unlink()
    parts.mkdir()
    (parts / "plan.txt").write_text(f"{data.manifest.plan} {code_version()}")
    (parts / "unfit").write_text("{}")
    files = data.manifest.files
    whole = {
        name: files[name].model_dump() for name in files if "train" not in name or "00001" in name
    }
    for record in ("train-00001", "test-00000"):
        (parts / f"{record}.json").write_text(json.dumps(whole))
    (parts / "train-00000.json").write_text('{"../secret": {"bytes": 0}}')
    (parts / "000000.arrow").write_bytes(b"no table")
    (parts / "000001.arrow").write_bytes(b"no table")

    for number in range(2):
        with pytest.raises(InputError, match=rf"00000{number}\.arrow was damaged, and is deleted"):
            make(out)
    (parts / "train-00000.json").write_text("[")

    assert records(data) == records(make(out))


@pytest.mark.slow
def test_one_killed_before_it_noted_its_unfit_runs_goes_on(data, tmp_path):
    """The plan is written first: a kill after it left a folder that couldn't be gone on with."""
    parts = tmp_path / "killed" / "unfinished"
    parts.mkdir(parents=True)
    (parts / "plan.txt").write_text(f"{data.manifest.plan} {code_version()}")

    assert records(data) == records(make(tmp_path / "killed"))


def unfit(folder: Path):
    """The small data set with one more household, of whom no home has the room."""
    log = folder / "sauna.txt"
    log.write_text("2026-01-05 15:10:00 Sauna Sauna ON Relax\n")
    people = [
        ["retired"],
        {"ana": {"type": "replay", "path": str(log)}},
    ]
    train = {**SOURCE["splits"]["train"], "runs": 12, "households": people}
    return {**SOURCE, "splits": {**SOURCE["splits"], "train": train}}


@pytest.mark.slow
def test_all_that_is_unfit_is_told_before_the_first_run_and_the_corrected_file_goes_on(tmp_path):
    with pytest.raises(ScenarioError) as caught:
        fleet2d.dataset(unfit(tmp_path), tmp_path / "made", workers=1)

    first, *reasons = str(caught.value).splitlines()
    assert re.fullmatch(r"\d+ runs can't be simulated; `skip: unfit` leaves them out", first)
    assert ["train, home 0", "train, home 1"] == sorted(line[:13] for line in reasons)
    assert not (tmp_path / "made").exists()


@pytest.mark.slow
def test_unfit_runs_are_left_out_and_counted(tmp_path):
    data = fleet2d.dataset({**unfit(tmp_path), "skip": "unfit"}, tmp_path / "made", workers=1)

    left_out = {int(number) for number in data.manifest.unfit}
    assert 0 < len(left_out) < 12
    assert {"train": 12 - len(left_out), "test": 1} == data.manifest.splits
    assert {*range(12)} - left_out == {*data.arrow("runs", "train")["run"].to_pylist()}
    assert "Left out: train, home" in (data.root / "README.md").read_text()


def test_a_complete_one_is_opened_and_another_refused(data):
    assert records(make(data.root)) == records(data)
    with pytest.raises(InputError, match="holds another data set"):
        fleet2d.dataset({**SOURCE, "seed": 5}, data.root)


def test_a_folder_with_other_files_is_refused(tmp_path):
    (tmp_path / "thesis.txt").write_text("mine")
    with pytest.raises(InputError, match="not empty"):
        make(tmp_path)
    assert ["thesis.txt"] == [path.name for path in tmp_path.iterdir()]


@pytest.mark.parametrize("damage", ["cut", "changed", "gone"])
def test_damaged_shards_are_found(data, tmp_path, damage):
    root = tmp_path / "copy"
    shutil.copytree(data.root, root)
    path = root / "train" / "labels-00001.parquet"
    content = path.read_bytes()
    if damage == "gone":
        path.unlink()
    else:
        path.write_bytes(
            content[:-100] if damage == "cut" else content[:99] + b"\0" + content[100:]
        )
    again = fleet2d.open_dataset(root)

    assert ["train/labels-00001.parquet"] == again.verify()
    if damage != "changed":
        with pytest.raises(InputError, match=r"labels-00001\.parquet"):
            again.arrow("labels", "train")


@pytest.mark.slow
def test_a_deleted_file_is_made_again_with_its_shard_only(data, tmp_path):
    root = tmp_path / "copy"
    shutil.copytree(data.root, root)
    (root / "train" / "labels-00001.parquet").unlink()
    written = {path: path.stat().st_ino for path in root.rglob("*-00000.parquet")}

    assert [] == make(root).verify()

    assert written == {path: path.stat().st_ino for path in root.rglob("*-00000.parquet")}
    assert not (root / "unfinished").exists()


ROOMS = "test/rooms-00000.parquet"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda m: m["versions"].update(fleet2d="0.0.1"),
            f"lacks {ROOMS}, which Fleet2D 0.0.1 can",
        ),
        (lambda m: m["files"][ROOMS].update(sha256="0" * 64), "differ now from those that were"),
    ],
)
def test_a_deleted_file_that_can_not_be_made_again_as_it_was_is_refused(
    data, tmp_path, change, message
):
    root = tmp_path / "copy"
    shutil.copytree(data.root, root)
    manifest = json.loads((root / "dataset.json").read_text())
    change(manifest)
    (root / "dataset.json").write_text(json.dumps(manifest))
    (root / ROOMS).unlink()

    with pytest.raises(InputError, match=message):
        make(root)


def test_the_card_says_what_is_in_it(data):
    card = (data.root / "README.md").read_text()

    assert card.startswith("---\nlicense: cc0-1.0\n")
    assert "| train | 3 | 0.75 | 2 |" in card
    assert "household: " in card
    assert (data.root / "pictures" / "place.png").stat().st_size > 1000


def test_workers_share_the_shards(data):
    whole, *shared = (
        [part.truth.tolist() for part in windows(data, "train", worker, workers)]
        for worker, workers in ((0, 1), (0, 2), (1, 2), (5, 6))
    )

    assert sorted(whole) == sorted(one for part in shared for one in part)
    assert all(shared[:2])


@pytest.mark.parametrize(("table", "split"), [("label", "train"), ("labels", "tests")])
def test_unknown_tables_and_splits_are_named(data, table, split):
    with pytest.raises(InputError, match="tables beliefs, evidence, labels, rooms, runs"):
        data.arrow(table, split)


def test_steps_of_evidence_are_the_last_of_their_bins(data):
    steps = np.array(data.arrow("evidence", "train")["step"].to_pylist())
    assert set((steps + 1) % 60) == {0}
