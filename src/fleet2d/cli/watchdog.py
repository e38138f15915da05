"""Name the component whose code has been running for a long time."""

import sys
import threading
import time
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

import typer

from fleet2d.errors import blame

FIRST_S = 30.0
"""Time after which a running component is named [s]; the next message comes after twice as long."""


@contextmanager
def watched(first_s: float = FIRST_S) -> Iterator[None]:
    """Print to stderr each component that runs longer than `first_s`, and the line it is at."""
    is_over = threading.Event()
    thread_id = threading.get_ident()
    thread = threading.Thread(
        target=_watch, args=(is_over, thread_id, first_s), daemon=True, name="fleet2d-watchdog"
    )
    thread.start()
    try:
        yield
    finally:
        is_over.set()
        thread.join(timeout=1)


def _watch(is_over: threading.Event, thread_id: int, first_s: float) -> None:
    call, start_s, limit_s = blame.now, time.monotonic(), first_s
    while not is_over.wait(first_s / 6):
        time_s = time.monotonic()
        if blame.now is None or blame.now is not call:
            call, start_s, limit_s = blame.now, time_s, first_s
        elif time_s - start_s >= limit_s:
            limit_s *= 2
            moment = "before the first step" if call.step is None else f"at step {call.step}"
            frame = sys._current_frames().get(thread_id)
            typer.echo(
                f"{call.path} has been running for {time_s - start_s:.0f} s {moment}{_line(frame)};"
                " Ctrl-C twice stops it",
                err=True,
            )


def _line(frame: FrameType | None) -> str:
    """Return the current line of the user's code as text; empty if there is none."""
    other_code = (str(Path(__file__).parents[1]), sys.prefix, sys.base_prefix, "<")
    lines = traceback.extract_stack(frame) if frame else []
    frames = [f for f in lines if not f.filename.startswith(other_code)]
    return f" ({Path(frames[-1].filename).name}:{frames[-1].lineno})" if frames else ""
