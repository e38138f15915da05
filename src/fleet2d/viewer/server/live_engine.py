"""A running simulation as the page watches and controls it.

This is the only module of the viewer that reads and changes the state of a simulation.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from fleet2d.engine.simulation import Simulation
from fleet2d.entities.body import Track
from fleet2d.errors import InputError, PlacementError
from fleet2d.floorplan.home import HomeChange
from fleet2d.kernels.numbers import TURN
from fleet2d.kernels.space import Mesh
from fleet2d.runs.run import Run
from fleet2d.viewer.facts.contract import LiveBody, LiveEvent, LiveOrder, MarkFacts
from fleet2d.viewer.facts.marks import intervention_marks

AHEAD_US = 120_000_000
MOST_CORNERS = 60


class LiveEngine:
    """A running simulation.

    A body that a page has called stays where it was called or placed last, until the next call.
    Watching has no effect on the run: its artifacts are the same, watched or not.
    """

    def __init__(self, simulation: Simulation) -> None:
        """Take over a simulation: nothing else may advance it."""
        self.simulation = simulation
        self._events_until = simulation.step
        self._meshes: dict[int, int] = {}
        self._walls: list[Mesh] = []
        self._called: set[str] = set()
        self._marks = 0

    @property
    def step(self) -> int:
        """The next step to simulate."""
        return self.simulation.step

    @property
    def done(self) -> bool:
        """Whether all steps are simulated."""
        return self.simulation.done

    def advance(self, steps: int) -> None:
        """Simulate a number of steps."""
        self.simulation.advance(steps)

    def finish(self) -> Run:
        """Close the run."""
        return self.simulation.finish()

    def bodies(self) -> list[LiveBody]:
        """Return the poses of all users and robots, and their paths ahead."""
        return [
            LiveBody(
                name=name,
                x=int(actor.state.x),
                y=int(actor.state.y),
                heading=int(actor.state.heading) % TURN,
                away=bool(actor.state.away),
                ahead=list(self._ahead(actor)),
                note=_note(actor),
            )
            for name, actor in self.simulation.actors.items()
        ]

    def _ahead(self, actor: Any) -> Iterator[tuple[int, int, int]]:
        """Yield the corners of the path ahead: time [us], x and y [lattice]."""
        if not isinstance(actor.motion, Track):
            return
        now_us = self.step * self.simulation.clock.step_us
        track = actor.motion.breakpoints
        time = np.asarray(track.time)
        first = int(np.searchsorted(time, now_us, side="right"))
        for i in range(first, min(len(time), first + MOST_CORNERS)):
            if time[i] > now_us + AHEAD_US:
                return
            yield int(time[i]), int(track.x[i]), int(track.y[i])

    def in_view(self) -> list[tuple[str, str]]:
        """Return (robot, user) pairs: the users that each robot has in view."""
        robots = self.simulation.scenario.robots
        return [
            (name, user)
            for name, actor in self.simulation.actors.items()
            if name in robots
            for user in actor.in_view()
        ]

    def doors(self) -> dict[str, bool]:
        """Return whether each door is open, by name."""
        state = self.simulation.state
        return {name: bool(entry["open"]) for name, entry in state.items() if "open" in entry}

    def beliefs(self) -> dict[str, list[float]]:
        """Return the newest shares of rooms of each algorithm whose output has shares."""
        shares = {}
        for name, output in self.simulation.outputs.items():
            share = getattr(output, "share", None)
            if isinstance(share, np.ndarray) and share.ndim == 1:
                shares[name] = share.round(5).tolist()
        return shares

    def events(self) -> list[LiveEvent]:
        """Return the events since the last call."""
        users = self.simulation.scenario.users
        recorded = self.simulation.events(self._events_until)
        self._events_until = self.step
        return [
            LiveEvent(
                step=event.step,
                entity=event.entity,
                event=str(event.event),
                user=event.detail if event.detail in users else "",
                detail="" if event.detail in users else event.detail,
            )
            for event in recorded
            if event.step < self._events_until
        ]

    def marks(self) -> list[MarkFacts]:
        """Return the marks of the interventions since the last call."""
        records = self.simulation.interventions[self._marks :]
        self._marks += len(records)
        return intervention_marks(records)

    def walls(self) -> int:
        """Return the id of the present set of walls, for `mesh`."""
        mesh = self.simulation.home.walls
        key = id(mesh)
        if key not in self._meshes:
            self._meshes[key] = len(self._walls)
            self._walls.append(mesh)  # referenced, so that its id stays unique
        return self._meshes[key]

    def mesh(self, number: int) -> Mesh:
        """Return a set of walls by its id.

        Raises:
            InputError: There is no such set of walls.
        """
        if not 0 <= number < len(self._walls):
            raise InputError(f"there is no set of walls with id {number}")
        return self._walls[number]

    def apply(self, order: LiveOrder) -> None:
        """Apply an intervention; the manifest records it, and `reproduce` repeats it.

        Raises:
            InputError: There is nothing of that name, or the place isn't free.
            ComponentError: The same, of doors.
        """
        name, place = order["target"], (order["x"], order["y"])
        if order["action"] == "door":
            self.simulation.change(
                HomeChange(open=name) if order["value"] else HomeChange(shut=name)
            )
        elif order["action"] == "place":
            self.simulation.put(name, self._near(name, place))
            if name in self._called:
                self.simulation.hold(name)
        elif order["action"] == "call":
            self.simulation.send(name, self._near(name, place))
            self._called.add(name)
        elif order["action"] == "replan":
            self.simulation.replan(name)
        else:
            raise InputError(f"there is no intervention {order['action']!r}")

    def _near(self, name: str, place: tuple[float, float]) -> tuple[float, float]:
        """Return the free place for a body that is nearest to a point [m].

        Raises:
            InputError: There is nobody of that name.
            PlacementError: There is no free place nearby.
        """
        actors = self.simulation.actors
        if name not in actors:
            raise InputError(f"there is nobody named {name!r}")
        space, lattice = actors[name].space, self.simulation.home.plan.lattice
        at = lattice.point_at(place)
        part = space.part_at(*at)
        if part < 0:
            part = space.part_near(*at)
        near = space.nearest(*at, part) if part >= 0 else None
        if near is None:
            raise PlacementError(
                f"{name} can't be at ({place[0]:g}, {place[1]:g}) m, nor is there free floor near:"
                " choose a point in a room"
            )
        x, y = lattice.to_metres(near).tolist()
        return x, y


def _note(actor: Any) -> str:
    """Return the active behavior of a body, and the last note of its plan."""
    active = actor.arbiter.active
    behaviors = actor.behaviors
    kind = behaviors[active].type_name if active is not None and active < len(behaviors) else ""
    notes = getattr(actor.plan, "notes", ())
    note = f"{notes[-1].event} {notes[-1].detail}".strip() if notes else ""
    return ": ".join(filter(None, (str(kind), note)))
