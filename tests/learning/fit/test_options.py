"""Options of `fleet2d fit persona`: labels of sensors, silences, residents and time zones of a log."""

import re
from pathlib import Path

import pytest

from fleet2d.learning.fit import validation
from fleet2d.learning.fit.command import fit_routine
from fleet2d.learning.fit.timeline import kinds_of, read_timeline
from fleet2d.logs.layout import read_log
from fleet2d.logs.log import ActivityLog, LogError


@pytest.fixture(autouse=True)
def _few_days_are_sampled(monkeypatch):
    """How well days fit, which takes long to tell, is no matter here."""
    for name in ("SAMPLED", "CHAIN_DAYS", "SAMPLED_BY_SECOND", "CHAIN_DAYS_BY_SECOND"):
        monkeypatch.setattr(validation, name, 7)


def events(path: Path) -> ActivityLog:
    """Return the log of four days with sensors that have no rooms."""
    lines = []
    for day in range(2, 6):
        for hour, sensor, doing in ((0, "M003", "Sleeping"), (8, "M018", "Meal_Preparation")):
            marks = [f" {doing} begin", *[""] * 46, f" {doing} end"]
            for k, mark in enumerate(marks):
                minute = k * 10
                time = f"{hour + minute // 60:02}:{minute % 60:02}:00"
                lines.append(f"2026-03-0{day} {time} {sensor} ON{mark}")
    file = path / "data"
    file.write_text("\n".join(lines) + "\n")
    return read_log(file)


def test_labels_are_given_kinds_of_rooms(tmp_path):
    log = events(tmp_path)
    timeline = read_timeline(log, {"M003": "bedroom", "M018": "kitchen"})
    assert timeline.places == ("bedroom", "kitchen")
    assert {"sleeping", "meal_preparation"} == {state.activity for state in timeline.states}


def test_a_label_without_a_kind_is_left_out(tmp_path):
    log = events(tmp_path)
    assert kinds_of(log, {"M018": ""}) == {"M003": ("m003",), "M018": None}
    assert read_timeline(log, {"M018": ""}).places == ("m003",)


def test_a_shorter_gap_leaves_more_unknown(tmp_path):
    from datetime import timedelta

    log = events(tmp_path)
    known = [
        (read_timeline(log, {}, gap, timedelta(hours=still)).minutes >= 0).sum()
        for gap, still in ((timedelta(hours=9), 12), (timedelta(minutes=15), 1))
    ]
    assert known[0] > known[1]


def test_what_one_sensor_can_not_tell_is_said(tmp_path):
    lines = events(tmp_path).path.read_text().replace("M018", "M003").splitlines()
    (tmp_path / "one").write_text("\n".join(lines) + "\n")
    lines = fit_routine(tmp_path / "one", tmp_path / "persona.yaml")
    assert any("in one room, m003: changes of room, stays and absences can't" in x for x in lines)


def test_a_week_without_the_person_is_left_out_with_the_reason(tmp_path):
    lines = events(tmp_path).path.read_text().splitlines()
    later = [line.replace("2026-03-0", "2026-03-1") for line in lines]
    (tmp_path / "holiday").write_text("\n".join(lines + later) + "\n")
    told = fit_routine(tmp_path / "holiday", tmp_path / "persona.yaml")
    assert any("days are left out: the night before or after them isn't" in x for x in told)


def test_days_that_begin_before_midnight_are_left_out(tmp_path):
    """Who slept in the afternoon, as in a log whose clock jumped, got up at -4:10, with a traceback."""
    lines = events(tmp_path).path.read_text().splitlines()
    later = [
        re.sub("-0(.) (..)", lambda t: f"-1{t[1]} {int(t[2]) + 12:02}", line)
        for line in lines
        if int(line[11:13]) < 12
    ]
    earlier = [re.sub("-0(.) ", lambda t: f"-0{int(t[1]) + 4} ", line) for line in lines]
    (tmp_path / "jump").write_text("\n".join(lines + earlier + later) + "\n")
    told = fit_routine(tmp_path / "jump", tmp_path / "persona.yaml")
    assert any("or they begin before midnight" in x for x in told)
    assert "-4:" not in (tmp_path / "persona.yaml").read_text()


def test_too_few_days_are_counted_with_what_is_missing(tmp_path):
    lines = events(tmp_path).path.read_text().splitlines()
    (tmp_path / "short").write_text("\n".join(x for x in lines if x < "2026-03-05") + "\n")
    with pytest.raises(LogError, match=r"2 of the 3 days of the log are whole.* log 1 more"):
        fit_routine(tmp_path / "short", tmp_path / "persona.yaml")


@pytest.mark.parametrize(("left_out", "has"), [("M018", "sleep alone"), ("M003", "no sleep")])
def test_nights_that_can_not_be_told_are_an_error(left_out, has, tmp_path):
    with pytest.raises(LogError, match=f"the log has {has}.*--rooms LABEL=bedroom"):
        fit_routine(events(tmp_path).path, tmp_path / "a.yaml", rooms=[f"{left_out}="])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"rooms": ["M004=kitchen"]}, "the log has no label 'M004'.*M003"),
        ({"rooms": ["M003"]}, "expected LABEL=KIND"),
        ({"gap": "long"}, "duration"),
        ({"id": "1"}, "takes no id"),
        ({"layout": "caas"}, "--format: expected one of auto, casas"),
    ],
)
def test_a_wrong_option_is_told_before_anything_is_written(options, message, tmp_path):
    out = tmp_path / "persona.yaml"
    with pytest.raises(LogError, match=message):
        fit_routine(events(tmp_path).path, out, **options)
    assert not out.exists()
