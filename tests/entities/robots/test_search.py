"""Orders of looks: the exact one is never beaten on its own model."""

from itertools import permutations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.reference.search import play
from tests.thorough import examples

from fleet2d.entities.robots.search import (
    MAX_EXACT_SITES,
    after_empty_looks,
    exact,
    greedy,
    likeliest_first,
    nearest_first,
    order_by,
    receding,
    search_problem,
)
from fleet2d.runtime.determinism import Draws, stream_key

DRAWS = Draws(stream_key(4, "robots.astro", "order"), 0)
HEURISTICS = (nearest_first, likeliest_first, greedy, receding)


@st.composite
def problems(draw, most=6):
    """Small searches: whole seconds, chances in per mill, not always somebody there."""
    count = draw(st.integers(1, most))
    seconds = st.integers(0, 60)
    weights = draw(st.lists(st.integers(0, 20), min_size=count + 1, max_size=count + 1))
    prior = np.array(weights[:count]) / max(sum(weights), 1)
    row = st.lists(seconds, min_size=count, max_size=count)
    return search_problem(
        prior,
        draw(row),
        draw(st.lists(row, min_size=count, max_size=count)),
        draw(row),
        draw(st.lists(st.sampled_from([0.3, 0.9, 1.0]), min_size=count, max_size=count)),
    )


@given(problems())
@settings(max_examples=examples(60))
def test_exact_order_is_the_best_of_all_orders(problem):
    costs = [play(problem, order).cost for order in permutations(range(len(problem.prior)))]
    assert play(problem, exact(problem)).cost == pytest.approx(min(costs), abs=1e-9)
    assert exact(problem) == receding(problem, horizon=8)


@given(problems(most=10))
@settings(max_examples=examples(60))
def test_every_policy_looks_at_every_site_once_and_none_beats_the_exact_one(problem):
    best = play(problem, exact(problem)).cost
    for name in ("random", "nearest", "likeliest", "greedy", "exact", "receding"):
        order = order_by(name, problem, DRAWS)
        assert list(range(len(problem.prior))) == sorted(order)
        assert best <= play(problem, order).cost + 1e-9


def test_searches_with_nothing_or_little_to_choose_from():
    nowhere = search_problem([0, 0, 0], [3, 1, 2], np.ones((3, 3)))
    assert 0 == play(nowhere, exact(nowhere)).cost
    alike = search_problem(np.full(4, 0.25), np.ones(4), np.ones((4, 4)))
    alone = search_problem([0.4], [7], [[0]], look=2)
    empty = search_problem([], [], np.zeros((0, 0)))
    for policy in (exact, *HEURISTICS):
        assert [0, 1, 2, 3] == policy(alike)  # ties go to the lower site
        assert [0] == policy(alone)
        assert [] == policy(empty)
    assert [9.0] == play(alone, [0]).time


def test_a_site_without_a_way_or_a_chance_comes_last():
    day = 86_400.0
    travel = np.array([[0, 5, day], [5, 0, day], [day, day, 0]])
    problem = search_problem([0.05, 0.05, 0.9], [5, 6, day], travel)
    assert 2 == exact(problem)[-1] == greedy(problem)[-1] == receding(problem)[-1]
    assert 2 == likeliest_first(problem)[0]  # which is why find drops those that it can't go to
    travel = np.array([[0, 1, 9], [1, 0, 9], [9, 9, 0]])
    assert [0, 2, 1] == exact(search_problem([0.5, 0.0, 0.5], [1, 1, 9], travel, look=3))


def test_each_heuristic_goes_by_what_it_says():
    travel = np.full((3, 3), 10.0)
    problem = search_problem([0.1, 0.3, 0.6], [1, 4, 30], travel)
    assert 0 == nearest_first(problem)[0]
    assert 2 == likeliest_first(problem)[0]
    assert 0 == greedy(problem)[0]  # 0.1 a second, beside 0.075 and 0.02


def test_sixteen_sites_are_solved_and_more_are_refused():
    rng = np.random.default_rng(4)
    places = rng.uniform(0, 10, (MAX_EXACT_SITES + 1, 2))
    travel = np.linalg.norm(places[:, None] - places, axis=-1)
    problem = search_problem(rng.dirichlet(np.ones(len(places))), travel[0], travel)
    with pytest.raises(ValueError, match="17 sites"):
        exact(problem)
    assert sorted(receding(problem)) == list(range(MAX_EXACT_SITES + 1))
    fewer = search_problem(problem.prior[:-1], travel[0, :-1], travel[:-1, :-1])
    best = play(fewer, exact(fewer)).cost
    assert best <= min(play(fewer, policy(fewer)).cost for policy in HEURISTICS)


def test_an_empty_look_fades_with_its_age():
    prior = np.array([0.5, 0.5])
    fresh = after_empty_looks(prior, np.array([0.0, np.inf]), 600, 0.8)
    older = after_empty_looks(prior, np.array([600.0, np.inf]), 600, 0.8)
    assert fresh.tolist() == pytest.approx([0.1, 0.5])
    assert older.tolist() == pytest.approx([0.3, 0.5])
    assert [0.5, 0.5] == after_empty_looks(prior, np.array([5.0, np.inf]), 0).tolist()


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"prior": [0.7, 0.7]}, "more than one"),
        ({"prior": [-0.1, 0.5]}, "prior has a value"),
        ({"reach": [1.0]}, "reach has shape"),
        ({"travel": [[0.0], [1.0]]}, "travel has shape"),
        ({"detect": 1.5}, "above one"),
        ({"look": float("nan")}, "look has a value"),
    ],
)
def test_problems_that_make_no_sense_are_refused(fields, words):
    usual = {"prior": [0.5, 0.5], "reach": [1, 1], "travel": np.ones((2, 2))}
    with pytest.raises(ValueError, match=words):
        search_problem(**{**usual, **fields})
