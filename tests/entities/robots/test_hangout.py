"""Hangout: stand near people, out of their way, and move rarely."""

from collections import Counter

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


def hangout(**fields):
    return {"type": "hangout", "source": "rtp", "explore": 0, "period": "10 min", **fields}


@pytest.mark.parametrize("near", ["room", "view", "path"])
def test_it_goes_where_people_are_believed_to_be(near):
    stored = run(home_with([hangout(near=near)], "40 min", **belief(bathroom_1=1)))
    assert "bathroom_1" == rooms(stored)[-1]
    assert names(stored)[-1] == "relocates"


def test_nearness_by_path_falls_with_the_time_on_foot():
    simulation = fleet2d.Simulation(home_with([hangout(near="path")], **belief(kitchen_1=1)))
    astro = simulation.actors["astro"]
    places = astro.behaviors[0].places
    kitchen = simulation.home.plan.room("kitchen_1").index
    near = places.nearness("path", 10.0)[::9, kitchen]
    rows, columns = astro.space.cells(kitchen, astro.part).T
    fields = (astro.space.distance_field(point[None]) for point in places.points[::9])
    seconds = np.array([field[rows, columns].min() / 0.6 for field in fields])
    assert near == pytest.approx(np.exp(-seconds / 10), rel=1e-3)
    x = np.linspace(0, 60, 500)
    assert decay(x) == pytest.approx(np.exp(-x), rel=1e-4)


def test_it_stays_out_of_rooms_but_near_them_if_told():
    content = home_with([hangout(no_stops_in=["bathroom"])], "40 min", **belief(bathroom_1=1))
    assert "kitchen_1" == rooms(run(content))[-1]


def test_it_stands_off_doors_ways_and_seats():
    content = home_with([hangout()], "5 min", "meander", **belief(bathroom_1=1))
    content["floorplan"] = {"type": "bundled", "furnish": True}
    content["robots"]["astro"].pop("start")
    simulation = Simulation(content)
    plan, behavior = simulation.home.plan, simulation.actors["astro"].behaviors[0]
    places = HangoutPlaces(simulation.actors["astro"], frozenset())
    points = shapely.points(plan.lattice.to_metres(places.points))
    doors = shapely.linestrings([[door.start, door.end] for door in plan.doorways])
    assert shapely.distance(points[:, None], doors).min() >= 0.79
    for penalty, most in ((places.block, 0.05), (places.prox, 0)):
        assert 0 == penalty.min()
        assert most < penalty.max() <= 1
    best = int(np.argmin(behavior.penalty))
    assert 0 == places.block[best] == places.prox[best]


def test_it_moves_rarely():
    def moves(**fields):
        content = home_with(
            [hangout(source="share", **fields)], "12 h", "meander", algorithms=SHARE
        )
        return [name for name in names(run(content)) if name == "relocates"]

    usual = moves()
    assert len(usual) < 12
    assert len(moves(hysteresis=0, moving=0)) >= len(usual)


def test_it_stands_still_in_quiet_hours():
    content = home_with([hangout(explore=1, quiet="07:30-08:30")], "2 h", **belief(bathroom_1=1))
    stored = assert_same_for_every_max_span(content, 61)
    poses = path(stored, "astro")
    quiet = slice(1860, 5400)  # a way that was begun before is ended
    assert 0 == np.ptp(poses.x[quiet]) == np.ptp(poses.y[quiet])
    steps = [step for step, name, _ in events(stored) if name == "explores"]
    assert [] == [step for step in steps if 1800 <= step < 5400]
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
    visits = [{"at": "07:15", "place": "living_room", "dwell": "2 min"}]
    behaviors = [{"type": "scheduled", "visits": visits}, hangout(period="1 h")]
    stored = run(home_with(behaviors, "40 min", **belief(bathroom_1=1)))
    assert ["relocates", "visits"] == names(stored)
    poses = path(stored, "astro")
    assert poses.x[800] == poses.x[-1] != poses.x[960]


def test_it_explores_all_rooms_with_equal_chances():
    stored = run(home_with([hangout(explore=1)], "1 d", **belief(bathroom_1=1)))
    counts = Counter(detail for _, name, detail in events(stored) if name == "explores")
    assert 144 == counts.total()
    expected = 144 / len(counts)
    # Five standard deviations.
    assert max(abs(count - expected) for count in counts.values()) < 5 * expected**0.5


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
    behavior = astro.behaviors[0]
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
