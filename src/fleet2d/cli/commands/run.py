"""`fleet2d run`: simulate a scenario and store the run."""

import gc
import sys
from contextlib import nullcontext, redirect_stdout, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from fleet2d.cli.progress import run_with_progress
from fleet2d.cli.summary import print_results
from fleet2d.cli.watchdog import watched
from fleet2d.errors import RunDirectoryError
from fleet2d.memory import rare_collections
from fleet2d.options import file_name, split

if TYPE_CHECKING:
    from fleet2d.engine.simulation import Simulation

Arguments = Annotated[
    list[str] | None,
    typer.Argument(
        metavar="[SCENARIO.yaml] [KEY.PATH=VALUE]...",
        help="A scenario (left out: the bundled base scenario), and changes to it.",
    ),
]


def run(
    arguments: Arguments = None,
    seed: Annotated[int | None, typer.Option(help="The seed of all randomness.")] = None,
    out: Annotated[Path | None, typer.Option(help="Directory for the run.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="Print nothing but errors.")] = False,
) -> None:
    """Simulate a scenario and store the run."""
    with redirect_stdout(sys.stderr) if as_json else nullcontext():  # output of components
        result = run_with_progress(
            _set_up(arguments, seed, out), show=sys.stderr.isatty() and not quiet
        )
    print_results(result, as_json=as_json, quiet=quiet)


def _set_up(arguments: list[str] | None, seed: int | None, out: Path | None) -> "Simulation":
    with rare_collections():
        from fleet2d.engine.simulation import Simulation
        from fleet2d.scenario.model import load_scenario

        gc.freeze()

    scenario, overrides = split(arguments)
    settings = {} if seed is None else {"seed": seed}
    with watched(), rare_collections():
        loaded = load_scenario(scenario, *overrides, **settings)
        name = loaded.name or (Path(scenario).stem if scenario else "run")
        directory = out or _fresh_directory(name)
        try:
            return Simulation(loaded, out=directory)
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
    while True:
        directory = Path("runs") / f"{stem}-{number:03d}"
        try:
            directory.mkdir(parents=True)  # at once, so that a parallel run takes the next
        except FileExistsError:
            number += 1
        except OSError as error:
            raise RunDirectoryError(
                f"{directory} can't be created: {error.strerror}; name another directory by --out"
            ) from error
        else:
            return directory
