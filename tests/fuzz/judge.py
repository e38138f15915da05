"""What must hold whatever a reader is given: an error of Fleet2D at most, soon, in little memory."""

import re
import resource
import signal
import tempfile
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

from tests.fuzz.readers import Reader

from fleet2d.errors import Fleet2DError

MOST_S = 10.0
"""Processor time that reading may take."""
MOST_BYTES = 1 << 30
"""Memory that reading may add to what the process has had at most."""
MAX_TEXT_BYTES = 8000
CHILD = re.compile("its reader (failed|died|gave)|to read than")
"""What is said of files that the child fails at which reads foreign formats."""


class HangError(BaseException):
    """Reading takes too long; no reader can catch it by accident."""


def judge(reader: Reader, content: bytes) -> str:
    """Return what is wrong with how a reader takes a content; empty if nothing is."""
    before = _peak()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "here" / reader.file
        path.parent.mkdir(parents=True)
        reader.beside(Path(folder) / "here")
        path.write_bytes(content)
        try:
            with _limited(MOST_S):
                reader.read(path)
        except Fleet2DError as error:
            text = str(error)
            if len(text) > MAX_TEXT_BYTES or any(len(line) > 1000 for line in text.split("\n")):
                return f"a message of {len(text)} characters"
            if CHILD.search(text):  # which would have failed at it in this process, too
                return text.replace(str(path), path.name)
        except HangError:
            return f"more than {MOST_S:g} s"
        except Exception as error:  # noqa: BLE001 - that is what is looked for
            return f"{type(error).__name__} at {_place(error)}"
    grown = _peak() - before
    return f"{grown >> 20} MB" if grown > MOST_BYTES else ""


def _place(error: BaseException) -> str:
    frames = [f for f in traceback.extract_tb(error.__traceback__) if "fleet2d/" in f.filename]
    return f"{Path(frames[-1].filename).name}:{frames[-1].lineno}" if frames else "?"


def _peak() -> int:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


@contextmanager
def _limited(seconds: float) -> Iterator[None]:
    def stop(_: int, __: FrameType | None) -> None:
        raise HangError

    before = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)
