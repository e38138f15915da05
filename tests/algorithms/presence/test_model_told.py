"""Told presence: answers correct a belief, fade, and end when the robot sees the person."""

import numpy as np
import pytest
from tests.entities.robots.test_interact import PILL, ana, home
from tests.scenes import table

import fleet2d
from fleet2d.errors import ComponentError

ASK = {**PILL, "do": "ask", "about": "ben", "at": ["07:10"]}
AWAY = {"type": "schedule", "days": [{"on": "daily", "items": [{"at": "07:01", "away": True}]}]}


def beliefs(ben, duration="2 h", **told):
    """The rows about ben of rtp and of the corrected belief."""
    run = fleet2d.run(
        home(
            duration,
            users={"ana": ana(), "ben": ben},
            robots={"astro": {"behaviors": [{"type": "interact"}]}},
            interactions={"where": ASK},
            algorithms={
                "rtp": {"type": "real_time_presence"},
                "told": {"type": "told_presence", "reads": ["rtp"], **told},
            },
        )
    )
    return table(run, "rtp", user="ben"), table(run, "told", user="ben")


def away_at(rows, step):
    """The probability of being away, of the update at a step."""
    (row,) = np.flatnonzero((rows["step"] == step) & (rows["room"] == "away"))
    return float(rows["share"][row])


def test_who_is_said_to_be_away_is_believed_to_be_for_a_while():
    rtp, told = beliefs(AWAY, half_life="30 min")
    before, after, later = 299, 1199, 6899

    assert away_at(told, before) == away_at(rtp, before)
    assert away_at(told, after) > 0.8 > away_at(rtp, after)
    assert away_at(rtp, later) < away_at(told, later) < away_at(told, after)


def test_who_is_said_to_be_at_home_is_not_believed_to_be_away():
    rtp, told = beliefs(ana("bedroom"))

    assert away_at(told, 1199) < away_at(rtp, 1199)


@pytest.mark.parametrize("source", ["long_term_presence", "belief_table"])
def test_told_presence_of_another_algorithm_is_refused_before_the_run(source):
    algorithms = {"other": {"type": source}, "told": {"type": "told_presence", "reads": ["other"]}}
    with pytest.raises(ComponentError, match=r"algorithms\.told: 'other' is not a real-time"):
        fleet2d.Simulation(home(algorithms=algorithms))


def test_told_presence_without_a_presence_is_refused():
    with pytest.raises(ComponentError, match="give `reads:"):
        fleet2d.run(home(algorithms={"told": {"type": "told_presence"}}))
