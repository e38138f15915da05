"""The memory of a process: rare garbage collection during imports and runs, and its peak.

Hardly any objects of a run are in reference cycles, so they are freed without garbage collection.
Collecting after every 700 new objects, as Python does, takes up to a quarter of the time of a run
with many people, and a sixth of the time of all imports.
"""

import gc
import os
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Lock

# New objects between two collections.
OBJECTS = 100_000

# With fewer objects than this before the import, these are exempted from collection, too.
FEW_OBJECTS = 20_000

# Free memory that the allocator keeps, and the size from which on an array has pages of its own:
# the largest that the allocator itself would choose [bytes].
KEPT_BYTES = 1 << 25
_MALLOPT = (-1, -2, -3)  # M_TRIM_THRESHOLD, M_TOP_PAD, M_MMAP_THRESHOLD

# Options of the allocator of polars (jemalloc), which would keep free memory for ten seconds.
_JEMALLOC = "dirty_decay_ms:0,muzzy_decay_ms:0,narenas:1"

_lock = Lock()
_runs = 0
_usual = gc.get_threshold()


@contextmanager
def rare_collections() -> Iterator[None]:
    """Collect garbage rarely while any thread of this process is within the context.

    Example:
        >>> with rare_collections():
        ...     gc.get_threshold()[0]
        100000
    """
    global _runs, _usual
    with _lock:
        _runs += 1
        if _runs == 1:
            _usual = gc.get_threshold()
            if 0 < _usual[0] < OBJECTS:  # 0: the user has disabled it
                gc.set_threshold(OBJECTS, *_usual[1:])
    try:
        yield
    finally:
        with _lock:
            _runs -= 1
            if _runs == 0:
                gc.set_threshold(*_usual)


@contextmanager
def library_imports() -> Iterator[None]:
    """Collect rarely while modules are imported, and never again look for garbage in them.

    Modules live to the end, and scanning them, mostly when Python exits, takes a fifth of the time
    of a short process. Older objects are left out with them, and would remain as garbage, so this
    is only done in a process that had few objects.

    Example:
        >>> with library_imports():
        ...     import colorsys
    """
    were_few = len(gc.get_objects()) < FEW_OBJECTS
    with rare_collections():
        yield
    if were_few:
        gc.freeze()


def keep_free_memory() -> None:
    """Let the C allocator keep the memory of freed arrays for the next ones.

    By default it returns memory of arrays above 128 KB to the system, and requests it again page by
    page: a tenth of the time of a short run. `release_memory` returns all free memory. Other
    allocators than GNU's stay as they are.
    """
    import ctypes

    with suppress(AttributeError, OSError, TypeError):
        libc = ctypes.CDLL(None)
        for parameter in _MALLOPT:
            libc.mallopt(parameter, KEPT_BYTES)


def release_memory() -> None:
    """Collect garbage, and return memory that is free to the system, where that is possible.

    The allocators of C and of Arrow keep freed memory: some dozens of MB in years of simulation.
    """
    import ctypes  # takes time, and short runs don't need it

    gc.collect()
    with suppress(AttributeError, OSError, TypeError):  # GNU's library only
        ctypes.CDLL(None).malloc_trim(0)
    if arrow := sys.modules.get("pyarrow"):
        arrow.default_memory_pool().release_unused()


def free_bodies(actors: Iterable[object]) -> None:
    """Free the bodies of a finished run, and with them all of its state.

    A body and its plan refer to each other, and would remain until the next garbage collection.
    """
    for actor in actors:
        vars(actor).clear()


def peak_memory_mb() -> float | None:
    """Return the peak memory of this process so far [MB]; None if the system doesn't tell.

    It is read from `/proc` on Linux, since `getrusage` would include a larger peak of the parent
    process.
    """
    with suppress(OSError):
        for line in Path("/proc/self/status").read_bytes().splitlines():
            if line.startswith(b"VmHWM:"):
                return int(line.split()[1]) / 1024
    try:
        import resource
    except ImportError:
        return None
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / (1024 * 1024 if sys.platform == "darwin" else 1024)


def free_memory_of_polars() -> None:
    """Let polars give free memory back at once; for programs that have not imported it yet."""
    os.environ.setdefault("_RJEM_MALLOC_CONF", _JEMALLOC)
