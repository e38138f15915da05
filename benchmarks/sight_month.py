"""What sight costs over a month of rounds: the seen area, the methods, and one decision.

    python benchmarks/sight_month.py [--json FILE]

Times are the best of several runs in this process that take turns, the first of each left out.
"""

import argparse
import json
import sys
import time
from pathlib import Path
from typing import Any

REPEATS = 5
SCENARIO = "bundled:rounds"  # whose robot learns nothing: what is added is all there is


def month(repeats: int = REPEATS) -> dict[str, float]:
    """Return the time to simulate the month [s], without and with what is kept of sight."""
    import fleet2d
    from fleet2d.engine.simulation import Simulation

    exposed, idle = algorithms()
    cases = {
        "an algorithm that does nothing": (idle, {}),
        "explored and exposure": (exposed, {"explored": {}}),
        "last seen besides": (exposed, {"explored": {}, "last_seen": {}}),
    }
    scenarios = {}
    for name, (algorithm, layers) in cases.items():
        scenario = fleet2d.load_scenario(SCENARIO)
        source = scenario.floorplan.model_copy(
            update={"layers": {key: fleet2d_layer() for key in layers}}
        )
        scenarios[name] = scenario.model_copy(
            update={"algorithms": {"a": algorithm}, "floorplan": source}
        )
    for name in ("visibility_polygon", "flashlight"):
        scenario = fleet2d.load_scenario(SCENARIO, sight={"method": {"type": name}})
        scenarios[f"by {name}"] = scenario.model_copy(update={"algorithms": {"a": idle}})
    times: dict[str, list[float]] = {name: [] for name in scenarios}
    for _ in range(repeats + 1):
        for name, scenario in scenarios.items():
            simulation = Simulation(scenario)
            began = time.perf_counter()
            simulation.run()
            times[name].append(time.perf_counter() - began)
    return {name: min(taken[1:]) for name, taken in times.items()}


def fleet2d_layer() -> Any:
    """Return the settings of a layer that is stored at the end."""
    from fleet2d.floorplan.layers import LayerSettings

    return LayerSettings()


def algorithms() -> tuple[Any, Any]:
    """Return an algorithm that adds up exposure, and one that does nothing."""
    from collections.abc import Set
    from typing import ClassVar

    import fleet2d

    class Exposed(fleet2d.Algorithm):
        """Adds up how much of each room was in view."""

        needs: ClassVar[Set[str]] = {"exposure"}

        def start(self, home: Any) -> None:
            self.sum = 0

        def update(self, history: Any, state: Any) -> None:
            self.sum = self.sum + history.exposure

    class Idle(fleet2d.Algorithm):
        """Does nothing: what an algorithm costs that asks for nothing."""

        def update(self, history: Any, state: Any) -> None:
            return None

    return Exposed(), Idle()


def in_the_loop() -> float:
    """Return what it takes to decide whether a user is in view, over the month [ns]."""
    from fleet2d.engine.cameras import Cameras
    from fleet2d.engine.simulation import Simulation

    class Timed(Cameras):
        seconds, steps = 0.0, 0

        def _look(self, bodies: Any, end: int, **stop: bool) -> Any:
            began = time.perf_counter()
            found = super()._look(bodies, end, **stop)
            Timed.seconds += time.perf_counter() - began
            Timed.steps += (found.end - self.next_step) * len(self.others)
            return found

    simulation = Simulation(SCENARIO)
    for cameras in simulation._state.cameras:
        cameras.__class__ = Timed
    simulation.run()
    return Timed.seconds / Timed.steps * 1e9


def main() -> None:
    """Measure, print, and store."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--json", type=Path, help="where to store the figures")
    options = parser.parse_args()
    months = month()
    for name, seconds in months.items():
        more = seconds / next(iter(months.values())) - 1
        print(f"month, {name}: {seconds:.3f} s ({more:+.0%})")
    loop_ns = min(in_the_loop() for _ in range(3))
    print(f"is a user in view, on average over the month: {loop_ns:.1f} ns")
    if options.json:
        options.json.write_text(
            json.dumps({"month_s": months, "loop_ns": loop_ns}, indent=2) + "\n"
        )


if __name__ == "__main__":
    sys.exit(main())
