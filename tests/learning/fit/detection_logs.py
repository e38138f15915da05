"""Logs of detections with known parameters."""

from pathlib import Path

import numpy as np

from fleet2d.kernels import F64
from fleet2d.learning.fit.perception import DetectionLog

TRUE = {
    "top": 0.93, "distance midpoint": 4.0, "distance width": 0.6,
    "bearing midpoint": 48.0, "bearing width": 6.0, "side": 0.8, "back": 0.5,
}  # fmt: skip


def falling(x: F64, midpoint, width) -> F64:
    return 1 / (1 + np.exp((x - midpoint) / width))


def shares(distance: F64, bearing: F64 | None, turned: F64 | None) -> F64:
    """Return the probability of each row to be noticed."""
    p = TRUE["top"] * falling(distance, TRUE["distance midpoint"], TRUE["distance width"])
    if bearing is not None:
        p = p * falling(np.abs(bearing), TRUE["bearing midpoint"], TRUE["bearing width"])
    if turned is not None:
        p = p * np.interp(turned, [0, 90, 180], [1, TRUE["side"], TRUE["back"]])
    return p


def simulated(seed, rows, *, bearing=False, turned=False) -> DetectionLog:
    """Return a log of a detector with the true parameters."""
    rng = np.random.default_rng(seed)
    distance = rng.uniform(0.3, 7, rows)
    angle = rng.uniform(-60, 60, rows) if bearing else None
    facing = rng.uniform(0, 180, rows) if turned else None
    detected = rng.random(rows) < shares(distance, angle, facing)
    return DetectionLog(
        Path("log.csv"), distance, detected, None if angle is None else np.abs(angle), facing
    )


def write(path: Path, **columns) -> Path:
    """Write columns to a CSV file."""
    lines = [
        ",".join(columns),
        *(",".join(map(str, row)) for row in zip(*columns.values(), strict=True)),
    ]
    path.write_text("\n".join(lines) + "\n")
    return path
