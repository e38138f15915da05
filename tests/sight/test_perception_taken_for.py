"""Pets and people that are taken for others, each at a rate of its own."""

import numpy as np
import pytest
from pydantic import ValidationError
from tests.sight.sightings import sightings

import fleet2d
from fleet2d.errors import Fleet2DError
from fleet2d.sight.built_in_errors import TakenFor

MANY = 20_000


def taken(user, **fields):
    """Whom many sightings of a user, one a second, are recognized as."""
    who = np.full(MANY, user)
    seen = sightings(np.full(MANY, 2.0), np.zeros(MANY), user=who, true_user=who)
    return TakenFor.model_validate(fields).distort(seen).user


def test_each_user_is_taken_for_others_at_its_own_rate():
    users = {"ben": "5 %", "cleo": {"rate": 0.2, "others": {"ana": 0.75, "unknown": 0.25}}}
    ben, cleo = (taken(user, users=users, lasts="0 s") for user in (1, 2))
    assert {1, 0} == set(ben.tolist())  # for ana, who has no entry
    assert 0.05 == pytest.approx((ben != 1).mean(), abs=0.01)
    assert 0.2 == pytest.approx((cleo != 2).mean(), abs=0.015)
    assert 0.25 == pytest.approx((cleo == -1).sum() / (cleo != 2).sum(), abs=0.04)
    assert (taken(0, users=users) == 0).all()


def test_the_rate_of_a_pet_rises_with_its_height():
    rates = [
        (taken(1, users={"ben": pet}, lasts="0 s") != 1).mean()
        for pet in ({"kind": "cat"}, {"kind": "dog"}, {"kind": "big_dog"}, {"height": "1.1 m"})
    ]
    assert rates == sorted(rates)
    assert rates == pytest.approx([0.013, 0.03, 0.088, 0.3], abs=0.015)


def test_it_lasts():
    groups = (taken(1, users={"ben": 0.2}, lasts="10 s") != 1).reshape(-1, 10).mean(axis=1)
    assert {0.0, 1.0} == set(groups.tolist())


@pytest.mark.parametrize(
    ("users", "words"),
    [
        ({}, "at least 1"),
        ({"cat": {"kind": "cat", "rate": 0.1}}, "one of rate, kind and height"),
        ({"cat": {"others": {"ana": 1}}}, "one of rate, kind and height"),
        ({"cat": {"rate": 0.1, "others": {"ana": 0.5}}}, "add up to 0.5"),
        ({"cat": {"rate": 0.1, "others": {"cat": 1}}}, "itself"),
        ({"unknown": 0.1}, "false_positives"),
    ],
)
def test_what_says_nothing_is_refused(users, words):
    with pytest.raises(ValidationError, match=words):
        TakenFor.model_validate({"users": users})


def home(users):
    return {
        "simulation": {"start": "2026-01-05T08:00", "duration": "3 h", "seed": 4},
        "floorplan": "bundled",
        "users": {"ana": {"type": "routine"}, "cat": {"type": "pet"}},
        "robots": {
            "astro": {
                "camera": {},
                "behaviors": [{"type": "patrol", "dwell": "1 min"}],
                "perception": {"errors": {"taken_for": {"users": users}}},
            }
        },
    }


def test_a_cat_is_seen_as_ana_in_a_run():
    rows = fleet2d.run(home({"cat": {"rate": 0.5}})).pandas("observations")
    cat = rows[rows["true_user"] == "cat"]
    assert {"ana", "cat"} == set(cat["user"])
    assert (rows[rows["true_user"] == "ana"]["user"] == "ana").all()


def test_a_user_that_is_not_there_is_an_error_with_its_name():
    with pytest.raises(Fleet2DError, match="no user 'dog'"):
        fleet2d.run(home({"dog": {"kind": "dog"}}))
