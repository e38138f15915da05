"""Objects of a home that have a state during a run: doors, and the base of sensors."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import timedelta
from typing import ClassVar, Literal, NamedTuple, Self

import numpy as np
from pydantic import Field, model_validator

from fleet2d.configuration.components import Component, Settings, register
from fleet2d.configuration.problems import did_you_mean, problem
from fleet2d.configuration.units import Duration, PositiveDuration, TimeOfDay, micros
from fleet2d.entities.place import Point
from fleet2d.errors import PlacementError
from fleet2d.floorplan.home import Home
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.floorplan.rooms.doorways import Doorway
from fleet2d.kernels import I64, Bool
from fleet2d.runtime.clock import DAY


class HomeObject(Component):
    """An object of the home with a state: a door, a sensor.

    Furniture that just stands there is part of the floor plan.
    """

    kind: ClassVar[str] = "object"


SensorFault = Literal["on", "off", "silent"]
"""How a sensor fails: it is always triggered, never triggered, or reports nothing."""


class SensorReading(NamedTuple):
    """A change of a sensor's state.

    Attributes:
        step: The step at which it goes on or off.
        on: Whether it goes on.
        user: The index of the user that it noticed; -1: none.
    """

    step: int
    on: bool
    user: int


@dataclass(frozen=True)
class SensorView:
    """The bodies over a span, as sensors see them: row u is user u, then come the robots.

    Attributes:
        first: First step of the span.
        x: Positions [lattice], int64 (bodies, steps + 1). Column 0 is the step before the span (at
            the first step of a run, that step itself), column j + 1 is step first + j.
        y: Likewise.
        present: Whether the body is at home, bool (bodies, steps + 1).
        users: How many of the rows are users.
    """

    first: int
    x: I64
    y: I64
    present: Bool
    users: int

    @property
    def steps(self) -> int:
        """The number of steps in the span."""
        return int(self.x.shape[1]) - 1


class Sensor(HomeObject):
    """Base of sensors: a subclass implements `sense`, which returns the steps that trigger it.

    The readings follow from that: the sensor goes on with the first of those steps, and off after
    its `hold` without any.

    Attributes:
        room: The room that its readings name; left out: where it is.
    """

    room: str | None = Field(default=None, min_length=1)

    # Names of its two states in the table of readings.
    words: ClassVar[tuple[str, str]] = ("ON", "OFF")

    def start(self, home: Home, step_us: int) -> None:
        """Prepare for a run; check here that the object that it watches exists."""

    def place(self, home: Home) -> str:
        """Return the name of the room that its readings name."""
        raise NotImplementedError

    def hold_us(self) -> int:
        """Return how long it stays on after the last step that triggers it [us]."""
        return 0

    def sense(self, view: SensorView, home: Home) -> tuple[I64, I64]:
        """Return the steps that trigger it, ascending, and the user of each; int64 (n,) each."""
        raise NotImplementedError


def first_cause(triggered: Bool, first: int) -> tuple[I64, I64]:
    """Return the steps in which a body triggers a sensor, and the lowest row of those that do.

    Args:
        triggered: Whether each body triggers it at each step, bool (bodies, steps).
        first: The step of the first column.

    Example:
        >>> steps, bodies = first_cause(np.array([[0, 0, 1], [0, 1, 1]], bool), 100)
        >>> steps.tolist(), bodies.tolist()
        ([101, 102], [1, 0])
    """
    columns = np.flatnonzero(triggered.any(axis=0))
    return columns + first, np.argmax(triggered[:, columns], axis=0).astype(np.int64)


class SensorState:
    """The state of a sensor between spans.

    Attributes:
        hold: How many steps it stays on after the last one that triggers it.
        on: Whether it is on.
        last: The last step that triggered it.
        user: The index of the user that switched it on; -1: none.
    """

    def __init__(self, hold_steps: int) -> None:
        self.hold = hold_steps
        self.on = False
        self.last = 0
        self.user = -1

    def read(self, steps: I64, users: I64, end: int) -> list[SensorReading]:
        """Return the readings before step `end`, given the steps that trigger it, and their users.

        Args:
            steps: Ascending, int64 (n,).
            users: Index of the user of each step, int64 (n,).
            end: The step after the span.
        """
        readings: list[SensorReading] = []
        # It stays on between steps no farther apart than its hold.
        quiet = np.flatnonzero(np.diff(steps) > self.hold + 1)
        begins = [0, *(quiet + 1).tolist()] if len(steps) else []
        ends = [*quiet.tolist(), len(steps) - 1]
        for i, j in zip(begins, ends, strict=False):
            if self.on and steps[i] > self.last + self.hold + 1:
                readings.append(self._off())
            if not self.on:
                self.on, self.user = True, int(users[i])
                readings.append(SensorReading(int(steps[i]), True, self.user))
            self.last = int(steps[j])
        if self.on and self.last + self.hold + 1 < end:
            readings.append(self._off())
        return readings

    def _off(self) -> SensorReading:
        self.on = False
        return SensorReading(self.last + self.hold + 1, False, self.user)


def in_order(readings: Sequence[tuple[int, SensorReading]]) -> list[tuple[int, SensorReading]]:
    """Return (sensor number, reading) pairs ordered by step, then by sensor."""
    return sorted(readings, key=lambda item: (item[1].step, item[0]))


class FurnitureSensor(Sensor):
    """Base of sensors of an object of the floor plan, in whose room they are.

    Attributes:
        of: The object of the floor plan that it is in, by name.
        hold: It turns off when nobody has been there for this long.
    """

    of: str
    hold: Duration = timedelta(seconds=0)

    def start(self, home: Home, step_us: int) -> None:
        """Check that the object exists."""
        home.object(self.of)

    def place(self, home: Home) -> str:
        """Return the room that the object stands in; empty if it is in none."""
        middle = home.object(self.of).footprint.centroid
        room = home.plan.room_at(middle.x, middle.y)
        return room.name if room else ""

    def hold_us(self) -> int:
        """Return how long it stays on [us]."""
        return micros(self.hold)


class Turn(Settings):
    """A change of a door at a time of day, every day.

    Attributes:
        at: When, every day.
        open: Open it, or shut it.
        locked: Lock it, or unlock it.
    """

    at: TimeOfDay
    open: bool | None = None
    locked: bool | None = None

    @model_validator(mode="after")
    def _does_something(self) -> Self:
        if self.open is None and self.locked is None:
            raise problem("nothing happens then: give 'open' or 'locked', true or false")
        return self


@register("object", "door")
class Door(HomeObject):
    """A door: while it is shut, it blocks sight and ways exactly like a wall.

    People open it as they come to it, unless it is locked; for bodies with `opens_doors: false`,
    such as robots, it is a wall. It never shuts on a body: it waits until the doorway is free.

    Attributes:
        doorway: Its doorway: by name, by a room that has one only, by 'room-room', or the one
            nearest to a point [x, y] in metres.
        open: Whether it stands open at first.
        locked: Whether it is locked at first, so that nobody can open it by hand.
        closes_after: It shuts this long after somebody opened it or went through; left out: it
            stays as it was left.
        schedule: When it is opened, shut or locked, every day.
    """

    doorway: str | Point = Field(examples=["bathroom_0", "kitchen_0-hallway_0", [4.0, 2.5]])
    open: bool = True
    locked: bool = False
    closes_after: PositiveDuration | None = Field(default=None, examples=["10 s"])
    schedule: tuple[Turn, ...] = ()

    @model_validator(mode="after")
    def _opens_by_day(self) -> Self:
        late = [turn.at for turn in self.schedule if turn.at >= DAY]
        if late:
            raise problem("a door's schedule ends at 23:59:59: write 00:00 for midnight")
        return self

    def find(self, plan: FloorPlan) -> Doorway:
        """Return its doorway in a floor plan.

        Raises:
            PlacementError: There is no such doorway, or several; the message lists the doorways.
        """
        if not plan.doorways:
            raise PlacementError(f"{plan.name} has no doorways: give it some, or no doors")
        if not isinstance(self.doorway, str):
            x, y = self.doorway
            return min(plan.doorways, key=lambda d: (_squared(d, x, y), d.index))
        matches = doorways_named(plan, self.doorway)
        names = [doorway.name for doorway in plan.doorways]
        if not matches:
            known = [*names, *(room.name for room in plan.rooms)]
            raise PlacementError(
                f"there is no doorway {self.doorway!r}{did_you_mean(self.doorway, known)}"
                f" The doorways are: {', '.join(names)}"
            )
        if len(matches) > 1:
            raise PlacementError(
                f"{self.doorway!r} has {len(matches)} doorways: choose one of"
                f" {', '.join(doorway.name for doorway in matches)}"
            )
        return matches[0]


def doorways_named(plan: FloorPlan, name: str) -> list[Doorway]:
    """Return the doorway of a name, those between 'room-room', or all of a room."""
    exact = [doorway for doorway in plan.doorways if doorway.name == name]
    if exact:
        return exact
    rooms = {room.name: room.index for room in plan.rooms}
    pairs = {
        tuple(sorted((rooms[a], rooms[b]))) for a in rooms for b in rooms if f"{a}-{b}" == name
    }
    if name in rooms:
        return [d for d in plan.doorways if rooms[name] in d.rooms]
    return [d for d in plan.doorways if tuple(sorted(d.rooms)) in pairs]


def door_hint(plan: FloorPlan, name: str) -> str:
    """Return how to add a door to a doorway of a plan in a scenario, for messages."""
    names = [doorway.name for doorway in plan.doorways]
    if not names:
        return ""
    matches = doorways_named(plan, name)
    doorway = matches[0].name if matches else names[0]
    return (
        ". A doorway that the picture shows is open until a door hangs in it: objects:"
        f" {{{name}: {{type: door, doorway: {doorway}}}}}; the doorways are: {', '.join(names)}"
    )


def _squared(doorway: Doorway, x: float, y: float) -> float:
    (x0, y0), (x1, y1) = doorway.start, doorway.end
    return float(((x0 + x1) / 2 - x) ** 2 + ((y0 + y1) / 2 - y) ** 2)
