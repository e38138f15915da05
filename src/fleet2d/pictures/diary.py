"""A diary: the activities of a persona on some days, as text and as a picture."""

from collections import Counter
from collections.abc import Sequence
from datetime import date
from pathlib import Path

import matplotlib as mpl
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from fleet2d.configuration.units import WEEKDAYS
from fleet2d.pictures.theme import apply_theme
from fleet2d.routines.interruptions import without_interruptions
from fleet2d.routines.life import Life
from fleet2d.routines.persona import Persona
from fleet2d.routines.planner import FINISHES, INTERRUPTS, RESUMES, Episode

MONDAY = date(2026, 1, 5)
DAY_S, HOUR_S = 86_400, 3_600
INTERRUPTING = (INTERRUPTS, FINISHES)
# End of a strip [hours]: a day lasts from waking up to the next waking up.
HOURS = 34
SLEEP_COLOR, AWAY_COLOR, NEED_COLOR = "#3b4a63", "#e3e3e3", "#111111"
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
            indent = "    " if episode.role in INTERRUPTING else ""
            again = " (goes on)" if episode.role == RESUMES else ""
            away = " (out)" if persona.activity(episode.activity).away else ""
            text = f"{indent}{episode.activity.replace('_', ' ')}{away}{again}"
            lines.append(
                f"  {_clock(episode.begin)}  {_length(episode.end - episode.begin):>10}  {text}"
            )
    return [*lines, *_summary(days)]


def _summary(days: Days) -> list[str]:
    counts = Counter(d.activity for _, episodes in days for d in episodes if d.role in INTERRUPTING)
    rates = ", ".join(
        f"{name.replace('_', ' ')} {count / len(days):.1f}" for name, count in counts.most_common()
    )
    return [f"interruptions a day: {rates}"] if rates else []


def _clock(time_s: int) -> str:
    return f"{time_s // HOUR_S % 24:02}:{time_s // 60 % 60:02}"


def _length(time_s: int) -> str:
    if time_s < 60:
        return f"{time_s} s"
    hours, minutes = divmod((time_s + 30) // 60, 60)
    return f"{hours} h {minutes:02} min" if hours else f"{minutes} min"


def draw_diary(persona: Persona, name: str, days: Days, target: Path) -> None:
    """Draw a strip for each day: planned activities as a band, interruptions as marks above it."""
    colors = _colors(persona, days)
    figure = Figure(figsize=(13, 1.2 + 0.55 * len(days)), layout="constrained")
    axes = figure.subplots()
    for row, (_, episodes) in enumerate(days):
        for episode in without_interruptions(episodes):
            span = (episode.begin / HOUR_S, (episode.end - episode.begin) / HOUR_S)
            axes.broken_barh([span], (row, 0.62), facecolors=colors[episode.activity])
        marks = [
            (episode.begin / HOUR_S, max(episode.end - episode.begin, 120) / HOUR_S)
            for episode in episodes
            if episode.role in INTERRUPTING
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
    apply_theme(figure).savefig(target, dpi=130)


def _colors(persona: Persona, days: Days) -> dict[str, str | tuple[float, ...]]:
    names = {
        episode.activity for _, episodes in days for episode in without_interruptions(episodes)
    }
    all_colors = mpl.colormaps["tab20"].colors  # type: ignore[attr-defined]
    palette = [color for i, color in enumerate(all_colors) if i not in GREYS]
    home = [n for n in sorted(names) if n != "sleep" and not persona.activity(n).away]
    colors: dict[str, str | tuple[float, ...]] = {"sleep": SLEEP_COLOR}
    colors |= {name: palette[i % len(palette)] for i, name in enumerate(home)}
    return colors | {n: AWAY_COLOR for n in sorted(names) if persona.activity(n).away}
