"""A planner of PDDL makes a plan for two errands, and a robot carries it out.

pip install pyperplan && python examples/live/plan.py
"""

import queue
import tempfile
from pathlib import Path
from typing import Any

from pyperplan import planner

import fleet2d
from fleet2d.live import Bridge, LiveStep, from_iterator, to_function

HOME: dict[str, Any] = {
    "extends": "bundled:paper",
    "simulation": {"start": "2026-01-05T09:00", "duration": "9 min"},
    "robots": {"astro": {"start": "hallway_1", "behaviors": [{"type": "live"}]}},
}
DOMAIN = """(define (domain errands) (:requirements :strips)
  (:predicates (at ?r) (next ?a ?b) (in ?t ?r) (done ?t))
  (:action move :parameters (?a ?b) :precondition (and (at ?a) (next ?a ?b))
           :effect (and (at ?b) (not (at ?a))))
  (:action do :parameters (?t ?r) :precondition (and (at ?r) (in ?t ?r)) :effect (done ?t)))"""
simulation = fleet2d.Simulation(HOME, seed=4)
doors = [door.name.split("-") for door in simulation.home.plan.doorways]
ways = " ".join(f"(next {a} {b}) (next {b} {a})" for a, b in doors)
rooms = " ".join(room.name for room in simulation.home.rooms)
PROBLEM = f"""(define (problem today) (:domain errands) (:objects {rooms} plants oven)
  (:init (at hallway_1) (in plants living_room_1) (in oven kitchen_1) {ways})
  (:goal (and (done plants) (done oven))))"""

with tempfile.TemporaryDirectory() as folder:
    for name, text in (("domain", DOMAIN), ("problem", PROBLEM)):
        Path(folder, name).write_text(text)
    search = planner.SEARCHES["astar"], planner.HEURISTICS["hff"]
    found = planner.search_plan(f"{folder}/domain", f"{folder}/problem", *search)
todo = iter([step.name.strip("()").split() for step in found])
messages: "queue.Queue[dict[str, Any]]" = queue.Queue()


def go_on() -> None:
    """Do what is next on the plan: moves take time, errands don't."""
    for action, what, *where in todo:
        print(f"{simulation.time:%H:%M:%S} {action} {what} {where[0]}")
        if action == "move":
            messages.put({"type": "goal", "entity": "astro", "to": where[0]})
            return


def hear(frame: LiveStep) -> None:
    """Go on when a goal is reached."""
    for _ in (goal for goal in frame.goals if goal.state == "reached"):
        go_on()


go_on()
Bridge(simulation, [from_iterator(iter(messages.get, None)), to_function(hear)], speed=0).run()
