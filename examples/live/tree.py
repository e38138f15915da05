"""A behavior tree drives a robot: it looks for Ana, room by room, then goes to the hallway.

pip install py_trees && python examples/live/tree.py
"""

import queue
from typing import Any

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.composites import Selector, Sequence
from py_trees.trees import BehaviourTree

import fleet2d
from fleet2d.live import Bridge, LiveStep, from_iterator, to_function

HOME = {"extends": "bundled:paper", "robots": {"astro": {"behaviors": [{"type": "live"}]}}}
WHEN = "simulation.start=2026-01-05T19:00", "simulation.duration=9 min"
ENDS = {"reached": Status.SUCCESS, "impossible": Status.FAILURE, "cancelled": Status.FAILURE}
messages, goals, seen = queue.Queue[dict[str, Any]](), dict[str, str](), set[str]()


class GoTo(Behaviour):
    """Go to the room of its name."""

    def initialise(self) -> None:
        """Send the robot there."""
        goals.pop(self.name, None)
        messages.put({"type": "goal", "entity": "astro", "to": self.name, "id": self.name})

    def update(self) -> Status:
        """Wait until it is there."""
        return ENDS.get(goals.get(self.name, ""), Status.RUNNING)


class Sees(Behaviour):
    """Whether the robot has seen the person of its name."""

    def update(self) -> Status:  # noqa: D102
        return Status.SUCCESS if self.name in seen else Status.FAILURE


looks = [
    Sequence(f"in {room}", True, [GoTo(room), Sees("ana")]) for room in ("kitchen_1", "bedroom_1")
]
search = Selector("search", True, looks)
tree = BehaviourTree(Sequence("find", True, [search, GoTo("hallway_1")]))


def tick(frame: LiveStep) -> None:
    """Take in what has happened, and let the tree decide."""
    goals.update({goal.id: str(goal.state) for goal in frame.goals})
    seen.update(event.detail for event in frame.events if event.event == "user_seen")
    if tree.root.status in (Status.INVALID, Status.RUNNING):
        tree.tick()


peers = from_iterator(iter(messages.get, None)), to_function(tick)
Bridge(fleet2d.Simulation(HOME, *WHEN, seed=4), peers, speed=0).run()
print("the tree ends in", tree.root.status.value)
