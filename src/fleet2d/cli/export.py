"""`fleet2d export`: write a run for others."""

from pathlib import Path
from typing import Annotated

import typer

from fleet2d.errors import InputError
from fleet2d.options import TrustFiles, TrustFolders, restrict_to
from fleet2d.runs import exporters


def _format_help() -> str:
    described = (
        f"{name}: {text}" if text else f"{name}." for name, text in exporters.formats().items()
    )
    return f"Its format; by default that of the suffix of FILE. {' '.join(described)}"


def export(  # noqa: PLR0913 - the options of the command
    directory: Annotated[Path, typer.Argument(metavar="RUN_DIR", help="A stored run.")],
    out: Annotated[
        Path | None, typer.Argument(help="The file to write, for other programs.")
    ] = None,
    layout: Annotated[str | None, typer.Option("--format", help=_format_help())] = None,
    html: Annotated[
        Path | None, typer.Option(help="The page to write: one file that plays anywhere.")
    ] = None,
    begin: Annotated[
        str | None, typer.Option("--from", help="Where it begins, such as 'day 3 18:30'.")
    ] = None,
    end: Annotated[str | None, typer.Option("--to", help="Where it ends.")] = None,
    every: Annotated[
        str | None, typer.Option(help="Time between two poses, such as '10 s'; default: the step.")
    ] = None,
    trust: TrustFiles = None,
    trust_dir: TrustFolders = None,
) -> None:
    """Write a run for others: a file for other programs, or a web page in one file."""
    from fleet2d.runs.run import open_run
    from fleet2d.viewer.moments import steps_of

    if (out is None) == (html is None):
        raise InputError(
            "name exactly one output: FILE (see --format), or --html FILE (a web page)"
        )
    if html is not None and every is not None:
        raise InputError("--every is for FILE: a page has the exact poses at all times")
    run = open_run(directory)
    first, last = steps_of(run, begin, end)
    with restrict_to(trust, trust_dir):
        if out is not None:
            typer.echo(exporters.export(run, out, layout, first=first, end=last, every=every))
        elif html is not None:
            from fleet2d.viewer.page_data import export_html

            export_html(run, html, first, last)
            typer.echo(f"{html}: {html.stat().st_size / 1e6:.1f} MB")
