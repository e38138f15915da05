"""Rooms that behaviors stay out of: `no_stops_in` of all behaviors of robots but hangout."""

import pytest
from tests.scenes import DOORS, scenario, table, write_flat

import fleet2d
from fleet2d.errors import PlacementError, ScenarioError
from fleet2d.floorplan.load import load_floorplan
from fleet2d.interventions import Call

CAMERA = {"range": [0.2, 6], "angle_deg": 340}
BEHAVIORS = {
    "patrol": {"type": "patrol", "rooms": ["kitchen", "living_room"], "dwell": "10 s"},
    "find": {"type": "find", "user": "ana", "every": "3 min", "distance": 0.5},
    "follow": {"type": "follow", "user": "ana", "distance": 0.5},
    "opportunistic": {"type": "opportunistic", "again": "1 min", "distance": 0.5},
    "come": {"type": "come", "stay": "2 min"},
    "explore": {"type": "explore"},
    "scheduled": {"type": "scheduled", "visits": [{"at": "07:02", "place": "kitchen"}, {"at": "07:04", "place": "bedroom"}]},
}  # fmt: skip


def inside(behavior, avoid):
    """Return for how many steps the robot is in the kitchen, where Ana stays."""
    rest = {"type": "patrol", "waypoints": [[4.4, 3.1], [1.0, 3.0]], "dwell": "20 s"}
    content = scenario(
        "12 min",
        users={"ana": {"type": "schedule", "rest": "kitchen", "days": [{"on": "daily", "items": [{"at": "00:00", "place": [6.5, 3.1], "activity": "read"}]}]}},
        robots={"astro": {"start": [1.0, 3.0], "camera": CAMERA, "behaviors": [{**BEHAVIORS[behavior], "no_stops_in": avoid}, rest]}},
        script=[{"at": "07:01", "call": "astro", "to": "kitchen"}] if behavior == "come" else [],
        artifacts={"trajectories": "every step"},
    )  # fmt: skip
    rows = table(fleet2d.run(content), "trajectories", entity="astro")
    return int((rows["room"].astype(str) == "kitchen_1").sum())


@pytest.mark.parametrize("behavior", BEHAVIORS)
def test_the_robot_stays_out_of_the_rooms_that_it_avoids(behavior):
    assert inside(behavior, []) > 0
    assert 0 == inside(behavior, ["kitchen", "bathroom"])  # the way there leads through the kitchen


def test_an_unknown_room_is_refused_and_a_kind_that_the_home_lacks_is_noted():
    with pytest.raises(PlacementError, match=r"patrol\.no_stops_in: .*did you mean 'kitchen'"):
        inside("patrol", ["kitchn"])
    assert inside("patrol", ["office"]) > 0


def test_a_robot_called_into_a_room_that_it_avoids_waits_near_the_door():
    """The door from the living room to the kitchen is at x = 5 m, y = 2.6 to 3.6 m."""
    simulation = fleet2d.Simulation(
        scenario(robots={"astro": {"start": [1.0, 1.0], "behaviors": [{"type": "come", "no_stops_in": ["kitchen"]}]}})
    )  # fmt: skip
    simulation.do(Call("astro", to="kitchen"))
    simulation.run_until("07:01")
    x, y = simulation.state["astro"]["x"], simulation.state["astro"]["y"]
    assert simulation.state["astro"]["room"] == "living_room_1"
    assert 0.8 < 5 - x + abs(y - 3.1) < 2


CHARGER = {"driving": "2 h", "standing": "9 h", "charging": "3 h", "charger": [2.0, 3.5]}


@pytest.fixture
def loop(monkeypatch, tmp_path):
    """The flat with one more door, from the bathroom to the bedroom: two ways lead to a charger."""
    monkeypatch.setattr("tests.scenes.DOORS", [*DOORS, (4, 5, 4.1, 6)])
    return write_flat(tmp_path)


def docking(plan, **dock):
    """Return through which of two rooms a robot drives from the bathroom to its charger."""
    robot = {
        "start": [7.0, 6.0],
        "battery": CHARGER,
        "behaviors": [{"type": "dock", "rest": True, **dock}],
    }
    content = scenario("3 min", robots={"astro": robot}, artifacts={"trajectories": "every step"})
    content["floorplan"]["path"] = str(plan)
    rows = table(fleet2d.run(content), "trajectories", entity="astro")
    assert abs(float(rows["x"][-1]) - 2.0) < 0.1, "it is at the charger"
    return {"kitchen_1", "bedroom_1"} & set(rows["room"].astype(str))


def test_the_way_to_the_charger_leads_round_rooms_to_avoid_if_there_is_another(loop):
    assert {"bedroom_1"} == docking(loop)
    assert {"kitchen_1"} == docking(loop, no_stops_in=["bedroom"])
    assert {"bedroom_1"} == docking(loop, no_stops_in=["kitchen", "bedroom"])


def test_a_charger_in_a_room_to_avoid_is_refused(loop):
    with pytest.raises(ScenarioError, match=r"dock\.no_stops_in has the room of the charger"):
        docking(loop, no_stops_in=["living_room"])


def test_a_visit_in_a_room_to_avoid_is_left_out_with_a_note():
    visits = [{"at": "07:01", "place": "kitchen"}, {"at": "07:02", "place": "bedroom"}]
    robot = {"behaviors": [{"type": "scheduled", "visits": visits, "no_stops_in": ["kitchen"]}]}
    simulation = fleet2d.Simulation(scenario(robots={"astro": robot}))
    note = "scheduled.visits: left out, because of `no_stops_in`: those of kitchen_1"
    assert [note] == simulation.actors["astro"].notes
    assert ["bedroom_1"] == table(simulation.run(), "events", event="visits")["detail"].tolist()


def test_a_path_is_retraced_but_for_its_part_in_rooms_to_avoid(shared_data):
    file = shared_data / "valetudo" / "dreame_z10_named_rooms_and_paths.json"

    def points(avoid):
        robot = {"behaviors": [{"type": "retrace", "path": str(file), "no_stops_in": avoid}]}
        content = scenario(robots={"astro": robot})
        content["floorplan"] = {"type": "valetudo", "path": str(file)}
        return int(table(fleet2d.run(content), "events", event="retraces")["detail"][0].split()[0])

    kinds = sorted({room.type for room in load_floorplan(file).rooms})
    assert points([kinds[0]]) < points([])
