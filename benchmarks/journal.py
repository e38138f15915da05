"""What it costs that a run survives: journal, checkpoints and seal, as a share of the base month.

    python benchmarks/journal.py [--pairs 8] [--days 30]
    python benchmarks/journal.py --instructions

The same month with and without them, in turn in one process, by processor time: the least of each,
so that what else the machine does counts little. With `--instructions` both are counted by valgrind
(cachegrind), which differs by less than 0.01 % from time to time, but leaves out what the system
does. And how fast `verify` reads, beside reading alone.
"""

import argparse
import hashlib
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any
from unittest.mock import patch

import fleet2d
from fleet2d.artifacts import store
from fleet2d.artifacts.journal import JournalWriter
from fleet2d.artifacts.ledger import Ledger
from fleet2d.artifacts.seal import verify_run
from fleet2d.engine.snapshots.checkpoint import CheckpointWriter


@contextmanager
def without(*names: str) -> Iterator[None]:
    """Leave out the journal, the checkpoints, or the seal."""
    nothing: Callable[..., None] = lambda *_, **__: None  # noqa: E731
    parts: dict[str, list[Any]] = {
        "journal": [
            patch.object(JournalWriter, "add", nothing),
            patch.object(Ledger, "commit", nothing),
        ],
        "checkpoints": [patch.object(CheckpointWriter, "after_span", nothing)],
        "seal": [patch.object(store, "make_seal", nothing)],
    }
    with ExitStack() as stack:
        for name in names:
            for part in parts[name]:
                stack.enter_context(part)
        yield


def month(folder: Path, days: int) -> float:
    """Return the processor time of a stored month [s]."""
    began = time.process_time()
    fleet2d.run(f"simulation.duration={days} d", seed=4, out=folder)
    return time.process_time() - began


def count(code: str) -> int:
    """Return the number of instructions that a process takes for some code."""
    grind = ["valgrind", "--tool=cachegrind", "--cache-sim=no", "--cachegrind-out-file=/dev/null"]
    environment = {**os.environ, "PYTHONHASHSEED": "0", "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(
        [*grind, sys.executable, "-c", code],
        check=True, capture_output=True, text=True, env=environment,
    )  # fmt: skip
    return int(done.stderr.rpartition("refs:")[2].split()[0].replace(",", ""))


def share_of_instructions(days: int) -> float:
    """Return how many more instructions a month takes with journal, checkpoints and seal."""
    # Valgrind takes thirty times as long: nothing may depend on the time.
    start = (
        f"import sys; sys.path.insert(0, {str(Path(__file__).parent)!r})"
        + """
import tempfile
from pathlib import Path
import journal, pyarrow.parquet
from fleet2d.artifacts import ledger
from fleet2d.engine.snapshots import checkpoint
checkpoint.COMMIT_S = checkpoint.COMPUTING_S = checkpoint.WAITING_S = ledger.SYNC_S = 1e9
"""
    )
    month = f"tempfile.TemporaryDirectory() as f: journal.month(Path(f) / 'run', {days})"
    without_all = f"with journal.without('journal', 'checkpoints', 'seal'), {month}"
    month = f"with {month}"
    count(start + month)  # compiles the modules
    imports, least, whole = (count(start + code) for code in ("", without_all, month))
    return (whole - least) / (least - imports)


def main() -> None:
    """Measure, and print shares and rates."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pairs", type=int, default=8)
    parser.add_argument("--days", type=int, default=30)
    parser.add_argument("--instructions", action="store_true")
    chosen = parser.parse_args()
    if chosen.instructions:
        share = share_of_instructions(chosen.days)
        print(f"journal, checkpoints and seal: {share:.2%} of the month's instructions")
        return
    left_out = {
        "journal, checkpoints and seal": ("journal", "checkpoints", "seal"),
        "journal and checkpoints": ("journal", "checkpoints"),
        "seal": ("seal",),
    }
    with tempfile.TemporaryDirectory() as folder:
        month(Path(folder) / "first", chosen.days)
        for what, names in left_out.items():
            took: dict[tuple[str, ...], list[float]] = {(): [], names: []}
            for pair in range(chosen.pairs):
                for which in (names, ()) if pair % 2 else ((), names):
                    with without(*which):
                        target = Path(folder) / f"{what}-{pair}-{len(which)}"
                        took[which].append(month(target, chosen.days))
            least, median = (
                pick(took[()]) / pick(took[names]) - 1 for pick in (min, statistics.median)
            )
            print(
                f"{what}: {least:.1%} of the month by the least of {chosen.pairs} each,"
                f" {median:.1%} by their medians"
            )
        root = Path(folder) / "first"
        size = sum(path.stat().st_size for path in root.rglob("*") if path.is_file())
        rates = []
        for _ in range(20):
            began = time.process_time()
            assert verify_run(root).same
            middle = time.process_time()
            for path in root.rglob("*"):
                if path.is_file():
                    hashlib.sha256(path.read_bytes())
            rates.append((middle - began, time.process_time() - middle))
        ours, plain = (min(each) for each in zip(*rates, strict=True))
        print(
            f"verify: {size / 1e6:.1f} MB in {ours * 1e3:.1f} ms, {size / 1e6 / ours:.0f} MB/s;"
            f" SHA-256 alone {plain * 1e3:.1f} ms, {size / 1e6 / plain:.0f} MB/s"
        )


if __name__ == "__main__":
    main()
