"""What the tests of drives share."""

from typing import Any

import numpy as np

from fleet2d import Drive
from fleet2d.entities.drives.drive import breakpoints
from fleet2d.kernels import TURN

CORNER = [(0, 0), (3, 0), (3, 2)]
"""A route that turns left after three metres [m]."""


def driven(
    drive: Drive, points: list[tuple[float, float]] = CORNER, heading_deg: float = 0.0
) -> list[tuple[float, ...]]:
    """The breakpoints of a robot of 0.5 m/s and 90 degrees/s: s, x and y [m], heading [degrees]."""
    route = np.round(np.array(points) * 1000).astype(np.int64)  # a unit is a millimetre
    heading = round(heading_deg / 360 * TURN)
    rows: Any = breakpoints(drive, route, heading, (500.0, TURN / 4), 1000.0)
    assert not rows[:, 4].any()
    numbers = rows[:, :4] / [1e6, 1000, 1000, TURN / 360]
    return [tuple(row) for row in np.round(numbers, 3).tolist()]
