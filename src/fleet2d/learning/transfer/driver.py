"""Running a transfer experiment: its cells are run, stored and resumed as variants of a study."""

import hashlib
import json
import shutil
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa

from fleet2d.configuration.problems import counted
from fleet2d.errors import ScenarioError
from fleet2d.learning.transfer.learners import Forecast, forecast
from fleet2d.learning.transfer.sources import PRESENCE, Sources
from fleet2d.learning.transfer.specification import Cell, TransferPlan
from fleet2d.logs.log import files_of
from fleet2d.runtime.determinism import sum_in_order
from fleet2d.studies.design import code_version, file_hash
from fleet2d.studies.directory import COMPLETE, PLAN, Counts, Meta, MetricFacts, StudyDirectory
from fleet2d.studies.driver import Observer, stored_results, write_variants
from fleet2d.studies.executors import Crew, TaskQueue, WorkerTask, by_home
from fleet2d.studies.plan import Changed, reconcile
from fleet2d.studies.results import (
    VARIANT,
    VariantResult,
    drop_damaged,
    read_results,
    result_of,
)
from fleet2d.studies.simulator import VariantOutcome, describe_error
from fleet2d.studies.specification import SEED

if TYPE_CHECKING:
    import polars as pl

SOURCES = "sources"
DAYS_TABLE = "days"
COLUMNS = (*Cell._fields, SEED)
METRICS = {
    "log_loss": MetricFacts(description="Log loss", unit="nats", better={"": "lower"}),
    "accuracy": MetricFacts(description="Right guesses", unit="share", better={"": "higher"}),
    "macro_f1": MetricFacts(description="Mean F1", unit="share", better={"": "higher"}),
    "unseen": MetricFacts(description="Outcomes that the training never saw", unit="share"),
    "naive_accuracy": MetricFacts(description="Of staying, or of `routine`", unit="share"),
    "naive_log_loss": MetricFacts(description="That of `routine`", unit="nats"),
    "cases": MetricFacts(description="Moments that are scored"),
}


NO_CELL = Cell("", "", "", "", 0)


@dataclass(frozen=True)
class CellTask(WorkerTask):
    """A cell to train and score."""

    cell: Cell = NO_CELL


@dataclass
class CellJob:
    """Trains and scores cells in a worker.

    Attributes:
        sources: The people that their models learn from.
    """

    sources: Sources

    def __call__(self, task: CellTask) -> VariantResult:
        """Return the scores of a cell, or its error."""
        try:
            outcome = self._outcome(task.cell)
        except Exception as error:  # noqa: BLE001 - it is reported, and the other cells go on
            outcome = VariantOutcome("failed", error=describe_error(error))
        return result_of(task, outcome)

    def _outcome(self, cell: Cell) -> VariantOutcome:
        sources = self.sources
        if cell.task == PRESENCE:
            from fleet2d.learning.transfer.presence import presence_forecast

            found = presence_forecast(sources, cell)
        else:
            asked = sources.of_days(cell, sources.tested[cell.home])
            found = forecast(sources.training(cell), asked, cell.learner, cell.task)
        rows = _by_day(found)
        metrics = {
            "log_loss": _mean(rows["log_loss"]),
            "accuracy": _mean(rows["accuracy"]),
            "cases": float(len(found.loss)),
        }
        return VariantOutcome(
            "complete", metrics={**metrics, **found.metrics}, tables={DAYS_TABLE: pa.table(rows)}
        )


def _mean(values: list[float]) -> float:
    return sum_in_order(values) / len(values)


def _by_day(found: Forecast) -> dict[str, list[float]]:
    """Return the mean scores of each day: days count equally, as people live them."""
    days, number = np.unique(found.day, return_inverse=True)
    counts = np.bincount(number)
    return {
        "day": days.tolist(),
        "log_loss": (np.bincount(number, found.loss) / counts).tolist(),
        "accuracy": (np.bincount(number, found.hit) / counts).tolist(),
    }


def _inputs(plan: TransferPlan) -> str:
    """Return a hash of everything that all results depend on, but code."""
    logs = {
        str(file): file_hash(file)
        for home in plan.homes.values()
        for file in files_of(home.settings.path)
    }
    settings = plan.file.model_dump(
        mode="json", exclude={"name", "tasks", "arms", "learners", "days", "skip", "homes"}
    )
    homes = {name: home.settings.model_dump(mode="json") for name, home in plan.homes.items()}
    tested = {name: days.tolist() for name, days in plan.tested.items()}
    return json.dumps([settings, homes, tested, logs], sort_keys=True, default=str)


def _identity(*parts: object) -> str:
    return hashlib.sha256(json.dumps(parts, default=str).encode()).hexdigest()


def run_transfer(
    plan: TransferPlan,
    location: Path,
    crew: Crew,
    *,
    changed: Changed | None = None,
    observer: Observer | None = None,
) -> Counts:
    """Train and score the cells of an experiment that have no results yet.

    Args:
        plan: The experiment.
        location: Its folder.
        crew: Where cells run.
        changed: What to do with results of other code, logs or settings; None: refuse to continue.
        observer: Follows the progress.

    Raises:
        InputError: The folder can't be used, holds other results, or people don't fit into homes;
            with `skip`, if that leaves no cell. Or a package is not installed.
        KeyboardInterrupt: Ctrl-C; cells that are scored are stored.
    """
    import polars as pl

    if any(cell.task == PRESENCE for cell in plan.cells):
        import fleet2d.learning.datasets.training  # noqa: F401 - an error before data, without torch
    observer = observer or Observer()
    directory = StudyDirectory(location)
    directory.check_empty()
    inputs = _inputs(plan)
    rows = [
        {
            **cell._asdict(),
            SEED: plan.file.seed,
            "identity": _identity(code_version(), inputs, cell),
            "template": _identity(cell),
            "home_key": f"{cell.home} {cell.task}",
            "simulated_s": 0.0,
            "index": number,
            VARIANT: number,
        }
        for number, cell in enumerate(plan.cells)
    ]
    kinds = {VARIANT: pl.Int32, "index": pl.Int32, SEED: pl.Int64, "days": pl.Int64}
    frame = pl.DataFrame(rows, schema_overrides=kinds)
    with directory.locked():
        for problem in drop_damaged(directory.storage):
            observer.on_note(problem)
        results = read_results(directory.storage, columns=(VARIANT, "status"))
        frame = reconcile(frame, directory, results[VARIANT], changed, observer.on_note)
        folder = Path(directory.location) / SOURCES
        if changed == "redo":
            shutil.rmtree(folder, ignore_errors=True)
        _write_plan(directory, plan, frame)
        complete = results.filter(status=COMPLETE)[VARIANT]
        missing = frame.filter(~pl.col(VARIANT).is_in(complete.implode()))
        columns = ("index", VARIANT, "identity", "home_key")
        tasks = [
            CellTask(variant, index, identity, home_key, plan.cells[index])
            for index, variant, identity, home_key in missing.select(columns).iter_rows()
        ]
        sources = Sources(plan, folder)
        unfit = sources.make(sources.names([task.cell for task in tasks]), crew)
        for name, words in unfit.items():
            learning = [task for task in tasks if name in sources.needed(task.cell)]
            tasks = [task for task in tasks if task not in learning]
            plan.unfit[words] = len(learning)
            observer.on_note(f"left out: {words} ({counted(len(learning), 'cell')})")
            frame = frame.filter(~pl.col(VARIANT).is_in([task.number for task in learning]))
        if not len(frame):
            raise ScenarioError("\n".join(["no model can be trained and scored", *unfit.values()]))
        if unfit:
            _write_plan(directory, plan, frame)
            missing = frame.filter(~pl.col(VARIANT).is_in(complete.implode()))
        observer.on_start(Counts(len(frame), len(frame) - len(missing), 0), crew.workers)
        queue = TaskQueue(by_home(tasks))
        job = CellJob(sources)
        with closing(stored_results(directory.storage, crew, job, queue)) as found:
            for result in found:
                observer.on_result(result)
        return Counts.of(write_variants(directory))


def _write_plan(directory: StudyDirectory, plan: TransferPlan, frame: "pl.DataFrame") -> None:
    directory.storage.write_table(PLAN, [frame.drop("index").to_arrow()])
    meta = Meta(
        name=plan.name,
        description="Models trained on simulated and real days, tested on days of real homes",
        code=code_version(),
        columns=COLUMNS,
        populations=("home", SEED),
        tables=(DAYS_TABLE,),
        compare=(
            {
                "metric": "log_loss",
                "against": {"arm": "real"},
                "within": ("task", "learner", "days"),
            },
        ),
        source=plan.source,
        metrics=METRICS,
        notes="\n".join(f"left out: {words} ({n} cells)" for words, n in plan.unfit.items()),
    )
    directory.write_meta(meta)
