"""Interruptions: needs and errands come up in a day, and leave its plan as it is."""

import pickle
import statistics
from itertools import accumulate, pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError
from tests.reference.interruptions import CERTAIN, MOST, SlowInterruptions
from tests.reference.planner import RoomTimes
from tests.routines.days import DAY_S, MONDAY

from fleet2d.kernels import Interruptions, RoomUse
from fleet2d.routines.interruptions import without_interruptions
from fleet2d.routines.life import Life
from fleet2d.routines.persona import Persona, bundled_names, bundled_persona
from fleet2d.routines.planner import SLEEP
from fleet2d.runtime.determinism import Draws

HOUR = 3600
IDLE = {"days": {"any_day": {"on": "daily", "wake": "07:00", "sleep": "23:00"}}}


def life(persona, seed=4):
    return Life(persona, seed, "users.ana")


def of(needs=None, errands=None, **more):
    return life(Persona.model_validate({**IDLE, "needs": needs, "errands": errands, **more}))


def days(lived, count=100):
    return [list(lived.day(MONDAY + i)) for i in range(count)]


QUANTILES = st.integers(1, 20_000).map(
    lambda longest: tuple(1 + i * longest // 256 for i in range(256))
)
CHANCES = st.sampled_from([0, 100, 700, CERTAIN])
REST, TOILET, COOK, WORK, WALK, ASLEEP, WASH = range(7)  # activities
SOME = st.lists(st.integers(REST, WASH), unique=True)
STEPS = st.tuples(st.integers(REST, COOK), CHANCES, QUANTILES)
NEEDS = st.tuples(
    st.lists(STEPS, min_size=1, max_size=3), QUANTILES, st.none() | QUANTILES,
    st.tuples(CHANCES, CHANCES, CHANCES, CHANCES), st.integers(0, 4000),
    st.none() | st.tuples(st.integers(0, 86_399), st.integers(0, 86_399)), SOME,
)  # fmt: skip
ERRANDS = st.tuples(STEPS, st.none() | SOME, st.none() | SOME)
DAYS = st.lists(
    st.tuples(st.integers(REST, WASH), st.integers(1, 20_000), st.integers(-1, 2)),
    min_size=1, max_size=12,
)  # fmt: skip
ROOMS = st.lists(
    st.lists(st.integers(-1, 2), max_size=2, unique=True), min_size=WASH + 1, max_size=WASH + 1
)
USES = st.none() | st.lists(
    st.tuples(st.integers(-1, 2), st.integers(20_000, 120_000), st.integers(0, 9000)), max_size=9
)


@given(
    st.lists(NEEDS, max_size=3), st.lists(ERRANDS, max_size=3), SOME, DAYS, USES, ROOMS,
    st.integers(0, 99),
)  # fmt: skip
def test_the_core_interrupts_a_day_as_python_does(
    needs, errands, firm, lengths, uses, rooms, number
):
    parts = needs, errands, [WORK, WALK], firm, ASLEEP, WASH + 1
    core, twin = Interruptions(*parts), SlowInterruptions(*parts)
    ends = accumulate((length for _, length, _ in lengths), initial=25_000)
    spans = zip(lengths, pairwise(ends), strict=True)
    day = [(activity, begin, end, room) for (activity, _, room), (begin, end) in spans]
    use, times = (None, None) if uses is None else (RoomUse(), RoomTimes())
    for room, begin, lasts in uses or ():
        for each in (use, times):
            each.add(room, begin, begin + lasts)
    slow = twin.interrupt(Draws(np.uint64(5), number), day, times, rooms)
    for each in (core, pickle.loads(pickle.dumps(core))):
        assert slow == each.interrupt(Draws(np.uint64(5), number), day, use, rooms)


@pytest.mark.parametrize("name", bundled_names())
def test_a_day_without_its_interruptions_is_the_planned_day(name):
    lived = life(bundled_persona(name))
    for ordinal in range(MONDAY, MONDAY + 400):
        plan = lived.draw_uninterrupted(ordinal, lived.template(ordinal))
        assert plan == without_interruptions(lived.day(ordinal))


@pytest.mark.parametrize("name", bundled_names())
def test_every_persona_uses_the_toilet_as_often_as_people_do(name):
    lived = days(life(bundled_persona(name)), 140)
    visits = [sum(episode.activity == "toilet" for episode in day) for day in lived]
    assert 4 <= statistics.mean(visits) <= 10  # Wyman et al. 2020: 2 to 10 by day, 0 to 4 at night
    assert min(visits) >= 1


def test_a_need_in_the_night_wakes_one_who_sleeps_on_afterwards():
    lived = of({"toilet": {"every": "3 h", "asleep": {"law": "gamma", "mean": "4 h"}}})
    up = 0
    for day in days(lived):
        night = [episode for episode in day if episode.begin >= 23 * HOUR + HOUR]
        up += sum(episode.activity == "toilet" for episode in night)
        assert SLEEP == day[-1].activity
        assert {SLEEP, "toilet"} >= {episode.activity for episode in night}
    assert 1 < up / 100 < 2.5


def test_hands_are_washed_right_after_the_toilet_as_often_as_stated():
    lived = of({"toilet": {"every": "2 h", "then": {"wash_hands": 0.8}}})
    after = [b.activity for day in days(lived, 200) for a, b in pairwise(day)
             if a.activity == "toilet"]  # fmt: skip
    washed = sum(name == "wash_hands" for name in after) / len(after)
    assert 0.8 == pytest.approx(washed, abs=0.03)


def test_a_need_waits_for_the_end_of_what_is_not_interruptible():
    shower = {"at": "12:00", "spread": "0 s", "takes": "20 min"}
    day = {**IDLE["days"]["any_day"], "do": {"shower": shower}}
    for one in days(of({"drink": "20 min"}, days={"any_day": day})):
        assert 1 == sum(episode.task == "shower" for episode in one)


def test_calls_come_only_at_their_times_of_day():
    call = {"every": {"law": "exponential", "mean": "1 h"}, "between": ["10:00", "12:00"]}
    lived = of({"phone_call": {**call, "patience": "0 s"}})
    begins = [d.begin for day in days(lived, 200) for d in day if d.activity == "phone_call"]
    assert 2 == pytest.approx(len(begins) / 200, abs=0.3)
    assert all(10 * HOUR <= time % DAY_S <= 12 * HOUR + 60 for time in begins)


def test_errands_are_done_between_the_activities_that_they_name():
    day = {**IDLE["days"]["any_day"], "do": {"shopping": {"at": "10:00"}}}
    lived = of(None, {"put_away": {"probability": 1, "after": ["shopping"]}}, days={"any_day": day})
    for one in days(lived):
        pairs = [(a.activity, b.activity) for a, b in pairwise(one)]
        assert ("shopping", "put_away") in pairs
        assert 1 == sum(episode.activity == "put_away" for episode in one)


def test_a_day_full_of_needs_has_numbers_for_its_draws():
    lived = of({f"need_{i}": {"every": "6 min", "activity": "drink"} for i in range(6)})
    assert all(len(day) <= MOST + 40 for day in days(lived, 10))


@pytest.mark.parametrize(
    ("persona", "words"),
    [
        ({"needs": {"toilett": "3 h"}}, ["needs.toilett", "toilet"]),
        ({"needs": {"drink": "30 s"}}, ["every", "5 min"]),
        ({"errands": {"fetch": {"probability": 1, "after": ["cok"]}}}, ["after", "cook"]),
    ],
)
def test_needs_that_are_none_are_refused_in_plain_words(persona, words):
    with pytest.raises(ValidationError) as failure:
        Persona.model_validate({**IDLE, **persona})
    assert all(word in str(failure.value) for word in words)
