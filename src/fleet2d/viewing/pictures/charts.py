"""Charts of people's days, and of how reliable estimates of presence are."""

from collections import Counter
from collections.abc import Sequence
from datetime import date, timedelta
from itertools import cycle
from pathlib import Path
from typing import NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from fleet2d.algorithms.presence.belief import ANYONE
from fleet2d.configuration.units import WEEKDAYS
from fleet2d.errors import ArtifactError
from fleet2d.kernels import F64, I64
from fleet2d.metrics.rtp_score import (
    GapMeasures,
    calibration_error,
    classwise_error,
    reliability_curve,
    top_k,
)
from fleet2d.palette import USER_COLORS
from fleet2d.routines.interruptions import without_interruptions
from fleet2d.routines.life import Life
from fleet2d.routines.persona import Persona
from fleet2d.routines.planner import FINISHES, INTERRUPTS, RESUMES, Episode
from fleet2d.runs.run import Run
from fleet2d.runs.trajectory import rebuild_path
from fleet2d.runtime.clock import HOUR_S
from fleet2d.viewing.pictures.floorplan import picture, write_picture

MONDAY = date(2026, 1, 5)
INTERRUPTION_ROLES = (INTERRUPTS, FINISHES)
# End of a strip [hours]: a day lasts from waking up to the next waking up.
HOURS = 34
SLEEP_COLOR = "#3b4a63"
AWAY_COLOR = "#e3e3e3"
NEED_COLOR = "#111111"
GREYS = (14, 15)  # indices of the palette: grey is for activities away from home

Days = Sequence[tuple[date, Sequence[Episode]]]


def diary_days(persona: Persona, count: int, seed: int) -> Days:
    """Return some days of a persona who lives alone, starting on a Monday."""
    life = Life(persona, seed, "users.diary")
    first = MONDAY.toordinal()
    return [(date.fromordinal(first + i), list(life.day(first + i))) for i in range(count)]


def diary_lines(name: str, persona: Persona, days: Days) -> list[str]:
    """Return a diary as lines of text; interruptions are indented."""
    lines = [f"{name}: {persona.about or 'a persona'}"]
    for day, episodes in days:
        lines.append(f"{WEEKDAYS[day.weekday()]}, {day}")
        for episode in episodes:
            indent = "    " if episode.role in INTERRUPTION_ROLES else ""
            again = " (goes on)" if episode.role == RESUMES else ""
            away = " (out)" if persona.activity(episode.activity).away else ""
            text = f"{indent}{episode.activity.replace('_', ' ')}{away}{again}"
            clock = f"{episode.begin // HOUR_S % 24:02}:{episode.begin // 60 % 60:02}"
            lines.append(f"  {clock}  {_length(episode.end - episode.begin):>10}  {text}")
    episodes_of_all = (episode for _, episodes in days for episode in episodes)
    counts = Counter(each.activity for each in episodes_of_all if each.role in INTERRUPTION_ROLES)
    rates = [f"{name.replace('_', ' ')} {n / len(days):.1f}" for name, n in counts.most_common()]
    return [*lines, f"interruptions a day: {', '.join(rates)}"] if rates else lines


def _length(time_s: int) -> str:
    if time_s < 60:
        return f"{time_s} s"
    hours, minutes = divmod((time_s + 30) // 60, 60)
    return f"{hours} h {minutes:02} min" if hours else f"{minutes} min"


def draw_diary(persona: Persona, name: str, days: Days, target: Path) -> None:
    """Draw a strip for each day: planned activities as a band, interruptions as marks above it.

    Raises:
        InputError: The file name has another suffix, or the file can't be written.
    """
    write_picture(target, lambda: _diary_figure(persona, name, days))


def _diary_figure(persona: Persona, name: str, days: Days) -> Figure:
    colors = _colors(persona, days)
    figure = Figure(figsize=(13, 1.2 + 0.55 * len(days)), dpi=130, layout="constrained")
    axes = figure.subplots()
    for row, (_, episodes) in enumerate(days):
        for episode in without_interruptions(episodes):
            span = (episode.begin / HOUR_S, (episode.end - episode.begin) / HOUR_S)
            axes.broken_barh([span], (row, 0.62), facecolors=colors[episode.activity])
        marks = []
        for episode in episodes:
            if episode.role in INTERRUPTION_ROLES:
                visible_s = max(episode.end - episode.begin, 120)
                marks.append((episode.begin / HOUR_S, visible_s / HOUR_S))
        axes.broken_barh(marks, (row + 0.66, 0.22), facecolors=NEED_COLOR)
    dates = [f"{WEEKDAYS[day.weekday()][:3]} {day:%d.%m.}" for day, _ in days]
    axes.set_yticks(np.arange(len(days)) + 0.4, dates)
    axes.set(xlim=(4, HOURS), xlabel="hour", title=f"{name}: {persona.about}")
    hours = range(4, HOURS + 1, 2)
    axes.set_xticks(hours, [f"{hour % 24}" for hour in hours])
    axes.invert_yaxis()
    patches = [Patch(color=color, label=label.replace("_", " ")) for label, color in colors.items()]
    patches.append(Patch(color=NEED_COLOR, label="needs and errands"))
    figure.legend(handles=patches, loc="outside lower center", ncols=8, fontsize=7, frameon=False)
    return figure


def _colors(persona: Persona, days: Days) -> dict[str, str | tuple[float, ...]]:
    names = {each.activity for _, day in days for each in without_interruptions(day)}
    all_colors = mpl.colormaps["tab20"].colors  # type: ignore[attr-defined]
    palette = cycle(color for i, color in enumerate(all_colors) if i not in GREYS)
    away = [name for name in sorted(names) if persona.activity(name).away]
    home = sorted(names - {"sleep", *away})
    colors: dict[str, str | tuple[float, ...]] = {"sleep": SLEEP_COLOR}
    colors |= zip(home, palette, strict=False)
    return colors | dict.fromkeys(away, AWAY_COLOR)


LIKELIEST_COLOR = "#b5305c"
EVERY_COLOR = "#2c6fb0"


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
        ArtifactError: The run has no such table, or the table isn't of presence.
    """
    table = run.arrow(algorithm)
    users = run.manifest["entities"]["users"]
    places = len(run.plan.rooms) + 1
    # An update has a row for each place of each user, and of anyone; the last place is away.
    is_presence = {"user", "room", "share"} <= set(table.column_names)
    if not is_presence or ANYONE not in table["user"][: places * (len(users) + 1)].to_pylist():
        raise ArtifactError(
            f"{algorithm} stored {', '.join(table.column_names[2:])}, no room probabilities: choose"
            " a presence algorithm such as ltp or rtp"
        )
    shares = table["share"].to_numpy().reshape(-1, len(users) + 1, places)
    at = "at" if "at" in table.column_names else "step"  # only `belief_table` has `at`
    steps = table[at].to_numpy().reshape(shares.shape)[:, 0, 0]
    every = timedelta(microseconds=run.manifest["step_us"])
    beliefs = []
    truths = []
    for row, user in enumerate(users):
        path = rebuild_path(run, run.plan, user, every)
        room = path.room[steps].astype(np.int64)
        is_away = path.away[steps]
        home = shares[:, row, :-1]
        away = shares[:, row, -1]
        belief = np.column_stack([home * (1 - away)[:, None], away])
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
    draw_forecasts(algorithm, *forecasts_of(run, algorithm), path)


def draw_forecasts(name: str, belief: F64, truth: I64, path: Path) -> None:
    """Draw the reliability diagram of forecasts, as `draw_reliability`.

    Args:
        name: The name of the model that forecast.
        belief: float64 (n, places), the probability of each place.
        truth: int64 (n,), the true place.
        path: The file.

    Raises:
        InputError: The file name has another suffix, or the file can't be written.
    """
    places = np.arange(belief.shape[1])
    highest = belief.max(axis=1)
    is_right = top_k(belief, truth, 1)
    is_true = (truth[:, None] == places).astype(np.float64)
    with picture(path, 5.2, 6.4) as figure:
        curve, counts = figure.subplots(2, 1, sharex=True, height_ratios=(4, 1))
        curve.plot([0, 1], [0, 1], color="#9a9a9a", linewidth=1, linestyle="--")
        likeliest = f"likeliest place (ECE {calibration_error(belief, truth):.3f})"
        every = f"every place (mean {classwise_error(belief, truth):.3f})"
        for forecasts, outcomes, color, label in (
            (highest, is_right, LIKELIEST_COLOR, likeliest),
            (belief.ravel(), is_true.ravel(), EVERY_COLOR, every),
        ):
            confidence, share, _ = reliability_curve(forecasts, outcomes)
            curve.plot(confidence, share, marker="o", markersize=4, color=color, label=label)
            weights = np.full(len(forecasts), 1 / len(forecasts))
            counts.hist(forecasts, np.linspace(0, 1, 21), weights=weights, color=color, alpha=0.6)
        curve.set(ylabel="observed frequency", xlim=(-0.02, 1.02), ylim=(-0.02, 1.02))
        curve.set_title(f"{name}: {len(truth):,} forecasts", fontsize=11, loc="left")
        curve.legend(loc="upper left", frameon=False)
        counts.set(xlabel="forecast probability", ylabel="share")
        figure.tight_layout()


def draw_gaps(measures: GapMeasures, path: Path) -> None:
    """Draw measures of models of presence by the time since a person was last seen.

    Args:
        measures: The measures, each drawn in a panel of its own.
        path: The file.

    Raises:
        InputError: The file name has another suffix, or the file can't be written.
    """
    with picture(path, 5.2 * len(measures), 4.2) as figure:
        panels = figure.subplots(1, len(measures), squeeze=False)[0]
        for axes, (measure, models) in zip(panels, measures.items(), strict=True):
            for k, (name, gaps) in enumerate(models.items()):
                means, *ends = np.array(list(gaps.values())).T
                reach = np.nan_to_num(np.abs(ends - means))
                place = np.arange(len(gaps)) + (k - len(models) / 2) / 12  # side by side
                color = USER_COLORS[k % len(USER_COLORS)]
                axes.errorbar(place, means, reach, marker="o", capsize=2, color=color, label=name)
                axes.set_xticks(range(len(gaps)), list(gaps), rotation=30)
            axes.set(ylabel=measure, xlabel="time since last seen")
            if max(mean for gaps in models.values() for mean, *_ in gaps.values()) > 1:
                axes.set_yscale("log")  # the log loss of the last room seen is far larger
                axes.yaxis.set_major_formatter("{x:g}")
        panels[0].legend(frameon=False)
        figure.tight_layout()
