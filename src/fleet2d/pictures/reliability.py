"""A reliability diagram: forecast probabilities of presence, and how often they came true."""

from datetime import timedelta
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fleet2d.algorithms.presence.belief import ANYONE
from fleet2d.errors import ArtifactError
from fleet2d.kernels import F64, I64
from fleet2d.metrics.rtp_score import (
    calibration_error,
    classwise_error,
    reliability_curve,
    top_k,
)
from fleet2d.pictures.floorplan import check_picture, picture
from fleet2d.runs.run import Run
from fleet2d.runs.trajectory import rebuild_path

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LIKELIEST_COLOR, EVERY_COLOR = "#b5305c", "#2c6fb0"


class Forecasts(NamedTuple):
    """The forecasts of an algorithm at its updates, and the true places of users.

    Attributes:
        belief: The probability of each place, the last of which is away: float64 (n, rooms + 1).
        truth: The index of the true place: int64 (n,).
    """

    belief: F64
    truth: I64


def forecasts_of(run: Run, algorithm: str) -> Forecasts:
    """Return the forecasts of an algorithm for all users of a stored run, with the truth.

    Args:
        run: A run that stored its output and key frames.
        algorithm: The algorithm; its output must be presence: rows `user, room, share`.

    Raises:
        ArtifactError: The run has no such table, or it isn't of presence.
    """
    table = run.arrow(algorithm)
    users, places = run.manifest["entities"]["users"], len(run.plan.rooms) + 1
    # An update has a row for each place of each user, and of anyone; the last place is away.
    if not {"user", "room", "share"} <= set(table.column_names) or ANYONE not in set(
        table["user"][: places * (len(users) + 1)].to_pylist()
    ):
        raise ArtifactError(
            f"{algorithm} stored {', '.join(table.column_names[2:])}, no room probabilities: choose"
            " a presence algorithm such as ltp or rtp"
        )
    shares = table["share"].to_numpy().reshape(-1, len(users) + 1, places)
    steps = table["step"].to_numpy().reshape(shares.shape)[:, 0, 0]
    every = timedelta(microseconds=run.manifest["step_us"])
    beliefs, truths = [], []
    for row, user in enumerate(users):
        path = rebuild_path(run, run.plan, user, every)
        room, is_away = path.room[steps].astype(np.int64), path.away[steps]
        home, away = shares[:, row, :-1], shares[:, row, -1]
        belief = np.concatenate([home * (1 - away)[:, None], away[:, None]], axis=1)
        has_place = is_away | (room >= 0)  # some cells belong to no room
        beliefs.append(belief[has_place])
        truths.append(np.where(is_away, places - 1, room)[has_place])
    if not beliefs:
        raise ArtifactError(
            f"{algorithm} stored no estimate yet: let the run be longer than its first period"
        )
    return Forecasts(np.concatenate(beliefs), np.concatenate(truths))


def draw_reliability(run: Run, algorithm: str, path: Path) -> None:
    """Draw the reliability diagram of an algorithm's presence to a PNG, SVG or PDF file.

    The upper panel shows for 15 groups of about equal size how often forecasts of a probability
    came true: for the likeliest place, and for every place. Points on the diagonal are reliable,
    points below it overconfident. The lower panel shows the distribution of the forecasts. Both
    are of all users, at the updates of the algorithm.

    Args:
        run: The run.
        algorithm: The algorithm.
        path: The file, whose name ends with `.png`, `.svg` or `.pdf`. An existing file is replaced.

    Raises:
        ArtifactError: The run has no output of the algorithm, or no key frames.
        InputError: The file name has another suffix, or the file can't be written.
    """
    check_picture(path)
    belief, truth = forecasts_of(run, algorithm)
    places = np.arange(belief.shape[1])
    highest, is_right = belief.max(axis=1), top_k(belief, truth, 1)
    is_true = (truth[:, None] == places).astype(np.float64)
    with picture(path, 5.2, 6.4) as figure:
        curve, counts = figure.subplots(2, 1, sharex=True, height_ratios=(4, 1))
        curve.plot([0, 1], [0, 1], color="#9a9a9a", linewidth=1, linestyle="--")
        ece, classwise = calibration_error(belief, truth), classwise_error(belief, truth)
        _points(curve, highest, is_right, LIKELIEST_COLOR, f"likeliest place (ECE {ece:.3f})")
        _points(
            curve,
            belief.ravel(),
            is_true.ravel(),
            EVERY_COLOR,
            f"every place (mean {classwise:.3f})",
        )
        curve.set(
            ylabel="observed frequency", xlim=(-0.02, 1.02), ylim=(-0.02, 1.02), aspect="equal"
        )
        curve.set_title(f"{algorithm}: {len(truth):,} forecasts", fontsize=11, loc="left")
        curve.legend(loc="upper left", frameon=False)
        for forecasts, color in ((highest, LIKELIEST_COLOR), (belief.ravel(), EVERY_COLOR)):
            weights = np.full(len(forecasts), 1 / len(forecasts))
            counts.hist(forecasts, np.linspace(0, 1, 21), weights=weights, color=color, alpha=0.6)
        counts.set(xlabel="forecast probability", ylabel="share")
        figure.tight_layout()


def _points(axes: "Axes", forecasts: F64, outcomes: F64, color: str, label: str) -> None:
    confidence, share, _ = reliability_curve(forecasts, outcomes)
    axes.plot(confidence, share, marker="o", markersize=4, color=color, label=label)
