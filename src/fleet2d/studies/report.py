"""The report of a study: one self-contained HTML page, its figures, and its tables as files."""

import base64
import html
import itertools
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from datetime import timedelta
from functools import cached_property
from pathlib import Path
from statistics import median_high
from typing import TYPE_CHECKING, Any

from fleet2d.configuration.problems import counted
from fleet2d.errors import ArtifactError, InputError, os_errors_as
from fleet2d.studies.answers import NOISE, RESIDUAL, judged
from fleet2d.studies.figures import over_time
from fleet2d.studies.intervals import ENOUGH_UNITS, LEVEL
from fleet2d.studies.specification import PairedComparison

if TYPE_CHECKING:
    import polars as pl
    from matplotlib.figure import Figure

    from fleet2d.studies.reader import Study


MAX_METRICS = 12
MAX_VALUES = 12  # of an axis that are listed
MAX_SHARES = 8
MAX_INTERACTIONS = 3  # pairs of axes with a table of cell means, for each metric
MAX_CELLS = 60  # of such a table
# from how many characters on names are shortened, and to how many
LONG_NAME = 16
SHORT_NAME = 6
INTERVAL = f"{LEVEL:.0%} interval"
HEADINGS = {"p_holm": "p (Holm)", "effect_size": "effect size", "low": INTERVAL}
# Columns that stand elsewhere on the page.
NOT_SHOWN = ("high", "doubt", "variance_ratio", "needed", "to", "better", "clear", "verdict")
GLOSSARY = {
    "mean": "mean over the units, such as homes and seeds, each of equal weight",
    "reference": "the same of the value that all others are compared with",
    "difference": "mean difference to the reference over pairs with the same home, people and seed",
    INTERVAL: f"contains the true value in about {LEVEL:.0%} of such studies; see Methods",
    "above": "pairs in which the value is above the reference",
    "below": "pairs in which the value is below the reference",
    "relative": "difference over the size of the reference",
    "effect size": "difference over the standard deviation of the units' differences (Cohen's d)",
    "p": "probability of such a difference, or a larger one, if there were none",
    "p (Holm)": "the same, corrected for the number of comparisons in this report",
    "pairs": "pairs of runs; then the number of units of each kind",
    "deviation": "standard deviation of single runs",
    "variants": "number of runs",
    "share": f"share of the variance of runs; {RESIDUAL}: what axes and their pairs don't explain",
}
STYLE = Path(__file__).with_suffix(".css").read_text(encoding="utf-8")


def write_report(study: "Study", folder: Path) -> Path:
    """Write `report.html`, `figures/NAME.svg` and `tables/NAME.csv`; return the page.

    Raises:
        ArtifactError: No variant is complete.
        InputError: matplotlib, polars or scipy is missing, or the folder can't be created.
    """
    from fleet2d.viewing.pictures.floorplan import drawing_style

    if not study.counts.complete:
        failed = study.counts.failed
        advice = f"{failed} failed, see fleet2d study status" if failed else "run it first"
        raise ArtifactError(f"{study.location} has no complete variant: {advice}")
    with os_errors_as(InputError, f"{folder} can't be created", "; name another --out"):
        for name in ("figures", "tables"):
            (folder / name).mkdir(parents=True, exist_ok=True)
    page = _Page(study, folder)
    with drawing_style():
        content = "\n".join(page.sections())
    path = folder / "report.html"
    title = html.escape(study.meta.name)
    path.write_text(
        f'<!doctype html><html lang="en"><meta charset="utf-8"><title>{title}</title>'
        f"<style>{STYLE}</style><body>\n{content}\n</body></html>\n",
        encoding="utf-8",
    )
    return path


class _Page:
    """The sections of a report; figures and tables are written to files on the way."""

    def __init__(self, study: "Study", folder: Path) -> None:
        self.study = study
        self.meta = study.meta
        self.folder = folder
        labels = {
            column: study.complete[column].unique(maintain_order=True).drop_nulls().to_list()
            for column in study.columns
        }
        self.counts = {column: len(values) for column, values in labels.items()}
        self.units = tuple(c for c in self.meta.populations if self.counts[c] > 1)
        self.axes = tuple(
            c for c in study.columns if c not in self.meta.populations and self.counts[c] > 1
        )
        self.names = {c: short_names(labels[c]) for c in self.meta.populations}

    def sections(self) -> Iterator[str]:
        """Yield the page, section by section."""
        yield from self._head()
        for number, comparison in enumerate(self.study.comparisons):
            yield from self._comparison(number, comparison)
        metrics = self._metrics()
        for metric in metrics:
            yield from self._metric(metric)
        if more := len(self.study.metrics) - len(metrics):
            yield f"<p>{more} more numbers are in <code>variants.parquet</code>.</p>"
        yield from self._methods()
        yield from self._failures()
        if self.meta.source:
            yield f"<h2>The study file</h2><pre>{html.escape(self.meta.source)}</pre>"

    def _head(self) -> Iterator[str]:
        counts = self.study.counts
        meta = self.meta
        yield f"<h1>{html.escape(meta.name)}</h1>"
        for text in filter(None, (meta.description, meta.notes)):
            yield f"<p>{html.escape(text)}</p>"
        if meta.tags:
            yield f"<p>Tags: {html.escape(', '.join(meta.tags))}.</p>"
        yield (
            f"<p>{counts.complete} of {counts.total} variants complete, {counts.failed} failed."
            f" {html.escape(meta.code)}.</p>"
        )
        rows = []
        for column in self.study.columns:
            labels = self.study.variants[column].unique(maintain_order=True).to_list()
            kind = "units of intervals" if column in meta.populations else "compared"
            values = [_text(self._name(column, label)) for label in labels[:MAX_VALUES]]
            if len(labels) > MAX_VALUES:
                values.append("…")
            rows.append([column, kind, str(len(labels)), ", ".join(values)])
        yield _table(["axis", "its values are", "number", "which"], rows, text=(0, 1, 3))
        yield from self._warnings(counts.total - counts.complete)
        yield '<p><a href="#methods">How answers were computed, and what columns mean</a></p>'

    def _warnings(self, missing: int) -> Iterator[str]:
        if missing:
            yield _warning(f"{missing} variants have no results: the answers below leave them out.")
        for column in self.units:
            if (count := self.counts[column]) < ENOUGH_UNITS:
                yield _warning(
                    f"There are only {count} values of {column}: a kind that is rare among all may"
                    f" be missing. {ENOUGH_UNITS} or more are better."
                )
        for column in self.meta.populations:
            if column not in self.units:
                yield _warning(f"There is only one {column}: answers hold for that one only.")

    @cached_property
    def _comparisons(self) -> "list[pl.DataFrame | InputError]":
        """The table of each comparison, or why there is none; p values corrected over all."""
        import polars as pl

        tables: list[pl.DataFrame | InputError] = []
        for c in self.study.comparisons:
            try:
                tables.append(self.study.paired(c.metric, c.against, c.by, c.within))
            except InputError as error:
                tables.append(error)
        found = iter(judged([table for table in tables if isinstance(table, pl.DataFrame)]))
        return [next(found) if isinstance(table, pl.DataFrame) else table for table in tables]

    def _comparison(self, number: int, comparison: PairedComparison) -> Iterator[str]:
        from fleet2d.studies.figures import draw_comparison, draw_unit_differences

        metric = comparison.metric
        against = comparison.against
        name = f"compare-{number + 1}"
        ((axis, reference),) = against.items()
        yield f"<h2>{html.escape(f'{metric} by {axis}, against {_text(reference)}')}</h2>"
        yield self._describe(metric)
        table = self._comparisons[number]
        if isinstance(table, InputError):
            yield _warning(str(table))
            return
        label = self._label(metric)
        yield self._figure(draw_comparison(table, axis, reference, label), name)
        within = (axis, *comparison.within)
        yield self._frame(table, name, within)
        for row in table.to_dicts():
            labels = ", ".join(_text(row[column]) for column in within)
            words = html.escape(row["verdict"])
            words = f"<b>{words}</b>" if row["clear"] else words
            yield f"<p>{html.escape(labels)}: {words}.</p>"
        ratios = [r for r in table["variance_ratio"].to_list() if r and math.isfinite(r)]
        if ratios:
            yield (
                f"<p>Differences are taken in pairs with the same homes, people and seeds; their"
                f" variance is {_number(1 / median_high(ratios))} of that of"
                " unpaired differences.</p>"
            )
        unit = self.units[0] if self.units else None
        if unit is not None and unit != axis:
            others = [column for column in comparison.within if column != unit]
            rows = self._shortened(self.study.differences(metric, against, unit, others))
            yield f"<h3>in each {html.escape(unit)}</h3>"
            yield self._figure(
                draw_unit_differences(rows, (axis, *others), unit, label), f"{name}-{unit}"
            )

    def _metrics(self) -> list[str]:
        """Return the metrics of the report, those of comparisons first."""
        compared = [comparison.metric for comparison in self.study.comparisons]
        ordered = dict.fromkeys([*compared, *self.study.metrics])
        return [name for name in ordered if name in self.study.metrics][:MAX_METRICS]

    def _metric(self, metric: str) -> Iterator[str]:
        from fleet2d.studies.figures import draw_course, draw_means

        study = self.study
        name = _file_name(metric)
        label = self._label(metric)
        frame = self._shortened(study.with_metric(metric))
        if not len(frame):
            return
        yield f"<h2>{html.escape(metric)}</h2>{self._describe(metric)}"
        if lacking := study.counts.complete - len(frame):
            yield _warning(f"{lacking} complete variants have no such number.")
        axes = self.axes or self.units[:1]
        tables = {a: self._shortened(study.summary(metric, [a], self.units)) for a in axes}
        if tables:
            yield self._figure(draw_means(tables, label), f"{name}-means")
        for axis, table in tables.items():
            yield f"<h3>by {html.escape(axis)}</h3>"
            yield self._frame(table, f"{name}-by-{_file_name(axis)}", (axis,))
        main = axes[0] if axes else None
        course = over_time(study, metric)
        if course is not None and course["day"].n_unique() > 1:
            yield "<h3>over time</h3>"
            yield self._figure(draw_course(course, label, main, self.units), f"{name}-time")
        yield from self._interactions(metric, label)
        shares = study.shares(metric)
        if len(shares):
            yield "<h3>share of the variance, by axis and by interaction</h3>"
            largest = shares.head(MAX_SHARES - 1).extend(shares.tail(1)).unique(maintain_order=True)
            yield self._frame(largest, f"{name}-variance", ("source",))
            if shares["share"].sum() > 1 + NOISE:
                yield "<p>Shares overlap, as not all combinations have this number.</p>"

    def _interactions(self, metric: str, label: str) -> Iterator[str]:
        from fleet2d.studies.figures import draw_interaction

        pairs = itertools.combinations(self.axes, 2)
        small = [p for p in pairs if self.counts[p[0]] * self.counts[p[1]] <= MAX_CELLS]
        for first, second in small[:MAX_INTERACTIONS]:
            name = f"{_file_name(metric)}-{_file_name(first)}-{_file_name(second)}"
            table = self.study.summary(metric, [first, second], self.units)
            yield f"<h3>{html.escape(f'{first} × {second}')}</h3>"
            yield self._figure(draw_interaction(table, first, second, label), name)
            yield self._frame(table, name, (first, second))

    def _methods(self) -> Iterator[str]:
        """Yield a paragraph that can be cited, and the names of the units."""
        times = self.study.complete["simulated_s"]
        combinations = math.prod(self.counts[axis] for axis in self.axes)
        units = " and ".join(f"{self.counts[c]} values of {c}" for c in self.units)
        sizes = ", ".join(f"{self.counts[axis]} values of {axis}" for axis in self.axes)
        number = sum(len(t) for t in self._comparisons if not isinstance(t, InputError))
        settings = f"{counted(combinations, 'combination')} of settings"
        if sizes:
            settings += f" ({sizes})"
        code = self.meta.code.partition(",")[0].capitalize()
        simulated = f"{'were' if combinations > 1 else 'was'} simulated by {code}"
        if units:
            simulated += f" over {units}"
        text = (
            f"{settings} {simulated}: {len(times)} runs of"
            f" {timedelta(seconds=times.median())} (h:mm:ss) each in the median."
            " Runs with the same home, people and seed share the people's lives to the second, so"
            " settings were compared in pairs."
        )
        if self.units:
            text += (
                f" Means weigh units equally. {INTERVAL}s treat {' and '.join(self.units)} as"
                " random and crossed: standard errors come from a random-effects analysis of"
                " variance with Satterthwaite's degrees of freedom, and intervals are those of"
                " Student's t after Hall's (1992) transformation, which corrects for skewness. p"
                f" values belong to the same intervals. From fewer than {ENOUGH_UNITS} units an"
                " interval can't be told: a kind that is one in ten may be missing among them."
            )
        if number:
            text += (
                f" Those of the {number} comparisons of this report were also corrected by Holm's"
                " (1979) method. Effect sizes are Cohen's d of paired differences."
            )
        yield f'<h2 id="methods">Methods</h2><p>{html.escape(text)}</p>'
        terms = "".join(f"<dt>{term}</dt><dd>{text}</dd>" for term, text in GLOSSARY.items())
        yield f"<h3>columns of tables</h3><dl>{terms}</dl>"
        for column, names in self.names.items():
            rows = [[short, label] for label, short in names.items() if short != label]
            if rows:
                yield f"<h3>names of {html.escape(column)}</h3>"
                yield _table(["in this report", "name"], rows, text=(0, 1))

    def _failures(self) -> Iterator[str]:
        failures = self.study.failures
        if len(failures):
            yield "<h2>Failures</h2>"
            table = failures.select("variant", *self.study.columns, "error").head(50)
            yield self._frame(table, "failures", (*self.study.columns, "error"))

    def _describe(self, metric: str) -> str:
        """Return a paragraph of what a metric is, and its unit."""
        facts = self.meta.metrics.get(metric.split(".")[0])
        unit = self.meta.unit(metric)
        description = facts.description if facts else ""
        text = f"{description} {f'Unit: {unit}.' if unit else ''}".strip()
        return f"<p>{html.escape(text)}</p>" if text else ""

    def _label(self, metric: str) -> str:
        """Return a metric with its unit, as axes of figures name it."""
        unit = self.meta.unit(metric)
        return f"{metric} [{unit}]" if unit else metric

    def _name(self, column: str, label: Any) -> Any:
        """Return a label as the report shows it."""
        return self.names.get(column, {}).get(label, label)

    def _shortened(self, frame: "pl.DataFrame") -> "pl.DataFrame":
        """Return a frame with the short names of units."""
        import polars as pl

        changes = [
            pl.col(column).replace(names)
            for column, names in self.names.items()
            if column in frame.columns and any(short != label for label, short in names.items())
        ]
        return frame.with_columns(changes)

    def _figure(self, figure: "Figure", name: str) -> str:
        """Write a figure to a file; return it as an HTML image."""
        from fleet2d.viewing.pictures.floorplan import save_figure

        path = self.folder / "figures" / f"{_file_name(name)}.svg"
        save_figure(figure, path)
        data = base64.b64encode(path.read_bytes()).decode()
        return f'<img alt="{html.escape(name)}" src="data:image/svg+xml;base64,{data}">'

    def _frame(self, frame: "pl.DataFrame", name: str, text: Sequence[str] = ()) -> str:
        """Write a data frame as CSV; return it as HTML. `text`: its columns of text."""
        frame.write_csv(self.folder / "tables" / f"{name}.csv")
        columns = [c for c in frame.columns if c not in NOT_SHOWN]
        head = [HEADINGS.get(c, c.removeprefix("n_").replace("_", " ")) for c in columns]
        rows = [[_cell(c, row) for c in columns] for row in frame.to_dicts()]
        texts = tuple(i for i, c in enumerate(columns) if c in text)
        file = f'<p class="files"><a href="tables/{name}.csv">CSV</a></p>'
        return _table(head, rows, texts) + file


def short_names(labels: Sequence[Any]) -> dict[Any, Any]:
    """Return for each label a name to show: of long ones the shortest start or end that is unique.

    >>> short_names(["658e5214673c7a4e25b458e56bdb6144", "65ae5214673c7a4e25b458e56bdb6144"])
    {'658e5214673c7a4e25b458e56bdb6144': '658e52', '65ae5214673c7a4e25b458e56bdb6144': '65ae52'}
    >>> short_names(["flat", 3])
    {'flat': 'flat', 3: 3}
    """
    texts = [str(label) for label in labels]
    longest = max(map(len, texts), default=0)
    if longest <= LONG_NAME:
        return dict(zip(labels, labels, strict=True))
    lengths = range(SHORT_NAME, longest + 1)
    starts = ([text[:n] for text in texts] for n in lengths)
    ends = ([f"…{text[-n:]}" for text in texts] for n in lengths)
    unique = (next(n for n in names if len(set(n)) == len(set(texts))) for names in (starts, ends))
    shortest = min(unique, key=lambda names: max(map(len, names)))
    return dict(zip(labels, shortest, strict=True))


def _file_name(metric: str) -> str:
    return re.sub(r"[^\w-]+", "_", metric)


def _warning(text: str) -> str:
    return f'<p class="warning">{html.escape(text)}</p>'


def _table(head: Sequence[str], rows: Sequence[Sequence[str]], text: Sequence[int] = ()) -> str:
    """Return an HTML table; `text` holds the indices of its columns of text."""

    def cells(tag: str, values: Sequence[str]) -> str:
        found = []
        for i, value in enumerate(values):
            kind = " class=text" if i in text else ""
            hint = f' title="{GLOSSARY[value]}"' if tag == "th" and value in GLOSSARY else ""
            found.append(f"<{tag}{kind}{hint}>{html.escape(value)}</{tag}>")
        return "".join(found)

    body = "".join(f"<tr>{cells('td', row)}</tr>" for row in rows)
    return f"<table><tr>{cells('th', head)}</tr>{body}</table>"


def _cell(column: str, row: Mapping[str, Any]) -> str:
    """Return a cell of a table of answers as text."""
    value = row[column]
    if column == "low":
        return "can't tell" if row["doubt"] else f"{_number(value)} to {_number(row['high'])}"
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return "–"
    if column in ("p", "p_holm"):
        return "< 0.001" if value < 0.001 else f"{value:.3f}"
    return f"{value:.1%}".replace("%", " %") if column in ("relative", "share") else _text(value)


def _text(value: Any) -> str:
    if value is None:
        return "–"
    return _number(value) if isinstance(value, float) else str(value)


def _number(value: float) -> str:
    """Return a number with three significant digits.

    >>> _number(0.12345), _number(1234.5), _number(float("nan"))
    ('0.123', '1,234', '–')
    """
    if not math.isfinite(value):
        return "–"
    return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.3g}"
