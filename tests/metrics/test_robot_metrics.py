"""Metrics of robots among people, against what an every-step record of a run says."""

from datetime import timedelta
from itertools import groupby, pairwise
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from tests.entities.robots.robots import CAMERA, events
from tests.entities.robots.test_find import belief
from tests.scenes import flat_document, run, scenario, table

from fleet2d import Algorithm, Behavior, Metric, Plan, Situation
from fleet2d.configuration.components import lookup
from fleet2d.metrics.metric import kaplan_meier, quantile, restricted_mean
from fleet2d.runs.run import Run

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


def content(period: str = "17 min") -> dict[str, Any]:
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


def poses(stored: Run, name: str) -> dict[str, Any]:
    return table(stored, "trajectories", entity=name)


def gaps(stored: Run, robot: str, user: str) -> Any:
    one, other = poses(stored, robot), poses(stored, user)
    return np.hypot(one["x"] - other["x"], one["y"] - other["y"])


@pytest.mark.parametrize("period", ["11 min", "1 d"])
def test_results_do_not_depend_on_the_period(stored, period):
    other = run(content(period)).metrics
    for metric in METRICS:
        assert flat(other[metric]) == {
            k: pytest.approx(v, rel=1e-9) for k, v in flat(stored.metrics[metric]).items()
        }


def flat(result: Any, path: str = "") -> dict[str, Any]:
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
    space = shapely.union_all(
        [shapely.Polygon(f["outline"], f["holes"]) for f in flat_document()["free"]]
    )
    shapely.prepare(space)
    one, other, gap = poses(stored, "bolt"), poses(stored, "ben"), gaps(stored, "bolt", "ben")
    near = np.flatnonzero(gap < 3.6)
    ends = np.stack([np.stack([p["x"], p["y"]], axis=1)[near] for p in (one, other)], axis=1)
    clear = shapely.contains_properly(space, shapely.linestrings(ends))
    result = stored.metrics["intrusion"]["bolt"]["ben"]
    for zone, low, high in (("intimate", 0, 0.45), ("personal", 0.45, 1.2), ("social", 1.2, 3.6)):
        minutes = (clear & (gap[near] >= low) & (gap[near] < high)).sum() / 60
        # A line that all but touches a corner may be told otherwise.
        assert result[zone] == pytest.approx(minutes / (6000 / 86400), abs=0.05 * 14.4)
    assert result["social"] > 10


def test_blocks_are_runs_of_steps_in_which_somebody_walks_into_the_robot(stored):
    ben, gap = poses(stored, "ben"), gaps(stored, "bolt", "ben")
    steps = []
    for k in range(1, len(gap)):
        moves = (ben["x"][k], ben["y"][k]) != (ben["x"][k - 1], ben["y"][k - 1])
        steps.append(bool(moves and (gap[k] < 0.4 or gap[k - 1] < 0.4)))
    result = stored.metrics["blocking"]["bolt"]["ben"]
    assert sum(steps) > 3
    assert result["seconds"] == pytest.approx(sum(steps) * 14.4)
    assert result["blocks"] == pytest.approx(sum(1 for hit, _ in groupby(steps) if hit) * 14.4)


@pytest.mark.parametrize("period", ["7 min", "1 d"])
def test_users_who_step_aside_for_a_robot_are_counted(period):
    stands = {"type": "schedule", "days": [{"items": [{"at": "00:00", "place": [3.0, 3.1]}]}]}
    polite = {"type": "reactions", "manners": {"steps_aside": 1, "turns": 0}}
    to_and_fro = {"type": "patrol", "waypoints": [[1.0, 3.1], [4.5, 3.1]], "dwell": "1 min"}
    crossing = content(period)
    crossing["users"] = {"ana": {"behaviors": [polite, stands]}}
    crossing["robots"] = {"astro": {"start": [1.0, 3.1], **to_and_fro}}
    crossing["algorithms"] = {}
    crossing["metrics"] = {"blocking": {"period": period}}
    stored = run(crossing)
    aside = [row for row in events(stored, "ana") if row[2] == "steps aside for astro"]
    assert len(aside) > 3
    result = stored.metrics["blocking"]["astro"]["ana"]
    assert result["asides"] == pytest.approx(len(aside) * 14.4)


class Polite(Behavior):
    """Steps aside for another robot, in words."""

    def decide(self, now: Situation) -> Plan:
        return now.plan().note("reacts", "steps aside for astro").stay(timedelta(minutes=5))


def test_robots_that_step_aside_for_a_robot_are_not_counted():
    crossing = scenario(
        "20 min",
        users={"ana": {"type": "meander"}},
        robots={"astro": {"type": "meander"}, "bolt": {"type": f"{__name__}:Polite"}},
        metrics={"blocking": {}},
    )
    stored = run(crossing)
    assert events(stored, "bolt")
    result = stored.metrics["blocking"]
    assert ["ana"] == [*result["astro"]] == [*result["bolt"]]
    assert "asides" not in result["astro"]["ana"]


def test_travel_counts_rests_apart_and_metres(stored):
    astro = poses(stored, "astro")
    rests = []
    for place, steps in groupby(zip(astro["x"].tolist(), astro["y"].tolist(), strict=True)):
        if sum(1 for _ in steps) >= 60:
            rests.append(place)
    moves = sum(np.hypot(a[0] - b[0], a[1] - b[1]) > 0.5 for a, b in pairwise(rests))
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
    home_steps = np.flatnonzero(~poses(stored, "ana")["away"])
    calls = [k for k in range(0, 6000, 600) if k in set(home_steps.tolist())]
    result = stored.metrics["reach_time"]["astro"]["ana"]
    assert len(calls) == result["calls"]
    straight = gaps(stored, "astro", "ana")[calls] / 0.6
    assert straight.mean() <= result["mean"] <= 3 * straight.mean()
    assert result["mean"] <= result["p90"]


def test_coverage_follows_from_the_layer_at_the_end(stored):
    result = stored.metrics["coverage"]["astro"]
    assert 0.5 < result["share"] < 1
    assert 0 < result["half_h"] <= 1.67
    rows = table(stored, "coverage", robot="astro")
    assert rows["share"].tolist() == sorted(rows["share"].tolist())
    assert rows["share"][-1] == pytest.approx(result["share"])


def test_battery_has_the_lowest_charge_and_the_dockings(stored):
    result = stored.metrics["battery"]["astro"]
    told_ = [
        (step, name, float(d.split()[0]))
        for step, name, d in events(stored)
        if name in ("battery", "docks", "charged")
    ]
    assert result["lowest"] == pytest.approx(min(level for *_, level in told_) / 100)
    docks = [step for step, name, _ in told_ if name == "docks"]
    assert result["dockings"] == pytest.approx(len(docks) * 14.4)
    assert 0 < result["charging"] < 1
    assert {"astro"} == set(stored.metrics["battery"])


def test_time_to_find_has_outcomes_and_times(stored):
    rows = table(stored, "time_to_find", robot="astro")
    begun = [step for step, name, _ in events(stored) if name == "find_begins"]
    ends = [
        (step, name)
        for step, name, _ in events(stored)
        if name in ("found", "gave_up", "not_at_home")
    ]
    assert begun[: len(rows["began"])] == rows["began"].tolist()
    assert [name for _, name in ends] == rows["end"].tolist()
    assert [step - b for (step, _), b in zip(ends, begun, strict=False)] == rows["seconds"].tolist()
    home = rows["at_home"]
    assert home.any()
    assert (~home).any()
    result = stored.metrics["time_to_find"]["astro"]
    assert result["success"] == pytest.approx((rows["end"][home] == "found").mean())
    assert result["out_told"] == pytest.approx((rows["end"][~home] == "not_at_home").mean())
    assert 0 < result["spl"] <= 1 <= result["ratio"]
    assert result["median"] <= result["p90"] if "p90" in result else True


def test_a_search_at_the_end_of_the_run_is_censored():
    cut = content("1 d")
    cut["simulation"]["duration"] = "9 min 30 s"
    cut["users"]["ana"] = {
        "type": "schedule",
        "days": [{"items": [{"at": "00:00", "place": "bathroom"}]}],
    }
    del cut["robots"]["astro"]["battery"]
    find = {"type": "find", "user": "ana", "every": "9 min", "source": "rtp", "policy": "random"}
    cut["robots"]["astro"]["behaviors"] = [find, {"type": "patrol", "waypoints": [[1.0, 3.0]]}]
    result = run(cut).metrics["time_to_find"]["astro"]
    assert {"searches": 1, "success": 0.0, "mean": 600.0, "spl": 0.0} == result


def test_a_wrong_verdict_not_at_home_is_counted():
    hidden = content("1 d")
    hidden["users"]["ana"] = {
        "type": "schedule",
        "days": [{"items": [{"at": "00:00", "place": "bathroom"}]}],
    }
    gate = {"type": "door", "doorway": "bathroom_1", "open": False, "locked": True}
    hidden["objects"] = {"gate": gate}
    find = {"type": "find", "user": "ana", "every": "40 min", "out": 0.9, "deadline": "30 min"}
    hidden["robots"]["astro"]["behaviors"] = ["dock", find]
    result = run(hidden).metrics["time_to_find"]["astro"]
    assert (2, 2, 0.0) == (result["searches"], result["false_out"], result["success"])


def test_a_battery_that_runs_empty_is_reported():
    empty = content("1 d")
    empty["robots"]["astro"]["behaviors"] = [{"type": "dock", "threshold": 0.01}, "meander"]
    empty["robots"]["astro"]["battery"] = {**BATTERY, "charger": [7.0, 6.0]}
    stored = run(empty)
    step = next(step for step, _, detail in events(stored) if detail == "0.0 %")
    result = stored.metrics["battery"]["astro"]
    assert result["empty"] == pytest.approx(1 - step / 6000)
    assert 0 == result["lowest"]


def test_a_battery_that_a_script_charges_again_is_empty_no_longer():
    """It counted as empty to the end of the run, though the robot drove on."""
    empty = content("1 d")
    empty["robots"]["astro"]["behaviors"] = [{"type": "dock", "threshold": 0.01}, "meander"]
    empty["robots"]["astro"]["battery"] = {**BATTERY, "charger": [7.0, 6.0]}
    steps, died = 6000, next(step for step, _, detail in events(run(empty)) if detail == "0.0 %")
    at = f"{died + 500} s"
    empty["script"] = [{"at": at, "battery": "astro", "charge": "100 %"}]
    stored = run(empty)
    last = [step for step, _, detail in events(stored) if detail == "0.0 %"][1:]
    expected = 500 + sum(steps - step for step in last)
    assert stored.metrics["battery"]["astro"]["empty"] == pytest.approx(expected / steps)


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
    times, happened = [float(t) for t, _ in rows], [h for _, h in rows]
    curve = kaplan_meier(times, happened)
    for time, left in curve:
        product = 1.0
        for t in range(1, int(time) + 1):
            at_risk = len([1 for other in times if other >= t])
            product *= 1 - len([1 for o, h in rows if o == t and h]) / at_risk
        assert left == pytest.approx(product)


@given(st.lists(st.integers(1, 50), min_size=1, max_size=30))
def test_without_censoring_the_estimate_equals_the_sample(times):
    curve = kaplan_meier([float(t) for t in times], [True] * len(times))
    assert restricted_mean(curve, 60.0) == pytest.approx(np.mean(times))
    assert quantile(curve, 0.5) == pytest.approx(np.quantile(times, 0.5, method="inverted_cdf"))


def test_events_that_never_happen_have_no_median_and_the_deadline_as_mean():
    curve = kaplan_meier([10.0, 10.0], [False, False])
    assert quantile(curve, 0.5) is None
    assert 10.0 == restricted_mean(curve, 10.0)


# --- Events ------------------------------------------------------------------------------------


class Diary(Metric):
    """Keeps what plans said happened, period by period."""

    def start(self, home: Any) -> None:
        self.events: list[list[Any]] = []

    def update(self, history: Any, state: Any) -> None:
        self.events += [list(event) for event in history.events]

    def result(self) -> dict[str, Any]:
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


class Listener(Algorithm):
    """Keeps the names of those whose events it hears."""

    def update(self, history: Any, state: Any) -> dict[str, Any]:
        return {"names": ",".join(sorted({event.entity for event in history.events}))}


def test_algorithms_hear_of_the_events_of_robots_only():
    told_events = content()
    told_events["algorithms"]["listener"] = {"type": f"{__name__}:Listener", "period": "50 min"}
    stored = run(told_events)
    assert {"astro,bolt"} == set(table(stored, "listener")["names"].tolist())
    assert "ana" in table(stored, "events")["entity"].tolist()
