"""Tables that the tests of the artifact layer share."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from fleet2d.artifacts.store import RunStore
from fleet2d.artifacts.table import Column, TableSpec

EVERY_KIND = TableSpec(
    "every_kind",
    (
        Column("step", "step", description="index of the step"),
        Column("time", "time"),
        Column("count", "int32"),
        Column("total", "int64", nullable=True),
        Column("x", "float64", "m"),
        Column("gap", "float64", "s", nullable=True),
        Column("true", "bool"),
        Column("room", "category", categories=("hall", "kitchen", "bath"), nullable=True),
        Column("what", "category"),
        Column("said", "string", nullable=True),
    ),
    "one column of every kind",
)


def rows_of_every_kind(n, seed=0):
    """Return n random rows for EVERY_KIND, with missing values wherever they may be."""
    rng = np.random.default_rng(seed)
    step = np.sort(rng.integers(0, 10 * n + 1, n))
    words = np.array(["seen", "lost", "arrived", "Grüße"])
    said = [None if k % 3 == 0 else "é" * (k % 5) + str(k) for k in range(n)]
    return {
        "step": step,
        "time": step * 1_000_000,
        "count": rng.integers(-5, 5, n).astype(np.int32),
        "total": np.ma.masked_array(rng.integers(0, 2**40, n), mask=rng.random(n) < 0.3),
        "x": rng.normal(size=n),
        "gap": np.where(rng.random(n) < 0.5, np.nan, rng.random(n)),
        "true": rng.random(n) < 0.5,
        "room": rng.integers(-1, 3, n).astype(np.int32),
        "what": words[rng.integers(0, 4, n)],
        "said": said,
    }


def part(rows, start, stop):
    """Return a slice of rows."""
    return {name: values[start:stop] for name, values in rows.items()}


def stored(rows, *, spec: TableSpec = EVERY_KIND, pieces=1, **options) -> RunStore:
    """Return a closed store that was given rows in so many pieces."""
    store = RunStore(options.pop("directory", None), [spec], **options)
    store.open()
    n = len(rows["step"])
    edges = np.linspace(0, n, pieces + 1).astype(int)
    for a, b in pairwise(edges):
        store.append(spec.name, **part(rows, int(a), int(b)))
    store.close()
    return store
