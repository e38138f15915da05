"""What the results share: intervals that hold the truth, and months that don't mind each other."""

import numpy as np
import pytest

from fleet2d.paper import ltp_gap
from fleet2d.paper.months import Request, cores, interval, run_all, silent

ONE_DAY = [ltp_gap.robot_month(number, 1) for number in range(3)]


def doubled(number: int) -> int:
    if number == 13:
        raise ValueError("13")
    return 2 * number


def test_intervals_hold_the_true_mean_as_often_as_they_say() -> None:
    drawn = np.random.default_rng(5).exponential(1.0, (600, 40))
    held = sum(low <= 1.0 <= high for _, low, high in map(interval, drawn))
    # 95 % less what 40 skewed values miss: 0.90 to 0.97, within four standard errors of 600.
    assert 0.88 < held / 600 < 0.98


def test_an_interval_holds_its_mean_and_is_the_same_each_time() -> None:
    values = [0.1, 0.4, 0.2, 0.9]
    mean, low, high = interval(values)
    assert mean == pytest.approx(0.4)
    assert 0.1 <= low < mean < high <= 0.9
    assert (mean, low, high) == interval(values)


def test_all_is_run_in_order_and_told_of() -> None:
    told: list[tuple[str, int, int]] = []
    found = run_all(
        doubled, [3, 1, 2], Request(), lambda what, done, of: told.append((what, done, of)), "cases"
    )
    assert [6, 2, 4] == found
    assert [("cases", done, 3) for done in range(4)] == told


def test_what_goes_wrong_in_a_process_is_raised_here() -> None:
    with pytest.raises(ValueError, match="13"):
        run_all(doubled, [1, 13, 2, 3], Request(workers=2), silent)


def test_months_are_the_same_whatever_the_number_of_processes() -> None:
    alone = run_all(ltp_gap.gaps, ONE_DAY, Request(workers=1), silent)
    assert alone == run_all(ltp_gap.gaps, ONE_DAY, Request(workers=2), silent)


def test_a_request_says_how_large_or_leaves_it() -> None:
    assert (30, 60) == Request().size(30, 60, 2, 3)
    assert (2, 3) == Request(quick=True).size(30, 60, 2, 3)
    assert (7, 3) == Request(quick=True, seeds=7).size(30, 60, 2, 3)
    assert cores() >= 1
