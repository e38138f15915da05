"""The one decorator every compiled function uses, and where compiled code is kept."""

import functools
import hashlib
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numba
import numpy as np

F = TypeVar("F", bound=Callable[..., Any])

# No fast-math: it lets the compiler reorder and fuse, and then two machines disagree.
# error_model="numpy": integer division is never checked for zero, which halves its cost.
FLAGS: dict[str, Any] = {"fastmath": False, "error_model": "numpy", "nogil": True, "cache": True}


@functools.cache
def cache_directory() -> Path:
    """Return the folder of the compiled kernels of exactly these sources.

    Numba notices a change in the file of a cached function, but not in the files that it calls
    into. A folder named after the content of *all* kernel sources makes a stale kernel impossible.
    """
    digest = hashlib.sha256()
    for source in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(source.read_bytes())
    home = os.environ.get("NUMBA_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME")
    base = Path(home) if home else Path.home() / ".cache"
    return base / "fleet2d" / f"kernels-{digest.hexdigest()[:16]}"


def kernel(function: F) -> F:
    """Compile `function` with the project's flags on its first call."""
    if numba.config.DISABLE_JIT:
        return _interpreted(function)
    before = numba.config.CACHE_DIR
    numba.config.CACHE_DIR = str(cache_directory())
    try:
        compiled: F = numba.njit(**FLAGS)(function)
    finally:
        numba.config.CACHE_DIR = before
    return compiled


def _interpreted(function: F) -> F:
    """Run `function` as plain Python; its hashes wrap around on purpose, so no overflow warning."""

    @functools.wraps(function)
    def call(*args: Any) -> Any:
        with np.errstate(over="ignore"):
            return function(*args)

    return call  # type: ignore[return-value]
