"""What holds for all tests, and for the examples in docstrings."""

import os
import sys
import tempfile
from importlib.util import find_spec

import pytest

# Examples in docstrings of modules that need an extra run where it is installed.
EXTRAS = {
    "src/fleet2d/learning/gym": "gymnasium",
    "src/fleet2d/learning/datasets/torch_data.py": "torch",
    "src/fleet2d/learning/datasets/training.py": "torch",
    "src/fleet2d/learning/transfer/presence.py": "torch",
}
collect_ignore = [path for path, package in EXTRAS.items() if find_spec(package) is None]


def pytest_configure(config: pytest.Config) -> None:
    """Use secrets of the tests only; keep bytecode in pytest's cache if it has no other place.

    Else every process that a test starts compiles all that it imports.
    """
    if "PYTEST_XDIST_WORKER" not in os.environ:  # which has that of its parent, as all processes
        folder = tempfile.TemporaryDirectory(prefix="fleet2d-state-")
        config.add_cleanup(folder.cleanup)
        os.environ["XDG_STATE_HOME"] = folder.name
    cache = getattr(config, "cache", None)
    if sys.dont_write_bytecode and cache is not None:
        os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
        os.environ["PYTHONPYCACHEPREFIX"] = sys.pycache_prefix = str(cache.mkdir("bytecode"))
        sys.dont_write_bytecode = False
