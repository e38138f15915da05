"""What it costs that a run survives: journal, checkpoints and seal, as a share of the base month.

    python benchmarks/journal.py [--months 12] [--days 30]
    python benchmarks/journal.py --instructions

All calls for them in a month are timed by processor time, and compared with the rest of the month:
two months, one of them without the calls, differ by chance more than by what the calls cost. With
`--instructions` such months are compared, by instructions: valgrind (cachegrind) counts them, which
differs by less than 0.01 % from time to time, but leaves out what the system does. And how fast
`verify` reads, beside reading alone.
"""

import argparse
import hashlib
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any
from unittest.mock import patch

import fleet2d
from fleet2d.artifacts import store
from fleet2d.artifacts.store import RunStore, TableWriter
from fleet2d.artifacts.unfinished import UnfinishedRun
from fleet2d.artifacts.verification import verify_run
from fleet2d.engine.checkpoint import CheckpointWriter


@contextmanager
def without(*names: str) -> Iterator[None]:
    """Leave out the journal, the checkpoints, or the seal."""
    nothing: Callable[..., None] = lambda *_, **__: None  # noqa: E731
    parts: dict[str, list[Any]] = {
        "journal": [
            patch.object(TableWriter, "log", nothing),
            patch.object(UnfinishedRun, "commit", nothing),
        ],
        "checkpoints": [patch.object(CheckpointWriter, "after_span", nothing)],
        "seal": [patch.object(store, "make_seal", nothing)],
    }
    with ExitStack() as stack:
        for name in names:
            for part in parts[name]:
                stack.enter_context(part)
        yield


class Calls:
    """Processor time of calls, without that of calls in them."""

    def __init__(self) -> None:
        """Start with none."""
        self.seconds: Counter[str] = Counter()
        self._inner = 0.0

    def timed(self, name: str, function: Callable[..., Any]) -> Callable[..., Any]:
        """Return a function that adds to the time of a name."""

        def call(*args: Any, **options: Any) -> Any:
            before, self._inner = self._inner, 0.0
            began = time.process_time()
            try:
                return function(*args, **options)
            finally:
                took = time.process_time() - began
                self.seconds[name] += took - self._inner
                self._inner = before + took

        return call


@contextmanager
def timed_calls() -> Iterator[Counter[str]]:
    """Time the journal, the checkpoints, and the seal."""
    calls = Calls()
    parts: dict[str, list[tuple[Any, str]]] = {
        "journal": [
            (TableWriter, "log"),
            *((UnfinishedRun, name) for name in ("begin", "commit", "end")),
            (RunStore, "commit"),
        ],
        "checkpoints": [(CheckpointWriter, "checkpoint")],
        "seal": [(store, "make_seal")],
    }
    with ExitStack() as stack:
        for name, functions in parts.items():
            for owner, function in functions:
                timed = calls.timed(name, getattr(owner, function))
                stack.enter_context(patch.object(owner, function, timed))
        yield calls.seconds


def month(folder: Path, days: int) -> float:
    """Return the processor time of a stored month [s]."""
    began = time.process_time()
    fleet2d.run("bundled:paper", f"simulation.duration={days} d", seed=4, out=folder)
    return time.process_time() - began


def share_of_time(root: Path, months: int, days: int) -> str:
    """Return how long the calls take, by the month in which they took least."""
    rounds = []
    for number in range(months):
        with timed_calls() as seconds:
            whole = month(root / str(number), days)
        rounds.append((sum(seconds.values()), whole, seconds))
    cost, whole, seconds = min(rounds, key=lambda entry: entry[0] / entry[1])
    shares = sorted(cost / (whole - cost) for cost, whole, _ in rounds)
    parts = ", ".join(f"{name} {1e3 * value:.1f} ms" for name, value in seconds.items())
    return (
        f"journal, checkpoints and seal: {shares[0]:.1%} of the rest of the month in the best of"
        f" {months}, {statistics.median(shares):.1%} in the median; {1e3 * cost:.1f} ms ({parts})"
        f" of {1e3 * whole:.0f} ms"
    )


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
from fleet2d.artifacts import unfinished
from fleet2d.engine import checkpoint
checkpoint.COMMIT_S = checkpoint.COMPUTING_S = checkpoint.WAITING_S = unfinished.SYNC_S = 1e9
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
    parser.add_argument("--months", type=int, default=12)
    parser.add_argument("--days", type=int, default=30)
    parser.add_argument("--instructions", action="store_true")
    chosen = parser.parse_args()
    if chosen.instructions:
        share = share_of_instructions(chosen.days)
        print(f"journal, checkpoints and seal: {share:.2%} of the month's instructions")
        return
    with tempfile.TemporaryDirectory() as folder:
        month(Path(folder) / "first", chosen.days)
        print(share_of_time(Path(folder), chosen.months, chosen.days))
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
