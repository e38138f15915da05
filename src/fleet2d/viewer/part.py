"""A part of a run as a run of its own, so that all that shows runs can show parts."""

from collections.abc import Mapping
from datetime import timedelta
from typing import Any

import numpy as np

from fleet2d.artifacts.manifest import Manifest
from fleet2d.errors import ArtifactError
from fleet2d.kernels import I64
from fleet2d.runs.run import Run, categories
from fleet2d.viewer.moments import clock_of

KEY_FRAMES = "key_frames"


def part_of_run(run: Run, first: int, end: int) -> Run:
    """Return the part of a run from step `first` to before step `end`, in memory.

    Its steps count from 0, it has no metrics, and it can't be reproduced. Random walks become
    positions.

    Args:
        run: The run.
        first: Its first step.
        end: The step before which it ends.

    Raises:
        ArtifactError: A table is damaged.
    """
    clock = clock_of(run)
    if (first, end) == (0, clock.steps):
        return run
    content = {
        **run.manifest,
        "start": clock.time(first).isoformat(),
        "steps": end - first,
        "simulated_s": (end - first) * clock.step_us / 1e6,
        "metrics": {},
        "tables": {},
        "digest": None,
    }
    names = [name for name in run.tables if not name.startswith("layer.")]
    tables = {name: _cut(run, name, first, end) for name in names}
    part = Run(None, Manifest(**_fields(content)), names, tables.__getitem__)
    part.plan = run.plan
    return part


def key_frame_rows(table: Any, first: int, end: int) -> I64:
    """Return the rows of a table of key frames that define the poses between two steps."""
    step = table["step"].to_numpy()
    entity, names = categories(table["entity"])
    kind, kinds = categories(table["kind"])
    reached = kind != (kinds.index("planned") if "planned" in kinds else len(kinds))
    selected = np.zeros(len(step), np.bool_)
    for code in range(len(names)):
        rows = np.flatnonzero(entity == code)
        rows_before = rows[(step[rows] <= first) & reached[rows]]
        rows_after = rows[step[rows] >= end]
        low = rows_before[-1] if len(rows_before) else rows[0]
        high = rows_after[0] if len(rows_after) else rows[-1]
        selected[rows[(rows >= low) & (rows <= high)]] = True
    return np.flatnonzero(selected)


def _fields(content: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of a manifest that exist in this version."""
    return {name: value for name, value in content.items() if name in Manifest.model_fields}


def _cut(run: Run, name: str, first: int, end: int) -> Any:
    """Return the rows of a table within a part of a run, with steps relative to its first step."""
    table = run.tables[name]
    if name == KEY_FRAMES:
        table = expand_walks(run)
        table = table.take(key_frame_rows(table, first, end))
    else:
        step = table["step"].to_numpy()
        table = table.take(np.flatnonzero((step >= first) & (step < end)))
    import pyarrow as pa

    step = np.maximum(table["step"].to_numpy() - first, 0)
    index = table.schema.get_field_index("step")
    return table.set_column(index, table.schema.field(index), pa.array(step))


def expand_walks(run: Run) -> Any:
    """Return the key frames of a run with random walks replaced by a position for each step.

    Raises:
        ArtifactError: A walk can't be rebuilt.
    """
    import pyarrow as pa

    table = run.tables[KEY_FRAMES]
    entity, kind = (table[name].cast("string").to_numpy(False) for name in ("entity", "kind"))
    walkers = list(dict.fromkeys(entity[kind == "walk"].tolist()))
    if not walkers:
        return table
    interval = timedelta(microseconds=run.manifest["step_us"])
    parts = [table.take(np.flatnonzero(~np.isin(entity, walkers)))]
    parts += [positions(run, name, interval) for name in walkers]
    return pa.concat_tables([part.cast(plain_schema(table)) for part in parts])


def plain_schema(table: Any) -> Any:
    """Return the schema of a table of key frames, with plain strings and without metadata."""
    import pyarrow as pa

    texts = {"entity": pa.string(), "kind": pa.string()}
    return pa.schema([(field.name, texts.get(field.name, field.type)) for field in table.schema])


def positions(run: Run, name: str, interval: timedelta) -> Any:
    """Return the positions of a body at equal intervals, in the columns of key_frames.

    Raises:
        ArtifactError: The run stored no key frames, or the path can't be rebuilt.
    """
    import pyarrow as pa

    if KEY_FRAMES not in run.tables:
        raise ArtifactError("the run stored no key frames: run it with artifacts.key_frames=true")
    path = run.path(name, interval)
    count = len(path.step)
    return pa.table(
        {
            "step": path.step,
            "time": path.time.astype("M8[us]"),
            "entity": pa.array([name] * count, pa.string()),
            "kind": pa.array(["track"] * count, pa.string()),
            "x": path.x,
            "y": path.y,
            "heading": path.heading,
            "away": path.away,
        }
    )
