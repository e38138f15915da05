"""Studies in experiment trackers: MLflow and Weights & Biases."""

import math
from pathlib import Path
from typing import Any, Literal

from fleet2d.errors import InputError, extra
from fleet2d.studies.reader import Study

TrackerName = Literal["mlflow", "wandb"]
IDENTITY = "fleet2d.identity"
STUDY = "fleet2d.study"


def track(study: Study, tracker: TrackerName, project: str, uri: str | None = None) -> int:
    """Store a study in a tracker: parameters, metrics, and the report if there is one.

    In MLflow the study is a run, and each complete variant a run below it; variants that are there
    are skipped. In Weights & Biases the study is a run with a table of its variants.

    Args:
        study: The study.
        tracker: The tracker.
        project: The experiment of MLflow, or the project of Weights & Biases.
        uri: The address of MLflow's store or server; None: as MLFLOW_TRACKING_URI says.

    Returns:
        The number of stored variants.

    Raises:
        InputError: The tracker's package is missing, or it can't be reached.
    """
    if tracker == "mlflow":
        return _to_mlflow(study, project, uri)
    if uri is not None:
        raise InputError("--uri is for mlflow; Weights & Biases takes WANDB_BASE_URL")
    return _to_wandb(study, project)


def _report(study: Study) -> Path | None:
    path = Path(study.location) / "report" / "report.html"
    return path if path.exists() else None


def _to_mlflow(study: Study, project: str, uri: str | None) -> int:
    with extra("mlflow", "this needs MLflow"):
        from mlflow import MlflowClient
        from mlflow.entities import Metric, Param
        from mlflow.exceptions import MlflowException
        from mlflow.utils.mlflow_tags import MLFLOW_PARENT_RUN_ID
    try:
        client = MlflowClient(uri)
        found = client.get_experiment_by_name(project)
        experiment = found.experiment_id if found else client.create_experiment(project)
        parent, known = _mlflow_runs(client, experiment, study)
        count = 0
        for row in study.complete.to_dicts():
            if row["identity"] in known:
                continue
            tags = {IDENTITY: row["identity"], MLFLOW_PARENT_RUN_ID: parent}
            tags["fleet2d.digest"] = row["digest"]
            run = client.create_run(experiment, tags=tags, run_name=f"variant {row['variant']}")
            given = {name: value for name, value in row.items() if value is not None}
            numbers = [name for name in study.metrics if math.isfinite(given.get(name, math.nan))]
            metrics = [Metric(_mlflow_name(name), given[name], 0, 0) for name in numbers]
            columns = [column for column in study.columns if column in given]
            params = [Param(_mlflow_name(column), str(given[column])) for column in columns]
            client.log_batch(run.info.run_id, metrics, params)
            client.set_terminated(run.info.run_id)
            count += 1
        if report := _report(study):
            client.log_artifact(parent, str(report))
        client.set_terminated(parent)
    except (MlflowException, OSError) as error:
        raise InputError(f"MLflow can't store the study: {error}; give --uri") from error
    return count


def _mlflow_runs(client: Any, experiment: str, study: Study) -> tuple[str, set[str]]:
    """Return the run of a study, created if there is none, and the identities of its variants."""
    runs: list[Any] = []
    page = None
    while page is None or page.token:
        page = client.search_runs([experiment], page_token=page and page.token)
        runs += page
    known = {run.data.tags[IDENTITY] for run in runs if IDENTITY in run.data.tags}
    for run in runs:
        if run.data.tags.get(STUDY) == study.meta.name:
            return run.info.run_id, known
    meta = study.meta
    tags = {STUDY: meta.name, "fleet2d.code": meta.code, **{f"tag.{t}": "1" for t in meta.tags}}
    tags["mlflow.note.content"] = "\n\n".join(filter(None, (meta.description, meta.notes)))
    return client.create_run(experiment, tags=tags, run_name=meta.name).info.run_id, known


def _mlflow_name(name: str) -> str:
    """Return a name with the characters that MLflow allows."""
    return "".join(c if c.isalnum() or c in "_-. :/" else "_" for c in name)


def _to_wandb(study: Study, project: str) -> int:
    with extra("wandb", "this needs Weights & Biases"):
        import wandb
    meta = study.meta
    rows = study.complete.to_dicts()
    columns = ["variant", *study.columns, "digest", *study.metrics]
    try:
        run = wandb.init(
            project=project,
            name=meta.name,
            tags=meta.tags,
            notes="\n\n".join(filter(None, (meta.description, meta.notes))),
            config={"code": meta.code, "study_file": meta.source},
        )
        table = wandb.Table(columns, [[row[c] for c in columns] for row in rows])
        run.log({"variants": table})
        if report := _report(study):
            run.log({"report": wandb.Html(report.read_text(encoding="utf-8"), inject=False)})
        run.finish()
    except (wandb.Error, OSError) as error:
        raise InputError(
            f"Weights & Biases can't store the study: {error}; log in, or set WANDB_MODE=offline"
        ) from error
    return len(rows)
