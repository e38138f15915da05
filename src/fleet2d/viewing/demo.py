"""`fleet2d demo`: the bundled scenario, what happened in it in sentences, and its page."""

import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from datetime import timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from fleet2d.cli import named_extras
from fleet2d.cli.results import print_verdict
from fleet2d.cli.run import run_with_progress, set_up
from fleet2d.configuration.units import format_duration
from fleet2d.errors import InputError
from fleet2d.interactions.interaction import Outcome
from fleet2d.runtime.events import EventKind

if TYPE_CHECKING:
    from fleet2d.runs.run import Run

IN_WORDS = {Outcome.DEFERRED: "put off", Outcome.MISTAKEN: "asked of somebody else"}
"""Outcomes of addressing a person whose names say too little."""


def demo(
    out: Annotated[
        Path | None, typer.Option(help="Folder of the run; left out: a new temporary one.")
    ] = None,
    view: Annotated[bool, typer.Option(help="Whether to open the page in the browser.")] = True,
) -> None:
    """Simulate the bundled home, and tell what happened.

    Then its page is shown in the browser (extra `view`), until Ctrl-C.

    Examples:
      fleet2d demo
      fleet2d demo --no-view --out month
    """
    directory = out or Path(tempfile.mkdtemp(prefix="fleet2d-"))
    run = run_with_progress(set_up(None, None, directory, strict=False, quiet=True))
    for sentence in sentences(run):
        typer.echo(sentence)
    print_verdict(run)
    typer.echo(f"stored in {directory}")
    if not view:
        return
    try:
        with named_extras():
            import fleet2d.viewing.page_server  # noqa: F401 - an error before the page, if a library is missing
    except InputError as error:
        typer.echo(f"no page: {error}")
        return
    from fleet2d.viewing.command import view as show_page

    show_page([str(directory)])


def sentences(run: "Run") -> Iterator[str]:
    """Yield what happened in a run, as far as its metrics and events tell it."""
    robots = run.manifest["entities"]["robots"]
    names = _listed([*run.manifest["entities"]["users"], *robots])
    simulated = format_duration(timedelta(seconds=run.manifest["simulated_s"]))
    wall_s = sum(run.manifest["wall_s"].values())
    speedup = run.manifest["simulated_s"] / wall_s
    yield f"{simulated} with {names} took {wall_s:.1f} s: {speedup:,.0f} times real time."
    seen = _result(run, "sightings")
    if seen and robots:
        shares = _listed([f"{name} in {100 * share:.0f} %" for name, share in seen.items()])
        yield f"{_listed(robots)} saw {shares} of the time at home, nights included."
    yield from _learning(run)
    metres = _result(run, "distance")
    events = run.tables["events"].select(["entity", "event", "detail"]).to_pylist()
    for robot in robots:
        if robot in metres:
            yield f"{_title(robot)} drove {metres[robot]:,.0f} m a day."
        own = [event for event in events if event["entity"] == robot]
        yield from _requests(robot, own)
        yield from _searches(robot, _rows(run, "time_to_find", ["robot", "user", "end"]))


def _learning(run: "Run") -> Iterator[str]:
    """Yield how wrong the beliefs about each user were at first, and how wrong at the end."""
    errors: dict[str, list[float]] = {}
    for row in _rows(run, "ltp_error", ["user", "tv"]):
        if row["user"] in run.manifest["entities"]["users"]:
            errors.setdefault(row["user"], []).append(row["tv"])
    if not errors or any(len(of_user) < 2 for of_user in errors.values()):
        return
    first = _listed([f"{100 * of_user[0]:.0f} % for {_title(u)}" for u, of_user in errors.items()])
    last = _listed([f"{100 * of_user[-1]:.0f} %" for of_user in errors.values()])
    believed = "What was believed of their rooms was wrong by"
    yield f"{believed} {first} at first, and by {last} at the end."


def _requests(robot: str, events: Sequence[dict[str, Any]]) -> Iterator[str]:
    """Yield how often a robot asked something of somebody, and with which answers."""
    counts = Counter(event["event"] for event in events)
    asked = counts[EventKind.ASKS]
    if asked:
        answers = {
            IN_WORDS.get(outcome, outcome.replace("_", " ")): counts[outcome] for outcome in Outcome
        }
        # A question that nobody notices has no event of its own.
        answers["not noticed"] = asked - sum(answers.values())
        listed = ", ".join(f"{count} {word}" for word, count in answers.items() if count)
        yield f"{_title(robot)} asked {asked} times: {listed}."


def _searches(robot: str, searches: Sequence[dict[str, Any]]) -> Iterator[str]:
    """Yield how often a robot really found whom it searched, and took somebody else for them."""
    ends: dict[str, Counter[str]] = {}
    for search in searches:
        if search["robot"] == robot:
            ends.setdefault(search["user"], Counter())[search["end"]] += 1
    for user, counts in ends.items():
        name = _title(user)
        found = counts[EventKind.FOUND]
        sentence = f"{_title(robot)} found {name} in {found} of {counts.total()} searches"
        if counts["false"]:
            sentence += f", and took somebody else for {name} in {counts['false']}"
        yield f"{sentence}."


def _rows(run: "Run", kind: str, columns: list[str]) -> list[dict[str, Any]]:
    """Return the rows of the table of the first metric of a type; none if nothing measured it."""
    configured = run.manifest["scenario"]["metrics"]
    name = next((name for name in configured if configured[name]["type"] == kind), None)
    if name is None or name not in run.tables:
        return []
    rows: list[dict[str, Any]] = run.tables[name].select(columns).to_pylist()
    return rows


def _result(run: "Run", kind: str) -> dict[str, Any]:
    """Return the result of the first metric of a type; empty if nothing measured it."""
    configured = run.manifest["scenario"]["metrics"]
    results = (run.metrics[name] for name in run.metrics if configured[name]["type"] == kind)
    return next(results, {})


def _title(name: str) -> str:
    return name[:1].upper() + name[1:]


def _listed(names: Sequence[str]) -> str:
    """Return names as a list in words.

    >>> _listed(["ana", "ben", "cleo"]), _listed(["astro"])
    ('Ana, Ben and Cleo', 'Astro')
    """
    titles = [_title(name) for name in names]
    return " and ".join([*([", ".join(titles[:-1])] if titles[:-1] else []), *titles[-1:]])
