"""How fast studies are: overhead per variant, speed-up by workers, memory of the driver, reading.

    python benchmarks/studies.py                    # all but the next two
    python benchmarks/studies.py months --workers 2 # the paper's 10 x 10 x 10 runs of 30 days
    python benchmarks/studies.py driver --variants 10000000
    python benchmarks/studies.py fleet              # the driver of 100,000 robots, each in a home
    python benchmarks/studies.py lives --robots 1000

Run it on a machine that does nothing else.
"""

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from concurrent.futures import Executor, Future
from pathlib import Path
from typing import Any

from fleet2d.configuration.documents import read_document
from fleet2d.runtime.memory import free_memory_of_polars
from fleet2d.studies.api import open_crew
from fleet2d.studies.driver import check_study, run_study
from fleet2d.studies.executors import Crew, LocalExecutor, SerialExecutor, WorkerTask
from fleet2d.studies.lives import HomeFeatures
from fleet2d.studies.reader import open_study
from fleet2d.studies.results import VariantResult, result_of
from fleet2d.studies.simulator import VariantOutcome

EXAMPLES = Path(__file__).parents[1] / "examples" / "studies"
HOUSEHOLDS = [["works_outside"], ["retired"], ["works_outside", "works_from_home", "child"]]
HOUR = {"extends": "bundled:paper", "simulation": {"duration": "1 h"}}


class InstantExecutor(SerialExecutor):
    """Returns results without simulating: what is left is the driver."""

    def __init__(self) -> None:
        """Make a result of usual size; making it is the work of a worker."""
        numbers = {f"metric_{i}.ana.value": 0.1 * i for i in range(30)}
        outcome = VariantOutcome("complete", "0" * 64, numbers, {}, {"total": 0.03})
        self._row = result_of(WorkerTask(0, 0, ""), outcome).row

    def submit(self, function: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Return a result for each task, or that its set-up has no problem."""
        content, tasks, *_ = args
        if b"FactsJob" in content:
            facts = HomeFeatures(7, 3, 120.0, frozenset({"bedroom"}))
            return super().submit(lambda: [facts] * len(tasks))
        if b"StudyJob" not in content:
            return super().submit(lambda: [""] * len(tasks))
        own = ({"variant": task.number, "identity": task.identity} for task in tasks)
        return super().submit(lambda: [VariantResult({**self._row, **each}) for each in own])


def run(study: Any, folder: Path, executor: Executor, workers: int = 1) -> float:
    """Run a study; return the wall time [s]."""
    start_s = time.perf_counter()
    with executor:
        run_study(check_study(study), folder, Crew(executor, workers))
    return time.perf_counter() - start_s


def overhead(folder: Path, seeds: int = 200) -> None:
    """Print what a variant takes beside its own run."""
    study = {"base": HOUR, "axes": {"robots.astro.speed": [0.3, 0.6]}, "replicates": seeds}
    run({**study, "replicates": 1}, folder / "warm", SerialExecutor())
    seconds = run(study, folder / "overhead", SerialExecutor())
    own = open_study(folder / "overhead").variants["wall_s"].sum()
    count = 2 * seeds
    print(f"overhead per variant: {1000 * (seconds - own) / count:.1f} ms ({count} of one hour,")
    print(f"  {1000 * own / count:.1f} ms each, in one process; checks and data set included)")


def speedup(folder: Path, days: int = 5, seeds: int = 40) -> None:
    """Print how much faster two workers are than one, their start included."""
    base = {**HOUR, "simulation": {"duration": {"days": days}}}
    study = {"base": base, "axes": {"robots.astro.speed": [0.3, 0.6]}, "replicates": seeds}
    seconds = {n: run(study, folder / f"workers{n}", LocalExecutor(n), n) for n in (1, 2)}
    print(
        f"{2 * seeds} variants of {days} days: {seconds[1]:.1f} s by 1 worker, {seconds[2]:.1f} s"
        f" by 2: {seconds[1] / seconds[2]:.2f} times"
    )


def driver(folder: Path, variants: int = 100_000) -> None:
    """Print time and memory of a driver of many variants: its first run, and going on with it."""
    free_memory_of_polars()  # as `fleet2d study run` does
    speeds = [round(0.1 + i / 1000, 3) for i in range(variants // 1000)]
    study = {"base": HOUR, "axes": {"robots.astro.speed": speeds}, "replicates": 1000}
    for name in (f"driver of {variants:,} variants", "  going on with nothing to do"):
        start_core_s = time.process_time()
        seconds = run(study, folder / "many", InstantExecutor())
        core_s = time.process_time() - start_core_s
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        print(
            f"{name}: {seconds:.0f} s, {core_s:.0f} s of a core, {1000 * core_s / variants:.3f} ms"
            f" each, {peak:.0f} MB at most",
            flush=True,
        )
    sizes = [path.stat().st_size for path in (folder / "many").rglob("*") if path.is_file()]
    print(f"  {len(sizes)} files of {sum(sizes) / 1e6:.0f} MB")


def fleet(folder: Path, robots: int = 100_000) -> None:
    """Print time and memory of a driver of a fleet, each robot in a home of its own."""
    free_memory_of_polars()
    homes = [{"synthetic": robots, "settings": {"furnish": True}}]
    lives = {"population": robots, "homes": homes, "households": HOUSEHOLDS}
    study = {"base": HOUR, "axes": {"robot": lives}}
    start_core_s = time.process_time()
    crew = Crew(InstantExecutor(), 1)
    run_study(check_study(study, crew=crew), folder / "fleet", crew)
    core_s = time.process_time() - start_core_s
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(
        f"driver of {robots:,} robots in as many homes: {core_s:.0f} s of a core,"
        f" {1000 * core_s / robots:.1f} ms each, {peak:.0f} MB at most",
        flush=True,
    )


def lives(folder: Path, robots: int = 1000, days: int = 30) -> None:
    """Print what a month of a robot in a furnished home of its own costs, all included.

    Imports are left out: a process does them once.
    """
    _live(folder / "first", 1, 1)
    begin = _core_s()
    _live(folder / "lives", robots, days)
    core_s = (_core_s() - begin) / robots
    print(
        f"{robots:,} robots, {days} days, each in a furnished home: {core_s:.2f} s of a core each,"
        f" {core_s * 100_000 / 3600:.1f} core-hours for 100,000"
    )


def _live(folder: Path, robots: int, days: int) -> None:
    """Run a study of robots, each in a home of its own."""
    homes = [{"synthetic": 10 * robots, "settings": {"furnish": True}}]
    axis = {"population": robots, "homes": homes, "households": HOUSEHOLDS}
    base = {**HOUR, "simulation": {"duration": {"days": days}}}
    study = {"base": base, "axes": {"robot": axis}}
    with open_crew("serial") as crew:
        run_study(check_study(study, crew=crew), folder, crew)


def _core_s() -> float:
    """Return the processor time of this process and of children that have ended [s]."""
    return sum(os.times()[:4])


def reading(folder: Path) -> None:
    """Print how long a study of 1,000 variants takes to open and summarize."""
    speeds = [round(0.1 + i / 1000, 3) for i in range(100)]
    study = {"base": HOUR, "axes": {"robots.astro.speed": speeds}, "replicates": 10}
    run(study, folder / "thousand", InstantExecutor())
    code = (
        "import sys, time; start_s, start_core_s = time.perf_counter(), time.process_time()\n"
        "import fleet2d\n"
        f"study = fleet2d.open_study({str(folder / 'thousand')!r})\n"
        "opened = time.perf_counter()\n"
        "study.summary('metric_1.ana.value', ['robots.astro.speed'])\n"
        "first, core_s = time.perf_counter(), time.process_time() - start_core_s\n"
        "again = fleet2d.open_study(study.location)\n"
        "again.summary('metric_1.ana.value', ['robots.astro.speed'])\n"
        "print(first - start_s, core_s, time.perf_counter() - first)\n"
    )
    command = [sys.executable, "-c", code]
    times = []
    for _ in range(6):  # the first compiles
        text = subprocess.check_output(command, env={**os.environ, **_as_installed(folder)})
        times.append([float(seconds) for seconds in text.split()])
    first_s, core_s, again_s = map(min, zip(*times[1:], strict=True))
    print(
        f"opening and aggregating 1,000 variants: {first_s:.2f} s with imports ({core_s:.2f} s of a"
        f" core), {again_s:.3f} s again; best of five"
    )


def _as_installed(folder: Path) -> dict[str, str]:
    """Return the environment of commands whose modules are compiled, as pip installs them."""
    return {
        "PYTHONDONTWRITEBYTECODE": "",
        "PYTHONPYCACHEPREFIX": str(folder / "bytecode"),
        "PYTHONPATH": os.pathsep.join(filter(None, sys.path)),
    }


def months(folder: Path, workers: int, *, small: bool = False) -> None:
    """Print how long the paper's thousand months take, or a few hours instead."""
    file: Any = EXAMPLES / "ten_by_ten_by_ten.yaml"
    if small:
        file = read_document(file).data
        file["base"]["simulation"]["duration"] = "1 h"
        file["axes"]["home"]["synthetic"] = 2
        people = file["axes"]["person"]["options"]
        file["axes"]["person"]["options"] = {"office": people["office"]}
    seconds = run(file, folder / "months", LocalExecutor(workers), workers)
    counts = open_study(folder / "months").counts
    print(
        f"the paper's {counts.total} variants by {workers} workers:"
        f" {seconds / 60:.1f} min, {counts.failed} failed"
    )


def main() -> None:
    """Measure what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parts = ("overhead", "speedup", "driver", "reading", "months", "fleet", "lives")
    parser.add_argument("what", nargs="*", metavar="|".join(parts), default=parts[:4])
    parser.add_argument("--robots", type=int, help="of a fleet")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--variants", type=int, default=100_000, help="of the driver")
    parser.add_argument("--small", action="store_true", help="few variants: does it work?")
    arguments = parser.parse_args()
    if unknown := set(arguments.what) - set(parts):
        parser.error(f"there is no {', '.join(unknown)}")
    print(f"load before: {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    with tempfile.TemporaryDirectory() as folder:
        for name in arguments.what:
            folder_of = Path(folder, name)
            if name == "months":
                months(folder_of, arguments.workers, small=arguments.small)
            elif name == "overhead":
                overhead(folder_of, seeds=1 if arguments.small else 200)
            elif name == "speedup":
                speedup(folder_of, 1 if arguments.small else 5, 1 if arguments.small else 40)
            elif name == "driver":
                driver(folder_of, 1_000 if arguments.small else arguments.variants)
            elif name == "fleet":
                fleet(folder_of, arguments.robots or 100_000)
            elif name == "lives":
                lives(folder_of, arguments.robots or 1000)
            else:
                reading(folder_of)


if __name__ == "__main__":
    main()
