"""When something of a script is done: times as people write them, and events."""

from datetime import datetime, timedelta

import pytest
from pydantic import TypeAdapter, ValidationError

from fleet2d.interventions.intervention import ClockTime, On, Trigger, When, parse_when
from fleet2d.runtime.clock import Clock
from fleet2d.runtime.events import Event

WHEN = TypeAdapter(When)
ON = TypeAdapter(On)
# A week from Monday noon on.
CLOCK = Clock(datetime(2026, 1, 5, 12), 1_000_000, 7 * 86_400)


@pytest.mark.parametrize(
    ("text", "days", "hours"),
    [
        ("19:00", range(7), 19),
        ("monday 07:30", [0], 7.5),
        ("weekdays 08:00", range(5), 8),
        ("friday,saturday 23:00", [4, 5], 23),
    ],
)
def test_a_time_of_day_may_have_days_before_it(text, days, hours):
    when = parse_when(text)
    assert (tuple(days), timedelta(hours=hours), text) == when


@pytest.mark.parametrize(
    ("text", "meaning"),
    [
        ("2026-01-07T14:00", datetime(2026, 1, 7, 14)),
        ("2026-01-07 14:00", datetime(2026, 1, 7, 14)),
        ("2026-01-07", datetime(2026, 1, 7)),
        ("2 d 14 h", timedelta(days=2, hours=14)),
        ("3600 s", timedelta(hours=1)),
    ],
)
def test_a_date_or_a_time_from_the_start_is_a_time(text, meaning):
    assert meaning == parse_when(text)


@pytest.mark.parametrize("text", ["noon", "25:00", "funday 19:00", "-1 h", "monday", "", None, []])
def test_what_is_no_time_is_refused(text):
    with pytest.raises(ValidationError):
        WHEN.validate_python(text)


@pytest.mark.parametrize("text", ["monday 07:30", "2026-01-07T14:00:00", "2 h"])
def test_a_time_is_written_as_it_is_read(text):
    assert text == WHEN.dump_python(WHEN.validate_python(text), mode="json")


@pytest.mark.slow
@pytest.mark.parametrize("text", ["11:00", "12:00", "monday 11:59:59", "weekend 00:00"])
def test_moments_of_a_clock_time_are_those_of_every_second_of_the_run(text):
    when = parse_when(text)
    assert isinstance(when, ClockTime)
    seconds = (CLOCK.time(step) for step in range(CLOCK.steps))
    expected = [
        moment
        for moment in seconds
        if moment.weekday() in when.days
        and moment - datetime.combine(moment.date(), datetime.min.time()) == when.time
    ]
    assert expected == list(when.moments(CLOCK))


@pytest.mark.parametrize(
    "written",
    ["user_seen", ["user_seen", "astro"], ["user_seen", "astro", "ana"], {"event": "user_seen"}],
)
def test_an_event_is_read_in_each_form_and_fits(written):
    trigger = ON.validate_python(written)
    assert trigger.fits(Event(3, "astro", "user_seen", "ana"))
    assert not trigger.fits(Event(3, "astro", "user_lost", "ana"))
    assert ON.validate_python(ON.dump_python(trigger, mode="json")) == trigger


def test_an_event_of_somebody_else_or_with_another_detail_does_not_fit():
    trigger = Trigger(event="activity", entity="ana", detail="dinner")
    assert not trigger.fits(Event(3, "ben", "activity", "dinner"))
    assert not trigger.fits(Event(3, "ana", "activity", "lunch"))


@pytest.mark.parametrize("written", [3, [], ["a", "b", "c", "d"], {"kind": "x"}, None])
def test_what_is_no_event_is_refused(written):
    with pytest.raises(ValidationError):
        ON.validate_python(written)
