"""Arbitration: order, hours, cooldowns, breaking in, and going on with what was broken off."""

import copy
from datetime import datetime, timedelta
from itertools import pairwise

import pytest
from tests.entities.robots.robots import assert_same_for_every_max_span, events, home_with, rooms
from tests.scenes import digests, run

import fleet2d
from fleet2d import Behavior
from fleet2d.entities.behavior import holds, parse_span
from fleet2d.errors import InputError
from fleet2d.interventions import Put, Release, Replan, Send

OWN = __name__


class Errand(Behavior):
    """Says when it wants to be asked, and does something at that time."""

    records = frozenset({"errand"})

    at: tuple[int, ...] = ()  # minutes after the start
    declines: bool = False

    def start(self, actor):
        self.decisions: list[int] = []

    def wakes_at(self, now, plan):
        start = now.actor.clock.start
        times = (start + timedelta(minutes=minute) for minute in self.at)
        return next((time for time in times if time > now.time), None)

    def decide(self, now):
        self.decisions.append(now.step)
        if self.declines or now.step // 60 not in self.at:
            return None
        return now.plan().note("errand", str(now.step)).go_to("kitchen").stay(timedelta(minutes=2))


class Idle(Behavior):
    """Stays for good."""

    records = frozenset({"idle"})

    def decide(self, now):
        return now.plan().note("idle", str(now.step)).stay()


class Round(Behavior):
    """Stays in three rooms for five minutes each; tells how far it is."""

    records = frozenset({"at"})

    def decide(self, now):
        plan = now.plan()
        for room in ("bedroom", "bathroom", "living_room"):
            plan.go_to(room).note("at", room).stay(timedelta(minutes=5))
        return plan


class SteadyRound(Round):
    """Goes on with its round."""

    resumes = True


def errand(*at, **fields):
    return {"type": f"{OWN}:Errand", "at": list(at), **fields}


IDLE = {"type": f"{OWN}:Idle"}
QUIET = {"type": "schedule", "days": [{"items": [{"at": "00:00", "away": True}]}]}


def noted(*behaviors, max_span=61):
    """What is told in half an hour of a robot with some behaviors, whatever the spans."""
    content = home_with([*behaviors], "30 min", QUIET)
    stored = assert_same_for_every_max_span(content, max_span)
    return [(name, detail) for _, name, detail in events(stored)]


def test_the_first_breaks_in_on_those_behind_it_when_it_said():
    rows = noted(errand(5, 20), IDLE, max_span=1)
    assert [("idle", "0"), ("errand", "300")] == rows[:2]
    assert ("errand", "1200") in rows


def test_who_has_nothing_to_do_after_all_leaves_no_trace():
    alone = run(home_with(["patrol"], "30 min", QUIET))
    with_errand = run(home_with([errand(*range(1, 30), declines=True), "patrol"], "30 min", QUIET))
    assert digests(alone) == digests(with_errand)


@pytest.mark.parametrize(
    ("behaviors", "rows"),
    [
        ([IDLE, errand(5)], [("idle", "0")]),
        ([errand(5, preempts=False), IDLE], [("idle", "0")]),
        ([{**IDLE, "when": "08:00-09:00"}], []),
    ],
    ids=["behind", "may not break in", "outside its hours"],
)
def test_who_has_no_right_to_the_turn_waits(behaviors, rows):
    assert rows == noted(*behaviors)


def test_only_the_round_that_resumes_goes_on_where_it_was():
    def stops(kind):
        rows = noted(errand(7), {"type": f"{OWN}:{kind}"})
        return [detail for name, detail in rows if name in ("at", "errand")][:5]

    assert ["bedroom", "bathroom", "420", "living_room", "bedroom"] == stops("SteadyRound")
    assert ["bedroom", "bathroom", "420", "bedroom", "bathroom"] == stops("Round")


def test_a_stop_that_was_broken_off_is_made_up_for():
    content = home_with([errand(7), {"type": f"{OWN}:SteadyRound"}], "30 min", QUIET)
    simulation = fleet2d.Simulation(content)
    simulation.advance(450)
    branch = copy.deepcopy(simulation)
    stored = simulation.run()
    begun = {detail: step for step, _, detail in reversed(events(stored))}  # the first of each
    # The errand's two minutes, and the ways to it and back.
    assert 120 < begun["living_room"] - begun["bathroom"] - 300 < 200
    assert digests(run(content)) == digests(branch.run()) == digests(stored)


def test_hours_begin_and_end_a_behavior():
    patrol = {"type": "patrol", "waypoints": [[7.0, 1.0]], "dwell": "1 h", "when": "07:10-07:20"}
    stored = assert_same_for_every_max_span(home_with([patrol, IDLE], "30 min", QUIET), 61, 1)
    assert [(0, "idle"), (1200, "idle")] == [(step, name) for step, name, _ in events(stored)]
    assert ["living_room_1", "kitchen_1"] == rooms(stored)


def test_a_cooldown_begins_when_its_turn_is_over():
    rows = noted({**errand(*range(60)), "cooldown": "10 min"}, IDLE)
    steps = [int(detail) for name, detail in rows if name == "errand"]
    pauses = [b - a for a, b in pairwise(steps)]
    assert 720 <= min(pauses) <= max(pauses) < 800


@pytest.mark.parametrize(
    "act", [Put("astro", "bedroom"), Send("astro", "kitchen"), Release("astro"), Replan("astro")]
)
def test_who_is_put_elsewhere_or_ordered_decides_at_once(act):
    simulation = fleet2d.Simulation(home_with([IDLE], "10 min", QUIET))
    simulation.advance(60)
    simulation.do(act)
    simulation.advance(1)
    assert 60 == simulation.actors["astro"].planned_at


MONDAY = datetime(2026, 1, 5)


@pytest.mark.parametrize(
    ("text", "holding", "not_holding"),
    [
        ("08:00-18:00", [8, 17.99, 24 + 8], [7.99, 18, 0]),
        ("weekdays 22:00-06:00", [22, 24 + 5.9, 4 * 24 + 23, 5 * 24 + 5], [5, 5 * 24 + 22, 6]),
        ("saturday,sunday 0:00-24:00", [5 * 24, 6 * 24 + 23.9], [0, 4 * 24 + 23.9]),
    ],
)
def test_hours_hold_when_they_say(text, holding, not_holding):
    span = parse_span(text)
    for hour in holding:
        assert span.end_at(MONDAY + timedelta(hours=hour)) is not None, hour
    for hour in not_holding:
        assert span.end_at(MONDAY + timedelta(hours=hour)) is None, hour


def test_the_next_begin_is_after_the_moment():
    span = parse_span("weekend 10:00-12:00")
    assert datetime(2026, 1, 10, 10) == span.next_begin(MONDAY)
    assert datetime(2026, 1, 11, 10) == span.next_begin(datetime(2026, 1, 10, 10))
    both = (parse_span("08:00-10:00"), parse_span("09:00-11:00"))
    assert MONDAY + timedelta(hours=11) == holds(both, MONDAY + timedelta(hours=9, minutes=30))


@pytest.mark.parametrize(
    ("when", "words"),
    [
        ("8-22", "time of day"),
        ("always", "expected hours"),
        ("someday 08:00-09:00", "unknown day 'someday'"),
        ("08:00-08:00", "different times"),
        ([7], "expected hours"),
    ],
)
def test_hours_that_can_not_be_read_are_refused(when, words):
    with pytest.raises(InputError, match=words):
        fleet2d.Simulation(home_with([{**IDLE, "when": when}]))


def test_hours_and_the_rest_are_written_back_as_they_were():
    content = home_with([{"type": "patrol", "when": ["weekend 8:00-9:30"], "cooldown": "5 min"}])
    scenario = fleet2d.load_scenario(content)
    again = fleet2d.load_scenario(scenario.model_dump(mode="json"))
    assert scenario.robots["astro"].behaviors == again.robots["astro"].behaviors
    assert ["weekend 08:00-09:30"] == scenario.model_dump(mode="json")["robots"]["astro"][
        "behaviors"
    ][0]["when"]
