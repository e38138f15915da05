"""Hangout: stand near people, out of their way, and move rarely."""

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
import shapely
from tests.entities.robots.robots import (
    SHARE,
    assert_same_for_every_max_span,
    events,
    home_with,
    names,
    rooms,
)
from tests.entities.robots.test_find import belief
from tests.scenes import path, run

import fleet2d
from fleet2d.engine.simulation import Simulation
from fleet2d.entities.robots.hangout import HangoutPlaces, decay
from fleet2d.errors import InputError


def hangout(**fields: Any) -> dict[str, Any]:
    return {"type": "hangout", "source": "rtp", "explore": 0, "period": "10 min", **fields}


@pytest.mark.parametrize("near", ["room", "view", "path"])
def test_it_goes_where_people_are_believed_to_be(near):
    content = home_with([hangout(near=near)], "40 min", **belief(bathroom_1=1))
    stored = assert_same_for_every_max_span(content, 61)
    assert "bathroom_1" == rooms(stored)[-1]
    assert names(stored)[-1] == "relocates"


def test_nearness_by_path_falls_with_the_time_on_foot():
    simulation = fleet2d.Simulation(home_with([hangout(near="path")], **belief(kitchen_1=1)))
    astro, places = simulation.actors["astro"], simulation.actors["astro"].behaviors[0].places  # type: ignore[attr-defined]
    kitchen = simulation.home.plan.room("kitchen_1").index
    near = places.nearness("path", 10.0)
    cells = astro.space.cells(kitchen, astro.part)[:, ::-1] * 64 + 33
    for place in range(0, len(places.points), 9):
        metres = astro.space.distance_field(places.points[[place]])[tuple((cells // 64)[:, ::-1].T)]
        seconds = metres.min() / 0.6
        assert near[place, kitchen] == pytest.approx(np.exp(-seconds / 10), rel=1e-3)
    x = np.linspace(0, 60, 500)
    assert decay(x) == pytest.approx(np.exp(-x), rel=1e-4)


def test_it_stays_out_of_rooms_but_near_them_if_told():
    content = home_with([hangout(no_stops_in=["bathroom"])], "40 min", **belief(bathroom_1=1))
    assert "kitchen_1" == rooms(run(content))[-1]


def test_a_kind_of_room_that_the_home_lacks_is_avoided_all_the_same():
    content = home_with([hangout(no_stops_in=["garage"])], "10 min", **belief(bathroom_1=1))
    plain = home_with([hangout()], "10 min", **belief(bathroom_1=1))
    assert rooms(run(plain)) == rooms(run(content))


def test_it_stands_off_doors_ways_and_seats():
    content = home_with([hangout()], "5 min", **belief(bathroom_1=1))
    content["floorplan"] = {"type": "bundled", "furnish": True}
    content["robots"]["astro"].pop("start")
    content["users"]["ana"] = "meander"
    simulation = Simulation(content)
    home, astro = simulation.home, simulation.actors["astro"]
    places = HangoutPlaces(astro, frozenset())
    points = shapely.points(home.plan.lattice.to_metres(places.points))
    for door in home.plan.doorways:
        line = shapely.LineString([door.start, door.end])
        assert shapely.distance(points, line).min() >= 0.79
    assert 0 <= places.block.min()
    assert 0.05 < places.block.max() <= 1
    assert 0 < places.prox.max() <= 1
    behavior: Any = astro.behaviors[0]
    free = int(np.argmax(-behavior.penalty))
    assert 0 == places.block[free] == places.prox[free]


def test_a_free_place_beats_one_in_the_way():
    simulation = Simulation(home_with([hangout()], **belief(kitchen_1=1)))
    behavior: Any = simulation.actors["astro"].behaviors[0]
    ways = behavior.places.block
    assert ways.max() > 0.2
    assert (ways == 0).any()


def test_it_moves_rarely():
    moody = {"algorithms": SHARE}
    stored = run(
        home_with([hangout(source="share", explore=0)], "12 h", {"type": "meander"}, **moody)
    )
    moves = [step for step, name, _ in events(stored) if name == "relocates"]
    assert len(moves) < 12
    careless = run(
        home_with(
            [hangout(source="share", hysteresis=0, moving=0)], "12 h", {"type": "meander"}, **moody
        )
    )
    assert names(careless).count("relocates") >= len(moves)
    assert min((b - a for a, b in pairwise(moves)), default=600) >= 600


def test_it_stands_still_in_quiet_hours():
    content = home_with([hangout(explore=1, quiet="07:30-08:30")], "2 h", **belief(bathroom_1=1))
    stored = assert_same_for_every_max_span(content, 61)
    poses = path(stored, "astro")
    quiet = slice(1860, 5400)  # a way that was begun before is ended
    assert 1 == len(set(zip(poses.x[quiet].tolist(), poses.y[quiet].tolist(), strict=True)))
    steps = [step for step, name, _ in events(stored) if name == "explores"]
    assert [step for step in steps if 1800 <= step < 5400] == []
    assert len([step for step in steps if step >= 5400]) >= 3


def test_it_leaves_a_room_that_it_stays_out_of_though_hours_are_quiet():
    content = home_with(
        [hangout(no_stops_in=["bedroom"], quiet="06:00-09:00")], "1 h", **belief(bathroom_1=1)
    )
    content["robots"]["astro"]["start"] = [1.0, 6.0]
    stored = assert_same_for_every_max_span(content, 61)
    assert "bedroom_1" not in rooms(stored, 60)
    assert 1 == len(rooms(stored, 60))
    elsewhere = home_with([hangout(quiet="06:00-09:00")], "1 h", **belief(bathroom_1=1))
    assert [] == names(run(elsewhere))


def test_called_away_it_goes_back_to_its_place_without_deciding_again():
    visit = {
        "type": "scheduled",
        "visits": [{"at": "07:15", "place": "living_room", "dwell": "2 min"}],
    }
    content = home_with([visit, hangout(period="1 h")], "40 min", **belief(bathroom_1=1))
    stored = assert_same_for_every_max_span(content, 61)
    assert ["relocates", "visits"] == names(stored)
    poses = path(stored, "astro")
    assert (poses.x[800], poses.y[800]) == (poses.x[-1], poses.y[-1])
    assert (poses.x[960], poses.y[960]) != (poses.x[-1], poses.y[-1])


def test_it_explores_all_rooms_with_equal_chances():
    stored = run(home_with([hangout(explore=1)], "2 d", **belief(bathroom_1=1)))
    details = [detail for _, name, detail in events(stored) if name == "explores"]
    shares = {room: details.count(room) / len(details) for room in set(details)}
    assert len(details) == 288
    expected = 1 / len(shares)
    # Five standard deviations of a share of 288 draws.
    assert all(abs(share - expected) < 5 * (expected / 288) ** 0.5 for share in shares.values())


@pytest.mark.parametrize("ana", ["meander", {"type": "routine", "persona": "works_outside"}])
def test_turning_it_off_leaves_the_life_of_people_as_it_was(ana):
    on = run(home_with([hangout()], "6 h", ana, **belief(bathroom_1=1)))
    off = run(home_with([], "6 h", ana, **belief(bathroom_1=1)))
    gone = run({**home_with([], "6 h", ana), "robots": {}})
    for column in ("x", "y", "heading", "away", "room"):
        lives = [getattr(path(stored, "ana"), column) for stored in (on, off, gone)]
        assert np.array_equal(lives[0], lives[1])
        assert np.array_equal(lives[0], lives[2])
    assert [row for row in events(on, "ana") if row[1] == "activity"] == [
        row for row in events(off, "ana") if row[1] == "activity"
    ]


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"no_stops_in": ["bathrom"]}, "no room 'bathrom'"),
        ({"no_stops_in": ["any"]}, "no place to hang out"),
        ({"quiet": "22:00"}, "expected hours"),
        ({"quiet": "workdays 22:00-23:00"}, "unknown day 'workdays'"),
        ({"near": "far"}, "near"),
        ({"explore": 1.5}, "expected a share from 0 to 1"),
        ({"moving": -1}, "moving"),
        ({"source": "ltp"}, "there is no algorithm 'ltp'"),
        ({"user": "anna"}, "there is no user 'anna'"),
    ],
)
def test_bad_settings_are_refused(fields, words):
    with pytest.raises(InputError, match=words):
        fleet2d.Simulation(home_with([hangout(**fields)], **belief(kitchen_1=1)))


def test_ways_from_where_it_stands_are_those_of_the_home_as_it_is_then():
    content = home_with([hangout(moving=0.5)], **belief(kitchen_1=1))
    simulation = Simulation(
        content | {"objects": {"gate": {"type": "door", "doorway": "kitchen_1-bathroom_1"}}}
    )
    astro = simulation.actors["astro"]
    behavior: Any = astro.behaviors[0]
    ways_when = {}
    for verb in ("open", "shut", "open"):
        simulation.do({verb: "gate"})
        simulation.advance()
        ways_when[verb] = ways = behavior._ways(astro)
        assert ways is behavior._ways(astro)
        behavior.ways = behavior.ways[0], {}
        assert np.array_equal(ways, behavior._ways(astro))
    assert np.isinf(ways_when["shut"]).any()
    assert not np.isinf(ways_when["open"]).any()
