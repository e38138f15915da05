"""A reliability diagram: how often what an algorithm believed of presence came true."""

from datetime import timedelta
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from fleet2d.algorithms.presence.belief import ANYONE
from fleet2d.errors import ArtifactError
from fleet2d.metrics.presence.scores import (
    calibration_error,
    classwise_error,
    reliability_curve,
    top_k,
)
from fleet2d.runs.run import Run
from fleet2d.runs.trajectory import rebuild_path
from fleet2d.view.floorplan import DPI, check_picture, drawing_style, save_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LIKELIEST, EVERY = "#b5305c", "#2c6fb0"
F64 = NDArray[np.float64]
I64 = NDArray[np.int64]


class Forecasts(NamedTuple):
    """What was believed of users at the times of an algorithm's updates, and where they were.

    Attributes:
        belief: float64 (n, rooms + 1), away last.
        truth: int64 (n,), the place.
    """

    belief: F64
    truth: I64


def forecasts_of(run: Run, algorithm: str) -> Forecasts:
    """Return what an algorithm of a stored run believed of each user, and the truth.

    Args:
        run: A run that stored its output and key frames.
        algorithm: The algorithm, whose output is presence: rows `user, room, share`.

    Raises:
        ArtifactError: The run has no such table, or it isn't of presence.
    """
    table = run.arrow(algorithm)
    users, places = run.manifest["entities"]["users"], len(run.plan.rooms) + 1
    # Each time there is a row for every place of every user, and of anyone; away last.
    if not {"user", "room", "share"} <= set(table.column_names) or ANYONE not in set(
        table["user"][: places * (len(users) + 1)].to_pylist()
    ):
        raise ArtifactError(
            f"{algorithm} stored {', '.join(table.column_names[2:])}, which is no presence: name an"
            " algorithm like rtp or ltp"
        )
    shares = table["share"].to_numpy().reshape(-1, len(users) + 1, places)
    steps = table["step"].to_numpy().reshape(shares.shape)[:, 0, 0]
    every = timedelta(microseconds=run.manifest["step_us"])
    beliefs, truths = [], []
    for row, user in enumerate(users):
        path = rebuild_path(run, run.plan, user, every)
        room, gone = path.room[steps].astype(np.int64), path.away[steps]
        home, away = shares[:, row, :-1], shares[:, row, -1]
        belief = np.concatenate([home * (1 - away)[:, None], away[:, None]], axis=1)
        known = gone | (room >= 0)  # beside all rooms nothing is right
        beliefs.append(belief[known])
        truths.append(np.where(gone, places - 1, room)[known])
    if not beliefs:
        raise ArtifactError(f"{algorithm} stored nothing of any user")
    return Forecasts(np.concatenate(beliefs), np.concatenate(truths))


def draw_reliability(run: Run, algorithm: str, path: Path) -> None:
    """Draw the reliability diagram of an algorithm's presence to a PNG or SVG file.

    Above, of 15 groups of about equal size, how often came true what was said with some
    probability: of the likeliest place, and of every place. On the diagonal all is as said, below
    it was said too surely. Beneath, how often what was said. Of all users, at the updates of the
    algorithm.

    Args:
        run: The run.
        algorithm: The algorithm.
        path: Where to; the name ends with `.png` or `.svg`. A file there is replaced.

    Raises:
        ArtifactError: The run doesn't hold what is needed.
        InputError: The name ends otherwise, or the file can't be written.
    """
    check_picture(path)
    belief, truth = forecasts_of(run, algorithm)
    places = np.arange(belief.shape[1])
    sure, right = belief.max(axis=1), top_k(belief, truth, 1)
    true = (truth[:, None] == places).astype(np.float64)
    with drawing_style():
        figure = Figure(figsize=(5.2, 6.4), dpi=DPI)
        FigureCanvasAgg(figure)
        curve, counts = figure.subplots(2, 1, sharex=True, height_ratios=(4, 1))
        curve.plot([0, 1], [0, 1], color="#9a9a9a", linewidth=1, linestyle="--")
        ece, classwise = calibration_error(belief, truth), classwise_error(belief, truth)
        _points(curve, sure, right, LIKELIEST, f"likeliest place (ECE {ece:.3f})")
        _points(curve, belief.ravel(), true.ravel(), EVERY, f"every place (mean {classwise:.3f})")
        curve.set(ylabel="came true", xlim=(-0.02, 1.02), ylim=(-0.02, 1.02), aspect="equal")
        curve.set_title(f"{algorithm}: {len(truth):,} forecasts", fontsize=11, loc="left")
        curve.legend(loc="upper left", frameon=False)
        for said, color in ((sure, LIKELIEST), (belief.ravel(), EVERY)):
            weights = np.full(len(said), 1 / len(said))
            counts.hist(said, np.linspace(0, 1, 21), weights=weights, color=color, alpha=0.6)
        counts.set(xlabel="said", ylabel="share")
        figure.tight_layout()
        save_figure(figure, path)


def _points(axes: "Axes", said: F64, true: F64, color: str, label: str) -> None:
    confidence, share, _ = reliability_curve(said, true)
    axes.plot(confidence, share, marker="o", markersize=4, color=color, label=label)
