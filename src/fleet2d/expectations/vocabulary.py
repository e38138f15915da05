"""The words that expectations are written in, in Python and in scenarios alike."""

from datetime import timedelta

from pydantic_core import PydanticCustomError

from fleet2d.configuration.problems import did_you_mean
from fleet2d.configuration.units import parse_duration, parse_time_of_day, weekdays_of
from fleet2d.errors import InputError
from fleet2d.expectations import counting, quantities, signals, states, temporal
from fleet2d.expectations.expectation import Expectation
from fleet2d.expectations.quantities import Place

Time = str | float | timedelta
"""How long: text such as "2 min", seconds, or a timedelta."""


# When something must hold


def always(expectation: Expectation, *, within: Time | None = None) -> Expectation:
    """Expect a condition at every step, until the end of the run or for `within`."""
    return temporal.Always(_part(expectation, "always"), _time(within, "within"))


def never(expectation: Expectation, *, within: Time | None = None) -> Expectation:
    """Expect a condition at no step, until the end of the run or for `within`."""
    return temporal.Never(_part(expectation, "never"), _time(within, "within"))


def eventually(expectation: Expectation, *, within: Time | None = None) -> Expectation:
    """Expect a condition at some step, before the end of the run or `within` some time."""
    return temporal.Eventually(_part(expectation, "eventually"), _time(within, "within"))


def at_end(expectation: Expectation) -> Expectation:
    """Expect a condition at the last step of the run."""
    return temporal.AtEnd(_part(expectation, "at_end"))


def until(hold: Expectation, goal: Expectation, *, within: Time | None = None) -> Expectation:
    """Expect `hold` at every step until `goal` holds, and `goal` in time."""
    parts = _part(hold, "until"), _part(goal, "until")
    return temporal.Until(*parts, _time(within, "within"))


def after(
    trigger: Expectation, expectation: Expectation, *, within: Time | None = None
) -> Expectation:
    """Expect a condition each time that `trigger` begins: at once, or `within` some time.

    Each event counts by itself; conditions that last, such as being in a room, count each time that
    they begin. Occasions whose time isn't over when the run ends don't count.
    """
    parts = _part(trigger, "after"), _part(expectation, "after")
    return temporal.After(*parts, _time(within, "within"))


def holds_for(expectation: Expectation, duration: Time) -> Expectation:
    """Condition that a condition has held for at least `duration`."""
    least = _time(duration, "holds_for")
    assert least is not None
    return counting.HoldsFor(_part(expectation, "holds_for"), least)


def count(expectation: Expectation, *, per: str | None = None) -> signals.Signal:
    """Return how often a condition has begun: this hour, day or week, or in the run so far."""
    if per is not None and per not in counting.PERIODS:
        raise InputError(
            f"count: per is {per!r}{did_you_mean(per, counting.PERIODS)} There are: hour, day, week"
        )
    return counting.Count(_part(expectation, "count"), per)


def at_most(times: int, expectation: Expectation, *, per: str | None = None) -> Expectation:
    """Expect a condition to begin at most `times` times: each hour, day or week, or in the run."""
    if type(times) is not int or times < 0:
        raise InputError(
            f"at_most: the number of times must be a whole number, 0 or more, not {times!r}"
        )
    count(expectation, per=per)
    return counting.AtMost(times, expectation, per)


# Numbers


def distance(body: str, other: Place) -> signals.Signal:
    """Return how far a body is from another one, a room, an object or a point [m]."""
    return quantities.DistanceSignal(body, other)


def speed(body: str) -> signals.Signal:
    """Return how fast a body goes [m/s]."""
    return quantities.SpeedSignal(body)


def battery(robot: str) -> signals.Signal:
    """Return the charge of a robot, 0 to 1; compare with a share, such as "10 %"."""
    return quantities.BatterySignal(robot)


def output(path: str) -> signals.Signal:
    """Return a number of an algorithm's newest output, such as "ltp.kitchen"."""
    return quantities.OutputSignal(path)


def probability(algorithm: str, room: str, user: str | None = None) -> signals.Signal:
    """Return an algorithm's probability of a room, for a user if it has one for each."""
    return quantities.OutputSignal(".".join(part for part in (algorithm, user, room) if part))


def metric(path: str) -> signals.Signal:
    """Return a number of a metric's result so far, by the names in its result."""
    return quantities.MetricSignal(path)


# Words


def room(body: str) -> signals.WordSignal:
    """Return the room that a body is in, for `room("ana") == "kitchen"`: a name, or a type."""
    return states.RoomSignal(body)


def activity(user: str) -> signals.WordSignal:
    """Return what a user does, for `activity("ana") == "sleep"`."""
    return states.ActivitySignal(user)


# Conditions


def moving(body: str) -> Expectation:
    """Condition that a body moves."""
    return states.IsMoving(body)


def away(body: str) -> Expectation:
    """Condition that a body is away from home."""
    return states.IsAway(body)


def seen(body: str, by: str) -> Expectation:
    """Condition that the owner of a camera counts a body as seen, until it has lost it."""
    return states.IsSeen(body, by)


def in_view(body: str, by: str) -> Expectation:
    """Condition that a body truly is in view of a camera, noticed or not."""
    return states.IsInView(body, by)


def perceived(body: str, by: str) -> Expectation:
    """Condition that a robot perceives a user at a step, correctly or not."""
    return states.IsPerceived(body, by)


def door(name: str) -> Expectation:
    """Condition that a door is open."""
    return states.IsOpen(name)


def sensor(name: str) -> Expectation:
    """Condition that a sensor is on."""
    return states.IsOn(name)


def events(kind: str, entity: str | None = None, *, detail: str | None = None) -> Expectation:
    """Condition that an event of a kind happens, optionally only to an entity or with a detail."""
    return states.EventHappens(kind, entity, detail)


def during(hours: str, *, days: str | None = None) -> Expectation:
    """Condition that the time is within some hours, such as "22:00-07:00", on some days.

    Args:
        hours: From when to when; past midnight if the second is the earlier one.
        days: Names of days, "weekdays" or "weekends", separated by commas; None: every day.
    """
    try:
        begin, separator, end = hours.partition("-")
        if not separator:
            raise InputError(f"during({hours!r}): write from when to when, like '22:00-07:00'")
        times = parse_time_of_day(begin.strip()), parse_time_of_day(end.strip())
        names = [name.strip() for name in days.split(",")] if days else "daily"
        return states.IsDuring(*times, frozenset(weekdays_of(names)), (hours, days))
    except PydanticCustomError as error:
        raise InputError(f"during: {error}") from None


def _time(value: Time | None, name: str) -> timedelta | None:
    try:
        return None if value is None else parse_duration(value)
    except PydanticCustomError as error:
        raise InputError(f"{name}: {error}") from None


def _part(expectation: object, word: str) -> Expectation:
    if isinstance(expectation, Expectation):
        return expectation
    raise InputError(
        f"{word}: {expectation} is not a condition, which holds or doesn't: compare it, as in"
        ' distance("ana", "astro") > 0.5, or room("ana") == "kitchen"'
    )
