"""The ways by which a body gets round others, against trying one after the other."""

import math

import numpy as np
import pytest
from shapely import box
from tests.kernels.scenes import breakpoints, following
from tests.meshed_homes import home_of
from tests.reference import giving_way as slow

from fleet2d.entities.yielder import AsideSearch, BodyInWay, Yielder
from fleet2d.kernels import Distances, next_stop

SECOND = 10**6
NEAR = 300
END = 30
BEAT = 3 * SECOND // 2
NO_DISCS = np.zeros((0, 3), np.int64)
MESH = home_of([box(0, 0, 4096, 4096)]).mesh
WAITS = np.array([1, 4])


def random_rows(random):
    """A body that drives and stands, in a square of 4000 units."""
    times = np.sort(random.choice(END, 7, replace=False)) * SECOND
    points = random.integers(100, 4000, (7, 2))
    points[[2, 3, 5]] = points[[1, 1, 4]]
    zeros = np.zeros(7, np.int64)
    return np.column_stack([times, points, zeros, zeros])


def kept(bodies):
    whole = np.ones((1, bodies), np.int64)
    return Distances(whole * 0, whole * NEAR, whole * 0, np.zeros((1, bodies), np.uint8))


def straight(time, x, y, heading, to_x, to_y, discs):
    """Drive there at 1000 units a second, facing one way; the right border can't be reached."""
    if to_x > 3000:
        return None
    takes = int(np.hypot(to_x - x, to_y - y) * SECOND / 1000)
    return np.array([[time + takes, to_x, to_y, heading, 0]])


def walk(now, place):
    """The same, for the reference."""
    rows = straight(*now[:4], *place, NO_DISCS)
    return None if rows is None else rows.tolist()


def scenes(count):
    """Timelines of three bodies with random tracks, and the rows of the first one."""
    random = np.random.default_rng(51)
    for _ in range(count):
        tracks = [random_rows(random) for _ in range(3)]
        timelines = following(list(map(breakpoints, tracks)))
        step = int(random.integers(0, 20))
        yield random, timelines, tracks, step


def rows_of(way):
    """The breakpoints of a way, the last of which it names."""
    rows = way[0].rows().tolist()
    assert rows[-1] == list(way[1])
    return rows


def free_in(timelines, step):
    return lambda rows: timelines.meeting_on(0, breakpoints(rows), kept(3), step, END) == (-1, -1)


def test_a_body_goes_on_after_the_first_wait_that_lets_it():
    found = 0
    for _, timelines, (rows, *_), step in scenes(120):
        now = step * SECOND
        pose = list(timelines.pose(0, step))
        rest = [row for row in rows.tolist() if row[0] > now]
        tracks = []
        for wait in WAITS.tolist():
            later = wait * SECOND
            tracks.append([[now, *pose], [now + later, *pose], *slow.delayed(rest, now, pose, later)[0]])  # fmt: skip
        expected = slow.first_free(tracks, free_in(timelines, step))
        way = timelines.way_after_a_wait(0, step, WAITS, kept(3), END)
        assert (expected is None) == (way is None)
        if way is not None and expected is not None:
            found += 1
            assert rows_of(way) == expected
            later = (expected[1][0] - expected[0][0]) if len(expected) > 1 else 0
            assert way[2] == [(now, now, later, slow.delayed(rest, now, pose, later)[1])]
    assert 10 < found < 110


@pytest.mark.parametrize("rests", [0, 6])
def test_a_body_goes_on_by_the_first_place_that_lets_it(rests):
    found = 0
    for random, timelines, (rows, *_), step in scenes(120):
        now, met = step * SECOND, step + 2
        pose = list(timelines.pose(0, step))
        places = random.integers(100, 4000, (3, 2))
        is_free = free_in(timelines, step)
        stop = slow.next_stop(rows.tolist(), (met + 1) * SECOND)
        goal = rows[stop].tolist()
        expected = None
        for place in places.tolist():
            there = straight(now, *pose[:3], *place, NO_DISCS)
            if expected is not None or there is None:
                continue
            out = [[now, *pose], *there.tolist()]
            if rests and not is_free(np.array(out)):
                continue
            tracks = []
            for wait in [*WAITS.tolist(), *([rests] if rests else [])]:
                until = (-(-out[-1][0] // SECOND) + wait) * SECOND
                track = [*out, [until, *out[-1][1:]]] if until > out[-1][0] else list(out)
                back = straight(*track[-1][:4], *goal[1:3], NO_DISCS)
                if back is None:
                    continue
                track += back.tolist()
                since, first = max(goal[0], now), len(rows)
                if stop >= 0:
                    track, first = slow.rested(track, since, BEAT), stop + 1
                tracks.append(slow.going_on(track, rows.tolist(), now, since, first)[0])
            expected = slow.first_free(tracks, is_free)
            if expected is None and rests and tracks:
                expected = tracks[-1]
        body = Yielder(0, MESH, None, 1000.0, 1000.0, BEAT, straight)
        way = timelines.way_by_a_place(body, step, met, places, WAITS, rests, kept(3), END)
        assert (expected is None) == (way is None)
        if way is not None:
            found += 1
            assert rows_of(way) == expected
    assert 10 < found < 115


def is_same_way(one, other):
    if one is None or other is None:
        return one is other
    return rows_of(one) == rows_of(other) and one[1:] == other[1:]


def test_a_body_takes_a_stop_where_it_stays():
    random = np.random.default_rng(54)
    taken = 0
    for _, timelines, (rows, *_), step in scenes(120):
        met = step + int(random.integers(0, 4))
        until = step + int(random.integers(1, 9))
        stop = slow.next_stop(rows.tolist(), (met + 1) * SECOND)
        places = [timelines.pose(1, at)[:2] for at in range(step, until)]
        away = math.dist(rows[stop, 1:3].tolist(), places[0])
        near = int(away) + int(random.integers(-1, 3))
        expected = len(set(places)) == 1 and away < near
        assert timelines.takes_stop(0, MESH, step, met, 1, near, until) == expected
        taken += expected
    assert 10 < taken < 110


@pytest.mark.parametrize("by_triangle", [True, False])
def test_a_body_goes_past_another_one_later_or_by_a_point_beside_it(by_triangle):
    found = {"later": 0, "beside": 0, "taken": 0, "none": 0}
    rooms = np.repeat(np.array([[0, 1]], np.int16), 32, axis=1).repeat(64, axis=0)
    rooms[:, :4] = -1
    none = np.zeros(0, np.int64)
    parts = np.zeros(len(MESH.triangles), np.int32) if by_triangle else lambda x, y: int(y > 3000)
    for random, timelines, _, step in scenes(200):
        met = step + 2
        near = int(random.choice([350, 2000]))
        distance = int(random.integers(300, 900))
        until = step + 5
        body = Yielder(0, MESH, None, 1000.0, 1000.0, BEAT, straight)
        middle, at = (timelines.pose(row, step)[:2] for row in (1, 0))
        points = [
            (x, y)
            for x, y in slow.points_around(middle, distance)
            if slow.room_of(rooms, x, y) == slow.room_of(rooms, *middle)
            and 0 < x < 4096
            and 0 < y < 4096
            and (by_triangle or y <= 3000)
        ]
        points.sort(key=lambda point: math.dist(point, at))
        waits = WAITS if random.integers(0, 2) else none
        later = beside = None
        if len(waits) and not timelines.rests(1, step, until):
            later = timelines.way_after_a_wait(0, step, waits, kept(3), until)
        is_taken = timelines.takes_stop(0, MESH, step, met, 1, near, until)
        if not is_taken:
            places = np.array(points[1:4], np.int64).reshape(-1, 2)
            now = np.zeros(1, np.int64)
            beside = timelines.way_by_a_place(body, step, met, places, now, 0, kept(3), until)
        in_way = BodyInWay(1, near, distance, rooms, parts, 0)
        way = timelines.way_past(body, step, met, in_way, waits, kept(3), until)
        assert is_same_way(way, beside if later is None else later)
        kind = "later" if later else "beside" if beside else "taken" if is_taken else "none"
        found[kind] += 1
    assert min(found.values()) > 3, found


def test_parts_of_another_space_are_refused():
    (_, timelines, _, step), *_ = scenes(1)
    body = Yielder(0, MESH, None, 1000.0, 1000.0, BEAT, straight)
    parts = np.zeros(len(MESH.triangles) + 1, np.int32)
    in_way = BodyInWay(1, 350, 400, np.zeros((64, 64), np.int16), parts, 0)
    with pytest.raises(ValueError, match="parts must be a function"):
        timelines.way_past(body, step, step + 1, in_way, WAITS, kept(3), step + 5)


def test_a_body_steps_aside_nearby_or_else_farther_away():
    found = {"near": 0, "far": 0, "none": 0}
    for random, timelines, _, step in scenes(120):
        met, until, rests = step + 2, step + 6, 5
        parts = random.integers(0, 8, (64, 64)).clip(0, 1).astype(np.int32)
        start = tuple(random.integers(700, 3000, 2).tolist())
        reach = np.array([0, *random.integers(300, 2500, 2)])
        near, far, spacing, most = int(random.integers(2, 8)), 20, 2, 3
        body = Yielder(0, MESH, None, 1000.0, 1000.0, BEAT, straight)
        expected = None
        kind = "none"
        for name, within in (("near", near), ("far", far)):
            search = within, spacing, most
            places = timelines.places_aside(0, step, step + rests, parts, 1, start, search, reach)
            if expected is None:
                expected = timelines.way_by_a_place(body, step, met, places, WAITS, rests, kept(3), until)  # fmt: skip
                kind = kind if expected is None else name
        aside = AsideSearch(parts, 1, lambda at=start: at, near, far, spacing, most, reach)
        way = timelines.way_aside(body, step, met, aside, WAITS, rests, kept(3), until)
        assert is_same_way(way, expected)
        found[kind] += 1
    assert min(found.values()) > 3, found


def random_rest(random):
    """A track on which most moments are of stops, with turns at some of them; some end away."""
    rows = random_rows(random)
    rows[-1, 4] = random.integers(0, 4) == 0
    return rows


def rests(random, count):
    """Yield tracks of a body with many stops, its timelines, a step, and when it meets another."""
    for _ in range(count):
        rows = random_rest(random)
        timelines = following([breakpoints(rows)])
        step = int(random.integers(0, 20))
        met = int(random.integers(step, step + 4)) * SECOND
        yield rows, timelines, step, met


def test_a_body_goes_round_others_and_beside_those_at_its_stop():
    random = np.random.default_rng(52)
    found = {0: 0, 1: 0, 2: 0}
    for rows, timelines, step, met in rests(random, 300):
        stops = rows[[1, 2, 4]][random.integers(0, 3, 2)]
        discs = np.column_stack([stops[:, 1:3] + random.integers(-200, 200, (2, 2)), [250, 150]])
        beside = random.integers(100, 4000, 2).tolist() if random.integers(0, 5) else None
        body = Yielder(0, MESH, None, 1000.0, 1000.0, BEAT, straight)
        now = [step * SECOND, *timelines.pose(0, step)]
        ways = slow.way_round(now, rows.tolist(), met, discs.tolist(), beside, walk, BEAT)
        way = timelines.way_round(body, step, met, discs, lambda *_, at=beside: at)
        assert ways == (None if way is None else (rows_of(way), way[2]))
        found[0 if way is None else len(way[2])] += 1
    assert min(found.values()) > 10, found


def test_a_body_goes_on_from_where_it_is_instead_of_a_stop():
    random = np.random.default_rng(53)
    found = {0: 0, 1: 0, 2: 0}
    for rows, timelines, step, met in rests(random, 200):
        body = Yielder(0, MESH, None, 1000.0, 1000.0, BEAT, straight)
        now = [step * SECOND, *timelines.pose(0, step)]
        ways = slow.way_from_here(now, rows.tolist(), met, walk, BEAT)
        way = timelines.way_from_here(body, step, met, lambda *_: True)
        assert ways == (None if way is None else (rows_of(way), way[2]))
        assert timelines.way_from_here(body, step, met, lambda *_: False) is None
        found[0 if way is None else len(way[2])] += 1
    assert min(found.values()) > 5, found


def test_a_body_at_rest_meets_whom_it_would_meet_on_a_track_that_rests():
    met = 0
    for _, timelines, _, step in scenes(60):
        rest = np.array([[step * SECOND, *timelines.pose(0, step)]])
        expected = timelines.meeting_on(0, breakpoints(rest), kept(3), step, END)
        assert timelines.meeting_at_rest(0, kept(3), step, END) == expected
        met += expected[0] >= 0
    assert 3 < met < 57


def test_a_body_rests_while_its_place_stays_the_same():
    rested = 0
    for _, timelines, _, step in scenes(60):
        places = {timelines.pose(1, at)[:2] for at in range(step, step + 3)}
        assert timelines.rests(1, step, step + 3) == (len(places) == 1)
        rested += len(places) == 1
    assert 5 < rested < 55


def test_the_next_stop_is_where_it_stands_next_and_can_stand():
    for _, _, (rows, *_), step in scenes(60):
        moment = step * SECOND
        assert next_stop(MESH, breakpoints(rows), moment) == slow.next_stop(rows.tolist(), moment)
    corner = np.array([[0, 0, 0, 0, 0], [5, 0, 0, 9, 0], [9, 70, 70, 9, 0]])
    assert next_stop(MESH, breakpoints(corner), 0) == -1, "on the border it only turns"


def test_places_aside_are_the_nearest_that_nobody_comes_near_to():
    found = 0
    for random, timelines, _, step in scenes(40):
        parts = random.integers(0, 8, (64, 64)).clip(0, 1).astype(np.int32)
        start = tuple(random.integers(700, 3000, 2).tolist())
        search = int(random.integers(3, 40)), 2, 5
        reach = np.array([0, 900, 1500])
        poses = timelines.poses(np.arange(step, step + 6))
        ways = [(poses[:, body, :2], int(reach[body])) for body in (1, 2)]
        places = timelines.places_aside(0, step, step + 5, parts, 1, start, search, reach)
        assert [tuple(place) for place in places.tolist()] == slow.places_aside(parts, 1, start, search, ways)  # fmt: skip
        found += len(places) > 0
    assert 10 < found


def test_who_stands_is_at_rest_now_or_will_have_stopped():
    reach = np.arange(100, 103)
    for _, timelines, _, step in scenes(60):
        for steps in (1, 3, 9):
            expected = []
            for other in (1, 2):
                for at in (step, step + steps):
                    poses = timelines.poses(np.arange(at, at + steps))[:, other]
                    if (poses[:, :2] == poses[0, :2]).all():
                        expected.append([*poses[0, :2].tolist(), int(reach[other])])
                        break
            assert timelines.standing(0, step, steps, reach).tolist() == expected
