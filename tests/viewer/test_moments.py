"""Moments as people write them."""

from datetime import datetime

import pytest

from fleet2d.errors import InputError
from fleet2d.runtime.clock import Clock
from fleet2d.viewer.moments import step_of

CLOCK = Clock(datetime(2026, 1, 5, 6), 1_000_000, 10 * 86_400)
HOUR = 3600


@pytest.mark.parametrize(
    ("text", "step"),
    [
        ("day 1 06:00", 0),
        ("Day 3 18:30", int(60.5 * HOUR)),
        ("day 2", 18 * HOUR),
        ("2026-01-05T07:00:01", HOUR + 1),
        ("2026-01-06", 18 * HOUR),
        ("2 h", 2 * HOUR),
        ("1 d 2 h", 26 * HOUR),
        ("step 17", 17),
        ("10 d", 240 * HOUR),
    ],
)
def test_moment_is_read(text: str, step: int) -> None:
    assert step == step_of(text, CLOCK)


@pytest.mark.parametrize(
    "text", ["", "noon", "day 3 25:00", "day 3 10:99", "2026-01-05T07:00Z", "step x", "-2 h"]
)
def test_what_names_no_moment_is_refused_with_examples(text: str) -> None:
    with pytest.raises(InputError, match="day 3 18:30"):
        step_of(text, CLOCK)


@pytest.mark.parametrize("text", ["day 1 05:59", "day 99", "11 d", "2025-01-01", "step 9999999"])
def test_moment_outside_the_run_is_refused_with_its_dates(text: str) -> None:
    with pytest.raises(InputError, match="2026-01-05 06:00 to 2026-01-15 06:00"):
        step_of(text, CLOCK)
