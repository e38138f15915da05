"""The command that measures the paper's results anew: `fleet2d reproduce-paper`."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from fleet2d.errors import InputError
from fleet2d.paper.result import PAPER_COLUMN

if TYPE_CHECKING:
    from fleet2d.paper.months import Tell
    from fleet2d.paper.result import Result


WIDTH = 200


def reproduce_paper(
    results: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[speed|ltp-gap|rtp-gap|feedback]...", help="Which; left out: all four."
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
    """Measure the paper's results anew, beside its figures."""
    from fleet2d.paper.months import Request
    from fleet2d.paper.result import make_directory
    from fleet2d.paper.results import chosen, reproduce
    from fleet2d.studies.execution import cores

    names = chosen(results or [])
    request = Request(quick, seeds, days, workers or cores(), real_map, out / "studies")
    make_directory(out)  # before hours of work
    pictures = _can_draw()
    for name in names:
        with _progress(name, show=sys.stderr.isatty()) as tell:
            found = reproduce(name, request, tell)
        _print(found)
        typer.echo(found.save(out))
        if pictures:
            from fleet2d.paper.pictures import draw

            target = out / f"{name}.png"
            draw(found, target)
            typer.echo(target)


def _can_draw() -> bool:
    """Tell whether pictures can be drawn; if not, say what is missing."""
    try:
        import fleet2d.view  # noqa: F401
    except InputError as error:
        typer.echo(f"no pictures: {error}", err=True)
        return False
    return True


@contextmanager
def _progress(name: str, *, show: bool) -> "Iterator[Tell]":
    """Show how far a result is, on a terminal."""
    from fleet2d.paper.months import silent

    if not show:
        yield silent
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task(name, total=None)

        def tell(what: str, done: int, of: int) -> None:
            progress.update(task, completed=done, total=of, description=f"{name}: {what}")

        yield tell


def _print(result: "Result") -> None:
    """Print the tables of a result."""
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    # In a file, lines are as long as they need to be.
    console = Console(soft_wrap=True, width=None if sys.stdout.isatty() else WIDTH)
    console.print(f"\n{escape(result.title)}", highlight=False)
    for table in result.tables:
        shown = Table(
            title=escape(table.title), title_justify="left", title_style="", show_edge=False
        )
        for number, head in enumerate(table.columns):
            told = head == PAPER_COLUMN
            left = told or not number
            shown.add_column(escape(head), justify="left" if left else "right", no_wrap=not told)
        for row in table.rows:
            shown.add_row(*map(escape, row))
        console.print(shown)
        for note in table.notes:
            console.print(f"note: {note}", highlight=False, markup=False)
