"""What a month is spent on: seconds of a scenario by part, in a warm process.

    python benchmarks/profile_month.py [SCENARIO] [--runs 5]

Parts exclude each other: what one calls of another counts for that. A clock around each call costs
about half a microsecond; the run with the median total is shown, beside one without clocks.
"""

import argparse
import functools
import statistics
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import fleet2d
from fleet2d.engine import loop
from fleet2d.engine.cameras import Cameras
from fleet2d.engine.collisions import Clearance
from fleet2d.engine.encounters import Encounters
from fleet2d.engine.layers import LayerBook
from fleet2d.engine.learners import Learners
from fleet2d.engine.recorder import Recorder
from fleet2d.engine.seen_area import SeenArea
from fleet2d.engine.sensors import Sensors
from fleet2d.engine.simulation import Simulation
from fleet2d.entities.body import Bodies
from fleet2d.entities.decisions import DecidingActor
from fleet2d.metrics.metric import Metric

spent: Counter[str] = Counter()
running: list[float] = []  # what was spent inside of each part under way


def timed(part: Callable[..., str], function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function that counts its time for a part; `part` is told the arguments."""

    @functools.wraps(function)
    def call(*args: Any, **kwargs: Any) -> Any:
        running.append(0.0)
        began = time.perf_counter()
        try:
            return function(*args, **kwargs)
        finally:
            took = time.perf_counter() - began
            spent[part(*args)] += took - running.pop()
            if running:
                running[-1] += took

    return call


def decides(actor: DecidingActor, *_: Any) -> str:
    """Return the part of a decision."""
    return "users decide" if actor.path.startswith("users.") else "robots decide"


def learns(_: Learners, learner: Any, *__: Any) -> str:
    """Return the part of an update."""
    return "metrics" if isinstance(learner.component, Metric) else "algorithms learn"


PARTS: tuple[tuple[Any, str, str | Callable[..., str]], ...] = (
    (Simulation, "__init__", "set up: plan, walls, routes, places"),
    (Simulation, "finish", "write and close"),
    (loop.Loop, "run", "loop"),
    *((Bodies, name, "everybody follows a plan") for name in ("follow", "window", "runs", "block")),
    *((Cameras, name, "robots look for users") for name in ("limit", "take")),
    *((SeenArea, name, "what of the home was in view") for name in ("take", "take_bins")),
    (LayerBook, "expose", "what of the rooms was in view"),
    *(
        (watcher, name, "encounters, giving way, sensors")
        for watcher in (Clearance, Encounters, Sensors)
        for name in ("limit", "take")
    ),
    (DecidingActor, "decide", decides),
    (Learners, "update", "algorithms and metrics: call, check"),
    (Learners, "_update", learns),
    (Learners, "_store", "algorithms and metrics: store"),
    (Recorder, "take", "record: events, key frames, samples"),
    (Recorder, "drain", "write and close"),
)


def once(scenario: str, folder: Path) -> float:
    """Run a scenario; return the seconds that it took."""
    began = time.perf_counter()
    fleet2d.run(scenario, out=folder / f"run{time.perf_counter_ns()}")
    return time.perf_counter() - began


def main() -> None:
    """Run with and without clocks, and print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("scenario", nargs="?", default="bundled:paper")
    parser.add_argument("--runs", type=int, default=5)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        once(arguments.scenario, folder)  # loads libraries
        plain = [once(arguments.scenario, folder) for _ in range(arguments.runs)]
        for owner, method, part in PARTS:
            named = part if callable(part) else functools.partial(lambda p, *_: p, part)
            setattr(owner, method, timed(named, getattr(owner, method)))
        loop.PHASES = tuple(
            timed(functools.partial(lambda p, *_: p, f"phase: {phase.__name__}"), phase)
            for phase in loop.PHASES
        )
        found = []
        for _ in range(arguments.runs):
            spent.clear()
            total = once(arguments.scenario, folder)
            found.append((total, Counter(spent)))
    total, parts = sorted(found, key=lambda run: run[0])[arguments.runs // 2]
    print(f"{arguments.scenario}: {statistics.median(plain):.2f} s, with clocks {total:.2f} s")
    for part, seconds in parts.most_common():
        print(f"{seconds:6.3f} s  {100 * seconds / total:4.1f} %  {part}")
    rest = total - sum(parts.values())
    print(f"{rest:6.3f} s  {100 * rest / total:4.1f} %  all else")


if __name__ == "__main__":
    main()
