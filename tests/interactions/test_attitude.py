"""What months make of a person: novelty, burden, annoyance, trust and habits."""

from datetime import datetime, timedelta

import pytest

from fleet2d.interactions.attitude import Attitude, AttitudeState, LeavingAttitude, SteadyAttitude
from fleet2d.interactions.interaction import Outcome

START = datetime(2026, 1, 5, 8)
DAY = timedelta(days=1)


def lived(attitude, days, outcome, willingness=0.5, each=1):
    state = attitude.begin(START)
    for day in range(days):
        for number in range(each):
            attitude.pass_time(state, START + day * DAY + timedelta(minutes=number))
            attitude.addressed(state, "pill", outcome, willingness)
    return state


def test_novelty_and_annoyance_halve_in_their_half_lives():
    attitude = Attitude(novelty_lasts="14 d", annoyance_lasts="2 d")
    state = AttitudeState(START, novelty=1.0, annoyance=4.0)
    attitude.pass_time(state, START + 2 * DAY)
    assert 2.0 == pytest.approx(state.annoyance)
    attitude.pass_time(state, START + 14 * DAY)
    assert 0.5 == pytest.approx(state.novelty)


def test_time_passes_the_same_in_one_stretch_or_in_many():
    one, many = AttitudeState(START, annoyance=1.0), AttitudeState(START, annoyance=1.0)
    Attitude().pass_time(one, START + 10 * DAY)
    for day in range(1, 11):
        Attitude().pass_time(many, START + day * DAY)
    assert one.annoyance == pytest.approx(many.annoyance)
    assert one.novelty == pytest.approx(many.novelty)


def test_burden_is_the_number_of_prompts_a_day():
    assert 3.0 == pytest.approx(lived(Attitude(), 60, Outcome.ACCEPTED, each=3).burden, rel=0.1)


def test_bad_moments_annoy_and_good_ones_do_not():
    assert 0.0 == lived(Attitude(), 20, Outcome.ACCEPTED, willingness=1.0).annoyance
    assert 0.5 < lived(Attitude(), 20, Outcome.IGNORED, willingness=0.0).annoyance


def test_trust_rises_with_what_is_useful_and_falls_with_mistakes():
    useful = lived(Attitude(), 20, Outcome.ACCEPTED).trust
    useless = lived(Attitude(), 20, Outcome.DECLINED).trust
    mistaken = lived(Attitude(), 20, Outcome.MISTAKEN).trust
    assert useful > 0.75 > 0.5 > useless > mistaken


@pytest.mark.parametrize(
    ("outcome", "left"),
    [("accepted", 1.05), ("deferred", 1), ("ignored", 1), ("declined", 0.97), ("sent_away", 0.97),
     ("banned", 0.97), ("switched_off", 0.7), ("mistaken", 0.7)],
)  # fmt: skip
def test_each_answer_leaves_as_much_trust_as_the_docs_say(outcome, left):
    assert 0.5 * left == pytest.approx(lived(Attitude(), 1, Outcome(outcome)).trust)


def test_lost_trust_recovers_to_what_it_was_at_first_and_gained_trust_stays():
    lost, gained = AttitudeState(START, trust=0.1), AttitudeState(START, trust=0.8)
    for state in (lost, gained):
        Attitude().pass_time(state, START + 30 * DAY)
    assert (0.3, 0.8) == pytest.approx((lost.trust, gained.trust))


def test_a_habit_forms_at_a_time_of_day_and_holds_there_only():
    state = lived(Attitude(), 20, Outcome.ACCEPTED)
    window = timedelta(minutes=30)
    assert state.expects("pill", START + 30 * DAY, window) > 0.9
    assert 0 == state.expects("pill", START + 30 * DAY + timedelta(hours=3), window)
    assert 0 == state.expects("song", START + 30 * DAY, window)


def test_kinds_of_people_differ_in_what_a_month_makes_of_them():
    steady, fading, leaving = (
        lived(kind(), 30, Outcome.IGNORED, willingness=0.4, each=3)
        for kind in (SteadyAttitude, Attitude, LeavingAttitude)
    )
    assert steady.novelty > fading.novelty > leaving.novelty
    assert steady.annoyance < fading.annoyance < leaving.annoyance
