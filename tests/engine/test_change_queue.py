"""Doors, furniture and rooms that change during a run: exactly, in any span, seen by everybody."""

from datetime import timedelta

import numpy as np
import pytest
import shapely
from tests.scenes import box, digests, entries, expecting, run, scenario, table, unmet, write_plan
from tests.thorough import some

import fleet2d
from fleet2d import Algorithm, ComponentError, InputError
from fleet2d.floorplan.home import HomeChange, HomeChanges
from fleet2d.interventions import MoveFurniture

OUTLINE = [
    [0, 0], [4, 0], [4, 1], [4.1, 1], [4.1, 0], [8, 0], [8, 2], [8.1, 2], [8.1, 0], [11, 0],
    [11, 3], [8.1, 3], [8.1, 2.8], [8, 2.8], [8, 3], [4.1, 3], [4.1, 1.9], [4, 1.9], [4, 3], [0, 3],
]  # fmt: skip
CART = {"name": "cart", "type": "table", "footprint": box(6, 0.1, 6.5, 0.6), "blocks": "sight"}


def write_three_rooms(folder, *objects):
    """Three rooms in a row, with a door line in each of the two gaps, and a cart in the middle."""
    rooms = {
        "kitchen": box(0, 0, 4.05, 3),
        "hallway": box(4.05, 0, 8.05, 3),
        "bathroom": box(8.05, 0, 11, 3),
    }
    lines = [([4.05, 1.0], [4.05, 1.9]), ([8.05, 2.0], [8.05, 2.8])]
    doorways = [{"start": start, "end": end} for start, end in lines]
    return write_plan(folder, OUTLINE, rooms, doorways=doorways, objects=[CART, *objects])


@pytest.fixture(scope="module")
def plan(tmp_path_factory):
    return write_three_rooms(tmp_path_factory.mktemp("rooms"))


def home(plan, duration="2 h", **sections):
    return {
        "simulation": {"duration": duration, "seed": 3},
        "floorplan": {"type": "native", "path": plan},
        "artifacts": {"trajectories": "every step"},
        **sections,
    }


def goes(*items):
    agenda = [{"at": at, "place": place} for at, place in items]
    return {"type": "schedule", "days": [{"items": agenda}]}


def door(doorway="kitchen_1", **more):
    return {"door": {"type": "door", "doorway": doorway, **more}}


def stands(x, y, **more):
    return {"start": [x, y], "start_heading_deg": 0, **more}


def changes_of(stored):
    rows = table(stored, "events")
    wanted = ("opened", "shut", "locked", "unlocked", "moved", "room_changed", "way_blocked")
    return [
        (int(step), entity, event)
        for step, entity, event in zip(rows["step"], rows["entity"], rows["event"], strict=True)
        if event in wanted
    ]


@pytest.mark.parametrize(
    ("script", "hidden"),
    [
        ([{"at": "10 s", "shut": "door"}, {"at": "30 s", "open": "door"}], range(10, 30)),
        (
            [
                {"at": "20 s", "move": "cart", "to": [4.8, 1.45]},
                {"at": "40 s", "move": "cart", "to": [6.0, 2.6]},
            ],
            range(20, 40),
        ),
    ],
    ids=["door", "cart"],
)
def test_a_shut_door_and_a_moved_cart_hide_who_is_behind_them_from_the_very_step_on(
    plan, script, hidden
):
    robot = stands(2, 1.45, camera={"range": [0, 9], "lost_after": "1 s"})
    users = {"ana": stands(6, 1.45)}
    content = home(plan, "60 s", users=users, robots={"astro": robot}, objects=door())
    seen = table(run({**content, "script": script}), "observations")["step"].tolist()

    assert [step for step in range(60) if step not in hidden] == seen


def test_scenario_with_doors_is_the_same_for_every_span(plan):
    times = ("00:00", "kitchen"), ("00:20", "bathroom"), ("00:25", "kitchen"), ("00:45", "hallway")
    turns = [{"at": "00:20", "open": False}, {"at": "00:50", "open": True}]
    content = home(
        plan,
        "1 h",
        users={"ana": goes(*times), "ben": {"type": "meander"}},
        robots={"astro": {"type": "patrol", "dwell": "20 s"}, "bolt": {"type": "meander"}},
        objects={
            **door("bathroom_1", open=False, closes_after="5 s"),
            "kitchen": {"type": "door", "doorway": "kitchen_1", "schedule": turns},
        },
        script=[
            {"at": "30 min", "move": "cart", "to": [6.25, 2.0], "turn_deg": 30},
            {"at": "35 min", "room": "kitchen_1", "type": "office"},
        ],
    )
    whole = run(content)
    kinds = {event for _, _, event in changes_of(whole)}
    assert {"opened", "shut", "moved", "room_changed"} <= kinds
    for span in some([7, 1, 1000], 3):
        assert digests(whole) == digests(run(content, max_span=span))


def test_person_opens_the_door_in_time_and_it_falls_shut_behind(plan):
    ana = goes(("00:00", [2, 1.45]), ("00:01", [6, 1.45])) | stands(2, 1.45)
    shut_door = door(open=False, closes_after="4 s")
    stored = run(home(plan, "3 min", users={"ana": ana}, objects=shut_door))
    where = table(stored, "trajectories", entity="ana")
    through = 30 + int(np.flatnonzero(where["x"][30:] > 4.05)[0])
    opened, shut = [step for step, _, _ in changes_of(stored)][-2:]
    assert through - 2 <= opened <= through - 1
    assert through + 3 <= shut <= through + 5


VISITS = {"type": "patrol", "rooms": ["bathroom_1"], "dwell": "1 s"}
LEAVES = {"type": "patrol", "rooms": ["hallway_1", "kitchen_1"]}
CASES = {
    "a robot waits at a shut door and goes on when it opens": (
        {"robots": {"astro": stands(6, 2.4, **VISITS)}, "objects": door("bathroom_1", open=False)},
        "at: 5 min, open: door",
        """
        never(during(00:00-00:05) and room(astro) == bathroom)
        eventually(room(astro) == bathroom, within=330 s)
        """,
    ),
    "a robot on its way turns back at a door that shuts before it": (
        {"robots": {"astro": stands(2, 1.45, **LEAVES)}},
        "at: 1 s, shut: door",
        "never(distance(astro, hallway) < 0.15)",
    ),
    "a door waits while somebody stands in it": (
        {"users": {"ana": stands(4.05, 1.45)}, "objects": door(open=False)},
        "",
        "always(door(door))",
    ),
    "nobody walks through a locked door": (
        {
            "users": {"ana": goes(("00:00", "hallway")) | stands(2, 1.45)},
            "objects": door(open=False, locked=True),
        },
        "at: 2 min, unlock: door",
        """
        never(during(00:00-00:02) and room(ana) == hallway)
        eventually(room(ana) == hallway)
        """,
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_what_doors_do_to_bodies(plan, name):
    sections, script, expected = CASES[name]
    content = home(plan, "10 min", objects=door(), script=entries(script)) | sections
    assert [] == unmet(run({**content, "expect": expecting(expected)}))


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


class Turns(Algorithm):
    """Asks for a change of the home after each update."""

    change: dict[str, str]

    def update(self, history, state):
        return HomeChanges([HomeChange(**self.change)])


def turned(plan, **change):
    turns = {"type": f"{__name__}:Turns", "period": "1 min", "change": change}
    users = {"ana": stands(6, 1.45)}
    return run(home(plan, "5 min", users=users, objects=door(), algorithms={"turns": turns}))


def test_algorithm_shuts_a_door_at_the_step_after_its_update(plan):
    stored = turned(plan, shut="door")
    assert [(60, "door", "shut")] == changes_of(stored)
    assert ["shut"] * 5 == table(stored, "turns")["change"].tolist()
    with pytest.raises(ComponentError, match=r"algorithms\.turns requests.*no door 'gate'.*door"):
        turned(plan, open="gate")


@pytest.mark.parametrize(
    ("word", "kind"), [("Arbeitszimmer", "office"), ("Living Room", "living_room")]
)
def test_room_used_otherwise_is_found_by_its_new_type_or_what_a_word_means(plan, word, kind):
    script = [{"at": "1 min", "room": "bathroom_1", "type": word}]
    simulation = fleet2d.Simulation(home(plan, users={"ana": stands(6, 1.45)}, script=script))
    ana = simulation.actors["ana"]
    simulation.run_until(timedelta(minutes=2))
    assert ["bathroom_1"] == [room.name for room in ana.rooms((kind,))]


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
        ({"objects": door("attic")}, r"no doorway 'attic'"),
        ({"objects": door("hallway_1")}, "has 2 doorways"),
        ({"objects": door() | {"b": door()["door"]}}, "door hangs in the doorway"),
        ({"objects": {"ana": door()["door"]}}, "a user named 'ana'"),
        ({"objects": door(schedule=[{"at": "9:00"}])}, "give 'open' or 'locked'"),
        ({"objects": door([600, 145])}, r"\(600, 145\) m is outside the home"),
    ],
)
def test_change_or_door_that_can_not_be_is_refused(plan, sections, message):
    content = home(plan, users={"ana": stands(6, 1.45)}, objects=door()) | sections
    with pytest.raises(InputError, match=message):
        fleet2d.Simulation(content)
