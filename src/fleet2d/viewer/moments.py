"""Moments as people write them: ``day 3 18:30``, ``2026-01-07T18:30``, ``2 d 14 h``, ``step 9``."""

import re
from datetime import datetime, timedelta

from pydantic_core import PydanticCustomError

from fleet2d.configuration.units import micros, parse_duration
from fleet2d.errors import InputError
from fleet2d.runs.run import Run
from fleet2d.runtime.clock import Clock, midnight_of

_DAY = re.compile(r"day (\d+)(?:[ ,]+(\d{1,2}):(\d{2})(?::(\d{2}))?)?", re.IGNORECASE)
_STEP = re.compile(r"step (\d+)", re.IGNORECASE)


def step_of(text: str, clock: Clock, option: str = "--at") -> int:
    """Return the step that a text names; the end of the run is the number of its steps.

    Args:
        text: ``day 3 18:30`` (day 1 is the date of the start), a local time, a time since the
            start, or ``step 5000``.
        clock: The clock of the run.
        option: The option that has the text as its value, for messages.

    Raises:
        InputError: The text names no moment, or one outside the run.

    Example:
        >>> clock = Clock(datetime(2026, 1, 5, 6), 1_000_000, 10 * 86_400)
        >>> step_of("day 1 06:00:30", clock), step_of("2026-01-05T07:00", clock)
        (30, 3600)
        >>> step_of("2 h", clock), step_of("step 9", clock)
        (7200, 9)
    """
    elapsed = _elapsed_us(text.strip(), clock)
    if elapsed is None:
        raise InputError(
            f"{option} {text!r} names no moment: write 'day 3 18:30', '2026-01-07T18:30', a time"
            " since the start such as '2 d 14 h', or 'step 5000'"
        )
    step = clock.step_at_or_after(elapsed)
    if not 0 <= step <= clock.steps:
        begin, end = clock.start, clock.time(clock.steps)
        raise InputError(
            f"{option} {text!r} is not within the run, which lasts from {begin:%Y-%m-%d %H:%M} to"
            f" {end:%Y-%m-%d %H:%M}"
        )
    return step


def clock_of(run: Run) -> Clock:
    """Return the clock of a stored run."""
    manifest = run.manifest
    return Clock(datetime.fromisoformat(manifest["start"]), manifest["step_us"], manifest["steps"])


def steps_of(run: Run, begin: str | None, end: str | None) -> tuple[int, int]:
    """Return the first step of a part of a run, and the step before which it ends.

    Args:
        run: The run.
        begin: A text as for `step_of`; None for the start of the run.
        end: A text as for `step_of`; None for the end of the run.

    Raises:
        InputError: A text names no moment of the run, or the part is empty.
    """
    clock = clock_of(run)
    first = 0 if begin is None else step_of(begin, clock, "--from")
    last = clock.steps if end is None else step_of(end, clock, "--to")
    if first >= last:
        raise InputError(f"--from {begin} is not before --to {end}: there is nothing to show")
    return first, last


def _elapsed_us(text: str, clock: Clock) -> int | None:
    if step := _STEP.fullmatch(text):
        return int(step[1]) * clock.step_us
    if day := _DAY.fullmatch(text):
        parts = [int(part or 0) for part in day.groups()[1:]]
        if parts[0] > 24 or parts[1] > 59 or parts[2] > 59 or len(day[1]) > 6:
            return None
        midnight = midnight_of(clock.start)
        since = timedelta(days=int(day[1]) - 1, hours=parts[0], minutes=parts[1], seconds=parts[2])
        return clock.elapsed(midnight) + micros(since)
    try:
        moment = datetime.fromisoformat(text)
    except ValueError:
        return _duration_us(text)
    return None if moment.tzinfo is not None else clock.elapsed(moment)


def _duration_us(text: str) -> int | None:
    try:
        return micros(parse_duration(text))
    except (PydanticCustomError, ValueError):
        return None
