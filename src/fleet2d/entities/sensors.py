"""Sensors of doors, seats, appliances and motion, real sensors, and sensors from a log."""

from dataclasses import replace
from datetime import timedelta
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from pydantic import Field

from fleet2d.configuration.units import (
    AngleDeg,
    Duration,
    InputPath,
    Length,
    PeerAddress,
    PositiveLength,
    format_duration,
)
from fleet2d.entities.place import Point
from fleet2d.entities.sensor import FurnitureSensor, Sensor, SensorView, first_cause
from fleet2d.errors import PlacementError
from fleet2d.floorplan.home import Home
from fleet2d.kernels import I64, TURN, Bool, half_sine, region_contains_points, visible_region
from fleet2d.logs.log import Day, LogError, LogKeys, PositionLog, by_clock_of_run, in_run
from fleet2d.runtime.clock import Clock

NAMES = {
    "time": ("time", "timestamp", "t", "datetime", "last_changed"),
    "sensor": ("sensor", "id", "name", "entity", "entity_id"),
    "state": ("state", "value", "message", "on"),
}
"""The names that a column may have, if the user gives none."""
ON = frozenset({"on", "open", "true", "1", "1.0", "present", "opened", "motion"})
OFF = frozenset({"off", "close", "closed", "false", "0", "0.0", "absent", "clear", "none"})
SILENT = frozenset({"unavailable", "unknown", ""})
"""The states of a sensor that reports nothing, as Home Assistant writes them."""


class ContactSensor(Sensor):
    """A sensor that reports OPEN when a door opens, and CLOSE when it shuts.

    Attributes:
        of: The name of the door, one of the scenario's objects.
    """

    of: str

    words = ("OPEN", "CLOSE")

    def watch(self, door: int) -> None:
        """Set the watched door, by its number in the home."""
        self.door = door

    def place(self, home: Home) -> str:
        """Return the first room of the doorway."""
        return home.rooms[home.doors[self.door].rooms[0]].name

    def sense(self, view: SensorView, home: Home) -> tuple[I64, I64]:
        """Return all steps of the span if the door is open: doors move between spans only."""
        shut = self.door in home.shut
        steps = np.arange(0 if shut else view.steps, dtype=np.int64) + view.first
        return steps, np.full(len(steps), -1, np.int64)


class OccupancySensor(FurnitureSensor):
    """A sensor that is on while somebody is on a bed, a sofa or a chair."""

    def sense(self, view: SensorView, home: Home) -> tuple[I64, I64]:
        """Return the steps in which the middle of a person is over the object."""
        lattice = home.lattice
        footprint = home.object(self.of).footprint
        low_x, low_y, high_x, high_y = footprint.bounds
        x0, y0 = lattice.point_at((low_x, low_y))
        x1, y1 = lattice.point_at((high_x, high_y))
        people = slice(view.users)
        x = view.x[people, 1:]
        y = view.y[people, 1:]
        is_near = (x >= x0) & (x <= x1) & (y >= y0) & (y <= y1)
        on_object = is_near & view.present[people, 1:]
        if on_object.any():
            points = np.column_stack([x[on_object], y[on_object]])
            on_object[on_object] = shapely.intersects_xy(footprint, lattice.to_metres(points))
        return first_cause(on_object, view.first)


class SmartPlug(FurnitureSensor):
    """A plug that is on while a person stays where its device is used: a stove, a desk, a TV.

    Passing by doesn't switch it on: the person has to stay on the spot for two steps.

    Attributes:
        of: The name of the powered object of the floor plan.
        reach: Distance from such a place that counts as using the device.
        hold: Time without use after which it turns off.
    """

    of: str
    reach: Length = Field(default=0.3, ge=0)
    hold: Duration = timedelta(minutes=1)

    def start(self, home: Home, step_us: int) -> None:
        """Check that the object exists, and can be used."""
        if not home.object(self.of).uses:
            raise PlacementError(
                f"{self.of} has no place to use it from: a plug can't tell its use"
            )

    def sense(self, view: SensorView, home: Home) -> tuple[I64, I64]:
        """Return the steps in which a person stays at one of the object's places."""
        lattice = home.lattice
        people = slice(view.users)
        x = view.x[people]
        y = view.y[people]
        still = (np.diff(x) == 0) & (np.diff(y) == 0)
        at_device = np.zeros(still.shape, np.bool_)
        reach = round(self.reach * lattice.units_per_m)
        for use in home.object(self.of).uses:
            at_x, at_y = lattice.point_at(use.at)
            squared = (x[:, 1:] - at_x) ** 2 + (y[:, 1:] - at_y) ** 2
            at_device |= squared <= reach * reach
        return first_cause(at_device & still & view.present[people, 1:], view.first)


class MotionSensor(Sensor):
    """A sensor that is on while a person moves in view of it, and for a while longer.

    It doesn't notice people who stand, sit or lie still.

    Attributes:
        at: Its position, [x, y] in metres.
        heading_deg: Its direction of view, counter-clockwise from +x.
        angle_deg: Width of its field of view.
        range: Its range.
        hold: Time without motion after which it turns off.
        robots: Whether robots trigger it, too.
    """

    at: Point = Field(examples=[[1.0, 2.5]])
    heading_deg: AngleDeg = 0.0
    angle_deg: AngleDeg = Field(default=360.0, gt=0, le=360)
    range: PositiveLength = 6.0
    hold: Duration = timedelta(seconds=5)
    robots: bool = False

    def start(self, home: Home, step_us: int) -> None:
        """Compute the sensor's position on the lattice."""
        if home.plan.room_at(*self.at) is None:
            raise PlacementError(
                f"({self.at[0]:g}, {self.at[1]:g}) m is outside the home: hang the sensor in a room"
            )
        self.eye = home.lattice.point_at(self.at)
        self.reach = round(self.range * home.lattice.units_per_m)
        self.version = -1

    def place(self, home: Home) -> str:
        """Return the room of the sensor."""
        room = home.plan.room_at(*self.at)
        return room.name if room else ""

    def sense(self, view: SensorView, home: Home) -> tuple[I64, I64]:
        """Return the steps in which somebody moved in view."""
        rows = slice(None) if self.robots else slice(view.users)
        x = view.x[rows]
        y = view.y[rows]
        present = view.present[rows]
        moved = (np.diff(x) != 0) | (np.diff(y) != 0)
        near = moved & present[:, 1:] & present[:, :-1]
        after_x = x[:, 1:]
        after_y = y[:, 1:]
        dx = after_x - self.eye[0]
        dy = after_y - self.eye[1]
        near &= dx * dx + dy * dy <= self.reach * self.reach
        if near.any():
            points = np.column_stack([after_x[near], after_y[near]])
            near[near] = self._in_view(points, home)
        return first_cause(near, view.first)

    def _in_view(self, points: I64, home: Home) -> Bool:
        x, y = self.eye
        if self.version != home.version:
            self.version = home.version
            self.walls = home.walls
            self.region = visible_region(self.walls, x, y)
        is_visible: Bool = region_contains_points(self.walls, x, y, *self.region, points)
        return is_visible & self._in_wedge(points[:, 0] - x, points[:, 1] - y)

    def _in_wedge(self, dx: I64, dy: I64) -> Bool:
        half = round(self.angle_deg / 360 * TURN)
        if half >= TURN:
            return np.ones(len(dx), np.bool_)
        middle = 2 * round(self.heading_deg / 360 * TURN)
        quarter = TURN // 2  # a quarter turn, in halves of a heading
        right = middle - half
        left = middle + half
        from_right = half_sine(right + quarter) * dy - half_sine(right) * dx >= 0
        to_left = half_sine(left) * dx - half_sine(left + quarter) * dy >= 0
        return from_right & to_left if half <= quarter else from_right | to_left


class LiveSensor(Sensor):
    """A real sensor, which an intervention `report` turns on or off; see `fleet2d live`.

    Attributes:
        room: The room that its readings name.
        source: The other program whose messages it takes, such as ws://127.0.0.1:8765, which
            `fleet2d live` opens; left out: any of `--with`.
    """

    room: str = Field(min_length=1)
    source: PeerAddress | None = None

    def sense(self, view: SensorView, home: Home) -> tuple[I64, I64]:
        """Return no steps: only reports switch it."""
        none = np.zeros(0, np.int64)
        return none, none


class ReplaySensor(Sensor, LogKeys):
    """A real sensor, whose readings are replayed from a table.

    A state of `unavailable` or `unknown`, as in Home Assistant, counts as off, and a note says for
    how long.

    Attributes:
        path: The table (.csv, .parquet, .jsonl) with a row for each change of its state.
        room: The room that its readings name.
        columns: Names of the columns time, state and sensor, as {state: value}.
        sensor: The sensor, if the table has several.
        day: The day of the table that is the first of the run: a number from 0, its date, or the
            first of the same weekday.
    """

    path: InputPath
    room: str = Field(min_length=1)
    sensor: str | None = None
    day: Day = 0

    def files(self) -> tuple[Path, ...]:
        """Return the file to read."""
        return (self.path,)

    def read(self, clock: Clock) -> None:
        """Read the table.

        Raises:
            LogError: The table can't be read, lacks a column, has no such sensor, or a state is
                unknown.
        """
        from fleet2d.logs.tables import LogTable

        table = LogTable.read(
            self.path,
            self.columns,
            NAMES,
            ("time", "state"),
            decimal_comma=self.decimal_comma,
            day_first=self.day_first,
        )
        stamps = table.stamps()
        zone = self.zone_of(clock)
        count = len(table.line)
        chosen = np.ones(count, bool)
        if "sensor" in table.named:
            chosen = table.rows_of("sensor", self.sensor)
        # The table may have many sensors, and its days and its end are those of all.
        whole = stamps.local(self.path, "rows", np.ones(count, bool), [], time_zone=zone, sort=True)
        nothing = np.zeros((count, 2))
        log = PositionLog(
            self.path, "readings", whole.first_day, whole.time_us, nothing, nothing[:, 0]
        )
        said: list[str] = []
        local = stamps.local(
            self.path, "readings", chosen, said, time_zone=zone, sort=self.sort, are_states=True
        )
        _, begin_us, notes = in_run(log, self.day, clock)
        time_us = by_clock_of_run(replace(log, time_us=local.time_us), self.day, clock).time_us
        notes = (*notes, *said)
        states = table.column("state").to_pylist()
        on = [_is_on(states[row], self.path, table.line[row]) for row in local.row.tolist()]
        self._steps = (time_us - begin_us) // clock.step_us
        self._on = np.array([bool(state) for state in on], bool)
        begins = self._steps.clip(0, clock.steps)
        ends = np.append(begins[1:], clock.steps)
        is_silent = np.array([state is None for state in on], bool)
        silent_us = int((ends - begins)[is_silent].sum()) * clock.step_us
        self.notes = notes
        if silent_us:
            gap = format_duration(timedelta(microseconds=silent_us))
            self.notes += (f"off for {gap} of the run in which it is unavailable or unknown",)

    def sense(self, view: SensorView, home: Home) -> tuple[I64, I64]:
        """Return the steps at which the sensor is on, without known users."""
        steps = np.arange(view.first, view.first + view.steps, dtype=np.int64)
        row = np.searchsorted(self._steps, steps, side="right") - 1
        on = steps[(row >= 0) & self._on[row]]
        return on, np.full(len(on), -1, np.int64)


def _is_on(value: Any, path: Path, line: int) -> bool | None:
    """Return whether a state means on; None: the sensor reports nothing.

    Raises:
        LogError: The word is unknown.
    """
    word = "" if value is None else str(value).strip().lower()
    if word not in ON | OFF | SILENT:
        raise LogError(
            f"{path}, line {line}: the state {value!r} is unknown: expected ON or OFF, OPEN or"
            " CLOSE"
        )
    return None if word in SILENT else word in ON
