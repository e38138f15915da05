"""Readings of real sensors, replayed from a table."""

from pathlib import Path
from typing import Any

import pytest

import fleet2d
from fleet2d.errors import InputError

ROWS = """time,sensor,state
2026-01-05 00:10:00,door,OPEN
2026-01-05 00:10:30,door,CLOSE
2026-01-05 00:12:00,hall,ON
2026-01-05 00:20:00,door,OPEN
"""


def scenario(path: Path, **settings: Any) -> dict[str, Any]:
    sensor = {"type": "replay_sensor", "path": str(path), "room": "hallway"} | settings
    return {
        "extends": "bundled:base",
        "simulation": {"duration": "1 h", "seed": 4},
        "objects": {"front": sensor},
    }


def write(folder: Path, text: str) -> Path:
    path = folder / "sensors.csv"
    path.write_text(text)
    return path


@pytest.mark.parametrize("span", [1, 100, None])
def test_readings_are_those_of_the_table(tmp_path: Path, span: int | None) -> None:
    run = fleet2d.run(scenario(write(tmp_path, ROWS), sensor="door"), max_span=span)

    rows = [(r["step"], r["sensor"], r["state"]) for r in run.tables["sensors"].to_pylist()]
    assert rows == [(600, "front", "ON"), (630, "front", "OFF"), (1200, "front", "ON")]


@pytest.mark.parametrize(
    ("text", "settings", "message"),
    [
        (ROWS, {}, "2 sensors: door, hall: select one by 'sensor'"),
        (ROWS, {"sensor": "doors"}, "no sensor 'doors'"),
        ("time,state\n0,maybe\n", {}, "the state 'maybe' is unknown"),
        ("time,state\n5,ON\n1,OFF\n", {}, "the time runs backwards"),
        ("time,sensor,state\n5,oven,ON\n5,door,ON\n1,door,OFF\n", {"sensor": "door"}, "line 4:"),
        (ROWS, {"sensor": "door", "day": 4}, "the run begins on day 4 of the log"),
    ],
)
def test_a_wrong_table_is_refused(
    tmp_path: Path, text: str, settings: dict[str, Any], message: str
) -> None:
    with pytest.raises(InputError) as caught:
        fleet2d.Simulation(scenario(write(tmp_path, text), **settings))

    assert "objects.front: " in str(caught.value)
    assert message in str(caught.value)
