"""Readings of real sensors, replayed from a table."""

import pytest

import fleet2d
from fleet2d.errors import InputError

ROWS = """time,sensor,state
2026-01-05 00:10:00,door,OPEN
2026-01-05 00:10:30,door,CLOSE
2026-01-05 00:12:00,hall,ON
2026-01-05 00:20:00,door,OPEN
"""


def scenario(path, **settings):
    sensor = {"type": "replay_sensor", "path": str(path), "room": "hallway"} | settings
    return {
        "extends": "bundled:paper",
        "simulation": {"duration": "1 h", "seed": 4},
        "objects": {"front": sensor},
    }


def write(folder, text):
    path = folder / "sensors.csv"
    path.write_text(text)
    return path


@pytest.mark.parametrize("span", [7, None])
def test_readings_are_those_of_the_table(tmp_path, span):
    run = fleet2d.run(scenario(write(tmp_path, ROWS), sensor="door"), max_span=span)

    rows = [(r["step"], r["sensor"], r["state"]) for r in run.tables["sensors"].to_pylist()]
    assert rows == [(600, "front", "ON"), (630, "front", "OFF"), (1200, "front", "ON")]


HISTORY = """entity_id,state,last_changed
binary_sensor.kitchen,off,2026-03-28T22:00:00.000Z
binary_sensor.kitchen,on,2026-03-28T23:30:00.123Z
binary_sensor.kitchen,off,2026-03-28T23:31:00.456Z
binary_sensor.kitchen,on,2026-03-29T00:08:00.000Z
binary_sensor.kitchen,unavailable,2026-03-29T00:10:00.000Z
binary_sensor.kitchen,off,2026-03-29T00:12:00.000Z
binary_sensor.kitchen,on,2026-03-29T01:30:00.000Z
binary_sensor.kitchen,off,2026-03-29T01:35:00.000Z
sensor.temperature,21.4,2026-03-28T22:10:00.000Z
"""


def test_home_assistants_unavailable_is_a_gap_that_a_note_tells(tmp_path):
    keys = {"sensor": "binary_sensor.kitchen", "day": "date", "time_zone": "Europe/Berlin"}
    content = scenario(write(tmp_path, HISTORY), **keys)
    content["simulation"] |= {"start": "2026-03-28T22:00", "duration": "8 h"}

    run = fleet2d.run(content)

    rows = [f"{r['time']:%H:%M} {r['state']}" for r in run.tables["sensors"].to_pylist()]
    assert rows == [
        "00:30 ON", "00:31 OFF", "01:08 ON", "01:10 OFF", "03:30 ON", "03:35 OFF",
    ]  # fmt: skip
    note = "objects.front: off for 2 min of the run in which it is unavailable or unknown"
    assert note in run.manifest["notes"]


def test_a_door_that_shuts_in_the_repeated_hour_of_a_day_of_24_hours_is_shut_after_it(tmp_path):
    """The reading was left out without a word: the door stood open until the morning."""
    text = "time,state\n2026-10-25T00:50:00Z,OPEN\n2026-10-25T01:10:00Z,CLOSE\n"
    content = scenario(write(tmp_path, text), day="date", time_zone="Europe/Berlin")
    content["simulation"] |= {"start": "2026-10-25T02:00", "duration": "2 h"}

    run = fleet2d.run(content)

    rows = [f"{r['time']:%H:%M} {r['state']}" for r in run.tables["sensors"].to_pylist()]
    assert rows == ["02:50 ON", "03:00 OFF"]
    assert any("summer time repeats count at its end" in note for note in run.manifest["notes"])


def test_what_is_outside_of_the_run_is_told(tmp_path):
    content = scenario(write(tmp_path, ROWS), sensor="door")
    content["simulation"]["duration"] = "11 min"

    notes = fleet2d.Simulation(content).notes

    assert "objects.front: of 4 readings, 0 are before the run and 2 after its end" in notes


def test_sensors_of_one_table_begin_with_the_same_day(tmp_path):
    text = ROWS + "2026-01-06 00:05:00,bell,ON\n"
    content = scenario(write(tmp_path, text), sensor="bell", day=0)

    assert fleet2d.run(content).tables["sensors"].num_rows == 0
    content["objects"]["front"]["day"] = 1
    assert fleet2d.run(content).tables["sensors"]["step"].to_pylist() == [300]


@pytest.mark.parametrize(
    ("text", "settings", "message"),
    [
        (ROWS, {}, "2 sensors: door, hall: select one by 'sensor'"),
        (ROWS, {"sensor": "doors"}, "no sensor 'doors'"),
        ("time,state\n0,maybe\n", {}, "the state 'maybe' is unknown"),
        ("time,state\n5,ON\n1,OFF\n", {}, "the time runs backwards"),
        ("time,sensor,state\n5,oven,ON\n5,door,ON\n1,door,OFF\n", {"sensor": "door"}, "line 4:"),
        (ROWS, {"sensor": "door", "day": 4}, "the run begins on day 4 of the log"),
        (
            ROWS.replace("2026-01-05 00:", "2026-01-05 07:"),
            {"sensor": "door"},
            "the log is from 2026-01-05 07:10:00 to 2026-01-05 07:20:00, the run from 2026-01-05"
            " 00:00:00 to 2026-01-05 01:00:00; choose another 'day', or set simulation.start",
        ),
    ],
)
def test_a_wrong_table_is_refused(tmp_path, text, settings, message):
    with pytest.raises(InputError) as caught:
        fleet2d.Simulation(scenario(write(tmp_path, text), **settings))

    assert "objects.front: " in str(caught.value)
    assert message in str(caught.value)
