"""The commands `fleet2d study run`, `tune`, `status`, `rerun`, `report` and `power`."""

import gc
import json
import signal
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from datetime import timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from fleet2d.configuration.problems import counted, suggest
from fleet2d.errors import InputError, end_by_signal, printable
from fleet2d.options import Trust, Workers, show_code

if TYPE_CHECKING:
    from fleet2d.studies.driver import CheckedStudy
    from fleet2d.studies.executors import Crew
    from fleet2d.studies.reader import Study

studying = typer.Typer(
    help="Run many variants of a scenario as one experiment.\n\nExamples:\n"
    "  fleet2d study run speeds.yaml --dry-run\n"
    "  fleet2d study run speeds.yaml\n"
    "  fleet2d study report studies/speeds",
    no_args_is_help=True,
)
ExecutorName = Annotated[
    Literal["local", "serial"],
    typer.Option(help="Where the workers are; serial: in this process, for a debugger."),
]
Where = Annotated[str, typer.Argument(metavar="DIR", help="The folder or store of a study.")]
# The number of lines of a list that are printed.
MAX_LINES = 10
MANY_VARIANTS = 20_000
PIVOTED = 4  # columns of a power table of two kinds of units, such as homes and seeds
IDENTITY_START = 6
"""The minimum number of characters of an identity that name a variant."""


def _print(text: object, *, err: bool = False) -> None:
    """Print text, which may come from somebody else's folder, without control characters."""
    typer.echo(printable(str(text), "\n"), err=err)


@studying.command()
def run(  # noqa: PLR0913 - options of the command line
    source: Annotated[Path, typer.Argument(metavar="STUDY.yaml", help="The study.")],
    out: Annotated[
        str | None, typer.Option(help="A folder or s3://…; left out: studies/NAME.")
    ] = None,
    workers: Workers = None,
    executor: ExecutorName = "local",
    dry_run: Annotated[
        bool,
        typer.Option("--dry-run", help="Check all, and say what it can tell: by a minute's pilot."),
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
) -> None:
    """Run the variants of a study that have no results yet.

    Examples:
      fleet2d study run speeds.yaml --dry-run
      fleet2d study run speeds.yaml --workers 8 --out speeds
    """
    from fleet2d.runtime.memory import free_memory_of_polars
    from fleet2d.studies.api import default_location, open_crew
    from fleet2d.studies.driver import check_study, run_study
    from fleet2d.studies.progress import observing
    from fleet2d.studies.reader import open_study
    from fleet2d.studies.specification import read_specification

    free_memory_of_polars()
    specification = read_specification(source)
    location = out or default_location(specification.name)
    gc.freeze()  # loaded modules live to the end: the collector needn't scan them
    with (
        interruptible(location),
        observing(quiet=quiet) as observer,
        open_crew(executor, workers) as crew,
    ):
        checked = check_study(specification, _print_size, crew, observer)
        if dry_run:
            _print_plan(checked, crew)
            return
        counts = run_study(
            checked, location, crew, fail_fast=fail_fast, changed=changed, observer=observer
        )
    if counts.failed:
        _print_failures(location)
    if as_json:
        facts = {"study": location, **vars(counts), "missing": counts.missing}
        _print(json.dumps({"answer": open_study(location).answer.content, **facts}))
    elif not quiet:
        _print(f"{counts.complete} of {counts.total} variants complete in {location}\n")
        _print(open_study(location).answer)
    if counts.failed or counts.missing:
        raise typer.Exit(1)


@studying.command()
def status(
    location: Where,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Print the progress of a study, even while it runs.

    Examples:
      fleet2d study status studies/speeds
    """
    from fleet2d.studies.directory import StudyDirectory

    directory = StudyDirectory(location)
    meta = directory.read_meta()
    counts = directory.counts()
    if as_json:
        _print(json.dumps({"study": location, **vars(counts), "missing": counts.missing}))
        return
    _print(
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
    trust: Trust = False,
) -> None:
    """Run one variant again and compare digest and metrics.

    Examples:
      fleet2d study rerun studies/speeds 12 --out variant
    """
    from fleet2d.studies.reader import open_study
    from fleet2d.studies.simulator import flat_numbers

    study = open_study(location)
    row = _row_of(study, variant)
    number = row["variant"]
    labels = ", ".join(f"{c} = {row[c]}" for c in study.columns if row[c] is not None)
    _print(f"variant {number}: {labels}")
    if trust:
        show_code({"scenario": study.scenario(number)})
    repeated = study.rerun(number, out, trust=trust)
    if out is not None:
        _print(f"stored in {out}")
    numbers = dict(flat_numbers(repeated.metrics))
    known = [name for name in study.metrics if row[name] is not None]
    differing = [name for name in known if str(numbers.get(name)) != str(row[name])]
    if row["digest"] is None:
        _print(f"digest {repeated.digest}; the study has no digest of this variant")
    elif repeated.digest != row["digest"]:
        _print(f"not reproduced: {repeated.digest} instead of {row['digest']}", err=True)
        raise typer.Exit(1)
    elif differing:
        first = differing[0]
        _print(
            f"not reproduced: the digest is the same, but {first} is {numbers.get(first)} instead"
            f" of {row[first]}: its code, which the digest doesn't have, may have changed",
            err=True,
        )
        raise typer.Exit(1)
    else:
        _print(f"reproduced: digest {repeated.digest}")


@studying.command()
def report(
    location: Where,
    out: Annotated[
        Path | None, typer.Option(help="Folder for the page and the figures; DIR/report.")
    ] = None,
) -> None:
    """Write the answers as an HTML page, figures and tables.

    Examples:
      fleet2d study report studies/speeds --out report
    """
    from fleet2d.studies.reader import open_study
    from fleet2d.studies.report import write_report

    study = open_study(location)
    if out is None and "://" in study.location:
        raise InputError(
            "give --out, a local folder for the report: the study is in a remote store"
        )
    path = write_report(study, out or Path(study.location) / "report")
    _print(f"{study.answer}\n\n{path}")


@studying.command()
def power(
    location: Where,
    metric: Annotated[
        str, typer.Argument(metavar="METRIC", help="A number, such as ltp_error.ana.tv.")
    ],
    against: Annotated[
        str | None,
        typer.Option(
            metavar="AXIS=VALUE", help="The reference; left out: as the study compares the metric."
        ),
    ] = None,
    effect: Annotated[
        float | None, typer.Option(help="The difference to detect; left out: what sizes detect.")
    ] = None,
    share: Annotated[
        float, typer.Option("--power", min=0.5, max=0.999, help="Share of studies that detect it.")
    ] = 0.8,
) -> None:
    """Print how many homes and seeds an effect needs.

    That follows from how much they vary in a small study.

    Examples:
      fleet2d study power studies/speeds distance.astro --effect 5
    """
    import polars as pl

    from fleet2d.studies.reader import open_study

    study = open_study(location)
    table = study.power(metric, _reference(study, metric, against), effect, power=share)
    unit = study.meta.unit(metric)
    aim = "the smallest difference that shows" if effect is None else f"to detect {effect:g}"
    name = f"{metric} [{unit}]" if unit else metric
    _print(f"{name}: {aim}, with a power of {100 * share:g} %; – is never")
    table = table.with_columns(pl.col(table.columns[0]).cast(pl.String))
    table = table.with_columns(pl.col(pl.Float64).round_sig_figs(3))
    if effect is None and len(table.columns) == PIVOTED:  # a column for each number of seeds
        axis, seed, home, detectable = table.columns
        table = table.pivot(seed, index=[axis, home], values=detectable)
        table = table.rename({n: f"{n} of {seed}" for n in table.columns[2:]})
    with pl.Config(
        tbl_hide_dataframe_shape=True, tbl_hide_column_data_types=True, tbl_rows=-1, tbl_cols=-1,
        tbl_formatting="NOTHING", tbl_width_chars=200,
    ):  # fmt: skip
        _print(str(table).replace("null", "–"))


def _reference(study: "Study", metric: str, against: str | None) -> Mapping[str, Any]:
    """Return the axis and the reference value of a comparison.

    Raises:
        InputError: `against` is not AXIS=VALUE, or the study compares no such metric.
    """
    if against is None:
        references = {each.metric: each.against for each in reversed(study.comparisons)}
        if metric in references:
            return references[metric]
        hint = suggest(metric, references, "It compares")
        raise InputError(
            f"the study doesn't compare {metric!r}{hint}; or give --against AXIS=VALUE"
        )
    from fleet2d.studies.answers import check_axes

    axis, _, text = against.partition("=")
    check_axes([axis], study.columns)
    labels = study.variants[axis].unique().to_list()
    by_text = {str(label): label for label in labels if label is not None}
    if text not in by_text:
        raise InputError(f"--against: {axis} has no value {text!r}{suggest(text, by_text)}")
    return {axis: by_text[text]}


def _print_size(count: int) -> None:
    """Print the number of variants if it takes long to check them."""
    if count >= MANY_VARIANTS:
        _print(f"{count:,} variants: all are checked first, a million takes minutes", err=True)


def _print_plan(checked: "CheckedStudy", crew: "Crew") -> None:
    """Print the axes, the first variants, the cost of all, and the effects that they show."""
    from fleet2d.studies.pilot import Pilot
    from fleet2d.studies.plan import check_setups
    from fleet2d.studies.sentences import in_words

    plan = checked.plan
    check_setups(plan, crew)
    for column, labels in plan.design.labels.items():
        values = ", ".join(map(str, labels[:MAX_LINES]))
        more = f", … {len(labels)} in all" if len(labels) > MAX_LINES else ""
        _print(f"{column}: {values}{more}")
    _print("")
    for index in plan.variants["index"].head(MAX_LINES):
        _print(f"  {plan.design.describe(index)}")
    if len(plan.variants) > MAX_LINES:
        _print(f"  … {len(plan.variants) - MAX_LINES} more")
    simulated = in_words(timedelta(seconds=plan.variants["simulated_s"].sum()))
    variants = counted(len(plan.variants), "variant")
    homes = counted(plan.variants["home_key"].n_unique(), "home")
    _print(f"\n{variants}, {homes}, {simulated} of simulated time\n")
    pilot = Pilot(checked)
    pilot.run(crew)
    _print(pilot.answer(crew.workers))


def _print_failures(location: str) -> None:
    from fleet2d.studies.reader import open_study

    failed = open_study(location).failures
    reasons: dict[str, list[int]] = {}
    for number, error in failed.select("variant", "error").iter_rows():
        reasons.setdefault(error, []).append(number)
    for error, numbers in list(reasons.items())[:MAX_LINES]:
        shown = ", ".join(map(str, numbers[:MAX_LINES]))
        more = f", … {len(numbers)} in all" if len(numbers) > MAX_LINES else ""
        plural = "s" if len(numbers) > 1 else ""
        _print(f"variant{plural} {shown}{more} failed: {error}", err=True)
    if len(reasons) > MAX_LINES:
        _print(f"… {len(reasons) - MAX_LINES} more reasons", err=True)


def _row_of(study: "Study", variant: str) -> dict[str, Any]:
    """Return the row of a variant, by its number or the start of its identity.

    Raises:
        InputError: There is no such variant, or several.
    """
    columns = ("variant", "identity", "digest", *study.columns, *study.metrics)
    rows = study.variants.select(*columns).to_dicts()
    found = [row for row in rows if str(row["variant"]) == variant]
    if not found and len(variant) >= IDENTITY_START:
        found = [row for row in rows if (row["identity"] or "").startswith(variant)]
    if len(found) != 1:
        raise InputError(
            f"{study.location} has {counted(len(found), 'variant')} {variant!r}: give a number from"
            f" 0 to {len(rows) - 1}, or the first {IDENTITY_START} characters or more of an"
            " identity"
        )
    return found[0]


@contextmanager
def interruptible(location: str | Path) -> Iterator[None]:
    """End at SIGTERM as at Ctrl-C: workers end, finished results are kept, and a message says so.

    Raises:
        Exit: It was interrupted.
    """
    handler = signal.signal(signal.SIGTERM, end_by_signal)
    try:
        yield
    except KeyboardInterrupt:
        text = f"interrupted; what is finished is in {location}: the same command goes on"
        _print(text, err=True)
        raise typer.Exit(130) from None
    finally:
        signal.signal(signal.SIGTERM, handler)


@studying.command()
def tune(
    source: Annotated[Path, typer.Argument(metavar="STUDY.yaml", help="A study that tunes.")],
    out: Annotated[Path | None, typer.Option(help="A folder; left out: studies/NAME-tune.")] = None,
    workers: Workers = None,
    executor: ExecutorName = "local",
    changed: Annotated[
        Literal["redo"] | None,
        typer.Option(help="redo: start over if the folder holds another search."),
    ] = None,
    quiet: Annotated[bool, typer.Option("--quiet", help="Print nothing but errors.")] = False,
) -> None:
    """Search parameters, and judge the best on other homes.

    Examples:
      fleet2d study tune search.yaml --workers 8
    """
    from fleet2d.studies.api import default_location, open_crew
    from fleet2d.studies.progress import observing_trials
    from fleet2d.studies.specification import read_specification
    from fleet2d.studies.tuning import tune as search

    specification = read_specification(source)
    folder = out or Path(default_location(f"{specification.name}-tune"))
    with (
        interruptible(folder),
        observing_trials(show=not quiet) as bar,
        open_crew(executor, workers) as crew,
    ):
        result = search(specification, folder, crew, bar, changed=changed)
    if quiet:
        return
    counts = ", ".join(f"{n} {state}" for state, n in result.trials.items())
    _print(f"trials: {counts}; in {folder}")
    tune = specification.file.tune
    assert tune is not None
    _print(f"the best setting: {result.value:.4g} on the training homes")
    for key, value in result.settings.items():
        _print(f"  {key}={value}")
    _print(f"{tune.metric} on the homes held out:\n\n{result.held_out.answer}")
