"""Algorithms and metrics in a run: order, due steps, who reads what, and what is stored."""

from datetime import datetime, timedelta
from itertools import pairwise

import numpy as np
import pytest
from tests.scenes import scenario, table

import fleet2d
from fleet2d import Algorithm, Behavior, Metric
from fleet2d.algorithms.presence.belief import Presence
from fleet2d.engine.learners import update_order
from fleet2d.errors import ArtifactError, ComponentError, ScenarioError

_UPDATES = {}


class Told(Algorithm):
    """Does what a function of the test says."""

    name: str

    def update(self, history, state):
        return _UPDATES[self.name](history, state)


class ToldMetric(Metric):
    """The same, as a metric."""

    name: str

    def update(self, history, state):
        return _UPDATES[self.name](history, state)

    def result(self):
        return {"asked": 1}


def told(update, **fields):
    name = str(len(_UPDATES))
    _UPDATES[name] = update
    return {"type": f"{__name__}:Told", "name": name, **fields}


def algorithm(update, **fields):
    return Told(**{k: v for k, v in told(update, **fields).items() if k != "type"})


def metric(update, **fields):
    return ToldMetric(**{k: v for k, v in told(update, **fields).items() if k != "type"})


def watched(duration="30 min", **sections):
    """A user and a robot that sees her at times."""
    return scenario(
        duration,
        users={"ana": {"type": "meander"}},
        robots={"astro": {"type": "patrol", "dwell": "30 s"}},
        **sections,
    )


# --- Order -------------------------------------------------------------------------------------


def chain(**reads):
    return {name: algorithm(lambda h, s: None, reads=names) for name, names in reads.items()}


def test_who_reads_stands_behind_those_it_reads():
    order = update_order(chain(a=["d", "b"], b=["c"], c=[], d=["c"], e=[]))
    assert {"a", "b", "c", "d", "e"} == set(order)
    position = {name: i for i, name in enumerate(order)}
    assert position["c"] < min(position["b"], position["d"])
    assert max(position["b"], position["d"]) < position["a"]
    assert ["z", "m", "a"] == update_order(chain(z=[], m=[], a=[])), "the scenario's order"


def test_a_circle_is_refused_and_named():
    with pytest.raises(ScenarioError) as caught:
        fleet2d.Simulation(watched(algorithms=chain(a=["b"], b=["c"], c=["a"], d=[])))
    message = str(caught.value)
    circle = message.rpartition(": ")[2].split(" reads ")
    assert {"a", "b", "c"} == set(circle)
    assert circle[0] == circle[-1]
    reads = {"a": "b", "b": "c", "c": "a"}
    assert all(reads[x] == y for x, y in pairwise(circle))
    with pytest.raises(ScenarioError, match="a reads a"):
        update_order(chain(a=["a"]))


ERROR = {"type": "ltp_error", "of": "lpt"}


@pytest.mark.parametrize(
    ("sections", "words"),
    [
        ({"algorithms": chain(ltp=[], hangout=["lpt"])}, "algorithms.hangout.*did you mean 'ltp'"),
        ({"algorithms": chain(ltp=[]), "metrics": {"m": ERROR}}, "metrics.m.*did you mean 'ltp'"),
        ({"metrics": {"m": ERROR}}, "There are: none"),
        ({"algorithms": {"a": algorithm(None, period="90 ms")}}, "algorithms.a.period.*multiple"),
    ],
)
def test_what_can_not_be_is_refused_before_the_run(sections, words):
    with pytest.raises(ScenarioError, match=words):
        fleet2d.Simulation(watched(**sections))


def test_a_reader_sees_the_output_of_the_same_step_others_that_of_before():
    seen = {"reader": [], "behavior": [], "metric": []}

    def source(history, state):
        return {"end": history.end}

    def reader(history, state):
        seen["reader"].append((history.end, state.outputs["source"]["end"]))

    def judge(history, state):
        seen["metric"].append((history.end, state.outputs["source"]["end"]))

    class Look(Behavior):
        def decide(self, now):
            if "source" in now.outputs:
                seen["behavior"].append((now.step, now.outputs["source"]["end"]))
            else:
                seen["behavior"].append((now.step, None))
            return now.plan().stay(timedelta(seconds=1))

    fleet2d.run(
        watched("30 s", algorithms={
            "reader": algorithm(reader, reads=("source",), period="5 s"),
            "source": algorithm(source, period="5 s"),
        }, metrics={"judge": metric(judge, period="10 s")})
        | {"users": {"ana": {"behaviors": [Look()]}}}
    )  # fmt: skip
    ends = list(range(5, 31, 5))
    assert [(end, end) for end in ends] == seen["reader"]
    assert [(end, end) for end in ends[1::2]] == seen["metric"]
    # The output made at the end of step 4 is there from step 5 on.
    assert [(k, k // 5 * 5 or None) for k in range(30)] == seen["behavior"]


# --- When --------------------------------------------------------------------------------------


@pytest.mark.parametrize("max_span", [None, 7])
def test_histories_are_whole_periods_without_gaps(max_span):
    handed = {"a": [], "b": []}

    def record(name):
        def update(history, state):
            assert len(history) == history.end - history.first
            assert 1.0 == history.step_s
            handed[name].append((history.first, history.end, state.step, state.time))

        return update

    fleet2d.run(
        watched(
            "10 min",
            algorithms={
                "a": algorithm(record("a"), period="3 min"),
                "b": algorithm(record("b"), period="1 s"),
            },
        ),
        max_span=max_span,
    )
    start = datetime(2026, 1, 5, 7)
    assert [
        (first, first + 180, first + 179, start + timedelta(seconds=first + 179))
        for first in range(0, 540, 180)
    ] == handed["a"]
    assert [(k, k + 1, k, start + timedelta(seconds=k)) for k in range(600)] == handed["b"]


@pytest.mark.parametrize(
    ("period", "expected"),
    [("4 min", [(0, 240), (240, 480), (480, 600)]), ("5 min", [(0, 300), (300, 600)])],
)
def test_metrics_get_every_period_once_and_at_the_end_its_rest(period, expected):
    handed = []
    keep = metric(lambda h, s: handed.append((h.first, h.end)), period=period)
    fleet2d.run(watched("10 min", metrics={"m": keep}))
    assert expected == handed


# --- What they are handed ----------------------------------------------------------------------


def test_poses_and_observations_of_a_history_are_those_that_are_stored():
    found = {"ana": [], "astro": [], "observations": []}

    def update(history, state):
        steps = history.observations.step
        assert all(history.first <= k < history.end for k in steps)
        found["observations"].append(history.observations)
        for name in ("ana", "astro"):
            found[name].append(history.poses(name))

    def joined(name, column):
        return np.concatenate([getattr(part, column) for part in found[name]])

    content = watched("20 min", metrics={"m": metric(update, period="7 min")})
    content["users"]["ana"] = {
        "type": "schedule",
        "days": [{"items": [{"at": "06:00", "place": "kitchen"}, {"at": "07:05", "away": True},
                            {"at": "07:11:30", "place": "living_room"}]}],
    }  # fmt: skip
    stored = fleet2d.run(content, "artifacts.trajectories=every step")
    rooms = {room.name: room.index for room in stored.plan.rooms}
    for name in ("ana", "astro"):
        rows = table(stored, "trajectories", entity=name)
        here = ~rows["away"]
        assert rows["away"].tolist() == joined(name, "away").tolist()
        for column in ("x", "y"):
            assert rows[column][here].tolist() == joined(name, column)[here].tolist()
        assert rows["heading"] == pytest.approx(joined(name, "heading"))
        assert [rooms.get(r, -1) for r in rows["room"]] == joined(name, "room").tolist()
    rows = table(stored, "observations")
    assert len(rows["step"]) > 30
    for column in ("step", "x", "y"):
        assert rows[column].tolist() == joined("observations", column).tolist()
    assert [rooms[r] for r in rows["room"]] == joined("observations", "room").tolist()


def test_draws_of_an_algorithm_depend_on_path_purpose_and_step():
    drawn = {}

    def update(history, state):
        for purpose in ("this", "that"):
            drawn[state.path, purpose, state.step] = state.random(purpose).uniform()

    fleet2d.run(watched("5 min", algorithms={n: algorithm(update, period="60 s") for n in "ab"}))
    assert 20 == len(drawn) == len(set(drawn.values()))


# --- What is stored ----------------------------------------------------------------------------


def told_twice(update, name="a", **more):
    """A run of two minutes in which an algorithm is updated at steps 59 and 119."""
    return fleet2d.run(
        watched("2 min", algorithms={name: algorithm(update, period="60 s")}, **more)
    )


def test_outputs_become_rows_with_step_and_time():
    def update(history, state):
        late = history.end > 60
        return {"n": history.end, "share": 0.5, "late": late, "word": f"w{history.end}"}

    rows = table(told_twice(update), "a")
    assert ["step", "time", "n", "share", "late", "word"] == list(rows)
    assert [59, 119] == rows["step"].tolist()
    assert ["2026-01-05T07:00:59", "2026-01-05T07:01:59"] == [str(t)[:19] for t in rows["time"]]
    assert [60, 120] == rows["n"].tolist()
    assert [False, True] == rows["late"].tolist()
    assert ["w60", "w120"] == rows["word"].tolist()


def test_arrays_become_a_row_per_entry():
    rows = table(told_twice(lambda h, s: {"x": np.arange(2), "y": ["p", "q"]}), "a")
    assert [59, 59, 119, 119] == rows["step"].tolist()
    assert [0, 1, 0, 1] == rows["x"].tolist()
    assert ["p", "q", "p", "q"] == rows["y"].tolist()


def test_nothing_put_out_is_no_row_and_keeps_the_output_before():
    simulation = fleet2d.Simulation(
        watched(
            "2 min",
            algorithms={
                "once": algorithm(lambda h, s: {"n": 1} if h.end == 60 else None, period="60 s"),
                "never": algorithm(lambda h, s: None, period="60 s"),
            },
        )
    )
    stored = simulation.run()
    assert [1] == table(stored, "once")["n"].tolist()
    assert "never" not in stored.tables
    assert {"once": {"n": 1}} == simulation.outputs


@pytest.mark.parametrize("name", ["events", "trajectories", "observations", "key_frames", "same"])
def test_tables_of_one_name_are_told_apart_by_their_sections(name):
    measures = {"same": metric(lambda h, s: {"other": 0.5}, period="60 s")}
    stored = told_twice(lambda h, s: {"n": 1}, name, metrics=measures)
    of_algorithm = name if name == "same" else f"algorithms_{name}"
    assert [1, 1] == table(stored, of_algorithm)["n"].tolist()
    of_metric = "metrics_same" if name == "same" else "same"
    assert [0.5, 0.5] == table(stored, of_metric)["other"].tolist()


def test_columns_are_those_of_the_first_output():
    stored = told_twice(lambda h, s: {"mean": 0.5 if h.end == 60 else 1})
    assert [0.5, 1.0] == table(stored, "a")["mean"].tolist(), "whole numbers become fractions"

    with pytest.raises((ComponentError, ArtifactError)) as caught:
        told_twice(lambda h, s: {"mean": 0 if h.end == 60 else 0.5})
    for word in ("algorithms.a", "'mean'", "float64", "int64", "0.0"):
        assert word in str(caught.value)
    with pytest.raises(ComponentError, match=r"algorithms\.a returned x, y, but x before"):
        told_twice(lambda h, s: {"x": 1} if h.end == 60 else {"x": 1, "y": 2})


def test_outputs_may_be_left_unstored():
    metrics = {"m": metric(lambda h, s: {"n": 1}, period="60 s")}
    stored = told_twice(lambda h, s: {"n": 1}, metrics=metrics, artifacts={"outputs": False})
    assert not {"a", "m"} & set(stored.tables)
    assert {"m": {"asked": 1}} == stored.metrics


def presence(state, total=1.0):
    """Everybody as likely in each room, by shares of a sum."""
    rooms, users = len(state.home.rooms), len(state.users) + 1
    return Presence(
        state.users, np.full((users, rooms), total / rooms), np.zeros(users), state.time
    )


@pytest.mark.parametrize(
    ("output", "words"),
    [
        (lambda h, s: {"x": float("nan")}, ["not finite", "'x'"]),
        (lambda h, s: {"x": [1.0, float("inf")]}, ["not finite"]),
        (lambda h, s: fleet2d.RoomDistribution([1, 2]), ["2 shares", "6 rooms"]),
        (lambda h, s: fleet2d.RoomDistribution([float("nan")] * 6), ["finite"]),
        (lambda h, s: fleet2d.RoomDistribution([-1] * 6), ["at least 0"]),
        (lambda h, s: {"x": [1, 2], "y": [1, 2, 3]}, ["different lengths", "'x': 2", "'y': 3"]),
        (lambda h, s: 3, ["returned 3"]),
        (lambda h, s: {}, ["returned {}"]),
        (lambda h, s: {"x": None}, ["'x'"]),
        (lambda h, s: {"x": {"a": 1}}, ["'x'"]),
        (lambda h, s: {"x": np.zeros((2, 2))}, ["x"]),
        (lambda h, s: {"step": 1}, ["step"]),
        (lambda h, s: presence(s, 1.1), ["presence of 'ana' is not a distribution", "sum to 1.1"]),
        (lambda h, s: s.outputs["lpt"], ["no algorithm 'lpt'", "There are: mine"]),
        (lambda h, s: s.outputs["mine"], ["'mine'", "has no output yet"]),
        (lambda h, s: s.home.plan.room("attic"), ["no room 'attic'"]),
        (lambda h, s: s.home.layers["dust"], ["no layer 'dust'"]),
        (lambda h, s: presence(s).share("an"), ["'an'", "There are: ana, anyone"]),
        (lambda h, s: h.poses("astor"), ["'astor'", "no such body", "astro"]),
        (lambda h, s: h.poses("ana"), ["'ana'", "only metrics know where users are"]),
        (lambda h, s: h.evidence, ["needs = {'evidence'}"]),
        (lambda h, s: h.exposure, ["needs = {'exposure'}"]),
        (lambda h, s: {"n": len(h.between(0, h.end))}, ["looks_back"]),
        (lambda h, s: 1 / 0, ["ZeroDivisionError"]),
    ],
)
def test_an_output_that_can_not_be_is_an_error_with_a_name(output, words):
    with pytest.raises((ComponentError, ArtifactError)) as caught:
        told_twice(output, "mine")
    for word in ("algorithms.mine", *words):
        assert word in str(caught.value)


def test_an_algorithm_that_fails_to_start_is_named():
    class Broken(Algorithm):
        def start(self, home):
            raise OSError("no such model")

    with pytest.raises(
        ComponentError, match=r"algorithms\.a failed when it was started: OSError: no such model"
    ):
        fleet2d.Simulation(watched(algorithms={"a": Broken()}))
