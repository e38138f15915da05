"""Whose fault an error is: a component's, at a step."""

import sys
import traceback
from pathlib import Path
from typing import Any, ClassVar

from fleet2d.errors import ArtifactError, ComponentError, InputError

FRAMES = 4  # of the user's own code that are told, the innermost


class blame:  # noqa: N801  (used as a function)
    """Name the component and the step when a component's code fails.

    Args:
        path: The component's path in the scenario.
        step: The step it is at; None before the run, when wrong input is not the component's fault.

    Raises:
        ComponentError: The code raised something; an error about the input before the run stays it.

    Example:
        >>> with blame("users.ana", 7):
        ...     {}["kitchen"]
        Traceback (most recent call last):
        fleet2d.errors.ComponentError: users.ana failed at step 7: KeyError: 'kitchen'
    """

    now: ClassVar["blame | None"] = None
    """The innermost component whose code runs now, for the watchdog."""

    interrupts: ClassVar[bool] = True
    """Whether Ctrl-C raises KeyboardInterrupt; in a run it is only noted, so code raised it."""

    def __init__(self, path: str, step: int | None) -> None:
        self.path, self.step = path, step

    def __enter__(self) -> None:
        """Begin."""
        self._around, blame.now = blame.now, self

    def __exit__(self, kind: Any, error: BaseException | None, trace: Any) -> None:
        """Turn an exception into one that says whose it is."""
        blame.now = self._around
        if error is None or isinstance(error, ArtifactError | GeneratorExit | MemoryError):
            return
        if isinstance(error, KeyboardInterrupt) and blame.interrupts:
            return
        if isinstance(error, InputError) and self.step is None:
            return
        own = isinstance(error, ComponentError)
        when = "when it was started" if self.step is None else f"at step {self.step}"
        if own and self.path in str(error):
            if when in str(error):
                return
            raise ComponentError(f"{error} ({when})") from error
        what = str(error) if own else f"{type(error).__name__}: {_text(error)}"
        raise ComponentError(f"{self.path} failed {when}: {what}{_place(error)}") from error


def _text(error: BaseException) -> str:
    """Return the message of an error, whose own code may fail too."""
    try:
        return str(error)
    except Exception as failure:  # noqa: BLE001 - it is the user's code
        return f"(its message can't be written: {type(failure).__name__})"


def _place(error: BaseException) -> str:
    """Return where in files outside Fleet2D an error arose: the user's own code, caller first."""
    frames = traceback.extract_tb(error.__traceback__)
    others = (str(Path(__file__).parent), sys.prefix, sys.base_prefix, "<")
    own = [f for f in frames if not f.filename.startswith(others)]
    lines = [f"{Path(f.filename).name}:{f.lineno}, in {f.name}: {f.line}" for f in own[-FRAMES:]]
    return f" ({'; '.join(lines)})" if lines else ""
