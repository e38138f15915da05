"""Sunrise and sunset, against almanacs and against the same formulas in floats."""

import math
from datetime import date, datetime, timedelta

import numpy as np
import pytest

from fleet2d.runtime.clock import Sun

# Latitude, noon in the mean of the year by the clock, and sunrise and sunset in 2026 as almanacs have them.
ALMANAC = [
    ("Berlin", 52.52, 13 * 60 + 6.4, "2026-06-21", "04:43", "21:33"),
    ("Berlin", 52.52, 12 * 60 + 6.4, "2026-12-21", "08:15", "15:54"),
    ("London", 51.51, 13 * 60 + 0.5, "2026-06-21", "04:43", "21:21"),
    ("London", 51.51, 12 * 60 + 0.5, "2026-12-21", "08:04", "15:53"),
    ("New York", 40.71, 12 * 60 + 56, "2026-06-21", "05:25", "20:31"),
    ("New York", 40.71, 11 * 60 + 56, "2026-12-21", "07:17", "16:32"),
]


@pytest.mark.parametrize(("city", "latitude", "noon_min", "day", "rise", "fall"), ALMANAC)
def test_the_sun_rises_and_sets_as_in_almanacs(city, latitude, noon_min, day, rise, fall):
    sun = Sun(latitude, timedelta(minutes=noon_min))
    moments = sun.day(date.fromisoformat(day).toordinal())

    for moment, expected in zip(moments, (rise, fall), strict=True):
        off = moment - datetime.fromisoformat(f"{day}T{expected}")
        assert abs(off) <= timedelta(minutes=1.5), city


@pytest.mark.parametrize("latitude", [-65.0, -33.9, 0.0, 23.4, 52.5, 65.0])
def test_every_day_of_a_year_equals_the_formulas_in_floats(latitude):
    sun, first = Sun(latitude, timedelta(hours=12)), date(2026, 1, 1).toordinal()
    for ordinal in range(first, first + 365, 3):
        n = ordinal - date(2000, 1, 1).toordinal()
        g, mean = math.radians(357.528 + 0.9856003 * n), 280.46 + 0.9856474 * n
        true = math.radians(mean + 1.915 * math.sin(g) + 0.02 * math.sin(2 * g))
        eps, phi = math.radians(23.4393), math.radians(latitude)
        delta = math.asin(math.sin(eps) * math.sin(true))
        ascension = math.degrees(math.atan2(math.cos(eps) * math.sin(true), math.cos(true)))
        early = ((mean - ascension + 180) % 360 - 180) * 240
        height = math.sin(math.radians(-0.833)) - math.sin(phi) * math.sin(delta)
        half_day = math.degrees(math.acos(height / (math.cos(phi) * math.cos(delta)))) * 240
        noon = datetime.fromordinal(ordinal) + timedelta(hours=12, seconds=-early)
        slack = timedelta(seconds=30 if abs(latitude) < 60 else 120)

        rise, fall = sun.day(ordinal)
        assert abs(rise - (noon - timedelta(seconds=half_day))) < slack
        assert abs(fall - (noon + timedelta(seconds=half_day))) < slack


def test_a_night_lasts_from_sunset_to_sunrise():
    sun = Sun(52.5, timedelta(hours=12))
    ordinal = date(2026, 12, 31).toordinal()
    (rise, fall), (next_rise, next_fall) = sun.day(ordinal), sun.day(ordinal + 1)
    second = timedelta(seconds=1)

    assert [rise, None, None, next_rise, next_rise] == [
        sun.end_at(moment) for moment in (rise - second, rise, fall - second, fall, fall + second)
    ]
    assert [fall, next_fall, next_fall] == [
        sun.next_begin(moment) for moment in (fall - second, fall, next_rise)
    ]


def test_the_light_of_day_grows_for_an_hour_about_sunrise():
    sun = Sun(52.5, timedelta(hours=12))
    rise, fall = sun.day(date(2026, 6, 21).toordinal())
    half = timedelta(minutes=30)
    moments = [rise - half, rise, rise + half, fall - half, fall, fall + half, fall + 2 * half]

    shares = sun.shares(np.array(moments, "M8[us]"))

    assert [0, 0.5, 1, 1, 0.5, 0, 0] == shares.tolist()
