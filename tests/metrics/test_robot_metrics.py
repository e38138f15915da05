"""Metrics of robots among people, against what an every-step record of a run says."""

from datetime import timedelta
from itertools import groupby, pairwise
from math import dist

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from tests.entities.robots.robots import CAMERA, events
from tests.entities.robots.test_find import belief
from tests.scenes import flat_document, run, scenario, table

from fleet2d import Algorithm, Behavior, Metric
from fleet2d.configuration.components import lookup
from fleet2d.metrics.metric import kaplan_meier, quantile, restricted_mean

BATTERY = {"driving": "20 min", "standing": "1 h", "charging": "10 min", "charger": [1.0, 3.0]}
OUT_LATER = {
    "days": [{"items": [{"at": "00:00", "place": [7.0, 6.0]}, {"at": "08:10", "away": True}]}]
}
METRICS = (
    "co_presence",
    "reach_time",
    "intrusion",
    "blocking",
    "travel",
    "time_to_find",
    "coverage",
    "battery",
)


def content(period="17 min"):
    find = {"type": "find", "user": "ana", "every": "9 min", "deadline": "3 min", "source": "rtp"}
    return scenario(
        "1 h 40 min",
        users={"ana": {"type": "schedule", **OUT_LATER}, "ben": {"type": "meander", "speed": 0.7}},
        robots={
            "astro": {
                "start": [1.0, 3.0],
                "camera": CAMERA,
                "battery": BATTERY,
                "behaviors": ["dock", find, {"type": "patrol", "dwell": "90 s"}],
            },
            "bolt": {"type": "meander"},
        },
        metrics={name: {"period": period} for name in METRICS},
        artifacts={"trajectories": "every step"},
        **belief(bathroom_1=1, kitchen_1=1, away=0.4),
    )


@pytest.fixture(scope="module")
def stored():
    """A run whose length is no multiple of the metrics' period."""
    return run(content())


def poses(stored, name):
    return table(stored, "trajectories", entity=name)


def gaps(stored, robot, user):
    one, other = poses(stored, robot), poses(stored, user)
    return np.hypot(one["x"] - other["x"], one["y"] - other["y"])


@pytest.mark.parametrize("period", ["11 min", "1 d"])
def test_results_do_not_depend_on_the_period(stored, period):
    other = run(content(period)).metrics
    for metric in METRICS:
        assert flat(other[metric]) == {
            k: pytest.approx(v, rel=1e-9) for k, v in flat(stored.metrics[metric]).items()
        }


def flat(result, path=""):
    if not isinstance(result, dict):
        return {path: result}
    return {k: v for key, value in result.items() for k, v in flat(value, f"{path}.{key}").items()}


@pytest.mark.parametrize(("robot", "user"), [("astro", "ana"), ("bolt", "ben")])
def test_co_presence_is_the_share_of_time_at_home_in_the_same_room(stored, robot, user):
    one, other = poses(stored, robot), poses(stored, user)
    home = ~other["away"]
    together = home & (one["room"] == other["room"])
    assert stored.metrics["co_presence"][robot][user] == pytest.approx(together.sum() / home.sum())


def test_intrusion_is_the_time_in_each_zone_without_a_wall_between(stored):
    parts = [shapely.Polygon(f["outline"], f["holes"]) for f in flat_document()["free"]]
    space = shapely.union_all(parts)
    shapely.prepare(space)
    ends = [np.stack([p["x"], p["y"]], axis=1) for p in (poses(stored, n) for n in ("bolt", "ben"))]
    is_clear = shapely.contains_properly(space, shapely.linestrings(np.stack(ends, axis=1)))
    zones = np.histogram(gaps(stored, "bolt", "ben")[is_clear], [0, 0.45, 1.2, 3.6])[0]
    result = stored.metrics["intrusion"]["bolt"]["ben"]
    # Minutes a day. A line that all but touches a corner may be told otherwise.
    assert zones / 60 * 14.4 == pytest.approx(
        [result[zone] for zone in ("intimate", "personal", "social")], abs=0.05 * 14.4
    )
    assert result["social"] > 10


def test_blocks_are_runs_of_steps_in_which_somebody_walks_into_the_robot(stored):
    ben, gap = poses(stored, "ben"), gaps(stored, "bolt", "ben")
    moves = (np.diff([ben["x"], ben["y"]]) != 0).any(axis=0)
    blocked = moves & (np.minimum(gap[1:], gap[:-1]) < 0.4)
    begins = np.count_nonzero(np.diff(blocked, prepend=False) & blocked)
    result = stored.metrics["blocking"]["bolt"]["ben"]
    assert blocked.sum() > 3
    assert result["seconds"] == pytest.approx(blocked.sum() * 14.4)
    assert result["blocks"] == pytest.approx(begins * 14.4)


def test_users_who_step_aside_for_a_robot_are_counted():
    stands = {"type": "schedule", "days": [{"items": [{"at": "00:00", "place": [3.0, 3.1]}]}]}
    polite = {"type": "reactions", "manners": {"steps_aside": 1, "turns": 0}}
    to_and_fro = {"type": "patrol", "waypoints": [[1.0, 3.1], [4.5, 3.1]], "dwell": "1 min"}
    stored = run(
        scenario(
            "1 h 40 min",
            users={"ana": {"behaviors": [polite, stands]}},
            robots={
                "astro": {"start": [1.0, 3.1], **to_and_fro},
                "bolt": {"type": f"{__name__}:Polite", "start": "bedroom"},
            },
            metrics={"blocking": {"period": "7 min"}},
        )
    )
    aside = [row for row in events(stored, "ana") if row[2] == "steps aside for astro"]
    result = stored.metrics["blocking"]
    assert len(aside) > 3
    assert result["astro"]["ana"]["asides"] == pytest.approx(len(aside) * 14.4)
    # Robots that step aside for a robot don't count.
    assert events(stored, "bolt")
    assert ["ana"] == [*result["astro"]] == [*result["bolt"]]


class Polite(Behavior):
    """Steps aside for another robot, in words."""

    def decide(self, now):
        return now.plan().note("reacts", "steps aside for astro").stay(timedelta(minutes=5))


def test_travel_counts_rests_apart_and_metres(stored):
    astro = poses(stored, "astro")
    places = groupby(zip(astro["x"].tolist(), astro["y"].tolist(), strict=True))
    rests = [place for place, steps in places if len(list(steps)) >= 60]
    moves = sum(dist(a, b) > 0.5 for a, b in pairwise(rests))
    result = stored.metrics["travel"]["astro"]
    assert moves > 10
    assert result["relocations"] == pytest.approx(moves * 14.4)
    metres = np.hypot(np.diff(astro["x"]), np.diff(astro["y"])).sum()
    assert result["metres"] == pytest.approx(metres * 14.4)


@pytest.mark.parametrize(("apart", "moves"), [(0.0, 2), (0.4, 1), (0.6, 0)])
def test_rests_count_if_they_are_farther_apart(apart, moves):
    walk = [[1.0, 3.0], [1.5, 3.0], [1.4, 3.0]]
    tour = {"type": "patrol", "waypoints": walk, "dwell": "2 min", "start": [1.0, 3.0]}
    content = scenario("6 min", robots={"astro": tour}, metrics={"travel": {"apart": apart}})
    assert run(content).metrics["travel"]["astro"]["relocations"] == pytest.approx(moves * 240)


def test_reach_time_is_the_distance_at_call_times_divided_by_speed(stored):
    calls = np.arange(0, 6000, 600)
    calls = calls[~poses(stored, "ana")["away"][calls]]
    straight = gaps(stored, "astro", "ana")[calls] / 0.6
    result = stored.metrics["reach_time"]["astro"]["ana"]
    assert len(calls) == result["calls"]
    assert straight.mean() <= result["mean"] <= min(result["p90"], 3 * straight.mean())


def test_coverage_follows_from_the_layer_at_the_end(stored):
    result = stored.metrics["coverage"]["astro"]
    assert 0.5 < result["share"] < 1
    assert 0 < result["half_h"] <= 1.67
    rows = table(stored, "coverage", robot="astro")
    assert rows["share"].tolist() == sorted(rows["share"].tolist())
    assert rows["share"][-1] == pytest.approx(result["share"])


def test_battery_has_the_lowest_charge_and_the_dockings(stored):
    rows = [row for row in events(stored) if row[1] in ("battery", "docks", "charged")]
    levels = [float(detail.split()[0]) for *_, detail in rows]
    docks = [name for _, name, _ in rows].count("docks")
    result = stored.metrics["battery"]
    assert {"astro"} == set(result)
    assert result["astro"]["lowest"] == pytest.approx(min(levels) / 100)
    assert result["astro"]["dockings"] == pytest.approx(docks * 14.4)
    assert 0 < result["astro"]["charging"] < 1


def test_time_to_find_has_outcomes_and_times(stored):
    rows = table(stored, "time_to_find", robot="astro")
    found = ("found", "gave_up", "not_at_home")
    begun = [step for step, name, _ in events(stored) if name == "find_begins"]
    ends = [(step, name) for step, name, _ in events(stored) if name in found]
    assert begun[: len(ends)] == rows["began"].tolist()
    assert ends == list(zip(rows["began"] + rows["seconds"], rows["end"], strict=True))
    home = rows["at_home"]
    assert {True, False} == set(home)
    result = stored.metrics["time_to_find"]["astro"]
    assert result["success"] == pytest.approx((rows["end"][home] == "found").mean())
    assert result["out_told"] == pytest.approx((rows["end"][~home] == "not_at_home").mean())
    assert 0 < result["spl"] <= 1 <= result["ratio"]
    assert result["median"] <= result.get("p90", np.inf)


HIDDEN = [{"items": [{"at": "00:00", "place": "bathroom"}]}]


def test_a_search_at_the_end_of_the_run_is_censored():
    cut = content("1 d")
    cut["simulation"]["duration"] = "9 min 30 s"
    cut["users"]["ana"] = {"type": "schedule", "days": HIDDEN}
    find = {"type": "find", "user": "ana", "every": "9 min", "source": "rtp", "policy": "random"}
    stay = {"type": "patrol", "waypoints": [[1.0, 3.0]]}
    cut["robots"]["astro"] |= {"battery": None, "behaviors": [find, stay]}
    result = run(cut).metrics["time_to_find"]["astro"]
    mistakes = {"false": 0, "false_out": 0}
    assert {"searches": 1, "success": 0.0, "mean": 600.0, "spl": 0.0, **mistakes} == result


def test_a_search_ends_where_the_robot_goes_off():
    """The next search took its place, and the last one counted until the end of the run."""
    off = content("1 d")
    off["users"]["ana"] = {"type": "schedule", "days": HIDDEN}
    find = {"type": "find", "user": "ana", "every": "9 min", "policy": "random"}
    off["robots"]["astro"] |= {"battery": None, "behaviors": [find, {"type": "patrol"}]}
    off["simulation"]["duration"] = "26 min"
    crash = {"power": "astro", "duration": "1 min"}
    off["script"] = [{"at": "9 min 5 s", **crash}, {"at": "18 min 7 s", **crash}]
    off["metrics"]["household"] = {}
    stored = run(off)

    rows = table(stored, "time_to_find")
    begun = [step for step, name, _ in events(stored) if name == "find_begins"]
    assert begun == rows["began"].tolist()
    assert [540, 1080] == rows["began"][rows["end"] == "open"].tolist()
    assert [5.0, 7.0] == rows["seconds"][rows["end"] == "open"].tolist()
    assert len(begun) == stored.metrics["time_to_find"]["astro"]["searches"]
    searching = stored.metrics["household"]["astro"]["searching_min"]
    assert rows["seconds"].sum() / 60 == pytest.approx(searching)


def test_a_wrong_verdict_not_at_home_is_counted():
    hidden = content("1 d")
    hidden["users"]["ana"] = {"type": "schedule", "days": HIDDEN}
    gate = {"type": "door", "doorway": "bathroom_1", "open": False, "locked": True}
    hidden["objects"] = {"gate": gate}
    find = {"type": "find", "user": "ana", "every": "40 min", "out": 0.9, "deadline": "30 min"}
    hidden["robots"]["astro"]["behaviors"] = ["dock", find]
    result = run(hidden).metrics["time_to_find"]["astro"]
    assert (2, 2, 0.0) == (result["searches"], result["false_out"], result["success"])


@pytest.mark.parametrize(
    "change", [{"put": "astro", "to": [7.0, 6.0]}, {"power": "astro", "duration": "2 min"}]
)
def test_time_charging_is_counted_where_docking_begins_again(change):
    """Only that after the last time that it docked was counted."""
    document = content("1 d")
    document["robots"]["astro"]["behaviors"] = ["dock", {"type": "patrol", "dwell": "90 s"}]
    document["script"] = [{"at": "2500 s", **change}]
    stored = run(document)

    steps = 0
    docked_at = None
    for step, name, _ in events(stored):
        if name == "docks" and docked_at is None:
            docked_at = step
        elif docked_at is not None and name in ("charged", "power_off"):
            steps += step - docked_at
            docked_at = None
    docks = [step for step, name, _ in events(stored) if name == "docks"]
    assert docks[0] < 2500 < docks[1]
    assert steps / 6000 == pytest.approx(stored.metrics["battery"]["astro"]["charging"])


def test_a_battery_is_empty_until_a_script_charges_it():
    """It counted as empty to the end of the run, though the robot drove on."""
    empty = content("1 d")
    empty["robots"]["astro"] |= {
        "behaviors": [{"type": "dock", "threshold": 0.01}, "meander"],
        "battery": {**BATTERY, "charger": [7.0, 6.0]},
    }

    def when_empty(stored):
        return [step for step, _, detail in events(stored) if detail == "0.0 %"]

    stored = run(empty)
    (died,) = when_empty(stored)
    result = stored.metrics["battery"]["astro"]
    assert (0, pytest.approx(1 - died / 6000)) == (result["lowest"], result["empty"])
    empty["script"] = [{"at": f"{died + 500} s", "battery": "astro", "charge": "100 %"}]
    stored = run(empty)
    expected = 500 + sum(6000 - step for step in when_empty(stored)[1:])
    assert stored.metrics["battery"]["astro"]["empty"] == pytest.approx(expected / 6000)


@pytest.mark.parametrize("name", [*METRICS, "detections"])
def test_every_number_of_the_closing_table_has_a_unit(stored, name):
    metric = lookup("metric", name)
    result = stored.metrics.get(name) or run({**content(), "metrics": {name: {}}}).metrics[name]
    shown = flat(metric.summary(result))
    assert shown
    assert shown.items() <= flat(result).items()
    units = {path: metric.units.get(path.rsplit(".")[-1], metric.unit) for path in shown}
    assert "" not in units.values()


# --- Survival ----------------------------------------------------------------------------------


@given(st.lists(st.tuples(st.integers(1, 50), st.booleans()), min_size=1, max_size=30))
def test_kaplan_meier_is_the_product_over_times(rows):
    times, happened = np.array(rows).T
    for time, left in kaplan_meier(times.astype(float).tolist(), [h for _, h in rows]):
        each = range(1, int(time) + 1)
        shares = [1 - ((times == t) & (happened > 0)).sum() / (times >= t).sum() for t in each]
        assert left == pytest.approx(np.prod(shares))


@given(st.lists(st.integers(1, 50), min_size=1, max_size=30))
def test_without_censoring_the_estimate_equals_the_sample(times):
    curve = kaplan_meier([float(t) for t in times], [True] * len(times))
    assert restricted_mean(curve, 60.0) == pytest.approx(np.mean(times))
    assert quantile(curve, 0.5) == pytest.approx(np.quantile(times, 0.5, method="inverted_cdf"))


def test_events_that_never_happen_have_no_median_and_the_deadline_as_mean():
    curve = kaplan_meier([10.0, 10.0], [False, False])
    assert quantile(curve, 0.5) is None
    assert 10.0 == restricted_mean(curve, 10.0)


class Diary(Metric):
    """Keeps what plans said happened, period by period."""

    def start(self, home):
        self.events = []

    def update(self, history, state):
        self.events += [list(event) for event in history.events]

    def result(self):
        return {"events": self.events}


@pytest.mark.slow
@pytest.mark.parametrize("period", ["1 s", "7 min", "1 d"])
def test_history_has_the_events_of_the_table(period):
    scenario_content = content()
    scenario_content["simulation"]["duration"] = "40 min"
    scenario_content["metrics"] = {"diary": {"type": f"{__name__}:Diary", "period": period}}
    stored = run(scenario_content)
    rows = table(stored, "events")
    sights = np.isin(rows["event"], ["user_seen", "user_lost"])
    rows["detail"] = np.where(sights, rows["user"], rows["detail"])
    columns = [rows[name].tolist() for name in ("step", "entity", "event", "detail")]
    expected = [list(row) for row in zip(*columns, strict=True)]
    events = stored.metrics["diary"]["events"]
    assert len(expected) > 10
    assert sights.any()
    # Rows of one step and body may be stored in another order.
    assert sorted(map(str, expected)) == sorted(map(str, events))
    assert [row[0] for row in events] == sorted(row[0] for row in events)


# --- Events ------------------------------------------------------------------------------------


class Listener(Algorithm):
    """Keeps the names of those whose events it hears."""

    def update(self, history, state):
        return {"names": ",".join(sorted({event.entity for event in history.events}))}


def test_algorithms_hear_of_the_events_of_robots_only():
    told_events = content()
    told_events["algorithms"]["listener"] = {"type": f"{__name__}:Listener", "period": "50 min"}
    stored = run(told_events)
    assert {"astro,bolt"} == set(table(stored, "listener")["names"].tolist())
    assert "ana" in table(stored, "events")["entity"].tolist()
