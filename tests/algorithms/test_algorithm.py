"""Outputs of algorithms."""

import numpy as np
import pytest

from fleet2d import RoomDistribution
from fleet2d.algorithms.algorithm import to_columns
from fleet2d.errors import ComponentError


def test_weights_become_shares_that_sum_to_one():
    assert [0.5, 0.25, 0.25, 0.0] == RoomDistribution([2, 1, 1, 0]).share.tolist()


def test_no_weight_at_all_is_uniform():
    assert [0.25] * 4 == RoomDistribution(np.zeros(4)).share.tolist()


def test_a_distribution_does_not_change_with_the_weights_it_came_from():
    weights = np.array([1.0, 1.0])
    distribution = RoomDistribution(weights)
    weights[0] = 99
    assert [0.5, 0.5] == distribution.share.tolist()


@pytest.mark.parametrize("weights", [[], [[1, 2]], 3, [1, -1], [1, np.nan], [1, np.inf]])
def test_what_is_no_distribution_is_refused(weights):
    with pytest.raises(ComponentError, match="room distribution"):
        RoomDistribution(weights)


def test_a_distribution_becomes_a_row_per_room():
    columns = to_columns(RoomDistribution([3, 1]), ["hall", "bath"], "algorithms.a")
    assert {"room": ["hall", "bath"], "share": [0.75, 0.25]} == {
        k: v.tolist() for k, v in columns.items()
    }


@pytest.mark.parametrize(
    ("value", "kind"),
    [(1, "i"), (1.5, "f"), (True, "b"), ("word", "O"), (np.float32(2), "f"), ([], "f")],
)
def test_scalars_and_lists_become_columns_of_their_kind(value, kind):
    assert kind == to_columns({"x": value}, [], "algorithms.a")["x"].dtype.kind


@pytest.mark.parametrize(
    "value", [np.zeros((2, 2)), None, object(), {"a": 1}, [None, 1], ["a", 1.5, None], 1j]
)
def test_unknown_columns_are_refused(value):
    with pytest.raises(ComponentError, match=r"algorithms\.a returned 'x'"):
        to_columns({"x": value}, [], "algorithms.a")
