"""The commands `fleet2d study run`, `status`, `rerun`, `report`, and `fleet2d tune`."""

import gc
import json
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from fleet2d.errors import InputError
from fleet2d.trust_options import TrustFiles, TrustFolders, restricting

if TYPE_CHECKING:
    from fleet2d.studies.driver import Checked
    from fleet2d.studies.reader import Study

studying = typer.Typer(
    help="Run many scenarios as one experiment, resumable, ending in an answer.",
    no_args_is_help=True,
)
Workers = Annotated[
    int | None, typer.Option(min=1, help="Processes at a time; left out: one per core.")
]
Where = Annotated[str, typer.Argument(metavar="DIR", help="The folder or store of a study.")]
SHOWN = 10
IDENTITY_START = 6
"""Characters of an identity that name a variant; fewer digits are its number."""


@studying.command()
def run(  # noqa: PLR0913 - options of the command line
    source: Annotated[Path, typer.Argument(metavar="STUDY.yaml", help="The study.")],
    out: Annotated[
        str | None, typer.Option(help="A folder or s3://…; left out: studies/NAME.")
    ] = None,
    workers: Workers = None,
    executor: Annotated[
        Literal["local", "ray", "serial"],
        typer.Option(help="Where the workers are; serial: in this process, for a debugger."),
    ] = "local",
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Check all, and print the variants and their time.")
    ] = False,
    fail_fast: Annotated[
        bool, typer.Option("--fail-fast", help="End with the first variant that fails.")
    ] = False,
    changed: Annotated[
        Literal["redo", "keep"] | None,
        typer.Option(help="What to do with results of other code or scenarios."),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="Print nothing but errors.")] = False,
    trust: TrustFiles = None,
    trust_dir: TrustFolders = None,
) -> None:
    """Run a study, or what is missing of it."""
    from fleet2d.studies.api import default_location, make_executor
    from fleet2d.studies.driver import RunOptions, check_study, run_study
    from fleet2d.studies.progress import observing

    with restricting(trust, trust_dir):
        checked = check_study(source)
        if dry_run:
            _print_plan(checked, workers)
            return
    location = out or default_location(checked.specification.name)
    gc.freeze()  # what is loaded lives to the end, which comes at once then
    with _terminated_as_interrupted(), restricting(trust, trust_dir):
        try:
            with observing(show=sys.stderr.isatty() and not quiet) as observer:
                options = RunOptions(fail_fast, changed, observer)
                counts = run_study(checked, location, make_executor(executor, workers), options)
        except KeyboardInterrupt:
            typer.echo(
                f"interrupted; what is finished is in {location}: the same command goes on",
                err=True,
            )
            raise typer.Exit(130) from None
    if as_json:
        typer.echo(json.dumps({"study": location, **vars(counts), "missing": counts.missing}))
    elif not quiet:
        typer.echo(f"{counts.complete} of {counts.total} variants complete in {location}")
    if counts.failed:
        _print_failures(location)
    if counts.failed or counts.missing:
        raise typer.Exit(1)


@studying.command()
def status(
    location: Where,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Print how far a study is, also while it is being run."""
    from fleet2d.studies.directory import StudyDirectory
    from fleet2d.studies.results import count

    directory = StudyDirectory(location)
    meta = directory.read_meta()
    counts = count(directory)
    if as_json:
        typer.echo(json.dumps({"study": location, **vars(counts), "missing": counts.missing}))
        return
    typer.echo(
        f"{meta.name}: {counts.complete} of {counts.total} variants complete,"
        f" {counts.failed} failed, {counts.missing} to run"
    )
    if counts.failed:
        _print_failures(location)


@studying.command()
def rerun(
    location: Where,
    variant: Annotated[
        str, typer.Argument(metavar="VARIANT", help="Its number, or the start of its identity.")
    ],
    out: Annotated[Path | None, typer.Option(help="Store the run in this directory.")] = None,
    trust: TrustFiles = None,
    trust_dir: TrustFolders = None,
) -> None:
    """Run one variant again, and compare it with what is stored."""
    from fleet2d.studies.reader import open_study

    study = open_study(location)
    number = _number_of(study, variant)
    rows = study.arrow_variants.select(["variant", "digest", *study.columns]).to_pylist()
    stored = next(row for row in rows if row["variant"] == number)
    words = ", ".join(f"{c} = {stored[c]}" for c in study.columns if stored[c] is not None)
    typer.echo(f"variant {number}: {words}")
    with restricting(trust, trust_dir):
        found = study.rerun(number, out)
    if out is not None:
        typer.echo(f"stored in {out}")
    if stored["digest"] is None:
        typer.echo(f"digest {found.digest}; the study has none of it")
    elif found.digest == stored["digest"]:
        typer.echo(f"reproduced: digest {found.digest}")
    else:
        typer.echo(f"not reproduced: {found.digest} instead of {stored['digest']}", err=True)
        raise typer.Exit(1)


@studying.command()
def report(
    location: Where,
    out: Annotated[
        Path | None, typer.Option(help="Folder for the page and the figures; DIR/report.")
    ] = None,
) -> None:
    """Write one self-contained HTML page of answers, and its figures as files."""
    from fleet2d.studies.reader import open_study
    from fleet2d.studies.report import write_report

    if out is None and "://" in location:
        raise InputError("a study in a store wants --out for its report: a local folder")
    typer.echo(write_report(open_study(location), out or Path(location) / "report"))


def _print_plan(checked: "Checked", workers: int | None) -> None:
    """Print the axes, the first variants, and what they will take."""
    from fleet2d.studies.execution import cores
    from fleet2d.studies.forecast import forecast
    from fleet2d.studies.local import LocalExecutor
    from fleet2d.studies.plan import check_setups
    from fleet2d.studies.progress import in_words

    plan = checked.plan
    count = workers or cores()
    check_setups(plan, LocalExecutor(count))
    for column, labels in plan.design.labels.items():
        shown = ", ".join(map(str, labels[:SHOWN]))
        more = f", … {len(labels)} in all" if len(labels) > SHOWN else ""
        typer.echo(f"{column}: {shown}{more}")
    typer.echo("")
    for variant in plan.variants[:SHOWN]:
        typer.echo(f"  {plan.design.describe(variant.index)}")
    if len(plan.variants) > SHOWN:
        typer.echo(f"  … {len(plan.variants) - SHOWN} more")
    expected = forecast(plan)
    typer.echo(
        f"\n{len(plan.variants)} variants, {len({v.home_key for v in plan.variants})} homes,"
        f" {in_words(expected.simulated)} of simulated time: about"
        f" {in_words(expected.by(count))} by {count} workers here"
    )


def _print_failures(location: str) -> None:
    from fleet2d.studies.reader import open_study

    table = open_study(location).arrow_variants.select(["variant", "status", "error"])
    failed = [row for row in table.to_pylist() if row["status"] == "failed"]
    for row in failed[:SHOWN]:
        typer.echo(f"variant {row['variant']} failed: {row['error']}", err=True)
    if len(failed) > SHOWN:
        typer.echo(f"… {len(failed) - SHOWN} more", err=True)


def _number_of(study: "Study", variant: str) -> int:
    table = study.arrow_variants.select(["variant", "identity"]).to_pylist()
    if variant.isdigit() and any(row["variant"] == int(variant) for row in table):
        return int(variant)
    fitting = []
    if len(variant) >= IDENTITY_START:
        fitting = [row["variant"] for row in table if (row["identity"] or "").startswith(variant)]
    if len(fitting) != 1:
        raise InputError(
            f"{study.location} has {len(fitting) or 'no'} variant{'s' * (len(fitting) > 1)}"
            f" {variant!r}: give a number from 0 to {len(table) - 1}, or the first"
            f" {IDENTITY_START} characters or more of an identity"
        )
    return int(fitting[0])


@contextmanager
def _terminated_as_interrupted() -> Iterator[None]:
    """Let SIGTERM end a study as Ctrl-C does: workers gone, finished variants kept."""

    def interrupt(*_: Any) -> None:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGTERM, interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def tune(
    source: Annotated[Path, typer.Argument(metavar="STUDY.yaml", help="A study that tunes.")],
    out: Annotated[Path | None, typer.Option(help="A folder; left out: studies/NAME-tune.")] = None,
    workers: Workers = None,
    executor: Annotated[
        Literal["local", "ray", "serial"], typer.Option(help="Where the workers are.")
    ] = "local",
    quiet: Annotated[bool, typer.Option("--quiet", help="Print nothing but errors.")] = False,
    trust: TrustFiles = None,
    trust_dir: TrustFolders = None,
) -> None:
    """Search parameters on training homes, and judge what is found on homes not seen."""
    from fleet2d.studies.api import default_location, make_executor
    from fleet2d.studies.progress import observing_trials
    from fleet2d.studies.specification import read_specification
    from fleet2d.studies.tune import tune as search

    with restricting(trust, trust_dir):
        specification = read_specification(source)
    folder = out or Path(default_location(f"{specification.name}-tune"))
    with _terminated_as_interrupted(), restricting(trust, trust_dir):
        try:
            with observing_trials(show=sys.stderr.isatty() and not quiet) as observer:
                found = search(specification, folder, make_executor(executor, workers), observer)
        except KeyboardInterrupt:
            typer.echo(f"interrupted; {folder} has what is finished: the same command goes on",
                       err=True)  # fmt: skip
            raise typer.Exit(130) from None
    if quiet:
        return
    counts = ", ".join(f"{n} {state}" for state, n in found.trials.items())
    typer.echo(f"trials: {counts}; in {folder}")
    for name, settings in found.settings.items():
        values = ", ".join(f"{value:.4g}" for value in found.values[name])
        typer.echo(f"{name}: {values} on the training homes")
        for key, value in settings.items():
            typer.echo(f"  {key}={value}")
    assert specification.file.tune is not None
    for metric in specification.file.tune.objectives:
        typer.echo(f"{metric} on the homes held out:")
        for row in found.held_out.paired(metric, {"setting": "as it was"}).to_dicts():
            interval = f"({row['low']:.4g} to {row['high']:.4g})"
            typer.echo(
                f"  {row['setting']}: {row['mean']:.4g} instead of {row['reference']:.4g},"
                f" difference {row['difference']:.4g} {interval}: {row['verdict']}"
            )
