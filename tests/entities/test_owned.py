"""Furniture of a person as a place: {object: bed, of: ana}."""

from typing import Any

import numpy as np
import pytest
from tests.scenes import digests, path, run, scenario, table

import fleet2d
from fleet2d.errors import InputError

BED = {"object": "bed", "of": "ana"}


def bedside(user: Any, place: Any = BED, duration: str = "30 min") -> dict[str, Any]:
    """A robot that goes to a place, at home with Ana and Ben."""
    robot = {"type": "scheduled", "visits": [{"at": "02:05", "place": place}]}
    return scenario(
        duration,
        users={"ana": user, "ben": {"type": "routine", "persona": "student"}},
        robots={"astro": robot},
        floorplan={"type": "bundled", "furnish": True},
        simulation={"start": "2026-01-05T02:00"},
    )


def metres_to(stored: Any, name: str) -> float:
    """From the robot in the end to where a user is in the end."""
    robot, user = path(stored, "astro"), path(stored, "ana" if name == "ana" else name)
    return float(np.hypot(robot.x[-1] - user.x[-1], robot.y[-1] - user.y[-1]))


@pytest.mark.parametrize("seed", range(3))
def test_a_robot_goes_to_the_bed_in_which_a_person_sleeps(seed: int) -> None:
    content = bedside({"type": "routine", "persona": "works_outside"})
    content["simulation"]["seed"] = seed
    stored = run(content)
    assert table(stored, "events", entity="ana", event="uses")["detail"][-1].startswith("bed")
    assert metres_to(stored, "ana") < 2


def test_a_schedule_lies_in_the_bed_that_a_robot_goes_to() -> None:
    ana = {"type": "schedule", "days": [{"items": [{"at": "00:00", "place": "bed"}]}]}
    assert metres_to(run(bedside(ana)), "ana") < 2


def test_somebody_goes_to_the_bed_of_who_comes_later_in_the_scenario() -> None:
    ana = {"type": "schedule", "days": [{"items": [{"at": "02:03", "place": "bed of ben"}]}]}
    content = bedside(ana)
    del content["robots"]
    used = table(run(content), "events", entity="ana", event="uses")["detail"].tolist()
    content["users"]["ana"]["days"][0]["items"][0]["place"] = {"object": "bed", "of": "ben"}
    assert used  # yesterday's, and today's
    assert all(name.startswith("bed") for name in used)
    assert digests(run(content))["events"] == digests(run(content, max_span=61))["events"]


def test_it_is_written_as_it_was() -> None:
    loaded = fleet2d.load_scenario(bedside({"type": "routine"}))
    assert loaded.robots["astro"].behaviors[0].visits[0].place == ("bed of ana",)  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("place", "words"),
    [
        ({"object": "bed", "of": "anna"}, "no user 'anna'.*did you mean 'ana'"),
        ({"object": "bedd", "of": "ana"}, "did you mean 'bed'"),
        ({"object": "bed"}, "expected a place"),
    ],
)
def test_what_is_not_there_is_refused_with_the_nearest_name(place: Any, words: str) -> None:
    with pytest.raises(InputError, match=words):
        fleet2d.Simulation(bedside({"type": "routine"}, place))
