"""Layers of cells as tables: a row for each cell that differs from the layer's fill value."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fleet2d.artifacts.table import Column, Kind, TableSpec
from fleet2d.configuration.problems import suggest
from fleet2d.errors import ArtifactError
from fleet2d.floorplan.layers import Layer
from fleet2d.runs.run import Run

PREFIX = "layer."
EVERYWHERE = -1
"""Row and column of the entry that holds the fill value: of all cells without an entry."""

KINDS: dict[str, Kind] = {"b": "bool", "i": "int64", "u": "int64", "f": "float64"}


def layer_table(layer: Layer) -> TableSpec:
    """Return the table that a layer is stored in."""
    kind = KINDS[layer.dtype.kind]
    return TableSpec(
        f"{PREFIX}{layer.name}",
        (
            Column("step", "step", description="the layer as it was after this step"),
            Column("time", "time", description="local time"),
            Column("row", "int32", description="of the cell; -1: all cells not named"),
            Column("column", "int32"),
            Column("value", kind, layer.unit, kind == "float64", description=layer.description),
        ),
        layer.description,
    )


def layer_rows(layer: Layer) -> dict[str, NDArray[Any]]:
    """Return the present values of a layer as rows: columns row, column and value."""
    values, fill = layer.values, np.array(layer.fill)
    differs = ~np.isnan(values) if np.isnan(fill) else values != fill.astype(values.dtype)
    row, column = np.nonzero(differs)
    kind = {"bool": np.bool_, "int64": np.int64, "float64": np.float64}[KINDS[layer.dtype.kind]]
    return {
        "row": np.concatenate([[EVERYWHERE], row]).astype(np.int32),
        "column": np.concatenate([[EVERYWHERE], column]).astype(np.int32),
        "value": np.concatenate([[fill.astype(kind)], values[differs].astype(kind)]),
    }


def layer_names(run: Run) -> list[str]:
    """Return the names of the layers that a run stored."""
    return [name.removeprefix(PREFIX) for name in run.tables if name.startswith(PREFIX)]


def layer_steps(run: Run, name: str) -> list[int]:
    """Return the steps after which a layer was stored, in order.

    Raises:
        ArtifactError: The run stored no such layer.
    """
    table = _table(run, name)
    begins = table["row"].to_numpy() == EVERYWHERE  # the first row of each step
    return [int(step) for step in table["step"].to_numpy()[begins]]


def read_layer(run: Run, name: str, step: int | None = None) -> NDArray[Any]:
    """Return a stored layer: (rows, columns), NaN where a float has no value.

    Args:
        run: The run.
        name: The layer's name.
        step: One of `layer_steps`; None for the last.

    Raises:
        ArtifactError: The run stored no such layer, or not at that step, or it is damaged.
    """
    steps = layer_steps(run, name)
    if not steps:
        raise ArtifactError(f"the layer {name!r} was never stored")
    if step is None:
        step = steps[-1]
    if step not in steps:
        listed = ", ".join(map(str, steps[:10])) + (", …" if len(steps) > 10 else "")
        raise ArtifactError(
            f"the layer {name!r} was not stored at step {step}; stored steps: {listed}"
        )
    table = _table(run, name)
    at_step = table["step"].to_numpy() == step
    row, column, value = (
        table[key].to_numpy(zero_copy_only=False)[at_step] for key in ("row", "column", "value")
    )
    lattice = run.plan.lattice
    inside = (row < lattice.rows) & (column < lattice.columns) & (row >= 0) & (column >= 0)
    if not inside[1:].all() or row[0] != EVERYWHERE:
        raise ArtifactError(f"the layer {name!r} doesn't fit the floor plan of the run")
    values = np.full((lattice.rows, lattice.columns), value[0])
    values[row[1:], column[1:]] = value[1:]
    return values


def _table(run: Run, name: str) -> Any:
    if f"{PREFIX}{name}" not in run.tables:
        names = suggest(name, layer_names(run), "It has")
        raise ArtifactError(f"the run stored no layer {name!r}{names}")
    return run.tables[f"{PREFIX}{name}"]
