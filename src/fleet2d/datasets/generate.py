"""Making a data set: its runs are simulated in worker processes, and stored as shards."""

import hashlib
import json
import shutil
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from datetime import timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pyarrow as pa
import pyarrow.parquet as pq

from fleet2d.datasets.reader import FORMAT, MANIFEST, Dataset, open_dataset
from fleet2d.datasets.specification import DatasetPlan, PlannedRun, plan_dataset
from fleet2d.datasets.tables import SCHEMAS, tables_of
from fleet2d.errors import InputError
from fleet2d.storage.files import FolderLock, partial_file, write_atomically
from fleet2d.studies.api import map_runs

if TYPE_CHECKING:
    from fleet2d.runs.run import Run

PARTS = "unfinished"
PLAN = "plan.json"


def dataset(
    source: str | Path | Mapping[str, Any], out: str | Path, *, workers: int | None = None
) -> Dataset:
    """Make a data set, or the rest of one that was interrupted, and open it.

    Its content is the same for any number of workers, and after an interruption.

    Args:
        source: A YAML file, or the same as a mapping.
        out: The folder to write.
        workers: The number of worker processes; None: one per core.

    Raises:
        InputError: The file is wrong, its splits overlap, or the folder holds something else.
        ComponentError: A run failed.

    Example:
        >>> import fleet2d
        >>> people = {"runs": 1, "homes": [{"synthetic": 1}], "households": [["retired"]]}
        >>> made = fleet2d.dataset({"splits": {"train": people}}, "small")  # doctest: +SKIP
    """
    plan, root = plan_dataset(source), Path(out)
    if (root / MANIFEST).is_file():
        made = open_dataset(root)
        if made.manifest["plan"] == plan.digest:
            return made
        raise InputError(f"{root} holds another data set: choose another folder, or delete it")
    if root.exists() and any(root.iterdir()) and not (root / PARTS).is_dir():
        raise InputError(f"{root} is not empty, and holds no data set: choose another folder")
    parts = root / PARTS
    parts.mkdir(parents=True, exist_ok=True)
    lock = FolderLock(parts, "dataset.lock")
    try:
        _check_plan(parts, plan)
        files = _write_shards(root, parts, plan, workers)
        _finish(root, plan, files)
    finally:
        lock.release()
    shutil.rmtree(parts)
    return open_dataset(root)


def _check_plan(parts: Path, plan: DatasetPlan) -> None:
    """Refuse to continue a data set of another file; begin one."""
    path = parts / PLAN
    if path.is_file() and path.read_text() != plan.digest:
        raise InputError(
            f"{parts.parent} holds the unfinished data set of another file: choose another folder,"
            " or delete it"
        )
    write_atomically(path, plan.digest.encode())


def _write_shards(
    root: Path, parts: Path, plan: DatasetPlan, workers: int | None
) -> dict[str, dict[str, Any]]:
    """Simulate the runs that have no part yet, then join the parts; return each file's record."""
    shards = list(plan.shards())
    lacking = [
        run
        for split, number, runs in shards
        if not _is_whole(root, parts, split, number)
        for run in runs
        if not (parts / _part_name(run)).is_file()
    ]
    by_seed = {run.seed: run for run in lacking}
    writer = PartWriter(str(parts), by_seed, plan.file.labels)
    map_runs(writer, [run.scenario for run in lacking], workers=workers)
    files: dict[str, dict[str, Any]] = {}
    for split, number, runs in shards:
        record = parts / f"{split}-{number:05}.json"
        if not _is_whole(root, parts, split, number):
            made = _join(root, parts, split, number, runs)
            write_atomically(record, json.dumps(made).encode())
        files |= json.loads(record.read_text())
        for run in runs:
            with suppress(FileNotFoundError):
                (parts / _part_name(run)).unlink()
    return files


def _is_whole(root: Path, parts: Path, split: str, number: int) -> bool:
    """Whether a shard was written, and its files have their lengths."""
    record = parts / f"{split}-{number:05}.json"
    if not record.is_file():
        return False
    files: dict[str, dict[str, Any]] = json.loads(record.read_text())
    return all(
        (root / name).is_file() and (root / name).stat().st_size == file["bytes"]
        for name, file in files.items()
    )


def _part_name(run: PlannedRun) -> str:
    return f"{run.number:06}.arrow"


@dataclass
class PartWriter:
    """Writes what a data set stores of a run, in the process that simulated it.

    Attributes:
        folder: The folder of parts.
        runs: The planned runs, by seed.
        labels: Time between labels.
    """

    folder: str
    runs: Mapping[int, PlannedRun]
    labels: timedelta

    def __call__(self, run: "Run") -> None:
        """Write the tables of a run, one after the other, as streams of one file."""
        planned = self.runs[int(run.manifest["seed"])]
        tables = tables_of(run, planned, self.labels)
        with (
            partial_file(Path(self.folder) / _part_name(planned)) as path,
            pa.OSFile(str(path), "wb") as file,
        ):
            for name, schema in SCHEMAS.items():
                with pa.ipc.new_stream(file, schema) as stream:
                    stream.write_table(tables[name])


def _join(
    root: Path, parts: Path, split: str, number: int, runs: tuple[PlannedRun, ...]
) -> dict[str, dict[str, Any]]:
    """Write the tables of a shard from the parts of its runs; return a record of each file."""
    tables: dict[str, list[pa.Table]] = {name: [] for name in SCHEMAS}
    for run in runs:
        with pa.OSFile(str(parts / _part_name(run)), "rb") as file:
            for name in SCHEMAS:
                tables[name].append(pa.ipc.open_stream(file).read_all())
    records = {}
    for name, rows in tables.items():
        path = root / split / f"{name}-{number:05}.parquet"
        path.parent.mkdir(exist_ok=True)
        table = pa.concat_tables(rows)
        with partial_file(path) as partial:
            pq.write_table(table, partial, compression="zstd", compression_level=9)
        content = path.read_bytes()
        records[path.relative_to(root).as_posix()] = {
            "rows": table.num_rows,
            "bytes": len(content),
            "sha256": hashlib.sha256(content).hexdigest(),
        }
    return records


def _finish(root: Path, plan: DatasetPlan, files: Mapping[str, Mapping[str, Any]]) -> None:
    """Write the data card, then the manifest: a data set with one is complete."""
    from fleet2d.artifacts.manifest import versions
    from fleet2d.datasets.card import write_card

    manifest = {
        "format": FORMAT,
        "name": plan.file.name,
        "plan": plan.digest,
        "versions": versions(),
        "splits": {name: split.runs for name, split in plan.file.splits.items()},
        "file": plan.file.model_dump(mode="json"),
        "files": files,
    }
    write_card(Dataset(root, manifest), plan.file)
    write_atomically(root / MANIFEST, json.dumps(manifest, indent=1, default=str).encode())
