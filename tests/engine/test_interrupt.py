"""Interruptions: plans that wait for interrupts, beside a twin that goes from step to step."""

import io
import textwrap
from datetime import timedelta

import numpy as np
import pytest
from tests.scenes import run, scenario, table

from fleet2d import Behavior, Simulation
from fleet2d.engine.interrupt import Interrupt, Interruptions
from fleet2d.errors import ComponentError, ScenarioError

PERIOD = 7


class EveryWeek(Interrupt):
    """The first two of every seven steps."""

    def holds(self, span):
        steps = span.first + np.arange(span.poses.x.shape[1])
        return steps % PERIOD < 2


class Counts(Interrupt):
    """An interrupt that answers with a number."""

    def holds(self, span):
        return 3


class Waits(Behavior):
    """Waits for an event, and notes each that happens; the plan ends itself every `stay`."""

    event: str = ""
    stay: timedelta = timedelta(minutes=2)

    def decide(self, now):
        plan = now.plan().interrupt_on(self.event)
        for event in now.events:
            plan.note("reacts", event.event)
        return plan.stay(self.stay)


class Overrules(Waits):
    """Takes over at an event, for one step."""

    listens = frozenset({EveryWeek.type_name})

    def decide(self, now):  # type: ignore[override]
        if not now.events:
            return None
        return now.plan().note("reacts", now.events[0].event).stay(timedelta(seconds=1))


def content(event, **behavior):
    waits = {"type": Waits.type_name, "event": event, **behavior}
    return scenario("3 min", robots={"astro": {"behaviors": [waits]}})


def reactions(stored):
    """Return the steps at which the behavior was asked because of an event."""
    return table(stored, "events", event="reacts")["step"].tolist()


def twin(steps):
    """Return the steps at which a plan that waits for `EveryWeek` is ended, step by step."""
    ends = []
    held = None
    for step in range(steps - 1):
        holds = step % PERIOD < 2
        if holds and held is False:
            ends.append(step + 1)
        held = holds
    return ends


def test_a_behavior_before_the_active_one_listens():
    first = {"type": Overrules.type_name}
    rests = {"type": Waits.type_name, "event": "user_seen"}
    stored = run(scenario("3 min", robots={"astro": {"behaviors": [first, rests]}}))

    assert twin(180) == reactions(stored)


class EveryTwelve(Interrupt):
    """The first of every twelve steps."""

    def holds(self, span):
        return (span.first + np.arange(span.poses.x.shape[1])) % 12 == 0


@pytest.mark.parametrize("max_span", ["null", "1", "10"])
def test_bodies_and_interrupts_do_not_disturb_each_other(max_span):
    names = {"astro": EveryWeek, "bolt": EveryTwelve, "zoe": EveryWeek}
    robots = {
        name: {"type": Waits.type_name, "event": event.type_name} for name, event in names.items()
    }
    stored = run(scenario("3 min", robots=robots), f"simulation.max_span={max_span}")

    twelves = list(range(13, 180, 12))
    for name, expected in (("astro", twin(180)), ("bolt", twelves), ("zoe", twin(180))):
        rows = table(stored, "events", event="reacts", entity=name)
        assert expected == rows["step"].tolist()


def test_nothing_is_done_where_no_plan_waits(monkeypatch):
    monkeypatch.setattr(Interruptions, "limit", lambda *_: pytest.fail("it looked ahead"))

    run(content("user_seen"))


def test_answer_of_a_wrong_shape_names_the_interrupt_and_what_is_expected():
    with pytest.raises(ComponentError, match=r"robots\.astro.*Counts.*returned 3.*booleans"):
        run(content(Counts.type_name))


def raises(error, call):
    with pytest.raises(error) as caught:
        call()
    return str(caught.value)


def test_event_that_there_is_not_is_refused_with_the_nearest():
    text = raises(ComponentError, lambda: run(content("home_emty")))

    assert "robots.astro: no event 'home_emty' interrupts its plans" in text
    assert "did you mean 'home_empty'? These do: " in text
    assert "home_occupied" in text
    assert "user_lost, user_seen" in text


def test_behavior_that_listens_to_an_unknown_event_is_refused(monkeypatch):
    monkeypatch.setattr(Overrules, "listens", frozenset({"doorbell"}))
    first = {"type": Overrules.type_name}
    text = raises(
        ScenarioError, lambda: Simulation(scenario(robots={"astro": {"behaviors": [first]}}))
    )

    assert "robots.astro listens to 'doorbell': no event 'doorbell' interrupts its plans" in text


OWN = """
import numpy as np
from fleet2d import Behavior, Interrupt

class Minute(Interrupt):
    def holds(self, span):
        return (span.first + np.arange(span.poses.x.shape[1])) % 60 == 30

class Rests(Behavior):
    def decide(self, now):
        plan = now.plan().interrupt_on(Minute)
        for event in now.events:
            assert event.event == Minute.type_name
            plan.note("reacts", "minute")
        return plan.stay()
"""


def test_interrupt_of_a_users_own_file_is_given_by_its_class(tmp_path):
    (tmp_path / "rest.py").write_text(textwrap.dedent(OWN))
    behavior = {"type": f"{tmp_path.as_posix()}/rest:Rests"}
    simulation = Simulation(scenario("3 min", robots={"astro": {"behaviors": [behavior]}}), seed=1)
    simulation.advance(40)
    file = io.BytesIO()
    simulation.save(file)
    file.seek(0)
    stored = simulation.run()

    assert [31, 91, 151] == reactions(stored)
    assert Simulation.load(file).run().digest == stored.digest


OUT = [
    {"at": "07:02", "away": True},
    {"at": "07:06", "place": "kitchen"},
]


@pytest.mark.parametrize(("event", "kind"), [("home_empty", "left_home"), ("home_occupied", "came_home")])  # fmt: skip
def test_robot_decides_once_after_the_last_person_left_or_the_first_came(event, kind):
    waits = {
        "type": "tests.engine.test_interrupt:Waits",
        "event": event,
    }
    people = {n: {"type": "schedule", "days": [{"items": OUT}]} for n in ("ana", "ben")}
    stored = run(scenario("10 min", users=people, robots={"astro": {"behaviors": [waits]}}))

    steps = table(stored, "events", event=kind)["step"].tolist()
    (reaction,) = table(stored, "events", event="reacts")["step"].tolist()
    assert 2 == len(steps)
    expected = max(steps) if event == "home_empty" else min(steps)
    assert expected <= reaction <= expected + 2
