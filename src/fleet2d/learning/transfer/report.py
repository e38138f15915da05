"""The report of a transfer experiment: a table and a figure for each task, and sentences."""

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fleet2d.learning.datasets.generate import markdown_table
from fleet2d.learning.transfer.driver import DAYS_TABLE
from fleet2d.learning.transfer.specification import ARMS
from fleet2d.runtime.determinism import sum_in_order
from fleet2d.storage.files import write_atomically
from fleet2d.studies.intervals import satterthwaite, student_quantile
from fleet2d.studies.reader import Study
from fleet2d.viewing.pictures.floorplan import write_picture

if TYPE_CHECKING:
    import polars as pl
    from matplotlib.figure import Figure

REFERENCE = "real"
BY_DAY = ("difference_by_day", "low_by_day", "high_by_day")
PAGE = "report.md"
MARKERS = "osD^v<>Px"


def headline(task: str) -> str:
    """Return the metric by which a task is judged."""
    return "macro_f1" if task == "activity" else "log_loss"


def compared(study: Study, task: str, against: str) -> "pl.DataFrame":
    """Return the paired comparison of the arms of a task with one, by learner and number of days.

    Its intervals `low` to `high` hold over homes, of which there are few. `difference_by_day`, with
    `low_by_day` and `high_by_day`, is the difference in log loss in these homes over their days.
    """
    import polars as pl

    metric = headline(task)
    table = study.paired(metric, {"arm": against}, by=("home",), within=("task", "learner", "days"))
    table = table.filter(task=task)
    scores = study.polars(DAYS_TABLE).filter(pl.col("task") == task).collect()
    keys = ["home", "learner", "days", "day"]
    pairs = scores.join(scores.filter(arm=against), on=keys, suffix="_of")
    pairs = pairs.with_columns(less=pl.col("log_loss") - pl.col("log_loss_of"))
    found = []
    for arm, learner, days in table.select("arm", "learner", "days").iter_rows():
        homes = pairs.filter(arm=arm, learner=learner, days=days).partition_by("home")
        found.append(over_days([home["less"].to_list() for home in homes]))
    return table.hstack(pl.DataFrame(found, BY_DAY, orient="row"))


def over_days(homes: Sequence[Sequence[float]]) -> tuple[float, float, float]:
    """Return the mean over homes of their mean differences, and its 95 % interval over days.

    Homes are fixed and their days a sample: the variances of the homes' means add up, with the
    degrees of freedom of Satterthwaite.

    Example:
        >>> [round(value, 2) for value in over_days([[0.1, 0.2, 0.3], [0.3, 0.5, 0.4]])]
        [0.3, 0.19, 0.41]
    """
    means = [sum_in_order(values) / len(values) for values in homes]
    mean = sum_in_order(means) / len(means)
    if min(map(len, homes)) < 2:  # a single day has no variance
        return mean, math.nan, math.nan
    variances = [float(np.var(v, ddof=1)) / len(v) / len(homes) ** 2 for v in homes]
    variance = sum_in_order(variances)
    if not variance:
        return mean, mean, mean
    freedom = satterthwaite(variances, [len(values) - 1 for values in homes])
    reach = student_quantile(freedom) * math.sqrt(variance)
    return mean, mean - reach, mean + reach


def write_report(study: Study, folder: Path) -> list[str]:
    """Write the tables and the figures of all tasks; return the sentences that sum them up."""
    tasks = study.complete["task"].unique(maintain_order=True).to_list()
    lines = [f"# {study.meta.name}", "", f"{study.meta.description}.", ""]
    sentences: list[str] = []
    for task in tasks:
        metric = headline(task)
        picture = folder / f"{task.replace(' ', '_')}.png"
        write_picture(picture, lambda task=task: draw(study, task))  # type: ignore[misc]
        lines += [f"## {task}", "", table(study, task), f"![{metric}]({picture.name})", ""]
    for task in _summarized(tasks):
        sentences += sentences_of(study, task)
    lines += [*sentences, "", *study.meta.notes.splitlines()]
    write_atomically(folder / PAGE, "\n".join(lines).encode())
    return sentences


def _summarized(tasks: Sequence[str]) -> list[str]:
    """Return the tasks of the sentences: the room in an hour, and one other than rooms."""
    rooms = [task for task in tasks if task.startswith("room")]
    hour = [task for task in rooms if "60" in task] or rooms[:1]
    return [*hour, *(task for task in tasks if task not in rooms)][:2]


def table(study: Study, task: str) -> str:
    """Return the table of a task in Markdown: scores, and differences to real days."""
    metric = headline(task)
    means = study.summary(metric, ["task", "learner", "days", "arm"]).filter(task=task)
    pairs = compared(study, task, REFERENCE) if _has_arm(study, task, REFERENCE) else None
    head = ["learner", "own days", "arm", "homes", metric.replace("_", " ")]
    head += [f"difference to {REFERENCE} (95 % over homes)", "better in"]
    head += ["difference in log loss (95 % over the days of these homes)"]
    rows = []
    for row in means.sort("learner", "days", descending=[True, False]).to_dicts():
        cells = [row["learner"], row["days"], row["arm"], row["variants"], f"{row['mean']:.3f}"]
        pair: list[Any] = []
        if pairs is not None and row["arm"] != REFERENCE:
            pair = pairs.filter(arm=row["arm"], learner=row["learner"], days=row["days"]).to_dicts()
        cells += _compared_cells(pair[0], task) if pair else [""] * 3
        rows.append(cells)
    return markdown_table(head, rows)


def _has_arm(study: Study, task: str, arm: str) -> bool:
    """Return whether another arm was tested beside one."""
    import polars as pl

    of_task = study.complete.filter(task=task)
    others = of_task.filter(pl.col("arm") != arm)
    pairs = others.join(of_task.filter(arm=arm), on=["home", "learner", "days"])
    return not pairs.is_empty()


def _compared_cells(row: dict[str, Any], task: str) -> list[str]:
    over_homes = interval(row["difference"], row["low"], row["high"])
    by_day = interval(*(row[name] for name in BY_DAY))
    return [over_homes, f"{_better(row, task)} of {row['pairs']}", by_day]


def interval(mean: float, low: float, high: float) -> str:
    """Return a difference with its interval as text."""
    return f"{mean:+.3f} ({low:+.3f} to {high:+.3f})"


def _better(row: dict[str, Any], task: str) -> int:
    """Return in how many homes an arm is better than the reference."""
    return int(row["above"] if headline(task) == "macro_f1" else row["below"])


def sentences_of(study: Study, task: str) -> list[str]:
    """Return the results of a task's comparisons in at most two sentences."""
    learner = study.complete["learner"][0]
    found = []
    for against, arm in ((REFERENCE, "both"), ("own", "fitted")):
        if not (_has_arm(study, task, against) and _has_arm(study, task, arm)):
            continue
        rows = compared(study, task, against).filter(arm=arm, learner=learner).to_dicts()
        if rows:
            found.append(_sentence(task, against, arm, rows))
    return found


def _sentence(task: str, against: str, arm: str, rows: list[dict[str, Any]]) -> str:
    metric = headline(task).replace("_", " ")
    parts = []
    for row in (rows[0], rows[-1]) if len(rows) > 1 else rows:
        by_day = (row[name] for name in BY_DAY)
        parts.append(
            f"with {row['days']} own days {row['mean']:.3f} instead of {row['reference']:.3f},"
            f" better in {_better(row, task)} of {row['pairs']} homes (log loss over their days"
            f" {interval(*by_day)})"
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
            color = DARK if arm == REFERENCE else COLORS[number % len(COLORS)]
            x = list(map(days.index, own["days"]))
            style = {"color": color, "marker": MARKERS[number], "ms": 4, "lw": 1.2}
            panel.plot(x, own[metric].to_list(), label=arm, **style)
        panel.set_xticks(range(len(days)), [str(value) for value in days])
        panel.set_title(home, fontsize=9)
        panel.set_xlabel("days of its own", fontsize=8)
        panel.spines[["top", "right"]].set_visible(False)
    panels[0].set_ylabel(f"{task}: {metric.replace('_', ' ')}", fontsize=8)
    handle_of: dict[str, Any] = {}
    for panel in panels:
        handles, labels = panel.get_legend_handles_labels()
        handle_of |= dict(zip(labels, handles, strict=True))
    style = {"loc": "outside lower center", "ncols": 9, "frameon": False, "fontsize": 8}
    figure.legend(handle_of.values(), handle_of, **style)
    return figure


def _by_arm(frame: "pl.DataFrame") -> "Iterator[tuple[str, pl.DataFrame]]":
    for arm in ARMS:
        own = frame.filter(arm=arm).sort("days")
        if len(own):
            yield arm, own
