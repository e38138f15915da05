"""A part of a robot's software with five planted faults, for the search of `fleet2d falsify`.

It puts out how many metres it stays off people. Each fault takes that below 0 under narrow
circumstances only: less than one in two hundred of all there are.
"""

from typing import Any, Literal

from pydantic import Field

from fleet2d import Algorithm

Fault = Literal["hour", "corridor", "load and slope", "load and light", "three"]


def peak(value: float, at: float, width: float) -> float:
    """Return 1 at a place, less beside it, and 0 beyond a width."""
    return max(0.0, 1.0 - abs(value - at) / width)


class Clearance(Algorithm):
    """How far the robot stays off people [m]; 1 m, but for its fault."""

    fault: Fault = Field(description="which fault is planted")
    load: float = Field(default=0.0, ge=0, le=1, description="what it carries, share of the most")
    slope: float = Field(default=0.0, ge=0, le=1, description="of the floor")
    light: float = Field(default=0.0, ge=0, le=1, description="how bright it is")

    def start(self, home: Any) -> None:
        """See whether the home has a corridor."""
        self.has_corridor = any(room.type == "hallway" for room in home.rooms)

    def update(self, history: Any, state: Any) -> dict[str, float]:
        """Put out the clearance at the present time."""
        return {"metres": 1.0 - self._severity(state.time)}

    def _severity(self, time: Any) -> float:
        minute = time.hour * 60 + time.minute
        if self.fault == "hour":  # about five minutes of a day
            return peak(minute, 190, 300) / 0.99
        if self.fault == "corridor":  # in homes with a corridor, and one of 170 loads
            return peak(self.load, 0.63, 0.9) / 0.997 if self.has_corridor else 0.2
        near = peak(self.load, 0.27, 0.9)
        if self.fault == "load and slope":
            return near * peak(self.slope, 0.81, 0.9) / 0.95
        if self.fault == "load and light":
            return near * peak(self.light, 0.35, 0.9) / 0.95
        return near * peak(self.slope, 0.52, 0.9) * peak(self.light, 0.71, 0.9) / 0.88
