"""Load that lasts: many years in one run, many runs in one process, many people in one home.

    python benchmarks/soak.py years [--count 10]
    python benchmarks/soak.py runs [--count 10000]
    python benchmarks/soak.py people [--count 1000] [--days 30]

Prints processor time, memory at its highest, and how that grew.
"""

import argparse
import gc
import resource
import tempfile
import time
from pathlib import Path

import fleet2d


def peak_mb() -> float:
    """Return the most memory that the process has held [MB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def held_mb() -> float:
    """Return the memory that the process holds now [MB]."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * resource.getpagesize() / 1e6


def years(count: int, folder: Path) -> None:
    """A month, and then years in one run: its memory should be a month's."""
    fleet2d.run("bundled:paper", "simulation.duration=30 d", seed=4, out=folder / "month")
    month, began = peak_mb(), time.process_time()
    run = fleet2d.run(
        "bundled:paper", f"simulation.duration={365 * count} d", seed=4, out=folder / "years"
    )
    took = time.process_time() - began
    size = sum(path.stat().st_size for path in (folder / "years").rglob("*") if path.is_file())
    print(
        f"{count} years in {took:.0f} s, {took / count / 12.17:.2f} s a month; {peak_mb():.0f} MB,"
        f" {peak_mb() - month:+.0f} MB beside a month; {size / 1e6:.0f} MB stored; {run.digest}"
    )


def runs(count: int, folder: Path) -> None:
    """Short runs one after the other: memory should stay where it is."""
    begins: list[tuple[int, float]] = []
    began = time.process_time()
    for number in range(count):
        fleet2d.run(
            "bundled:paper", "simulation.duration=10 min", seed=number, out=folder / str(number)
        )
        if number in (count // 10, count - 1):
            gc.collect()
            begins.append((number, held_mb()))
    took = time.process_time() - began
    (first, before), (last, after) = begins
    print(
        f"{count} runs in {took:.0f} s, {1e3 * took / count:.1f} ms each; {after:.0f} MB,"
        f" {after - before:+.1f} MB from run {first} to run {last}"
    )


def people(count: int, days: int, folder: Path) -> None:
    """A crowd in one home."""
    users = {f"user{n}": {"type": "room_sampling"} for n in range(count)}
    scenario = {
        "extends": "bundled:paper",
        "simulation": {"duration": f"{days} d", "seed": 4},
        "users": {"ana": None, **users},
        "algorithms": {"ltp": None},
        "metrics": {"ltp_error": None},
        "artifacts": {"trajectories": "off"},
    }
    began = time.process_time()
    run = fleet2d.run(scenario, out=folder / "crowd")
    took = time.process_time() - began
    print(f"{count} people for {days} days in {took:.0f} s; {peak_mb():.0f} MB; {run.digest}")


def main() -> None:
    """Do one of them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=["years", "runs", "people"])
    parser.add_argument("--count", type=int)
    parser.add_argument("--days", type=int, default=30)
    chosen = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        if chosen.what == "years":
            years(chosen.count or 10, Path(folder))
        elif chosen.what == "runs":
            runs(chosen.count or 10_000, Path(folder))
        else:
            people(chosen.count or 1000, chosen.days, Path(folder))


if __name__ == "__main__":
    main()
