"""Plans and who makes them: legs, interruptions, arbitration, and what a behavior may not do."""

from datetime import datetime, timedelta

import numpy as np
import pytest
from tests.scenes import path, scenario, table

import fleet2d
from fleet2d import Behavior
from fleet2d.errors import ComponentError, InputError

SECOND = timedelta(seconds=1)
HOUR = timedelta(hours=1)
_DECIDE = {}


class Told(Behavior):
    """Does what a function of the test says."""

    records = frozenset({"back", "gone", "later", "never", "now", "on the step"})
    name: str

    def decide(self, now):
        return _DECIDE[self.name](now)


def entity_with(*functions, **body):
    """The configuration of a body that asks these functions in turn."""
    behaviors = []
    for number, function in enumerate(functions):
        name = f"{len(_DECIDE)}-{number}"
        _DECIDE[name] = function
        behaviors.append(Told(name=name))
    return {"start": [1.0, 3.0], "start_heading_deg": 0, "behaviors": behaviors, **body}


def run(*functions, duration="5 min", **body):
    return fleet2d.run(
        scenario(
            duration,
            users={"ana": entity_with(*functions, **body)},
            artifacts={"trajectories": "1 s"},
        )
    )


def recording_steps(function):
    """A list that fills with the steps at which the function is asked."""
    steps = []

    def decide(now):
        steps.append(now.step)
        return function(now)

    return steps, decide


def minute(now):
    return now.plan().stay(timedelta(minutes=1))


def test_a_turn_takes_the_long_way_if_told_to():
    poses = path(run(lambda now: now.plan().turn_by(-1.5).stay(), turn_rate_deg=18), "ana")
    turned = np.unwrap(poses.heading)
    assert turned[:31] == pytest.approx(np.linspace(0, -3 * np.pi, 31), abs=0.01)
    assert turned[32:] == pytest.approx(-3 * np.pi, abs=0.01)


def test_a_plan_knows_the_time_up_to_which_it_is_made():
    times = []

    def decide(now):
        plan = now.plan().stay(timedelta(seconds=90))
        times.append((now.time, plan.time))
        return plan

    run(decide, duration="3 min")
    start = datetime(2026, 1, 5, 7)
    assert [
        (start, start + timedelta(seconds=90)),
        (start + timedelta(seconds=90), start + timedelta(minutes=3)),
    ] == times


def test_leaving_and_coming_home():
    def decide(now):
        plan = now.plan().leave_home().note("gone").stay(timedelta(seconds=60)).come_home()
        return plan.note("back").stay()

    stored = run(decide)
    events = table(stored, "events")
    assert ["left_home", "gone", "came_home", "back"] == events["event"].tolist()
    gone, back = events["step"][0], events["step"][2]
    away = path(stored, "ana").away
    assert 60 <= back - gone <= 61
    assert away[gone:back].all()
    assert not away[:gone].any()
    assert not away[back:].any()


# --- Legs --------------------------------------------------------------------------------------


WHEN = datetime(2026, 1, 5, 7, 1, 40)


@pytest.mark.parametrize(
    ("decide", "expected"),
    [
        (lambda now: now.plan().stay(until=now.time - HOUR).stay(30 * SECOND), range(0, 300, 30)),
        (lambda now: now.plan().stay(until=WHEN if now.time < WHEN else None), [0, 100]),
        (lambda now: now.plan().stay(10.4 * SECOND), [*range(0, 300, 11)]),
        (lambda now: now.plan(), range(300)),
        (lambda now: None, [0, 60, 120, 180, 240]),
    ],
    ids=["past time", "time", "end between two steps", "no time", "no plan"],
)
def test_who_decides_is_asked_again_when_its_plan_is_over(decide, expected):
    steps, decide = recording_steps(decide)
    run(decide)
    assert [*expected] == steps


def test_leaving_twice_and_coming_home_at_home_do_nothing():
    stored = run(lambda now: now.plan().come_home().leave_home().leave_home().stay())
    assert ["left_home"] == table(stored, "events")["event"].tolist()


@pytest.mark.parametrize(
    "go",
    [
        lambda plan, actor: plan.go_to("kitchen"),
        lambda plan, actor: plan.go_to_point(*actor.find("kitchen", 0, "spot")),
    ],
    ids=["place", "point"],
)
def test_who_is_away_comes_home_before_walking(go):
    def decide(now):
        if not now.actor.state.away:
            return now.plan().leave_home().stay(30 * SECOND)
        assert now.room is None
        return go(now.plan(), now.actor).stay()

    stored = run(decide)
    assert ["left_home", "came_home"] == table(stored, "events")["event"].tolist()
    poses = path(stored, "ana")
    assert not poses.away[-1]
    assert stored.plan.room("kitchen_1").index == poses.room[-1]


def test_notes_are_told_at_the_first_step_not_before_them():
    def decide(now):
        plan = now.plan().note("now").stay(2.5 * SECOND).note("later", "why")
        return plan.stay(1.5 * SECOND).note("on the step").stay(24 * HOUR).note("never")

    events = table(run(decide), "events")
    assert ["now", "later", "on the step"] == events["event"].tolist()
    assert [0, 3, 4] == events["step"].tolist()
    assert ["", "why", ""] == events["detail"].tolist()


def test_the_first_behavior_with_a_plan_is_followed():
    third, decide_third = recording_steps(minute)
    second, decide_second = recording_steps(lambda now: minute(now) if now.step >= 120 else None)
    first, decide_first = recording_steps(lambda now: minute(now) if now.step == 180 else None)
    run(decide_first, decide_second, decide_third)
    assert [0, 60, 120, 180, 240] == first
    assert [0, 60, 120, 240] == second
    assert [0, 60] == third


# --- Who decides -------------------------------------------------------------------------------


@pytest.mark.parametrize("decide", [(), (lambda now: None,)], ids=["no behavior", "no plan"])
def test_without_a_plan_it_stays_still(decide):
    poses = path(run(*decide), "ana")
    assert {(1.0, 3.0, 0.0)} == set(zip(poses.x, poses.y, poses.heading, strict=True))


def test_a_situation_tells_where_and_when_it_is():
    situations = []

    def decide(now):
        room = now.room.name if now.room else None
        situations.append((now.time - now.step * SECOND, now.xy, room, now.events))
        return now.plan().go_to([7.0, 1.0]).stay(timedelta(minutes=2))

    run(decide, duration="3 min")
    start = datetime(2026, 1, 5, 7)
    assert [
        (start, (1.0, 3.0), "living_room_1", ()),
        (start, (7.0, 1.0), "kitchen_1", ()),
    ] == situations


def test_draws_depend_on_body_purpose_and_step_only():
    drawn = {}

    def decide(now):
        for purpose in ("this", "that"):
            again = {now.random(purpose).uniform() for _ in range(2)}
            assert 1 == len(again)
            drawn[now.actor.name, purpose, now.step] = again.pop()
        return minute(now)

    fleet2d.run(scenario("3 min", users={"ana": entity_with(decide), "ben": entity_with(decide)}))
    assert 12 == len(drawn) == len(set(drawn.values()))
    before = dict(drawn)
    drawn.clear()
    fleet2d.run(
        scenario(
            "3 min",
            users={
                "cleo": entity_with(minute),
                "ana": entity_with(minute, decide),
                "ben": entity_with(decide),
            },
        )
    )
    assert 6 == len(drawn)
    assert before.items() >= drawn.items()


# --- Interruptions -----------------------------------------------------------------------------


def watched(decide, *others, **camera):
    """A user who leaves the living room after 100 s and comes back at 200 s, and a robot in it."""

    def leave(now):
        plan = now.plan().stay(timedelta(seconds=100)).go_to([7.0, 6.0])
        return plan.stay(until=datetime(2026, 1, 5, 7, 3, 20)).go_to([1.0, 3.0]).stay()

    lens = {"range": [0, 10], "angle_deg": 360, "lost_after": "5 s", **camera}
    robot = entity_with(decide, *others, start=[1.0, 1.0], camera=lens)
    return scenario("5 min", users={"ana": entity_with(leave)}, robots={"astro": robot})


def test_events_that_a_plan_names_end_it_at_the_next_step():
    told = []

    def decide(now):
        told.extend((now.step, e.event, e.user, e.x, e.y) for e in now.events)
        return now.plan().interrupt_on("user_seen", "user_lost").stay()

    stored = fleet2d.run(watched(decide))
    events, seen = table(stored, "events", entity="astro"), table(stored, "observations")
    assert ["user_seen", "user_lost", "user_seen"] == events["event"].tolist()
    last = np.searchsorted(seen["step"], events["step"], side="right") - 1
    expected = zip(events["step"] + 1, events["event"], ["ana"] * 3, seen["x"][last], seen["y"][last], strict=True)  # fmt: skip
    assert [*expected] == told


def test_events_that_a_plan_does_not_name_leave_it_alone():
    steps, decide = recording_steps(lambda now: now.plan().interrupt_on("user_lost").stay())
    stored = fleet2d.run(watched(decide))
    lost = table(stored, "events", event="user_lost")["step"].tolist()
    assert [0, *(step + 1 for step in lost)] == steps


def test_an_interrupted_body_goes_on_from_where_it_is():
    def decide(now):
        plan = now.plan().interrupt_on("user_lost", "user_seen")
        return plan.go_to([1.0, 3.0] if now.events else [4.5, 0.6]).stay()

    poses = path(fleet2d.run(watched(decide)), "astro")
    assert np.hypot(np.diff(poses.x), np.diff(poses.y)).max() <= 0.6 + 2e-3


# --- What a behavior may not do ----------------------------------------------------------------


def returns_the_same_plan_again():
    plans = []

    def decide(now):
        plans.append(minute(now))
        return plans[0]

    return decide


@pytest.mark.parametrize(
    ("decide", "words"),
    [
        (lambda now: 1 / 0, ["step 0", "ZeroDivisionError", "division by zero"]),
        (lambda now: now.outputs["ltp"], ["step 0", "KeyError", "ltp"]),
        (lambda now: "kitchen", ["decide() returned 'kitchen'", "plan or None"]),
        (lambda now: now.plan().go_to("attic"), ["step 0", "no room 'attic'", "kitchen_1"]),
        (lambda now: now.plan().go_to([10.0, 1.0]), ["can't be reached"]),
        (lambda now: now.plan().go_to(3), ["step 0", "expected a place"]),
        (lambda now: now.plan().stay(timedelta(seconds=-1)), ["can't stay for"]),
        (lambda now: now.plan().stay().go_to("kitchen"), ["can't go on"]),
        (lambda now: now.plan().stay().stay(timedelta(1)), ["can't go on"]),
        (lambda now: now.plan().interrupt_on("user_seen"), ["camera"]),
        (returns_the_same_plan_again(), ["begin here and now", "now.plan()"]),
    ],
)
def test_a_behavior_that_breaks_its_contract_is_named(decide, words):
    with pytest.raises(ComponentError) as caught:
        run(decide)
    assert not isinstance(caught.value, InputError)
    for word in ["users.ana", *words]:
        assert word in str(caught.value)


def test_an_event_that_there_is_not_is_refused_with_those_there_are():
    decide = entity_with(lambda now: now.plan().interrupt_on("doorbell"))
    with pytest.raises(ComponentError) as caught:
        fleet2d.run(scenario(robots={"astro": decide}))
    for word in ("robots.astro", "'doorbell'", "user_lost, user_seen"):
        assert word in str(caught.value)


def test_what_was_stored_before_a_failure_is_readable(tmp_path):
    def decide(now):
        assert now.step < 120, "enough"
        return minute(now)

    content = scenario(users={"ana": entity_with(decide)})
    message = r"users\.ana failed at step 120: AssertionError: enough"
    with pytest.raises(ComponentError, match=message):
        fleet2d.run(content, out=tmp_path / "run")
    stored = fleet2d.open_run(tmp_path / "run")
    assert ("failed", 120) == (stored.status, stored.manifest["steps"])
    assert [0, 60] == table(stored, "trajectories")["step"].tolist()


def test_a_start_that_fails_is_named_and_nothing_is_written(tmp_path):
    class Broken(Behavior):
        def start(self, actor):
            raise ValueError("not today")

    content = scenario(users={"ana": {"behaviors": [Broken()]}})
    with pytest.raises(
        ComponentError, match=r"users\.ana failed when it was started: ValueError: not today"
    ):
        fleet2d.run(content, out=tmp_path / "run")
    assert not (tmp_path / "run").exists()
