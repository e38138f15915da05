"""Days of the week by name."""

from typing import get_args

import pytest
from pydantic_core import PydanticCustomError

from fleet2d.configuration.units import GROUPS, WEEKDAYS, Days, weekdays_of


def test_every_name_that_a_scenario_may_give_stands_for_days() -> None:
    assert (*GROUPS, *WEEKDAYS) == get_args(Days)
    assert set(range(7)) == weekdays_of("daily") == weekdays_of(WEEKDAYS)
    assert weekdays_of("daily") == weekdays_of(("weekdays", "weekend"))


def test_monday_is_the_first_day() -> None:
    assert [{day} for day in range(7)] == [weekdays_of(name) for name in WEEKDAYS]


def test_unknown_day_is_told_with_the_known() -> None:
    with pytest.raises(PydanticCustomError, match="unknown day 'mondy'; there are: daily, "):
        weekdays_of(["weekend", "mondy"])
