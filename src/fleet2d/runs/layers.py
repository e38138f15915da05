"""Read the layers of a run back."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fleet2d.artifacts.table import ALL_CELLS, LAYER_PREFIX
from fleet2d.configuration.problems import suggest
from fleet2d.errors import ArtifactError
from fleet2d.runs.run import Run


def layer_names(run: Run) -> list[str]:
    """Return the names of the layers that a run stored."""
    return [name.removeprefix(LAYER_PREFIX) for name in run.tables if name.startswith(LAYER_PREFIX)]


def layer_steps(run: Run, name: str) -> list[int]:
    """Return the steps after which a layer was stored, in order.

    Raises:
        ArtifactError: The run stored no such layer.
    """
    table = _layer_table(run, name)
    begins = table["row"].to_numpy() == ALL_CELLS  # each step has one such row first
    return table["step"].to_numpy()[begins].tolist()


def read_layer(run: Run, name: str, step: int | None = None) -> NDArray[Any]:
    """Return a stored layer: (rows, columns), NaN where a float has no value.

    Args:
        run: The run.
        name: The layer's name.
        step: One of `layer_steps`; None for the last.

    Raises:
        ArtifactError: The run stored no such layer, or not at that step, or the layer is damaged.
    """
    steps = layer_steps(run, name)
    if not steps:
        raise ArtifactError(f"the layer {name!r} was never stored")
    if step is None:
        step = steps[-1]
    if step not in steps:
        first = map(str, steps[:10])
        listed = ", ".join([*first, "…"] if len(steps) > 10 else first)
        raise ArtifactError(
            f"the layer {name!r} was not stored at step {step}; stored steps: {listed}"
        )
    table = _layer_table(run, name)
    at_step = table["step"].to_numpy() == step
    columns = (table[key] for key in ("row", "column", "value"))
    row, column, value = (each.to_numpy(zero_copy_only=False)[at_step] for each in columns)
    lattice = run.plan.lattice
    inside = (row < lattice.rows) & (column < lattice.columns) & (row >= 0) & (column >= 0)
    if not inside[1:].all() or row[0] != ALL_CELLS:
        raise ArtifactError(f"the layer {name!r} doesn't fit the floor plan of the run")
    values = np.full((lattice.rows, lattice.columns), value[0])
    values[row[1:], column[1:]] = value[1:]
    return values


def _layer_table(run: Run, name: str) -> Any:
    if f"{LAYER_PREFIX}{name}" not in run.tables:
        names = suggest(name, layer_names(run), "It has")
        raise ArtifactError(f"the run stored no layer {name!r}{names}")
    return run.tables[f"{LAYER_PREFIX}{name}"]
