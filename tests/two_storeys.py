"""A house of two storeys, side by side in the plan, with stairs whose ends are 10 m apart there."""

from typing import Any


def box(x: float) -> list[list[float]]:
    return [[x, 0], [x + 5, 0], [x + 5, 4], [x, 4]]


PLAN: dict[str, Any] = {
    "format": "fleet2d-floorplan",
    "version": 1,
    "free": [box(0), box(6)],
    "rooms": [
        {"name": "below", "type": "living_room", "polygon": box(0)},
        {"name": "above", "type": "bedroom", "polygon": box(6)},
    ],
    "objects": [
        {"name": "sofa", "type": "sofa", "footprint": [[4.2, 3], [5, 3], [5, 4], [4.2, 4]]},
    ],
    "portals": [{"type": "stairs", "start": [0.5, 3.5], "end": [10.5, 3.5], "takes": 10}],
    "entrance": [0.5, 0.5],
}
