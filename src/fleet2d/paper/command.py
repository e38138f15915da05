"""The command that repeats the measurements of the paper: `fleet2d reproduce-paper`."""

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from fleet2d.configuration.problems import suggest
from fleet2d.errors import InputError

if TYPE_CHECKING:
    from fleet2d.paper.months import OnProgress, PaperOptions, Result

RESULTS = ("speed", "ltp-gap", "rtp-gap", "feedback")  # in the order of the paper
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
    from fleet2d.paper.months import PaperOptions, make_directory
    from fleet2d.studies.executors import cores

    names = check_names(results or [])
    options = PaperOptions(quick, seeds, days, workers or cores(), real_map, out / "studies")
    make_directory(out)  # an error is shown before hours of work
    can_draw = _can_draw()
    for name in names:
        with _progress(name, show=sys.stderr.isatty()) as on_progress:
            result = reproduce(name, options, on_progress)
        _print(result)
        typer.echo(result.save(out))
        if can_draw:
            from fleet2d.paper.pictures import draw

            target = out / f"{name}.png"
            draw(result, target)
            typer.echo(target)


def check_names(names: Sequence[str]) -> list[str]:
    """Return the names of results in the order of the paper; all of them if `names` is empty.

    Raises:
        InputError: There is no such result.

    Example:
        >>> check_names(["feedback", "speed"])
        ['speed', 'feedback']
    """
    for name in names:
        if name not in RESULTS:
            raise InputError(f"there is no result {name!r}{suggest(name, RESULTS)}")
    return [name for name in RESULTS if name in names or not names]


def reproduce(name: str, options: "PaperOptions", on_progress: "OnProgress") -> "Result":
    """Repeat the measurements of one result.

    Args:
        name: One of `RESULTS`.
        options: The size.
        on_progress: Receives the progress.

    Raises:
        InputError: The map can't be read, or matplotlib is missing, which drawing frames needs.
    """
    from fleet2d.paper import months, speed

    functions = (
        speed.reproduce,
        months.reproduce_ltp_gap,
        months.reproduce_rtp_gap,
        months.reproduce_feedback,
    )
    return dict(zip(RESULTS, functions, strict=True))[name](options, on_progress)


def _can_draw() -> bool:
    """Return whether pictures can be drawn; if not, print what is missing."""
    try:
        import fleet2d.pictures  # noqa: F401
    except InputError as error:
        typer.echo(f"no pictures: {error}", err=True)
        return False
    return True


@contextmanager
def _progress(name: str, *, show: bool) -> "Iterator[OnProgress]":
    """Yield a function that shows progress as a bar if `show`, else does nothing."""
    from fleet2d.paper.months import ignore_progress
    from fleet2d.studies.progress import progress_bar

    with progress_bar(show=show) as progress:
        if progress is None:
            yield ignore_progress
            return
        task = progress.add_task(name, total=None)

        def update(phase: str, done: int, total: int) -> None:
            progress.update(task, completed=done, total=total, description=f"{name}: {phase}")

        yield update


def _print(result: "Result") -> None:
    """Print the tables of a result."""
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    from fleet2d.paper.months import PAPER_COLUMN

    console = Console(soft_wrap=True, width=None if sys.stdout.isatty() else WIDTH)
    console.print(f"\n{escape(result.title)}", highlight=False)
    for table in result.tables:
        grid = Table(
            title=escape(table.title), title_justify="left", title_style="", show_edge=False
        )
        for number, head in enumerate(table.columns):
            is_text = head == PAPER_COLUMN
            justify: Literal["left", "right"] = "left" if is_text or not number else "right"
            grid.add_column(escape(head), justify=justify, no_wrap=not is_text)
        for row in table.rows:
            grid.add_row(*map(escape, row))
        console.print(grid)
        for note in table.notes:
            console.print(f"note: {note}", highlight=False, markup=False)
