"""Errors of components: which component failed, and at which step."""

import os
import signal
import sys
import threading
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, ClassVar, NoReturn

from fleet2d.errors import ArtifactError, ComponentError, InputError

FRAMES = 4
"""The innermost frames of the user's own code that a message lists, at most."""


class blame:  # noqa: N801  (used as a function)
    """Name the component and the step in the error when a component's code fails.

    Args:
        path: The component's path in the scenario.
        step: The present step; None before the run, when errors about input are passed on.

    Raises:
        ComponentError: The code raised an exception.

    Example:
        >>> with blame("users.ana", 7):
        ...     {}["kitchen"]
        Traceback (most recent call last):
        fleet2d.errors.ComponentError: users.ana failed at step 7: KeyError: 'kitchen'
    """

    now: ClassVar["blame | None"] = None
    """The innermost component whose code is running, for the watchdog."""

    last: ClassVar["blame | None"] = None
    """The component whose code was called last."""

    interrupts: ClassVar[bool] = True
    """Whether Ctrl-C raises KeyboardInterrupt; if not, a component must have raised it."""

    pressed: ClassVar[bool | None] = None
    """Whether Ctrl-C was pressed; None: unknown, as nothing notes it."""

    def __init__(self, path: str, step: int | None) -> None:
        self.path, self.step = path, step

    @property
    def time(self) -> str:
        """When it is running, in words."""
        return "when it was started" if self.step is None else f"at step {self.step}"

    def __enter__(self) -> None:
        """Make this the running component."""
        self._outer, blame.now, blame.last = blame.now, self, self

    def __exit__(self, kind: Any, error: BaseException | None, trace: Any) -> None:
        """Replace an exception by one that names the component."""
        blame.now = self._outer
        if error is None or isinstance(error, ArtifactError) or may_be_ctrl_c(error):
            return
        if isinstance(error, InputError) and self.step is None:
            return
        is_ours = isinstance(error, ComponentError)
        if is_ours and self.path in str(error):
            if self.time in str(error):
                return
            raise ComponentError(f"{error} ({self.time})") from error
        message = str(error) if is_ours else f"{type(error).__name__}: {text_of(error)}"
        raise ComponentError(f"{self.path} failed {self.time}: {message}{_place(error)}") from error


def may_be_ctrl_c(error: BaseException) -> bool:
    """Whether Ctrl-C may have raised an exception, and not the code of a component."""
    is_unclear = blame.interrupts and blame.pressed is not False
    return isinstance(error, KeyboardInterrupt) and is_unclear


def end_by_signal(*_: object) -> None:
    """Raise KeyboardInterrupt, which is no component's own: a handler of signals."""
    blame.pressed = True
    raise KeyboardInterrupt


@contextmanager
def ctrl_c_watch() -> Iterator[None]:
    """Note whether Ctrl-C is pressed, so that an interrupt without it is a component's own."""
    before = signal.getsignal(signal.SIGINT)
    if before not in (signal.default_int_handler, signal.SIG_IGN):  # a program's own
        yield
        return

    blame.pressed = False
    if before is not signal.SIG_IGN:
        signal.signal(signal.SIGINT, end_by_signal)
    try:
        yield
    finally:
        blame.pressed = None
        signal.signal(signal.SIGINT, before)


@contextmanager
def exit_guard() -> Iterator[None]:
    """Make `os._exit` of a component's code an error, which else ends the program without a word.

    In another thread it still ends the program, with exit code 1 and a message.
    """
    leave, program = os._exit, os.getpid()

    def guarded(status: int) -> NoReturn:
        caller = sys._getframe(1)
        package = caller.f_globals.get("__name__", "").partition(".")[0]
        if os.getpid() != program or package == "fleet2d":  # a child process ends like this
            leave(status)
        if threading.current_thread() is threading.main_thread():
            raise SystemExit(f"os._exit({status})")
        place = f"{Path(caller.f_code.co_filename).name}:{caller.f_lineno}"
        last = f"; {blame.last.path} was called last, {blame.last.time}" if blame.last else ""
        message = f"error: a thread ended the program by os._exit({status}) ({place}){last}"
        os.write(2, f"{message}\n".encode())
        leave(1)

    os._exit = guarded
    try:
        yield
    finally:
        os._exit = leave


def text_of(error: BaseException) -> str:
    """Return the message of an error, even if its own code fails."""
    try:
        return str(error)
    except BaseException as failure:  # noqa: BLE001 - it is the user's code
        return f"(its message can't be written: {type(failure).__name__})"


def _place(error: BaseException) -> str:
    """Return the frames of an error in the user's own code, caller first."""
    libraries = (str(Path(__file__).parent), sys.prefix, sys.base_prefix, "<")
    frames = [
        frame
        for frame in traceback.extract_tb(error.__traceback__)
        if not frame.filename.startswith(libraries)
    ]
    lines = [f"{Path(f.filename).name}:{f.lineno}, in {f.name}: {f.line}" for f in frames[-FRAMES:]]
    return f" ({'; '.join(lines)})" if lines else ""
