"""Quantities: what they accept, exactly, and what they say about the rest."""

import copy
import pickle
from datetime import timedelta
from fractions import Fraction
from pathlib import Path
from typing import get_args

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import BaseModel, TypeAdapter, ValidationError
from pydantic_core import PydanticCustomError

from fleet2d.configuration.units import (
    GROUPS,
    MAX_DURATION,
    WEEKDAYS,
    AngleDeg,
    Days,
    Duration,
    InputPath,
    Length,
    PositiveDuration,
    PositiveLength,
    Share,
    Speed,
    Text,
    TimeOfDay,
    TurnRateDeg,
    format_duration,
    micros,
    parse_duration,
    weekdays_of,
    whole_steps,
)
from fleet2d.errors import ScenarioError


def read(type_, value):
    return TypeAdapter(type_).validate_python(value)


def message(type_, value):
    with pytest.raises(ValidationError) as caught:
        read(type_, value)
    return str(caught.value.errors()[0]["msg"])


@pytest.mark.parametrize(
    ("written", "microseconds"),
    [
        ({"s": 0.1 + 0.2}, 300_000),
        ("1 s", 1_000_000),
        ("14 d", 1_209_600_000_000),
        ("500 ms", 500_000),
        ("2 weeks", 1_209_600_000_000),
        ("1 h 30 min", 5_400_000_000),
        ("1h30min", 5_400_000_000),
        ("1 day, 1 s", 86_401_000_000),
        ("1e-3 s", 1000),
        ("7 µs", 7),
        (timedelta(seconds=90), 90_000_000),
        ({"days": 30, "hours": 2}, 2_599_200_000_000),
        (0, 0),
    ],
)
def test_duration_is_read_exactly(written, microseconds):
    assert microseconds == micros(read(Duration, written))


@given(st.integers(0, micros(MAX_DURATION)))
def test_duration_survives_its_canonical_spelling(count):
    duration = timedelta(microseconds=count)

    assert duration == parse_duration(format_duration(duration))


@pytest.mark.parametrize(
    ("written", "dumped"),
    [("30 d", "30 d"), ("60 min", "1 h"), ("90 s", "90 s"), ("500 ms", "0.5 s"), (0, "0 s"),
     ("2 weeks", "14 d"), ("1 us", "0.000001 s"), ("36 h", "36 h"), ("100 s", "100 s")],
)  # fmt: skip
def test_duration_dumps_in_the_largest_unit_that_divides_it(written, dumped):
    class Model(BaseModel):
        value: Duration

    assert {"value": dumped} == Model(value=written).model_dump(mode="json")


@pytest.mark.parametrize(
    ("written", "said"),
    [
        ("1 parsec", "unknown unit 'parsec' in '1 parsec': a duration is written like '30 s', "
                     "'5 min', '1 h', '14 d'"),
        ({"fortnights": 1}, "unknown unit 'fortnights' in"),
        ("fast", "expected a duration, got 'fast': write it with a unit, like '30 s'"),
        (7, "7 has no unit: write '7 d', '7 h', '7 min' or '7 s'"),
        ("7", "7 has no unit: write '7 d', '7 h', '7 min' or '7 s'"),
        (0.5, "0.5 has no unit: write '0.5 d'"),
        ("", "expected a duration, got ''"),
        ("5 3", "expected a duration, got '5 3'"),
        ("1 h 30", "expected a duration, got '1 h 30'"),
        (True, "expected a duration, got True"),
        (None, "expected a duration, got None"),
        ({}, "expected a duration, got {}"),
        ({"days": "3"}, "expected a duration, got {'days': '3'}"),
        ("-1 s", "expected a duration of 0 or more, got -1 s"),
        (timedelta(-1), "expected a duration of 0 or more"),
        ("1e-7 s", "expected a duration of 1 microsecond or longer, got '1e-7 s'"),
        ("1e300 s", "expected a duration of at most 1000 years, got '1e300 s'"),
        (timedelta.max, "expected a duration of at most 1000 years"),
        (float("nan"), "expected a duration, a finite number, got nan"),
        (float("inf"), "expected a duration, a finite number, got inf"),
    ],
)  # fmt: skip
def test_duration_says_what_is_wrong(written, said):
    assert said in message(Duration, written)


def test_huge_exponent_is_refused_before_it_fills_the_memory():
    assert "expected a length" in message(Length, "1e999999999 m")


def test_positive_duration_refuses_zero():
    assert "expected a duration longer than 0, got 0 s" == message(PositiveDuration, 0)


@pytest.mark.parametrize(
    ("type_", "written", "number"),
    [
        (Length, "0.2 m", 0.2),
        (Length, "20 cm", 0.2),
        (Length, -1, -1.0),
        (Length, Fraction(1, 4), 0.25),
        (Speed, "0.6 m/s", 0.6),
        (Speed, "3.6 km/h", 1.0),
        (AngleDeg, "-90°", -90.0),
        (AngleDeg, "1 turn", 360.0),
        (TurnRateDeg, "90 deg/s", 90.0),
        (Share, 1, 1.0),
        (Share, "95 %", 0.95),
    ],
)
def test_quantity_is_read_in_its_base_unit(type_, written, number):
    assert number == read(type_, written)


@pytest.mark.parametrize(
    ("type_", "written", "said"),
    [
        (Length, "3 ft", "unknown unit 'ft' in '3 ft': a length is written like '0.2 m'"),
        (Length, float("nan"), "expected a length, a finite number, got nan"),
        (Length, "1e400", "expected a length, a finite number, got '1e400'"),
        (PositiveLength, 0, "expected a length above 0, got 0"),
        (Speed, -1, "expected a speed of 0 or more, got -1"),
        (Speed, "fast", "expected a speed, got 'fast': write a number in m/s, or like '0.6 m/s'"),
        (Share, 1.5, "expected a share from 0 to 1, or from '0 %' to '100 %', got 1.5"),
        (Share, "95", "expected a share from 0 to 1"),
    ],
)
def test_quantity_says_what_is_wrong(type_, written, said):
    assert said in message(type_, written)


@pytest.mark.parametrize(
    ("written", "seconds", "dumped"),
    [("07:30", 27_000, "07:30"), ("7:30", 27_000, "07:30"), ("07:30:15", 27_015, "07:30:15"),
     ("00:00:05.25", 5.25, "00:00:05.25"), ("24:00", 86_400, "24:00"),
     (timedelta(hours=1), 3600, "01:00")],
)  # fmt: skip
def test_time_of_day_is_the_time_since_midnight(written, seconds, dumped):
    adapter = TypeAdapter(TimeOfDay)
    value = adapter.validate_python(written)

    assert (timedelta(seconds=seconds), dumped) == (value, adapter.dump_python(value, mode="json"))


@pytest.mark.parametrize("written", ["24:01", "25:00", "7", "07:60", 450, "noon", None, "07:30 pm"])
def test_time_of_day_refuses_what_no_clock_shows(written):
    assert "expected a time of day" in message(TimeOfDay, written)


@pytest.mark.parametrize(
    "type_",
    [Duration, PositiveDuration, Length, Speed, AngleDeg, TurnRateDeg, Share, TimeOfDay, InputPath],
)
def test_json_schema_describes_each_quantity(type_):
    schema = TypeAdapter(type_).json_schema()

    assert schema["description"]
    assert schema["x-quantity"]


def test_path_starts_from_the_folder_of_its_file(tmp_path):
    (tmp_path / "plan.json").touch()

    assert tmp_path / "plan.json" == read(InputPath, Text("plan.json", tmp_path))


def test_path_starts_from_the_current_folder_otherwise(tmp_path, monkeypatch):
    (tmp_path / "plan.json").touch()
    monkeypatch.chdir(tmp_path)

    assert tmp_path / "plan.json" == read(InputPath, "plan.json")


def test_path_that_is_no_file_is_refused(tmp_path):
    assert f"no such file: {tmp_path / 'x'}" == message(InputPath, Text("x", tmp_path))
    assert f"a folder, not a file: {tmp_path}" == message(InputPath, tmp_path)
    assert "expected the path of a file, got 3" == message(InputPath, 3)


def test_text_keeps_its_folder_in_copies():
    text = Text("plan.json", Path("/homes"))

    assert Path("/homes") == copy.deepcopy(text).folder == pickle.loads(pickle.dumps(text)).folder


@pytest.mark.parametrize("duration", [timedelta(0), timedelta(seconds=3), timedelta(seconds=1)])
def test_no_multiple_of_the_step_is_refused(duration):
    with pytest.raises(
        ScenarioError, match=r"^period is \d s, which is not a multiple of .* \(2 s\)"
    ):
        whole_steps(duration, 2_000_000, "period")


def test_multiple_of_the_step_is_counted():
    assert 3 == whole_steps(timedelta(seconds=6), 2_000_000, "period")


def test_every_name_that_a_scenario_may_give_stands_for_days():
    assert (*GROUPS, *WEEKDAYS) == get_args(Days)
    assert set(range(7)) == weekdays_of("daily") == weekdays_of(WEEKDAYS)
    assert weekdays_of("daily") == weekdays_of(("weekdays", "weekend"))


def test_monday_is_the_first_day():
    assert [{day} for day in range(7)] == [weekdays_of(name) for name in WEEKDAYS]


def test_unknown_day_is_told_with_the_known():
    with pytest.raises(PydanticCustomError, match="unknown day 'mondy'; there are: daily, "):
        weekdays_of(["weekend", "mondy"])
