"""Making a data set: its runs are simulated in worker processes, and stored as shards."""

import hashlib
import json
import shutil
import sys
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pyarrow as pa
import pyarrow.parquet as pq
import yaml

from fleet2d import __version__
from fleet2d.algorithms.presence.belief import AWAY
from fleet2d.datasets.reader import FORMAT, MANIFEST, Dataset, open_dataset
from fleet2d.datasets.specification import (
    PARTS,
    PICTURES,
    DatasetFile,
    DatasetPlan,
    PlannedRun,
    Shard,
    plan_dataset,
)
from fleet2d.datasets.tables import SCHEMAS, tables_of
from fleet2d.errors import InputError
from fleet2d.storage.files import FolderLock, partial_file, write_atomically
from fleet2d.studies.api import map_runs
from fleet2d.studies.progress import progress_bar

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.progress import Progress

    from fleet2d.runs.run import Run


CARD = "README.md"
MAX_VALUES = 12  # of a distribution in a row
TABLES = {
    "runs": "a row for each run: split, home, household, what was varied, seed, digest",
    "rooms": "a row for each room of the home of a run: kind, area, middle",
    "evidence": "what the robot looked at and perceived, minute by minute; the only table that a"
    " model may read",
    "labels": "where each user truly was, where the user went next and at which step, and what the"
    " user did",
    "beliefs": "the belief of the models of real-time presence that ran along",
}
BIASES = (
    "People are simulated: their days are drawn from personas, and repeat more than those of real"
    " people. Nobody visits.",
    "Homes have the rooms and the furniture that the generator, or the floor plans, know of. People"
    " walk the shortest way.",
    "The robot perceives rooms by line of sight and chance. Identities are right unless the"
    " scenario says otherwise.",
    "Rows of a run depend on each other: split and resample by run, or by home, never by row.",
)


def write_card(data: Dataset, file: DatasetFile) -> None:
    """Write the data card of a data set, with pictures if matplotlib is installed."""
    root = data.root
    counts = {split: _count(data, split) for split in data.splits}
    text = [
        f"---\n{yaml.safe_dump(_head(data, file), sort_keys=False)}---\n",
        f"# {file.name}\n",
        f"{file.description or 'Evidence of robots in homes, and where people were.'} Made by"
        f" Fleet2D; licence {file.licence}.\n",
        "## How much\n",
        _table(
            ["split", "runs", "days", "homes", "labels", "rows of evidence"],
            [
                [s, c["runs"], f"{c['days']:g}", c["homes"], c["labels"], c["evidence"]]
                for s, c in counts.items()
            ],
        ),
        "No home, household or persona is in more than one split: this is checked before the first"
        " run. No two runs have the same seed, so no two have the same days.\n",
        "## Tables\n",
        *(
            f"- `{name}`: {words}. Columns: {', '.join(f'`{c}`' for c in SCHEMAS[name].names)}."
            for name, words in TABLES.items()
        ),
        "\n`step` is the last step that a row knows of: join `evidence` up to a step with `labels`"
        " of that step.\n",
        "## Distributions\n",
        *(_distribution(split, c) for split, c in counts.items()),
        *(f"![{words}]({PICTURES}/{name}.png)\n" for name, words in _draw(root, counts).items()),
        "## Known biases\n",
        *(f"- {bias}" for bias in BIASES),
    ]
    write_atomically(root / CARD, "\n".join(text).encode())


def _head(data: Dataset, file: DatasetFile) -> dict[str, Any]:
    """Return the head of the card, which the Hub and `datasets` read."""
    return {
        "license": file.licence.lower(),
        "pretty_name": file.name,
        "configs": [
            {
                "config_name": table,
                "data_files": [
                    {"split": split, "path": f"{split}/{table}-*.parquet"} for split in data.splits
                ],
                **({"default": True} if table == "labels" else {}),
            }
            for table in SCHEMAS
        ],
    }


def _count(data: Dataset, split: str) -> dict[str, Any]:
    """Return how much there is in a split, and how it is distributed."""
    runs = data.arrow("runs", split)
    labels = data.polars("labels", split).group_by("run", "place", maintain_order=True).len()
    rooms = {
        (row["run"], row["room"]): row["kind"] for row in data.arrow("rooms", split).to_pylist()
    }
    kinds: Counter[str] = Counter()
    for run, place, count in labels.collect().iter_rows():
        kinds[rooms.get((run, place), AWAY)] += count
    return {
        "runs": len(runs),
        "days": sum(runs["days"].to_pylist()),
        "homes": len(set(runs["home"].to_pylist())),
        "labels": kinds.total(),
        "evidence": sum(
            record["rows"]
            for name, record in data.manifest["files"].items()
            if name.startswith(f"{split}/evidence-")
        ),
        "household": Counter(runs["household"].to_pylist()),
        "varied": Counter(
            part for text in runs["varied"].to_pylist() for part in text.split("; ") if part
        ),
        "place": kinds,
        "rooms in a home": Counter(str(n) for n in Counter(run for run, _ in rooms).values()),
    }


def _distribution(split: str, counts: Mapping[str, Any]) -> str:
    lines = [f"**{split}**\n"]
    for name in ("household", "varied", "rooms in a home", "place"):
        total = sum(counts[name].values())
        shares = [
            f"{value} {count / total:.0%}" for value, count in counts[name].most_common(MAX_VALUES)
        ]
        if shares:
            lines.append(f"- {name}: {', '.join(shares)}")
    return "\n".join(lines) + "\n"


def _table(head: list[str], rows: list[list[Any]]) -> str:
    """Return a table in Markdown."""
    cells = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(str(cell) for cell in row)} |" for row in cells) + "\n"


def _draw(root: Path, counts: Mapping[str, Mapping[str, Any]]) -> dict[str, str]:
    """Draw where people are, by split; return captions by name, none without matplotlib."""
    try:
        from matplotlib.figure import Figure
    except ImportError:
        return {}
    folder = root / PICTURES
    folder.mkdir(exist_ok=True)
    captions = {}
    for name, words in (
        ("place", "Share of time in each kind of room, and away, by split"),
        ("rooms in a home", "Rooms of the homes, by split"),
    ):
        figure = _bars(Figure(figsize=(8, 3.2), layout="constrained"), counts, name)
        slug = name.replace(" ", "_")
        figure.savefig(folder / f"{slug}.png", dpi=110, metadata={"Software": None})
        captions[slug] = words
    return captions


def _bars(figure: "Figure", counts: Mapping[str, Mapping[str, Any]], name: str) -> "Figure":
    from fleet2d.palette import USER_COLORS

    axes = figure.subplots()
    total: Counter[str] = sum((Counter(c[name]) for c in counts.values()), Counter())
    keys = [key for key, _ in total.most_common(MAX_VALUES)]
    if all(key.isdigit() for key in keys):
        keys.sort(key=int)
    width = 0.8 / len(counts)
    for k, (split, own) in enumerate(counts.items()):
        share = [own[name][key] / max(sum(own[name].values()), 1) for key in keys]
        at = [i + (k - (len(counts) - 1) / 2) * width for i in range(len(keys))]
        axes.bar(at, share, width, label=split, color=USER_COLORS[k % len(USER_COLORS)])
    slanted: dict[str, Any] = {"rotation": 30, "ha": "right"} if name == "place" else {}
    axes.set_xticks(range(len(keys)), keys, **slanted)
    axes.set_ylabel("share")
    axes.set_xlabel(name)
    axes.legend(frameon=False)
    axes.spines[["top", "right"]].set_visible(False)
    return figure


PLAN = "plan.txt"
# Runs that are planned at a time: they are what a data set of any size keeps in memory.
BLOCK_RUNS = 512


def dataset(
    source: str | Path | Mapping[str, Any], out: str | Path, *, workers: int | None = None
) -> Dataset:
    """Make a data set, the rest of one that was interrupted, or files that it lacks, and open it.

    Its content is the same for any number of workers, and after an interruption.

    Args:
        source: A YAML file, or the same as a mapping.
        out: The folder to write.
        workers: The number of worker processes; None: one per core.

    Raises:
        InputError: The file is wrong, its splits overlap, the folder holds something else, or
            files that are lacking can't be made again as they were.
        ComponentError: A run failed.

    Example:
        >>> import fleet2d
        >>> people = {"runs": 1, "homes": [{"synthetic": 1}], "households": [["retired"]]}
        >>> made = fleet2d.dataset({"splits": {"train": people}}, "small")  # doctest: +SKIP
    """
    plan, root = plan_dataset(source), Path(out)
    parts, made = root / PARTS, None
    if (root / MANIFEST).is_file():
        made = open_dataset(root)
        if made.manifest["plan"] != plan.digest:
            raise InputError(f"{root} holds another data set: choose another folder, or delete it")
        if not made.lacking():
            return made
    elif root.exists() and any(root.iterdir()) and not parts.is_dir():
        raise InputError(f"{root} is not empty, and holds no data set: choose another folder")
    parts.mkdir(parents=True, exist_ok=True)
    lock = FolderLock(parts, "dataset.lock")
    try:
        _check_plan(parts, plan)
        if made is not None:
            _record_shards(parts, plan, made)
        with progress_bar(show=sys.stderr.isatty()) as bar:
            files = _write_shards(root, parts, plan, workers, bar)
        if made is None:
            _finish(root, plan, files)
    finally:
        lock.release()
    shutil.rmtree(parts)
    if made is not None and files != made.manifest["files"]:
        raise InputError(
            f"{root}: files that were lacking differ now from those that were written, by other"
            " versions of libraries (see --verify): delete the data set, and make it again"
        )
    return open_dataset(root)


def _record_shards(parts: Path, plan: DatasetPlan, made: Dataset) -> None:
    """Record the shards of a complete data set, so that only those that lack a file are made."""
    version = made.manifest["versions"]["fleet2d"]
    if version != __version__:
        raise InputError(
            f"{made.root} lacks {made.lacking()[0]}, which Fleet2D {version} can make again; this"
            f" is {__version__}"
        )
    for shard in plan.shards():
        names = [
            path.relative_to(made.root).as_posix() for path in _files_of(made.root, shard).values()
        ]
        record = {name: made.manifest["files"][name] for name in names}
        write_atomically(_record_path(parts, shard), json.dumps(record).encode())


def _check_plan(parts: Path, plan: DatasetPlan) -> None:
    """Refuse to continue a data set of another file or version; begin one."""
    path, identity = parts / PLAN, f"{plan.digest} {__version__}"
    if path.is_file() and path.read_text() != identity:
        raise InputError(
            f"{parts.parent} holds the unfinished data set of another file, or another version of"
            " Fleet2D: choose another folder, or delete it"
        )
    write_atomically(path, identity.encode())


def _write_shards(
    root: Path, parts: Path, plan: DatasetPlan, workers: int | None, bar: "Progress | None"
) -> dict[str, dict[str, Any]]:
    """Simulate the runs that are lacking, block by block; return the record of each file."""
    total = sum(split.runs for split in plan.file.splits.values())
    task = bar.add_task("runs", total=total) if bar else None

    def advance(runs: int = 1) -> None:
        if bar is not None and task is not None:
            bar.advance(task, runs)

    files: dict[str, dict[str, Any]] = {}
    block: list[Shard] = []
    for shard in plan.shards():
        record = _record_of(root, parts, shard)
        if record:
            files |= record
            advance(shard.end - shard.first)
            continue
        block.append(shard)
        if sum(each.end - each.first for each in block) >= BLOCK_RUNS:
            files |= _write_block(root, parts, plan, block, workers, advance)
            block = []
    return files | _write_block(root, parts, plan, block, workers, advance)


def _write_block(
    root: Path,
    parts: Path,
    plan: DatasetPlan,
    block: Sequence[Shard],
    workers: int | None,
    advance: Callable[[int], None],
) -> dict[str, dict[str, Any]]:
    """Simulate the runs of some shards that have no part yet, then join the parts to shards."""
    runs = {
        shard: [plan.run(shard.split, k) for k in range(shard.first, shard.end)] for shard in block
    }
    lacking = [
        run for own in runs.values() for run in own if not (parts / _part_name(run)).is_file()
    ]
    advance(sum(map(len, runs.values())) - len(lacking))
    writer = PartWriter(str(parts), {run.seed: run for run in lacking}, plan.file.labels)
    map_runs(
        writer,
        [run.scenario for run in lacking],
        workers=workers,
        on_result=lambda _: advance(1),
    )
    files: dict[str, dict[str, Any]] = {}
    for shard, own in runs.items():
        made = _join(root, parts, shard, own)
        write_atomically(_record_path(parts, shard), json.dumps(made).encode())
        files |= made
        for run in own:
            (parts / _part_name(run)).unlink()
    return files


def _record_path(parts: Path, shard: Shard) -> Path:
    return parts / f"{shard.split}-{shard.number:05}.json"


def _record_of(root: Path, parts: Path, shard: Shard) -> dict[str, dict[str, Any]]:
    """Return the record of a shard that was written whole, else nothing."""
    paths = {path.relative_to(root).as_posix(): path for path in _files_of(root, shard).values()}
    try:
        record: dict[str, dict[str, Any]] = json.loads(_record_path(parts, shard).read_text())
        sizes = {name: record[name]["bytes"] for name in paths}
        is_whole = all(path.stat().st_size == sizes[name] for name, path in paths.items())
    except (OSError, ValueError, LookupError, TypeError):
        return {}
    return {name: record[name] for name in paths} if is_whole else {}


def _files_of(root: Path, shard: Shard) -> dict[str, Path]:
    """Return the file of each table of a shard."""
    return {name: root / shard.split / f"{name}-{shard.number:05}.parquet" for name in SCHEMAS}


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
            for name in SCHEMAS:
                with pa.ipc.new_stream(file, tables[name].schema) as stream:
                    stream.write_table(tables[name])


def _join(
    root: Path, parts: Path, shard: Shard, runs: Sequence[PlannedRun]
) -> dict[str, dict[str, Any]]:
    """Write the tables of a shard from the parts of its runs; return a record of each file."""
    tables: dict[str, list[pa.Table]] = {name: [] for name in SCHEMAS}
    for run in runs:
        part = parts / _part_name(run)
        try:
            with pa.OSFile(str(part), "rb") as file:
                for name in SCHEMAS:
                    tables[name].append(pa.ipc.open_stream(file).read_all())
        except (OSError, pa.ArrowException) as error:
            part.unlink(missing_ok=True)
            raise InputError(
                f"{part} was damaged, and is deleted ({error}): run the same command again"
            ) from None
    records = {}
    for name, path in _files_of(root, shard).items():
        path.parent.mkdir(exist_ok=True)
        table = pa.concat_tables(tables[name]).unify_dictionaries()
        with partial_file(path) as partial:
            pq.write_table(table, partial, **_encoding(table))
        content = path.read_bytes()
        records[path.relative_to(root).as_posix()] = {
            "rows": table.num_rows,
            "bytes": len(content),
            "sha256": hashlib.sha256(content).hexdigest(),
        }
    return records


def _encoding(table: pa.Table) -> dict[str, Any]:
    """Return how a table is stored: steps and times as differences, texts by their values.

    Most rows follow the one before by the same time, so this takes a third less room. The values of
    a belief hardly repeat: their bytes are stored one place after the other.
    """
    moments = {"step", "next_step", "time"} & {*table.column_names}
    beliefs = {"probability"} & {*table.column_names}
    return {
        "compression": "zstd",
        "compression_level": 3,
        "column_encoding": {
            **dict.fromkeys(moments, "DELTA_BINARY_PACKED"),
            **dict.fromkeys(beliefs, "BYTE_STREAM_SPLIT"),
        },
        "use_dictionary": [
            name for name in table.column_names if name not in moments and name not in beliefs
        ],
        "write_statistics": ["run", "step"],  # by which readers leave out parts of a file
        "store_schema": False,  # that of the dictionaries: readers get texts
    }


def _finish(root: Path, plan: DatasetPlan, files: Mapping[str, Mapping[str, Any]]) -> None:
    """Write the data card, then the manifest: a data set with one is complete."""
    from fleet2d.artifacts.manifest import versions

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
