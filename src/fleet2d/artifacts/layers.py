"""Layers of cells as tables: a row for each cell that differs from the layer's fill value."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fleet2d.artifacts.table import Column, Kind, TableSpec
from fleet2d.floorplan.home.layers import Layer

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
