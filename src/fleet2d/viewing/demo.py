"""`fleet2d demo`: the bundled scenario, its events in sentences, and its page."""

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
from fleet2d.viewing.story import ASLEEP, plain, rows_of_metric, titled

if TYPE_CHECKING:
    from fleet2d.runs.run import Run

IN_WORDS = {Outcome.DEFERRED: "put off", Outcome.MISTAKEN: "said to somebody else"}
"""Words for outcomes of addressing a person whose names say too little."""
DID = {
    "ask": "asked",
    "deliver": "brought something to",
    "greet": "greeted",
    "offer": "offered something to",
    "patrol_report": "reported to",
    "remind": "reminded",
}
"""What a robot did that carried out an interaction, by its kind."""


def demo(
    out: Annotated[
        Path | None, typer.Option(help="Folder of the run; left out: a new temporary one.")
    ] = None,
    view: Annotated[bool, typer.Option(help="Whether to open the page, or Jupyter.")] = True,
    tutorial: Annotated[
        str | None,
        typer.Option(help="Write this tutorial or guide as a notebook, into a folder of its name."),
    ] = None,
    lists: Annotated[bool, typer.Option("--list", help="List all tutorials and guides.")] = False,
) -> None:
    """Simulate the bundled home, and tell what happened.

    Then its page is shown in the browser (extra `view`), until Ctrl-C. With --tutorial nothing is
    simulated: a notebook is written, and opened in Jupyter if that is installed.

    Examples:
      fleet2d demo
      fleet2d demo --no-view --out month
      fleet2d demo --tutorial algorithm
    """
    if lists or tutorial is not None:
        if out is not None:
            raise InputError("--out is the folder of a run: a tutorial gets a folder of its name")
        _teach(None if lists else tutorial, opens=view)
        return
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


def _teach(tutorial: str | None, *, opens: bool) -> None:
    """Write and open a tutorial or a guide as a notebook; None: list all of them."""
    from fleet2d.viewing.tutorials import open_in_jupyter, sources, title, write_notebook

    if tutorial is None:
        for name, source in sources().items():
            typer.echo(f"{name:18} {title(source)}")
        return
    path = write_notebook(tutorial)
    if not (opens and open_in_jupyter(path)):
        typer.echo(f"{path}: open it in your editor, or in Jupyter (pip install notebook)")


def sentences(run: "Run") -> Iterator[str]:
    """Yield sentences on a run, from its metrics and events."""
    users = run.manifest["entities"]["users"]
    robots = run.manifest["entities"]["robots"]
    simulated_s = run.manifest["simulated_s"]
    wall_s = sum(run.manifest["wall_s"].values())
    yield (
        f"{_period(simulated_s)} of {_listed([*users, *robots])}, simulated in {wall_s:.1f} s:"
        f" {float(f'{simulated_s / wall_s:.2g}'):,.0f} times as fast as life."
    )
    columns = ["step", "entity", "event", "detail", *(["user"] if users else [])]
    events = run.tables["events"].select(columns).to_pylist()
    if users and robots:
        shares = {user: _waking_share(user, events, run.manifest["steps"]) for user in users}
        seen = [f"{titled(u)} for {100 * share:.0f} %" for u, share in shares.items() if share]
        if seen:
            waking = "the time they were at home and awake"
            yield f"{_listed(robots)} saw {_listed(seen)} of {waking}."
    yield from _learning(run)
    metres = _result(run, "distance")
    for robot in robots:
        if robot in metres:
            yield f"{titled(robot)} drove {metres[robot]:,.0f} m a day."
        yield from _requests(run, robot, events)
        searches = rows_of_metric(run, "time_to_find", ["robot", "user", "end"])
        yield from _searches(robot, searches)


def _waking_share(user: str, events: Sequence[dict[str, Any]], steps: int) -> float | None:
    """Return the share of a user's steps at home and awake in which some robot saw the user."""
    is_awake = is_out = False  # unknown until the first activity
    seen_by = since = waking = seen = 0
    for event in (*events, {"step": steps, "entity": user, "event": ""}):
        is_own = event["entity"] == user
        if not is_own and event["user"] != user:
            continue
        if is_awake and not is_out:
            steps = event["step"] - since
            waking += steps
            if seen_by:
                seen += steps
        since = event["step"]
        match event["event"]:
            case EventKind.ACTIVITY if is_own:
                is_awake = event["detail"] != ASLEEP
            case EventKind.LEFT_HOME | EventKind.CAME_HOME if is_own:
                is_out = event["event"] == EventKind.LEFT_HOME
            case EventKind.USER_SEEN:
                seen_by += 1
            case EventKind.USER_LOST:
                seen_by -= 1
    return seen / waking if waking else None


def _learning(run: "Run") -> Iterator[str]:
    """Yield how wrong the beliefs about each user were at first, and how wrong at the end."""
    errors: dict[str, list[float]] = {}
    for row in rows_of_metric(run, "ltp_error", ["user", "tv"]):
        if row["user"] in run.manifest["entities"]["users"]:
            errors.setdefault(row["user"], []).append(row["tv"])
    if not errors or any(len(of_user) < 2 for of_user in errors.values()):
        return
    first = [f"{100 * own[0]:.0f} % of {titled(user)}'s" for user, own in errors.items()]
    last = [f"{100 * own[-1]:.0f} %" for own in errors.values()]
    wrong = f"{_listed(first)} time into wrong rooms; in the end {_listed(last)}"
    yield f"At first, what was learned put {wrong}."


def _requests(run: "Run", robot: str, events: Sequence[dict[str, Any]]) -> Iterator[str]:
    """Yield how often a robot addressed each person with a request, and the answers."""
    requests: dict[str, Counter[str]] = {}
    for event in events:
        if event["entity"] == robot and event["event"] in (EventKind.ASKS, *Outcome):
            requests.setdefault(event["detail"], Counter())[event["event"]] += 1
    for request, counts in requests.items():
        name, _, person = request.rpartition(" ")
        did = DID[run.manifest["scenario"]["interactions"][name]["do"]]
        times = counts.pop(EventKind.ASKS)
        answers = {IN_WORDS.get(kind, plain(kind)): counts[kind] for kind in Outcome}
        # A question that nobody notices has no event of its own.
        answers["not noticed"] = times - counts.total()
        listed = ", ".join(f"{count} {word}" for word, count in answers.items() if count)
        often = "once" if times == 1 else f"{times} times"
        yield f"{titled(robot)} {did} {titled(person)} {often} ({plain(name)}): {listed}."


def _searches(robot: str, searches: Sequence[dict[str, Any]]) -> Iterator[str]:
    """Yield how often a robot found the person it searched for, and mistook somebody else."""
    ends: dict[str, Counter[str]] = {}
    for search in searches:
        if search["robot"] == robot:
            ends.setdefault(search["user"], Counter())[search["end"]] += 1
    for user, counts in ends.items():
        name = titled(user)
        found = counts[EventKind.FOUND]
        sentence = f"{titled(robot)} found {name} in {found} of {counts.total()} searches"
        if counts["false"]:
            sentence += f", and took somebody else for {name} in {counts['false']}"
        yield f"{sentence}."


def _period(simulated_s: float) -> str:
    """Return a period in words if it is of whole days.

    >>> _period(30 * 86_400), _period(3600)
    ('30 days', '1 h')
    """
    days, rest = divmod(simulated_s, 86_400)
    if rest or days < 2:
        return format_duration(timedelta(seconds=simulated_s))
    return f"{days:.0f} days"


def _result(run: "Run", kind: str) -> dict[str, Any]:
    """Return the result of the first metric of a type; empty if nothing measured it."""
    configured = run.manifest["scenario"]["metrics"]
    results = (run.metrics[name] for name in run.metrics if configured[name]["type"] == kind)
    return next(results, {})


def _listed(names: Sequence[str]) -> str:
    """Return names as a list in words.

    >>> _listed(["ana", "ben", "cleo"]), _listed(["astro"])
    ('Ana, Ben and Cleo', 'Astro')
    """
    titles = [titled(name) for name in names]
    return " and ".join(filter(None, [", ".join(titles[:-1]), *titles[-1:]]))
