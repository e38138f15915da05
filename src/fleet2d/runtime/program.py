"""Programs of other languages that take part in a run over pipes, with time limits and errors.

A message is a line of JSON, ended by a newline. It may be followed by blocks of bytes, whose names
and sizes its key `blocks` lists, as [["evidence", 1024]]: tables are Arrow IPC streams. A program
reads messages from its standard input and answers each by one on its standard output:

    start    facts about the run           ready
    update   tables of the history         output, or none
    decide   where a body is               plan, or none
    save     nothing                       state, with one block of any bytes
    load     such a block                  ready
"""

import contextlib
import json
import os
import subprocess
import sys
import tempfile
import time
import weakref
from collections.abc import Mapping, Sequence
from pathlib import Path
from queue import Empty, Queue, SimpleQueue
from threading import Thread
from typing import IO, Any, NamedTuple

from fleet2d.errors import ComponentError

VERSION = 1
"""The version of the messages."""
MAX_BLOCK = 256 << 20
MAX_LINE = 16 << 20
READ_SIZE = 1 << 20
# At most this many parts of an answer wait to be read; a program that writes more has to wait.
READ_AHEAD = 4
# Time for a program to end by itself [s].
END_S = 1.0
# An error quotes this much of the end of a program's stderr [characters].
QUOTED = 500


def interpreter_of(program: Path) -> list[str]:
    """Return the beginning of the command that runs a program, by its suffix."""
    by_suffix = {".py": sys.executable, ".js": "node", ".mjs": "node"}
    return [by_suffix[program.suffix]] if program.suffix in by_suffix else []


class Answer(NamedTuple):
    """An answer of a program: its JSON object, and its blocks by name."""

    content: dict[str, Any]
    blocks: dict[str, bytes]


class ExternalProgram:
    """A program of a run, which is started when it is first asked.

    A copy is a program of its own, which continues from the state that the other one saved.

    Attributes:
        wall_s: Time that it took to answer so far [s].
        asked: Number of messages sent to it.
    """

    def __init__(
        self, program: Path, arguments: Sequence[str], timeout_s: float, start: Mapping[str, Any]
    ) -> None:
        """Note the command; the program starts with the first message.

        Args:
            program: The program, which runs in its folder; what runs it follows from its suffix:
                .py this interpreter, .js and .mjs Node.
            arguments: Its arguments.
            timeout_s: An answer that takes longer ends the run.
            start: The content of its first message.
        """
        self._program = program.absolute()
        self._arguments = list(arguments)
        self._timeout_s = timeout_s
        self._start = dict(start)
        self._state: bytes | None = None
        self._process: subprocess.Popen[bytes] | None = None
        self.wall_s = 0.0
        self.asked = 0

    def __getstate__(self) -> dict[str, Any]:
        """Return the attributes of a copy, with the state that the program saves."""
        state = self._state
        if self._process is not None:
            state = self.ask({"type": "save"}, expected="state").blocks.get("state")
            if state is None:
                raise self._failure('answered "save" without a block named "state"')
        kept = ("_program", "_arguments", "_timeout_s", "_start", "wall_s", "asked")
        return {name: vars(self)[name] for name in kept} | {"_state": state, "_process": None}

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
        answer = self._exchange(content, blocks or {}, expected)
        self.wall_s += time.perf_counter() - began
        self.asked += 1
        return answer

    def _begin(self) -> None:
        self._stderr = tempfile.TemporaryFile()  # noqa: SIM115 - open while the program runs
        try:
            process = subprocess.Popen(  # noqa: S603 - which programs may run is checked by trust
                [*interpreter_of(self._program), str(self._program), *self._arguments],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self._stderr,
                cwd=self._program.parent,
                bufsize=0,
            )
        except OSError as error:
            self._stderr.close()
            by = "".join(f" by {name}" for name in interpreter_of(self._program))
            raise ComponentError(
                f"{self._program} can't be started{by}: {error.strerror or error}"
            ) from error
        self._process = process
        self._unread = bytearray()
        assert process.stdin is not None
        assert process.stdout is not None
        # A thread for each pipe, on any system: neither side reads while it waits for the other one
        # to take its bytes.
        self._messages = SimpleQueue[bytes | None]()
        self._parts = Queue[bytes](READ_AHEAD)
        reader = Thread(target=_read, args=(process.stdout, self._parts), daemon=True)
        Thread(target=_write, args=(process.stdin, self._messages), daemon=True).start()
        reader.start()
        ends = self._messages, self._parts, reader
        self._finalizer = weakref.finalize(self, _end, process, self._stderr, *ends)
        self._exchange({"type": "start", "version": VERSION, **self._start}, {}, "ready")
        if self._state is not None:
            self._exchange({"type": "load"}, {"state": self._state}, "ready")

    def _exchange(
        self, content: Mapping[str, Any], blocks: Mapping[str, bytes], expected: str
    ) -> Answer:
        if blocks:
            sizes = [[name, len(data)] for name, data in blocks.items()]
            content = {**content, "blocks": sizes}
        self._take_arrived()
        if self._unread:
            raise self._failure(f"wrote {bytes(self._unread[:80])!r} without being asked")
        message = json.dumps(content).encode() + b"\n" + b"".join(blocks.values())
        try:
            answer = self._transfer(message)
        except TimeoutError:
            raise self._failure(
                f"didn't answer {content['type']!r} within {self._timeout_s:g} s and was ended"
            ) from None
        except (ValueError, TypeError, AttributeError) as error:
            line = bytes(self._unread[:80])
            raise self._failure(
                f"wrote {line!r}, which is not a line of JSON with a type ({error})"
            ) from None
        if answer is None:
            process = self._process
            assert process is not None
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(END_S)
            raise self._failure(
                f"ended with code {process.poll()} instead of answering {content['type']!r}"
            )
        kind = answer.content.get("type", answer.content)
        text = answer.content.get("text", "")
        if kind == "error":
            raise self._failure(f"reports: {text}")
        if expected and kind != expected:
            said = f" ({text})" if text else ""
            raise self._failure(f"answered {kind!r}{said} to {content['type']!r}, not {expected!r}")
        return answer

    def _take_arrived(self) -> None:
        """Take the output since the last answer, so that it isn't mistaken for the next one."""
        with contextlib.suppress(Empty):
            while part := self._parts.get_nowait():
                self._unread += part
            self._parts.put(part)  # the next answer has to meet the end, too

    def _transfer(self, message: bytes) -> Answer | None:
        """Write a message, and read the answer; return None if the program has ended.

        Raises:
            TimeoutError: The program doesn't answer in time.
            ValueError: It answers with something else.
        """
        self._messages.put(message)
        deadline = time.monotonic() + self._timeout_s
        needed = 0
        while True:
            try:
                part = self._parts.get(timeout=max(0.0, deadline - time.monotonic()))
            except Empty:
                raise TimeoutError from None
            if not part:
                return None
            self._unread += part
            if len(self._unread) >= needed:
                answer, needed = self._parse()
                if answer is not None:
                    return answer

    def _parse(self) -> tuple[Answer | None, int]:
        """Return an answer that has arrived as a whole; else None, and the size to wait for.

        Raises:
            ValueError: The output is no answer.
        """
        end = self._unread.find(b"\n", 0, MAX_LINE) + 1
        if not end:
            if len(self._unread) >= MAX_LINE:
                raise ValueError(f"more than {MAX_LINE} bytes without a newline")
            return None, 0
        content = json.loads(self._unread[:end])
        sizes = [(str(name), int(size)) for name, size in content.get("blocks", ())]
        if any(not 0 <= size <= MAX_BLOCK for _, size in sizes):
            raise ValueError("a block is too large")
        whole = end + sum(size for _, size in sizes)
        if len(self._unread) < whole:
            return None, whole
        blocks = {}
        for name, size in sizes:
            blocks[name] = bytes(self._unread[end : end + size])
            end += size
        del self._unread[:whole]
        return Answer(content, blocks), 0

    def _failure(self, text: str) -> ComponentError:
        """End the program, and return the error about it."""
        self._stderr.seek(0, os.SEEK_END)
        self._stderr.seek(max(0, self._stderr.tell() - QUOTED))
        said = self._stderr.read().decode(errors="replace").strip()
        self._finalizer()
        quoted = f"; on stderr it wrote: {said}" if said else ""
        return ComponentError(f"{self._program} {text}{quoted}")


def _write(pipe: IO[bytes], messages: "SimpleQueue[bytes | None]") -> None:
    """Write messages to a program until a None, or until the program has ended."""
    with contextlib.suppress(OSError, ValueError):
        while (message := messages.get()) is not None:
            unwritten = memoryview(message)
            while unwritten:
                unwritten = unwritten[pipe.write(unwritten) :]


def _read(pipe: IO[bytes], parts: "Queue[bytes]") -> None:
    """Read the output of a program in parts; an empty part marks the end."""
    with contextlib.suppress(OSError, ValueError):
        while part := pipe.read(READ_SIZE):
            parts.put(part)
    parts.put(b"")


def _end(
    process: "subprocess.Popen[bytes]",
    stderr: IO[bytes],
    messages: "SimpleQueue[bytes | None]",
    parts: "Queue[bytes]",
    reader: Thread,
) -> None:
    """End a program: by the end of its input, else by force."""
    messages.put(None)
    with contextlib.suppress(OSError):
        assert process.stdin is not None
        process.stdin.close()
    try:
        process.wait(END_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
    while reader.is_alive():  # the reader waits for room in the queue, and no more output is needed
        with contextlib.suppress(Empty):
            parts.get(timeout=0.01)
    with contextlib.suppress(OSError):
        assert process.stdout is not None
        process.stdout.close()
    stderr.close()
