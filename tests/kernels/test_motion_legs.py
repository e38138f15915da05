"""Plans built leg by leg, against the same in lists."""

from math import ceil

import numpy as np
import pytest
import shapely
from tests.kernels.test_space_routes import routes_of
from tests.meshed_homes import home_of

from fleet2d.kernels import TURN, Legs, time_route, turn_between

SPEED, TURN_RATE = 768.0, 1023.7
# With a pillar, and less than the places that the tests go to.
ROOM = shapely.box(0, 0, 3600, 3600) - shapely.box(1600, 1600, 2200, 2200)


class InLists:
    """The slow, obvious twin of Legs: the state is the last row."""

    def __init__(self):
        self.rows = [[5_000_000, 100, 200, 7, 0]]

    @property
    def now(self):
        return self.rows[-1]

    def turn(self, headings):
        left = abs(headings)
        while left > 0:
            part = min(left, TURN // 3)
            left -= part
            time, x, y, heading, away = self.now
            heading = (heading + (part if headings > 0 else -part)) % TURN
            self.rows.append([time + ceil(part * 1e6 / TURN_RATE), x, y, heading, away])

    def settle(self, x, y, heading):
        if [x, y] != self.now[1:3]:
            self.walk(np.array([self.now[1:3], [x, y]]))
        self.turn(turn_between(self.now[3], heading))

    def walk(self, route):
        timed = time_route(route, self.now[0], self.now[3], SPEED, TURN_RATE)
        self.rows += [[*row, 0] for row in timed[1:].tolist()]


@pytest.mark.parametrize("seed", range(8))
def test_legs_equal_lists(seed):
    random, legs, twin = np.random.default_rng(seed), Legs(), InLists()
    routes = routes_of(home_of([ROOM]))
    legs.mark(*twin.now)
    for what in random.integers(0, 6, 80).tolist():
        time, x, y, heading, away = now = twin.now
        if what == 0:
            twin.rows.append([time + int(random.integers(0, 10**9)), x, y, heading, away])
            legs.mark(*twin.now)
        elif what == 1:
            headings = int(random.integers(-2 * TURN, 2 * TURN))
            twin.turn(headings)
            assert twin.now == list(legs.turn(*now, headings, TURN_RATE))
        elif what == 2:
            route = np.concatenate([[[x, y]], random.integers(0, 4000, (3, 2))])
            twin.walk(route)
            assert twin.now == list(legs.walk(time, heading, route, SPEED, TURN_RATE))
        elif what == 3:
            place = random.choice([x, *random.integers(0, 4000, 2)], 2).tolist()
            twin.settle(*place, towards := int(random.integers(TURN)))
            after = legs.settle(time, x, y, heading, *place, towards, SPEED, TURN_RATE)
            assert twin.now == list(after)
        elif what == 4:
            goal = random.integers(1, 4000, 2).tolist()
            off = None if random.random() < 0.5 else tuple(random.integers(1, 4000, 2).tolist())
            after = legs.go(time, x, y, heading, routes, *goal, SPEED, TURN_RATE, off)
            begin = off or (x, y)
            inside = all(ROOM.contains(shapely.Point(point)) for point in (begin, goal))
            assert inside == (after is not None)
            if inside:
                twin.walk(np.array([(x, y), begin]))
                twin.walk(routes.find(*begin, *goal))
                assert twin.now == list(after)
        else:
            block = np.array([[time + 10, 3, 4, 5, 1], [time + 20, 6, 7, 8, 0]])
            legs.add(block)
            twin.rows += block.tolist()

    columns = legs.track()

    assert len(twin.rows) == len(legs)
    assert twin.rows == legs.rows().tolist()
    assert [list(row) for row in zip(*(c.tolist() for c in columns), strict=True)] == twin.rows
    assert [np.dtype(t) for t in ("i8", "i8", "i8", "i8", "u1")] == [c.dtype for c in columns]


@pytest.mark.parametrize("headings", [0, -700, TURN])
def test_visits_equal_ways_turns_and_stays_one_by_one(headings):
    routes = routes_of(home_of([ROOM]))
    stops = np.array([[300, 3000], [3000, 2900], [3000, 2900], [700, 800]])
    legs, twin = Legs(), InLists()
    begin = twin.now

    end = legs.visit(*begin[:-1], routes, stops, SPEED, TURN_RATE, headings, 1_500)

    for stop in stops.tolist():
        twin.walk(routes.find(*twin.now[1:3], *stop))
        twin.turn(headings)
        twin.rows.append([twin.now[0] + 1_500, *twin.now[1:]])
    assert twin.now == list(end or ())
    assert twin.rows[1:] == legs.rows().tolist()


def test_if_a_stop_is_out_of_reach_nothing_is_visited():
    legs = Legs()
    in_pillar = np.array([[300, 3000], [1900, 1900]])
    routes = routes_of(home_of([ROOM]))

    assert legs.visit(0, 100, 200, 7, routes, in_pillar, SPEED, TURN_RATE, TURN, 0) is None
    assert not len(legs)
