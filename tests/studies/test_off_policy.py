"""Off-policy estimates cover the truth as often as they claim, whatever policy was logged."""

from datetime import datetime, timedelta
from typing import Any

import numpy as np
import pytest
from tests.entities.robots.test_interact import PILL, ana, home
from tests.thorough import THOROUGH, some

import fleet2d
from fleet2d.errors import InputError
from fleet2d.interactions.answers import Answers, Circumstances
from fleet2d.interactions.attitude import AttitudeState
from fleet2d.interactions.interaction import Interaction, Outcome
from fleet2d.kernels import F64
from fleet2d.studies.off_policy import (
    LoggedOpportunities,
    doubly_robust,
    inverse_propensity,
    read_opportunities,
)

SONG = Interaction(do="offer", to="ana", every=timedelta(hours=1), worth=2)
ACTIVITIES = ("sleep", "breakfast", "work_at_home", "tv", "rest", "phone_call")
DAY, COUNT = datetime(2026, 1, 5, 8), 150
WORLDS = 1000 if THOROUGH else 150


def circumstances(activity: str) -> Circumstances:
    return Circumstances(
        DAY, "song", SONG, activity, "living_room", 0, False, False, 1.0, True, False
    )


def true_rates() -> F64:
    """The probability of a yes at each activity, by the model of answers itself."""
    answers, state = Answers(), AttitudeState(DAY)
    rates = []
    for activity in ACTIVITIES:
        now = circumstances(activity)
        noticed, available = (
            answers.chance("notice", now, state),
            answers.chance("available", now, state),
        )
        rates.append(noticed * available * answers.chance("accept", now, state))
    return np.array(rates)


def world(number: int) -> tuple[LoggedOpportunities, np.ndarray[Any, Any]]:
    """A log of random opportunities, answered by the model of answers; and their activities."""
    rng = np.random.default_rng(number)
    kinds = rng.integers(0, len(ACTIVITIES), COUNT)
    chance = rng.uniform(0.2, 0.8, len(ACTIVITIES))[kinds]
    asked = rng.uniform(size=COUNT) < chance
    answers, state = Answers(), AttitudeState(DAY)
    replies = [
        answers.reply(circumstances(ACTIVITIES[kind]), state, number, "users.ana", step)
        for step, kind in enumerate(kinds.tolist())
    ]
    said_yes = np.array([r is not None and r.outcome == Outcome.ACCEPTED for r in replies])
    steps = np.arange(COUNT)
    log = LoggedOpportunities(
        ["song ana"] * COUNT, steps, asked, chance, asked * said_yes, steps, COUNT
    )
    return log, kinds


@pytest.mark.slow
@pytest.mark.parametrize(
    "method", some(["robust with a wrong model", "weights", "normalized", "robust"], 2)
)
def test_intervals_cover_the_truth_as_often_as_they_claim(method: str) -> None:
    rates = true_rates()
    target = np.array([0.05, 0.9, 0.2, 0.7, 0.8, 0.1])
    hits, means = 0, []
    for number in range(WORLDS):
        log, kinds = world(number)
        truth = float((target * rates).mean())
        if method.startswith("robust"):
            model = rates[kinds] if method == "robust" else np.full(COUNT, 0.9)
            estimate = doubly_robust(log, target[kinds], model)
        else:
            estimate = inverse_propensity(log, target[kinds], normalized=method == "normalized")
        hits += estimate.low <= truth <= estimate.high
        means.append(estimate.mean)

    assert truth == pytest.approx(np.mean(means), abs=0.012)
    assert 0.95 == pytest.approx(hits / WORLDS, abs=0.015 if THOROUGH else 0.045)


def test_a_good_model_narrows_the_interval() -> None:
    log, kinds = world(1)
    target = np.full(COUNT, 0.9)
    weighted = inverse_propensity(log, target)
    robust = doubly_robust(log, target, true_rates()[kinds])

    assert robust.high - robust.low < 0.9 * (weighted.high - weighted.low)


def test_a_log_without_chance_is_refused() -> None:
    first = np.zeros(1, np.int64)
    log = LoggedOpportunities(["a b"], first, np.array([True]), np.zeros(1), np.zeros(1), first, 1)
    with pytest.raises(InputError, match="let the policy that is logged explore"):
        inverse_propensity(log, np.ones(1))


def test_a_log_without_opportunities_is_refused() -> None:
    log = read_opportunities(fleet2d.run(home("20 min")))
    with pytest.raises(InputError, match="the log has no opportunity"):
        inverse_propensity(log, [])


@pytest.mark.parametrize("target", [np.ones(3), np.full(COUNT, 1.2), np.full(COUNT, np.nan)])
def test_a_target_that_is_no_probability_of_each_opportunity_is_refused(target: F64) -> None:
    log, _ = world(1)
    with pytest.raises(InputError, match="a probability from 0 to 1 for each of 150 opportunities"):
        doubly_robust(log, target, 0.5)


@pytest.mark.parametrize("seed", range(3))
def test_a_day_counts_what_it_has_however_many_opportunities(seed: int) -> None:
    """Days with many opportunities differ from those with few: the interval is that of the days."""
    rng = np.random.default_rng(seed)
    days = 40
    day = np.repeat(np.arange(days), rng.choice([0, 2, 30], days))
    n = len(day)
    asked, said_yes = rng.uniform(size=n) < 0.5, rng.uniform(size=n) < 0.4
    log = LoggedOpportunities(
        ["a b"] * n, np.arange(n), asked, np.full(n, 0.5), asked * said_yes, day, days
    )
    told = doubly_robust(log, np.full(n, 0.9), 0.4)

    assert 0.9 * 0.4 * n / days == pytest.approx(told.mean, abs=0.8)
    per_day = np.bincount(day, minlength=days)
    assert told.error > 0.9 * 0.9 * 0.4 * per_day.std() / np.sqrt(days)


def test_opportunities_of_a_run_are_read_with_what_came_of_them() -> None:
    behaviors = [{"type": "interact", "timing": "when"}, {"type": "patrol"}]
    run = fleet2d.run(
        home(
            "3 h",
            users={"ana": ana(outcomes=("declined", "accepted"))},
            robots={"astro": {"behaviors": behaviors}},
            algorithms={
                "when": {"type": "timing", "policy": {"type": "thompson", "min_chance": 0.5}}
            },
            interactions={"pill": PILL | {"at": [], "every": "1 h"}},
            simulation={**home()["simulation"], "start": "2026-01-05T22:30", "duration": "3 h"},
        )
    )
    log = read_opportunities(run)

    assert {"pill ana"} == set(log.text)
    assert (np.diff(log.step) >= 0).all()
    assert ((log.chance >= 0) & (log.chance <= 1)).all()
    assert (log.reward[~log.asked] == 0).all()
    assert log.reward.sum() >= 1
    assert (2, {0, 1}) == (log.days, set(log.day))
