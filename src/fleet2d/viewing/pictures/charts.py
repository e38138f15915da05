"""Charts of people's days, of how reliable estimates of presence are, and of what people answer."""

from collections import Counter
from collections.abc import Callable, Sequence
from datetime import date, timedelta
from pathlib import Path
from typing import NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from fleet2d.algorithms.presence.belief import ANYONE
from fleet2d.configuration.units import WEEKDAYS
from fleet2d.errors import ArtifactError, InputError
from fleet2d.interactions.interaction import Outcome
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
from fleet2d.runtime.clock import HOUR_S, midnight_of
from fleet2d.runtime.events import EventKind
from fleet2d.runtime.local_time import written
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
        marks = [
            (episode.begin / HOUR_S, max(episode.end - episode.begin, 120) / HOUR_S)
            for episode in episodes
            if episode.role in INTERRUPTION_ROLES
        ]
        axes.broken_barh(marks, (row + 0.66, 0.22), facecolors=NEED_COLOR)
    axes.set_yticks(
        [row + 0.4 for row in range(len(days))],
        [f"{WEEKDAYS[day.weekday()][:3]} {day:%d.%m.}" for day, _ in days],
    )
    axes.set(xlim=(4, HOURS), xlabel="hour", title=f"{name}: {persona.about}")
    axes.set_xticks(range(4, HOURS + 1, 2), [f"{hour % 24}" for hour in range(4, HOURS + 1, 2)])
    axes.invert_yaxis()
    patches = [Patch(color=color, label=label.replace("_", " ")) for label, color in colors.items()]
    patches.append(Patch(color=NEED_COLOR, label="needs and errands"))
    figure.legend(handles=patches, loc="outside lower center", ncols=8, fontsize=7, frameon=False)
    return figure


def _colors(persona: Persona, days: Days) -> dict[str, str | tuple[float, ...]]:
    names = {each.activity for _, day in days for each in without_interruptions(day)}
    all_colors = mpl.colormaps["tab20"].colors  # type: ignore[attr-defined]
    palette = [color for i, color in enumerate(all_colors) if i not in GREYS]
    home = [n for n in sorted(names) if n != "sleep" and not persona.activity(n).away]
    colors: dict[str, str | tuple[float, ...]] = {"sleep": SLEEP_COLOR}
    colors |= {name: palette[i % len(palette)] for i, name in enumerate(home)}
    return colors | {n: AWAY_COLOR for n in sorted(names) if persona.activity(n).away}


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
        ArtifactError: The run has no such table, or it isn't of presence.
    """
    table = run.arrow(algorithm)
    users = run.manifest["entities"]["users"]
    places = len(run.plan.rooms) + 1
    # An update has a row for each place of each user, and of anyone; the last place is away.
    if not {"user", "room", "share"} <= set(table.column_names) or ANYONE not in set(
        table["user"][: places * (len(users) + 1)].to_pylist()
    ):
        raise ArtifactError(
            f"{algorithm} stored {', '.join(table.column_names[2:])}, no room probabilities: choose"
            " a presence algorithm such as ltp or rtp"
        )
    shares = table["share"].to_numpy().reshape(-1, len(users) + 1, places)
    at = "at" if "at" in table.column_names else "step"  # of `belief_table`, of the others
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
    draw_forecasts(algorithm, *forecasts_of(run, algorithm), path)


def draw_forecasts(name: str, belief: F64, truth: I64, path: Path) -> None:
    """Draw the reliability diagram of forecasts, as `draw_reliability`.

    Args:
        name: What forecast them.
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
        measures: What is drawn, a panel for each measure.
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
                axes.set_yscale("log")  # the room of the last sighting is wrong by far
                axes.yaxis.set_major_formatter("{x:g}")
        panels[0].legend(frameon=False)
        figure.tight_layout()


# What came of a request or question, in the order in which it is stacked, and its color.
ANSWER_COLORS = {
    Outcome.ACCEPTED: "#009988",
    Outcome.DEFERRED: "#77aadd",
    Outcome.DECLINED: "#ee7733",
    "no answer": "#bbbbbb",
    "sent away": "#cc3311",
}
SHOWN_AS = {
    Outcome.ACCEPTED: Outcome.ACCEPTED,
    Outcome.DEFERRED: Outcome.DEFERRED,
    Outcome.DECLINED: Outcome.DECLINED,
    Outcome.SENT_AWAY: "sent away",
    Outcome.BANNED: "sent away",
    Outcome.SWITCHED_OFF: "sent away",
}
# Events by which a robot is no longer with the person whom it addressed.
ENDS_TALK = frozenset(
    {EventKind.DELIVERED, EventKind.COLLECTS, EventKind.WITHDRAWS, EventKind.INTERACTION_OVER}
)
MOOD_COLOR = "#aa3377"
EXPIRED_COLOR = "#9a9a9a"
WEEKLY_FROM = 70  # days of a run from which on bars are weeks


class AskedTime(NamedTuple):
    """A time at which a robot addressed a person.

    Attributes:
        robot: The robot.
        user: The person meant.
        text: The interaction and the person meant.
        step: When.
        answer: What came of it: a key of ANSWER_COLORS.
        answered: The step of the answer; None without one.
        end: The step at which the robot had carried it out or withdrew; None if it did neither.
    """

    robot: str
    text: str
    step: int
    answer: str
    answered: int | None = None
    end: int | None = None

    @property
    def user(self) -> str:
        """The person meant."""
        return self.text.rpartition(" ")[2]


def asked_of(run: Run) -> tuple[list[AskedTime], list[AskedTime]]:
    """Return the times that robots addressed people, and the requests that expired, by the events.

    Example:
        >>> import fleet2d
        >>> asked_of(fleet2d.run("simulation.duration=1 h"))
        ([], [])
    """
    events = run.tables["events"]
    asked: list[AskedTime] = []
    expired: list[AskedTime] = []
    open_ones: dict[str, AskedTime] = {}  # by robot
    columns = (events[name].to_pylist() for name in ("step", "entity", "event", "detail"))
    for step, robot, event, detail in sorted(zip(*columns, strict=True), key=lambda row: row[0]):
        if event in ENDS_TALK and robot in open_ones:
            asked.append(open_ones.pop(robot)._replace(end=step))
        elif event == EventKind.ASKS:
            asked += [open_ones.pop(robot)] if robot in open_ones else []
            open_ones[robot] = AskedTime(robot, detail, step, "no answer")
        elif event in SHOWN_AS and robot in open_ones and open_ones[robot].answered is None:
            open_ones[robot] = open_ones[robot]._replace(answer=SHOWN_AS[event], answered=step)
        elif event == EventKind.EXPIRED:
            expired.append(AskedTime(robot, detail, step, event))
    return [*asked, *open_ones.values()], expired


def _hours_of(run: Run) -> Callable[[int], float]:
    """Return the function from steps to hours since the midnight before the run."""
    clock = run.clock
    midnight = midnight_of(clock.start)
    return lambda step: (written(clock.time(step)) - midnight) / timedelta(hours=1)


def answers_figure(run: Run) -> Figure:
    """Return a figure of what people answered: by day or week, and by hour of the day.

    Bars are the times that a robot addressed a person, by answer, and ticks below them requests
    that expired. The line is the person's annoyance, if the run has the metric `interactions`.

    Raises:
        InputError: Robots wanted nothing of anybody.
    """
    asked, expired = asked_of(run)
    pairs = sorted({(each.robot, each.user) for each in [*asked, *expired]})
    if not pairs:
        raise InputError("robots addressed nobody in this run: there are no answers to draw")
    figure = Figure(figsize=(10.67, 0.6 + 2.3 * len(pairs)), dpi=100, facecolor="white")
    panels = figure.subplots(len(pairs), 2, width_ratios=(3, 1), squeeze=False)
    hours_of = _hours_of(run)
    days = 1 + int(hours_of(run.manifest["steps"] - 1) // 24)
    width = 7 if days >= WEEKLY_FROM else 1
    for (robot, user), (by_day, by_hour) in zip(pairs, panels, strict=True):
        own, own_expired = (
            [each for each in times if (each.robot, each.user) == (robot, user)]
            for times in (asked, expired)
        )
        late = [hours_of(each.step) / 24 for each in own_expired]
        times = [(hours_of(each.step), each.answer) for each in own]
        _stack(by_day, [(hours / 24, answer) for hours, answer in times], width, days)
        _stack(by_hour, [(hours % 24, answer) for hours, answer in times], 1, 24)
        by_day.plot(late, np.zeros(len(late)), "|", color=EXPIRED_COLOR, clip_on=False)
        accepted = sum(each.answer == Outcome.ACCEPTED for each in own)
        title = f"{robot} asked {user} {len(own)} times: {accepted} accepted, {len(late)} expired"
        by_day.set_title(title, loc="left", fontsize=10)
        by_day.set(xlabel="day", ylabel="times a week" if width == 7 else "times a day")
        by_hour.set(xlabel="hour of the day", xticks=range(0, 25, 6))
        _draw_annoyance(run, robot, user, by_day)
    place = {"loc": "lower right", "bbox_to_anchor": (1, 1)}
    panels[0, 1].legend(**place, ncols=3, frameon=False, fontsize=7)
    figure.tight_layout()
    return figure


def _stack(axes: Axes, answers: Sequence[tuple[float, str]], width: int, end: int) -> None:
    """Draw the answers in intervals of a width up to an end, stacked."""
    edges = np.arange(0, end + width, width)
    below = np.zeros(len(edges) - 1)
    for answer, color in ANSWER_COLORS.items():
        counts, _ = np.histogram([at for at, each in answers if each == answer], edges)
        middles = edges[:-1] + width / 2
        axes.bar(middles, counts, width * 0.85, bottom=below, color=color, label=answer)
        below += counts
    axes.set_xlim(0, edges[-1])
    axes.spines[["top", "right"]].set_visible(False)


def _draw_annoyance(run: Run, robot: str, user: str, axes: Axes) -> None:
    """Draw the annoyance of a person over the days, if the run has stored it."""
    tables = run.tables
    if "interactions" not in tables or "annoyance" not in tables["interactions"].column_names:
        return
    table = tables["interactions"]
    hours_of = _hours_of(run)
    columns = (table[name].to_pylist() for name in ("asked_at", "robot", "addressed", "annoyance"))
    pairs = zip(*columns, strict=True)
    rows = [(hours_of(at) / 24, value) for at, *pair, value in pairs if pair == [robot, user]]
    if rows:
        mood = axes.twinx()
        mood.plot(*zip(*rows, strict=True), color=MOOD_COLOR, linewidth=1.2)
        mood.set_ylabel("annoyance", color=MOOD_COLOR)
        mood.set_ylim(bottom=0)
        mood.spines["top"].set_visible(False)
