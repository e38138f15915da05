"""Errors within libraries and threads: a line each, no traceback, and nothing left behind."""

import logging
import threading

import pytest

from fleet2d.live.library_errors import LIBRARIES, libraries_told


@pytest.mark.parametrize("name", LIBRARIES)
def test_an_error_of_a_library_is_one_line(name, capfd):
    told = []
    logger = logging.getLogger(f"{name}.server")
    with libraries_told(told.append):
        try:
            raise ValueError("first\nsecond \x1b[2J")
        except ValueError:
            logger.exception("the handshake failed\nTraceback of its own")
        logger.info("connected")

    assert told == [
        f"{name}.server: the handshake failed: ValueError: first second \\x1b[2J",
    ]
    assert capfd.readouterr().err == ""


def test_a_thread_that_fails_is_one_line(capfd):
    def fail():
        raise RuntimeError("gone")

    told = []
    with libraries_told(told.append):
        thread = threading.Thread(target=fail)
        thread.start()
        thread.join()

    assert told == ["a thread ended: RuntimeError: gone"]
    assert capfd.readouterr().err == ""


def test_loggers_and_threads_are_as_before_afterwards():
    logger = logging.getLogger(LIBRARIES[0])
    before = logger.handlers, logger.propagate, threading.excepthook
    with libraries_told(print):
        assert logger.handlers != before[0]

    assert (logger.handlers, logger.propagate, threading.excepthook) == before
