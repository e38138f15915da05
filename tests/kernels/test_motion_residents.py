"""What people do in a home, against the same leg by leg, and what is refused."""

from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.kernels.calls import CALLS, OneRoom
from tests.reference.residents import SlowHome
from tests.scenes import scenario
from tests.thorough import examples

import fleet2d
from fleet2d.entities.plan import Plan
from fleet2d.entities.users.resident import MOVE_KINDS, SECOND_US, KnownHome, Venue
from fleet2d.floorplan.placed_objects import POSTURES
from fleet2d.kernels import CoreVenue, LastStint, Legs, Resident, Waits
from fleet2d.routines.activity import Activity
from fleet2d.routines.distributions import uniform

HOMES = {
    "furnished": {"floorplan": {"type": "bundled", "furnish": True}},
    "empty": {},
}


@cache
def person(home, body):
    """A person in a home, or a robot that moves as a person does not, and its routine."""
    users = {"ana": {"type": "routine", "persona": "retired"}}
    robot = {"type": "routine", "persona": "retired", "drive": {"type": "trapezoidal"}}
    content = scenario("1 d", users=users, robots={"astro": robot}, **HOMES[home])
    actor = fleet2d.Simulation(content).actors[body]
    return actor.behaviors[0], actor


@st.composite
def venue_of(draw, spots, rooms, kinds):
    """A venue with any rooms, furniture, moves and stores."""
    own = draw(st.lists(st.sampled_from(rooms), max_size=3, unique=True))
    activity = Activity(
        away=draw(st.booleans()) and draw(st.booleans()),
        choose=draw(st.sampled_from(["own", "nearest", "each_time", "here"])),
        posture=draw(st.sampled_from(POSTURES)),
        objects=tuple(draw(st.lists(st.sampled_from(kinds), max_size=3)) if kinds else ()),
    )
    moves = [
        (kind, draw(st.sampled_from([1, 60, 900, 7200])))
        for kind in MOVE_KINDS
        if draw(st.booleans()) and not activity.away
    ]
    seats = spots.at_furniture(activity, own)
    stores = draw(st.lists(st.sampled_from(rooms), max_size=2))
    takes = draw(st.sampled_from([(0, 0), (1, 90), (600, 600), (9, 50_000)]))
    return Venue(activity, own, list(seats), stores, tuple(moves), uniform(*takes))


@pytest.mark.slow
@settings(max_examples=examples(400), deadline=None)
@given(
    st.data(),
    st.sampled_from([("furnished", "ana"), ("empty", "ana"), ("furnished", "astro")]),
)
def test_activities_equal_those_done_leg_by_leg(data, who):
    behavior, actor = person(*who)
    kinds = sorted({thing.type for thing in actor.home.objects if thing.uses})
    any_venue = venue_of(behavior.spots, list(behavior.reachable_rooms), kinds)
    homes = KnownHome(behavior, actor), SlowHome(behavior, actor)
    plans = [Plan(actor, 0) for _ in homes]
    for _ in range(data.draw(st.integers(1, 3))):
        stints, end_us = [], plans[0].time_us
        for _ in range(data.draw(st.integers(1, 4))):
            end_us += data.draw(st.sampled_from([0, 1, 7, 100, 1800, 9000])) * SECOND_US
            number = data.draw(st.integers(0, 1))
            role, stays = data.draw(st.integers(0, 3)), data.draw(st.booleans())
            venue = f"a{number}", data.draw(any_venue)
            stints.append((venue, number, end_us, role, stays))
        until_us = end_us - data.draw(st.sampled_from([0, 0, 3600])) * SECOND_US
        continues = data.draw(st.booleans())
        for plan, home in zip(plans, homes, strict=True):
            home.update()
            rows = [(home.in_core(*venue), *numbers) for venue, *numbers in stints]
            home.live(plan, rows, until_us, continues=continues)
        one, other = ((vars(plan), plan.legs.rows().tolist()) for plan in plans)
        assert other[1] == one[1]
        for name in ("time_us", "x", "y", "heading", "away", "notes", "posture", "postures"):
            assert other[0][name] == one[0][name], name


class Rooms(OneRoom):
    """A home of rooms with a spot each."""

    def spots(self, room):
        return [(5 + room, 5)]


def walks_of(stints, **answers):
    """Return the spots to which somebody walks, 7 us each, who does activities from 0 on."""
    spots = []

    def walk(course, place):
        spots.append(place[1:])
        return (course[0][0] + 7, *place[1:], 0, 0), 0

    resident, until = Resident(1, 100.0, 100.0, None, []), stints[-1][2]
    now = (0, 0, 0, 0, 0)
    resident.live(Rooms(**answers), walk, Legs(), now, 0, stints, until, False, LastStint())
    return spots


EVERY_10_S = Waits(np.array([10 * SECOND_US] * 2))
DUE_US = 7 + 10 * SECOND_US


def test_no_move_begins_in_the_last_ninety_seconds():
    walks = {}
    for more_us in (0, 1):
        moves = CoreVenue(None, 0, False, 0, 0, [0, 1], [], [], [(1, EVERY_10_S)], None)
        end_us = DUE_US + 90 * SECOND_US + more_us
        walks[more_us] = [len(walks_of([(moves, number, end_us, 0, False)])) for number in range(9)]
    assert {1} == set(walks[0])
    assert {1, 2} == set(walks[1])  # some stay in their room


@pytest.mark.parametrize(("more_us", "walks"), [(0, 1), (1, 3)])
@pytest.mark.parametrize("wait_us", [0, 20 * SECOND_US])
def test_nothing_is_fetched_without_time_to_wait_and_return(wait_us, more_us, walks):
    takes_5_s = ([5, 5], 5, 5, 0, 1 << 24)
    fetches = CoreVenue(None, 0, False, 0, 0, [0], [], [1], [(2, EVERY_10_S)], takes_5_s)
    end_us = DUE_US + wait_us + 5 * SECOND_US + 90 * SECOND_US + more_us
    assert walks == len(walks_of([(fetches, 0, end_us, 0, False)], wait=wait_us))


def test_an_error_of_the_home_is_passed_on_and_the_last_stint_stays_known():
    *args, last = CALLS["Resident.live"]()
    args[0] = Resident(1, 100.0, 100.0, None, [])

    def no_way(*_):
        raise KeyError("no way")

    args[0].live(*args[1:], last)
    assert (0, (-1, 1000, 500), (-1, 1000, 500)) == last.__getstate__()
    with pytest.raises(KeyError, match="no way"):
        args[0].live(args[1], no_way, *args[3:], last)

    assert (0, None, None) == last.__getstate__()
