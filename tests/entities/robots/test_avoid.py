"""Rooms that behaviors stay out of: `avoid` of patrol, find, follow and opportunistic."""

from typing import Any

import pytest
from tests.scenes import scenario, table

import fleet2d
from fleet2d.errors import PlacementError

CAMERA = {"range": [0.2, 6], "angle_deg": 340}
BEHAVIORS: dict[str, dict[str, Any]] = {
    "patrol": {"type": "patrol", "rooms": ["kitchen", "living_room"], "dwell": "10 s"},
    "find": {"type": "find", "user": "ana", "every": "3 min", "distance": 0.5},
    "follow": {"type": "follow", "user": "ana", "distance": 0.5},
    "opportunistic": {"type": "opportunistic", "again": "1 min", "distance": 0.5},
}


def inside(behavior: str, avoid: list[str]) -> int:
    """Return for how many steps the robot is in the kitchen, where Ana stays."""
    rest = {"type": "patrol", "waypoints": [[4.4, 3.1], [1.0, 3.0]], "dwell": "20 s"}
    content = scenario(
        "12 min",
        users={"ana": {"type": "schedule", "rest": "kitchen", "days": [{"on": "daily", "items": [{"at": "00:00", "place": [6.5, 3.1], "activity": "read"}]}]}},
        robots={"astro": {"start": [1.0, 3.0], "camera": CAMERA, "behaviors": [{**BEHAVIORS[behavior], "avoid": avoid}, rest]}},
        artifacts={"trajectories": "every step"},
    )  # fmt: skip
    rows = table(fleet2d.run(content), "trajectories", entity="astro")
    return int((rows["room"].astype(str) == "kitchen_0").sum())


@pytest.mark.parametrize("behavior", BEHAVIORS)
def test_the_robot_stays_out_of_the_rooms_that_it_avoids(behavior: str) -> None:
    assert inside(behavior, []) > 0
    assert 0 == inside(behavior, ["kitchen"])


def test_an_unknown_room_is_refused_and_a_kind_that_the_home_lacks_is_noted() -> None:
    with pytest.raises(PlacementError, match=r"patrol\.avoid: .*did you mean 'kitchen'"):
        inside("patrol", ["kitchn"])
    assert inside("patrol", ["office"]) > 0
