"""Trajectories: sampled as often as asked."""

from typing import Any

import numpy as np
import pytest
from tests.scenes import everything, run, scenario, table

from fleet2d.errors import ScenarioError


def small(every: Any) -> dict[str, Any]:
    return scenario(
        "30 min",
        users={"ana": {"type": "meander"}, "ben": {"type": "meander"}},
        artifacts={"trajectories": every},
    )


@pytest.mark.parametrize(
    ("every", "steps"),
    [("1 min", 60), ("10 min", 600), ("every step", 1), ("1 s", 1), ("90 s", 90)],
)
def test_trajectories_are_stored_as_often_as_asked(every, steps):
    rows = table(run(small(every)), "trajectories", entity="ben")
    assert list(range(0, 1800, steps)) == rows["step"].tolist()


def test_what_is_sampled_rarely_is_part_of_what_is_sampled_often():
    often, rarely = (table(run(small(every)), "trajectories") for every in ("every step", "3 min"))
    kept = often["step"] % 180 == 0
    for column, values in rarely.items():
        assert often[column][kept].tolist() == values.tolist()


def test_an_interval_that_is_no_multiple_of_the_step_is_refused():
    with pytest.raises(ScenarioError, match=r"artifacts\.trajectories.*multiple"):
        run(small("1.5 s"))


def test_where_somebody_away_is_is_not_told():
    truth = table(run(everything("2 h")), "trajectories", entity="ana")
    gone = truth["away"]
    assert gone.any()
    assert np.isnan(truth["x"][gone]).all()
    assert not np.isnan(truth["x"][~gone]).any()
    assert all(room is None or room != room for room in truth["room"][gone])
