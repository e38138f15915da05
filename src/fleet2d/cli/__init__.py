"""The command line: `fleet2d run`, `validate`, `show` and the rest; see `fleet2d --help`.

No run depends on the standard streams of a command: some may be closed, or lead to a full disk, a
terminal that is gone, or an encoding without all characters.
"""

import gc
import io
import os
import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, NoReturn, TextIO

from fleet2d.errors import Fleet2DError, InputError, ctrl_c_watch
from fleet2d.runtime.memory import keep_free_memory, rare_collections


def main() -> NoReturn:
    """Run the command line; exit codes: 0 success, 1 failure, 2 wrong input, 130 interrupted."""
    # NumPy starts a thread for each core when it is imported; nothing here multiplies matrices.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # Looking for pydantic's plugins takes as long as importing it.
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    keep_free_memory()
    open_streams()
    code: str | int | None = 0
    try:
        with ctrl_c_watch(), rare_collections(), named_extras():
            from fleet2d.cli.__main__ import app

            gc.freeze()  # modules live to the end: the collector needn't scan them
            app(standalone_mode=True)
    except SystemExit as end:
        code = end.code
    except Fleet2DError as error:
        for line in (f"error: {error}", *getattr(error, "__notes__", ())):
            sys.stderr.write(f"{line}\n")
        code = 2 if isinstance(error, InputError) else 1
    except KeyboardInterrupt:
        code = 130
    except OSError as error:
        if not output_problem():
            if error.filename is None:
                raise
            sys.stderr.write(
                f"error: {error.filename} can't be read or written: {error.strerror}\n"
            )
            code = 1
    if problem := output_problem():
        if not code:
            sys.stderr.write(f"error: the output can't be written ({problem})\n")
        code = code or 1
    sys.exit(code)


@contextmanager
def named_extras() -> Iterator[None]:
    """Name the extra of a missing module that is imported in the block.

    Raises:
        InputError: An extra installs the module, or it is a limb of Fleet2D.
    """
    try:
        yield
    except ModuleNotFoundError as error:
        name = (error.name or "").partition(".")[0]
        if name == "fleet2d":  # the limb is not installed
            raise InputError(
                f"this needs {error.name}, which is missing: reinstall fleet2d"
            ) from None
        if extra := extra_with(name):
            raise InputError(f'this needs {name}: pip install "fleet2d[{extra}]"') from None
        raise


def extra_with(module: str) -> str:
    """Return the extra of Fleet2D that installs a module's package; empty if none does.

    Example:
        >>> extra_with("starlette"), extra_with("yaml")
        ('view', '')
    """
    from importlib.metadata import requires

    for line in requires("fleet2d") or ():
        package, _, marker = line.partition(";")
        if re.match(rf"{re.escape(module)}\b(?!-)", package.replace("_", "-")):
            return marker.partition('extra == "')[2].rstrip('"')
    return ""


class _StandardStream(io.FileIO):
    """stdout or stderr; after the first output that can't be written, further output is dropped.

    Attributes:
        problem: Why the stream can't be written; empty if it can.
    """

    problem = ""

    def __init__(self, number: int, *, fails: bool) -> None:
        """Open the stream; unless it `fails`, the first output is dropped, too."""
        super().__init__(number, "w", closefd=False)
        self._fails = fails

    def write(self, data: Any) -> int:
        """Write bytes.

        Raises:
            OSError: The bytes can't be written.
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
            # Otherwise a file of the run would get the free number, and all messages with it.
            # Results must not vanish in silence: writing to stdout fails.
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
        sys.stdout.flush()  # the rest is dropped now, so that Python doesn't fail on it at exit
    return raw.problem


def _opened(number: int, before: TextIO | None, *, fails: bool) -> io.TextIOWrapper:
    raw = _StandardStream(number, fails=fails)
    return io.TextIOWrapper(
        io.BufferedWriter(raw),
        "utf-8" if before is None else before.encoding,
        "backslashreplace",
        line_buffering=not fails or raw.isatty(),
    )
