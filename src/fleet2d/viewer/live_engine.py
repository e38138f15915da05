"""A running simulation as the page watches and steers it.

The only module of the viewer that knows how a simulation is asked and told things.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from fleet2d.engine.simulation import Simulation
from fleet2d.entities.motion import Track
from fleet2d.errors import InputError, PlacementError
from fleet2d.floorplan.home.change import HomeChange
from fleet2d.kernels.headings import TURN
from fleet2d.kernels.mesh import Mesh
from fleet2d.runs.run import Run
from fleet2d.viewer.contract import LiveBody, LiveEvent, LiveOrder, MarkFacts
from fleet2d.viewer.marks import intervention_marks

AHEAD_US = 120_000_000
MOST_CORNERS = 60


class LiveEngine:
    """A simulation under way.

    Watching asks only what has no effect, so that the run's artifacts are the same, watched or not.
    """

    def __init__(self, simulation: Simulation) -> None:
        """Watch a simulation; it is advanced by nobody else."""
        self.simulation = simulation
        self._heard_until = simulation.step
        self._meshes: dict[int, int] = {}
        self._walls: list[Mesh] = []
        self._driven: set[str] = set()
        self._marked = 0

    @property
    def step(self) -> int:
        """The next step to simulate."""
        return self.simulation.step

    @property
    def done(self) -> bool:
        """Whether all steps are simulated."""
        return self.simulation.done

    def advance(self, steps: int) -> None:
        """Simulate so many steps."""
        self.simulation.advance(steps)

    def finish(self) -> Run:
        """Close the run."""
        return self.simulation.finish()

    def bodies(self) -> list[LiveBody]:
        """Return where everybody is, and the ways ahead."""
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
        """Yield the corners of the way ahead: time [us], x and y [lattice]."""
        if not isinstance(actor.motion, Track):
            return
        now = self.step * self.simulation.clock.step_us
        track = actor.motion.breakpoints
        time = np.asarray(track.time)
        first = int(np.searchsorted(time, now, side="right"))
        for i in range(first, min(len(time), first + MOST_CORNERS)):
            if time[i] > now + AHEAD_US:
                return
            yield int(time[i]), int(track.x[i]), int(track.y[i])

    def seen(self) -> list[tuple[str, str]]:
        """Return which robot has which user in view."""
        robots = self.simulation.scenario.robots
        return [
            (name, user)
            for name, actor in self.simulation.actors.items()
            if name in robots
            for user in actor.in_view()
        ]

    def doors(self) -> dict[str, bool]:
        """Return of each door whether it is open."""
        state = self.simulation.state
        return {name: bool(entry["open"]) for name, entry in state.items() if "open" in entry}

    def beliefs(self) -> dict[str, list[float]]:
        """Return the newest shares per room of each algorithm that puts out some."""
        shares = {}
        for name, output in self.simulation.outputs.items():
            share = getattr(output, "share", None)
            if isinstance(share, np.ndarray) and share.ndim == 1:
                shares[name] = share.round(5).tolist()
        return shares

    def events(self) -> list[LiveEvent]:
        """Return the events since this was asked last."""
        users = self.simulation.scenario.users
        recorded = self.simulation.events(self._heard_until)
        self._heard_until = self.step
        return [
            LiveEvent(
                step=event.step,
                entity=event.entity,
                event=str(event.event),
                user=event.detail if event.detail in users else "",
                detail="" if event.detail in users else event.detail,
            )
            for event in recorded
            if event.step < self._heard_until
        ]

    def marks(self) -> list[MarkFacts]:
        """Return what was done to the run since this was last asked."""
        done = self.simulation.interventions[self._marked :]
        self._marked += len(done)
        return intervention_marks(done)

    def walls(self) -> int:
        """Return the number of what ends sight at present, for `mesh`."""
        mesh = self.simulation.home.walls
        key = id(mesh)
        if key not in self._meshes:
            self._meshes[key] = len(self._walls)
            self._walls.append(mesh)  # kept, so that no other gets its id
        return self._meshes[key]

    def mesh(self, number: int) -> Mesh:
        """Return what ended sight.

        Raises:
            InputError: There is no such number.
        """
        if not 0 <= number < len(self._walls):
            raise InputError(f"the run has no walls of number {number}")
        return self._walls[number]

    def apply(self, order: LiveOrder) -> None:
        """Intervene as the page asks; the run's manifest keeps it, and `reproduce` does it again.

        Raises:
            InputError: There is nothing of that name, or nobody can be there.
            ComponentError: The same, of doors.
        """
        name, place = order["target"], (order["x"], order["y"])
        if order["action"] == "door":
            self.simulation.change(
                HomeChange(open=name) if order["value"] else HomeChange(shut=name)
            )
        elif order["action"] == "place":
            self.simulation.put(name, self._near(name, place))
        elif order["action"] == "call":
            self._call(name, place)
        elif order["action"] == "replan":
            self.simulation.replan(name)
        else:
            raise InputError(f"{order['action']} is nothing that can be done to a run")

    def _call(self, name: str, place: tuple[float, float]) -> None:
        """Let a body go somewhere and stay; from then on it goes only where it is called."""
        near = self._near(name, place)
        if name not in self._driven:
            self.simulation.drive(name)
            self._driven.add(name)
        plan = self.simulation.plan(name).go_to(near).stay()
        self.simulation.decide(name, plan)

    def _near(self, name: str, place: tuple[float, float]) -> tuple[float, float]:
        """Return the place nearest to a point where a body fits [m].

        Raises:
            InputError: There is nobody of that name.
            PlacementError: It fits nowhere near.
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
            raise PlacementError(f"{name} can't be at ({place[0]:g}, {place[1]:g}) m")
        x, y = lattice.to_metres(near).tolist()
        return x, y


def _note(actor: Any) -> str:
    """Return why a body does what it does: the behavior that has its way, and what it noted."""
    active = actor.arbiter.active
    behaviors = actor.behaviors
    kind = behaviors[active].type_name if active is not None and active < len(behaviors) else ""
    notes = getattr(actor.plan, "notes", ())
    said = f"{notes[-1].event} {notes[-1].detail}".strip() if notes else ""
    return ": ".join(part for part in (str(kind), said) if part)
