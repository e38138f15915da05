"""Interactions as data: when requests come up, what they are worth, and what becomes of them."""

from datetime import datetime, timedelta

import pytest
from tests.scenes import scenario

from fleet2d.errors import ScenarioError
from fleet2d.interactions.interaction import Interaction, Outcome, RequestQueue
from fleet2d.scenario.load import load_scenario

MONDAY = datetime(2026, 1, 5)
HOUR, MINUTE = timedelta(hours=1), timedelta(minutes=1)
PILL = {"do": "remind", "to": "ana", "at": ["20:00", "08:00"], "worth": 4}


def queue(**changes):
    return RequestQueue({"pill": Interaction(**(PILL | changes))}, MONDAY)


def test_requests_come_up_at_their_times_and_expire():
    requests = queue(on="weekdays")
    changes = requests.advance(MONDAY + timedelta(days=6))

    hours = [(change.event, (change.time - MONDAY) / HOUR) for change in changes]
    assert [("due", 8), ("expired", 8.5), ("due", 20), ("expired", 20.5)] == hours[:4]
    assert 4 * 5 == len(hours), "of five days"
    assert [] == requests.open
    next_due = MONDAY + timedelta(days=7, hours=8)
    assert {"due": next_due, "expired": next_due + 30 * MINUTE} == requests.next_changes()


def test_requests_at_an_interval_count_from_the_start():
    times = queue(at=[], every="90 min").interactions["pill"].times(MONDAY, MONDAY + 2 * HOUR)
    assert MONDAY + 3 * HOUR == next(times)
    assert MONDAY + 4.5 * HOUR == next(times)


def test_requests_at_an_interval_come_up_on_their_days_only():
    pill = queue(at=[], every="1 h", on="weekend").interactions["pill"]

    assert MONDAY + timedelta(days=5) == next(pill.times(MONDAY, MONDAY))


def test_value_falls_evenly_until_the_deadline():
    song = Interaction(do="offer", to="ana", every="1 d", within="2 h", worth=10, falls_to=0.5)
    values = [song.value_after(hours * HOUR) for hours in (0, 1, 2, 2.1, -1)]
    assert [10.0, 7.5, 5.0, 0.0, 0.0] == values


def test_the_most_valuable_request_comes_first():
    hello = Interaction(do="greet", to="ben", every="1 d", worth=1)
    news = Interaction(do="deliver", to="ana", every="1 d", worth=3)
    requests = RequestQueue({"hello": hello, "news": news}, MONDAY)
    requests.advance(MONDAY)

    assert ["news ana", "hello ben"] == [request.text for request in requests.ready(MONDAY)]
    assert ["hello ben"] == [request.text for request in requests.ready(MONDAY, ["ben"])]


@pytest.mark.parametrize(
    ("outcome", "tries", "ready_after"),
    [
        (Outcome.ACCEPTED, 3, None),
        (Outcome.DECLINED, 3, None),
        (Outcome.SENT_AWAY, 3, None),
        (Outcome.BANNED, 3, None),
        (Outcome.SWITCHED_OFF, 3, None),
        (Outcome.DEFERRED, 3, 17 * MINUTE),
        (Outcome.IGNORED, 3, 10 * MINUTE),
        (Outcome.IGNORED, 1, None),
    ],
)
def test_an_answer_settles_a_request(outcome, tries, ready_after):
    requests, now = queue(tries=tries), MONDAY + 8 * HOUR
    requests.advance(now)
    requests.settle(requests.open[0], outcome, now, now + 17 * MINUTE)

    assert [] == requests.ready(now)
    if ready_after is None:
        assert [] == requests.open
    else:
        assert now + ready_after == requests.next_ready(now)
        assert [] == requests.ready(now + ready_after - MINUTE)
        assert ["pill ana"] == [each.text for each in requests.ready(now + ready_after)]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"at": []}, "it comes up by 'at'"),
        ({"every": "1 h"}, "it comes up by 'at'"),
        ({"to": "anna"}, "there is no user 'anna': did you mean 'ana'?"),
        ({"by": "astra"}, "there is no robot 'astra': did you mean 'astro'?"),
        ({"do": "ask", "about": "anna"}, "pill.about: there is no user 'anna': did you mean"),
        ({"do": "nag"}, "'remind', 'offer'"),
        ({"fetch_from": "ben"}, "'fetch_from' is for `do: deliver`"),
        ({"do": "deliver", "fetch_from": "ana"}, "'fetch_from' is for `do: deliver`"),
        ({"at": [], "every": "1 us"}, "interactions.pill.every: expected a step (1 s) or more"),
        ({"on": "feast"}, "interactions.pill.on"),
    ],
)
def test_wrong_interactions_are_refused(changes, message):
    content = scenario(
        users={"ana": {"type": "meander"}},
        robots={"astro": {"type": "patrol"}},
        interactions={"pill": PILL | changes},
    )
    with pytest.raises(ScenarioError) as caught:
        load_scenario(content)
    assert message in str(caught.value)
    assert "interactions.pill" in str(caught.value)
