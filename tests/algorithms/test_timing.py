"""Timing: what is learned from answers, by each policy, and how the robot keeps to it."""

import numpy as np
import pytest
from tests.entities.robots.test_interact import PILL, ana, events_of, home
from tests.scenes import digests, table

import fleet2d
from fleet2d.algorithms.timing import (
    Asked,
    FixedTimes,
    LogisticTiming,
    ThompsonTiming,
    TwoStageTiming,
)
from fleet2d.errors import ComponentError

ROOMS, KITCHEN, BEDROOM = 3, 0, 1


def taught(policy, count=30):
    """Teach a policy that it is welcome in the kitchen at 8, and never at 14 in the bedroom."""
    policy.start(ROOMS)
    for _ in range(count):
        policy.learn(Asked("ana", "tea", 8, KITCHEN, "accepted"))
        policy.learn(Asked("ana", "tea", 14, BEDROOM, "declined"))
    return policy


@pytest.mark.parametrize("policy", [LogisticTiming(), ThompsonTiming()])
def test_a_learner_asks_when_it_is_welcome_and_not_when_it_is_not(policy):
    chances = taught(policy).chances()

    assert (24, ROOMS) == chances.shape
    assert chances[8, KITCHEN] > 0.95
    assert chances[14, BEDROOM] < 0.05
    assert chances[9, KITCHEN] >= chances[14, KITCHEN]


def test_a_greedy_learner_never_learns_of_an_unlucky_hour_again():
    """The feedback loop: it asks only where a yes is likely, and so never sees a better answer."""
    greedy, exploring = LogisticTiming(), LogisticTiming(explore=0.1)
    for policy in (greedy, exploring):
        policy.start(ROOMS)
        for _ in range(3):
            policy.learn(Asked("ana", "tea", 8, KITCHEN, "declined"))

    assert 0 == greedy.chances()[8, KITCHEN]
    assert 0.1 == exploring.chances()[8, KITCHEN]


def test_thompson_learns_who_has_time_from_other_interactions():
    policy = ThompsonTiming()
    policy.start(ROOMS)
    for _ in range(10):
        policy.learn_from_other(Asked("ana", "pill", 8, KITCHEN, "declined"))
        policy.learn_from_other(Asked("ana", "pill", 14, KITCHEN, "ignored"))
    chances = policy.chances()

    assert chances[8, KITCHEN] > 0.9
    assert chances[14, KITCHEN] < 0.1


def experienced(worth, yeses, noes, **settings):
    """The chance at 8 in the kitchen of a policy that had some yeses there, and noes with time."""
    policy = TwoStageTiming(**settings)
    policy.start(ROOMS)
    policy.worth = worth
    for number in range(yeses + noes):
        answer = "accepted" if number < yeses else "declined"
        policy.learn(Asked("ana", "tea", 8, KITCHEN, answer))
    return float(policy.chances()[8, KITCHEN])


def test_what_is_worth_little_is_asked_only_where_a_yes_is_nearly_sure():
    assert experienced(5, 10, 10) > 0.9
    assert experienced(1.5, 10, 10) < 0.1
    assert experienced(1.5, 20, 0) > 0.9
    assert 0.02 == experienced(0, 20, 0)


def test_who_never_agrees_is_asked_at_no_hour_and_who_has_no_time_at_that_hour():
    policy = TwoStageTiming()
    policy.start(ROOMS)
    policy.worth = 5
    for _ in range(20):
        policy.learn_from_other(Asked("ana", "pill", 8, KITCHEN, "ignored"))
        policy.learn_from_other(Asked("ana", "pill", 18, KITCHEN, "declined"))
    assert policy.chances()[8, KITCHEN] < 0.1 < 0.9 < policy.chances()[18, KITCHEN]

    for _ in range(20):
        policy.learn(Asked("ana", "tea", 18, KITCHEN, "declined"))
    assert policy.chances()[:, KITCHEN].max() < 0.1


def test_a_policy_knows_what_the_interaction_is_worth():
    class Greedy(FixedTimes):
        """Asks only for what is worth more than 3."""

        def chances(self):
            return np.full((24, self.rooms), float(self.worth > 3))

    run = fleet2d.run(timed(Greedy(), "5 h", users={"ana": ana(outcomes=("declined",))}))
    assert {1.0} == set(table(run, "when")["chance"])  # the pill is worth 4


def test_thompson_explores_less_the_more_it_knows():
    few, many = (taught(ThompsonTiming(min_chance=0.0), count).chances() for count in (1, 40))

    assert 0.05 < few[14, BEDROOM] < 0.6
    assert many[14, BEDROOM] < 0.01


def test_fixed_times_learn_nothing():
    policy = taught(FixedTimes(hours=(7, 8)))
    expected = np.zeros((24, ROOMS))
    expected[[7, 8]] = 1
    assert np.array_equal(expected, policy.chances())


def timed(policy, duration="3 h", **changes):
    behaviors = [{"type": "interact", "timing": "when"}, {"type": "patrol"}]
    return home(
        duration,
        robots={"astro": {"behaviors": behaviors}},
        algorithms={"when": {"type": "timing", "policy": policy}},
        interactions={"pill": PILL | {"at": [], "every": "1 h", "within": "1 h"}},
        **changes,
    )


def test_answers_reach_the_learner_and_its_chances_reach_the_robot():
    policy = {"type": "thompson", "ask_at": 0.5}
    run = fleet2d.run(timed(policy, users={"ana": ana(outcomes=("declined",))}))
    rows = table(run, "when")
    last = rows["step"] == rows["step"].max()
    asked_in = {
        (r, int(h))
        for r, h, c in zip(
            rows["room"][last], rows["hour"][last], rows["chance"][last], strict=True
        )
        if c < 0.45
    }

    assert any("kitchen" in str(room) for room, _ in asked_in)
    assert {7, 8, 9} & {hour for _, hour in asked_in}
    assert "opportunity" in {event for _, event in events_of(run, "opportunity")}


def test_outside_of_the_fixed_times_nobody_is_asked():
    run = fleet2d.run(timed({"type": "fixed_times", "hours": []}, "5 h"))
    asks = [step for step, _ in events_of(run, "asks")]

    assert len(asks) <= 1  # before the first answer there is no experience


def test_spans_are_invisible_to_the_learner():
    content = timed("thompson", "2 h")
    content["users"]["ana"] = ana() | {"answers": {"defers": 0.5}}
    other = {**content, "simulation": {**content["simulation"], "max_span": 7}}
    assert digests(fleet2d.run(content)) == digests(fleet2d.run(other))


def test_hours_that_no_day_has_are_refused():
    for hour in (-1, 24):
        with pytest.raises(ValueError, match="hours"):
            FixedTimes(hours=(hour,))


def test_an_algorithm_without_chances_of_asking_is_refused_as_timing():
    behavior = {"type": "interact", "timing": "ltp"}
    content = home("1 h", robots={"astro": {"behaviors": [behavior]}})
    content["algorithms"] = {"ltp": {"type": "long_term_presence", "period": "10 min"}}
    with pytest.raises(ComponentError, match="output of 'ltp' has no chances of asking"):
        fleet2d.run(content)
