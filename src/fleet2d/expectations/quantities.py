"""Signals that are numbers: distances, speeds, batteries, outputs, metrics."""

from dataclasses import dataclass

from fleet2d.configuration.units import LENGTH, SHARE, SPEED
from fleet2d.expectations.scene import Scene
from fleet2d.expectations.signals import BODY, Signal

Place = str | tuple[float, float]
"""A body, a room, an object, or a point (x, y) [m]."""


@dataclass(frozen=True, eq=False)
class DistanceSignal(Signal):
    """The distance of a body from another, a room, an object or a point [m].

    It is measured from the centre of a body to the nearest point of a room or object: 0 inside.
    Infinite while a body is away from home.
    """

    body: str
    other: Place

    word = "distance"
    unit = "m"
    quantity = LENGTH

    def __post_init__(self) -> None:
        if not isinstance(self.other, str):
            x, y = self.other
            object.__setattr__(self, "other", (float(x), float(y)))

    def check(self, scene: Scene) -> None:
        """Refuse unknown bodies and places."""
        places = {*scene.rooms, *scene.things}
        if self.body in places and self.body not in scene.bodies and self.other in scene.bodies:
            raise scene.error(
                f"{self}: name the body first: distance({self.other!r}, {self.body!r})"
            )
        scene.check_body(self.body, self)
        if isinstance(self.other, str):
            names = [*scene.bodies, *scene.rooms, *scene.things]
            scene.check_name("body, room or object", self.other, names, self)
        if self.other == self.body:
            raise scene.error(f"{self}: give two different bodies")


@dataclass(frozen=True, eq=False)
class SpeedSignal(Signal):
    """The speed of a body: the distance from its position at the step before, per step [m/s]."""

    body: str

    word = "speed"
    of = BODY
    unit = "m/s"
    quantity = SPEED


@dataclass(frozen=True, eq=False)
class BatterySignal(Signal):
    """The charge of a robot, 0 to 1, rounded down to a tenth of a percent."""

    robot: str

    word = "battery"
    of = ("robot with a battery", "batteries")
    unit = "share"
    quantity = SHARE


@dataclass(frozen=True, eq=False)
class OutputSignal(Signal):
    """A number of an algorithm's newest output, which counts from the step after it.

    `ltp.kitchen` is the probability of a room by `ltp`; `rtp.ana.kitchen` that for one user;
    `mine.sightings` a named number of an output. Missing before the first output.
    """

    path: str

    word = "output"

    def check(self, scene: Scene) -> None:
        """Refuse an unknown algorithm."""
        scene.check_name("algorithm", self.path.split(".")[0], scene.algorithms, self)
        if "." not in self.path:
            raise scene.error(
                f'{self}: select a number of the output, such as output("{self.path}.kitchen")'
            )


@dataclass(frozen=True, eq=False)
class MetricSignal(Signal):
    """A number of a metric's result so far, by the names in its result.

    It changes when the metric is updated; at the last step it is the result of the whole run.
    Missing before the first update.
    """

    path: str

    word = "metric"

    def check(self, scene: Scene) -> None:
        """Refuse an unknown metric."""
        scene.check_name("metric", self.path.split(".")[0], scene.metrics, self)
