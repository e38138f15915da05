"""Pictures of fits: time shares by hour and durations of stays, of the log and of the persona."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fleet2d.fit.compare import by_hour, dwell_times, shares
from fleet2d.fit.days import LivedDay
from fleet2d.fit.persona import FittedPersona
from fleet2d.fit.sample import sample_markov, sample_persona
from fleet2d.fit.timeline import Timeline
from fleet2d.logs.log import AWAY
from fleet2d.palette import OTHER_COLOR, ROOM_COLORS

SAMPLED = 140
LABELS = ("log", "persona", "Markov chain")
LINES = ("#222222", "#c2410c", "#9aa5b1")


def draw_fit(
    timeline: Timeline, days: Sequence[LivedDay], fitted: FittedPersona, target: Path, seed: int = 0
) -> None:
    """Draw the days of the log, of the persona and of a Markov chain next to each other.

    At the top: the shares of the rooms in each hour. At the bottom: the distribution function of
    the durations of stays, room by room.
    """
    from matplotlib.figure import Figure

    count = len(timeline.places)
    real = timeline.rooms[[day.number for day in days]]
    sampled = sample_persona(fitted, timeline, SAMPLED, seed)[1]
    sets = (real, sampled, sample_markov(real, count, SAMPLED, seed))
    colors = [ROOM_COLORS.get(place, OTHER_COLOR) for place in timeline.places]
    columns = max(3, count)
    figure = Figure(figsize=(2.1 * columns, 5.2), layout="constrained")
    upper: Any
    lower: Any
    upper, lower = figure.subfigures(2, 1)  # type: ignore[misc]
    for axes, labels, label in zip(upper.subplots(1, 3, sharey=True), sets, LABELS, strict=True):
        stacked = np.cumsum(by_hour(labels, count), axis=1)
        below = np.zeros(24)
        for i, place in enumerate(timeline.places):
            color = "white" if place == AWAY else colors[i]
            axes.bar(
                np.arange(24) + 0.5, stacked[:, i] - below, 1, below, color=color, label=place,
                edgecolor="#d0d0d0", linewidth=0.3,
            )  # fmt: skip
            below = stacked[:, i]
        axes.set(title=label, xlim=(0, 24), ylim=(0, 1), xticks=(0, 6, 12, 18, 24))
        axes.set_xlabel("hour of the day")
    upper.axes[0].set_ylabel("share of the time")
    handles, names = upper.axes[0].get_legend_handles_labels()
    upper.legend(handles, names, loc="outside right upper", frameon=False, fontsize=8)
    _draw_stays(lower.subplots(1, count, sharey=True, squeeze=False)[0], sets, timeline)
    figure.savefig(target, dpi=150, metadata={"Date": None} if target.suffix == ".svg" else None)


def _draw_stays(panels: Sequence[Any], sets: Sequence[Any], timeline: Timeline) -> None:
    count = len(timeline.places)
    stays = [dwell_times(labels, count) for labels in sets]
    share = [shares(labels, count) for labels in sets]
    for i, (axes, place) in enumerate(zip(panels, timeline.places, strict=True)):
        for k, color in enumerate(LINES):
            lengths = stays[k][i]
            if len(lengths):
                at = np.arange(1, len(lengths) + 1) / len(lengths)
                axes.step(lengths, at, where="post", color=color, linewidth=1.3, label=LABELS[k])
        percent = " / ".join(f"{100 * part[i]:.0f}" for part in share)
        axes.set_title(f"{place.replace('_', ' ')}\n{percent} %", fontsize=8)
        axes.set(xscale="log", xlim=(1, 1440), ylim=(0, 1), xticks=(1, 10, 100, 1000))
        axes.set_xticklabels(["1", "10", "100", "1000"], fontsize=7)
        axes.set_xlabel("stay [min]", fontsize=8)
    panels[0].set_ylabel("share of the stays\nthat are over")
    panels[0].legend(frameon=False, fontsize=7, loc="lower right")
