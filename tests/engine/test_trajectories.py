"""Trajectories: sampled as often as asked."""

import numpy as np
import pytest
from tests.scenes import everything, run, scenario, table

from fleet2d.errors import ScenarioError


def small(every):
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
