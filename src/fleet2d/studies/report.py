"""The report of a study: one self-contained HTML page, and its figures as files."""

import base64
import html
import math
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from statistics import median_high
from typing import TYPE_CHECKING, Any

from fleet2d.errors import ArtifactError, InputError
from fleet2d.studies.answers import FEW_UNITS
from fleet2d.studies.figures import over_time
from fleet2d.studies.specification import PairedComparison

if TYPE_CHECKING:
    import polars as pl
    from matplotlib.figure import Figure

    from fleet2d.studies.reader import Study


MAX_METRICS = 12
MAX_SHARES = 8
STYLE = """
body{font:15px/1.5 system-ui,sans-serif;max-width:56em;margin:2em auto;padding:0 1em;color:#2d3138}
h1{font-size:1.6em}
h2{font-size:1.25em;margin-top:2.2em;border-top:1px solid #d8dbe0;padding-top:1em}
h3{font-size:1em;margin:1.4em 0 .3em}table{border-collapse:collapse;font-size:.85em;margin:.6em 0}
th,td{padding:.2em .8em .2em 0;text-align:right;border-bottom:1px solid #e6e8ec}
th:first-child,td:first-child,td.text,th.text{text-align:left}img{max-width:100%}
.warning{background:#fdf3e1;padding:.5em .8em;border-left:4px solid #c26a12}
code,pre{font-size:.85em;background:#f4f5f7}pre{padding:.8em;overflow:auto}
"""


def write_report(study: "Study", folder: Path) -> Path:
    """Write `report.html` and its figures into a folder; return the page.

    Raises:
        ArtifactError: No variant is complete.
        InputError: matplotlib, polars or scipy is missing, or the folder can't be created.
    """
    from fleet2d.pictures.floorplan import drawing_style

    if not study.counts.complete:
        raise ArtifactError(f"{study.location} has no complete variant: run it first")
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"{folder} can't be created: {error.strerror}; name another --out"
        ) from error
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
    """The sections of a report; figures are written to files on the way."""

    def __init__(self, study: "Study", folder: Path) -> None:
        self.study, self.folder = study, folder
        self.units = tuple(c for c in study.meta.populations if study.variants[c].n_unique() > 1)
        self.axes = tuple(
            c
            for c in study.columns
            if c not in study.meta.populations and study.variants[c].drop_nulls().n_unique() > 1
        )

    def sections(self) -> Iterator[str]:
        """Yield the page, section by section."""
        yield from self._head()
        for number, comparison in enumerate(self.study.meta.compare):
            yield from self._comparison(number, comparison)
        metrics = self._metrics()
        for metric in metrics:
            yield from self._metric(metric)
        more = len(self.study.metrics) - len(metrics)
        if more:
            yield f"<p>{more} more numbers are in <code>variants.parquet</code>.</p>"
        yield from self._failures()
        yield from self._source()

    def _head(self) -> Iterator[str]:
        counts, meta = self.study.counts, self.study.meta
        yield f"<h1>{html.escape(meta.name)}</h1>"
        if meta.description:
            yield f"<p>{html.escape(meta.description)}</p>"
        yield (
            f"<p>{counts.complete} of {counts.total} variants complete, {counts.failed} failed."
            f" {html.escape(meta.code)}.</p>"
        )
        rows = []
        for column in self.study.columns:
            labels = self.study.variants[column].unique(maintain_order=True).to_list()
            values = ", ".join(map(_text, labels[:12])) + (", …" if len(labels) > 12 else "")
            rows.append([column, str(len(labels)), values])
        yield _table(["axis", "values", "which"], rows, text=(0, 2))
        yield from self._warnings(counts.total - counts.complete)

    def _warnings(self, missing: int) -> Iterator[str]:
        if missing:
            yield _warning(f"{missing} variants have no results: the answers below leave them out.")
        for column in self.units:
            count = self.study.variants[column].n_unique()
            if count < FEW_UNITS:
                yield _warning(
                    f"There are only {count} values of {column}: intervals are wide and uncertain."
                    f" {FEW_UNITS} or more are better."
                )
        for column in self.study.meta.populations:
            if column not in self.units:
                yield _warning(f"There is only one {column}: answers hold for that one only.")

    def _comparison(self, number: int, comparison: PairedComparison) -> Iterator[str]:
        from fleet2d.studies.figures import draw_comparison

        metric, against = comparison.metric, comparison.against
        ((axis, reference),) = against.items()
        yield f"<h2>{html.escape(f'{metric} by {axis}, against {_text(reference)}')}</h2>"
        try:
            table = self.study.paired(metric, against, comparison.by, comparison.within)
        except InputError as error:
            yield _warning(str(error))
            return
        yield self._figure(draw_comparison(table, axis, reference, metric), f"compare-{number + 1}")
        yield _frame(table.drop("variance_ratio"), text=(axis, "verdict", *comparison.within))
        ratios = [r for r in table["variance_ratio"].to_list() if r and math.isfinite(r)]
        if ratios:
            yield (
                f"<p>Differences are taken in pairs with the same homes, people and seeds; their"
                f" variance is {_number(1 / median_high(ratios))} of that of"
                " unpaired differences.</p>"
            )

    def _metrics(self) -> list[str]:
        """Return the metrics of the report, those of comparisons first."""
        compared = [comparison.metric for comparison in self.study.meta.compare]
        ordered = dict.fromkeys([*compared, *self.study.metrics])
        return [name for name in ordered if name in self.study.metrics][:MAX_METRICS]

    def _metric(self, metric: str) -> Iterator[str]:
        from fleet2d.studies.figures import draw_course, draw_distribution, draw_means

        study, name = self.study, _file_name(metric)
        frame = study._with_metric(metric)
        if not len(frame):
            return
        yield f"<h2>{html.escape(metric)}</h2>"
        if lacking := study.counts.complete - len(frame):
            yield _warning(f"{lacking} complete variants have no such number.")
        axes = self.axes or self.units[:1]
        tables = {axis: study.summary(metric, [axis], self.units) for axis in axes}
        if tables:
            yield self._figure(draw_means(tables, metric), f"{name}-means")
        for axis, table in tables.items():
            yield f"<h3>by {html.escape(axis)}</h3>{_frame(table, text=(axis,))}"
        main = axes[0] if axes else None
        yield "<h3>distribution over variants</h3>"
        yield self._figure(draw_distribution(frame, metric, main), f"{name}-distribution")
        course = over_time(study, metric)
        if course is not None and course["day"].n_unique() > 1:
            yield "<h3>over time</h3>"
            yield self._figure(draw_course(course, metric, main, self.units), f"{name}-time")
        effects = study.effects(metric, self.units)
        if len(effects):
            yield f"<h3>main effects</h3>{_frame(effects, text=('axis', 'value'))}"
        shares = study.shares(metric)
        if len(shares):
            yield "<h3>share of the variance, by axis and by interaction</h3>"
            yield _frame(shares.head(MAX_SHARES), text=("source",))

    def _failures(self) -> Iterator[str]:
        failures = self.study.failures
        if len(failures):
            yield "<h2>Failures</h2>"
            table = failures.select("variant", *self.study.columns, "error").head(50)
            yield _frame(table, text=(*self.study.columns, "error"))

    def _source(self) -> Iterator[str]:
        if self.study.meta.source:
            yield f"<h2>The study file</h2><pre>{html.escape(self.study.meta.source)}</pre>"

    def _figure(self, figure: "Figure", name: str) -> str:
        """Write a figure to a file; return it as an HTML image."""
        from fleet2d.pictures.floorplan import save_figure

        path = self.folder / "figures" / f"{name}.svg"
        path.parent.mkdir(exist_ok=True)
        save_figure(figure, path)
        data = base64.b64encode(path.read_bytes()).decode()
        return f'<img alt="{html.escape(name)}" src="data:image/svg+xml;base64,{data}">'


def _file_name(metric: str) -> str:
    return re.sub(r"[^\w-]+", "_", metric)


def _warning(text: str) -> str:
    return f'<p class="warning">{html.escape(text)}</p>'


def _frame(frame: "pl.DataFrame", text: Sequence[str] = ()) -> str:
    """Return a data frame as an HTML table; `text` names its columns of text."""
    text_columns = tuple(i for i, column in enumerate(frame.columns) if column in text)
    rows = [[_text(value) for value in row] for row in frame.rows()]
    return _table([column.replace("_", " ") for column in frame.columns], rows, text_columns)


def _table(head: Sequence[str], rows: Sequence[Sequence[str]], text: Sequence[int] = ()) -> str:
    """Return an HTML table; `text` holds the indices of its columns of text."""

    def cells(tag: str, values: Sequence[str]) -> str:
        return "".join(
            f"<{tag}{' class=text' if i in text else ''}>{html.escape(value)}</{tag}>"
            for i, value in enumerate(values)
        )

    body = "".join(f"<tr>{cells('td', row)}</tr>" for row in rows)
    return f"<table><tr>{cells('th', head)}</tr>{body}</table>"


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
