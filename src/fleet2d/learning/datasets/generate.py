"""Making a data set: its runs are simulated in worker processes, and stored as shards."""

import hashlib
import itertools
import json
import shutil
from collections import Counter
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from contextlib import closing
from dataclasses import replace
from datetime import timedelta
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pyarrow as pa
import pyarrow.parquet as pq
import yaml

from fleet2d import __version__
from fleet2d.algorithms.presence.belief import AWAY
from fleet2d.artifacts.manifest import read_json, versions
from fleet2d.bounds import FILE_BYTES, read_bytes
from fleet2d.configuration.problems import counted
from fleet2d.errors import Fleet2DError, InputError, ScenarioError
from fleet2d.learning.datasets.reader import (
    MANIFEST,
    Dataset,
    DatasetManifest,
    ShardRecord,
    open_dataset,
)
from fleet2d.learning.datasets.specification import (
    PARTS,
    PICTURES,
    DatasetFile,
    DatasetPlan,
    PlannedRun,
    Shard,
    plan_dataset,
)
from fleet2d.learning.datasets.tables import SCHEMAS, tables_of
from fleet2d.runtime.progress import progress_bar
from fleet2d.scenario.load import load_scenario
from fleet2d.storage.files import FolderLock, partial_file, refuse_links, write_atomically
from fleet2d.studies.api import ExecutorName, FunctionTask, map_runs, open_crew
from fleet2d.studies.design import code_version, home_key
from fleet2d.studies.executors import TaskQueue, by_home, run_tasks
from fleet2d.studies.simulator import check_setup

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from fleet2d.runs.run import Run


CARD = "README.md"
# The number of values of a distribution in a row.
MAX_VALUES = 12
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


def write_card(data: Dataset, file: DatasetFile, left_out: Sequence[str] = ()) -> None:
    """Write the data card of a data set, with pictures if matplotlib is installed.

    Args:
        data: The data set.
        file: Its file.
        left_out: The lives that its conditions left out, a line for each split.
    """
    root = data.root
    counts = {split: _count(data, split) for split in data.splits}
    rows = [
        [split, c["runs"], f"{c['days']:g}", c["homes"], c["labels"], c["evidence"]]
        for split, c in counts.items()
    ]
    text = [
        f"---\n{yaml.safe_dump(_head(data, file), sort_keys=False)}---\n",
        f"# {file.name}\n",
        f"{file.description or 'Evidence of robots in homes, and where people were.'} Made by"
        f" Fleet2D; licence {file.licence}.\n",
        "## How much\n",
        markdown_table(["split", "runs", "days", "homes", "labels", "rows of evidence"], rows),
        *(f"Left out: {text}\n" for text in dict.fromkeys(data.manifest.unfit.values())),
        "No home, household or persona is in more than one split: this is checked before the first"
        " run. No two runs have the same seed, so no two have the same days.\n",
        "## Tables\n",
        *(f"- `{name}`: {words}. Columns: {_columns_of(name)}." for name, words in TABLES.items()),
        "\n`step` is the last step that a row knows of: join `evidence` up to a step with `labels`"
        " of that step.\n",
        "## Distributions\n",
        *(f"{line}\n" for line in left_out),
        *(_distribution(split, count) for split, count in counts.items()),
        *(f"![{words}]({PICTURES}/{name}.png)\n" for name, words in _draw(root, counts).items()),
        "## Known biases\n",
        *(f"- {bias}" for bias in BIASES),
    ]
    write_atomically(root / CARD, "\n".join(text).encode())


def _head(data: Dataset, file: DatasetFile) -> dict[str, Any]:
    """Return the head of the card, which the Hub and `datasets` read."""
    configs = []
    for table in SCHEMAS:
        files = [{"split": name, "path": f"{name}/{table}-*.parquet"} for name in data.splits]
        config: dict[str, Any] = {"config_name": table, "data_files": files}
        if table == "labels":
            config["default"] = True
        configs.append(config)
    return {"license": file.licence.lower(), "pretty_name": file.name, "configs": configs}


def _columns_of(table: str) -> str:
    return ", ".join(f"`{name}`" for name in SCHEMAS[table].names)


def _count(data: Dataset, split: str) -> dict[str, Any]:
    """Return the size of a split, and the distribution of its values."""
    runs = data.arrow("runs", split)
    labels = data.arrow("labels", split).group_by(["run", "place"], use_threads=False)
    rooms = {
        (row["run"], row["room"]): row["kind"] for row in data.arrow("rooms", split).to_pylist()
    }
    files = data.manifest.files
    evidence = f"{split}/evidence-"
    kinds: Counter[str] = Counter()
    for row in labels.aggregate([([], "count_all")]).to_pylist():
        kind = rooms.get((row["run"], row["place"]), AWAY)
        kinds[kind] += row["count_all"]
    sizes = Counter(run for run, _ in rooms).values()
    varied = "; ".join(runs["varied"].to_pylist()).split("; ")
    return {
        "runs": len(runs),
        "days": sum(runs["days"].to_pylist()),
        "homes": len(set(runs["home"].to_pylist())),
        "labels": kinds.total(),
        "evidence": sum(files[name].rows for name in files if name.startswith(evidence)),
        "household": Counter(runs["household"].to_pylist()),
        "varied": Counter(filter(None, varied)),
        "place": kinds,
        "rooms in a home": Counter(map(str, sizes)),
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


def markdown_table(head: Sequence[str], rows: Sequence[Sequence[Any]]) -> str:
    """Return a table in Markdown."""
    lines = [head, ["---"] * len(head), *rows]
    return "".join(f"| {' | '.join(map(str, cells))} |\n" for cells in lines)


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
        number = max(sum(own[name].values()), 1)
        share = [own[name][key] / number for key in keys]
        shift = (k - (len(counts) - 1) / 2) * width
        at = [i + shift for i in range(len(keys))]
        axes.bar(at, share, width, label=split, color=USER_COLORS[k % len(USER_COLORS)])
    slanted: dict[str, Any] = {"rotation": 30, "ha": "right"} if name == "place" else {}
    axes.set_xticks(range(len(keys)), keys, **slanted)
    axes.set_ylabel("share")
    axes.set_xlabel(name)
    axes.legend(frameon=False)
    axes.spines[["top", "right"]].set_visible(False)
    return figure


PLAN = "plan.txt"
UNFIT = "unfit"  # the file with the runs that are left out
# The number of reasons that an error lists.
MAX_REASONS = 20
# The number of runs planned at a time, which a data set of any size keeps in memory.
BLOCK_RUNS = 512


def dataset(
    source: str | Path | Mapping[str, Any],
    out: str | Path,
    *,
    workers: int | None = None,
    executor: ExecutorName | Executor = "local",
) -> Dataset:
    """Make a data set or the files that it lacks, such as after an interruption, and open it.

    Its content is the same for any number of workers, and after an interruption.

    Args:
        source: A YAML file, or the same as a mapping.
        out: The folder to write.
        workers: The number of worker processes; None: one per core.
        executor: Where they run, as for `map_runs`.

    Raises:
        InputError: The file is wrong, its splits overlap, the folder holds something else, or
            missing files can't be made again as they were.
        ComponentError: A run failed.

    Example:
        >>> import fleet2d
        >>> people = {"runs": 1, "homes": [{"synthetic": 1}], "households": [["retired"]]}
        >>> made = fleet2d.dataset({"splits": {"train": people}}, "small")  # doctest: +SKIP
    """
    with open_crew(executor, workers) as crew:
        plan = plan_dataset(source, crew)
    root = Path(out)
    parts = root / PARTS
    made = None
    refuse_links(root, (PARTS, PICTURES, *plan.file.splits))
    if (root / MANIFEST).is_file():
        made = open_dataset(root)
        if made.manifest.plan != plan.digest:
            raise InputError(f"{root} holds another data set: choose another folder, or delete it")
        if not made.lacking():
            return made
        plan = replace(plan, unfit=_by_number(made.manifest.unfit))
    elif root.exists() and any(root.iterdir()) and not parts.is_dir():
        raise InputError(f"{root} is not empty, and holds no data set: choose another folder")
    else:
        plan = _without_unfit(plan, parts, workers, executor)
    parts.mkdir(parents=True, exist_ok=True)
    lock = FolderLock(parts, "dataset.lock")
    try:
        _check_plan(parts, plan)
        if made is not None:
            _record_shards(plan, made)
        files = _write_shards(root, plan, workers, executor)
        if made is None:
            _finish(root, plan, files)
    finally:
        lock.release()
    shutil.rmtree(parts)
    if made is not None and files != made.manifest.files:
        raise InputError(
            f"{root}: files that were lacking differ now from those that were written, by other"
            " code or versions of libraries (see --verify): delete the data set, and make it again"
        )
    return open_dataset(root)


def check_dataset(
    source: str | Path | Mapping[str, Any],
    out: str | Path,
    *,
    workers: int | None = None,
    executor: ExecutorName | Executor = "local",
) -> None:
    """Check a data set in its folder, so that `dataset` begins with its runs.

    Args:
        source: A YAML file, or the same as a mapping.
        out: The folder.
        workers: The number of worker processes; None: one per core.
        executor: Where they run, as for `map_runs`.

    Raises:
        InputError: As for `dataset`.
    """
    root = Path(out)
    if (root / MANIFEST).is_file():
        return
    parts = root / PARTS
    with open_crew(executor, workers) as crew:
        plan = plan_dataset(source, crew)
    plan = _without_unfit(plan, parts, workers, executor)
    parts.mkdir(parents=True, exist_ok=True)
    lock = FolderLock(parts, "dataset.lock")
    try:
        _check_plan(parts, plan)
    finally:
        lock.release()


def _record_shards(plan: DatasetPlan, made: Dataset) -> None:
    """Record the shards of a complete data set, so that only those that lack a file are made."""
    version = made.manifest.versions.get("fleet2d")
    if version != __version__:
        raise InputError(
            f"{made.root} lacks {made.lacking()[0]}, which Fleet2D {version} can make again; this"
            f" is {__version__}"
        )
    for shard in plan.shards():
        record = {name: made.manifest.files[name] for name in _files_of(shard).values()}
        _write_record(made.root, shard, record)


def _identity(plan: DatasetPlan) -> bytes:
    return f"{plan.digest} {code_version()}".encode()


def _check_plan(parts: Path, plan: DatasetPlan) -> None:
    """Refuse to continue a data set of another file or version; begin a new one."""
    path = parts / PLAN
    has_runs = any(parts.glob("*.arrow")) or any(parts.glob("*-*.json"))
    if path.is_file() and read_bytes(path, FILE_BYTES) != _identity(plan) and has_runs:
        raise InputError(
            f"{parts.parent} holds the unfinished data set of another file, or another version of"
            " Fleet2D: choose another folder, or delete it"
        )
    write_atomically(parts / UNFIT, json.dumps(plan.unfit).encode())
    write_atomically(path, _identity(plan))


def _by_number(stored: Mapping[str, str]) -> dict[int, str]:
    return {int(number): why for number, why in stored.items()}


def _without_unfit(
    plan: DatasetPlan, parts: Path, workers: int | None, executor: ExecutorName | Executor
) -> DatasetPlan:
    """Set up each home with each of its households, before the first run and before any file.

    Raises:
        ScenarioError: People don't fit into homes, and `skip` is left out; a line for each.
    """
    path = parts / PLAN
    is_checked = path.is_file() and read_bytes(path, FILE_BYTES) == _identity(plan)
    if is_checked and (parts / UNFIT).is_file():
        return replace(plan, unfit=_by_number(read_json(read_bytes(parts / UNFIT, FILE_BYTES))))
    first_of: dict[tuple[str, str], PlannedRun] = {}
    same_as: dict[int, int] = {}
    for split in plan.file.splits:
        for run in plan.runs(split):
            key = json.dumps([split, run.scenario["floorplan"], run.scenario["users"]], default=str)
            same_as[run.number] = first_of.setdefault((split, key), run).number
    reasons = _set_up(list(first_of.values()), workers, executor)
    unfit = {number: reasons[first] for number, first in same_as.items() if first in reasons}
    if unfit and plan.file.skip is None:
        lines = list(dict.fromkeys(unfit.values()))
        more = [f"… and {len(lines) - MAX_REASONS} more"] if len(lines) > MAX_REASONS else []
        advice = f"{counted(len(unfit), 'run')} can't be simulated; `skip: unfit` leaves them out"
        raise ScenarioError("\n".join([advice, *lines[:MAX_REASONS], *more]))
    fit = replace(plan, unfit=unfit)
    if empty := [split for split in plan.file.splits if not fit.count(split)]:
        raise ScenarioError(f"no run of {empty[0]} is fit: {next(iter(unfit.values()))}")
    return fit


def _set_up(
    runs: Sequence[PlannedRun], workers: int | None, executor: ExecutorName | Executor
) -> dict[int, str]:
    """Return why runs can't be set up, by number, with their homes and households."""
    tasks = [
        FunctionTask(k, k, "", home_key(run.scenario), run.scenario) for k, run in enumerate(runs)
    ]
    reasons = {}
    with (
        progress_bar(show=True) as bar,
        open_crew(executor, workers) as crew,
        closing(run_tasks(crew, set_up_problem, TaskQueue(by_home(tasks)))) as rounds,
    ):
        bar_task = bar.add_task("checking homes", total=len(tasks))
        for end in itertools.chain.from_iterable(rounds):
            bar.advance(bar_task)
            if why := end.loss or end.payload:
                run = runs[end.task.number]
                words = f"{run.split}, home {run.labels['home']}, {run.labels['household']}"
                reasons[run.number] = f"{words}: {why}"
    return reasons


def set_up_problem(task: FunctionTask) -> str:
    """Set a run up in a worker process; return why it fails, or an empty text."""
    try:
        check_setup(load_scenario(task.scenario))
    except Fleet2DError as error:
        return str(error)
    return ""


def _write_shards(
    root: Path, plan: DatasetPlan, workers: int | None, executor: ExecutorName | Executor
) -> dict[str, ShardRecord]:
    """Simulate the missing runs, block by block; return the record of each file."""
    records = {shard: _record_of(root, shard) for shard in plan.shards()}
    lacking = [shard for shard, record in records.items() if not record]
    size = max(1, BLOCK_RUNS // plan.file.runs_per_shard)
    total = sum(len(shard.runs) for shard in records)
    left = sum(len(shard.runs) for shard in lacking)
    with progress_bar(show=True) as bar:
        task = bar.add_task("runs", total=total, completed=total - left)
        for begin in range(0, len(lacking), size):
            runs = {shard: plan.runs_of(shard) for shard in lacking[begin : begin + size]}
            planned = [*itertools.chain.from_iterable(runs.values())]
            new = [run for run in planned if not _part_path(root, run).is_file()]
            bar.advance(task, len(planned) - len(new))
            by_seed = {run.seed: run for run in new}
            writer = partial(write_part, root, by_seed, plan.file.labels)
            scenarios = [run.scenario for run in new]
            map_runs(
                writer,
                scenarios,
                workers=workers,
                executor=executor,
                on_result=lambda _: bar.advance(task),
            )
            records |= {shard: _join(root, shard, own) for shard, own in runs.items()}
    return {name: file for record in records.values() for name, file in record.items()}


def _record_path(root: Path, shard: Shard) -> Path:
    return root / PARTS / f"{shard.split}-{shard.number:05}.json"


def _record_of(root: Path, shard: Shard) -> dict[str, ShardRecord]:
    """Return the record of a shard that was written whole, else nothing."""
    try:
        stored = read_json(read_bytes(_record_path(root, shard), FILE_BYTES))
        names = _files_of(shard).values()
        record = {name: ShardRecord.model_validate(stored[name]) for name in names}
        is_whole = all((root / n).stat().st_size == file.bytes for n, file in record.items())
    except (OSError, ValueError, LookupError, TypeError):
        return {}
    return record if is_whole else {}


def _write_record(root: Path, shard: Shard, record: Mapping[str, ShardRecord]) -> None:
    """Record that the files of a shard are whole."""
    content = {name: file.model_dump() for name, file in record.items()}
    write_atomically(_record_path(root, shard), json.dumps(content).encode())


def _files_of(shard: Shard) -> dict[str, str]:
    """Return the name of the file of each table of a shard."""
    return {table: f"{shard.split}/{table}-{shard.number:05}.parquet" for table in SCHEMAS}


def _part_path(root: Path, run: PlannedRun) -> Path:
    return root / PARTS / f"{run.number:06}.arrow"


def write_part(
    root: Path, planned: Mapping[int, PlannedRun], labels: timedelta, run: "Run"
) -> None:
    """Write the tables of a run that a data set stores, in the process that simulated it.

    The tables come one after the other, as streams of one file.

    Args:
        root: The folder of the data set.
        planned: The planned runs, by seed.
        labels: Time between labels.
        run: The run.
    """
    own = planned[int(run.manifest["seed"])]
    tables = tables_of(run, own, labels)
    with partial_file(_part_path(root, own)) as path, pa.OSFile(str(path), "wb") as file:
        for name in SCHEMAS:
            with pa.ipc.new_stream(file, tables[name].schema) as stream:
                stream.write_table(tables[name])


def _join(root: Path, shard: Shard, runs: Sequence[PlannedRun]) -> dict[str, ShardRecord]:
    """Turn the parts of some runs into the files of a shard; return a record of each file."""
    tables: dict[str, list[pa.Table]] = {name: [] for name in SCHEMAS}
    parts = [_part_path(root, run) for run in runs]
    for part in parts:
        try:
            with pa.OSFile(str(part), "rb") as file:
                for name, schema in SCHEMAS.items():
                    table = pa.ipc.open_stream(file).read_all()
                    table.cast(schema)
                    tables[name].append(table)
        except (OSError, ValueError, pa.ArrowException) as error:
            part.unlink(missing_ok=True)
            raise InputError(
                f"{part} was damaged, and is deleted ({error}): run the same command again"
            ) from None
    record = {}
    for table_name, name in _files_of(shard).items():
        path = root / name
        path.parent.mkdir(exist_ok=True)
        table = pa.concat_tables(tables[table_name]).unify_dictionaries()
        with partial_file(path) as partial:
            pq.write_table(table, partial, **_encoding(table))
        content = path.read_bytes()
        digest = hashlib.sha256(content).hexdigest()
        record[name] = ShardRecord(rows=table.num_rows, bytes=len(content), sha256=digest)
    _write_record(root, shard, record)
    for part in parts:
        part.unlink()
    return record


def _encoding(table: pa.Table) -> dict[str, Any]:
    """Return the options to store a table: steps and times as differences, texts as dictionaries.

    Steps mostly grow by the same amount, so this takes a third less room. Beliefs hardly repeat:
    their bytes are stored plane by plane.
    """
    columns = table.column_names
    moments = {"step", "next_step", "time"}.intersection(columns)
    beliefs = {"probability"}.intersection(columns)
    return {
        "compression": "zstd",
        "compression_level": 3,
        "column_encoding": {
            **dict.fromkeys(moments, "DELTA_BINARY_PACKED"),
            **dict.fromkeys(beliefs, "BYTE_STREAM_SPLIT"),
        },
        "use_dictionary": [name for name in columns if name not in moments | beliefs],
        "write_statistics": ["run", "step"],  # readers skip parts of a file by them
        "store_schema": False,  # it would give readers dictionaries in place of texts
    }


def _finish(root: Path, plan: DatasetPlan, files: Mapping[str, ShardRecord]) -> None:
    """Write the data card, then the manifest: a data set with one is complete."""
    manifest = DatasetManifest(
        name=plan.file.name,
        plan=plan.digest,
        versions=versions(),
        splits={name: plan.count(name) for name in plan.file.splits},
        unfit={str(number): why for number, why in plan.unfit.items()},
        file=plan.file.model_dump(mode="json"),
        files=dict(files),
    )
    write_card(Dataset(root, manifest), plan.file, plan.left_out)
    write_atomically(root / MANIFEST, manifest.model_dump_json(indent=1).encode())
