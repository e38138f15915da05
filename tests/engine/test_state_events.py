"""Events of a run: each is made once, handed to all, and kept for a while."""

import copy
import pickle
from contextlib import nullcontext

import pytest
from tests.scenes import everything, run, table

import fleet2d
from fleet2d.engine.state import EventStream, Listener
from fleet2d.errors import InputError
from fleet2d.runtime.events import CHANGES, HOME, SIGHTS, Event, EventKind


class Sink:
    """Keeps what it is handed."""

    def __init__(self):
        self.taken = []

    def take_events(self, events):
        self.taken.append(list(events))


def event(step, kind="found", entity="ana"):
    return Event(step, entity, kind, "")


class Short(EventStream):
    """Keeps five events."""

    CAPACITY = 5


def test_every_sink_is_handed_each_event_once_in_the_order_it_became_known():
    sinks = [Sink(), Sink()]
    stream = EventStream(sinks)
    stream.emit([event(7), event(3)])
    stream.emit([])
    stream.emit([event(5)])
    for sink in sinks:
        assert [[event(7), event(3)], [event(5)]] == sink.taken


def test_events_since_a_step_are_in_order_of_step_and_of_kind():
    stream = EventStream()
    seen, shut = event(4, "user_seen"), event(4, "shut", HOME)
    zoe, ana = event(4, entity="zoe"), event(4)
    stream.emit([event(9), seen, shut])
    stream.emit([zoe, ana, event(2)])
    assert [event(2), zoe, ana, seen, shut, event(9)] == stream.since(0), "zoe was known first"
    assert [event(9)] == stream.since(5)
    assert [] == stream.since(10)


@pytest.mark.parametrize(
    ("emitted", "kept", "first"),
    [
        ([range(5)], [0, 1, 2, 3, 4], 0),
        ([range(5), [5, 6]], [2, 3, 4, 5, 6], 2),
        ([[90, 1, 2], [3, 4, 5]], [], 91),
        ([range(12)], [7, 8, 9, 10, 11], 7),
    ],
    ids=["as many as are kept", "two more", "one became known early", "too many at once"],
)
def test_events_that_are_no_longer_kept_are_asked_for_in_vain(emitted, kept, first):
    sink = Sink()
    stream = Short([sink])
    for steps in emitted:
        stream.emit([event(step) for step in steps])
    assert [len(steps) for steps in emitted] == [len(taken) for taken in sink.taken]
    assert kept == [each.step for each in stream.since(first)]
    if first:
        with pytest.raises(InputError, match=f"from step {first} on are kept, not from step"):
            stream.since(first - 1)


def test_a_function_listens_and_stays_behind_when_a_stream_is_copied():
    heard = []
    sink = Sink()
    stream = EventStream([sink])
    stream.listeners.append(Listener(heard.extend, {event(1).event}))
    stream.emit([event(1)])
    stream.deliver(2)
    for copied in (copy.deepcopy(stream), pickle.loads(pickle.dumps(stream))):
        copied.emit([event(2)])
        copied.deliver(3)
        assert [event(1), event(2)] == copied.since(0)
        assert [[event(1)], [event(2)]] == copied.sinks[0].taken
    assert [event(1)] == heard == stream.since(0)
    assert 1 == len(sink.taken)


@pytest.mark.parametrize("count", [0, 1, 4, 5, 9])
def test_a_copied_stream_has_the_same_events_and_keeps_as_many(count):
    stream = Short()
    for step in range(count):
        stream.emit([Event(step, "ana", EventKind.FOUND if step % 2 else "waves", f"é{step}")])
    for copied in (copy.deepcopy(stream), pickle.loads(pickle.dumps(stream))):
        assert list(stream._recent) == list(copied._recent)
        assert {Event} >= {type(event) for event in copied._recent}
        copied.emit([event(20), event(21)])
        assert [*stream._recent, event(20), event(21)][-5:] == list(copied._recent)
        with pytest.raises(InputError) if count > 3 else nullcontext():
            copied.since(0)


def test_plans_come_before_cameras_and_the_home_comes_last():
    rank = {kind: event(0, kind).rank for kind in EventKind}
    assert {0} == {rank[kind] for kind in EventKind if kind not in SIGHTS | CHANGES}
    assert {1} == {rank[kind] for kind in SIGHTS}
    assert {2} == {rank[kind] for kind in CHANGES}
    assert 0 == event(0, "of a behavior's own").rank


# --- In runs -----------------------------------------------------------------------------------


def listened(content, **settings):
    """Return what a sink of its own hears of a whole run, and the run."""
    simulation, sink = fleet2d.Simulation(content, **settings), Sink()
    simulation._state.events.sinks.append(sink)
    stored = simulation.run()
    return [event for events in sink.taken for event in events], stored


def rows(stored):
    """Return the table of events as events."""
    columns = table(stored, "events")
    detail = [
        user if isinstance(user, str) else text
        for user, text in zip(columns["user"], columns["detail"], strict=True)
    ]
    keys = (columns["step"].tolist(), columns["entity"], columns["event"], detail)
    return list(zip(*keys, strict=True))


@pytest.mark.parametrize("span", [None, 1, 61])
def test_a_sink_hears_just_the_rows_of_the_table(span):
    heard, stored = listened(everything("20 min"), max_span=span)
    assert len(heard) > 50
    assert sorted(map(tuple, heard)) == sorted(rows(stored))


def test_the_table_is_in_order_of_step_entity_and_rank():
    content = everything(
        "1 h", objects={"door": {"type": "door", "doorway": "living_room_1-kitchen_1"}}
    )
    content["script"] = [{"at": "10 min", "shut": "door"}, {"at": "20 min", "open": "door"}]
    stored = run(content)
    order = ["ana", "ben", "astro", "bolt", "curio", "drift", "ego", "door"]
    keys = [(step, order.index(who), event(0, kind).rank) for step, who, kind, _ in rows(stored)]
    assert keys == sorted(keys)
    assert {"shut", "opened"} <= {kind for _, _, kind, _ in rows(stored)}
