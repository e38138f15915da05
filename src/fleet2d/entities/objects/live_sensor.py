"""Live sensors: real ones, whose states arrive while the run goes on."""

import numpy as np
from pydantic import Field

from fleet2d.configuration.components import register
from fleet2d.configuration.units import PeerAddress
from fleet2d.entities.objects.home_object import Sensor, SensorView
from fleet2d.floorplan.home import Home
from fleet2d.kernels import I64


@register("object", "live_sensor")
class LiveSensor(Sensor):
    """A real sensor: it is on or off as an intervention `report` says; see `fleet2d live`.

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
