"""Hidden Markov chains: against obvious twins, and against the truth they were drawn from."""

import numpy as np
import pytest
from tests.algorithms.presence.worlds import (
    DAY,
    DETECTION,
    MONDAY,
    any_evidence,
    bins_of,
    evidence,
    follow,
    hangout,
    patrol,
    person,
    pieces,
    shares_at_home,
    transitions,
)
from tests.homes import needs_jit
from tests.reference import presence as slow

from fleet2d.algorithms.presence.chain import (
    Chain,
    Sensor,
    likelihood,
    missed,
    prior,
    unknown_seen,
    with_anyone,
)
from fleet2d.algorithms.presence.exposure_ratio import ExposureRatio
from fleet2d.algorithms.presence.likelihood import Likelihood, joined
from fleet2d.algorithms.presence.sighting_share import SightingShare
from fleet2d.metrics.presence.distances import total_variation


@pytest.mark.parametrize("seed", range(6))
def test_chance_of_a_miss_is_that_of_its_twin(seed: int) -> None:
    bins = any_evidence(seed)
    unknown = bins.seen[:, -1] > bins.seen[:, :-1].sum(axis=1)
    assert unknown.any()
    for user in range(2):
        found = missed(bins, user, None, Sensor(0.9, 0.1, 4))
        expected = slow.missed(
            bins.watched.tolist(), bins.seen[:, user].tolist(), unknown.tolist(), 6, 0.9, 0.1, 4
        )
        assert np.abs(found - np.array(expected)).max() < 1e-12


def test_evidence_in_pieces_says_the_same() -> None:
    bins, sensor = any_evidence(8), Sensor(0.9, 0.1, 4)
    first, rest = bins.part(0, 17), bins.part(17, 40)
    whole = likelihood(bins, 1, None, sensor)
    parts = [
        likelihood(first, 1, None, sensor),
        likelihood(rest, 1, (first.watched[-1], first.seen[-1]), sensor),
    ]
    assert np.array_equal(whole, np.concatenate(parts))


def test_who_was_seen_is_there_and_who_was_not_is_not_where_one_looked() -> None:
    bins = any_evidence(9, users=1)
    likely = likelihood(bins, 0, None, Sensor(0.95, 0.05))
    hit = bins.seen[:, 0].sum(axis=1) > 0
    most = bins.seen[hit, 0].argmax(axis=1)
    rows = likely[hit]
    assert (rows[np.arange(len(rows)), most] > 50 * rows[:, -1]).all()
    assert (likely[~hit, -1] == 1).all()
    known = ~unknown_seen(bins)
    seen_nowhere = (bins.watched == 0) & ~hit[:, None]
    assert (likely[:, :-1][seen_nowhere] == 1).all()
    watched = (bins.watched == 1) & ~hit[:, None] & known
    assert (likely[:, :-1][watched] <= 0.06).all()


def test_somebody_unknown_is_no_evidence_against_a_user() -> None:
    bins = any_evidence(10, users=1)
    bins.seen[:, 0] = 0
    bins.seen[:, 1, 0] = 6
    likely = likelihood(bins, 0, None, Sensor(0.95, 0.05))
    assert (likely[:, 0] == 1).all()


@pytest.mark.parametrize("stages", [1, 2, 3])
def test_before_anything_is_learned_stays_are_passed_in_stages(stages: int) -> None:
    found = prior(2, stages)
    assert np.abs(found.sum(axis=1) - 1).max() < 1e-12
    by_place = found.reshape(3, stages, 3, stages)
    for place in range(3):
        for other in {0, 1, 2} - {place}:
            assert (by_place[place, :, other, 1:] == 0).all()  # a stay begins with the first
            assert (by_place[place, :, other, 0] > 0).all()
        assert (np.tril(by_place[place, :, place], -1) == 0).all()


def test_anyone_is_where_not_everybody_is_missing() -> None:
    one, other = np.array([[0.5, 0.25, 0.25]]), np.array([[0.5, 0.0, 0.5]])
    found = with_anyone([one, other], np.zeros((1, 2), bool))[0]
    assert [0.75, 0.25, 0.125] == found[2].tolist()
    found = with_anyone([one, other], np.array([[False, True]]))[0]
    assert [0.75, 1.0, 0.0] == found[2].tolist()


def learn(estimator, found, rooms: int, users: int = 1):
    estimator.begin(rooms, users)
    for part in pieces(bins_of(found), 240):
        estimator.observe(part)
    return estimator.presence([f"u{i}" for i in range(users)], MONDAY)


def test_what_was_learned_after_a_day_is_one_step_of_all_days_by_hand() -> None:
    """Smoothing and maximization of one day, by the twin that sums over all paths of each window."""
    where = person(DAY + 1, 2, 3, dwell=10)
    estimator = Likelihood()
    found = evidence(where, 2, patrol, 3)
    learn(estimator, found, 2)
    bins = bins_of(found).part(0, DAY)
    likely = likelihood(bins, 0, None, Sensor(0.95, 0.05, 30))
    transition = prior(2, 1)
    chain = Chain(2, 1)
    for _ in range(1 + 4):  # the day itself, and the first time through all days
        pairs = np.zeros((3, 3))
        alpha, beta = [np.full(3, 1 / 3)], [np.ones(3)]
        for row in likely:
            now = (alpha[-1] @ transition) * row
            alpha.append(now / now.sum())
        for row in likely[::-1]:
            ahead = transition @ (row * beta[-1])
            beta.append(ahead / ahead.sum())
        beta = beta[::-1]
        gamma = np.array([a * b / (a * b).sum() for a, b in zip(alpha, beta, strict=True)])
        for t, row in enumerate(likely):
            both = alpha[t][:, None] * transition * (row * beta[t + 1])
            pairs += both / both.sum()
        counts = pairs + 30 * chain.prior
        transition = counts / counts.sum(axis=1, keepdims=True)
    assert np.abs(transition - estimator.chains[0].transition).max() < 1e-9
    assert np.abs(gamma[1:].sum(axis=0) - estimator.counts.by_day[0, 0, :3]).max() < 1e-6


@needs_jit
def test_transitions_and_shares_are_those_the_person_was_drawn_from() -> None:
    """60 days and independent looks: the model is right, so only sampling is left.

    A room left some 300 times has a chance to leave with a standard error of 6 % of it, if all was
    seen: 20 % are 3 of these. When somebody who is away comes and goes is never seen: 45 %.
    """
    for seed in (0, 1):
        truth = transitions(4, seed)
        where = person(60 * DAY, 4, seed)
        estimator = Likelihood(detection=DETECTION)
        presence = learn(estimator, evidence(where, 4, patrol, seed), 4)
        found = estimator.chains[0].transition
        leave, estimate = 1 - np.diagonal(truth), 1 - np.diagonal(found)
        bound = np.array([0.2, 0.2, 0.2, 0.2, 0.45])
        assert (np.abs(estimate - leave) < bound * leave).all()
        assert total_variation(shares_at_home(where, 4), presence.share("u0")) < 0.03
        assert np.mean(where == 4) == pytest.approx(presence.away("u0"), abs=0.03)


@needs_jit
def test_sighting_share_collapses_under_hangout_and_likelihood_holds() -> None:
    """Robots that hang out where they saw somebody most: the rich get richer (6 runs of 30 days).

    Of 12 runs each the means were .65 and .10, with standard errors of .024 and .017: of 6, bounds
    of .45 and .2 are more than 4 standard errors away.
    """
    errors = []
    for seed in range(6):
        where = person(30 * DAY, 5, seed)
        found, truth = evidence(where, 5, hangout, seed), shares_at_home(where, 5)
        errors.append(
            [
                total_variation(truth, learn(estimator, found, 5).share("u0"))
                for estimator in (SightingShare(), ExposureRatio(), Likelihood())
            ]
        )
    naive, ratio, full = np.mean(errors, axis=0)
    assert naive > 0.45
    assert ratio < 0.25
    assert full < 0.2
    assert (np.array(errors)[:, 0] > np.array(errors)[:, 2]).all()


@needs_jit
def test_exposure_ratio_is_biased_by_following_and_likelihood_holds() -> None:
    """Robots that stay while they see the person: rooms left at once are watched too little."""
    errors = []
    for seed in range(4):
        where = person(30 * DAY, 5, seed)
        found, truth = evidence(where, 5, follow, seed), shares_at_home(where, 5)
        errors.append(
            [
                total_variation(truth, learn(estimator, found, 5).share("u0"))
                for estimator in (ExposureRatio(), Likelihood())
            ]
        )
    ratio, full = np.mean(errors, axis=0)
    assert full < 0.02
    assert ratio > 3 * full


@needs_jit
def test_independent_patrol_is_fair_to_all() -> None:
    for seed in range(2):
        where = person(30 * DAY, 5, seed)
        found, truth = evidence(where, 5, patrol, seed), shares_at_home(where, 5)
        for estimator in (SightingShare(), ExposureRatio(), Likelihood(), Likelihood(stages=2)):
            assert total_variation(truth, learn(estimator, found, 5).share("u0")) < 0.08


def test_pieces_of_evidence_join_to_the_whole() -> None:
    bins = any_evidence(11)
    whole = joined(pieces(bins, 7))
    for one, other in zip(bins, whole, strict=True):
        assert np.array_equal(one, other)
