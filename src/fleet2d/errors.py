"""Exceptions, all derived from :class:`Fleet2DError`, and contexts that raise them for others."""

import signal
import sys
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, ClassVar

# Longer lines of a message quote input; they are shortened to head and tail [characters].
_LONGEST = 1000
_HEAD = 600
_TAIL = 300
_MAX_LINES = 200


class Fleet2DError(Exception):
    """Base of all errors that Fleet2D raises.

    Example:
        >>> len(str(Fleet2DError("x" * 10**6)))
        903
    """

    def __init__(self, *args: object) -> None:
        """Shorten very long lines of the message, and very many; escape control characters."""
        texts = (_cut(printable(a, "\n\t")) if isinstance(a, str) else a for a in args)
        super().__init__(*texts)


def printable(text: str, others: str = "") -> str:
    r"""Return text from a file for a terminal: control characters are escaped.

    Args:
        text: Any text.
        others: Characters that are left as they are.

    Example:
        >>> printable("\x1b[2Jgone")
        '\\x1b[2Jgone'
    """
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() or c in others else repr(c)[1:-1] for c in text)


def _cut(text: str) -> str:
    if len(text) <= _LONGEST:
        return text
    lines = text.split("\n")
    if len(lines) > _MAX_LINES:
        lines[_MAX_LINES:] = [f"... {len(lines) - _MAX_LINES} more lines"]
    return "\n".join(
        line if len(line) <= _LONGEST else f"{line[:_HEAD]}...{line[-_TAIL:]}" for line in lines
    )


class InputError(Fleet2DError):
    """The user's input is wrong; the message says what, where, and what to do."""


class ScenarioError(InputError):
    """A scenario file, an override or a component's configuration is wrong."""


class FloorPlanError(InputError):
    """A floor plan can't be read, or isn't a home."""


class NoLayoutError(FloorPlanError):
    """No layout of a synthetic home was found that meets a request."""


class UnclearPlaceError(FloorPlanError):
    """A picture is no home because of one place in it.

    Attributes:
        place: The place (column, row) [pixels].
        radius: Radius of what is unclear [pixels].
    """

    def __init__(self, message: str, place: tuple[int, int], radius: float) -> None:
        """Take the message and the place."""
        super().__init__(message)
        self.place = place
        self.radius = radius


class PlacementError(InputError):
    """An entity can't stand at a place, or can't get there."""


class ComponentError(Fleet2DError):
    """A behavior, an algorithm or a metric broke its contract during a run."""


class NoWayError(ComponentError):
    """There is no way to a place at present, for example because a door is shut."""


class ArtifactError(Fleet2DError):
    """A run could not be stored or read back."""


class RunDirectoryError(InputError):
    """The run directory exists already, is missing, or can't be written."""


@contextmanager
def extra(name: str, need: str) -> Iterator[None]:
    """Explain what to install if the imports in the block fail.

    Args:
        name: The extra of Fleet2D that has the package, such as study.
        need: The feature and the package that it needs.

    Raises:
        InputError: The package is not installed.

    Example:
        >>> with extra("paint", "painting needs easel"):
        ...     import easel
        Traceback (most recent call last):
        fleet2d.errors.InputError: painting needs easel: pip install "fleet2d[paint]"
    """
    try:
        yield
    except ImportError:
        raise InputError(f'{need}: pip install "fleet2d[{name}]"') from None


@contextmanager
def os_errors_as(error: type[Fleet2DError], message: str, advice: str = "") -> Iterator[None]:
    """Raise an error of Fleet2D in place of an OSError in the block.

    Args:
        error: The class of the error.
        message: The beginning of its message, which the operating system's reason follows.
        advice: The end of its message.

    Example:
        >>> with os_errors_as(InputError, "absent.yaml can't be read"):
        ...     open("absent.yaml")
        Traceback (most recent call last):
        fleet2d.errors.InputError: absent.yaml can't be read: No such file or directory
    """
    try:
        yield
    except OSError as reason:
        raise error(f"{message}: {reason.strerror or reason}{advice}") from reason


@contextmanager
def errors_as(
    error: Callable[[str], BaseException] | None,
    place: str = "",
    of: type[BaseException] | tuple[type[BaseException], ...] = InputError,
) -> Iterator[None]:
    """Raise another error in place of one in the block, or the same one with its place.

    Args:
        error: The error to raise; None: one of the same class.
        place: The beginning of its message, which that of the error in the block follows.
        of: The errors in whose place it is raised.

    Example:
        >>> with errors_as(ScenarioError, "changes.2", of=KeyError):
        ...     {}["hall_door"]
        Traceback (most recent call last):
        fleet2d.errors.ScenarioError: changes.2: 'hall_door'
    """
    try:
        yield
    except of as reason:
        raise (error or type(reason))(f"{place}: {reason}" if place else str(reason)) from reason


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

    __slots__ = ("_outer", "path", "step")

    now: ClassVar["blame | None"] = None
    """The innermost component whose code is running, for the watchdog."""

    interrupts: ClassVar[bool] = True
    """Whether Ctrl-C raises KeyboardInterrupt; if not, a component must have raised it."""

    pressed: ClassVar[bool | None] = None
    """Whether Ctrl-C was pressed; None: unknown, as nothing notes it."""

    def __init__(self, path: str, step: int | None) -> None:
        self.path, self.step = path, step

    @property
    def time(self) -> str:
        """The time at which the component runs, in words."""
        return "when it was started" if self.step is None else f"at step {self.step}"

    def __enter__(self) -> None:
        """Mark the component as running."""
        self._outer = blame.now
        blame.now = self

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
    """Handle a signal: raise a KeyboardInterrupt that isn't blamed on a component."""
    blame.pressed = True
    raise KeyboardInterrupt


@contextmanager
def ctrl_c_watch() -> Iterator[None]:
    """Note whether Ctrl-C is pressed: a KeyboardInterrupt without it is a component's."""
    before = signal.getsignal(signal.SIGINT)
    if before not in (signal.default_int_handler, signal.SIG_IGN):  # the program handles SIGINT
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


def text_of(error: BaseException) -> str:
    """Return the message of an error, even if its own code fails."""
    try:
        return str(error)
    except BaseException as failure:  # noqa: BLE001 - it is the user's code
        return f"(its message can't be written: {type(failure).__name__})"


def own_frames(stack: traceback.StackSummary) -> list[traceback.FrameSummary]:
    """Return the frames of a stack in the user's own code, caller first."""
    libraries = (str(Path(__file__).parent), sys.prefix, sys.base_prefix, "<")
    return [frame for frame in stack if not frame.filename.startswith(libraries)]


def _place(error: BaseException) -> str:
    frames = own_frames(traceback.extract_tb(error.__traceback__))
    lines = [f"{Path(f.filename).name}:{f.lineno}, in {f.name}: {f.line}" for f in frames[-FRAMES:]]
    return f" ({'; '.join(lines)})" if lines else ""
