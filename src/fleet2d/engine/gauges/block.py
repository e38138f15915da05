"""A block of steps, as the gauges of expectations see it."""

from collections.abc import Sequence
from dataclasses import dataclass

from fleet2d.algorithms.log import SensorRow
from fleet2d.engine.bodies import Bodies
from fleet2d.floorplan.home.home import Home
from fleet2d.kernels import I64
from fleet2d.runtime.events import Event


@dataclass
class Block:
    """The steps from `first` to `end` - 1, in which the home doesn't change.

    Attributes:
        first: The first step.
        end: The step after the last one.
        bodies: The bodies and their poses.
        home: The home in these steps.
        observations: The observations of robots, int64 (n, OBSERVATION).
        readings: The readings of sensors.
        sensors: Names of the sensors, in the order of their numbers.
        events: The events, in order of step.
    """

    first: int
    end: int
    bodies: Bodies
    home: Home
    observations: I64
    readings: Sequence[SensorRow]
    sensors: Sequence[str]
    events: Sequence[Event] = ()
