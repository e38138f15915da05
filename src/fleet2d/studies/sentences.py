"""Conclusions of studies, tests and searches: a question, two to six sentences, a small table."""

import html
import itertools
import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import timedelta
from functools import cached_property
from typing import TYPE_CHECKING, Any

from fleet2d.configuration.problems import counted
from fleet2d.errors import InputError
from fleet2d.runtime.clock import DAY_S, HOUR_S
from fleet2d.studies.answers import MAX_P, Comparison, StudyAnswers, judged
from fleet2d.studies.intervals import ENOUGH_UNITS, LEVEL, plural

if TYPE_CHECKING:
    import polars as pl

    from fleet2d.studies.specification import PairedComparison

MAX_METRICS = 12
MAX_NAMED = 3  # findings of a kind that sentences name; the table has all
MAX_ROWS = 12
INTERVAL = f"{LEVEL:.0%} interval"
HEADINGS = {"p_holm": "p (Holm)", "effect_size": "effect size", "low": INTERVAL}
NOT_SHOWN = ("high", "doubt", "variance_ratio", "needed", "clear", "verdict")
"""Columns of answers that stand in another one, or elsewhere on a page."""


@dataclass(frozen=True)
class Conclusion:
    """The findings of a study, a test or a search.

    Attributes:
        question: The question.
        sentences: The answer.
        table: Its numbers: rows of the same columns, such as `low`, `high` and `doubt`. Texts show
            the first twelve.
    """

    question: str
    sentences: tuple[str, ...]
    table: tuple[Mapping[str, Any], ...] = ()

    @property
    def content(self) -> dict[str, Any]:
        """The conclusion as JSON data, which has no NaN."""
        rows = [_without_nan(row) for row in self.table]
        return {"question": self.question, "sentences": list(self.sentences), "table": rows}

    def __str__(self) -> str:
        """Return the conclusion as lines of text."""
        lines = [self.question] if self.question else []
        lines += self.sentences
        if self.table:
            head, rows = cells_of(self.table[:MAX_ROWS])
            lines += ["", *_aligned([head, *rows]), *self._rows_left_out]
        return "\n".join(lines)

    @property
    def _rows_left_out(self) -> list[str]:
        """A line with the number of rows that a text doesn't show, if any."""
        more = len(self.table) - MAX_ROWS
        return [f"… and {counted(more, 'more row')}"] if more > 0 else []

    def _repr_html_(self) -> str:
        """Return the conclusion as HTML, for notebooks and pages."""
        parts = [f"<h3>{html.escape(self.question)}</h3>"] if self.question else []
        parts += [f"<p>{html.escape(' '.join(self.sentences))}</p>"]
        if self.table:
            parts.append(html_table(*cells_of(self.table[:MAX_ROWS])))
        return "".join([*parts, *(f"<p>{rest}</p>" for rest in self._rows_left_out)])


def is_missing(value: Any) -> bool:
    """Return whether a value of a table is None, NaN or infinite."""
    return value is None or (isinstance(value, float) and not math.isfinite(value))


def _without_nan(row: Mapping[str, Any]) -> dict[str, Any]:
    return {name: None if is_missing(value) else value for name, value in row.items()}


def _aligned(rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """Yield rows of cells as lines, with columns as wide as their widest cells."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        yield "  ".join(map(str.ljust, row, widths)).rstrip()


def cells_of(rows: Sequence[Mapping[str, Any]]) -> tuple[list[str], list[list[str]]]:
    """Return the headings and the cells of a table of answers, without the columns not shown."""
    columns = [column for column in rows[0] if column not in NOT_SHOWN]
    head = [HEADINGS.get(c, c.removeprefix("n_").replace("_", " ")) for c in columns]
    return head, [_cells(row, columns) for row in rows]


def _cells(row: Mapping[str, Any], columns: Sequence[str]) -> list[str]:
    return [cell(column, row) for column in columns]


def html_table(
    head: Sequence[str],
    rows: Sequence[Sequence[str]],
    text: Sequence[int] = (0,),
    hints: Mapping[str, str] | None = None,
) -> str:
    """Return an HTML table; `text` holds the indices of its columns of text, `hints` is by name."""

    def line(tag: str, values: Sequence[str]) -> str:
        found = []
        for i, value in enumerate(values):
            kind = " class=text" if i in text else ""
            hint = (hints or {}).get(value) if tag == "th" else None
            title = f' title="{html.escape(hint)}"' if hint else ""
            found.append(f"<{tag}{kind}{title}>{html.escape(value)}</{tag}>")
        return f"<tr>{''.join(found)}</tr>"

    body = "".join(line("td", row) for row in rows)
    return f"<table>{line('th', head)}{body}</table>"


def cell(column: str, row: Mapping[str, Any]) -> str:
    """Return a cell of a table of answers as text."""
    value = row[column]
    if column == "low":
        return "can't tell" if row["doubt"] else f"{number(value)} to {number(row['high'])}"
    if is_missing(value):
        return "–"
    if column in ("p", "p_holm"):
        return "< 0.001" if value < 0.001 else f"{value:.3f}"
    return f"{value:.1%}".replace("%", " %") if column in ("relative", "share") else text_of(value)


def text_of(value: Any) -> str:
    """Return a value of a table as text."""
    if value is None:
        return "–"
    return number(value) if isinstance(value, float) else str(value)


def number(value: float) -> str:
    """Return a number with three significant digits.

    >>> number(0.12345), number(1234.5), number(float("nan"))
    ('0.123', '1,234', '–')
    """
    if not math.isfinite(value):
        return "–"
    return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.3g}"


def in_words(time_span: timedelta) -> str:
    """Return a duration in its largest fitting unit.

    >>> in_words(timedelta(seconds=200)), in_words(timedelta(hours=30))
    ('3.3 min', '30.0 h')
    """
    seconds = time_span.total_seconds()
    units = (
        ("years", 31_557_600),
        ("months", 2_629_800),
        ("days", DAY_S),
        ("h", HOUR_S),
        ("min", 60),
    )
    for name, unit in units:
        if seconds >= unit * (2 if unit >= DAY_S else 1):
            return f"{seconds / unit:,.1f} {name}"
    return f"{seconds:.1f} s"


def listed(parts: Sequence[str], of: str) -> str:
    """Return the first parts of a sentence, and how many more there are.

    >>> listed(["a", "b", "c", "d", "e"], "difference")
    'a; b; c; and 2 more differences'
    """
    more = len(parts) - MAX_NAMED
    rest = [f"and {counted(more, f'more {of}')}"] if more > 0 else []
    return "; ".join([*parts[:MAX_NAMED], *rest])


class StudyAnswer:
    """Writes the answer of a study.

    Attributes:
        tables: The results of each comparison that the study asks for, corrected for all of them;
            or why there are none.
    """

    def __init__(self, study: StudyAnswers) -> None:
        """Make the comparisons that the study asks for, or else one of each axis and metric."""
        self._study = study
        self.asked = study.comparisons or tuple(self._default_comparisons())
        found: list[list[Comparison] | InputError] = []
        for c in self.asked:
            try:
                found.append(study.compared(c.metric, c.against, c.by, c.within))
            except InputError as error:
                found.append(error)
        corrected = iter(judged([c for each in found if isinstance(each, list) for c in each]))
        self._lacking = [self._values_without(c) for c in self.asked]
        self.tables: list[list[Comparison] | InputError] = [
            each if isinstance(each, InputError) else list(itertools.islice(corrected, len(each)))
            for each in found
        ]

    def _default_comparisons(self) -> "Iterator[PairedComparison]":
        """Yield the comparisons of a study that names none: by one number of each metric.

        That is the first that can be judged: among all numbers, some would differ by chance.
        """
        from fleet2d.studies.specification import PairedComparison

        study = self._study
        judged_numbers = [name for name in study.metrics if study.better(name)]
        firsts: dict[str, str] = {}
        for name in judged_numbers or study.metrics:
            firsts.setdefault(name.partition(".")[0], name)
        for metric in list(firsts.values())[:MAX_METRICS]:
            for axis in self._varying(study.variants, populations=False):
                if axis in study.meta.features:
                    continue  # robots never differ by one feature alone
                values = study.with_metric(metric)[axis].drop_nulls()
                if len(values):
                    yield PairedComparison(metric=metric, against={axis: values[0]})

    def _values_without(self, c: "PairedComparison") -> list[str]:
        """Return why a comparison lacks values of its axis, in words."""
        study = self._study
        (axis,) = c.against
        is_known = axis in study.columns and c.metric in study.metrics
        if not is_known or not study.counts.complete:
            return []
        known = {None, *study.with_metric(c.metric)[axis]}
        complete = {*study.complete[axis]}
        return [
            f"{c.metric} with {axis} = {text_of(value)}, as none of its variants"
            f" {'has it' if value in complete else 'is complete'}"
            for value in study.variants[axis].unique(maintain_order=True)
            if value not in known
        ]

    def _varying(self, frame: "pl.DataFrame", *, populations: bool) -> list[str]:
        """Return the axes, or the populations, with several values in some variants."""
        study = self._study
        return [
            column
            for column in study.columns
            if (column in study.populations) == populations
            and frame[column].drop_nulls().n_unique() > 1
        ]

    @cached_property
    def comparisons(self) -> list[Comparison]:
        """All comparisons that could be made."""
        return [c for table in self.tables if isinstance(table, list) for c in table]

    def answer(self) -> Conclusion:
        """Return the answer."""
        study = self._study
        clear_first = sorted(self.comparisons, key=lambda c: not c.is_clear)
        table = [self._row(each) for each in clear_first]
        if not study.counts.complete:
            sentences = [self._no_findings(), self._cost()]
        else:
            if not self.comparisons:
                table = [self._mean(metric) for metric in study.metrics[:MAX_METRICS]]
            sentences = list(filter(None, [*self._findings(), self._left_out(), self._cost()]))
        return Conclusion(study.meta.description or study.meta.name, tuple(sentences), tuple(table))

    def _no_findings(self) -> str:
        study = self._study
        counts = study.counts
        missing = f"; {counts.missing} have not run" if counts.missing else ""
        return (
            f"Nothing can be told, as no variant is complete: of {counts.total} variants"
            f" {counts.failed} failed{self._why_failed()}{missing}."
        )

    def _why_failed(self) -> str:
        """Return the most frequent reason of failures, as the end of a clause."""
        failed = self._study.variants.filter(status="failed")
        reasons = Counter(failed["error"].to_list())
        return "".join(f", most often because: {reason}" for reason, _ in reasons.most_common(1))

    def _findings(self) -> Iterator[str]:
        """Yield the findings, for whom they hold, and what remains open."""
        if not self._study.metrics:
            yield "Nothing can be told, as no variant has a metric that is a number."
        elif not self.asked:
            yield "There is nothing to compare: the table has the means."
        many = len(self.comparisons)
        clear = [c for c in self.comparisons if c.is_clear]
        clear.sort(key=lambda c: c.p_holm)
        if clear:
            corrected = f" (corrected for {many} comparisons)" if many > 1 else ""
            findings = [self._finding(c) for c in clear]
            yield f"Clear{corrected}: {listed(findings, 'difference')}."
            subject = "The first" if len(clear) > 1 else "It"
            yield self._for_whom(clear[0], subject)
        elif many:
            yield f"No difference is clear, of {counted(many, 'comparison')}."
        same = [c for c in self.comparisons if c.is_same]
        open_ones = [c for c in self.comparisons if not c.is_same and not c.is_clear]
        if same:
            parts = [f"{c.metric} with {self._sides(c)}" for c in same]
            yield f"The same in every pair: {listed(parts, 'comparison')}."
        problems = []
        for lacking, table in zip(self._lacking, self.tables, strict=True):
            problems += lacking
            if isinstance(table, InputError) and not lacking:
                problems.append(str(table))
        if open_ones or problems:
            parts = [*(self._unclear(c) for c in open_ones), *problems]
            yield f"Can't be told: {listed(parts, 'comparison')}."

    def _sides(self, c: Comparison) -> str:
        (axis, value), *within = c.labels.items()
        where = "".join(f", {column} = {text_of(label)}" for column, label in within)
        return f"{axis} = {text_of(value)} against {text_of(c.reference)}{where}"

    def _finding(self, c: Comparison) -> str:
        """Return a difference in words, with its interval or how many units agree."""
        unit = self._study.meta.unit(c.metric)
        judgement = f", which is {c.outcome}" if c.better else ""
        low, high = sorted(map(abs, c.interval))
        amount = f"by {number(abs(c.difference))} ({number(low)} to {number(high)})"
        if unit:
            amount += f" [{unit}]"
        if c.estimate.doubt:
            side = int(c.direction == "lower")
            parts = []
            for kind, signs in c.estimate.signs.items():
                number_of_units = c.units.get(kind, sum(signs))
                parts.append(f"{signs[side]} of {number_of_units} {plural(kind)}")
            amount = f"in {' and '.join(parts)}; by how much can't be told, as {c.estimate.doubt}"
        return f"{c.metric} is {c.direction}{judgement}, with {self._sides(c)}, {amount}"

    def _unclear(self, c: Comparison) -> str:
        if math.isnan(c.p):
            return f"{c.metric} with {self._sides(c)}: there is only one pair"
        mean = f"where the mean is {number(abs(c.difference))} {c.direction}"
        if not c.estimate.doubt:
            mean += f", or anything from {' to '.join(map(number, c.interval))}"
        if c.p_holm < MAX_P:
            agreeing = c.above if c.difference > 0 else c.below
            why = f", but only {agreeing} of {c.pairs} pairs are"
        else:
            why = f" (p {cell('p', {'p': c.p_holm})}): {c.needed} would show that"
        return f"{c.metric} with {self._sides(c)}, {mean}{why}"

    def _for_whom(self, c: Comparison, subject: str) -> str:
        """Return in which homes and other groups a difference is the other way round."""
        study = self._study
        (axis, _), *within = c.labels.items()
        frame = study.with_metric(c.metric)
        varying = self._varying(frame, populations=True)
        kinds = [kind for kind in varying if kind != study.columns[-1]] or varying
        kinds += self._varying(frame, populations=False)
        sign = 1 if c.difference > 0 else -1
        parts = []
        columns = [column for column, _ in within]
        for kind in kinds:
            if kind in c.labels:
                continue
            rows = study.differences(c.metric, {axis: c.reference}, kind, columns).drop_nulls(kind)
            if kind in study.meta.features and rows[kind].n_unique() > MAX_ROWS:
                continue  # a number, such as an area
            for column, label in c.labels.items():
                rows = rows.filter(rows[column].eq_missing(label))
            other = rows.filter(rows["difference"] * sign < 0)[kind].to_list()
            part = f"{len(other) or 'none'} of {len(rows)} {plural(kind)}"
            if 0 < len(other) <= MAX_NAMED:
                part += f" ({', '.join(map(text_of, other))})"
            parts.append(part)
        return f"{subject} is the other way round in {' and '.join(parts)}." if parts else ""

    def _left_out(self) -> str:
        study = self._study
        counts = study.counts
        parts = []
        if counts.total > counts.complete:
            lost = f"{counts.total - counts.complete} of {counts.total} variants have no result"
            parts.append(lost + self._why_failed())
        for metric in dict.fromkeys(c.metric for c in self.asked):
            known = study.with_metric(metric) if metric in study.metrics else ()
            if lacking := counts.complete - len(known):
                parts.append(f"{lacking} complete variants lack {metric}")
        numbers = {kind: study.variants[kind].n_unique() for kind in study.populations}
        first = next((kind for kind, count in numbers.items() if count > 1), "")
        few = [
            f"{count} {plural(kind) if count > 1 else kind}"
            for kind, count in numbers.items()
            if count < ENOUGH_UNITS and kind != first
        ]
        if few:
            parts.append(f"it holds for {' and '.join(few)} only")
        text = "; ".join(parts)
        return f"{text[0].upper()}{text[1:]}." if text else ""

    def _cost(self) -> str:
        study = self._study
        simulated = in_words(timedelta(seconds=float(study.complete["simulated_s"].sum())))
        wall = in_words(timedelta(seconds=float(study.variants["wall_s"].sum())))
        runs = counted(study.counts.complete, "run")
        return f"It took {runs}: {simulated} simulated in {wall} of computing."

    def _row(self, c: Comparison) -> dict[str, Any]:
        low, high = c.interval
        return {
            "number": self._study.meta.with_unit(c.metric),
            "compared": self._sides(c),
            "mean": c.mean,
            "reference": c.reference_mean,
            "difference": c.difference,
            "low": low,
            "high": high,
            "doubt": c.estimate.doubt,
            "p_holm": c.p_holm,
            "outcome": c.outcome,
        }

    def _mean(self, metric: str) -> dict[str, Any]:
        (row,) = self._study.summary(metric, []).to_dicts()
        return {"number": self._study.meta.with_unit(metric), **row}
