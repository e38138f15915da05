"""How bodies move, piece after piece, against a twin that holds a pose for every step."""

import copy
import gc
import pickle
import sys
from bisect import bisect_right
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule
from tests.kernels.scenes import STANDING, breakpoints, following
from tests.meshed_homes import home_of
from tests.reference import motion as slow
from tests.strategies import quick

from fleet2d.kernels import Timelines, WalkRule, Window

STEP_US = 1000
HORIZON = 60
POSE_TYPES = (np.int64, np.int64, np.int64, np.uint8, np.int8)
ROOM = home_of([shapely.box(0, 0, 1280, 960).difference(shapely.box(500, 300, 640, 700))])
RULE = WalkRule(np.uint64(5), 9000, 40_000, 500)
INSIDE = home_of([shapely.box(100, 100, 1180, 860).difference(shapely.box(400, 200, 740, 800))])


class Twin:
    """Poses of one body at every step, up to the horizon."""

    def __init__(self):
        self.poses = {}

    def follow(self, step, track, posture_us, postures):
        for s in range(step, HORIZON):
            posture = postures[bisect_right(posture_us, s * STEP_US)]
            self.poses[s] = *slow.pose_at(track, s * STEP_US), posture

    def walk(self, step, walls, space, rule, start):
        poses = slow.walk(walls.walls, space.walls, *map(int, rule[:4]), start, step)
        for s, pose in zip(range(step, HORIZON), poses, strict=False):
            self.poses[s] = *pose, 0, 0


def runs_of(window, body):
    """Return the runs of a body: the step at which each begins, and its pose."""
    part = slice(*window.start[body : body + 2].tolist())
    columns = (window.step, window.x, window.y, window.heading, window.away, window.posture)
    rows = zip(*(column[part].tolist() for column in columns), strict=True)
    return [(step, (x, y, heading, away, posture)) for step, x, y, heading, away, posture in rows]


def dense(window, body, first, end):
    """Return the poses of a body at some steps."""
    columns = (column.tolist() for column in window.dense(body, first, end))
    return list(zip(*columns, strict=True))


def joined(poses, first):
    """Return the steps at which another pose is taken, and the poses."""
    return [(first + j, pose) for j, pose in enumerate(poses) if j == 0 or pose != poses[j - 1]]


def check_window(window, expected, first, end):
    """Check that a window tells the poses of all bodies, in as few runs as there can be."""
    assert (first, end) == (window.first, window.end)
    assert len(expected) + 1 == len(window.start)
    for body, poses in enumerate(expected):
        assert joined(poses, first) == runs_of(window, body)
        assert poses == dense(window, body, first, end)
    assert sum(len(runs_of(window, body)) for body in range(len(expected))) == window.start[-1]


# Steps and half steps, nothing at all, and times within a step.
pauses = st.one_of(st.sampled_from([0, 0, 500, 1000, 5000, 20_000]), st.integers(1, 9000))


@st.composite
def tracks(draw, around):
    """Tracks that begin near a moment: jumps, halts, legs, turns, and being away."""
    time = around + draw(st.sampled_from([0, 0, -7000, -333, 500, 12_000]))
    x, y, heading, away = draw(st.integers(0, 900)), 400, draw(st.integers(0, 4095)), 0
    track = [(time, x, y, heading, away)]
    for _ in range(draw(st.integers(0, 5))):
        time += draw(pauses)
        x += draw(st.sampled_from([0, 0, 0, 1, -40, 7000]))
        y += draw(st.sampled_from([0, 0, 3, -2000]))
        heading = (heading + draw(st.sampled_from([0, 0, 0, 1, 2047, 2048, 3000]))) % 4096
        away = draw(st.sampled_from([0, 0, 1]))
        track.append((time, x, y, heading, away))
    return track


@st.composite
def postures_from(draw, around):
    """When another posture is taken, at or within steps, and which."""
    times = sorted(around + pause for pause in draw(st.lists(pauses, max_size=4)))
    codes = draw(st.lists(st.integers(0, 2), min_size=len(times) + 1, max_size=len(times) + 1))
    return times, codes


class Moving(RuleBasedStateMachine):
    """Bodies that get plans at ever later steps, or others at the same; looked at anywhere."""

    @initialize(bodies=st.integers(1, 3), data=st.data())
    def begin(self, bodies, data):
        self.now = self.known_from = 0
        self.timelines = Timelines(bodies, STEP_US)
        self.twins = [Twin() for _ in range(bodies)]
        for body in range(bodies):
            if data.draw(st.booleans()):
                self._follow(body, data)
            else:
                self._walk(body, data)

    def _follow(self, body, data):
        track = data.draw(tracks(self.now * STEP_US))
        times, codes = data.draw(postures_from(self.now * STEP_US))
        moments, postures = np.array(times, np.int64), np.array(codes, np.int8)
        self.timelines.follow(body, self.now, breakpoints(track), moments, postures)
        self.twins[body].follow(self.now, track, times, codes)

    def _walk(self, body, data):
        key, stride = (
            data.draw(st.integers(0, 2**64 - 1)),
            data.draw(st.sampled_from([700, 20_000])),
        )
        of, start = WalkRule(np.uint64(key), stride, 40_000, 500), (221, 333, 77)
        space = data.draw(st.sampled_from([ROOM, INSIDE]))
        self.timelines.walk(body, self.now, ROOM.mesh, space.mesh, of, start)
        self.twins[body].walk(self.now, ROOM, space, of, start)

    @rule(steps=st.integers(0, 9), at=st.integers(0, 2), data=st.data())
    def follow(self, steps, at, data):
        """Another plan, some steps later or at the same step."""
        self.now = min(self.now + steps, HORIZON - 2)
        self._follow(at % len(self.twins), data)

    @rule(steps=st.integers(0, 9), at=st.integers(0, 2), data=st.data())
    def walk(self, steps, at, data):
        self.now = min(self.now + steps, HORIZON - 2)
        self._walk(at % len(self.twins), data)

    @rule(back=st.integers(0, 5), at=st.integers(0, 2), data=st.data())
    def follow_from_an_earlier_step_on(self, back, at, data):
        """As a script may, that lets a body do something else than was planned."""
        now, self.now = self.now, max(self.known_from, self.now - back)
        self._follow(at % len(self.twins), data)
        self.now = now

    @rule(data=st.data())
    def look_at_a_window(self, data):
        first = data.draw(st.integers(self.known_from, HORIZON - 1))
        end = data.draw(st.integers(first, HORIZON))
        expected = [[twin.poses[s] for s in range(first, end)] for twin in self.twins]
        check_window(self.timelines.window(first, end), expected, first, end)
        body = data.draw(st.integers(0, len(self.twins) - 1))
        check_window(self.timelines.runs(body, first, end), [expected[body]], first, end)

    @rule(data=st.data())
    def look_at_a_step(self, data):
        step = data.draw(st.integers(self.known_from, HORIZON - 1))
        expected = [twin.poses[step][:4] for twin in self.twins]
        assert expected == [self.timelines.pose(b, step) for b in range(len(self.twins))]
        poses = self.timelines.poses(np.array([step, step])).tolist()
        assert poses == [[list(pose) for pose in expected]] * 2

    @rule(steps=st.integers(0, 20))
    def forget(self, steps):
        """All before a step, not beyond the present one; what is left is as before."""
        before = min(self.known_from + steps, self.now)
        self.timelines.forget(before)
        self.known_from = before

    @rule(how=st.sampled_from(["pickle", "deepcopy", "copy of a copy"]))
    def go_on_with_a_copy(self, how):
        if how == "pickle":
            self.timelines = pickle.loads(pickle.dumps(self.timelines))
        elif how == "deepcopy":
            self.timelines = copy.deepcopy(self.timelines)
        else:
            state = pickle.dumps(self.timelines)
            self.timelines = pickle.loads(pickle.dumps(pickle.loads(state)))

    @invariant()
    def the_present_pose_is_known(self):
        if hasattr(self, "twins"):
            for body, twin in enumerate(self.twins):
                assert twin.poses[self.now][:4] == self.timelines.pose(body, self.now)


TestMoving = Moving.TestCase
TestMoving.settings = quick


# --- Windows of given poses --------------------------------------------------------------------


@quick
@given(st.data(), st.integers(0, 3), st.integers(0, 12), st.integers(0, 10**9))
def test_a_window_of_given_poses_joins_equal_ones(data, bodies, steps, first):
    pose = st.tuples(*[st.integers(0, 1)] * 5)
    rows = st.lists(pose, min_size=steps, max_size=steps)
    poses = data.draw(st.lists(rows, min_size=bodies, max_size=bodies))
    columns = np.array(poses, np.int64).reshape(bodies, steps, 5).transpose(2, 0, 1)
    given_poses = (column.astype(t) for column, t in zip(columns, POSE_TYPES, strict=True))
    window = Window(first, *given_poses)

    for same in (window, copy.deepcopy(window), pickle.loads(pickle.dumps(window))):
        check_window(same, poses, first, first + steps)
    if bodies and steps:
        begin = data.draw(st.integers(0, steps - 1))
        end = data.draw(st.integers(begin, steps))
        assert poses[0][begin:end] == dense(window, 0, first + begin, first + end)


def resting(bodies=1):
    """Return bodies that rest at (5, 6)."""
    return following([breakpoints([(0, 5, 6, 7, 0)])] * bodies, STEP_US)


def test_resting_for_ten_years_is_one_run():
    window = resting(3).window(0, 10 * 365 * 86_400_000)
    assert [0, 1, 2, 3] == window.start.tolist()
    assert [5, 5, 5] == window.x.tolist()


def test_arrays_of_a_window_are_read_only_and_outlive_it():
    for name in ("start", "step", "x", "y", "heading", "away", "posture"):
        array = getattr(resting(500).window(3, 9), name)
        before = array.tolist()
        gc.collect()
        assert before == array.tolist()
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1


def walking(mesh=ROOM.mesh, space=INSIDE.mesh):
    """Return somebody who walks."""
    timelines = Timelines(1, STEP_US)
    timelines.walk(0, 0, mesh, space, RULE, (221, 333, 77))
    return timelines


def test_threads_may_ask_for_the_same_walk_at_once():
    """It is drawn on as it is asked for: two threads that did that at once crashed."""

    def ask(timelines):
        return [len(timelines.window(s, s + 3000).step) for s in range(0, 60_000, 977)]

    expected = ask(walking())
    for _ in range(10):
        with ThreadPoolExecutor(4) as pool:
            assert [expected] * 4 == list(pool.map(ask, [walking()] * 4))


def test_timelines_keep_the_meshes_of_walks_alive():
    mesh = home_of([shapely.box(0, 0, 1280, 960)]).mesh
    timelines = walking(mesh, mesh)
    expected = timelines.pose(0, 40)
    again = copy.deepcopy(timelines)
    del mesh, timelines
    gc.collect()
    assert expected == again.pose(0, 40)
    assert 200 == len(dense(again.window(0, 200), 0, 0, 200))


def test_meshes_are_freed_with_their_walks():
    """Doors that open and shut make many of them in a month."""
    timelines = resting(2)
    meshes = [home_of([shapely.box(0, 0, 1280, 900 + 2 * i)]).mesh for i in range(4)]

    def reference_counts():
        return [sys.getrefcount(mesh) for mesh in meshes]

    free = reference_counts()
    timelines.walk(0, 0, meshes[0], meshes[1], RULE, (221, 333, 77))
    timelines.walk(1, 5, meshes[0], meshes[0], RULE, (221, 333, 77))
    timelines.walk(0, 10, meshes[2], meshes[3], RULE, (221, 333, 77))
    timelines.pose(0, 30)
    for before, used in ((9, [1, 1, 1, 1]), (10, [1, 0, 1, 1]), (50, [1, 0, 1, 1])):
        timelines.forget(before)
        assert used == [now - then for now, then in zip(reference_counts(), free, strict=True)]
    expected = timelines.window(50, 90)
    again = pickle.loads(pickle.dumps(timelines)).window(50, 90)
    assert runs_of(expected, 0) == runs_of(again, 0)
    del timelines
    assert free == reference_counts()


def test_copies_are_independent():
    timelines = resting()
    twin = copy.deepcopy(timelines)
    track = breakpoints([(0, 50, 60, 70, 1)])
    twin.follow(0, 4, track, *STANDING)
    assert [(5, 6, 7, 0), (50, 60, 70, 1)] == [timelines.pose(0, 4), twin.pose(0, 4)]


def test_a_body_without_a_motion_yet_is_nowhere():
    timelines = Timelines(2, STEP_US)
    for ask in (lambda: timelines.pose(1, 0), lambda: timelines.window(0, 3)):
        with pytest.raises(ValueError, match="no motion yet"):
            ask()


@pytest.mark.parametrize("walks", [False, True])
def test_forgotten_steps_are_refused(walks):
    timelines, track = walking() if walks else resting(), breakpoints([(0, 5, 6, 7, 0)])
    timelines.pose(0, 30)
    for step in (20,) if walks else (4, 20):
        timelines.follow(0, step, track, *STANDING)
    timelines.forget(12)
    assert timelines.pose(0, 12)
    for step in (0, 11 if walks else 3):
        for ask in (timelines.pose, lambda _, step: timelines.window(step, 15)):
            with pytest.raises(ValueError, match="forgotten"):
                ask(0, step)


@pytest.mark.parametrize(
    ("part", "value"),
    [
        (0, 8),
        (1, 6),
        (2, [0, 2, 3]),
        (2, [0, 3, 2]),
        (2, [0, 9, 4]),
        (2, [1, 2, 4]),
        (2, [0, 0, 4]),
        (2, []),
        (3, [7, 8, 7, 11]),
        (3, [7, 7, 7, 8]),
        (3, [8, 9, 7, 8]),
        (4, [0, 1, 2]),
    ],
)
def test_states_that_no_window_has_are_refused(part, value):
    state = [7, 11, [0, 2, 4], [7, 8, 7, 8], *[[0, 1, 2, 3]] * 5]

    def read():
        types = [np.int64, np.int64, *POSE_TYPES]
        arrays = (np.array(each, of) for each, of in zip(state[2:], types, strict=True))
        window = Window.__new__(Window)
        window.__setstate__((*state[:2], *arrays))
        return window

    assert [(7, (2, 2, 2, 2, 2)), (8, (3, 3, 3, 3, 3))] == runs_of(read(), 1)
    state[part] = value
    with pytest.raises(ValueError, match="no state of a window"):
        read()
