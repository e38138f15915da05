"""The ways by which a body gets round others, against trying one after the other."""

import numpy as np
import pytest
from shapely import box
from tests.meshed_homes import home_of
from tests.reference import giving_way as slow

from fleet2d.kernels import Breakpoints, Distances, Timelines, Yielder, next_stop

SECOND = 10**6
NEAR = 300
END = 30
BEAT = 3 * SECOND // 2
NO_DISCS = np.zeros((0, 3), np.int64)
MESH = home_of([box(0, 0, 4096, 4096)]).mesh
WAITS = np.array([1, 4])


def breakpoints(rows):
    time, x, y, heading, away = np.ascontiguousarray(rows.T)
    return Breakpoints(time, x, y, heading, away.astype(np.uint8))


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
        timelines = Timelines(3, SECOND)
        for row, rows in enumerate(tracks):
            timelines.follow(row, 0, breakpoints(rows), np.zeros(0, np.int64), np.zeros(1, np.int8))
        step = int(random.integers(0, 20))
        yield random, timelines, tracks, step


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
            assert way[0].tolist() == expected
            later = (expected[1][0] - expected[0][0]) if len(expected) > 1 else 0
            assert way[1] == [(now, now, later, slow.delayed(rest, now, pose, later)[1])]
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
                since = max(goal[0], now)
                leaves = max(since, -(-track[-1][0] // BEAT) * BEAT)
                if stop >= 0 and track[-1][0] < leaves:
                    track.append([leaves, *track[-1][1:]])
                rest = rows[stop + 1 :].tolist() if stop >= 0 else []
                later = track[-1][0] - since
                track += slow.delayed(rest, since, track[-1][1:], later)[0]
                tracks.append(track)
            expected = slow.first_free(tracks, is_free)
            if expected is None and rests and tracks:
                expected = tracks[-1]
        body = Yielder(0, MESH, None, 1000.0, 1000.0, BEAT, straight)
        way = timelines.way_by_a_place(body, step, met, places, WAITS, rests, kept(3), END)
        assert (expected is None) == (way is None)
        if way is not None:
            found += 1
            assert way[0].tolist() == expected
    assert 10 < found < 115


def test_a_body_that_stands_at_a_corner_stays_aside_as_no_way_leads_back():
    corner = np.array([[0, 0, 0, 0, 0], [20 * SECOND, 0, 0, 0, 0]])
    timelines = Timelines(1, SECOND)
    timelines.follow(0, 0, breakpoints(corner), np.zeros(0, np.int64), np.zeros(1, np.int8))
    body = Yielder(0, MESH, None, 1000.0, 1000.0, BEAT, straight)
    place = np.array([[900, 1200]])
    way = timelines.way_by_a_place(body, 2, 4, place, WAITS, 6, kept(1), END)
    assert way is not None
    assert way[0].tolist() == [
        [2 * SECOND, 0, 0, 0, 0],
        [3 * SECOND + SECOND // 2, 900, 1200, 0, 0],
        [5 * SECOND, 900, 1200, 0, 0],
        [20 * SECOND, 900, 1200, 0, 0],
    ]


def random_rest(random):
    """A track on which most moments are of stops, with turns at some of them; some end away."""
    rows = random_rows(random)
    rows[-1, 4] = random.integers(0, 4) == 0
    return rows


def rests(random, count):
    """Yield tracks of a body with many stops, its timelines, a step, and when it meets another."""
    for _ in range(count):
        rows = random_rest(random)
        timelines = Timelines(1, SECOND)
        timelines.follow(0, 0, breakpoints(rows), np.zeros(0, np.int64), np.zeros(1, np.int8))
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
        assert ways == (None if way is None else (way[0].tolist(), way[1]))
        found[0 if way is None else len(way[1])] += 1
    assert min(found.values()) > 10, found


def test_a_body_goes_on_from_where_it_is_instead_of_a_stop():
    random = np.random.default_rng(53)
    found = {0: 0, 1: 0, 2: 0}
    for rows, timelines, step, met in rests(random, 200):
        body = Yielder(0, MESH, None, 1000.0, 1000.0, BEAT, straight)
        now = [step * SECOND, *timelines.pose(0, step)]
        ways = slow.way_from_here(now, rows.tolist(), met, walk, BEAT)
        way = timelines.way_from_here(body, step, met, lambda *_: True)
        assert ways == (None if way is None else (way[0].tolist(), way[1]))
        assert timelines.way_from_here(body, step, met, lambda *_: False) is None
        found[0 if way is None else len(way[1])] += 1
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
