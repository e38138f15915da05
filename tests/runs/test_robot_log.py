"""The log of a robot: what it decided, did, perceived, and what failed, as its own would say it."""

from functools import cache

import numpy as np
import pytest
from tests.engine.test_power import BATTERY, PATROL, home
from tests.scenes import path, table

import fleet2d
from fleet2d.engine.repeat import decisions_of
from fleet2d.errors import InputError
from fleet2d.runs.robot_log import LogEntry, day_of, log_lines, moves_of, robot_log

SCRIPT = """
at: 5 min, power: astro, state: crash, duration: 2 min
at: 20 min, fault: astro, wheels: true, duration: 5 min
at: 22 min, suppress: astro, user: ana
at: 50 min, power: astro, duration: 10 min
"""


@cache
def stored(*, decisions=True):
    content = home(SCRIPT, "40 h", astro={"battery": BATTERY, "behaviors": ["dock", PATROL]})
    content["artifacts"] = {"trajectories": "off", "decisions": decisions}
    return fleet2d.run(content)


def log(first=0, end=7200, source="", **more):
    entries = robot_log(stored(), "astro", first, end, **more)
    return [entry for entry in entries if source in ("", entry.source)]


def test_it_has_each_event_of_the_robot_and_of_nobody_else():
    rows = table(stored(), "events", entity="astro")
    told = [(e.step, e.text.split()[0]) for e in log(end=3600) if e.source not in ("decision", "drive", "fault")]  # fmt: skip

    expected = zip(rows["step"].tolist(), map(str, rows["event"]), strict=True)
    assert [pair for pair in expected if pair[0] < 3600] == told
    assert told


def test_power_and_faults_stand_out_and_say_how_long_they_lasted():
    assert [
        LogEntry(300, "ERROR", "power", "power_off crash"),
        LogEntry(420, "INFO", "power", "power_on crash, was off for 2 min"),
        LogEntry(3000, "WARN", "power", "power_off off"),
        LogEntry(3600, "INFO", "power", "power_on off, was off for 10 min"),
    ] == log(source="power")
    assert [LogEntry(1200, "ERROR", "fault", "fault wheels for 5 min")] == log(source="fault")


def test_a_stretch_that_begins_while_it_is_off_knows_since_when():
    assert ["power_on off, was off for 10 min"] == [e.text for e in log(3100, source="power")]


def test_moves_are_those_of_its_path_whatever_part_is_read():
    poses = path(stored(), "astro")
    moves = list(moves_of(stored(), "astro", 0, 40 * 3600))
    ends = [step for move in moves for step in (move.first, move.end)]

    way = np.hypot(np.diff(poses.x), np.diff(poses.y)).sum()
    assert sum(move.metres for move in moves) == pytest.approx(way, abs=0.05 * len(moves))
    assert ends == sorted(set(ends))
    words = [e.text.split()[0] for e in log(source="drive")]
    assert words.count("sets") == words.count("stops") > 5


def test_decisions_that_were_not_stored_come_from_the_repeated_run():
    run = stored(decisions=False)
    again = robot_log(run, "astro", 0, 7200, decisions_of(run))

    assert log() == again
    assert {"decision"} == {e.source for e in set(again) - set(robot_log(run, "astro", 0, 7200))}
    assert {"patrol", "dock", "off"} <= {
        e.text.split(":")[0] for e in again if e.source == "decision"
    }


def test_days_are_those_of_the_calendar():
    hour = 3600
    assert [(0, 17 * hour), (17 * hour, 40 * hour)] == [day_of(stored(), day) for day in (1, 2)]
    with pytest.raises(InputError, match="no day 3: its days are 1 to 2"):
        day_of(stored(), 3)


def test_as_text_it_has_a_head_for_each_day():
    lines = list(log_lines(log(0, 40 * 3600), stored().clock))

    assert "-- day 1, Monday 2026-01-05" == lines[0]
    assert "07:05:00  ERROR  power     power_off crash" in lines
    assert 1 == lines.count("-- day 2, Tuesday 2026-01-06")


def test_an_unknown_robot_is_refused():
    with pytest.raises(InputError, match="no robot 'astr': did you mean 'astro'"):
        robot_log(stored(), "astr", 0, 10)
