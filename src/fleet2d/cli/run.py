"""`fleet2d run`, `resume` and `verify`: simulate, continue, and check what is stored."""

import gc
import sys
import threading
import time
import traceback
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext, redirect_stdout, suppress
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Annotated

import typer

from fleet2d.cli.results import print_results
from fleet2d.errors import (
    InputError,
    RunDirectoryError,
    blame,
    os_errors_as,
    own_frames,
)
from fleet2d.options import Trust, file_name, resume_hint, show_code, split
from fleet2d.runtime.memory import rare_collections

if TYPE_CHECKING:
    from fleet2d.engine.simulation import Simulation
    from fleet2d.runs.run import Run


FIRST_S = 30.0
"""Time after which a running component is named [s]; the next message comes after twice as long."""


@contextmanager
def watched(first_s: float = FIRST_S) -> Iterator[None]:
    """Print each component that runs longer than `first_s` to stderr, with its current line."""
    is_over = threading.Event()
    thread_id = threading.get_ident()
    thread = threading.Thread(
        target=_watch, args=(is_over, thread_id, first_s), daemon=True, name="fleet2d-watchdog"
    )
    thread.start()
    try:
        yield
    finally:
        is_over.set()
        thread.join(timeout=1)


def _watch(is_over: threading.Event, thread_id: int, first_s: float) -> None:
    call = blame.now
    start_s = time.monotonic()
    limit_s = first_s
    while not is_over.wait(first_s / 6):
        time_s = time.monotonic()
        if blame.now is None or blame.now is not call:
            call = blame.now
            start_s = time_s
            limit_s = first_s
        elif time_s - start_s >= limit_s:
            limit_s *= 2
            moment = "before the first step" if call.step is None else f"at step {call.step}"
            frame = sys._current_frames().get(thread_id)
            typer.echo(
                f"{call.path} has been running for {time_s - start_s:.0f} s {moment}{_line(frame)};"
                " Ctrl-C twice stops it",
                err=True,
            )


def _line(frame: FrameType | None) -> str:
    """Return the current line of the user's code as text; empty if there is none."""
    frames = own_frames(traceback.extract_stack(frame)) if frame else []
    return f" ({Path(frames[-1].filename).name}:{frames[-1].lineno})" if frames else ""


def run_with_progress(simulation: "Simulation", *, quiet: bool = False) -> "Run":
    """Run a simulation to the end, and show its progress unless `quiet`.

    Raises:
        Exit: Ctrl-C or SIGTERM; the run up to then is stored.
    """
    gc.freeze()  # loaded modules live to the end: the collector needn't scan them
    try:
        with watched():
            return simulation.run() if quiet else _run_with_bar(simulation)
    except KeyboardInterrupt:
        from fleet2d.engine.access import directory_of

        directory = directory_of(simulation)
        assert directory is not None
        typer.echo(resume_hint(simulation.time, directory), err=True)
        raise typer.Exit(130) from None


def _run_with_bar(simulation: "Simulation") -> "Run":
    from fleet2d.runtime.progress import progress_bar

    with progress_bar(show=True, counts=False) as progress:
        task = progress.add_task("", total=simulation.clock.steps)
        start_s = time.perf_counter()

        def update(current: "Simulation") -> None:
            simulated_s = current.step * current.clock.step_us / 1e6
            speedup = simulated_s / (time.perf_counter() - start_s)
            text = f"{current.time:%a %d %b %Y %H:%M}  {speedup:,.0f} x real time"
            progress.update(task, completed=current.step, description=text)

        return simulation.run(update)


Strict = Annotated[
    bool, typer.Option("--strict", help="Refuse a home in which something will not work.")
]
Arguments = Annotated[
    list[str] | None,
    typer.Argument(
        metavar="SCENARIO.yaml|KEY.PATH=VALUE",
        help="A scenario (left out: the bundled family), and changes to it.",
    ),
]


def run(
    arguments: Arguments = None,
    seed: Annotated[int | None, typer.Option(help="The seed of all randomness.")] = None,
    out: Annotated[Path | None, typer.Option(help="Directory for the run.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="Print nothing but errors.")] = False,
    strict: Strict = False,
) -> None:
    """Simulate a scenario and store the run.

    Examples:
      fleet2d run
      fleet2d run home.yaml simulation.duration.days=60 --seed 4 --out sixty
      fleet2d run bundled:paper --json --quiet
    """
    with redirect_stdout(sys.stderr) if as_json else nullcontext():  # output of components
        simulation = set_up(arguments, seed, out, strict=strict, quiet=quiet)
        result = run_with_progress(simulation, quiet=quiet)
    print_results(result, as_json=as_json, quiet=quiet)


def report_wrong(simulation: "Simulation", *, strict: bool, quiet: bool = False) -> None:
    """Print the problems of a home to stderr, unless `quiet`.

    Raises:
        InputError: There is a problem, and `strict` refuses it.
    """
    from fleet2d.engine.simulation import flaws_of

    flaws = flaws_of(simulation)
    for text in flaws if strict or not quiet else ():
        typer.echo(f"wrong: {text}", err=True)
    if strict and flaws:
        raise InputError(f"{simulation.home.plan.name}: --strict refuses a home like that")


def set_up(
    arguments: list[str] | None, seed: int | None, out: Path | None, **wrong: bool
) -> "Simulation":
    """Return the simulation of a scenario and its changes, before its first step.

    Args:
        arguments: The scenario, and changes to it.
        seed: The seed; None: that of the scenario.
        out: The directory of the run; None: a new one of the scenario's name.
        wrong: The arguments of `report_wrong`.

    Raises:
        InputError: The scenario or the directory is wrong.
    """
    with rare_collections():
        from fleet2d.engine.simulation import Simulation
        from fleet2d.scenario.load import load_scenario

        gc.freeze()

    scenario, overrides = split(arguments)
    settings = {} if seed is None else {"seed": seed}
    with watched(), rare_collections():
        loaded = load_scenario(scenario, *overrides, **settings)
        name = loaded.name or (Path(scenario).stem if scenario else "run")
        directory = out or _fresh_directory(name)
        try:
            simulation = Simulation(loaded, out=directory)
            report_wrong(simulation, **wrong)
            return simulation
        except BaseException:
            if out is None:
                with suppress(OSError):
                    directory.rmdir()
                    directory.parent.rmdir()  # fails if there are other runs
            raise


def _fresh_directory(name: str) -> Path:
    """Create and return runs/NAME-001, or the directory of the first free number."""
    stem = file_name(name) or "run"
    number = 1
    advice = "; name another directory by --out"
    while True:
        directory = Path("runs") / f"{stem}-{number:03d}"
        refusal = os_errors_as(RunDirectoryError, f"{directory} can't be created", advice)
        with refusal, suppress(FileExistsError):
            directory.mkdir(parents=True)  # at once, so that a parallel run takes the next number
            return directory
        number += 1


def resume(
    directory: Annotated[Path, typer.Argument(metavar="RUN_DIR", help="An unfinished run.")],
    trust: Trust = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="Print nothing but errors.")] = False,
) -> None:
    """Continue an interrupted or killed run.

    The result equals that of an undisturbed run.

    Examples:
      fleet2d resume runs/home-001
    """
    from fleet2d.artifacts.manifest import Manifest
    from fleet2d.engine.repeat import reopen

    if trust:
        show_code(Manifest.read(directory).content())
    with redirect_stdout(sys.stderr) if as_json else nullcontext():  # output of components
        simulation, note = reopen(directory, trust=trust)
        if not quiet:
            typer.echo(note, err=True)
        run = run_with_progress(simulation, quiet=quiet)
    print_results(run, as_json=as_json, quiet=quiet)


def verify(
    directory: Annotated[Path, typer.Argument(metavar="RUN_DIR", help="A stored run.")],
    again: Annotated[
        bool, typer.Option("--again", help="Simulate it again, and compare with that.")
    ] = False,
    trust: Trust = False,
) -> None:
    """Check that a stored run is unchanged or reproducible.

    Without --again its files are compared with its seal, and nothing is simulated. The exit code is
    1 if files differ.

    Examples:
      fleet2d verify runs/home-001
      fleet2d verify runs/home-001 --again
    """
    if again:
        _reproduce(directory, trust=trust)
    elif trust:
        raise InputError("--trust is for --again: without it no code of the run is called")
    else:
        _compare_with_seal(directory)


def _reproduce(directory: Path, *, trust: bool) -> None:
    """Run a stored run again from its manifest, and compare."""
    from fleet2d.artifacts.manifest import Manifest
    from fleet2d.engine.repeat import reproduce as repeat

    if trust:
        show_code(Manifest.read(directory).content())
    result = repeat(directory, trust=trust)
    for cause in result.causes:
        typer.echo(f"note: {cause}")
    typer.echo(f"not compared: {', '.join(result.not_compared)}")
    if result.same:
        typer.echo(f"reproduced: digest {result.digest}")
        return
    typer.echo(f"not reproduced: {', '.join(result.differing)} differ", err=True)
    raise typer.Exit(1)


def _compare_with_seal(directory: Path) -> None:
    """Check that the files of a stored run are unchanged, without running anything."""
    from fleet2d.artifacts.verification import verify_run

    result = verify_run(directory)
    for name in result.foreign:
        typer.echo(f"note: {name} is not part of the run")
    for name, difference in result.differing.items():
        typer.echo(f"{name} {difference}", err=True)
    if result.differing:
        raise typer.Exit(1)
    typer.echo(f"verified: seal {result.digest}")
