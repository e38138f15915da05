"""`fleet2d export`: runs as films, pages and files for other programs."""

from pathlib import Path
from typing import Annotated, Any

import typer

from fleet2d.errors import InputError
from fleet2d.live import exporters
from fleet2d.options import Trust, show_code

_FILMS = (".mp4", ".gif", ".webp")


def _format_help() -> str:
    described = (
        f"{name}: {text}" if text else f"{name}." for name, text in exporters.formats().items()
    )
    return (
        "Its format; by default that of the suffix of FILE. .html: a page that plays anywhere."
        " .mp4, .gif, .webp: a film."
        f" {' '.join(described)}"
    )


def export(  # noqa: PLR0913 - options of the command line
    directory: Annotated[Path, typer.Argument(metavar="RUN_DIR", help="A stored run.")],
    out: Annotated[Path, typer.Argument(metavar="FILE", help="The file to write.")],
    layout: Annotated[str | None, typer.Option("--format", help=_format_help())] = None,
    begin: Annotated[
        str | None, typer.Option("--from", help="Where it begins, such as 'day 3 18:30'.")
    ] = None,
    end: Annotated[str | None, typer.Option("--to", help="Where it ends.")] = None,
    every: Annotated[
        str | None,
        typer.Option(help="Of data: time between two poses, such as '10 s'; default: the step."),
    ] = None,
    speed: Annotated[
        float | None, typer.Option(help="Of a film: times real time; default: 60.")
    ] = None,
    height: Annotated[
        int | None, typer.Option(help="Of a film: its height [pixels]; default: 720.")
    ] = None,
    trust: Trust = False,
) -> None:
    """Write a run as a film, a page or data for other programs.

    Examples:
      fleet2d export runs/home-001 evening.mp4 --from 'day 3 18:00' --to 'day 3 19:00'
      fleet2d export runs/home-001 week.html
    """
    from fleet2d.runs.moments import steps_of
    from fleet2d.runs.run import open_run

    suffix = out.suffix.lower()
    is_film = layout is None and suffix in _FILMS
    is_page = layout is None and suffix == ".html"
    is_data = not is_film and not is_page
    if not is_film:
        _refuse(f"{out} is no film", speed=speed, height=height)
    if not is_data:
        _refuse(f"{out} is no data for other programs", every=every)
    run = open_run(directory, trust=trust)
    if trust:
        show_code(run.manifest)
    first, last = steps_of(run, begin, end)
    if is_film:
        from fleet2d.viewing.film import write_film

        size: dict[str, Any] = {"speed": speed, "height": height}
        given = {name: value for name, value in size.items() if value is not None}
        frames = write_film(run, out, first, last, **given)
        typer.echo(f"{out}: {frames} pictures, {out.stat().st_size / 1e6:.1f} MB")
    elif is_page:
        from fleet2d.viewing.page_data import export_html

        export_html(run, out, first, last)
        typer.echo(f"{out}: {out.stat().st_size / 1e6:.1f} MB")
    else:
        typer.echo(exporters.export(run, out, layout, first=first, end=last, every=every))


def _refuse(reason: str, **options: object) -> None:
    """Refuse options that are given.

    Raises:
        InputError: Such an option is given.
    """
    for name, value in options.items():
        if value is not None:
            raise InputError(f"{reason}: leave out --{name}")
