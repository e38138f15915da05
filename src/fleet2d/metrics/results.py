"""Results of metrics as tables: a column for each person or robot, a row for each measure."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple, cast

from fleet2d.configuration.components import lookup
from fleet2d.metrics.metric import Metric

MAX_COLUMNS = 6
"""With more subjects than this, a metric has a row for each of them instead of a column."""


class ResultRow(NamedTuple):
    """A line of the closing table."""

    name: str
    values: Sequence[str]
    unit: str


class ResultTable(NamedTuple):
    """The lines of a metric: the first names its subjects, each of the others has one measure."""

    rows: Sequence[ResultRow]
    hidden: int  # numbers that it leaves out


def blocks_of(results: Mapping[str, Any], configured: Mapping[str, Any]) -> list[ResultTable]:
    """Lay out the results of all metrics that measured something.

    Args:
        results: The result of each metric, such as `Run.metrics`.
        configured: The settings of each metric, of which only the type is read.
    """
    classes = {name: lookup("metric", configured[name]["type"]) for name in results}
    blocks = (block_of(name, cast(type[Metric], classes[name]), results[name]) for name in results)
    return [block for block in blocks if len(block.rows) > 1]


def block_of(metric: str, metric_class: type[Metric], result: Any) -> ResultTable:
    """Lay out the result of a metric: a column for each subject, such as a person.

    Only the numbers next to the subjects are in it, not what is nested in them.
    """
    numbers = dict(_numbers(metric_class.summary(result)))
    depth = min(map(len, numbers), default=0)
    shown = {path: number for path, number in numbers.items() if len(path) == depth}
    everything = list(_numbers(result))
    hidden = len(everything) - len(shown)
    if not any(number for path, number in everything if path not in shown):
        hidden = 0  # zeros alone say nothing more
    subjects = list(dict.fromkeys(path[:-1] for path in shown))
    measures = list(dict.fromkeys(path[-1:] for path in shown))
    has_names_alone = depth == 1 and not any(name in metric_class.units for (name,) in shown)
    if has_names_alone and len(shown) <= MAX_COLUMNS:
        subjects = measures
        measures = [()]
    rows = [ResultRow(metric, [" · ".join(subject) for subject in subjects], "")]
    for measure in measures:
        unit = metric_class.units.get("".join(measure), metric_class.unit)
        values = [
            _text(shown[subject + measure], unit) if subject + measure in shown else ""
            for subject in subjects
        ]
        # A row for each subject has one unit: the first says it for all.
        is_said = has_names_alone and len(rows) > 1
        rows.append(ResultRow("".join(measure), values, "" if is_said else unit))
    return ResultTable(rows, hidden)


def _numbers(result: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Yield the numbers of a result with the names on the way to each."""
    if not isinstance(result, Mapping):
        yield path, result
        return
    for name, value in result.items():
        yield from _numbers(value, (*path, str(name)))


def _text(value: Any, unit: str) -> str:
    """Return a value as text: shares in percent, other numbers with few digits."""
    if not isinstance(value, float):
        return str(value)
    if unit.startswith("share"):
        return f"{100 * value:.1f} %" if value >= 0.001 or value == 0 else "< 0.1 %"
    return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.3g}"
