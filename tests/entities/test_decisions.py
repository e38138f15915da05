"""Arbitration: order, hours, cooldowns, breaking in, and going on with what was broken off."""

from datetime import datetime, timedelta
from itertools import pairwise
from typing import Any

import pytest
from tests.entities.robots.robots import assert_same_for_every_max_span, events, home_with, rooms
from tests.scenes import digests, run

import fleet2d
from fleet2d import Behavior, Plan, Situation
from fleet2d.entities.behavior import holds, parse_span
from fleet2d.errors import InputError
from fleet2d.interventions import Put, Release, Replan, Send

OWN = __name__


class Errand(Behavior):
    """Says when it wants to be asked, and does something at that time."""

    records = frozenset({"errand"})

    at: tuple[int, ...] = ()  # minutes after the start
    declines: bool = False

    def start(self, actor: Any) -> None:
        self.decisions: list[int] = []

    def wakes_at(self, now: Situation, plan: Plan) -> datetime | None:
        start = now.actor.clock.start
        times = (start + timedelta(minutes=minute) for minute in self.at)
        return next((time for time in times if time > now.time), None)

    def decide(self, now: Situation) -> Plan | None:
        self.decisions.append(now.step)
        if self.declines or now.step // 60 not in self.at:
            return None
        return now.plan().note("errand", str(now.step)).go_to("kitchen").stay(timedelta(minutes=2))


class Idle(Behavior):
    """Stays for good."""

    records = frozenset({"idle"})

    def decide(self, now: Situation) -> Plan:
        return now.plan().note("idle", str(now.step)).stay()


class Round(Behavior):
    """Stays in three rooms for five minutes each; tells how far it is."""

    records = frozenset({"at"})

    def decide(self, now: Situation) -> Plan:
        plan = now.plan()
        for room in ("bedroom", "bathroom", "living_room"):
            plan.go_to(room).note("at", room).stay(timedelta(minutes=5))
        return plan


class SteadyRound(Round):
    """Goes on with its round."""

    resumes = True


def errand(*at: int, **fields: Any) -> dict[str, Any]:
    return {"type": f"{OWN}:Errand", "at": list(at), **fields}


IDLE = {"type": f"{OWN}:Idle"}
QUIET = {"type": "schedule", "days": [{"items": [{"at": "00:00", "away": True}]}]}


def noted(content: dict[str, Any], *spans: int) -> list[tuple[str, str]]:
    stored = assert_same_for_every_max_span(content, *(spans or (61,)))
    return [(name, detail) for _, name, detail in events(stored)]


def test_the_first_breaks_in_on_those_behind_it_when_it_said():
    rows = noted(home_with([errand(5, 20), IDLE], "30 min", QUIET), 61, 1)
    assert [("idle", "0"), ("errand", "300")] == rows[:2]
    assert ("errand", "1200") in rows


def test_who_is_behind_or_may_not_break_in_waits():
    assert [("idle", "0")] == noted(home_with([IDLE, errand(5)], "30 min", QUIET))
    assert [("idle", "0")] == noted(home_with([errand(5, preempts=False), IDLE], "30 min", QUIET))


def test_who_has_nothing_to_do_after_all_leaves_no_trace():
    alone = run(home_with(["patrol"], "30 min", QUIET))
    with_errand = run(home_with([errand(*range(1, 30), declines=True), "patrol"], "30 min", QUIET))
    assert digests(alone) == digests(with_errand)


def test_only_the_round_that_resumes_goes_on_where_it_was():
    def stops(kind: str) -> list[str]:
        content = home_with([errand(7), {"type": f"{OWN}:{kind}"}], "30 min", QUIET)
        return [detail for name, detail in noted(content) if name in ("at", "errand")]

    assert ["bedroom", "bathroom", "420", "living_room", "bedroom"] == stops("SteadyRound")[:5]
    assert ["bedroom", "bathroom", "420", "bedroom", "bathroom"] == stops("Round")[:5]


def test_a_stop_that_was_broken_off_is_made_up_for():
    content = home_with([errand(7), {"type": f"{OWN}:SteadyRound"}], "30 min", QUIET)
    rows = [(detail, step) for step, _, detail in events(run(content))]
    begun = dict(reversed(rows))  # the first of each
    # The errand's two minutes, and the ways to it and back.
    assert 120 < begun["living_room"] - begun["bathroom"] - 300 < 200


def test_hours_begin_and_end_a_behavior():
    patrol = {"type": "patrol", "waypoints": [[7.0, 1.0]], "dwell": "1 h", "when": "07:10-07:20"}
    stored = assert_same_for_every_max_span(home_with([patrol, IDLE], "30 min", QUIET), 61, 1)
    assert ["idle", "idle"] == [name for _, name, _ in events(stored)]
    assert [0, 1200] == [step for step, _, _ in events(stored)]
    assert ["living_room_1", "kitchen_1"] == rooms(stored)


def test_outside_its_hours_a_behavior_is_not_asked():
    assert [] == noted(home_with([{**IDLE, "when": "08:00-09:00"}], "30 min", QUIET))


def test_a_cooldown_begins_when_its_turn_is_over():
    content = home_with([{**errand(*range(60)), "cooldown": "10 min"}, IDLE], "40 min", QUIET)
    steps = [int(detail) for name, detail in noted(content) if name == "errand"]
    assert len(steps) >= 3
    assert all(b - a >= 720 for a, b in pairwise(steps))
    assert all(b - a < 800 for a, b in pairwise(steps))


def test_copies_made_while_something_is_broken_off_live_the_same_future():
    import copy

    content = home_with([errand(7), {"type": f"{OWN}:SteadyRound"}], "30 min", QUIET)
    simulation = fleet2d.Simulation(content)
    simulation.advance(450)
    branch = copy.deepcopy(simulation)
    assert digests(run(content)) == digests(branch.run()) == digests(simulation.run())


def test_replanning_asks_everybody_anew():
    simulation = fleet2d.Simulation(home_with([errand(5), IDLE], "10 min", QUIET))
    simulation.advance(60)
    simulation.do(Replan("astro"))
    simulation.advance(60)
    assert simulation.actors["astro"].behaviors[0].decisions == [0, 60]  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    "act", [Put("astro", "bedroom"), Send("astro", "kitchen"), Release("astro"), Replan("astro")]
)
def test_who_is_put_elsewhere_or_ordered_decides_at_once(act):
    simulation = fleet2d.Simulation(home_with([IDLE], "10 min", QUIET))
    simulation.advance(60)
    simulation.do(act)
    simulation.advance(1)
    assert 60 == simulation.actors["astro"].planned_at  # type: ignore[attr-defined]


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
