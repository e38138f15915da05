"""Progress of long work on stderr: a bar in a terminal, else a line a minute."""

import sys
import threading
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.progress import Progress

LINES_EVERY_S = 60.0


@contextmanager
def progress_bar(*, show: bool, counts: bool = True) -> "Iterator[Progress]":
    """Yield the tasks whose progress is shown.

    Args:
        show: Whether progress is shown at all.
        counts: Whether a bar shows the number done rather than the percentage.
    """
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TaskProgressColumn,
        TextColumn,
        TimeRemainingColumn,
    )

    share = MofNCompleteColumn() if counts else TaskProgressColumn()
    columns = (TextColumn("{task.description}"), BarColumn(), share, TimeRemainingColumn())
    is_bar = show and sys.stderr.isatty()
    console = Console(stderr=True, soft_wrap=not is_bar)
    progress = Progress(*columns, console=console, transient=True, disable=not is_bar)
    shown: AbstractContextManager[object] = nullcontext()
    if show:
        shown = progress if is_bar else _lines(progress)
    with shown:
        yield progress


@contextmanager
def _lines(progress: "Progress") -> Iterator[None]:
    """Write a line about each task to stderr, every minute."""
    is_over = threading.Event()

    def write() -> None:
        while not is_over.wait(LINES_EVERY_S):
            for task in progress.tasks:
                share = "" if task.total is None else f"{task.percentage:.0f} %: "
                sys.stderr.write(f"{share}{task.description}\n")

    thread = threading.Thread(target=write, daemon=True, name="fleet2d-progress")
    thread.start()
    try:
        yield
    finally:
        is_over.set()
        thread.join(timeout=1)
