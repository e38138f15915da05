"""The phases of a span: in which order what happens at a step, and when a span ends."""

from datetime import timedelta

import pytest
from tests.scenes import digests, everything, run, scenario

import fleet2d
from fleet2d import Algorithm, Behavior, Metric
from fleet2d.engine import loop
from fleet2d.engine.loop import PHASES, Span
from fleet2d.entities.body import NEVER
from fleet2d.interventions import Replan, ShutDoor

STORY = []
"""What happened, as it happened: the step, and to whom."""


class Tell(Behavior):
    """Tells when it is asked, whether the door is shut then, and what it knows of who came before."""

    name: str

    def decide(self, now):
        shut = "shut" if now.home.shut else "open"
        STORY.append((now.step, f"{self.name}, {shut}"))
        return now.plan().stay(timedelta(minutes=1))


class Learn(Algorithm):
    """Tells when it is updated."""

    def update(self, history, state):
        STORY.append((state.step, "algorithm"))
        return {"at": state.step}


class Measure(Metric):
    """Tells when it is updated."""

    def update(self, history, state):
        STORY.append((state.step, f"metric after {state.outputs['learn']['at']}"))


def told(duration="150 s", **more):
    """A user and two robots who decide every minute, and a door that is shut after one."""

    def body(name):
        return {"start": [1.0, 3.0], "behaviors": [Tell(name=name)]}

    return scenario(
        duration,
        users={"zoe": body("zoe"), "ana": body("ana")},
        robots={"bolt": body("bolt"), "astro": body("astro")},
        objects={"door": {"type": "door", "doorway": "living_room_1-kitchen_1"}},
        script=[{"at": "1 min", "shut": "door"}],
        algorithms={"learn": {"type": f"{__name__}:Learn", "period": "1 min"}},
        metrics={"measure": {"type": f"{__name__}:Measure", "period": "1 min"}},
        **more,
    )


@pytest.fixture
def story():
    STORY.clear()
    yield STORY
    STORY.clear()


def test_phases_come_in_the_order_of_the_paper():
    names = ["intervene", "change_home", "decide", "move", "watch", "record", "learn"]
    assert names == [phase.__name__ for phase in PHASES]


@pytest.mark.parametrize("span", [None, 1, 7])
def test_in_a_step_come_home_users_robots_algorithms_metrics(story, span):
    run(told(), max_span=span)
    names = ("zoe", "ana", "bolt", "astro")
    learned = [(59, "algorithm"), (59, "metric after 59")]
    assert story == [
        *((0, f"{name}, open") for name in names),
        *learned,
        *((60, f"{name}, shut") for name in names),
        (119, "algorithm"),
        (119, "metric after 119"),
        *((120, f"{name}, shut") for name in names),
        (149, "metric after 119"),  # the rest, when the run ends
    ]


def test_what_a_script_does_at_a_step_comes_before_all_else(story):
    simulation = fleet2d.Simulation(told())
    simulation.advance(30)
    simulation.do(ShutDoor("door"))
    simulation.do(Replan("bolt"))
    simulation.advance(1)
    assert (30, "bolt, shut") == story[-1]


def spans_of(simulation, end):
    """Run span by span; yield each with where `move` would have ended it, and what was due."""
    state = simulation._state
    while simulation.step < end:
        span = Span(simulation.step, end)
        for phase in PHASES[: PHASES.index(loop.watch)]:
            phase(state, span)
        moved = span.end
        for phase in PHASES[PHASES.index(loop.watch) :]:
            phase(state, span)
        yield span, moved, state


@pytest.mark.parametrize("max_span", [None, 61])
def test_a_span_ends_where_something_is_due_and_not_before(max_span):
    content = everything("30 min")
    content["objects"] = {"door": {"type": "door", "doorway": "living_room_1-kitchen_1"}}
    content["script"] = [{"at": "10 min", "shut": "door"}]
    simulation = fleet2d.Simulation(content, max_span=max_span)
    begun = 0
    for span, moved, state in spans_of(simulation, 1800):
        assert begun == span.first < span.end <= moved
        assert span.end == state.bodies.step == simulation.step
        assert span.end - span.first <= (max_span or 1800)
        # Whoever is due has decided, and decides next at the end of the span or later.
        assert span.end <= state.bodies.next_decision() <= NEVER
        # Just one step beyond the span's, nobody but those who interrupt it would have been due.
        if span.end == moved < min(1800, span.first + (max_span or 1800)):
            due = [
                state.bodies.next_decision(),
                state.changes.next_due(),
                state.layers.next_due(span.first),
            ]
            learnt = span.end % 60 == 0  # the periods of learners here are whole minutes
            assert learnt or span.end in due
        assert state.settled <= span.end
        assert span.settles == (state.settled == span.end)
        begun = span.end
    assert 1800 == begun


def test_watchers_that_nobody_waits_for_take_in_many_spans_at_once():
    content = scenario(
        "1 h",
        users={"ana": {"type": "meander"}},
        robots={"astro": {"type": "patrol", "dwell": "20 s"}},
    )
    spans, settled = 0, 0
    simulation = fleet2d.Simulation(content)
    for span, _, state in spans_of(simulation, 3600):
        spans, settled = spans + 1, settled + span.settles
        assert all(watcher.next_step <= span.end for watcher in state.watchers)
    assert spans > 20
    assert 0 == settled
    assert digests(run(content)) == digests(simulation.finish())


def test_when_a_run_settles_all_watchers_have_taken_in_the_same_steps():
    simulation = fleet2d.Simulation(everything("20 min"))
    simulation.advance(333)
    simulation._state.settle(simulation.step)
    assert {333} == {watcher.next_step for watcher in simulation._state.watchers}
    assert 333 == simulation._state.settled
