"""Studies in MLflow and Weights & Biases: their offline stores are read back."""

import json
import sys
from pathlib import Path

import pytest
from tests.scenes import Cli
from tests.studies.scenes import SPEED, run, small

from fleet2d.errors import InputError
from fleet2d.studies.reader import Study
from fleet2d.studies.trackers import track


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Study:
    keys = {"replicates": 2, "tags": ["pilot"], "description": "Fast?", "notes": "No noise."}
    folder = tmp_path_factory.mktemp("study") / "speeds"
    opened = run(small(name="speeds", **keys), folder)[1]
    (folder / "report").mkdir()
    (folder / "report" / "report.html").write_text("<h1>speeds</h1>")
    return opened


@pytest.mark.filterwarnings("ignore")  # MLflow's own
def test_mlflow_has_a_run_for_the_study_and_one_for_each_variant(
    study: Study, tmp_path: Path
) -> None:
    mlflow = pytest.importorskip("mlflow")
    uri = f"sqlite:///{tmp_path}/mlflow.db"
    assert 4 == track(study, "mlflow", "robots", uri)
    client = mlflow.MlflowClient(uri)
    experiment = client.get_experiment_by_name("robots").experiment_id
    runs = client.search_runs([experiment])
    (parent,) = (r for r in runs if r.data.tags.get("fleet2d.study") == "speeds")
    assert "Fast?\n\nNo noise." == parent.data.tags["mlflow.note.content"]
    assert "1" == parent.data.tags["tag.pilot"]
    assert ["report.html"] == [file.path for file in client.list_artifacts(parent.info.run_id)]
    variants = [r for r in runs if r.data.tags.get("mlflow.parentRunId") == parent.info.run_id]
    assert 4 == len(variants)
    rows = {f"variant {row['variant']}": row for row in study.variants.to_dicts()}
    for each in variants:
        row = rows[each.info.run_name]
        assert row["digest"] == each.data.tags["fleet2d.digest"]
        assert {SPEED: str(row[SPEED]), "seed": str(row["seed"])} == each.data.params
        assert row["sightings.ana"] == each.data.metrics["sightings.ana"]
    assert 0 == track(study, "mlflow", "robots", uri)
    assert 5 == len(client.search_runs([experiment]))


@pytest.mark.filterwarnings("ignore")
def test_wandb_has_a_run_with_a_table_of_the_variants(
    study: Study, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("wandb")
    monkeypatch.setenv("WANDB_MODE", "offline")
    monkeypatch.setenv("WANDB_DIR", str(tmp_path))
    monkeypatch.setenv("WANDB_SILENT", "true")
    assert 4 == track(study, "wandb", "robots")
    (folder,) = (tmp_path / "wandb").glob("offline-run-*")
    (table,) = folder.glob("files/media/table/variants*.json")
    content = json.loads(table.read_text())
    assert ["variant", SPEED, "seed", "digest"] == content["columns"][:4]
    assert study.variants["digest"].to_list() == [row[3] for row in content["data"]]
    assert list(folder.glob("files/media/html/report*.html"))
    assert list(folder.glob("*.wandb"))


def test_a_uri_is_for_mlflow(study: Study) -> None:
    with pytest.raises(InputError, match="WANDB_BASE_URL"):
        track(study, "wandb", "robots", "sqlite:///x.db")


def test_a_tracker_that_is_not_installed_is_named(
    study: Study, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "mlflow", None)
    with pytest.raises(InputError, match=r"fleet2d\[mlflow\]"):
        track(study, "mlflow", "robots")


def test_a_tracker_that_does_not_exist_is_refused(fleet2d: Cli) -> None:
    assert 2 == fleet2d("study", "track", "here", "--to", "mlfow")[0]
