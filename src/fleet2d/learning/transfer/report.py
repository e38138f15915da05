"""What a transfer experiment says: a table and a figure for each task, and a few sentences."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fleet2d.learning.transfer.driver import DAYS_TABLE
from fleet2d.learning.transfer.specification import ARMS
from fleet2d.storage.files import write_atomically
from fleet2d.studies.intervals import estimate
from fleet2d.studies.reader import Study
from fleet2d.viewing.pictures.floorplan import write_picture

if TYPE_CHECKING:
    import polars as pl
    from matplotlib.figure import Figure

REFERENCE = "real"
PAGE = "report.md"
MARKERS = "osD^v<>Px"


def headline(task: str) -> str:
    """Return the metric by which a task is judged."""
    return "macro_f1" if task == "activity" else "log_loss"


def compared(study: Study, task: str, against: str) -> "pl.DataFrame":
    """Return the paired comparison of the arms of a task with one, by learner and number of days.

    Its intervals hold over homes. `clear_homes` has the homes in which the difference is clear by
    the days of that home alone, better before worse, as `2 + 1`.
    """
    import polars as pl

    metric = headline(task)
    table = study.paired(metric, {"arm": against}, by=("home",), within=("task", "learner", "days"))
    table = table.filter(task=task)
    by_home = {
        key: _clear(study, task, against, *key)
        for key in table.select("arm", "learner", "days").rows()
    }
    better = [_text(by_home[key]) for key in table.select("arm", "learner", "days").rows()]
    return table.with_columns(pl.Series("clear_homes", better, pl.String))


def _text(clear: tuple[int, int]) -> str:
    return f"{clear[0]} / {clear[1]}"


def _clear(
    study: Study, task: str, against: str, arm: str, learner: str, days: int
) -> tuple[int, int]:
    """Return in how many homes an arm has a clearly lower, or higher, log loss by their days."""
    import polars as pl

    rows = study.polars(DAYS_TABLE).filter(
        (pl.col("task") == task) & (pl.col("learner") == learner) & (pl.col("days") == days)
    )
    frame = rows.collect()
    both = frame.filter(arm=arm).join(frame.filter(arm=against), on=["home", "day"], suffix="_of")
    better = worse = 0
    for part in both.partition_by("home"):
        difference = part["log_loss"] - part["log_loss_of"]
        found = estimate(difference.to_list(), {"day": part["day"].to_list()})
        better += found.high < 0
        worse += found.low > 0
    return better, worse


def write_report(study: Study, folder: Path) -> list[str]:
    """Write the tables and the figures of all tasks; return the sentences that sum them up."""
    tasks = study.complete["task"].unique(maintain_order=True).to_list()
    lines = [f"# {study.meta.name}", "", f"{study.meta.description}.", ""]
    sentences: list[str] = []
    for task in tasks:
        metric = headline(task)
        picture = folder / f"{task.replace(' ', '_')}.png"
        write_picture(picture, lambda task=task: draw(study, task))  # type: ignore[misc]
        lines += [f"## {task}", "", *table(study, task), "", f"![{metric}]({picture.name})", ""]
    for task in _told(tasks):
        sentences += sentences_of(study, task)
    lines += [*sentences, "", *study.meta.notes.splitlines()]
    write_atomically(folder / PAGE, "\n".join(lines).encode())
    return sentences


def _told(tasks: Sequence[str]) -> list[str]:
    """Return the tasks that the sentences are about: rooms in an hour, and what else there is."""
    rooms = [task for task in tasks if task.startswith("room")]
    hour = [task for task in rooms if "60" in task] or rooms[:1]
    return [*hour, *(task for task in tasks if task not in rooms)][:2]


def table(study: Study, task: str) -> list[str]:
    """Return the table of a task in Markdown: scores, and differences to real days."""
    metric = headline(task)
    means = study.summary(metric, ["task", "learner", "days", "arm"]).filter(task=task)
    pairs = compared(study, task, REFERENCE) if _has(study, task, REFERENCE) else None
    head = ["learner", "own days", "arm", "homes", metric.replace("_", " ")]
    head += [f"difference to {REFERENCE} (95 % over homes)", "homes clearly better / worse by days"]
    lines = [f"| {' | '.join(head)} |", "| " + " | ".join(["---"] * len(head)) + " |"]
    for row in means.sort("learner", "days", descending=[True, False]).to_dicts():
        cells = [row["learner"], row["days"], row["arm"], row["variants"], f"{row['mean']:.3f}"]
        pair: list[Any] = []
        if pairs is not None and row["arm"] != REFERENCE:
            pair = pairs.filter(arm=row["arm"], learner=row["learner"], days=row["days"]).to_dicts()
        cells += [_difference(pair[0]), pair[0]["clear_homes"]] if pair else ["", ""]
        lines.append(f"| {' | '.join(map(str, cells))} |")
    return lines


def _has(study: Study, task: str, arm: str) -> bool:
    return bool(len(study.complete.filter(task=task, arm=arm)))


def _difference(row: dict[str, Any]) -> str:
    return f"{row['difference']:+.3f} ({row['low']:+.3f} to {row['high']:+.3f})"


def sentences_of(study: Study, task: str) -> list[str]:
    """Return what the comparisons of a task say, two sentences at most."""
    learner = study.complete["learner"][0]
    found = []
    for against, arm in ((REFERENCE, "both"), ("own", "fitted")):
        if not (_has(study, task, against) and _has(study, task, arm)):
            continue
        rows = compared(study, task, against).filter(arm=arm, learner=learner).to_dicts()
        found += [_sentence(task, against, arm, rows)] if rows else []
    return found


def _sentence(task: str, against: str, arm: str, rows: list[dict[str, Any]]) -> str:
    metric = headline(task).replace("_", " ")
    parts = []
    for row in (rows[0], rows[-1]) if len(rows) > 1 else rows:
        homes = row["pairs"]
        good = row["above"] if metric == "macro f1" else row["below"]
        parts.append(
            f"with {row['days']} own days {row['mean']:.3f} instead of {row['reference']:.3f}"
            f" (difference {_difference(row)}; better in {good} of {homes} homes)"
        )
    return f"{task}, {metric}: {ARMS[arm]}, beside {ARMS[against]}: {'; '.join(parts)}."


def draw(study: Study, task: str) -> "Figure":
    """Draw the scores of a task over the number of own days, a panel for each home."""
    from matplotlib.figure import Figure

    from fleet2d.studies.figures import COLORS, DARK

    metric = headline(task)
    learner = study.complete["learner"][0]
    frame = study.with_metric(metric).filter(task=task, learner=learner)
    homes = frame["home"].unique(maintain_order=True).to_list()
    figure = Figure(figsize=(2.9 * max(len(homes), 2), 3.4), dpi=130, layout="constrained")
    panels = figure.subplots(1, len(homes), sharey=True, squeeze=False)[0]
    days = sorted(frame["days"].unique().to_list())
    for panel, home in zip(panels, homes, strict=True):
        for number, (arm, own) in enumerate(_by_arm(frame.filter(home=home))):
            color = COLORS[number % len(COLORS)] if arm != REFERENCE else DARK
            x = [days.index(value) for value in own["days"].to_list()]
            style = {"color": color, "marker": MARKERS[number], "ms": 4, "lw": 1.2}
            panel.plot(x, own[metric].to_list(), label=arm, **style)
        panel.set_xticks(range(len(days)), [str(value) for value in days])
        panel.set_title(home, fontsize=9)
        panel.set_xlabel("days of its own", fontsize=8)
        panel.spines[["top", "right"]].set_visible(False)
    panels[0].set_ylabel(f"{task}: {metric.replace('_', ' ')}", fontsize=8)
    handles: dict[str, Any] = {}
    for panel in panels:
        handles |= dict(zip(*panel.get_legend_handles_labels()[::-1], strict=True))
    figure.legend(
        handles.values(), handles, loc="outside lower center", ncols=9, frameon=False, fontsize=8
    )
    return figure


def _by_arm(frame: "pl.DataFrame") -> "Iterator[tuple[str, pl.DataFrame]]":
    for arm in ARMS:
        own = frame.filter(arm=arm).sort("days")
        if len(own):
            yield arm, own
