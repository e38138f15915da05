"""Real-time presence: networks trained on windows of simulated robots, scored on replayed logs."""

from collections.abc import Sequence

import numpy as np

from fleet2d.algorithms.presence.learned import TRUSTS
from fleet2d.kernels import F64, I64
from fleet2d.learning.datasets.training import TrainingSettings, fine_tune, train
from fleet2d.learning.datasets.windows import PRIOR, Windows, predict
from fleet2d.learning.transfer.learners import Forecast
from fleet2d.learning.transfer.sources import Sources
from fleet2d.learning.transfer.specification import Cell
from fleet2d.metrics.rtp_score import log_loss, top_k
from fleet2d.runtime.clock import DAY_S

SETTINGS = TrainingSettings(hidden=16, epochs=6, trust=(1.0,) * TRUSTS)
# The number of times that a home's own windows count among others.
OWN_REPEATS = 3


def of_days(parts: Sequence[Windows], days: I64) -> list[Windows]:
    """Return the windows of some days of a log whose replay began at midnight, in steps of 1 s."""
    return [part.rows(np.isin(part.step // DAY_S, days)) for part in parts]


def thinned(parts: Sequence[Windows], rows: int) -> list[Windows]:
    """Return every n-th window, so that about `rows` remain."""
    every = max(1, -(-sum(len(part.truth) for part in parts) // rows))
    return [part.rows(slice(None, None, every)) for part in parts]


def presence_forecast(sources: Sources, cell: Cell) -> Forecast:
    """Train the network of a cell, and score it on the test days of its home."""
    rows = sources.file.rows
    own_log = f"log-{cell.home}"
    log = sources.windows_of(own_log)
    own = of_days(log, sources.homes[cell.home].own(cell.days)) if cell.days else []
    real: list[Windows] = []
    made: list[Windows] = []
    for name in sources.needed(cell):
        if name != own_log:
            kind = real if name.startswith("log-") else made
            kind += sources.windows_of(name)
    known = [*thinned(real, rows), *thinned(made, rows)]
    if cell.arm == "own":
        known = own
    elif cell.arm in ("real", "both"):
        known += own * OWN_REPEATS
    weights = train(known, settings=SETTINGS)
    if cell.arm == "tuned":
        weights = fine_tune(weights, own)
    asked = of_days(log, sources.tested[cell.home])
    loss, hit = _scored(asked, [predict(weights, part) for part in asked])
    naive_loss, naive_hit = _scored(asked, [part.beliefs[PRIOR] for part in asked])
    metrics = {
        "unseen": 0.0,
        "naive_accuracy": float(naive_hit.mean()),
        "naive_log_loss": float(naive_loss.mean()),
    }
    return Forecast(loss, hit, np.concatenate([part.step // DAY_S for part in asked]), metrics)


def _scored(parts: Sequence[Windows], beliefs: Sequence[F64]) -> tuple[F64, F64]:
    """Return the log loss of beliefs in windows, and whether the likeliest place was right."""
    loss = []
    hit = []
    for part, belief in zip(parts, beliefs, strict=True):
        loss.append(log_loss(belief, part.truth))
        hit.append(top_k(belief, part.truth, 1))
    return np.concatenate(loss), np.concatenate(hit)
