"""A long hunt: `python -m tests.fuzz --minutes 60`, all readers in turn; finds are kept as files."""

import argparse
import hashlib
import sys
import time
import warnings
from collections import Counter
from pathlib import Path

import hypothesis
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from tests.fuzz.judge import judge
from tests.fuzz.readers import READERS, Reader

FINDS = Path(__file__).parent / "finds"
ROUND = 50
"""Contents that a reader is given before the next has its turn."""


def hunt(reader: Reader, seed: int, known: set[str]) -> tuple[int, list[str]]:
    """Return how many contents a reader was given, and what is wrong, each new kind of it once."""
    count, found = 0, []

    @hypothesis.seed(seed)
    @settings(
        max_examples=max(5, ROUND // reader.cost), deadline=None, database=None,
        phases=[Phase.generate], suppress_health_check=list(HealthCheck),
    )  # fmt: skip
    @given(st.deferred(reader.contents))
    def one(content: bytes) -> None:
        nonlocal count
        count += 1
        wrong = judge(reader, content)
        kind = f"{reader.name}: {wrong}"
        if wrong and kind not in known:
            known.add(kind)
            name = f"{reader.name}-{hashlib.sha256(content).hexdigest()[:8]}"
            (FINDS / name).write_bytes(content)
            found.append(f"{kind} (tests/fuzz/finds/{name})")

    one()
    return count, found


def main() -> None:
    """Hunt until the time is up; exit code 1 if something was found."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=0, help="of the first round")
    parser.add_argument("--reader", action="append", choices=list(READERS), help="only this one")
    chosen = parser.parse_args()
    warnings.simplefilter("ignore")
    end, seed = time.monotonic() + 60 * chosen.minutes, chosen.seed
    counts, known = Counter[str](), set[str]()
    while time.monotonic() < end:
        for name in chosen.reader or READERS:
            count, found = hunt(READERS[name], seed, known)
            counts[name] += count
            for line in found:
                print(line, flush=True)
            if time.monotonic() >= end:
                break
        seed += 1
    print(f"{counts.total()} contents, the next seed is {seed}, {len(known)} found")
    for name, count in counts.items():
        print(f"  {name}: {count}")
    sys.exit(1 if known else 0)


main()
