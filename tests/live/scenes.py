"""Live scenes that tests share."""

from functools import cache

import fleet2d

LIVE = {
    "extends": "bundled:paper",
    "simulation": {"duration": "30 s", "seed": 4, "start": "2026-01-05T12:00"},
    "users": {"ana": {"type": "live"}},
    "robots": {"astro": {"perceives": "live", "behaviors": [{"type": "live"}]}},
    "objects": {"front_door": {"type": "live_sensor", "room": "hallway"}},
    "algorithms": {"ltp": None},
    "metrics": {"ltp_error": None},
}


@cache
def place(room="kitchen_1") -> tuple[float, float]:
    """Return a place in the middle of a room of the bundled home."""
    return next(r.anchor_xy for r in fleet2d.load_floorplan().rooms if r.name == room)
