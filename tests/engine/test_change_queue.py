"""Doors, furniture and rooms that change during a run: exactly, in any span, seen by everybody."""

import copy
from datetime import timedelta
from typing import Any

import numpy as np
import pytest
import shapely
from tests.scenes import digests, run, scenario, table
from tests.thorough import some

import fleet2d
from fleet2d import Algorithm, ComponentError, InputError
from fleet2d.engine.change_queue import crossings
from fleet2d.floorplan.home import HomeChange, HomeChanges
from fleet2d.interventions import MoveFurniture, ShutDoor
from fleet2d.kernels import Breakpoints


def flat() -> dict[str, Any]:
    """Three rooms in a row, with a door line in each of the two gaps, and a cart in the middle."""
    return {
        "format": "fleet2d-floorplan",
        "version": 1,
        "name": "three rooms",
        "free": [
            {
                "outline": [
                    [0, 0], [4, 0], [4, 1], [4.1, 1], [4.1, 0], [8, 0], [8, 2], [8.1, 2],
                    [8.1, 0], [11, 0], [11, 3], [8.1, 3], [8.1, 2.8], [8, 2.8], [8, 3], [4.1, 3],
                    [4.1, 1.9], [4, 1.9], [4, 3], [0, 3],
                ]
            }
        ],
        "rooms": [
            {"type": "kitchen", "polygon": [[0, 0], [4.05, 0], [4.05, 3], [0, 3]]},
            {"type": "hallway", "polygon": [[4.05, 0], [8.05, 0], [8.05, 3], [4.05, 3]]},
            {"type": "bathroom", "polygon": [[8.05, 0], [11, 0], [11, 3], [8.05, 3]]},
        ],
        "doorways": [
            {"start": [4.05, 1.0], "end": [4.05, 1.9]},
            {"start": [8.05, 2.0], "end": [8.05, 2.8]},
        ],
        "objects": [
            {
                "name": "cart",
                "type": "table",
                "footprint": [[6, 0.1], [6.5, 0.1], [6.5, 0.6], [6, 0.6]],
                "blocks": "sight",
            }
        ],
    }  # fmt: skip


@pytest.fixture
def plan(tmp_path):
    import json

    path = tmp_path / "flat.json"
    path.write_text(json.dumps(flat()))
    return str(path)


def home(plan: str, duration: str = "2 h", **sections: Any) -> dict[str, Any]:
    return {
        "simulation": {"duration": duration, "seed": 3},
        "floorplan": {"type": "native", "path": plan},
        "artifacts": {"trajectories": "every step"},
        **sections,
    }


def stands(x: float, y: float, **more: Any) -> dict[str, Any]:
    return {"start": [x, y], "start_heading_deg": 0, **more}


def changes_of(stored: fleet2d.Run) -> list[tuple[int, str | None, str]]:
    rows = table(stored, "events")
    wanted = ("opened", "shut", "locked", "unlocked", "moved", "room_changed", "way_blocked")
    return [
        (int(step), entity, event)
        for step, entity, event in zip(rows["step"], rows["entity"], rows["event"], strict=True)
        if event in wanted
    ]


def test_shut_door_hides_who_is_behind_it_from_the_very_step_on(plan):
    stored = run(
        home(
            plan,
            "60 s",
            users={"ana": stands(6, 1.45)},
            robots={"astro": stands(2, 1.45, camera={"range": [0, 9], "lost_after": "1 s"})},
            objects={"door": {"type": "door", "doorway": "kitchen_1"}},
            script=[{"at": "10 s", "shut": "door"}, {"at": "30 s", "open": "door"}],
        )
    )
    seen = table(stored, "observations")["step"].tolist()
    assert [*range(10), *range(30, 60)] == seen


def test_scenario_with_doors_is_the_same_for_every_span(plan):
    content = home(
        plan,
        users={
            "ana": {
                "type": "schedule",
                "days": [
                    {
                        "items": [
                            {"at": "00:00", "place": "kitchen"},
                            {"at": "00:20", "place": "bathroom"},
                            {"at": "00:25", "place": "kitchen"},
                            {"at": "01:00", "place": "hallway"},
                        ]
                    }
                ],
            },
            "ben": {"type": "meander"},
        },
        robots={"astro": {"type": "patrol", "dwell": "20 s"}, "bolt": {"type": "meander"}},
        objects={
            "bath": {"type": "door", "doorway": "bathroom_1", "open": False, "closes_after": "5 s"},
            "kitchen": {
                "type": "door",
                "doorway": "kitchen_1",
                "schedule": [{"at": "00:40", "open": False}, {"at": "01:30", "open": True}],
            },
        },
        script=[
            {"at": "50 min", "move": "cart", "to": [6.25, 2.0], "turn_deg": 30},
            {"at": "55 min", "room": "kitchen_1", "type": "office"},
        ],
    )
    whole = run(content)
    kinds = {event for _, _, event in changes_of(whole)}
    assert {"opened", "shut", "moved", "room_changed"} <= kinds
    for span in some([7, 1, 1000], 3):
        assert digests(whole) == digests(run(content, max_span=span))


def test_person_opens_the_door_in_time_and_it_falls_shut_behind(plan):
    stored = run(
        home(
            plan,
            "3 min",
            users={
                "ana": stands(
                    2,
                    1.45,
                    behaviors=[
                        {
                            "type": "schedule",
                            "days": [
                                {
                                    "items": [
                                        {"at": "00:00", "place": [2, 1.45]},
                                        {"at": "00:01", "place": [6, 1.45]},
                                    ]
                                }
                            ],
                        }
                    ],
                )
            },
            objects={
                "door": {
                    "type": "door", "doorway": "kitchen_1", "open": False, "closes_after": "4 s",
                }
            },
        )
    )  # fmt: skip
    where = table(stored, "trajectories", entity="ana")
    through = 30 + int(np.flatnonzero(where["x"][30:] > 4.05)[0])
    opened, shut = [step for step, _, _ in changes_of(stored)][-2:]
    assert through - 2 <= opened <= through - 1
    assert through + 3 <= shut <= through + 5


def test_robot_waits_at_a_shut_door_and_goes_on_when_it_opens(plan):
    stored = run(
        home(
            plan,
            "10 min",
            robots={
                "astro": stands(
                    6,
                    2.4,
                    behaviors=[{"type": "patrol", "rooms": ["bathroom_1"], "dwell": "1 s"}],
                )
            },
            objects={"door": {"type": "door", "doorway": "bathroom_1", "open": False}},
            script=[{"at": "5 min", "open": "door"}],
        )
    )
    where = table(stored, "trajectories", entity="astro")
    inside = where["step"][where["x"] > 8.1]
    assert 300 < inside[0] < 330


def test_robot_on_its_way_turns_back_at_a_door_that_shuts_before_it(plan):
    stored = run(
        home(
            plan,
            "2 min",
            robots={
                "astro": stands(
                    2, 1.45, behaviors=[{"type": "patrol", "rooms": ["hallway_1", "kitchen_1"]}]
                )
            },
            objects={"door": {"type": "door", "doorway": "kitchen_1"}},
            script=[{"at": "1 s", "shut": "door"}],
        )
    )
    where = table(stored, "trajectories", entity="astro")
    assert where["x"].max() < 4.05 - 0.15


def test_door_waits_while_somebody_stands_in_it(plan):
    simulation = fleet2d.Simulation(
        home(
            plan,
            "1 min",
            users={"ana": stands(4.05, 1.45)},
            objects={"door": {"type": "door", "doorway": "kitchen_1", "open": False}},
        )
    )
    simulation.run_until(timedelta(seconds=30))
    assert frozenset() == simulation.home.shut


def test_nobody_walks_through_a_locked_door(plan):
    stored = run(
        home(
            plan,
            "5 min",
            users={"ana": stands(2, 1.45, behaviors=[{
                "type": "schedule", "days": [{"items": [{"at": "00:00", "place": "hallway"}]}]}])},
            objects={
                "door": {"type": "door", "doorway": "kitchen_1", "open": False, "locked": True}
            },
            script=[{"at": "2 min", "unlock": "door"}],
        )
    )  # fmt: skip
    where = table(stored, "trajectories", entity="ana")
    assert where["x"][:120].max() < 4.05
    assert where["x"].max() > 4.1


def test_moved_cart_ends_sight_where_it_stands_now(plan):
    stored = run(
        home(
            plan,
            "60 s",
            users={"ana": stands(7.5, 1.45)},
            robots={"astro": stands(4.6, 1.45, camera={"range": [0, 9], "lost_after": "1 s"})},
            script=[
                {"at": "20 s", "move": "cart", "to": [6.0, 1.45]},
                {"at": "40 s", "move": "cart", "to": [6.0, 2.6]},
            ],
        )
    )
    seen = table(stored, "observations")["step"].tolist()
    assert [*range(20), *range(40, 60)] == seen


def test_paths_go_round_a_moved_cart(plan):
    simulation = fleet2d.Simulation(home(plan, robots={"astro": stands(4.6, 1.45)}))
    simulation.do(MoveFurniture("cart", (6.0, 1.45), turn_deg=45))
    simulation.advance(1)
    lattice = simulation.home.plan.lattice
    space = simulation.home.space(0.15)
    route = space.route(
        *(tuple(lattice.to_lattice(p).tolist()) for p in ((4.6, 1.45), (7.5, 1.45)))
    )
    line = shapely.LineString(lattice.to_metres(route))
    cart = next(thing for thing in simulation.home.objects if thing.name == "cart")
    assert len(route) > 2
    assert shapely.distance(line, cart.footprint) >= 0.15


class Closer(Algorithm):
    """Shuts the door after the first update."""

    def update(self, history: Any, state: Any) -> HomeChanges | None:
        return HomeChanges([HomeChange(shut="door")])


def test_algorithm_shuts_a_door_at_the_step_after_its_update(plan):
    stored = run(
        home(
            plan,
            "5 min",
            users={"ana": stands(6, 1.45)},
            objects={"door": {"type": "door", "doorway": "kitchen_1"}},
            algorithms={"closer": {"type": f"{__name__}:Closer", "period": "1 min"}},
        )
    )
    assert [(60, "door", "shut")] == changes_of(stored)
    assert ["shut"] * 5 == table(stored, "closer")["change"].tolist()


class Wrecker(Algorithm):
    """Asks for a door that isn't there."""

    def update(self, history: Any, state: Any) -> HomeChanges:
        return HomeChanges([HomeChange(open="gate")])


def test_algorithm_that_opens_a_door_that_is_not_there_is_named(plan):
    content = home(
        plan,
        "5 min",
        users={"ana": stands(6, 1.45)},
        objects={"door": {"type": "door", "doorway": "kitchen_1"}},
        algorithms={"wrecker": {"type": f"{__name__}:Wrecker", "period": "1 min"}},
    )
    with pytest.raises(ComponentError, match=r"algorithms\.wrecker requests.*no door 'gate'.*door"):
        run(content)


def test_room_used_otherwise_is_found_by_its_new_type(plan):
    simulation = fleet2d.Simulation(
        home(
            plan,
            users={"ana": stands(6, 1.45)},
            script=[{"at": "1 min", "room": "bathroom_1", "type": "office"}],
        )
    )
    ana = simulation.actors["ana"]
    simulation.run_until(timedelta(minutes=2))
    assert ["bathroom_1"] == [room.name for room in ana.rooms(("office",))]


def test_branches_change_on_their_own(plan):
    simulation = fleet2d.Simulation(
        home(
            plan,
            users={"ana": stands(6, 1.45)},
            objects={"door": {"type": "door", "doorway": "kitchen_1"}},
        )
    )
    simulation.advance(10)
    branch = copy.deepcopy(simulation)
    branch.do(ShutDoor("door"))
    branch.advance(10)
    simulation.advance(10)
    assert (frozenset({0}), frozenset()) == (branch.home.shut, simulation.home.shut)
    assert branch.actors["ana"].home is branch.home


def test_homes_without_doors_pay_nothing():
    simulation = fleet2d.Simulation(scenario("1 min"))
    assert simulation.home.walls is simulation.home.plan.mesh


@pytest.mark.parametrize(
    ("sections", "message"),
    [
        ({"script": [{"at": "1 s", "shut": "dor"}]}, r"script\.0: there is no door 'dor'"),
        ({"script": [{"at": "1 s", "move": "cart", "to": [99, 9]}]}, "is not in the home"),
        ({"script": [{"at": "1 s", "move": "bed", "to": [6, 2]}]}, r"no object.*'bed'.*cart"),
        ({"script": [{"at": "1 s", "room": "attic", "type": "office"}]}, "no room 'attic'"),
        (
            {"script": [{"at": "1 s", "room": "kitchen_1", "type": "ofice"}]},
            r"script\.0: there is no room type 'ofice': did you mean 'office'\? There are: kitchen",
        ),
        ({"objects": {"gate": {"type": "door", "doorway": "attic"}}}, r"no doorway 'attic'"),
        ({"objects": {"gate": {"type": "door", "doorway": "hallway_1"}}}, "has 2 doorways"),
        (
            {"objects": {n: {"type": "door", "doorway": "kitchen_1"} for n in ("a", "b")}},
            "a hangs in the doorway",
        ),
        ({"objects": {"ana": {"type": "door", "doorway": "kitchen_1"}}}, "a user named 'ana'"),
        (
            {
                "objects": {
                    "d": {"type": "door", "doorway": "kitchen_1", "schedule": [{"at": "9:00"}]}
                }
            },
            "give 'open' or 'locked'",
        ),
        (
            {"objects": {"gate": {"type": "door", "doorway": [600, 145]}}},
            r"\(600, 145\) m is outside the home",
        ),
    ],
)
def test_change_or_door_that_can_not_be_is_refused(plan, sections, message):
    content = home(
        plan,
        **{
            "users": {"ana": stands(6, 1.45)},
            "objects": {"door": {"type": "door", "doorway": "kitchen_1"}},
            **sections,
        },
    )
    with pytest.raises(InputError, match=message):
        fleet2d.Simulation(content)


def test_track_crosses_a_line_at_the_moment_it_does():
    track = Breakpoints(
        np.array([0, 1000, 2000, 3000]),
        np.array([0, 100, 100, 0]),
        np.array([0, 0, 50, 50]),
        np.zeros(4, np.int64),
        np.zeros(4, np.uint8),
    )
    assert [250, 2750] == crossings(track, ((25, -100), (25, 100)))
    assert [250] == crossings(track, ((25, -100), (25, 10)))
    assert [] == crossings(track, ((25, 10), (25, 40)))


@pytest.mark.parametrize(
    ("word", "kind"), [("Arbeitszimmer", "office"), ("Living Room", "living_room")]
)
def test_a_room_is_used_as_what_a_word_usually_means(plan, word, kind):
    simulation = fleet2d.Simulation(
        home(plan, script=[{"at": "1 s", "room": "kitchen_1", "type": word}])
    )
    simulation.advance(2)
    assert kind == next(room.type for room in simulation.home.rooms if room.name == "kitchen_1")
