"""The command line: `fleet2d run`, `validate`, `show` and the rest; see `fleet2d --help`."""

import os
import sys
from typing import Annotated, NoReturn

import typer

from fleet2d.cli import inputs, pictures, runs
from fleet2d.cli.plugins import Commands
from fleet2d.cli.product_tests import run_tests
from fleet2d.cli.reproduce import reproduce
from fleet2d.cli.resume import resume
from fleet2d.cli.verify import verify
from fleet2d.errors import Fleet2DError, InputError

app = typer.Typer(
    cls=Commands,
    help="Simulate weeks of a home in a fraction of a second, exactly reproducible.",
    no_args_is_help=True,
    invoke_without_command=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
for command in (
    runs.run,
    inputs.validate,
    inputs.schema,
    inputs.components,
    pictures.show,
    inputs.convert,
    runs.export,
    resume,
    verify,
    reproduce,
):
    app.command()(command)
app.command("test")(run_tests)


@app.callback()
def about(
    version: Annotated[
        bool, typer.Option("--version", is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Simulate weeks of a home in a fraction of a second, exactly reproducible."""
    if version:
        from fleet2d.version import __version__

        typer.echo(f"fleet2d {__version__}")
        raise typer.Exit


def main() -> NoReturn:
    """Run the command line; exit codes: 0 success, 1 failure, 2 wrong input, 130 interrupted."""
    # NumPy starts a thread for each core when it is imported; nothing here multiplies matrices.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    try:
        app(standalone_mode=True)
    except Fleet2DError as error:
        for line in (f"error: {error}", *getattr(error, "__notes__", ())):
            typer.echo(line, err=True)
        sys.exit(2 if isinstance(error, InputError) else 1)
    except KeyboardInterrupt:
        sys.exit(130)
    sys.exit(0)
