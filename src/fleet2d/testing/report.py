"""The page of a gate: one HTML file to send, without references to other files."""

import base64
import html
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

from fleet2d.expectations.verdict import amount
from fleet2d.testing.answer import answer, headline
from fleet2d.testing.claim import percent
from fleet2d.testing.gate import HELD, NOT_RUN, Gate, PairedChange, Tally, listed
from fleet2d.viewing.page_data import POLICY, write_file

MAX_BUILDS = 12
"""The number of builds in the page: the newest of the history."""
STYLE = Path(__file__).with_suffix(".css").read_text(encoding="utf-8")
KIND_OF = {HELD: "good", NOT_RUN: "odd"}
"""Class of a cell with a verdict; "bad" for others."""


def write_report(
    path: Path, gate: Gate, hints: Mapping[Tally, str], pictures: Mapping[Tally, Path]
) -> None:
    """Write the page of a gate.

    Args:
        path: The file; an existing one is replaced.
        gate: The gate.
        hints: The commands that show failures.
        pictures: Pictures of the worst moments of failures.

    Raises:
        InputError: The file can't be written.
    """
    title = html.escape(headline(gate))
    kind = "good" if gate.passes else "bad"
    parts = [
        "<!doctype html>",
        '<html lang="en"><head><meta charset="utf-8">',
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f"<title>{title}</title><style>{STYLE}</style></head><body>",
        f'<h1>Release gate</h1><p class="verdict {kind}">{title}.</p>',
        *_answer_lines(gate),
        *_coverage(gate),
        *_comparison(gate),
        *_failures(gate, hints, pictures),
        *_all(gate),
        *_trend(gate),
        "</body></html>\n",
    ]
    write_file(path, "\n".join(parts).encode())


def _answer_lines(gate: Gate) -> Iterator[str]:
    """Yield the sentences of the answer after the verdict."""
    items = map(html.escape, answer(gate).sentences[1:])
    yield f"<ul>{''.join(f'<li>{item}</li>' for item in items)}</ul>"


def _coverage(gate: Gate) -> Iterator[str]:
    """Yield the matrix of requirements and tests."""
    if not gate.coverage:
        return
    tests = list(dict.fromkeys(test for row in gate.coverage for test, _ in row.verdicts))
    rows = []
    for row in gate.coverage:
        cells = [_cell(row.requirement), _cell(row.text), _verdict(row.verdict)]
        for test in tests:
            found = {name: v for (t, name), v in row.verdicts.items() if t == test}
            text = ", ".join(f"{name}: {verdict}" for name, verdict in found.items())
            cells.append(_cell(text, _worst(found.values())))
        rows.append(cells)
    yield "<h2>Requirements</h2>"
    names = [gate.short[test] for test in tests]
    yield _table(["requirement", "", "verdict", *names], rows)


def _comparison(gate: Gate) -> Iterator[str]:
    """Yield how the two builds differ on the same trials."""
    if not gate.against:
        return
    title = f"{gate.build or 'This build'} compared with {gate.against}"
    yield f"<h2>{html.escape(title)}</h2>"
    yield (
        "<p>Both ran the same trials. p is the exact probability of such a difference if the builds"
        " don't differ (McNemar; by homes where there are several), corrected by Holm's method for"
        " all expectations.</p>"
    )
    rows = []
    for change in gate.changes:
        kind = {-1: "bad", 1: "good"}.get(change.direction, "odd" if change.worse else "")
        cells = [
            _cell(gate.short[change.test]),
            _cell(change.name),
            _cell(f"{change.pairs}"),
            _cell(f"{len(change.worse)}", kind if change.worse else ""),
            _cell(f"{len(change.better)}", kind if change.better else ""),
            _cell(f"{change.p_holm:.2g}"),
            _cell(_shift(change), "odd" if change.is_narrower else ""),
            _cell(listed(change.worse or change.better)),
        ]
        rows.append(cells)
    head = ["test", "expectation", "trials", "worse", "better", "p (Holm)", "margin", "which"]
    yield _table(head, rows) if rows else "<p>No trial is the same: nothing is compared.</p>"


def _shift(change: PairedChange) -> str:
    if change.shift is None:
        return ""
    sign = "+" if change.shift > 0 else ""
    return f"{sign}{amount(change.shift, change.unit)} (p = {change.p_shift:.2g})"


def _failures(
    gate: Gate, hints: Mapping[Tally, str], pictures: Mapping[Tally, Path]
) -> Iterator[str]:
    """Yield the failures, with pictures of the worst moments and the commands to see them."""
    for title, tallies in (("What speaks against it", gate.blocking), ("Known", gate.known)):
        if not tallies:
            continue
        yield f"<h2>{title}</h2>"
        if title == "Known":
            yield f"<p>This {html.escape(gate.known_as)}.</p>"
        for each in tallies:
            yield f"<h3>{html.escape(each.title)}</h3><p>{html.escape(each.sentence())}</p>"
            if len(each.failed) > 1:
                yield f"<p>Failed in {html.escape(listed(each.failed))}.</p>"
            if each in hints:
                yield f"<pre>{html.escape(hints[each])}</pre>"
            if each in pictures:
                data = base64.b64encode(pictures[each].read_bytes()).decode()
                image = f'<img alt="the worst moment" src="data:image/png;base64,{data}">'
                yield f"<figure>{image}</figure>"


def _all(gate: Gate) -> Iterator[str]:
    """Yield all expectations with their rates."""
    rows = []
    for each in gate.tallies:
        low, high = each.rate
        cells = [_cell(gate.short[each.test]), _cell(each.name), _verdict(each.verdict)]
        cells.append(_cell(f"{each.held} of {each.trials}"))
        cells.append(_cell(f"{percent(low)} to {percent(high)}" if each.outcomes else ""))
        rows.append(cells)
    yield "<h2>All expectations</h2>"
    yield _table(["test", "expectation", "verdict", "held", "95 % interval"], rows)


def _trend(gate: Gate) -> Iterator[str]:
    """Yield how often each expectation held with the builds of the history."""
    builds = list(gate.trend)[-MAX_BUILDS:]
    if not builds:
        return
    shown = {each.place for each in gate.tallies}
    places = dict.fromkeys(place for build in builds for place in gate.trend[build])
    rows = []
    for place in places:
        if place not in shown:
            continue
        cells = [_cell(gate.short[place[0]]), _cell(place[1])]
        for build in builds:
            held, number = gate.trend[build].get(place, (0, 0))
            kind = "odd" if held else "bad"
            if held == number:
                kind = "good"
            cells.append(_cell(f"{held} of {number}", kind) if number else _cell(""))
        rows.append(cells)
    yield "<h2>History</h2><p>In how many trials each expectation held, by build.</p>"
    yield _table(["test", "expectation", *builds], rows)


def _verdict(verdict: str) -> str:
    return _cell(verdict, KIND_OF.get(verdict, "bad"))


def _worst(verdicts: Iterable[str]) -> str:
    kinds = {KIND_OF.get(verdict, "bad") for verdict in verdicts}
    return next((kind for kind in ("bad", "odd", "good") if kind in kinds), "")


def _cell(text: str, kind: str = "") -> str:
    marked = f' class="{kind}"' if kind else ""
    return f"<td{marked}>{html.escape(text)}</td>"


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    names = "".join(f"<th>{html.escape(name)}</th>" for name in head)
    body = "".join(f"<tr>{''.join(cells)}</tr>" for cells in rows)
    return f"<table><tr>{names}</tr>{body}</table>"
