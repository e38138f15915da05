"""The report of a study: one self-contained HTML page, its figures, and its tables as files."""

import base64
import html
import math
import re
from collections.abc import Callable, Iterator, Sequence
from datetime import timedelta
from pathlib import Path
from statistics import median_high
from typing import TYPE_CHECKING, Any

from fleet2d.configuration.problems import counted
from fleet2d.errors import ArtifactError, InputError, os_errors_as
from fleet2d.studies.answers import NOISE, RESIDUAL, Comparison
from fleet2d.studies.figures import over_time
from fleet2d.studies.intervals import ENOUGH_UNITS, LEVEL
from fleet2d.studies.rollout import RolloutAnswer
from fleet2d.studies.sentences import (
    INTERVAL,
    MAX_METRICS,
    StudyAnswer,
    cells_of,
    html_table,
    text_of,
)
from fleet2d.studies.sentences import number as shown_number
from fleet2d.studies.specification import PairedComparison

if TYPE_CHECKING:
    import polars as pl
    from matplotlib.figure import Figure

    from fleet2d.studies.reader import Study


# The number of values of an axis that are listed.
MAX_VALUES = 12
MAX_SHARES = 3  # sources of the variance of a metric
# The numbers of characters above which a name is shortened, and that it keeps at least.
LONG_NAME = 16
SHORT_NAME = 6
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
        self.answer = StudyAnswer(study)
        labels = {
            column: study.complete[column].unique(maintain_order=True).drop_nulls().to_list()
            for column in study.columns
        }
        self.counts = {column: len(values) for column, values in labels.items()}
        self.units = tuple(c for c in self.meta.populations if self.counts[c] > 1)
        self.axes = tuple(
            c
            for c in study.columns
            if c not in (*self.meta.populations, *self.meta.features) and self.counts[c] > 1
        )
        self.names = {c: short_names(labels[c]) for c in self.meta.populations}

    def sections(self) -> Iterator[str]:
        """Yield the page, section by section."""
        yield from self._head()
        for number, comparison in enumerate(self.answer.asked):
            yield from self._comparison(number, comparison)
        if self.meta.rollout is not None:
            yield from self._rollout()
        if self.meta.fleet:
            yield from self._fleet()
        yield from self._numbers()
        yield from self._methods()
        yield from self._failures()
        if self.meta.source:
            yield f"<h2>The study file</h2><pre>{html.escape(self.meta.source)}</pre>"

    def _head(self) -> Iterator[str]:
        counts = self.study.counts
        meta = self.meta
        yield f"<h1>{html.escape(meta.name)}</h1>{self.study.answer._repr_html_()}"
        if meta.notes:
            yield f"<p>{html.escape(meta.notes)}</p>"
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
            values = [text_of(self._name(column, label)) for label in labels[:MAX_VALUES]]
            if len(labels) > MAX_VALUES:
                values.append("…")
            rows.append([column, kind, str(len(labels)), ", ".join(values)])
        yield html_table(["axis", "its values are", "number", "which"], rows, text=(0, 1, 3))
        for column in self.units:
            if (count := self.counts[column]) < ENOUGH_UNITS:
                yield _warning(
                    f"There are only {count} values of {column}: a kind that is rare among all may"
                    f" be missing. {ENOUGH_UNITS} or more are better."
                )
        yield '<p><a href="#methods">How answers were computed, and what columns mean</a></p>'

    def _comparison(self, number: int, asked: PairedComparison) -> Iterator[str]:
        metric = asked.metric
        ((axis, reference),) = asked.against.items()
        yield f"<h2>{html.escape(f'{metric} by {axis}, against {text_of(reference)}')}</h2>"
        found = self.answer.tables[number]
        if isinstance(found, InputError):
            yield _warning(str(found))
            return
        yield from self._compared(f"compare-{number + 1}", metric, asked, found)

    def _compared(
        self, name: str, metric: str, asked: PairedComparison, found: list[Comparison]
    ) -> Iterator[str]:
        """Yield the table and the figures of a comparison."""
        import polars as pl

        from fleet2d.studies.figures import draw_comparison, draw_course, draw_unit_differences

        ((axis, reference),) = asked.against.items()
        label = self.meta.with_unit(metric)
        table = pl.DataFrame([each.row() for each in found], infer_schema_length=None)
        yield self._figure(draw_comparison(table, axis, reference, label), name)
        within = (axis, *asked.within)
        yield self._frame(table, name, within)
        for each in found:
            labels = ", ".join(map(text_of, each.labels.values()))
            words = html.escape(each.verdict)
            words = f"<b>{words}</b>" if each.is_clear else words
            yield f"<p>{html.escape(labels)}: {words}.</p>"
        ratios = [each.variance_ratio for each in found if math.isfinite(each.variance_ratio)]
        if any(ratios):
            yield (
                f"<p>Differences are taken in pairs with the same homes, people and seeds; their"
                f" variance is {shown_number(1 / median_high(filter(None, ratios)))} of that of"
                " unpaired differences.</p>"
            )
        unit = self.units[0] if self.units else None
        if unit is not None and unit != axis:
            others = [column for column in asked.within if column != unit]
            rows = self._shortened(self.study.differences(metric, asked.against, unit, others))
            yield f"<h3>in each {html.escape(unit)}</h3>"
            figure = draw_unit_differences(rows, (axis, *others), unit, label)
            yield self._figure(figure, f"{name}-{unit}")
        course = over_time(self.study, metric)
        if course is not None and course["day"].n_unique() > 1:
            yield "<h3>over time</h3>"
            figure = draw_course(course, label, axis, self.units)
            yield self._figure(figure, f"{_file_name(metric)}-time")

    def _numbers(self) -> Iterator[str]:
        """Yield one table of all metrics, those of comparisons first: their means, by axis."""
        import polars as pl

        study = self.study
        asked = [comparison.metric for comparison in self.answer.asked]
        known = [name for name in dict.fromkeys([*asked, *study.metrics]) if name in study.metrics]
        means = []
        shares = []
        overlapping = []
        for metric in known[:MAX_METRICS]:
            for axis in (*self.axes, None):
                table = study.summary(metric, [axis] if axis else [], self.units)
                for row in table.to_dicts():
                    value = text_of(row.pop(axis)) if axis else "all"
                    label = f"{axis} = {value}" if axis else value
                    means.append({"number": self.meta.with_unit(metric), "in": label, **row})
            of_it = study.shares(metric)
            largest = of_it.head(MAX_SHARES).extend(of_it.tail(1)).unique(maintain_order=True)
            shares += [{"number": self.meta.with_unit(metric), **row} for row in largest.to_dicts()]
            if of_it["share"].sum() > 1 + NOISE:
                overlapping.append(metric)
        if means:
            yield "<h2>All numbers</h2>"
            yield self._frame(pl.DataFrame(means, infer_schema_length=None), "numbers", ("in",))
        if shares:
            yield "<h3>What their variance is due to</h3>"
            yield self._frame(pl.DataFrame(shares), "variance", ("source",))
        if overlapping:
            names = html.escape(", ".join(overlapping))
            yield f"<p>Shares overlap, as not all combinations have a number, of {names}.</p>"
        outputs = dict.fromkeys(metric.partition(".")[0] for metric in known)
        yield f"<dl>{''.join(map(self._described, outputs))}</dl>"
        if len(known) > MAX_METRICS:
            more = len(known) - MAX_METRICS
            yield f"<p>{more} more numbers are in <code>variants.parquet</code>.</p>"

    def _described(self, metric: str) -> str:
        """Return a metric with its description; empty if it has none."""
        fact = self.meta.metrics.get(metric)
        if fact is None or not fact.description:
            return ""
        return f"<dt>{html.escape(metric)}</dt><dd>{html.escape(fact.description)}</dd>"

    def _methods(self) -> Iterator[str]:
        """Yield a paragraph that can be cited, and the names of the units."""
        times = self.study.complete["simulated_s"]
        combinations = math.prod(self.counts[axis] for axis in self.axes)
        units = " and ".join(f"{self.counts[c]} values of {c}" for c in self.units)
        sizes = ", ".join(f"{self.counts[axis]} values of {axis}" for axis in self.axes)
        number = len(self.answer.comparisons)
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
                " Student's t and the same after Hall's (1992) transformation, which corrects for"
                " skewness, three quarters of the way to the wider end. p"
                f" values belong to the same intervals. From fewer than {ENOUGH_UNITS} units an"
                " interval can't be told: a kind that is one in ten may be missing among them; p is"
                " then that of the exact sign test."
            )
        if number:
            text += (
                f" Those of the {number} comparisons of this report were also corrected by Holm's"
                " (1979) method, and intervals by Bonferroni's: in 95 % of studies all of them"
                " hold. Effect sizes are Cohen's d of paired differences."
            )
        yield f'<h2 id="methods">Methods</h2><p>{html.escape(text)}</p>'
        terms = "".join(f"<dt>{term}</dt><dd>{text}</dd>" for term, text in GLOSSARY.items())
        yield f"<h3>columns of tables</h3><dl>{terms}</dl>"
        for column, names in self.names.items():
            rows = [[short, label] for label, short in names.items() if short != label]
            if rows:
                yield f"<h3>names of {html.escape(column)}</h3>"
                yield html_table(["in this report", "name"], rows, text=(0, 1))

    def _rollout(self) -> Iterator[str]:
        """Yield the looks at a rollout, day by day."""
        try:
            found = RolloutAnswer(self.study)
        except InputError:
            return  # the answer says why
        yield "<h2>The rollout day by day</h2>"
        yield self._figure(found.figure(), "rollout")
        yield self._frame(found.table, "rollout", ("date",))

    def _fleet(self) -> Iterator[str]:
        """Yield percentiles, the worst robots and groups, by compared or judged metrics."""
        asked = {c.metric: c.against for c in reversed(self.answer.asked)}
        judged = [name for name in self.study.metrics if self.study.better(name)]
        for metric in list(dict.fromkeys([*asked, *judged]))[:MAX_METRICS]:
            name = f"fleet_{_file_name(metric)}"
            yield f"<h2>{html.escape(self.meta.with_unit(metric))} over robots</h2>"
            yield self._frame(self.study.percentiles(metric), f"{name}_percentiles")
            found = self.study.groups(metric, asked.get(metric))
            if len(found):
                yield f"<h3>groups{' of differences' if metric in asked else ''}</h3>"
                yield self._frame(found, f"{name}_groups", ("group",))
            if self.study.better(metric):
                yield "<h3>the worst 1 %</h3>"
                rows = self.study.worst(metric)
                texts = [c for c, kind in rows.schema.items() if str(kind) == "String"]
                yield self._frame(rows, f"{name}_worst", texts)

    def _failures(self) -> Iterator[str]:
        failures = self.study.failures
        if len(failures):
            yield "<h2>Failures</h2>"
            table = failures.select("variant", *self.study.columns, "error").head(50)
            yield self._frame(table, "failures", (*self.study.columns, "error"))

    def _name(self, column: str, label: Any) -> Any:
        """Return a label as the report shows it."""
        return self.names.get(column, {}).get(label, label)

    def _shortened(self, frame: "pl.DataFrame") -> "pl.DataFrame":
        """Return a frame with the short names of units."""
        import polars as pl

        changes = []
        for column, names in self.names.items():
            if column in frame.columns and list(names) != list(names.values()):
                changes.append(pl.col(column).replace(names))
        return frame.with_columns(changes)

    def _figure(self, figure: "Figure", name: str) -> str:
        """Write a figure to a file; return it as an HTML image."""
        from fleet2d.viewing.pictures.floorplan import save_figure

        path = self.folder / "figures" / f"{_file_name(name)}.svg"
        save_figure(figure, path)
        data = base64.b64encode(path.read_bytes()).decode()
        return f'<img alt="{html.escape(name)}" src="data:image/svg+xml;base64,{data}">'

    def _frame(self, frame: "pl.DataFrame", name: str, text: Sequence[str] = ()) -> str:
        """Write a data frame as CSV; return it as HTML. `text` names its columns of text."""
        frame.write_csv(self.folder / "tables" / f"{name}.csv")
        head, rows = cells_of(frame.to_dicts())
        texts = (0, *(i for i, c in enumerate(frame.columns) if c in text))
        file = f'<p class="files"><a href="tables/{name}.csv">CSV</a></p>'
        return html_table(head, rows, texts, GLOSSARY) + file


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
    starts = _shortest_unique(texts, lambda text, length: text[:length])
    ends = _shortest_unique(texts, lambda text, length: f"…{text[-length:]}")
    shortest = min(starts, ends, key=lambda names: max(map(len, names)))
    return dict(zip(labels, shortest, strict=True))


def _shortest_unique(texts: Sequence[str], part_of: Callable[[str, int], str]) -> list[str]:
    """Return the shortest part of each text that tells different texts apart."""
    length = SHORT_NAME
    while True:
        parts = [part_of(text, length) for text in texts]
        if len(set(parts)) == len(set(texts)):
            return parts
        length += 1


def _file_name(metric: str) -> str:
    return re.sub(r"[^\w-]+", "_", metric)


def _warning(text: str) -> str:
    return f'<p class="warning">{html.escape(text)}</p>'
