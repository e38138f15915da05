"""A child process that reads files of floor plans and bags, within limits of time and memory.

Parsing a file and finding its rooms, much of it in libraries, may crash, hang or exhaust memory.
Then the child dies, and its parent raises an error of one line. A process starts its child for the
first file, and keeps it. The child gets a function and the content of files by pickle, and answers
in JSON, which the parent checks, since the answer to a hostile file may be hostile, too.
"""

import atexit
import json
import math
import os
import pickle
import signal
import sys
import time
import traceback
from base64 import b64decode, b64encode
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, fields, is_dataclass
from functools import cache
from io import BufferedWriter
from pathlib import Path
from subprocess import DEVNULL, PIPE, Popen, TimeoutExpired
from threading import Lock, Timer
from typing import Any, Literal, TypeVar, cast, get_type_hints

import numpy as np
import shapely
from pydantic import ConfigDict, TypeAdapter
from shapely import MultiPolygon, Polygon

from fleet2d.bounds import JSON_VALUES, LOG_BYTES, READ_MB, READ_SECONDS, Bound, one_line
from fleet2d.errors import (
    Fleet2DError,
    FloorPlanError,
    InputError,
    UnclearPlaceError,
    os_errors_as,
)
from fleet2d.kernels import Mesh

try:
    import resource
except ImportError:  # on Windows
    resource = None  # type: ignore[assignment]

T = TypeVar("T")

# A file may take this multiple of its processor time by the clock, as others use the processor.
PATIENCE = 10
# An answer that isn't valid raises one of these.
WRONG = (ValueError, TypeError, KeyError, RecursionError, shapely.errors.ShapelyError)
_CODE = "from fleet2d.storage.apart import serve; serve()"
_VARIABLES = "FLEET2D_MAX_"
_ENVIRONMENT = {
    "OPENBLAS_NUM_THREADS": "1",  # each thread takes memory
    "ARROW_DEFAULT_MEMORY_POOL": "system",  # other pools reserve a gigabyte
    # Freed memory is kept: returning it to the system, and getting it back page by page, takes as
    # long as reading a picture.
    "MALLOC_MMAP_THRESHOLD_": str(1 << 30),
    "MALLOC_TRIM_THRESHOLD_": str(1 << 30),
}

_lock = Lock()
_child: Popen[bytes] | None = None


@dataclass(frozen=True)
class _Failure:
    """An exception in the child.

    Attributes:
        kind: Fleet2D's error about the file (`file`) or about what is installed (`input`), a lack
            of memory, or another exception.
        text: The message.
        place: The place at which a picture is unclear, and its radius [pixels].
    """

    kind: Literal["file", "input", "memory", "other"]
    text: str = ""
    place: tuple[int, int, float] | None = None

    def error(self, path: Path, failure: type[InputError]) -> InputError:
        """Return the error that the parent raises."""
        if self.kind == "memory":
            return failure(_beyond(path, "more memory", READ_MB))
        if self.kind == "other":
            return failure(
                f"{path} can't be read: {self.text}: if the file isn't damaged, simplify it or"
                " export it again"
            )
        return (failure if self.kind == "file" else InputError)(self.text)


def apart(
    path: Path,
    read: Callable[..., T],
    *arguments: Any,
    failure: type[InputError] = FloorPlanError,
    seconds: Bound = READ_SECONDS,
) -> T:
    """Call a function of Fleet2D for a file in the child, and return its result.

    Args:
        path: The file, for messages.
        read: The function, or a method of a component. Its annotation says what it returns: plain
            data, dataclasses, arrays, meshes and polygons.
        arguments: Its arguments, among them the content of the file.
        failure: The type of the error about the file.
        seconds: The processor time that the function may take [s].

    Raises:
        InputError: The function raises it or fails, it exceeds a limit, or the child dies; of the
            type `failure`, unless the function raises another one.
    """
    patience = PATIENCE * seconds.limit
    limits = {key: text for key, text in os.environ.items() if key.startswith(_VARIABLES)}
    with _lock:
        start = time.monotonic()
        rest = limits, arguments, failure, seconds.limit
        answer = _exchange(read, rest, patience)
        if not answer:
            is_late = time.monotonic() - start >= patience
            raise failure(_death(path, seconds, is_late, _stop(grace=1.0)))
        try:
            result: T | _Failure = _decode(answer, get_type_hints(read)["return"])
        except WRONG:
            _stop()
            raise failure(
                f"{path} can't be read: its reader gave no valid answer: export the file again"
            ) from None
        if isinstance(result, _Failure) and result.kind in ("memory", "other"):
            _stop()  # the child may still hold much memory, so the next file gets a new one
    if not isinstance(result, _Failure):
        return result
    place = result.place
    unclear = place and UnclearPlaceError(result.text, place[:2], place[2])
    raise result.error(path, failure) from unclear


def _exchange(read: object, rest: object, patience: float) -> bytes:
    """Return the answer to a request, in two parts; empty if the child died or took too long."""
    process = _running()
    timer = Timer(patience, process.kill)
    timer.start()
    try:
        assert process.stdin is not None
        assert process.stdout is not None
        pickle.dump(read, process.stdin)
        pickle.dump(rest, process.stdin)
        process.stdin.flush()
        length = min(int.from_bytes(process.stdout.read(8), "big"), READ_MB.limit << 20)
        answer = process.stdout.read(length)
        return answer if len(answer) == length else b""
    except BrokenPipeError:
        return b""
    except BaseException:  # the answer must not be taken for that to the next request
        _stop()
        raise
    finally:
        timer.cancel()
        timer.join()


def _running() -> Popen[bytes]:
    """Return the child, which is started if there is none."""
    global _child
    if _child is None or _child.poll() is not None:
        _stop()
        with os_errors_as(InputError, "no process can be started to read files"):
            _child = Popen(  # noqa: S603 - it is Python
                [sys.executable, "-P", "-c", _CODE],
                stdin=PIPE,
                stdout=PIPE,
                stderr=DEVNULL,
                env={**os.environ, **_ENVIRONMENT},
                creationflags=0x08000000 if sys.platform == "win32" else 0,  # without a window
            )
    return _child


def _stop(grace: float = 0.0) -> int:
    """End the child, if there is one, and return its exit status.

    Args:
        grace: Time that the child has to end by itself [s].
    """
    global _child
    process = _child
    _child = None
    if process is None:
        return 0
    _close(process)
    with suppress(TimeoutExpired):
        return process.wait(grace)
    process.kill()
    return process.wait()


def _close(process: Popen[bytes]) -> None:
    """Close the pipes to a child, which makes it end, even while another thread writes to one."""
    for pipe in (process.stdin, process.stdout):
        cast("BufferedWriter", pipe).raw.close()


def _forget() -> None:
    """Drop the child, which ends by itself or belongs to the process before a fork."""
    global _child, _lock
    _lock = Lock()
    if _child is not None:
        _close(_child)
        _child.returncode = 0  # this process doesn't have to wait for the child
        _child = None


atexit.register(_forget)
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget)


def _death(path: Path, seconds: Bound, is_late: bool, status: int) -> str:
    """Return the message about a file at which the child died."""
    name = signal.Signals(-status).name if status < 0 else f"exit code {status}"
    if is_late or name == "SIGXCPU":
        return _beyond(path, "longer", seconds)
    cause = f"died ({name}): if the file isn't damaged, simplify it or export it again"
    if name == "SIGKILL":
        cause = "was killed, perhaps because memory ran out: try again"
    return f"{path} can't be read: its reader {cause}"


def _beyond(path: Path, what: str, bound: Bound) -> str:
    return (
        f"{path} takes {what} to read than {bound.limit} {bound.noun}: simplify it, or set"
        f" {bound.variable}={2 * bound.limit} in the environment"
    )


def _encode(value: object) -> bytes:
    return json.dumps(value, default=_plain).encode()


def _plain(part: Any) -> Any:
    """Return a part of an answer as plain data."""
    if isinstance(part, MultiPolygon):
        return {"#polygons": list(part.geoms)}
    if isinstance(part, np.ndarray):
        return {"#array": [part.dtype.str, part.shape, b64encode(part.tobytes()).decode()]}
    if isinstance(part, Mesh):
        return {"#mesh": [part.vertices, part.triangles, part.neighbors]}
    if isinstance(part, Polygon):
        rings = shapely.get_rings(part)
        return {"#rings": [shapely.get_coordinates(ring).tolist() for ring in rings]}
    if is_dataclass(part):
        return {field.name: getattr(part, field.name) for field in fields(part)}
    raise TypeError(f"{type(part).__name__} is no part of an answer")


def _decode(answer: bytes, kind: Any) -> Any:
    """Return the value in an answer, of a type, or the failure.

    Raises:
        Exception: The answer is neither; one of `WRONG`.
    """
    if answer.count(b",") > JSON_VALUES.limit:
        raise ValueError("too many values")
    content = json.loads(answer, object_hook=_part, parse_constant=int)  # NaN is refused
    if "failure" in content:
        return _checked(content["failure"], _Failure)
    return _checked(content["value"], kind)


def _part(content: dict[str, Any]) -> Any:
    """Return the array, mesh or polygon that a mapping stands for, else the mapping."""
    match content:
        case {"#array": [dtype, shape, text]}:
            return np.frombuffer(b64decode(text), dtype).reshape(shape)
        case {"#mesh": arrays}:
            return Mesh(*arrays)
        case {"#polygons": polygons}:
            return MultiPolygon(polygons)
        case {"#rings": rings}:
            corners = [np.array(ring, np.float64).reshape(-1, 2) for ring in rings]
            if not all(np.isfinite(ring).all() for ring in corners):
                raise ValueError("a coordinate is infinite")
            return Polygon(corners[0], corners[1:]) if corners else Polygon()
    return content


def _checked(content: object, kind: Any) -> Any:
    """Return plain data as a type."""
    [value] = _adapter(kind).validate_python([content])
    return value


@cache
def _adapter(kind: Any) -> TypeAdapter[tuple[Any]]:
    # A dataclass alone takes no settings, so it is wrapped in a tuple.
    settings = ConfigDict(arbitrary_types_allowed=True, allow_inf_nan=False)
    return TypeAdapter(tuple[kind], config=settings)


def serve() -> None:
    """Answer the requests of the parent, until it ends."""
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # libraries may print
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent decides when the child ends
    base = _size()
    while True:
        try:
            before = _size()
            read = pickle.load(sys.stdin.buffer)  # noqa: S301 - of the parent
            base += _size() - before  # plus the size of the module with its libraries
            limits, arguments, failure, seconds = pickle.load(sys.stdin.buffer)  # noqa: S301
        except EOFError:
            return
        for name in [name for name in os.environ if name.startswith(_VARIABLES)]:
            del os.environ[name]
        os.environ.update(limits)
        _limit(base, seconds)
        answer = _answer(read, arguments, failure)
        answers.write(len(answer).to_bytes(8, "big") + answer)
        answers.flush()


def _answer(read: Callable[..., Any], arguments: tuple[Any, ...], kind: type[InputError]) -> bytes:
    try:
        return _encode({"value": read(*arguments)})
    except Fleet2DError as error:
        cause = error.__cause__
        at = (*cause.place, cause.radius) if isinstance(cause, UnclearPlaceError) else None
        failure = _Failure("file" if isinstance(error, kind) else "input", str(error), at)
    except RecursionError:
        failure = _Failure("other", "its parts are nested too deeply")
    except MemoryError:
        failure = _Failure("memory")
    except Exception as error:  # noqa: BLE001 - whatever a library raises, the parent goes on
        frames = traceback.extract_tb(error.__traceback__)
        ours = next(f for f in reversed(frames) if "fleet2d" in f.filename)
        place = f"{type(error).__name__} at {Path(ours.filename).name}:{ours.lineno}"
        text = f"its reader failed ({place}, {one_line(error, 100)})"
        failure = _Failure("memory" if "bad_alloc" in text else "other", text)  # by GEOS
    return _encode({"failure": failure})


def _size() -> int:
    """Return the size of this process [bytes]; 0 where it is unknown."""
    with suppress(OSError):
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        return pages * resource.getpagesize()
    return 0


def _limit(base: int, seconds: int) -> None:
    """Limit the processor time and memory that this process takes from now on.

    Args:
        base: Size of the process when it began [bytes].
        seconds: The processor time [s].
    """
    if resource is None:
        return
    limits = {
        resource.RLIMIT_CORE: 0,
        resource.RLIMIT_FSIZE: LOG_BYTES.limit,  # bags are unpacked to files
        resource.RLIMIT_CPU: math.ceil(time.process_time() + seconds),
    }
    if base:
        limits[resource.RLIMIT_AS] = base + (READ_MB.limit << 20)
    for kind, amount in limits.items():
        _, most = resource.getrlimit(kind)
        resource.setrlimit(kind, (amount if most < 0 else min(amount, most), most))
