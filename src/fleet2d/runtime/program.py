"""Programs of other languages that take part in a run over pipes: started, timed, ended and blamed.

A message is a line of JSON, ended by a newline. It may be followed by blocks of bytes, whose names
and sizes its key `blocks` lists, as [["evidence", 1024]]: tables are Arrow IPC streams. A program
reads messages from its standard input and answers each by one on its standard output:

    start    what the run is               ready
    update   tables of the history         output, or none
    decide   where a body is               plan, or none
    save     nothing                       state, with one block of any bytes
    load     such a block                  ready
"""

import contextlib
import json
import os
import queue
import subprocess
import sys
import tempfile
import threading
import time
import weakref
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import IO, Any, NamedTuple

from fleet2d.errors import ComponentError

VERSION = 1
"""The version of the messages."""
MAX_BLOCK = 256 << 20
MAX_LINE = 16 << 20
# Time for a program to end by itself [s].
END_S = 1.0
# The end of what it wrote on stderr that an error quotes [characters].
QUOTED = 500


class Answer(NamedTuple):
    """An answer of a program: its JSON object, and its blocks by name."""

    content: dict[str, Any]
    blocks: dict[str, bytes]


def command_line(program: Path, arguments: Sequence[str]) -> list[str]:
    """Return how a program is run: a Python file by the interpreter of this process."""
    python = [sys.executable] if program.suffix == ".py" else []
    return [*python, str(program), *arguments]


class ExternalProgram:
    """A program of a run, which is started when it is first asked.

    A copy is a program of its own, which continues from the state that the other one saved.

    Attributes:
        wall_s: Time that it took to answer so far [s].
        asked: How often it was asked.
    """

    def __init__(self, command: Sequence[str], timeout_s: float, start: Mapping[str, Any]) -> None:
        """Note what to run.

        Args:
            command: The program and its arguments.
            timeout_s: An answer that takes longer ends the run.
            start: The content of its first message.
        """
        self._command, self._timeout_s, self._start = list(command), timeout_s, dict(start)
        self._state: bytes | None = None
        self._process: subprocess.Popen[bytes] | None = None
        self.wall_s, self.asked = 0.0, 0

    def __getstate__(self) -> dict[str, Any]:
        """Return what a copy needs, with the state that the program saves."""
        state = self._state
        if self._process is not None:
            state = self.ask({"type": "save"}, expected="state").blocks.get("state")
            if state is None:
                raise self._failure('answered "save" without a block named "state"')
        return {
            "_command": self._command,
            "_timeout_s": self._timeout_s,
            "_start": self._start,
            "_state": state,
            "_process": None,
            "wall_s": self.wall_s,
            "asked": self.asked,
        }

    def ask(
        self,
        content: Mapping[str, Any],
        blocks: Mapping[str, bytes] | None = None,
        expected: str = "",
    ) -> Answer:
        """Send a message, and return the answer.

        Args:
            content: The message.
            blocks: Blocks of bytes, by name.
            expected: The type that the answer must have, besides `error`; empty: any.

        Raises:
            ComponentError: The program can't be started, doesn't answer in time, ends, or answers
                with something else.
        """
        if self._process is None:
            self._begin()
        began = time.perf_counter()
        answer = self._exchange(content, blocks or {})
        self.wall_s += time.perf_counter() - began
        self.asked += 1
        kind = answer.content.get("type")
        if kind == "error":
            raise self._failure(f"reports: {answer.content.get('text', '')}")
        if expected and kind != expected:
            raise self._failure(f"answered {kind!r} to {content['type']!r}, not {expected!r}")
        return answer

    def _begin(self) -> None:
        self._stderr = tempfile.TemporaryFile()  # noqa: SIM115 - open while the program runs
        try:
            process = subprocess.Popen(  # noqa: S603 - which programs may run is checked by trust
                self._command,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self._stderr,
                cwd=Path(self._command[0]).parent if os.sep in self._command[0] else None,
            )
        except OSError as error:
            self._stderr.close()
            raise ComponentError(
                f"{self._command[0]} can't be started: {error.strerror or error}"
            ) from error
        self._process = process
        answers: queue.SimpleQueue[Answer | str] = queue.SimpleQueue()
        self._answers = answers
        assert process.stdout is not None
        threading.Thread(target=_read, args=(process.stdout, answers), daemon=True).start()
        self._finalizer = weakref.finalize(self, _end, process, self._stderr)
        self._exchange_checked({"type": "start", "version": VERSION, **self._start}, {})
        if self._state is not None:
            self._exchange_checked({"type": "load"}, {"state": self._state})

    def _exchange_checked(self, content: Mapping[str, Any], blocks: Mapping[str, bytes]) -> None:
        answer = self._exchange(content, blocks)
        if answer.content.get("type") != "ready":
            text = answer.content.get("text", answer.content)
            raise self._failure(f"answered {text} to {content['type']!r}, not 'ready'")

    def _exchange(self, content: Mapping[str, Any], blocks: Mapping[str, bytes]) -> Answer:
        process = self._process
        assert process is not None
        assert process.stdin is not None
        if blocks:
            content = {**content, "blocks": [[name, len(data)] for name, data in blocks.items()]}
        try:
            process.stdin.write(json.dumps(content).encode() + b"\n" + b"".join(blocks.values()))
            process.stdin.flush()
            answer = self._answers.get(timeout=self._timeout_s)
        except queue.Empty:
            raise self._failure(
                f"didn't answer {content['type']!r} within {self._timeout_s:g} s and was ended"
            ) from None
        except OSError:
            answer = "ended"
        if isinstance(answer, str):
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(END_S)
            code = process.poll()
            if answer == "ended":
                answer = f"ended with code {code} instead of answering {content['type']!r}"
            raise self._failure(answer)
        return answer

    def _failure(self, text: str) -> ComponentError:
        """End the program, and return the error about it."""
        self._stderr.seek(0, os.SEEK_END)
        self._stderr.seek(max(0, self._stderr.tell() - QUOTED))
        said = self._stderr.read().decode(errors="replace").strip()
        self._finalizer()
        quoted = f"; on stderr it wrote: {said}" if said else ""
        return ComponentError(f"{' '.join(self._command)} {text}{quoted}")


def _read(stream: IO[bytes], answers: "queue.SimpleQueue[Answer | str]") -> None:
    """Read answers until the stream ends."""
    while True:
        line = stream.readline(MAX_LINE)
        if not line:
            answers.put("ended")
            return
        try:
            content = json.loads(line)
            sizes = [(str(name), int(size)) for name, size in content.get("blocks", ())]
            if any(not 0 <= size <= MAX_BLOCK for _, size in sizes):
                raise ValueError("a block is too large")
            blocks = {name: stream.read(size) for name, size in sizes}
        except (ValueError, TypeError, AttributeError) as error:
            answers.put(f"wrote {line[:80]!r}, which is no line of JSON with a type ({error})")
            return
        answers.put(Answer(content, blocks))


def _end(process: "subprocess.Popen[bytes]", stderr: IO[bytes]) -> None:
    """End a program: by the end of its input, else by force."""
    with contextlib.suppress(OSError):
        assert process.stdin is not None
        process.stdin.close()
    try:
        process.wait(END_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
    with contextlib.suppress(OSError):
        assert process.stdout is not None
        process.stdout.close()
    stderr.close()
