"""Poses over time against fractions, and the random walk against a look at every wall."""

import math
from fractions import Fraction
from itertools import islice, pairwise

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from tests.kernels.scenes import breakpoints
from tests.meshed_homes import home_of, houseexpo
from tests.reference import motion as slow
from tests.reference.line_of_sight import is_inside, touches_any_wall
from tests.strategies import homes, quick, seeds

from fleet2d.kernels import (
    TURN,
    Poses,
    WalkRule,
    time_route,
    trace_meander,
    trace_track,
)

DAY_US = 86_400_000_000


def poses(count):
    """Return room for poses, filled with what no pose is."""
    x, y, heading = (np.full(count, -7, np.int64) for _ in range(3))
    return Poses(x, y, heading, np.full(count, 9, np.uint8))


def rows_of(out):
    """Return the poses as tuples."""
    return list(zip(*(array.tolist() for array in out), strict=True))


def traced(track, begin, step, count):
    """Return the poses that the kernel finds."""
    out = poses(count)
    trace_track(breakpoints(track), begin, step, out)
    return rows_of(out)


def twin(track, begin, step, count):
    """Return the poses that the twin finds."""
    return [slow.pose_at(track, begin + i * step) for i in range(count)]


@st.composite
def tracks(draw):
    """Tracks with breakpoints at equal times, halts, turns across 0 and half turns."""
    time, x, y, heading, away = draw(st.integers(0, 50)), 500, 700, draw(st.integers(0, 4095)), 0
    track = [(time, x, y, heading, away)]
    pause = st.one_of(st.sampled_from([0, 1, 20, 1_000_000]), st.integers(0, 200))
    hop = st.one_of(st.just(0), st.integers(-40, 40), st.integers(-(2**20), 2**20))
    turn = st.one_of(st.sampled_from([0, 2047, 2048, 2049, -1, 1]), st.integers(0, 4095))
    for _ in range(draw(st.integers(0, 6))):
        time += draw(pause)
        x, y = x + draw(hop), y + draw(hop)
        heading, away = (heading + draw(turn)) % TURN, draw(st.integers(0, 1))
        track.append((time, x, y, heading, away))
    return track


@quick
@given(tracks(), st.integers(-60, 400), st.sampled_from([1, 3, 20, 333_333]))
def test_trace_track_equals_fractions(track, begin, step):
    assert twin(track, begin, step, 40) == traced(track, begin, step, 40)


def test_trace_track_of_a_ten_year_halt_and_a_day_long_leg_does_not_overflow():
    years = 3650 * DAY_US
    track = [(0, 5, 5, 0, 0), (years, 5, 5, 0, 0), (years + DAY_US, 2**20, 5, 2047, 0)]

    for begin, step in ((0, 300 * DAY_US), (years, 7_000_000_001)):
        assert twin(track, begin, step, 14) == traced(track, begin, step, 14)


@quick
@given(
    st.integers(-(2**20), 2**20),
    st.integers(-(2**20), 2**20),
    st.integers(1, 10**9),
    st.integers(1, 10**8),
)
def test_trace_track_rounds_halves_up(start, change, whole, step):
    """However many steps a leg has: quotients are carried along from step to step."""
    track = [(0, start, -start, 0, 0), (whole, start + change, -start - change, 1, 0)]

    for begin in (0, whole // 2):
        assert twin(track, begin, step, 60) == traced(track, begin, step, 60)


def timed(route, speed, rate, heading=0):
    """Return the breakpoints of a route that begins at 1 s."""
    return time_route(np.array(route, np.int64), 1_000_000, heading, speed, rate)


corners = st.one_of(
    st.tuples(st.integers(0, 3), st.integers(0, 3)),
    st.tuples(st.integers(0, 2**20 - 1), st.integers(0, 2**20 - 1)),
)


@quick
@given(
    st.lists(corners, min_size=1, max_size=8),
    st.floats(50.0, 5000.0),
    st.floats(100.0, 8000.0),
    st.integers(0, 4095),
)
def test_time_route_turns_then_walks_at_most_at_top_speed(route, speed, rate, heading):
    """Each leg takes the least whole microseconds; a rounded float may add or take one."""
    rows = iter(timed(route, speed, rate, heading).tolist())
    state = [1_000_000, *route[0], heading]
    assert state == next(rows)

    for (ax, ay), (bx, by) in pairwise(route):
        squared = (bx - ax) ** 2 + (by - ay) ** 2
        if squared == 0:
            continue
        leg = next(rows)
        if leg[1:3] == [ax, ay]:
            turn = abs(slow.shorter_turn(state[3], leg[3]))
            assert turn > 0
            assert abs(leg[0] - state[0] - -(turn * 10**6 // -Fraction(rate))) <= 1
            assert (leg[0] - state[0] + 1e-3) * rate >= turn * 1e6
            state, leg = leg, next(rows)
        assert [bx, by, state[3]] == leg[1:]
        assert abs(leg[0] - state[0] - slow.least_walk_us(squared, Fraction(speed))) <= 1
        assert (leg[0] - state[0] + 1e-3) * speed >= squared**0.5 * 1e6
        state = leg
    assert next(rows, None) is None


def test_time_route_rounds_every_time_up():
    rows = timed([(0, 0), (0, 1)], 3.0, 3000.0)

    assert [1_000_000, 1_341_334, 1_674_668] == rows[:, 0].tolist()


def test_endless_time_route_ends_at_the_last_possible_time():
    assert 2**61 == timed([(0, 0), (5, 5), (0, 9)], 1e-300, 1e-300)[-1, 0]


# --- The random walk ---


def walked(walls, space, rule, first, start, count):
    """Return the poses of a walk: int64 (count, 3)."""
    out = poses(count)
    trace_meander(walls.mesh, space.mesh, rule, first, tuple(start.tolist()), out)
    assert not out.away.any()
    return np.stack(out[:3], axis=1)


def shrunk(home, reach):
    """Return the home as a body that reaches so far on all sides has it; None if it has none."""
    outside = shapely.box(-500, -500, 20_000, 20_000).difference(shapely.union_all(home.polygons))
    grown = [
        shapely.affinity.translate(outside, x, y)
        for x, y in ((reach, 0), (-reach, 0), (0, reach), (0, -reach))
    ]
    rest = shapely.union_all(home.polygons).difference(shapely.union_all(grown), grid_size=2)
    parts = [p for p in shapely.get_parts(rest) if p.geom_type == "Polygon" and p.area > 0]
    return home_of(parts) if parts else None


def inner_points(home, rng, count):
    """Return points strictly inside: int64 (n, 2)."""
    tried = rng.integers(0, [64 * home.columns, 64 * home.rows], (40 * count, 2))
    inside = tried[is_inside(home.walls, tried)]
    off_wall = [not touches_any_wall(home.walls, p, p[None])[0] for p in inside[:count]]
    return np.asarray(inside[:count][off_wall], np.int64)


@quick
@given(homes(), seeds(), st.sampled_from([0, 40, 100]), st.sampled_from([700, 9_000, 90_000]))
def test_trace_meander_equals_a_check_of_every_wall(polygons, seed, reach, stride):
    """From inside of the space, from its border, and from a step on that isn't the first."""
    home, rng = home_of(polygons), np.random.default_rng(seed)
    space = shrunk(home, reach)
    if space is None:
        return
    wall = space.walls[rng.integers(len(space.walls))]
    limit = int(rng.choice([0, 37, 200, 2048]))
    rule = WalkRule(np.uint64(seed), stride, 60_000, limit)
    for x, y in [*inner_points(space, rng, 2), wall[:2], (wall[:2] + wall[2:]) // 2]:
        first, start = int(rng.integers(100)), np.array([x, y, rng.integers(TURN)])
        steps = slow.walk(home.walls, space.walls, *map(int, rule[:4]), start.tolist(), first)

        expected = np.array(list(islice(steps, 25)))

        assert np.array_equal(expected, walked(home, space, rule, first, start, 25))


@pytest.mark.parametrize("stride", [256, 0.1 * 1280 * 256, 1280 * 256])
def test_trace_meander_never_leaves_a_real_home(shared_data, stride):
    """Known failure 8: with 1 m a step, one move in five crossed a wall."""
    path = shared_data / "houseexpo" / "658e5214673c7a4e25b458e56bdb6144.json"
    home, rng = houseexpo(path), np.random.default_rng(8)
    rule = WalkRule(np.uint64(12), int(stride), 30_000, 300)

    moves = 0
    for x, y in inner_points(home, rng, 2):
        places = walked(home, home, rule, 0, np.array([x, y, 0]), 4000)[:, :2]
        assert is_inside(home.walls, places).all()
        for here, there in pairwise(places):
            if (here != there).any():
                assert not touches_any_wall(home.walls, here, there[None])[0]
                assert abs(math.dist(here, there) - rule.stride / 256) < 1
                moves += 1
    assert moves > 80


def test_trace_meander_from_the_border_does_not_step_through_a_wall():
    """Beyond the wall is space too, one stride away, and it would be strictly inside."""
    home = home_of([shapely.box(0, 0, 2000, 1000), shapely.box(2010, 0, 4000, 1000)])
    space = home_of([shapely.box(300, 300, 1700, 700), shapely.box(2310, 300, 3700, 700)])
    rule = WalkRule(np.uint64(3), 900 * 256, 0, 1)

    steps = walked(home, space, rule, 0, np.array([1700, 500, 0]), 5)

    assert [[1700, 500]] * 5 == steps[:, :2].tolist()


def test_trace_meander_with_a_stride_beyond_the_home_stays_and_turns():
    home = home_of([shapely.box(0, 0, 640, 640)])
    rule = WalkRule(np.uint64(1), 1000 * 256, 60_000, 4096)

    steps = walked(home, home, rule, 0, np.array([333, 333, 0]), 500)

    assert {(333, 333)} == {(x, y) for x, y, _ in steps.tolist()}
    assert len(set(steps[:, 2].tolist())) > 200
