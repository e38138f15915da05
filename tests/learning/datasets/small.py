"""A small data set: two homes to train on, one to test on, and six hours of each."""

import atexit
import tempfile
from functools import cache
from pathlib import Path

SOURCE = {
    "name": "small",
    "base": {
        "extends": "bundled:paper",
        "simulation": {"start": "2026-01-05 15:00", "duration": "6 h"},
        "robots": {"astro": {"behaviors": [{"type": "patrol", "dwell": "5 min"}]}},
    },
    "splits": {
        "train": {
            "runs": 3,
            "homes": [{"synthetic": 2, "settings": {"furnish": True}}],
            "households": [["retired"], ["student", "child"]],
        },
        "test": {
            "runs": 1,
            "homes": [{"synthetic": 1, "first": 50, "settings": {"furnish": True}}],
            "households": [["works_outside"]],
        },
    },
    "beliefs": ["routine", "last_seen"],
    "runs_per_shard": 2,
}


def make(folder: Path, workers=1):
    """Make it."""
    import fleet2d

    return fleet2d.dataset(SOURCE, folder, workers=workers)


@cache
def made():
    """Make it once for all tests of this process, which change copies of it only."""
    folder = tempfile.TemporaryDirectory(prefix="fleet2d-small-")
    atexit.register(folder.cleanup)
    return make(Path(folder.name) / "small")
