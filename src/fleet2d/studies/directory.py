"""The folder of a study: its description, plan and results so far, and the lock of its writer."""

import hashlib
import json
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from pydantic import BaseModel, ConfigDict

from fleet2d.errors import ArtifactError, RunDirectoryError, errors_as, extra
from fleet2d.metrics.limits import limits_of
from fleet2d.storage.files import PARTIAL, FolderLock
from fleet2d.studies.intervals import Limits
from fleet2d.studies.results import VARIANT, check_numbers, read_results
from fleet2d.studies.storage import Storage, writing

if TYPE_CHECKING:
    import polars as pl

FORMAT = 2
COMPLETE = "complete"
FAILED = "failed"
MISSING = "missing"
LOCK = "lock"
META = "study.json"
PLAN = "plan.parquet"
SCENARIOS = "scenarios.parquet"
VARIANTS = "variants.parquet"
PLAN_ONLY = ("identity", "template", "home_key")
"""Columns of the plan that variants don't have, or from their results."""


@dataclass(frozen=True)
class Counts:
    """The progress of a study, in variants.

    Attributes:
        total: The number of its variants.
        complete: The number of variants that are complete.
        failed: The number of variants that failed.
    """

    total: int
    complete: int
    failed: int

    @classmethod
    def of(cls, variants: "pl.DataFrame") -> Self:
        """Count variants by their statuses."""
        statuses = variants["status"]
        complete, failed = (int((statuses == status).sum()) for status in (COMPLETE, FAILED))
        return cls(len(statuses), complete, failed)

    @property
    def missing(self) -> int:
        """The number of variants without results."""
        return self.total - self.complete - self.failed


class MetricFacts(BaseModel):
    """The description of a metric for readers.

    Attributes:
        description: What it measures, in one line.
        unit: The unit of its numbers.
        units: The units of numbers with another one, by the last part of their names.
        least: The least values of numbers by the last part of their names; "" is for all others.
        largest: The largest values, likewise.
        better: Which of two values is better, `higher` or `lower`, by the same names.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    description: str = ""
    unit: str = ""
    units: dict[str, str] = {}
    least: dict[str, float] = {}
    largest: dict[str, float] = {}
    better: dict[str, str] = {}


class Meta(BaseModel):
    """The content of `study.json`.

    Attributes:
        name: The name of the study.
        description: The question that it answers.
        code: The version of the code that runs it.
        columns: The columns of the axes, the seed last.
        populations: The columns whose values are a sample of a population.
        tables: The names of the tables to keep.
        compare: The comparisons that the report shows, as `PairedComparison` takes them.
        source: The study file's text, for readers.
        metrics: The metrics of the scenarios, by name.
        tags: Words to find the study by.
        notes: Remarks of its author, and how many lives of a population are left out.
        fleet: The column with the numbers of the lives of a population; empty without one.
        features: The columns of what was drawn for each life, its seed the last.
        rollout: The rollout, as `Rollout` takes it; None without one.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: str
    description: str
    code: str
    columns: tuple[str, ...]
    populations: tuple[str, ...]
    tables: tuple[str, ...]
    compare: tuple[dict[str, Any], ...] = ()
    source: str = ""
    metrics: dict[str, MetricFacts] = {}
    tags: tuple[str, ...] = ()
    notes: str = ""
    fleet: str = ""
    features: tuple[str, ...] = ()
    rollout: dict[str, Any] | None = None

    def unit(self, metric: str) -> str:
        """Return the unit of a metric such as `ltp_error.ana.tv`; empty if unknown."""
        facts, last = self._facts(metric)
        return facts.units.get(last, facts.unit)

    def with_unit(self, metric: str) -> str:
        """Return a metric with its unit, if it has one, as tables and axes name it."""
        unit = self.unit(metric)
        return f"{metric} [{unit}]" if unit else metric

    def limits(self, metric: str) -> Limits:
        """Return the least and the largest value that a metric can have; a share is 0 to 1."""
        return limits_of(*self._facts(metric))

    def better(self, metric: str) -> str:
        """Return which values of a metric are better: `higher`, `lower`, or empty for neither."""
        facts, last = self._facts(metric)
        return facts.better.get(last, facts.better.get("", ""))

    def _facts(self, metric: str) -> tuple[MetricFacts, str]:
        """Return the facts of a metric, and the last part of its name."""
        names = metric.split(".")
        return self.metrics.get(names[0], MetricFacts()), names[-1]


class StudyDirectory:
    """A study on the disk or in a store.

    Attributes:
        storage: The folder or store of its files.
        scratch: A local folder for the lock.
    """

    def __init__(self, location: str | Path) -> None:
        """Resolve the location; nothing is read or written.

        Raises:
            InputError: polars is not installed.
        """
        with extra("study", "studies need polars"):
            import polars as pl  # noqa: F401 - whether it is there
        self.storage = Storage(location)
        self.scratch = self.storage.folder or _scratch_of(self.storage.location)

    @property
    def location(self) -> str:
        """The folder or store as the user wrote it, without secrets."""
        return self.storage.location

    def exists(self) -> bool:
        """Return whether there is a study."""
        return self.storage.exists(META)

    def check_empty(self) -> None:
        """Refuse a folder that holds something else.

        Raises:
            RunDirectoryError: The folder isn't empty, and holds no study.
        """
        folder = self.storage.folder
        if folder is None or not folder.exists() or self.exists():
            return
        is_folder = folder.is_dir()
        names = {p.name.removesuffix(PARTIAL) for p in folder.iterdir()} if is_folder else {""}
        # A study that was killed while it began has the files that are written before `study.json`.
        if names and not (names <= {LOCK, PLAN, SCENARIOS, META} and names & {LOCK, SCENARIOS}):
            raise RunDirectoryError(
                f"{folder} exists and holds no study: choose another --out or remove it"
            )

    def read_meta(self) -> Meta:
        """Return the description of the study.

        Raises:
            RunDirectoryError: There is no study, its description is damaged, or a later version
                wrote it.
        """
        if not self.exists():
            raise RunDirectoryError(
                f"{self.location} holds no study: give the folder that `fleet2d study run` wrote"
            )
        with self.storage.reading(META):
            content = json.loads(self.storage.read(META))
            version = content.pop("format")
            if isinstance(version, int) and version > FORMAT:
                raise RunDirectoryError(
                    f"{self.location} was written by a later Fleet2D (format {version}): update"
                    " Fleet2D"
                )
            meta = Meta.model_validate(content)
            if unknown := set(meta.populations) - set(meta.columns):
                raise ValueError(f"its populations {', '.join(sorted(unknown))} are no columns")
            return meta

    def write_meta(self, meta: Meta) -> None:
        """Write the description of the study.

        Raises:
            ArtifactError: It can't be written, or holds a Python value that JSON can't hold.
        """
        with errors_as(ArtifactError, "the study can't be described", of=(TypeError, ValueError)):
            content = json.dumps({"format": FORMAT, **meta.model_dump()}, indent=1)
        self.storage.write(META, content.encode())

    def plan(self, kept: Callable[[str], bool] = lambda _: True) -> "pl.DataFrame":
        """Return the plan, or some of its columns: a row for each variant, with its parameters.

        Raises:
            RunDirectoryError: It is missing or damaged.
        """
        frame = self.storage.read_frame(PLAN, (VARIANT, *PLAN_ONLY), kept)
        with self.storage.reading(PLAN):
            check_numbers(frame)
        return frame

    def counts(self) -> Counts:
        """Count the variants by status."""
        return Counts.of(self.variants())

    def scenario(self, number: int) -> dict[str, Any]:
        """Return the scenario of a variant, with its seed.

        Raises:
            RunDirectoryError: The study has no such variant, or its variants are no runs.
        """
        if not self.storage.exists(SCENARIOS):
            raise RunDirectoryError(
                f"the variants of {self.location} are no runs of scenarios: the command that made"
                " them makes them again"
            )
        rows = self.plan().filter(variant=number)
        if not len(rows):
            raise RunDirectoryError(f"{self.location} has no variant {number}")
        scenarios = self.storage.read_frame(SCENARIOS, ("template", "scenario"))
        with self.storage.reading(SCENARIOS):
            (text,) = scenarios.filter(template=rows["template"][0])["scenario"]
            content: dict[str, Any] = json.loads(text)
            content["simulation"]["seed"] = rows["seed"][0]
        return content

    def variants(self) -> "pl.DataFrame":
        """Return parameters, status, times, digest and metrics of all variants.

        Rows are in the order of the design.

        Raises:
            RunDirectoryError: Files are missing or damaged.
        """
        return self._with_results(self.plan(lambda column: column not in PLAN_ONLY))

    def slices(self) -> "Iterator[pl.DataFrame]":
        """Yield some `variants` at a time: all results may need more memory than there is.

        Raises:
            RunDirectoryError: Files are missing or damaged.
        """
        import polars as pl

        with self.storage.parquet(PLAN) as file:
            names = [name for name in file.schema_arrow.names if name not in PLAN_ONLY]
            for number in range(file.num_row_groups):  # a slice is a row group of `write_plan`
                yield self._with_results(pl.from_arrow(file.read_row_group(number, names)))

    def _with_results(self, plan: "pl.DataFrame") -> "pl.DataFrame":
        import polars as pl

        results = read_results(self.storage, plan[VARIANT])
        with self.storage.reading(PLAN):
            joined = plan.join(results, on=VARIANT, how="left", maintain_order="left")
            return joined.with_columns(pl.col("status").fill_null(MISSING))

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Keep other processes from running the same study.

        Raises:
            RunDirectoryError: Another process is running it.
        """
        advice = "wait for it or end it; `fleet2d study status` shows how far it is"
        with writing(self.scratch):
            self.scratch.mkdir(parents=True, exist_ok=True)
            lock = FolderLock(self.scratch, LOCK, advice)
        try:
            yield
        finally:
            lock.release()


def _scratch_of(location: str) -> Path:
    """Return the local folder for the lock of a remote store."""
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    name = hashlib.sha256(location.encode()).hexdigest()[:16]
    return Path(base) / "fleet2d" / "studies" / name
