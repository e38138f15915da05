"""One history, many futures: where should the robot wait to see Ana most this evening?

The simulation is copied with its random streams. In each copy the robot is sent to another room
until the end of the evening; the history before is computed only once.

    python examples/branching.py
"""

import copy
from datetime import datetime

from fleet2d import Behavior, Plan, Simulation, Situation
from fleet2d.interventions import Replan


class Errand(Behavior):
    """Wait in the room that the script sets."""

    room: str = "entryway"

    def start(self, actor: object) -> None:
        """Begin with the room of the configuration."""
        self.goal = self.room  # not a field, so it is state of the run and may change

    def decide(self, now: Situation) -> Plan:
        """Go there and stay for good."""
        return now.plan().go_to(self.goal).stay()


def main() -> None:
    """Run a day, branch it in the afternoon, and tell which room was best."""
    robot = {"behaviors": [Errand()], "camera": {"angle_deg": 360}}
    history = Simulation("bundled:paper", "simulation.duration.days=1", robots={"astro": robot})
    history.run_until(datetime(2026, 1, 5, 17, 0))
    print(f"{history.time:%A %H:%M}, the robot is in {history.state['astro']['room']}")

    shares = {}
    for room in history.actors["astro"].reachable_rooms():
        future = copy.deepcopy(history)
        future.actors["astro"].behaviors[0].goal = room.name
        future.do(Replan("astro"))
        shares[room.name] = future.run().metrics["sightings"]["ana"]
    for name, share in sorted(shares.items(), key=lambda item: -item[1]):
        print(f"  waiting in {name:14} sees Ana {share:6.1%} of her time at home that day")


if __name__ == "__main__":
    main()
