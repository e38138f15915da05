"""Code shared by the results: intervals that contain the truth, and studies of months."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fleet2d.errors import ComponentError
from fleet2d.paper.months import PaperOptions, ignore_progress, interval, month, run_study


def test_intervals_hold_the_true_mean_as_often_as_they_say() -> None:
    samples = np.random.default_rng(5).exponential(1.0, (200, 40))
    hits = sum(low <= 1.0 <= high for _, low, high in map(interval, samples))
    # 95 % less what 40 skewed values miss: 0.90 to 0.97, within three standard errors of 200.
    assert 0.88 < hits / 200 < 0.98


def test_an_interval_holds_its_mean_and_is_the_same_each_time() -> None:
    values = [0.1, 0.4, 0.2, 0.9]
    mean, low, high = interval(values)
    assert mean == pytest.approx(0.4)
    assert low < mean < high
    assert (mean, low, high) == interval(values)


def days(**keys: Any) -> dict[str, Any]:
    robot = {"type": "patrol"}
    base = month(robot, algorithms={}, metrics={"sightings": {}}, days=1)
    return {"base": base, "axes": {"robots.astro.speed": [0.3, 0.6]}, **keys}


def test_progress_is_reported(tmp_path: Path) -> None:
    calls: list[tuple[str, int, int]] = []
    options = PaperOptions(workers=1, folder=tmp_path)
    run_study("days", days(), options, lambda *call: calls.append(call))
    assert [("months", done, 2) for done in range(3)] == calls[-3:]


def test_months_that_are_there_are_not_run_again(tmp_path: Path) -> None:
    options = PaperOptions(workers=1, folder=tmp_path)
    first = run_study("days", days(), options, ignore_progress)
    calls: list[tuple[str, int, int]] = []
    again = run_study("days", days(), options, lambda *call: calls.append(call))
    assert [("months", 2, 2)] == calls
    assert first.variants["digest"].to_list() == again.variants["digest"].to_list()


def test_a_month_that_fails_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(
        "from fleet2d import Metric\n"
        "class Fails(Metric):\n"
        "    def update(self, history, state):\n        raise ValueError('thirteen')\n"
    )
    own = {"type": f"{tmp_path.as_posix()}/mine:Fails"}
    rules = [{"set": {"metrics.own": own}}]
    with pytest.raises(ComponentError, match="thirteen"):
        run_study("days", days(rules=rules), PaperOptions(workers=1), ignore_progress)


def test_a_request_says_how_large_or_leaves_it() -> None:
    assert (30, 60) == PaperOptions().size(30, 60, 2, 3)
    assert (2, 3) == PaperOptions(quick=True).size(30, 60, 2, 3)
    assert (7, 3) == PaperOptions(quick=True, seeds=7).size(30, 60, 2, 3)
