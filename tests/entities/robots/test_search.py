"""Orders of looks: the exact one is never beaten on its own model."""

from itertools import permutations, product
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.reference.search import play
from tests.thorough import examples

from fleet2d.entities.robots.search import (
    MAX_EXACT_SITES,
    SearchProblem,
    after_empty_looks,
    exact,
    greedy,
    likeliest_first,
    nearest_first,
    order_by,
    random_order,
    receding,
    search_problem,
)
from fleet2d.runtime.determinism import Draws, stream_key

DRAWS = Draws(stream_key(4, "robots.astro", "order"), 0)
HEURISTICS = (nearest_first, likeliest_first, greedy, receding)


@st.composite
def problems(draw: Any, most: int = 6) -> SearchProblem:
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


@given(problems(most=10))
@settings(max_examples=examples(60))
def test_exact_order_is_never_beaten_by_a_heuristic(problem):
    best = play(problem, exact(problem)).cost
    for policy in HEURISTICS:
        assert best <= play(problem, policy(problem)).cost + 1e-9
    assert best <= play(problem, random_order(problem, DRAWS)).cost + 1e-9


@given(problems(most=5))
@settings(max_examples=examples(60))
def test_the_cost_of_an_order_is_the_mean_over_all_that_can_happen(problem):
    """Wherever the target is, and whichever looks would miss it: an account of its own."""
    order = exact(problem)
    mean, success = 0.0, 0.0
    for site, missed in product(range(len(order)), (False, True)):
        chance = problem.prior[site] * (
            1 - problem.detect[site] if missed else problem.detect[site]
        )
        seconds, at = 0.0, None
        for look in order:
            seconds += problem.reach[look] if at is None else problem.travel[at, look]
            seconds += problem.look[look]
            at = look
            if look == site and not missed:
                mean, success = mean + chance * seconds, success + chance
                break
    assert play(problem, order).cost == pytest.approx(mean, abs=1e-9)
    assert play(problem, order).success == pytest.approx(success, abs=1e-12)


@given(problems(most=7))
@settings(max_examples=examples(40))
def test_what_is_left_of_an_exact_order_is_exact_from_there(problem):
    """Bellman's principle: to decide anew after an empty look gives the same, if nobody moves."""
    order = exact(problem)
    first, rest = order[0], sorted(order[1:])
    after = search_problem(
        problem.prior[rest],
        problem.travel[first, rest],
        problem.travel[np.ix_(rest, rest)],
        problem.look[rest],
        problem.detect[rest],
    )
    went_on = [rest.index(site) for site in order[1:]]
    assert play(after, exact(after)).cost == pytest.approx(play(after, went_on).cost, abs=1e-9)


def test_searches_with_nothing_or_little_to_choose_from():
    nowhere = search_problem([0, 0, 0], [3, 1, 2], np.ones((3, 3)))
    assert 0 == play(nowhere, exact(nowhere)).cost
    assert [0, 1, 2] == exact(nowhere) == likeliest_first(nowhere)  # ties go to the lower site
    alike = search_problem(np.full(4, 0.25), np.ones(4), np.ones((4, 4)))
    for policy in (exact, *HEURISTICS):
        assert [0, 1, 2, 3] == policy(alike)
    alone = search_problem([0.4], [7], [[0]], look=2)
    for policy in (exact, *HEURISTICS):
        assert [0] == policy(alone)
    assert [9.0] == play(alone, [0]).time
    empty = search_problem([], [], np.zeros((0, 0)))
    for policy in (exact, *HEURISTICS):
        assert [] == policy(empty)


def test_a_site_without_a_way_comes_last_however_likely_it_is():
    day = 86_400.0
    travel = np.array([[0, 5, day], [5, 0, day], [day, day, 0]])
    problem = search_problem([0.05, 0.05, 0.9], [5, 6, day], travel)
    assert 2 == exact(problem)[-1] == greedy(problem)[-1] == receding(problem)[-1]
    assert 2 == likeliest_first(problem)[0]  # which is why find drops those that it can't go to


def test_a_site_where_nobody_is_waits_until_all_others_are_done():
    travel = np.array([[0, 1, 9], [1, 0, 9], [9, 9, 0]])
    problem = search_problem([0.5, 0.0, 0.5], [1, 1, 9], travel, look=3)
    assert [0, 2, 1] == exact(problem)


@given(problems(most=10))
@settings(max_examples=examples(60))
def test_every_policy_looks_at_every_site_once(problem):
    sites = list(range(len(problem.prior)))
    for name in ("random", "nearest", "likeliest", "greedy", "exact", "receding"):
        assert sites == sorted(order_by(name, problem, DRAWS))  # type: ignore[arg-type]


@given(problems(most=8))
@settings(max_examples=examples(40))
def test_a_horizon_that_holds_all_sites_is_exact(problem):
    assert exact(problem) == receding(problem, horizon=8)


def test_each_heuristic_goes_by_what_it_says():
    travel = np.full((3, 3), 10.0)
    problem = search_problem([0.1, 0.3, 0.6], [1, 4, 30], travel)
    assert 0 == nearest_first(problem)[0]
    assert 2 == likeliest_first(problem)[0]
    assert 0 == greedy(problem)[0]  # 0.1 a second, beside 0.075 and 0.02


def test_looks_that_may_miss_can_be_repeated():
    problem = search_problem([0.8], [10], [[0]], look=5, detect=0.5)
    outcome = play(problem, [0, 0, 0])
    assert [15.0, 20.0, 25.0] == outcome.time
    assert [0.4, 0.2, 0.1] == pytest.approx(outcome.chance)
    assert outcome.success == pytest.approx(0.7)


def test_sixteen_sites_are_solved_and_more_are_refused():
    rng = np.random.default_rng(4)
    places = rng.uniform(0, 10, (MAX_EXACT_SITES + 1, 2))
    travel = np.sqrt(((places[:, None] - places[None]) ** 2).sum(axis=-1))
    weights = rng.uniform(size=MAX_EXACT_SITES + 1)
    problem = search_problem(weights / weights.sum(), travel[0], travel)
    with pytest.raises(ValueError, match="17 sites"):
        exact(problem)
    fewer = SearchProblem(
        problem.prior[:-1], problem.reach[:-1], problem.travel[:-1, :-1],
        problem.look[:-1], problem.detect[:-1],
    )  # fmt: skip
    best = play(fewer, exact(fewer)).cost
    for policy in HEURISTICS:
        assert best <= play(fewer, policy(fewer)).cost
    assert sorted(receding(problem)) == list(range(MAX_EXACT_SITES + 1))


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
    usual: dict[str, Any] = {"prior": [0.5, 0.5], "reach": [1, 1], "travel": np.ones((2, 2))}
    with pytest.raises(ValueError, match=words):
        search_problem(**{**usual, **fields})
