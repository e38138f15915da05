"""The command that repeats the measurements of the paper: `fleet2d reproduce-paper`."""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from fleet2d.configuration.problems import check_known
from fleet2d.errors import InputError, os_errors_as

if TYPE_CHECKING:
    from fleet2d.paper.results import Result

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
    workers: Annotated[
        int | None, typer.Option(min=1, help="Processes at a time; left out: one per core.")
    ] = None,
    real_map: Annotated[
        Path | None,
        typer.Option("--map", help="A real home, for speed: a ROS map's YAML file, or a vacuum's."),
    ] = None,
) -> None:
    """Repeat the measurements of the paper, and print them beside its figures."""
    from fleet2d.paper import results as months
    from fleet2d.paper.speed import measure_rows
    from fleet2d.studies.executors import cores

    measures = dict(
        zip(
            months.RESULTS,
            (measure_rows, months.ltp_gap, months.rtp_gap, months.feedback),
            strict=True,
        )
    )

    names = check_names(results or [], months.RESULTS)
    options = months.PaperOptions(quick, seeds, days, workers or cores(), real_map, out / "studies")
    with os_errors_as(InputError, f"{out} can't be created", "; name another directory by --out"):
        out.mkdir(parents=True, exist_ok=True)  # an error is shown before hours of work
    can_draw = _can_draw()
    for name in names:
        result = measures[name](options)
        _print(result)
        typer.echo(result.save(out))
        if can_draw:
            from fleet2d.paper.pictures import draw

            target = out / f"{name}.png"
            draw(result, target)
            typer.echo(target)


def check_names(names: Sequence[str], known: Sequence[str]) -> list[str]:
    """Return names of results in the order of the known ones; all of them if `names` is empty.

    Raises:
        InputError: There is no such result.

    Example:
        >>> check_names(["feedback", "speed"], ["speed", "ltp-gap", "feedback"])
        ['speed', 'feedback']
    """
    for name in names:
        check_known(name, "result", known, InputError)
    return [name for name in known if name in names or not names]


def _can_draw() -> bool:
    """Return whether pictures can be drawn; if not, print what is missing."""
    try:
        import fleet2d.pictures  # noqa: F401
    except InputError as error:
        typer.echo(f"no pictures: {error}", err=True)
        return False
    return True


def _print(result: "Result") -> None:
    """Print the tables of a result."""
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    from fleet2d.paper.results import PAPER_COLUMN

    console = Console(soft_wrap=True, width=None if sys.stdout.isatty() else WIDTH)
    console.print(f"\n{escape(result.title)}", highlight=False)
    for table in result.tables:
        title = escape(table.title)
        grid = Table(title=title, title_justify="left", title_style="", show_edge=False)
        for number, head in enumerate(table.columns):
            is_text = head == PAPER_COLUMN
            grid.add_column(
                escape(head),
                justify="left" if is_text or not number else "right",
                no_wrap=not is_text,
            )
        for row in table.rows:
            grid.add_row(*map(escape, row))
        console.print(grid)
        for note in table.notes:
            console.print(f"note: {note}", highlight=False, markup=False)
