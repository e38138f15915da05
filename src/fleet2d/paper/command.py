"""The command that repeats the measurements of the paper: `fleet2d reproduce-paper`."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from fleet2d.configuration.problems import check_known
from fleet2d.errors import InputError, os_errors_as
from fleet2d.options import Workers

WIDTH = 200  # of lines in a file [characters]


def reproduce_paper(
    results: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[speed|ltp-gap|rtp-gap|feedback]...",
            help="Results to measure; left out: all four.",
        ),
    ] = None,
    out: Annotated[Path, typer.Option(help="Directory for numbers and pictures.")] = Path("paper"),
    quick: Annotated[
        bool, typer.Option("--quick", help="Small versions: all in about a minute.")
    ] = False,
    seeds: Annotated[
        int | None,
        typer.Option(min=1, help="Months of each kind: seeds, robots of ltp-gap, runs of speed."),
    ] = None,
    days: Annotated[int | None, typer.Option(min=1, help="Days of a month.")] = None,
    workers: Workers = None,
    real_map: Annotated[
        Path | None,
        typer.Option("--map", help="A real home, for speed: a ROS map's YAML file, or a vacuum's."),
    ] = None,
) -> None:
    """Repeat the measurements of the paper, and print them beside its figures."""
    from rich.console import Console

    from fleet2d.paper import results as months
    from fleet2d.paper.speed import measure_rows
    from fleet2d.studies.executors import cores

    functions = (measure_rows, months.ltp_gap, months.rtp_gap, months.feedback)
    measures = dict(zip(months.RESULTS, functions, strict=True))
    for name in results or ():
        check_known(name, "result", measures, InputError)
    options = months.PaperOptions(quick, seeds, days, workers or cores(), real_map, out / "studies")
    with os_errors_as(InputError, f"{out} can't be created", "; name another directory by --out"):
        out.mkdir(parents=True, exist_ok=True)  # an error is shown before hours of work
    can_draw = _can_draw()
    width = None if sys.stdout.isatty() else WIDTH
    console = Console(soft_wrap=True, width=width, highlight=False, markup=False)
    for name in [name for name in measures if name in (results or measures)]:
        result = measures[name](options)
        console.print(f"\n{result.title}")
        for table in result.tables:
            console.print(table)
        for note in result.notes:
            console.print(f"note: {note}")
        typer.echo(result.save(out))
        if can_draw:
            from fleet2d.paper.pictures import draw

            target = out / f"{name}.png"
            draw(result, target)
            typer.echo(target)


def _can_draw() -> bool:
    """Return whether pictures can be drawn; if not, print what is missing."""
    try:
        import fleet2d.pictures  # noqa: F401
    except InputError as error:
        typer.echo(f"no pictures: {error}", err=True)
        return False
    return True
