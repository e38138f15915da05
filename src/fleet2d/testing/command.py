"""The command `fleet2d falsify`."""

import json
import os
import re
import time
from datetime import timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
import yaml

from fleet2d.configuration.problems import counted
from fleet2d.errors import InputError, RunDirectoryError, os_errors_as
from fleet2d.options import Workers
from fleet2d.runtime.progress import progress_bar
from fleet2d.storage.files import new_folder

if TYPE_CHECKING:
    from fleet2d.testing.search import FailingPoint, FailureSearch, SearchSpace, TryJob

UNLIMITED_TRIES = 1_000_000  # for a budget of time
SHRINK_TRIES = 40
FAILURE_FOUND = 1
"""The exit code if a run fails, as that of a test."""


def falsify(
    target: Annotated[
        str,
        typer.Argument(
            metavar="SCENARIO.yaml|TEST.py::NAME",
            help="A scenario with expectations, or a test with a trial.",
        ),
    ],
    over: Annotated[
        list[str],
        typer.Option(
            metavar="AXES.yaml|AXIS",
            help="What varies: a YAML file of axes, or one axis, 'home={synthetic: 50}'; again"
            " for more.",
        ),
    ],
    budget: Annotated[
        str, typer.Option(metavar="N|TIME", help="How many runs, or for how long, '5 min'.")
    ] = "200",
    out: Annotated[
        Path, typer.Option(help="The scenario to write that fails; a run beside it.")
    ] = Path("falsified.yaml"),
    finds: Annotated[
        int, typer.Option(min=1, help="How many runs that fail to look for; see what they share.")
    ] = 1,
    seed: Annotated[int, typer.Option(min=0, help="Of the search.")] = 0,
    workers: Workers = None,
    quiet: Annotated[bool, typer.Option("--quiet", help="Print nothing but errors.")] = False,
) -> None:
    """Search for a case that breaks an expectation.

    A case is a home, a household, a timing or a seed. The exit code is 1 if there is one.

    Examples:
      fleet2d falsify home.yaml --over 'home={synthetic: 50}' --budget '5 min'
      fleet2d falsify test_robot.py::test_keeps_off --over axes.yaml
    """
    from fleet2d.studies.api import open_crew
    from fleet2d.studies.sentences import in_words
    from fleet2d.testing.search import FailureSearch, parse_over, read_space

    for path in (out, out.with_suffix("")):  # the scenario, and the folder of its run
        if path.exists():
            raise RunDirectoryError(f"{path} exists already: name another file by --out")
    tries, seconds = parse_budget(budget)
    job = job_of(target, read_space(parse_over(over)))
    job.check()
    search = FailureSearch(job, tries, seed=seed, finds=finds)
    with progress_bar(show=not quiet) as bar, open_crew("local", workers) as crew:
        task = bar.add_task("runs", total=tries if seconds is None else None)

        def update(search: "FailureSearch") -> None:
            size = search.narrowest[1] if search.narrowest else ""
            narrowest = f", narrowest {size}" if size else ""
            bar.update(task, completed=search.tries, description=f"{search.tries} runs{narrowest}")

        begin_s = time.monotonic()
        search.run(crew, seconds, update)
        took = in_words(timedelta(seconds=time.monotonic() - begin_s))
    answer = search.answer(f"When does {target} fail?", took)
    if not search.tries:
        raise InputError(f"--budget: {budget} was over before the first run: nothing was tried")
    if sum(search.errors.values()) == search.tries:
        first = next(iter(search.errors))
        raise InputError(f"none of {counted(search.tries, 'run')} could be done: {first}")
    if search.failure is None:
        typer.echo(answer)
        return
    lines: list[str] = []
    described: set[str] = set()
    for number, failure in enumerate(search.failures):
        path = out if number == 0 else out.with_stem(f"{out.stem}-{number + 1}")
        # Of failures of one kind only the first is made smaller.
        shrink = 0 if failure.what in described else SHRINK_TRIES
        described.add(failure.what)
        lines += [*describe_failure(failure, job, target, path, shrink), ""]
    for line in [] if quiet else [*lines, str(answer)]:
        typer.echo(line)
    raise typer.Exit(FAILURE_FOUND)


def parse_budget(text: str) -> tuple[int, float | None]:
    """Return the largest number of runs, and the seconds for them.

    Raises:
        InputError: It is neither a number nor a time.

    >>> parse_budget("200"), parse_budget("5 min")
    ((200, None), (1000000, 300.0))
    """
    from pydantic_core import PydanticCustomError

    from fleet2d.configuration.units import parse_duration

    if re.fullmatch(r"[1-9]\d{0,6}", text.strip()):
        return int(text), None
    try:
        if not text.strip()[-1:].isalpha():  # a bare number is a number of runs
            raise ValueError
        return UNLIMITED_TRIES, parse_duration(text).total_seconds()
    except (PydanticCustomError, ValueError):
        raise InputError(
            f"--budget: expected a number of runs like 200, or a time like '5 min', got {text!r}"
        ) from None


def job_of(target: str, space: "SearchSpace") -> "TryJob":
    """Return the job of a search for a failure of a scenario or a test.

    Raises:
        InputError: There is no such scenario or test, or the scenario expects nothing.
    """
    from fleet2d.scenario.compose import compose
    from fleet2d.scenario.load import scenario_of
    from fleet2d.testing.search import TryJob, claimed_test

    path, separator, name = target.partition("::")
    if separator:
        scenario = claimed_test(Path(path), name)[1].scenario
        return TryJob(scenario._document, scenario.folder, space, (Path(path), name))
    job = TryJob(compose(path), Path(path).absolute().parent, space)
    if not scenario_of(job.base, job.folder).expect:
        raise InputError(f"{target} has no expectations: add a section `expect`, or name a test")
    return job


def describe_failure(
    failure: "FailingPoint", job: "TryJob", target: str, out: Path, shrink: int = SHRINK_TRIES
) -> list[str]:
    """Write the failing scenario, and its run beside it; return the lines of a report.

    Raises:
        InputError: Its run doesn't fail again.
    """
    from fleet2d.testing.failures import describe_trial

    trial = job.run(failure.point, failure.seed)
    if not trial.failures:
        raise InputError(
            f"{target} failed at try {failure.number}, but holds when that try is repeated: it"
            " depends on more than the scenario and the seed, such as a file or the time of day"
        )
    command = f"fleet2d test {out}"
    if job.test is not None:
        command = f"pytest {target} --fleet2d-scenario {out}"
    point = job.space.text(failure.point)
    lines = [f"fails at try {failure.number}: {point}, seed {failure.seed}"]
    folder = out.with_suffix("")
    refusal = os_errors_as(RunDirectoryError, f"{folder} can't be written")
    with refusal, new_folder(folder) as made:
        made.mkdir()
        report = describe_trial(trial, job.body(), made, shrink, command)
        lines += [line.replace(str(made), str(folder)) for line in report]
    reason = trial.failures[0].text.splitlines()[0]
    out.write_text(_scenario_text(failure, job, target, out, reason), encoding="utf-8")
    return [*lines, "", f"written: {out}"]


def _scenario_text(
    failure: "FailingPoint", job: "TryJob", target: str, out: Path, reason: str
) -> str:
    """Return the YAML of a failing scenario: the file that it extends, and the changes."""
    from fleet2d.configuration.documents import Document
    from fleet2d.scenario.compose import assignment, merge

    content = Document()
    changes = [(("simulation", "seed"), failure.seed), *job.space.changes(failure.point)]
    for keys, value in changes:
        content = merge(content, assignment(keys, value, ""))
    source = target.partition("::")[0]
    data: dict[str, Any]
    if job.test is None:
        data = {"extends": os.path.relpath(source, out.parent), **content.data}
    else:
        data = job.scenario(failure.point, failure.seed).resolved()
    plain = json.loads(json.dumps(data, default=str))  # YAML refuses subclasses of its types
    body = yaml.safe_dump(plain, sort_keys=False, allow_unicode=True)
    return f"# This scenario fails, according to fleet2d falsify {target}: {reason}\n{body}"
