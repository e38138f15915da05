"""Motion sensors, as an alarm system has them: passive infrared, on a wall or the ceiling."""

from datetime import timedelta

import numpy as np
from pydantic import Field

from fleet2d.configuration.components import register
from fleet2d.configuration.units import AngleDeg, Duration, PositiveLength, micros
from fleet2d.entities.objects.home_object import Sensor, SensorView, first_cause
from fleet2d.entities.place import Point
from fleet2d.errors import PlacementError
from fleet2d.floorplan.home import Home
from fleet2d.kernels import I64, TURN, Bool, half_sine, region_contains_points, visible_region


@register("object", "motion_sensor")
class MotionSensor(Sensor):
    """A sensor that is on while a person moves in view, with no wall between, and a while longer.

    It doesn't notice people who stand, sit or lie still.

    Attributes:
        at: Where it hangs, [x, y] in metres.
        heading_deg: Where it looks, counter-clockwise from +x.
        angle_deg: Width of its field of view.
        range: How far it sees.
        hold: It turns off when nobody has moved for this long.
        robots: Whether robots trigger it, too.
    """

    at: Point = Field(examples=[[1.0, 2.5]])
    heading_deg: AngleDeg = 0.0
    angle_deg: AngleDeg = Field(default=360.0, gt=0, le=360)
    range: PositiveLength = 6.0
    hold: Duration = timedelta(seconds=5)
    robots: bool = False

    def start(self, home: Home, step_us: int) -> None:
        """Compute its position on the lattice."""
        x, y = home.plan.lattice.point_at(self.at)
        if home.plan.room_at(*self.at) is None:
            raise PlacementError(
                f"({self.at[0]:g}, {self.at[1]:g}) m is outside the home: hang the sensor in a room"
            )
        self.eye = (int(x), int(y))
        self.reach = round(self.range * home.plan.lattice.units_per_m)
        self.version = -1

    def place(self, home: Home) -> str:
        """Return the room that it hangs in."""
        room = home.plan.room_at(*self.at)
        return room.name if room else ""

    def hold_us(self) -> int:
        """Return how long it stays on [us]."""
        return micros(self.hold)

    def sense(self, view: SensorView, home: Home) -> tuple[I64, I64]:
        """Return the steps in which somebody moved in view."""
        rows = slice(None) if self.robots else slice(view.users)
        x, y, present = view.x[rows], view.y[rows], view.present[rows]
        moved = (np.diff(x) != 0) | (np.diff(y) != 0)
        near = moved & present[:, 1:] & present[:, :-1]
        dx, dy = x[:, 1:] - self.eye[0], y[:, 1:] - self.eye[1]
        near &= dx * dx + dy * dy <= self.reach * self.reach
        bodies, columns = np.nonzero(near)
        if len(columns):
            points = np.stack([x[bodies, columns + 1], y[bodies, columns + 1]], axis=1)
            near[bodies, columns] = self._in_view(points, home)
        return first_cause(near, view.first)

    def _in_view(self, points: I64, home: Home) -> Bool:
        x, y = self.eye
        if self.version != home.version:
            self.version, self.walls = home.version, home.walls
            self.region = visible_region(self.walls, x, y)
        is_visible: Bool = region_contains_points(self.walls, x, y, *self.region, points)
        return is_visible & self._in_wedge(points[:, 0] - x, points[:, 1] - y)

    def _in_wedge(self, dx: I64, dy: I64) -> Bool:
        half = round(self.angle_deg / 360 * TURN)
        if half >= TURN:
            return np.ones(len(dx), np.bool_)
        middle = 2 * round(self.heading_deg / 360 * TURN)
        quarter = TURN // 2  # of a turn, in halves of a heading
        right, left = middle - half, middle + half
        from_right = half_sine(right + quarter) * dy - half_sine(right) * dx >= 0
        to_left = half_sine(left) * dx - half_sine(left + quarter) * dy >= 0
        return from_right & to_left if half <= quarter else from_right | to_left
