"""Who keeps a run waiting: the component whose code has been running for long is named."""

import sys
import threading
import time
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

import typer

from fleet2d.blame import blame

FIRST_S = 30.0
"""The code of a component may run for so long before anything is said; then twice as long."""


@contextmanager
def watched(first_s: float = FIRST_S) -> Iterator[None]:
    """Say on stderr which component has been running for long, and in which line of its code."""
    over = threading.Event()
    here = threading.get_ident()
    thread = threading.Thread(
        target=_watch, args=(over, here, first_s), daemon=True, name="fleet2d-watchdog"
    )
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join(timeout=1)


def _watch(over: threading.Event, thread: int, first_s: float) -> None:
    seen, since, limit = blame.now, time.monotonic(), first_s
    while not over.wait(first_s / 6):
        now = time.monotonic()
        if blame.now is None or blame.now is not seen:
            seen, since, limit = blame.now, now, first_s
        elif now - since >= limit:
            limit *= 2
            when = "before the first step" if seen.step is None else f"at step {seen.step}"
            frame = sys._current_frames().get(thread)
            typer.echo(
                f"{seen.path} has been running for {now - since:.0f} s {when}{_line(frame)};"
                " Ctrl-C twice stops it",
                err=True,
            )


def _line(frame: FrameType | None) -> str:
    """Return where the code of the user is now; empty if it is none of theirs."""
    others = (str(Path(__file__).parents[1]), sys.prefix, sys.base_prefix, "<")
    lines = traceback.extract_stack(frame) if frame else []
    theirs = [f for f in lines if not f.filename.startswith(others)]
    return f" ({Path(theirs[-1].filename).name}:{theirs[-1].lineno})" if theirs else ""
