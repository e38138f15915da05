"""The likelihood estimator: against the truth that people were drawn from, under each robot."""

from dataclasses import replace

import numpy as np
import pytest
from tests.algorithms.presence.worlds import (
    DAY,
    DETECTION,
    MONDAY,
    any_evidence,
    counts_of,
    evidence,
    evidence_of,
    follow,
    hangout,
    patrol,
    person,
    pieces,
    shares_at_home,
    transitions,
)

from fleet2d.algorithms.presence.belief import with_anyone
from fleet2d.algorithms.presence.estimator import SightingShare
from fleet2d.algorithms.presence.exposure_ratio import AuditOnly, ExposureRatio
from fleet2d.algorithms.presence.likelihood import Likelihood
from fleet2d.algorithms.presence.people import day_evidence, joined
from fleet2d.metrics.ltp_error import total_variation


def test_anyone_is_where_not_everybody_is_missing():
    one, other = np.array([[0.5, 0.25, 0.25]]), np.array([[0.5, 0.0, 0.5]])
    combined = with_anyone([one, other], np.zeros((1, 2), bool))[0]
    assert [0.75, 0.25, 0.125] == combined[2].tolist()
    combined = with_anyone([one, other], np.array([[False, True]]))[0]
    assert [0.75, 1.0, 0.0] == combined[2].tolist()


def test_observations_of_no_user_are_unknown():
    bins = any_evidence(10, users=1)
    seen = np.zeros_like(bins.seen)
    seen[3, 1, 2] = 6
    bins = replace(bins, sightings=counts_of(seen))
    assert [[3, 2]] == np.argwhere(bins.sightings.unknown).tolist()


def learn(estimator, collected, rooms, users=1):
    estimator.begin(rooms, users)
    for part in pieces(collected, 240):
        estimator.observe(part)
    return estimator.presence([f"u{i}" for i in range(users)], MONDAY)


@pytest.mark.slow
def test_stays_and_shares_are_those_the_person_was_drawn_from():
    """60 days and independent looks: the model is right, so only sampling is left.

    A room left some 300 times has a chance to leave with a standard error of 6 % of it, if all was
    seen: 20 % are 3 of these. When somebody who is away comes and goes is never seen: 45 %.
    """
    for seed in (0, 1):
        truth = transitions(4, seed)
        where = person(60 * DAY, 4, seed)
        estimator = Likelihood(detection=DETECTION, together=1)
        presence = learn(estimator, evidence(where, 4, patrol, seed), 4)
        leave, estimate = 1 - np.diagonal(truth), 1 - estimator.people.model.stay[0]
        bound = np.array([0.2, 0.2, 0.2, 0.2, 0.45])
        assert (np.abs(estimate - leave) < bound * leave).all()
        assert total_variation(shares_at_home(where, 4), presence.share("u0")) < 0.03
        assert np.mean(where == 4) == pytest.approx(presence.away("u0"), abs=0.03)


@pytest.mark.slow
def test_sighting_share_fails_under_hangout_but_likelihood_does_not():
    """Robots that hang out where they saw somebody most: the rich get richer (6 runs of 30 days).

    Of 12 runs each the means were .65 and .10, with standard errors of .024 and .017: of 6, bounds
    of .45 and .2 are more than 4 standard errors away.
    """
    errors = []
    for seed in range(6):
        where = person(30 * DAY, 5, seed)
        collected, truth = evidence(where, 5, hangout, seed), shares_at_home(where, 5)
        errors.append(
            [
                total_variation(truth, learn(estimator, collected, 5).share("u0"))
                for estimator in (SightingShare(), ExposureRatio(), Likelihood())
            ]
        )
    naive, ratio, full = np.mean(errors, axis=0)
    assert naive > 0.45
    assert ratio < 0.25
    assert full < 0.2
    assert (np.array(errors)[:, 0] > np.array(errors)[:, 2]).all()


@pytest.mark.slow
def test_following_biases_exposure_ratio_but_not_likelihood():
    """Robots that stay while they see the person: rooms left at once are watched too little."""
    errors = []
    for seed in range(4):
        where = person(30 * DAY, 5, seed)
        collected, truth = evidence(where, 5, follow, seed), shares_at_home(where, 5)
        errors.append(
            [
                total_variation(truth, learn(estimator, collected, 5).share("u0"))
                for estimator in (ExposureRatio(), Likelihood())
            ]
        )
    ratio, full = np.mean(errors, axis=0)
    assert full < 0.02
    assert ratio > 3 * full


def audits(t, at, sees_person, sightings, random):
    """Go through the rooms by the clock for 15 minutes every other hour, else follow."""
    return (
        t // 3 % len(sightings) if t % 120 < 15 else follow(t, at, sees_person, sightings, random)
    )


@pytest.mark.slow
def test_audits_by_the_clock_find_the_truth_whatever_the_robot_does_in_between():
    """60 days have 720 looks at each room, timed by the clock: shares have errors of 0.02 at most.

    The total variation of five rooms is then about 0.02, and above 0.06 not once in 10,000 times.
    """
    for seed in range(4):
        where = person(60 * DAY, 5, seed)
        collected, truth = evidence(where, 5, audits, seed), shares_at_home(where, 5)
        audited, all_looks = (
            total_variation(truth, learn(estimator, collected, 5).share("u0"))
            for estimator in (AuditOnly(), ExposureRatio())
        )
        assert audited < 0.06
        assert all_looks > 2 * audited


def test_pieces_of_a_day_join_to_the_whole():
    day = any_evidence(11).days[1]
    whole = joined([day_evidence(piece) for piece in pieces(day, 7)])
    for one, other in zip(day_evidence(day), whole, strict=True):
        assert np.array_equal(one, other)


@pytest.mark.slow
def test_intervals_contain_the_truth_at_least_as_often_as_stated():
    """Ten days of a patrol, 20 runs of 4 rooms and away: 90 % intervals hold 96 %.

    Were each covered with 0.9, fewer than 80 of 100 would be once in a thousand times; all of them
    once in 40,000 times, but what follows from doubling the variance isn't 0.9.
    """
    held, wide = [], []
    for seed in range(20):
        where = person(10 * DAY, 4, seed)
        estimator = Likelihood()
        learn(estimator, evidence(where, 4, patrol, seed), 4)
        low, high = estimator.interval(np.uint64(0), 0.9)
        at_home, away = shares_at_home(where, 4), np.mean(where == 4)
        truth = np.append(at_home, away)
        held.append((low[0] <= truth) & (truth <= high[0]))
        wide.append(high[0] - low[0])
    assert np.mean(held) > 0.8
    assert np.mean(wide) < 0.15


def two_of_four(t, at, sees, sightings, random):
    """Ten bins in one of the first two rooms, then another of them at random."""
    return int(random.integers(2)) if t % 10 == 0 else at


def with_islands(bins, island):
    """The same evidence in a home whose rooms are in these parts."""
    return replace(bins, by_patch=bins.by_patch._replace(island=np.array(island)))


def a_week_of_two_rooms(seed, island):
    """Learn of a person who uses two rooms of four; return also the truth, and the error."""
    where = person(7 * DAY, 2, seed)
    where[where == 2] = 4
    bins, estimator = evidence(where, 4, two_of_four, seed), Likelihood()
    estimator.begin(4, 1)
    for part in pieces(bins if island is None else with_islands(bins, island), 240):
        estimator.observe(part)
    truth = np.append(shares_at_home(where, 4), np.mean(where == 4))
    share = estimator.presence(["u0"], MONDAY).share("u0")
    return estimator, truth, total_variation(truth[:4], share)


def test_time_out_of_sight_is_away_if_nothing_joins_the_other_rooms():
    """Rooms that no robot can look into look like away, so that each got as much time as away."""
    for seed in (0, 1, 2):
        apart, truth, error = a_week_of_two_rooms(seed, [0, 0, 2, 3])
        home, away = apart.presence(["u0"], MONDAY).share("u0"), truth[4]
        assert [0, 0] == home[2:].tolist()
        assert away == pytest.approx(apart.presence(["u0"], MONDAY).away("u0"), abs=0.03)
        assert error < 0.04
        unknown, _, _ = a_week_of_two_rooms(seed, None)
        at_large = unknown.presence(["u0"], MONDAY)
        assert at_large.with_away("u0")[2] == pytest.approx(at_large.away("u0"), rel=1e-6)


def test_intervals_hold_the_time_that_may_be_in_rooms_never_watched():
    for seed in (0, 1, 2):
        estimator, truth, _ = a_week_of_two_rooms(seed, [0, 0, 0, 0])
        low, high = estimator.interval(np.uint64(0), 0.9)
        assert ((low[0] <= truth) & (truth <= high[0])).all()
        assert (high[0, 2:] > 0.9 * truth[4]).all()
        apart = a_week_of_two_rooms(seed, [0, 0, 2, 3])[0].interval(np.uint64(0), 0.9)
        assert [0, 0] == apart[1][0, 2:4].tolist()
        assert apart[1][0, 4] - apart[0][0, 4] < high[0, 4] - low[0, 4]


def test_a_part_of_the_home_counts_from_when_a_robot_looks_into_it():
    """Later a robot is carried to the other part, and the person, too."""
    where = np.repeat([0, 2], 2 * DAY)
    watched = np.eye(4)[where]
    seen = np.repeat((watched > 0).astype(np.int64)[:, None], 2, axis=1)
    bins = with_islands(evidence_of(watched, seen), [0, 0, 2, 2])
    estimator = Likelihood()
    estimator.begin(4, 1)
    for part in pieces(bins, 360):
        estimator.observe(part)
    assert np.abs(estimator.presence(["u0"], MONDAY).share("u0") - [0.5, 0, 0.5, 0]).max() < 0.02
