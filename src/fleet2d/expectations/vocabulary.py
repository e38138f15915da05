"""The words that expectations are written in, in Python and in scenarios alike."""

from datetime import timedelta

from pydantic_core import PydanticCustomError

from fleet2d.errors import InputError
from fleet2d.expectations import counting, quantities, signals, states, temporal
from fleet2d.expectations.expectation import Expectation
from fleet2d.expectations.quantities import Place
from fleet2d.problems import did_you_mean
from fleet2d.units import parse_duration, parse_time_of_day
from fleet2d.weekdays import weekdays_of

Time = str | float | timedelta
"""How long: text such as "2 min", seconds, or a timedelta."""


# When something must hold


def always(expectation: Expectation, *, within: Time | None = None) -> Expectation:
    """Expect something at every step, from now on to the end of the run, or for so long."""
    return temporal.Always(_part(expectation, "always"), _time(within, "within"))


def never(expectation: Expectation, *, within: Time | None = None) -> Expectation:
    """Expect something at no step, from now on to the end of the run, or for so long."""
    return temporal.Never(_part(expectation, "never"), _time(within, "within"))


def eventually(expectation: Expectation, *, within: Time | None = None) -> Expectation:
    """Expect something at some step, before the run ends, or so much time has passed."""
    return temporal.Eventually(_part(expectation, "eventually"), _time(within, "within"))


def at_end(expectation: Expectation) -> Expectation:
    """Expect something at the last step of the run."""
    return temporal.AtEnd(_part(expectation, "at_end"))


def until(hold: Expectation, goal: Expectation, *, within: Time | None = None) -> Expectation:
    """Expect something at every step until something else holds, which it must, in time."""
    parts = _part(hold, "until"), _part(goal, "until")
    return temporal.Until(*parts, _time(within, "within"))


def after(
    trigger: Expectation, expectation: Expectation, *, within: Time | None = None
) -> Expectation:
    """Expect something each time that something else begins: at once, or in time.

    Each event counts by itself; of what lasts, such as being in a room, each time that it begins.
    What is still open when the run ends doesn't count.
    """
    parts = _part(trigger, "after"), _part(expectation, "after")
    return temporal.After(*parts, _time(within, "within"))


def holds_for(expectation: Expectation, duration: Time) -> Expectation:
    """Say that something has held for at least so long."""
    longest = _time(duration, "holds_for")
    assert longest is not None
    return counting.HoldsFor(_part(expectation, "holds_for"), longest)


def count(expectation: Expectation, *, per: str | None = None) -> signals.Signal:
    """Return how often something has begun so far: this hour, day or week, or at all."""
    if per is not None and per not in counting.PERIODS:
        raise InputError(
            f"count: per is {per!r}{did_you_mean(per, counting.PERIODS)} There are: hour, day, week"
        )
    return counting.Count(_part(expectation, "count"), per)


def at_most(times: int, expectation: Expectation, *, per: str | None = None) -> Expectation:
    """Expect that something begins so many times at most: each hour, day or week, or at all."""
    if type(times) is not int or times < 0:
        raise InputError(f"at_most: {times!r} times: a whole number, 0 or more, is wanted first")
    count(expectation, per=per)
    return counting.AtMost(times, expectation, per)


# Numbers


def distance(body: str, other: Place) -> signals.Signal:
    """Return how far a body is from another one, a room, an object or a point [m]."""
    return quantities.Distance(body, other)


def speed(body: str) -> signals.Signal:
    """Return how fast a body goes [m/s]."""
    return quantities.Speed(body)


def battery(robot: str) -> signals.Signal:
    """Return the charge of a robot, 0 to 1; compare with a share, such as "10 %"."""
    return quantities.Battery(robot)


def output(path: str) -> signals.Signal:
    """Return a number of what an algorithm put out last, such as "ltp.kitchen"."""
    return quantities.Output(path)


def probability(algorithm: str, room: str, user: str | None = None) -> signals.Signal:
    """Return the probability that an algorithm gives a room, of a user where it tells users."""
    return quantities.Output(".".join(part for part in (algorithm, user, room) if part))


def metric(path: str) -> signals.Signal:
    """Return what a metric has come to so far, by the names that its result has."""
    return quantities.MetricValue(path)


# Words


def room(body: str) -> signals.WordSignal:
    """Return the room that a body is in, for `room("ana") == "kitchen"`: a name, or a type."""
    return states.RoomOf(body)


def activity(user: str) -> signals.WordSignal:
    """Return what a user does, for `activity("ana") == "sleep"`."""
    return states.ActivityOf(user)


# What is so or not


def moving(body: str) -> Expectation:
    """Say that a body moves."""
    return states.Moving(body)


def away(body: str) -> Expectation:
    """Say that a body is not at home."""
    return states.Away(body)


def seen(body: str, by: str) -> Expectation:
    """Say that a camera's owner counts somebody as seen, until it has lost them."""
    return states.Seen(body, by)


def in_view(body: str, by: str) -> Expectation:
    """Say that somebody really is in view of a camera, noticed or not."""
    return states.InView(body, by)


def perceived(body: str, by: str) -> Expectation:
    """Say that a robot perceives somebody at a step, rightly or wrongly."""
    return states.Perceived(body, by)


def door(name: str) -> Expectation:
    """Say that a door is open."""
    return states.DoorOpen(name)


def sensor(name: str) -> Expectation:
    """Say that a sensor is on."""
    return states.SensorOn(name)


def events(kind: str, entity: str | None = None, *, detail: str | None = None) -> Expectation:
    """Say that an event happens: of a kind, to somebody or anybody, with a detail or any."""
    return states.Happens(kind, entity, detail)


def during(hours: str, *, days: str | None = None) -> Expectation:
    """Say that it is a time of day, such as "22:00-07:00", on days such as "weekdays" or all."""
    try:
        begin, separator, end = hours.partition("-")
        if not separator:
            raise InputError(f"during({hours!r}): write from when to when, like '22:00-07:00'")
        times = parse_time_of_day(begin.strip()), parse_time_of_day(end.strip())
        names = [name.strip() for name in days.split(",")] if days else "daily"
        return states.During(*times, frozenset(weekdays_of(names)), (hours, days))
    except PydanticCustomError as error:
        raise InputError(f"during: {error}") from None


def _time(value: Time | None, what: str) -> timedelta | None:
    try:
        return None if value is None else parse_duration(value)
    except PydanticCustomError as error:
        raise InputError(f"{what}: {error}") from None


def _part(expectation: object, word: str) -> Expectation:
    if isinstance(expectation, Expectation):
        return expectation
    raise InputError(
        f"{word}: {expectation} is nothing that holds or doesn't: compare it, as in"
        ' distance("ana", "astro") > 0.5, or room("ana") == "kitchen"'
    )
