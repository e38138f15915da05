"""Population: what many people do at each hour is what the survey found."""

import copy
import statistics
from collections import Counter
from datetime import date
from itertools import pairwise

import pytest
from tests.routines.days import MONDAY
from tests.scenes import scenario
from tests.thorough import THOROUGH

from fleet2d.engine.simulation import Simulation
from fleet2d.errors import InputError
from fleet2d.routines import survey
from fleet2d.routines.interruptions import without_interruptions
from fleet2d.routines.planner import RESUMES

HOUR = 3600


def users(count, **fields):
    return {f"user_{i}": {"type": "population", **fields} for i in range(count)}


def apart(counts, target):
    """The total variation distance of counted shares from the survey's."""
    total = sum(counts.values())
    return sum(abs(counts[c] / total - share) for c, share in target.items()) / 2


@pytest.mark.slow
def test_shares_of_many_people_follow_the_survey_hour_by_hour():
    simulation = Simulation(
        scenario("5 min", users=users(1000 if THOROUGH else 300, group="workers"))
    )
    counts = {}
    for actor in simulation.actors.values():
        for ordinal in range(MONDAY, MONDAY + 7):
            kind = "weekend" if date.fromordinal(ordinal).weekday() > 4 else "weekday"
            day = iter(without_interruptions(actor.behaviors[0].day(ordinal)))
            episode = next(day)
            for hour in range(4, 28):
                while episode.end <= hour * HOUR + HOUR // 2:
                    episode = next(day)
                counts.setdefault((kind, hour % 24), Counter())[episode.task] += 1
    distances = [
        apart(count, survey.shares("workers", kind)[hour]) for (kind, hour), count in counts.items()
    ]
    assert 48 == len(distances)
    assert statistics.median(distances) < 0.03
    assert max(distances) < 0.10


def test_days_follow_each_other_without_a_gap():
    actor = Simulation(scenario("5 min", users=users(1))).actors["user_0"]
    days = [actor.behaviors[0].day(MONDAY + i) for i in range(20)]
    for day, after in pairwise(days):
        assert all(one.end == other.begin for one, other in pairwise(day))
        assert all(episode.begin < episode.end for episode in day)
        assert (4 * HOUR, 28 * HOUR) == (day[0].begin, day[-1].end)
        assert 4 * HOUR == after[0].begin


def test_hardly_a_day_of_the_retired_has_no_meal_at_home():
    """Without what the survey doesn't record, as eating in front of the television, 29 % had none."""
    simulation = Simulation(scenario("5 min", users=users(40, group="retired")))
    meals = [
        sum(
            episode.activity in ("breakfast", "lunch", "dinner") and episode.role != RESUMES
            for episode in actor.behaviors[0].day(day)
        )
        for actor in simulation.actors.values()
        for day in range(MONDAY, MONDAY + 7)
    ]
    assert meals.count(0) < 0.06 * len(meals)
    assert 2 < statistics.mean(meals) < 3


def test_asking_for_a_day_again_or_from_a_branch_gives_the_same():
    simulation = Simulation(scenario("5 min", users=users(1)))
    behavior = simulation.actors["user_0"].behaviors[0]
    third = behavior.day(MONDAY + 3)
    assert third == copy.deepcopy(simulation).actors["user_0"].behaviors[0].day(MONDAY + 3)
    behavior.day(MONDAY + 9)
    assert third == behavior.day(MONDAY + 3)


def test_a_group_that_is_none_is_refused():
    with pytest.raises(InputError, match=r"users\.user_0\.group"):
        Simulation(scenario(users=users(1, group="teens")))


def test_the_table_is_whole():
    assert sum(facts["share"] for facts in survey.table()["groups"].values()) == 10_000
    for facts in survey.table()["groups"].values():
        for kind in ("weekday", "weekend"):
            assert [10_000] * 24 == [sum(hour) for hour in facts[kind]]
        assert 10_000 == sum(share for share, _ in facts["other"].values())
