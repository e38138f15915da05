"""The standard streams of a command: no run depends on them.

Whoever starts a command may have closed some of them, or they may lead to a full disk, a terminal
that is gone, or an encoding without all characters.
"""

import io
import os
import sys
from typing import Any, TextIO


class _StandardStream(io.FileIO):
    """stdout or stderr; after the first output that can't be written, further output is dropped.

    Attributes:
        problem: Why it can't be written; empty if it can.
    """

    problem = ""

    def __init__(self, number: int, *, fails: bool) -> None:
        """Open it; unless it `fails`, the first output is dropped, too."""
        super().__init__(number, "w", closefd=False)
        self._fails = fails

    def write(self, data: Any) -> int:
        """Write bytes.

        Raises:
            OSError: They can't be written.
        """
        if not self.problem:
            try:
                return super().write(data)
            except OSError as error:
                self.problem = error.strerror or str(error)
                if self._fails:
                    raise
        return memoryview(data).nbytes


def open_streams() -> None:
    """Open the standard streams that are closed; escape characters that an encoding lacks."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            # The lowest number that is free: otherwise a file of the run would get it, and with it
            # all messages. Results must not vanish in silence: writing to stdout fails.
            os.open(os.devnull, os.O_RDONLY if number == 1 else os.O_RDWR)
    # A test or a notebook may have replaced them. Both sides are None if a stream was closed.
    if sys.stdout is sys.__stdout__:
        sys.stdout = _opened(1, sys.stdout, fails=True)
    if sys.stderr is sys.__stderr__:  # if messages can't be written, nobody can be told
        sys.stderr = _opened(2, sys.stderr, fails=False)


def output_problem() -> str:
    """Return why results can't be written to stdout; empty if all are written."""
    buffer = getattr(sys.stdout, "buffer", None)
    raw = getattr(buffer, "raw", None)
    if not isinstance(raw, _StandardStream):
        return ""
    try:
        sys.stdout.flush()
    except OSError:
        sys.stdout.flush()  # drops what is left, so that it doesn't fail when Python ends
    return raw.problem


def _opened(number: int, before: TextIO | None, *, fails: bool) -> io.TextIOWrapper:
    raw = _StandardStream(number, fails=fails)
    return io.TextIOWrapper(
        io.BufferedWriter(raw),
        "utf-8" if before is None else before.encoding,
        "backslashreplace",
        line_buffering=not fails or raw.isatty(),
    )
