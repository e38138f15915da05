"""Random streams addressed by step, and sums that are the same in every version of Python."""

import builtins
import sys
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from tests.thorough import some

import fleet2d
from fleet2d.runtime.determinism import Draws, stream_key, sum_in_order


def test_every_seed_path_and_purpose_has_a_stream_of_its_own():
    paths = ["users.ana", "users.ben", "users.anax", "robots.ana", ""]
    keys = {
        int(stream_key(*key)) for key in product([0, 1, 4, 2**63 - 1], paths, ["spot", "x", ""])
    }
    assert 4 * 5 * 3 == len(keys)
    assert stream_key(1, "users.ana", "x") != stream_key(11, "sers.ana", "x")
    assert stream_key(1, "users.a", "nax") != stream_key(1, "users.ana", "x")


def test_keys_are_the_same_on_every_machine():
    assert 0xB2018C82EE74584F == int(stream_key(4, "users.ana", "spot"))
    draws = Draws(stream_key(4, "users.ana", "spot"), 0)
    assert [3, 4, 4, 3, 4] == [draws.below(6) for _ in range(5)]


def test_draws_of_one_step_do_not_depend_on_how_many_were_taken_at_another():
    key = stream_key(4, "users.ana", "spot")
    first, second = (Draws(key, 8) for _ in range(2))
    greedy = Draws(key, 7)
    other = [greedy.below(100) for _ in range(1000)]
    drawn = [first.below(100) for _ in range(5)]
    assert drawn == [second.below(100) for _ in range(5)] != other[:5]


def test_draws_below_are_even():
    counts = np.bincount(
        [Draws(stream_key(1, "p", "q"), step).below(7) for step in range(14_000)], minlength=7
    )
    assert 7 == len(counts)
    assert ((counts - 2000) ** 2 / 2000).sum() < 22.5  # chi squared, 6 degrees of freedom, 0.1 %


def test_every_order_of_a_shuffle_is_as_likely():
    counts = {}
    for step in range(6000):
        order = tuple(Draws(stream_key(2, "p", "q"), step).shuffled("abc"))
        counts[order] = counts.get(order, 0) + 1
    assert 6 == len(counts)
    assert sum((n - 1000) ** 2 / 1000 for n in counts.values()) < 20.5  # 5 degrees, 0.1 %


def test_a_choice_is_one_of_the_items():
    chosen = {Draws(stream_key(2, "p", "q"), step).choice("abc") for step in range(50)}
    assert {"a", "b", "c"} == chosen


@pytest.mark.parametrize("bound", [0, -1, 2**31])
def test_a_bound_that_can_not_be_is_refused(bound):
    with pytest.raises(ValueError, match="bound"):
        Draws(stream_key(1, "p", "q"), 0).below(bound)


EXAMPLES = Path(__file__).parents[2] / "examples"


def test_floats_are_added_one_after_the_other():
    values = [1e16, 1.0, -1e16, 0.1]
    assert sum_in_order(values) == ((1e16 + 1.0) - 1e16) + 0.1 == 0.1


@pytest.mark.parametrize(
    "scenario",
    some(
        [
            [None],
            [EXAMPLES / "family.yaml"],
            [EXAMPLES / "learning_robot.yaml"],
            [EXAMPLES / "smart_home.yaml"],
            [None, "floorplan={type: synthetic, area_m2: 60}"],
        ],
        3,
    ),
)
def test_a_run_adds_no_floats_by_the_built_in_sum(scenario, monkeypatch):
    """The mover's distance of the bundled month had another last digit in Python 3.13 than in 3.11."""
    calls = set()
    built_in = builtins.sum

    def checked(values, start=0):
        total = built_in(values, start)
        caller = sys._getframe(1)
        if type(total) is float and caller.f_globals["__name__"].startswith("fleet2d"):
            calls.add(f"{caller.f_code.co_filename}:{caller.f_lineno}")
        return total

    monkeypatch.setattr(builtins, "sum", checked)
    fleet2d.run(*scenario, "simulation.duration=1 d", seed=4)
    assert not calls
