"""The program `fleet2d`: what is common to all commands."""

from typing import Annotated

import typer

from fleet2d.cli.plugins import Commands

app = typer.Typer(
    cls=Commands,
    help="Simulate weeks of a home in a fraction of a second, exactly reproducible.",
    no_args_is_help=True,
    invoke_without_command=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)


@app.callback()
def about(
    version: Annotated[
        bool, typer.Option("--version", is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Simulate weeks of a home in a fraction of a second, exactly reproducible."""
    if version:
        from fleet2d import __version__

        typer.echo(f"fleet2d {__version__}")
        raise typer.Exit
