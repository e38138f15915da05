"""All commands of the command line."""

from typing import Annotated

import typer

from fleet2d.cli import inputs, pictures, runs
from fleet2d.cli.plugins import Commands
from fleet2d.cli.product_tests import run_tests
from fleet2d.cli.reproduce import reproduce
from fleet2d.cli.resume import resume
from fleet2d.cli.verify import verify

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
