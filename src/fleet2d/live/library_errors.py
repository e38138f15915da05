"""Errors in libraries of peers and in threads, as lines in place of tracebacks."""

import logging
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from fleet2d.bounds import one_line
from fleet2d.errors import printable

LIBRARIES = ("websockets", "paho", "roslibpy", "twisted", "asyncio", "concurrent")
"""The loggers that write to the terminal if nobody listens to them."""
MAX_TEXT = 300


class _LogHandler(logging.Handler):
    """Passes warnings and errors on as lines."""

    def __init__(self, tell: Callable[[str], object]) -> None:
        super().__init__(logging.WARNING)
        self._tell = tell

    def emit(self, record: logging.LogRecord) -> None:
        error = record.exc_info[1] if record.exc_info else None
        cause = f": {_described(error)}" if error is not None else ""
        text = record.getMessage().partition("\n")[0]
        self._tell(printable(one_line(f"{record.name}: {text}{cause}", MAX_TEXT)))


def _described(error: BaseException) -> str:
    return f"{type(error).__name__}: {error}"


@contextmanager
def libraries_told(tell: Callable[[str], object]) -> Iterator[None]:
    """Report errors within libraries and in their threads.

    Args:
        tell: Called with one line about each error, from any thread.
    """
    handler = _LogHandler(tell)
    loggers = [logging.getLogger(name) for name in LIBRARIES]
    before = [(logger.handlers, logger.propagate) for logger in loggers]
    hook = threading.excepthook

    def tell_thread(args: threading.ExceptHookArgs) -> None:
        if args.exc_value is not None:
            tell(printable(one_line(f"a thread ended: {_described(args.exc_value)}", MAX_TEXT)))

    for logger in loggers:
        logger.handlers = [handler]
        logger.propagate = False
    threading.excepthook = tell_thread
    try:
        yield
    finally:
        threading.excepthook = hook
        for logger, (handlers, propagates) in zip(loggers, before, strict=True):
            logger.handlers = handlers
            logger.propagate = propagates
