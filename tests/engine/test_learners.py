"""Algorithms and metrics in a run: order, due steps, who reads what, and what is stored."""

from collections.abc import Callable
from datetime import datetime, timedelta
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from tests.scenes import each_step, scenario, table

import fleet2d
from fleet2d import Algorithm, Behavior, History, Home, Metric, Plan, Present, Situation
from fleet2d.engine.learners import update_order
from fleet2d.errors import ArtifactError, ComponentError, ScenarioError

Update = Callable[[History, Present], Any]
_UPDATES: dict[str, Update] = {}
_LOG: list[Any] = []


class Told(Algorithm):
    """Does what a function of the test says."""

    name: str

    def update(self, history: History, state: Present) -> Any:
        return _UPDATES[self.name](history, state)


class ToldMetric(Metric):
    """The same, as a metric."""

    name: str

    def update(self, history: History, state: Present) -> Any:
        return _UPDATES[self.name](history, state)

    def result(self) -> dict[str, Any]:
        return {"asked": 1}


def told(update: Update, **fields: Any) -> dict[str, Any]:
    name = str(len(_UPDATES))
    _UPDATES[name] = update
    return {"type": f"{__name__}:Told", "name": name, **fields}


def algorithm(update: Update, **fields: Any) -> Told:
    return Told(**{k: v for k, v in told(update, **fields).items() if k != "type"})


def metric(update: Update, **fields: Any) -> ToldMetric:
    return ToldMetric(**{k: v for k, v in told(update, **fields).items() if k != "type"})


def watched(duration: str = "30 min", **sections: Any) -> dict[str, Any]:
    """A user and a robot that sees her at times."""
    return scenario(
        duration,
        users={"ana": {"type": "meander"}},
        robots={"astro": {"type": "patrol", "dwell": "30 s"}},
        **sections,
    )


# --- Order -------------------------------------------------------------------------------------


def chain(**reads: list[str]) -> dict[str, Algorithm]:
    return {name: algorithm(lambda h, s: None, reads=names) for name, names in reads.items()}


def test_who_reads_stands_behind_those_it_reads():
    order = update_order(chain(a=["d", "b"], b=["c"], c=[], d=["c"], e=[]))
    assert {"a", "b", "c", "d", "e"} == set(order)
    position = {name: i for i, name in enumerate(order)}
    assert position["c"] < min(position["b"], position["d"])
    assert max(position["b"], position["d"]) < position["a"]


def test_without_reads_the_order_is_that_of_the_scenario():
    assert ["z", "m", "a"] == update_order(chain(z=[], m=[], a=[]))


def test_a_circle_is_refused_and_named():
    with pytest.raises(ScenarioError) as caught:
        fleet2d.Simulation(watched(algorithms=chain(a=["b"], b=["c"], c=["a"], d=[])))
    message = str(caught.value)
    circle = message.rpartition(": ")[2].split(" reads ")
    assert {"a", "b", "c"} == set(circle)
    assert circle[0] == circle[-1]
    reads = {"a": "b", "b": "c", "c": "a"}
    assert all(reads[x] == y for x, y in pairwise(circle))


def test_reading_itself_is_a_circle():
    with pytest.raises(ScenarioError, match="a reads a"):
        update_order(chain(a=["a"]))


def test_reading_what_is_missing_is_refused_with_what_there_is():
    with pytest.raises(ScenarioError) as caught:
        fleet2d.Simulation(watched(algorithms=chain(ltp=[], hangout=["lpt"])))
    for word in ("algorithms.hangout", "'lpt'", "did you mean 'ltp'"):
        assert word in str(caught.value)


@pytest.mark.parametrize("type_", ["ltp_error", "ltp_gap", "rtp_score"])
def test_a_metric_of_an_algorithm_that_is_missing_is_refused_with_what_there_is(type_):
    with pytest.raises(ScenarioError) as caught:
        fleet2d.Simulation(
            watched(algorithms=chain(ltp=[]), metrics={"error": {"type": type_, "of": "lpt"}})
        )
    for word in ("metrics.error", "'lpt'", "did you mean 'ltp'"):
        assert word in str(caught.value)


def test_a_metric_of_an_algorithm_is_refused_where_there_is_none():
    with pytest.raises(ScenarioError, match="There are: none"):
        fleet2d.Simulation(watched(metrics={"error": {"type": "ltp_error", "of": "ltp"}}))


def test_a_reader_sees_the_output_of_the_same_step_others_that_of_before():
    seen: dict[str, list[Any]] = {"reader": [], "behavior": [], "metric": []}

    def source(history: History, state: Present) -> Any:
        return {"end": history.end}

    def reader(history: History, state: Present) -> None:
        seen["reader"].append((history.end, state.outputs["source"]["end"]))

    def judge(history: History, state: Present) -> None:
        seen["metric"].append((history.end, state.outputs["source"]["end"]))

    class Look(Behavior):
        def decide(self, now: Situation) -> Plan:
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
    handed: dict[str, list[tuple[int, int, int, datetime]]] = {"a": [], "b": []}

    def record(name: str) -> Update:
        def update(history: History, state: Present) -> None:
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
    handed: list[tuple[int, int]] = []
    keep = metric(lambda h, s: handed.append((h.first, h.end)), period=period)
    fleet2d.run(watched("10 min", metrics={"m": keep}))
    assert expected == handed


@pytest.mark.parametrize("period", ["1.5 s", "90 ms"])
def test_a_period_that_is_no_multiple_of_the_step_is_refused(period):
    with pytest.raises(ScenarioError) as caught:
        fleet2d.Simulation(watched(algorithms={"a": algorithm(lambda h, s: None, period=period)}))
    for word in ("algorithms.a.period", "multiple", "1 s"):
        assert word in str(caught.value)


def test_two_runs_of_one_scenario_do_not_share_state():
    class Count(Algorithm):
        def start(self, home: Home) -> None:
            self.count = 0

        def update(self, history: History, state: Present) -> Any:
            self.count += 1
            return {"count": self.count}

    loaded = fleet2d.load_scenario(watched("10 min", algorithms={"c": Count(period="1 min")}))
    for _ in range(2):
        assert list(range(1, 11)) == table(fleet2d.run(loaded), "c")["count"].tolist()


# --- What they are handed ----------------------------------------------------------------------


def test_poses_and_observations_of_a_history_are_those_that_are_stored():
    found: list[Any] = []

    def update(history: History, state: Present) -> None:
        observations = history.observations
        assert observations.step.tolist() == sorted(observations.step.tolist())
        assert all(history.first <= k < history.end for k in observations.step)
        found.append((history.poses("ana"), history.poses("astro"), observations))

    content = watched("20 min", metrics={"m": metric(update, period="7 min")})
    content["users"]["ana"] = {
        "type": "schedule",
        "days": [{"items": [{"at": "06:00", "place": "kitchen"}, {"at": "07:05", "away": True},
                            {"at": "07:11:30", "place": "living_room"}]}],
    }  # fmt: skip
    stored = fleet2d.run(content, "artifacts.trajectories=every step")
    rooms = {room.name: room.index for room in stored.plan.rooms}
    for body, name in enumerate(("ana", "astro")):
        rows = table(stored, "trajectories", entity=name)
        x, y, heading, away, room = (
            np.concatenate([getattr(entry[body], column) for entry in found])
            for column in ("x", "y", "heading", "away", "room")
        )
        here = ~rows["away"]
        assert rows["away"].tolist() == away.tolist()
        assert rows["x"][here].tolist() == x[here].tolist()
        assert rows["y"][here].tolist() == y[here].tolist()
        assert rows["heading"] == pytest.approx(heading)
        assert [rooms.get(r, -1) for r in rows["room"]] == room.tolist()
    assert away.size == 1200
    rows = table(stored, "observations")
    assert len(rows["step"]) > 30
    for column in ("step", "x", "y"):
        seen = np.concatenate([getattr(entry[2], column) for entry in found])
        assert rows[column].tolist() == seen.tolist()
    seen = np.concatenate([entry[2].room for entry in found])
    assert [rooms[r] for r in rows["room"]] == seen.tolist()


def test_algorithms_may_ask_for_robots_but_not_for_users():
    def update(history: History, state: Present) -> None:
        assert 60 == len(history.poses("astro").x)
        assert (("ana",), ("astro",)) == (state.users, state.robots)
        history.poses("ana")

    with pytest.raises(ComponentError) as caught:
        fleet2d.run(watched(algorithms={"a": algorithm(update, period="60 s")}))
    for word in ("algorithms.a", "'ana'", "only metrics know where users are", "astro"):
        assert word in str(caught.value)


def test_an_unknown_body_is_refused_with_those_there_are():
    with pytest.raises(ComponentError, match=r"no such body.*ana, astro"):
        fleet2d.run(watched(metrics={"m": metric(lambda h, s: h.poses("bob"), period="60 s")}))


def test_draws_of_an_algorithm_depend_on_path_purpose_and_step():
    drawn: dict[Any, float] = {}

    def update(history: History, state: Present) -> None:
        for purpose in ("this", "that"):
            drawn[state.path, purpose, state.step] = state.random(purpose).uniform()

    fleet2d.run(watched("5 min", algorithms={n: algorithm(update, period="60 s") for n in "ab"}))
    assert 20 == len(drawn) == len(set(drawn.values()))


# --- What is stored ----------------------------------------------------------------------------


def test_outputs_become_rows_with_step_and_time():
    def update(history: History, state: Present) -> Any:
        return {"n": history.end, "share": 0.5, "late": history.end > 60, "word": f"w{history.end}"}

    rows = table(
        fleet2d.run(watched("2 min", algorithms={"a": algorithm(update, period="60 s")})), "a"
    )
    assert ["step", "time", "n", "share", "late", "word"] == list(rows)
    assert [59, 119] == rows["step"].tolist()
    assert ["2026-01-05T07:00:59", "2026-01-05T07:01:59"] == [str(t)[:19] for t in rows["time"]]
    assert [60, 120] == rows["n"].tolist()
    assert [False, True] == rows["late"].tolist()
    assert ["w60", "w120"] == rows["word"].tolist()


def test_arrays_become_a_row_per_entry():
    stored = fleet2d.run(
        watched(
            "1 min",
            algorithms={
                "a": algorithm(
                    lambda h, s: {"x": np.arange(3), "y": ["p", "q", "r"]}, period="30 s"
                )
            },
        )
    )
    rows = table(stored, "a")
    assert [29] * 3 + [59] * 3 == rows["step"].tolist()
    assert [0, 1, 2] * 2 == rows["x"].tolist()
    assert ["p", "q", "r"] * 2 == rows["y"].tolist()


def test_nothing_put_out_is_no_table_and_no_output():
    simulation = fleet2d.Simulation(
        watched("2 min", algorithms={"a": algorithm(lambda h, s: None, period="60 s")})
    )
    stored = simulation.run()
    assert "a" not in stored.tables
    assert {} == simulation.outputs


def test_an_output_of_none_keeps_the_one_before():
    update = lambda h, s: {"end": h.end} if h.end == 60 else None  # noqa: E731
    simulation = fleet2d.Simulation(
        watched("3 min", algorithms={"a": algorithm(update, period="60 s")})
    )
    simulation.run()
    assert {"a": {"end": 60}} == simulation.outputs


@pytest.mark.parametrize("name", ["events", "trajectories", "observations", "key_frames"])
def test_an_algorithm_may_be_called_like_a_table_of_the_engine(name):
    stored = fleet2d.run(
        watched("2 min", algorithms={name: algorithm(lambda h, s: {"n": 1}, period="60 s")})
    )
    assert [1, 1] == table(stored, f"algorithms_{name}")["n"].tolist()


def test_an_algorithm_and_a_metric_of_one_name_have_a_table_each():
    stored = fleet2d.run(
        watched(
            "2 min",
            algorithms={"same": algorithm(lambda h, s: {"n": 1}, period="60 s")},
            metrics={"same": metric(lambda h, s: {"other": 0.5, "more": 1}, period="60 s")},
        )
    )
    assert [1, 1] == table(stored, "same")["n"].tolist()
    assert [0.5, 0.5] == table(stored, "metrics_same")["other"].tolist()


def test_fractions_where_whole_numbers_came_first_are_refused():
    update = lambda h, s: {"mean": 0 if h.end == 60 else 0.5}  # noqa: E731
    with pytest.raises((ComponentError, ArtifactError)) as caught:
        fleet2d.run(watched("2 min", algorithms={"a": algorithm(update, period="60 s")}))
    for word in ("algorithms.a", "'mean'", "float64", "int64", "0.0"):
        assert word in str(caught.value)


def test_whole_numbers_where_fractions_came_first_are_stored():
    update = lambda h, s: {"mean": 0.5 if h.end == 60 else 1}  # noqa: E731
    stored = fleet2d.run(watched("2 min", algorithms={"a": algorithm(update, period="60 s")}))
    assert [0.5, 1.0] == table(stored, "a")["mean"].tolist()


def test_other_columns_than_before_are_refused():
    update = lambda h, s: {"x": 1} if h.end == 60 else {"x": 1, "y": 2}  # noqa: E731
    with pytest.raises(ComponentError, match=r"algorithms\.a returned x, y, but x before"):
        fleet2d.run(watched("2 min", algorithms={"a": algorithm(update, period="60 s")}))


def test_what_one_component_does_to_its_history_is_not_seen_by_others():
    seen: list[list[float]] = []

    def spoil(history: History, state: Present) -> None:
        poses, observations = history.poses("ana"), history.observations
        seen.append([*poses.x.tolist(), *poses.room.tolist(), *observations.x.tolist()])
        for array in (poses.x, poses.xy, poses.heading, poses.room, poses.away, observations.x):
            try:
                array[:] = 0
            except ValueError:
                assert not array.flags.writeable

    names = {"a": metric(spoil, period="60 s"), "b": metric(spoil, period="60 s")}
    stored = fleet2d.run(watched("10 min", metrics=names))
    assert len(table(stored, "observations")["x"])
    assert table(stored, "observations")["x"].all()
    assert seen[0::2] == seen[1::2]


def test_outputs_may_be_left_unstored():
    content = watched(
        "2 min",
        algorithms={"a": algorithm(lambda h, s: {"n": 1}, period="60 s")},
        metrics={"m": metric(lambda h, s: {"n": 1}, period="60 s")},
        artifacts={"outputs": False},
    )
    stored = fleet2d.run(content)
    assert not {"a", "m"} & set(stored.tables)
    assert {"m": {"asked": 1}} == stored.metrics


@pytest.mark.parametrize(
    ("output", "words"),
    [
        (lambda s: {"x": float("nan")}, ["not finite", "'x'"]),
        (lambda s: {"x": [1.0, float("inf")]}, ["not finite"]),
        (lambda s: fleet2d.RoomDistribution([1, 2]), ["2 shares", "6 rooms"]),
        (lambda s: fleet2d.RoomDistribution([float("nan")] * 6), ["finite"]),
        (lambda s: fleet2d.RoomDistribution([-1] * 6), ["at least 0"]),
        (lambda s: {"x": [1, 2], "y": [1, 2, 3]}, ["different lengths", "'x': 2", "'y': 3"]),
        (lambda s: 3, ["returned 3"]),
        (lambda s: {}, ["returned {}"]),
        (lambda s: {"x": None}, ["'x'"]),
        (lambda s: {"x": {"a": 1}}, ["'x'"]),
        (lambda s: {"x": np.zeros((2, 2))}, ["x"]),
        (lambda s: {"step": 1}, ["step"]),
        (lambda s: s.outputs["ltp"], ["no algorithm 'ltp'", "There are: mine"]),
        (lambda s: s.home.plan.room("attic"), ["no room 'attic'"]),
        (lambda s: 1 / 0, ["ZeroDivisionError"]),
    ],
)
def test_an_output_that_can_not_be_is_an_error_with_a_name(output, words):
    with pytest.raises((ComponentError, ArtifactError)) as caught:
        fleet2d.run(
            watched("2 min", algorithms={"mine": algorithm(lambda h, s: output(s), period="60 s")})
        )
    for word in ("algorithms.mine", *words):
        assert word in str(caught.value)


def test_an_algorithm_that_fails_to_start_is_named():
    class Broken(Algorithm):
        def start(self, home: Home) -> None:
            raise OSError("no such model")

    with pytest.raises(
        ComponentError, match=r"algorithms\.a failed when it was started: OSError: no such model"
    ):
        fleet2d.Simulation(watched(algorithms={"a": Broken()}))


def test_the_history_is_the_same_whatever_else_is_due_meanwhile():
    def record(history: History, state: Present) -> Any:
        poses = history.poses("astro")
        return {
            "x": poses.x[::100],
            "seen": np.full(len(poses.x[::100]), len(history.observations.step)),
        }

    alone = table(fleet2d.run(watched(algorithms={"a": algorithm(record, period="15 min")})), "a")
    beside = {
        "a": algorithm(record, period="15 min"),
        "b": algorithm(lambda h, s: None, period="7 s"),
        "c": algorithm(lambda h, s: None, period="4 min"),
    }
    among = table(fleet2d.run(watched(algorithms=beside)), "a")
    for column in alone:
        assert alone[column].tolist() == among[column].tolist()
    rows = each_step(watched(), "astro")
    assert rows["x"][::100].tolist() == alone["x"].tolist()
