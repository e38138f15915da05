"""Local time against the standard library, minute by minute, in nights in which clocks change."""

import copy
import pickle
from datetime import UTC, datetime, time, timedelta
from zoneinfo import ZoneInfo

import numpy as np
import pytest
from tests.change_nights import CHANGED_RULES, DAY, MINUTE, ZONES, nights
from tests.thorough import some

from fleet2d.entities.behavior import parse_span
from fleet2d.expectations.expectation import RunSignals
from fleet2d.expectations.temporal import _period_begins
from fleet2d.expectations.vocabulary import during
from fleet2d.interventions.intervention import parse_when
from fleet2d.runtime.clock import Clock, midnight_of, next_midnight
from fleet2d.runtime.local_time import LocalTime, Zone, written, zone_of

MINUTES = 24 * 60
WINDOWS = (
    "02:15-02:45",
    "01:30-02:30",
    "22:00-03:10",
    "00:00-24:00",
    "23:30-00:15",
    "sunday 00:00-02:30",
)

NIGHTS = [night for zone in ZONES for night in nights(zone)]
NIGHTS += [night for zone, year in CHANGED_RULES for night in nights(zone, year)]


def clock_of(night, minutes=MINUTES):
    """Return the clock of a run of steps of a minute."""
    begin = night.begin.replace(tzinfo=None)
    zone = zone_of(night.zone, begin, begin + minutes * MINUTE)
    return Clock(zone.at(night.begin), 60_000_000, minutes)


def test_forty_zones_are_compared():
    """In the northern and the southern hemisphere, with two nights each, or none."""
    assert len(ZONES) == len(set(ZONES)) == 40
    assert len(NIGHTS) > 60


@pytest.mark.parametrize("night", some(NIGHTS, 2), ids=str)
def test_clock_reads_as_the_standard_library_each_minute(night):
    """Fields, offset and fold; texts, readings and stamps of tables; and each moment of a reading."""
    clock = clock_of(night)
    expected = [night.reading(minute) for minute in range(MINUTES)]
    moments = [clock.time(minute) for minute in range(MINUTES)]
    assert [str(moment) for moment in moments] == [str(each) for each in expected]
    assert [moment.fold for moment in moments] == [each.fold for each in expected]
    steps = np.arange(MINUTES)
    assert clock.texts(steps) == [each.isoformat() for each in expected]
    assert clock.times(steps).tolist() == [each.replace(tzinfo=None) for each in expected]
    utc = [each.astimezone(UTC).replace(tzinfo=None) for each in expected]
    assert clock.stamps(steps).tolist() == utc
    assert [clock.elapsed(moment) for moment in moments] == (steps * clock.step_us).tolist()


@pytest.mark.parametrize("night", some(NIGHTS, 2), ids=str)
def test_written_time_is_the_first_minute_that_reads_so_or_later_after_a_gap(night):
    """Each minute of the local night that one may write, by a search through the real ones."""
    clock = clock_of(night)
    readings = [night.reading(minute).replace(tzinfo=None) for minute in range(MINUTES)]
    first = readings[0]
    latest = max(readings)
    at = {}
    for minute, reading in enumerate(readings):
        at.setdefault(reading, minute)
    by_reading = sorted(at)
    for ahead in range((latest - first) // MINUTE + 1):
        wanted = first + ahead * MINUTE
        if wanted not in at:  # the next one that is read
            wanted = next(reading for reading in by_reading if reading > wanted)
        step = clock.step_at_or_after(clock.elapsed(first + ahead * MINUTE))
        assert step == at[wanted], first + ahead * MINUTE


@pytest.mark.parametrize("night", some(NIGHTS, 2), ids=str)
def test_hours_hold_while_the_clock_reads_a_time_within_them(night):
    """Of behaviors and expectations, with their ends and the next begin."""
    clock = clock_of(night)
    ends = MINUTES * clock.step_us
    for window in WINDOWS:
        span = parse_span(window)
        begin, end = span.begin, span.end
        inside = []
        for minute in range(MINUTES):
            reading = night.reading(minute).replace(tzinfo=None)
            days = (datetime.combine(reading, time()) - back * DAY for back in (0, 1))
            inside.append(
                any(d.weekday() in span.days and d + begin <= reading < d + end for d in days)
            )
        for minute in range(0, MINUTES, 53):
            moment = clock.time(minute)
            over = span.end_at(moment)
            assert (over is not None) == inside[minute], (window, moment)
            if over is not None and window != "00:00-24:00":
                later = next((k for k in range(minute, MINUTES) if not inside[k]), None)
                assert min(clock.elapsed(over), ends) == (later or MINUTES) * clock.step_us
            begins = [k for k in range(minute + 1, MINUTES) if inside[k] and not inside[k - 1]]
            starts = span.next_begin(moment)
            if window != "00:00-24:00":
                assert min(clock.elapsed(starts), ends) == min([*begins, MINUTES]) * clock.step_us
        days = None if len(window.split()) == 1 else window.split()[0]
        condition = during(window.split()[-1], days=days)
        trace = condition.trace(RunSignals({}, {}, 0, MINUTES, True, clock))
        assert trace.values(np.arange(MINUTES)).tolist() == [float(each) for each in inside]


@pytest.mark.parametrize("night", some(NIGHTS, 2), ids=str)
def test_hours_days_and_weeks_of_expectations_begin_by_the_clock(night):
    """A day that is begun again, as a clock is put back, is the same one; an hour is another."""
    clock = clock_of(night)
    readings = [night.reading(minute).replace(tzinfo=None) for minute in range(MINUTES)]
    midnights = [datetime.combine(reading, time()) for reading in readings]
    periods = {
        "hour": [reading.replace(minute=0) for reading in readings],
        "day": midnights,
        "week": [midnight - midnight.weekday() * DAY for midnight in midnights],
    }
    for per, begun in periods.items():
        expected = []
        latest = begun[0]
        for k in range(1, MINUTES):
            is_hour = per == "hour" and not readings[k].minute
            if begun[k] > latest or is_hour:
                expected.append(k)
            latest = max(latest, begun[k])
        assert _period_begins(RunSignals({}, {}, 0, MINUTES, True, clock), per) == expected, per


@pytest.mark.parametrize("night", some(NIGHTS, 2), ids=str)
def test_daily_time_of_a_script_is_once_a_day(night):
    """Also at a time that doesn't exist, or exists twice: then it is the first of both."""
    clock = clock_of(night, 3 * MINUTES)
    readings = [night.reading(minute).replace(tzinfo=None) for minute in range(3 * MINUTES)]
    for text in ("00:00", "00:30", "02:30", "03:00", "23:30"):
        when = parse_when(text)
        steps = {clock.step_at_or_after(clock.elapsed(m)) for m in when.moments(clock)}  # type: ignore[union-attr]
        expected = set()
        for date in sorted({reading.date() for reading in readings}):
            wanted = datetime.combine(date, time.fromisoformat(text))
            exact = [k for k, reading in enumerate(readings) if reading == wanted]
            later = [k for k in range(1, len(readings)) if readings[k - 1] < wanted < readings[k]]
            expected.update(exact[:1] or later[:1])
        assert steps - {0} == expected - {0}, text


def test_real_time_passes_over_a_change():
    """Durations, differences and comparisons are of real time; what is written, is read."""
    berlin = zone_of("Europe/Berlin", datetime(2026, 10, 24), datetime(2026, 10, 26))
    before = berlin.at(datetime(2026, 10, 25, 2, 50))
    after = before + timedelta(minutes=20)
    assert after.isoformat() == "2026-10-25T02:10:00+01:00"
    assert after - before == timedelta(minutes=20)
    assert after > before
    assert after != before.replace(minute=10)
    assert min(after, before) is before
    assert after > datetime(2026, 10, 25, 2, 59)  # written, which is the first
    assert datetime(2026, 10, 25, 3) - before == timedelta(minutes=70)
    assert before == datetime(2026, 10, 25, 0, 50, tzinfo=UTC)
    assert berlin.at(datetime.fromisoformat("2026-10-25T02:50+01:00")) - before == timedelta(
        hours=1
    )
    assert after.replace(minute=20).isoformat() == "2026-10-25T02:20:00+01:00"
    assert after.astimezone(UTC) == datetime(2026, 10, 25, 1, 10, tzinfo=UTC)
    assert after.timestamp() == 1792890600.0
    assert (midnight_of(after), written(after).hour) == (datetime(2026, 10, 25), 2)
    for again in (pickle.loads(pickle.dumps(after)), copy.deepcopy(after)):
        assert (again, again.fold, type(again)) == (after, 1, LocalTime)


def test_next_midnight_is_later_where_the_clock_reads_it_twice():
    """In Newfoundland it was put back at 00:01, to 23:01 of the day before."""
    night = nights("America/St_Johns", 2010)[1]
    clock = clock_of(night)
    for minute in range(MINUTES - 120):
        moment = clock.time(minute)
        assert clock.elapsed(next_midnight(moment)) > minute * clock.step_us


def test_zone_is_stored_with_the_offsets_that_were_used():
    """A run needs no rules of the machine that reads it."""
    zone = zone_of("Europe/Berlin", datetime(2026, 3, 1), datetime(2026, 11, 1))
    assert zone.record == {
        "name": "Europe/Berlin",
        "standard_s": 3600,
        "offset_s": 3600,
        "changes": [["2026-03-29T01:00:00Z", 7200], ["2026-10-25T01:00:00Z", 3600]],
    }
    again = Zone.of_record(zone.record)
    assert (again.changes_us, again.offsets_us) == (zone.changes_us, zone.offsets_us)


def test_new_year_in_the_last_time_zone_comes_at_noon_of_utc():
    """Days, weeks and years are those of the home."""
    zone = zone_of("Etc/GMT+12", datetime(2026, 12, 31), datetime(2027, 1, 2))
    clock = Clock(zone.at(datetime(2026, 12, 31, 23, 59)), 60_000_000, 3)
    steps = np.arange(3)
    assert clock.texts(steps)[1] == "2027-01-01T00:00:00-12:00"
    assert clock.stamps(steps)[1] == np.datetime64("2027-01-01T12:00")
    assert ZoneInfo("Etc/GMT+12").utcoffset(datetime(2027, 1, 1)) == timedelta(hours=-12)
