"""What a camera sees, against a twin that looks at every wall and at sixty digits of a cosine."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from shapely.geometry import Polygon
from tests.homes import JIT_IS_OFF, Home, home_of
from tests.reference import look as slow
from tests.reference.random import key_of_word
from tests.strategies import homes, quick, seeds

from fleet2d.kernels.look import (
    USER_LOST,
    USER_SEEN,
    Crowd,
    Detections,
    Lens,
    Memory,
    SightEvents,
    in_wedge,
    look,
)
from fleet2d.kernels.motion import Poses
from fleet2d.sight.camera import Camera

Int64 = npt.NDArray[np.int64]

ANGLES = [1, 90, 180, 181, 359, 360]
EIGHTHS = [0, 512, 1024, 1536, 2048, 2560, 3072, 3584]
STEPS = 12


class Scene(NamedTuple):
    """A robot and users over a span: robot (steps, 4) x, y, heading, away; users (u, steps, 3)."""

    robot: Int64
    users: Int64
    keys: npt.NDArray[np.uint64]


class Seen(NamedTuple):
    """What came of a look: steps done, sightings, events, and the memory afterwards."""

    done: int
    sightings: list[tuple[int, ...]]
    events: list[tuple[int, ...]]
    noticed: list[int]
    seen: list[int]


def half_angle(degrees: float) -> int:
    """Return the half of a field of view as a lens has it."""
    return round(degrees / 360 * 4096)


def new_memory(scene: Scene) -> Memory:
    """Return a memory of nobody."""
    count = len(scene.users)
    return Memory(scene.keys, np.full(count, -1, np.int64), np.zeros(count, np.uint8))


def looked(
    home: Home,
    eye: slow.Eye,
    scene: Scene,
    first: int,
    stops: tuple[bool, bool] = (False, False),
    memory: Memory | None = None,
) -> Seen:
    """Return what the kernel sees."""
    memory = memory or new_memory(scene)
    lens = Lens(eye.near**2, eye.far**2, eye.half_angle, eye.chance, eye.patience)
    x, y, heading, away = (np.ascontiguousarray(column) for column in scene.robot.T)
    robot = Poses(x, y, heading, away.astype(np.uint8))
    user_x, user_y, user_away = (np.ascontiguousarray(scene.users[..., i]) for i in range(3))
    room = scene.users.shape[0] * len(x)
    sightings = Detections(*(np.full(room, -7, dtype) for dtype in _SIGHTINGS))
    events = SightEvents(*(np.full(room, -7, dtype) for dtype in _EVENTS))
    done, found, happened = look(
        home.mesh,
        lens,
        robot,
        Crowd(user_x, user_y, user_away.astype(np.uint8)),
        first,
        memory,
        stops,
        sightings,
        events,
    )
    return Seen(
        done,
        list(zip(*(array[:found].tolist() for array in sightings), strict=True)),
        list(zip(*(array[:happened].tolist() for array in events), strict=True)),
        memory.noticed.tolist(),
        memory.seen.tolist(),
    )


_SIGHTINGS = (np.int64, np.int32, np.int64, np.int64)
_EVENTS = (np.int64, np.int32, np.int32)


def looked_slowly(
    home: Home, eye: slow.Eye, scene: Scene, first: int, stops: tuple[bool, bool] = (False, False)
) -> Seen:
    """Return what the twin sees."""
    known = [slow.Known(int(key), -1, False) for key in scene.keys]
    done, sightings, events = slow.look(
        home.walls,
        eye,
        [(slow.Body(x, y, bool(away)), heading) for x, y, heading, away in scene.robot.tolist()],
        [[slow.Body(x, y, bool(away)) for x, y, away in user] for user in scene.users.tolist()],
        first,
        known,
        stops,
    )
    return Seen(done, sightings, events, [k.noticed for k in known], [int(k.seen) for k in known])


def scene_in(home: Home, rng: np.random.Generator, count: int, steps: int = STEPS) -> Scene:
    """Return a scene where much goes on: bodies at one point, on borders, on walls, away."""
    size = [64 * home.columns, 64 * home.rows]
    cells = home.cells if len(home.cells) else rng.integers(0, size, (5, 2))
    robot = np.empty((steps, 4), np.int64)
    robot[:, :2] = rng.choice(cells, steps)
    robot[:, 2] = np.where(
        rng.random(steps) < 0.5, rng.choice(EIGHTHS, steps), rng.integers(0, 4096, steps)
    )
    robot[:, 3] = rng.random(steps) < 0.1
    users = np.zeros((count, steps, 3), np.int64)
    users[..., :2] = rng.choice(cells, (count, steps))
    for user in users:
        kind = rng.integers(0, 8, steps)
        offset = rng.integers(1, 400, (steps, 1)) * rng.integers(-1, 2, (steps, 2))
        user[kind == 0, :2] = robot[kind == 0, :2]
        near = (kind == 1) | (kind == 2) | (kind == 3)
        user[near, :2] = (robot[:, :2] + offset)[near]
        user[kind == 4, :2] = rng.integers(0, size, (steps, 2))[kind == 4]
        user[kind == 5, :2] = rng.choice(home.walls, steps)[kind == 5, :2]
        user[:, 2] = rng.random(steps) < 0.1
    return Scene(robot, users, rng.integers(0, 2**64, count, np.uint64))


@st.composite
def eyes(draw: st.DrawFn) -> slow.Eye:
    """Cameras of all kinds."""
    near = draw(st.sampled_from([0, 0, 1, 100]))
    return slow.Eye(
        near=near,
        far=near + draw(st.sampled_from([0, 150, 400, 5000])),
        half_angle=half_angle(draw(st.one_of(st.sampled_from(ANGLES), st.floats(0.1, 360)))),
        chance=round(draw(st.sampled_from([0.0, 0.5, 1.0, 1.0])) * 2**53),
        patience=draw(st.sampled_from([1, 2, 5])),
    )


stoppings = st.tuples(st.booleans(), st.booleans())


@quick
@given(homes(), eyes(), seeds(), st.integers(0, 3), st.integers(0, 10**9), stoppings)
def test_look_is_that_of_the_twin(
    polygons: list[Polygon],
    eye: slow.Eye,
    seed: int,
    count: int,
    first: int,
    stops: tuple[bool, bool],
) -> None:
    home = home_of(polygons)
    scene = scene_in(home, np.random.default_rng(seed), count)

    assert looked_slowly(home, eye, scene, first, stops) == looked(home, eye, scene, first, stops)


@pytest.mark.parametrize("degrees", ANGLES)
@pytest.mark.parametrize("detection", [0.0, 0.5, 1.0])
def test_look_in_one_room_is_that_of_the_twin(degrees: int, detection: float) -> None:
    home = home_of([shapely.box(0, 0, 1280, 960).difference(shapely.box(500, 300, 640, 700))])
    eye = slow.Eye(0, 700, half_angle(degrees), round(detection * 2**53), 2)
    scene = scene_in(home, np.random.default_rng(degrees), 4, 20 if JIT_IS_OFF else 150)

    expected = looked_slowly(home, eye, scene, 1000)

    assert expected == looked(home, eye, scene, 1000)
    assert (detection > 0) == bool(expected.sightings)


@quick
@given(homes(), eyes(), seeds(), st.integers(1, STEPS - 1))
def test_look_at_two_spans_is_that_at_one(
    polygons: list[Polygon], eye: slow.Eye, seed: int, cut: int
) -> None:
    home = home_of(polygons)
    scene = scene_in(home, np.random.default_rng(seed), 3)
    whole = looked(home, eye, scene, 50)

    memory = new_memory(scene)
    before = Scene(scene.robot[:cut], scene.users[:, :cut], scene.keys)
    after = Scene(scene.robot[cut:], scene.users[:, cut:], scene.keys)
    first = looked(home, eye, before, 50, memory=memory)
    second = looked(home, eye, after, 50 + cut, memory=memory)

    assert whole == Seen(
        first.done + second.done,
        first.sightings + second.sightings,
        first.events + second.events,
        second.noticed,
        second.seen,
    )


@quick
@given(homes(), eyes(), seeds(), stoppings)
def test_look_that_goes_on_after_each_stop_sees_what_one_that_never_stops_does(
    polygons: list[Polygon], eye: slow.Eye, seed: int, stops: tuple[bool, bool]
) -> None:
    home = home_of(polygons)
    scene = scene_in(home, np.random.default_rng(seed), 3)
    whole = looked(home, eye, scene, 0)

    memory, at, sightings, events = new_memory(scene), 0, [], []
    while at < STEPS:
        rest = Scene(scene.robot[at:], scene.users[:, at:], scene.keys)
        seen = looked(home, eye, rest, at, stops, memory)
        stopping = [step for step, _, kind in seen.events if stops[kind]]
        at += seen.done
        assert [at - 1] * len(stopping) == stopping
        assert stopping or at == STEPS
        sightings += seen.sightings
        events += seen.events

    assert (whole.sightings, whole.events) == (sightings, events)
    assert (whole.noticed, whole.seen) == (memory.noticed.tolist(), memory.seen.tolist())


def test_look_at_another_user_leaves_the_draws_of_the_first_alone() -> None:
    """Known failure 9: adding a user changed the robot's random numbers."""
    home = home_of([shapely.box(0, 0, 1280, 960)])
    eye = slow.Eye(0, 700, half_angle(180), 2**52, 2)
    both = scene_in(home, np.random.default_rng(4), 2, 60)
    second = Scene(both.robot, both.users[1:], both.keys[1:])

    of_both = [(s, x, y) for s, user, x, y in looked(home, eye, both, 0).sightings if user == 1]

    assert len(of_both) > 3
    assert of_both == [(s, x, y) for s, _, x, y in looked(home, eye, second, 0).sightings]


def line_of(users: list[tuple[int, int]], steps: int = 1, heading: int = 0) -> Scene:
    """Return a robot at (501, 501) that looks at users who stand still."""
    robot = np.tile([501, 501, heading, 0], (steps, 1))
    still = [[[501 + dx, 501 + dy, 0]] * steps for dx, dy in users]
    return Scene(robot, np.array(still, np.int64), np.arange(len(users), dtype=np.uint64))


ROOM = home_of([shapely.box(0, 0, 1280, 1280)])
SURE = 2**53


@pytest.mark.parametrize(
    ("near", "far", "distance", "expected"),
    [
        (0, 100, 0, True),
        (1, 100, 0, False),
        (50, 100, 49, False),
        (50, 100, 50, True),
        (50, 100, 100, True),
        (50, 100, 101, False),
    ],
)
def test_look_sees_between_its_ranges_ends_included(
    near: int, far: int, distance: int, expected: bool
) -> None:
    seen = looked(ROOM, slow.Eye(near, far, 300, SURE, 1), line_of([(distance, 0)]), 0)

    assert expected == bool(seen.sightings)


@pytest.mark.parametrize(
    ("degrees", "heading", "offset", "expected"),
    [
        (90, 0, (60, 60), True),
        (90, 0, (60, 61), False),
        (90, 0, (60, -60), True),
        (90, 0, (60, -61), False),
        (90, 1024, (60, 60), True),
        (90, 1024, (61, 60), False),
        (90, 2560, (-60, 0), True),
        (90, 2560, (0, -60), True),
        (90, 2560, (1, -60), False),
        (180, 0, (0, 60), True),
        (180, 0, (0, -60), True),
        (180, 0, (-1, 60), False),
        (180, 512, (60, -60), True),
        (180, 512, (60, -61), False),
        (181, 0, (-1, 200), True),
        (181, 0, (-2, 200), False),
        (181, 0, (-1, -200), True),
        (270, 0, (-60, 60), True),
        (270, 0, (-61, 60), False),
        (270, 0, (-60, -60), True),
        (359, 0, (-60, 0), False),
        (359, 0, (-60, 1), True),
        (359, 0, (-300, 1), False),
        (360, 0, (-60, 0), True),
        (1, 0, (300, 2), True),
        (1, 0, (300, 3), False),
        (1, 0, (-300, 0), False),
        (1, 0, (0, 0), True),
    ],
)
def test_look_sees_within_its_angle_borders_included(
    degrees: int, heading: int, offset: tuple[int, int], expected: bool
) -> None:
    eye = slow.Eye(0, 600, half_angle(degrees), SURE, 1)
    scene = line_of([offset], heading=heading)

    assert expected == bool(looked(ROOM, eye, scene, 0).sightings)
    assert expected == slow.in_wedge(heading, eye.half_angle, *offset)


@pytest.mark.parametrize("half", [1, 11, 1024, 2047, 2048, 2049, 3072, 4085, 4095, 4096])
def test_in_wedge_of_every_direction_is_that_of_cosines(half: int) -> None:
    rng = np.random.default_rng(half)
    for heading in [0, 512, 2048, 4095, *rng.integers(0, 4096, 2 if JIT_IS_OFF else 12).tolist()]:
        ahead, right, left = 2 * heading, 2 * heading - half, 2 * heading + half
        for part in (ahead, right - 3, right + 3, left - 3, left + 3, ahead + 4096):
            dx, dy = (round(5760 * float(f(part))) for f in (slow.cosine, _sine))

            assert slow.in_wedge(heading, half, dx, dy) == in_wedge(heading, half, dx, dy)


def _sine(part: int) -> object:
    return slow.cosine(part - 2048)


def test_look_of_the_narrowest_camera_does_not_see_behind() -> None:
    """Rounded to a half angle of 0, its wedge was a line through the robot."""
    lens = Camera(angle_deg=0.01).lens(1280, 1_000_000)

    assert in_wedge(0, lens.half_angle, 300, 0)
    assert not in_wedge(0, lens.half_angle, -300, 0)


@pytest.mark.parametrize("half", [1, 300, 2047])
def test_in_wedge_never_takes_what_is_right_behind(half: int) -> None:
    for heading in range(0, 4096, 64):
        behind = [round(-1000 * float(f(2 * heading))) for f in (slow.cosine, _sine)]

        assert not in_wedge(heading, half, *behind)


def test_look_counts_a_user_as_lost_after_its_patience() -> None:
    """Seen in steps 0 and 1, then away: lost in the first step that is `patience` after step 1."""
    scene = line_of([(50, 0)], steps=9)
    scene.users[0, 2:, 2] = 1

    seen = looked(ROOM, slow.Eye(0, 100, 300, SURE, 4), scene, 100)

    assert [(100, 0, 551, 501), (101, 0, 551, 501)] == seen.sightings
    assert [(100, 0, USER_SEEN), (105, 0, USER_LOST)] == seen.events


def test_look_keeps_a_user_who_is_back_before_its_patience_ends() -> None:
    scene = line_of([(50, 0)], steps=9)
    scene.users[0, 2:5, 2] = 1

    seen = looked(ROOM, slow.Eye(0, 100, 300, SURE, 4), scene, 100)

    assert [(100, 0, USER_SEEN)] == seen.events


@pytest.mark.parametrize(
    ("word", "chance", "expected"),
    [(0, 0, False), (0, 1, True), (2**64 - 1, SURE - 1, False), (2**64 - 1, SURE, True)],
)
def test_look_notices_never_at_chance_0_and_always_at_chance_1(
    word: int, chance: int, expected: bool
) -> None:
    """Even where the random bits are all zeros or all ones."""
    scene = line_of([(50, 0)])._replace(keys=np.array([key_of_word(word)], np.uint64))

    assert expected == bool(looked(ROOM, slow.Eye(0, 100, 300, chance, 1), scene, 0).sightings)


def test_look_of_a_robot_that_is_away_sees_nobody() -> None:
    scene = line_of([(50, 0), (0, 0)], steps=3)
    scene.robot[:, 3] = 1

    assert [] == looked(ROOM, slow.Eye(0, 100, 4096, SURE, 1), scene, 0).sightings


def test_look_in_the_step_of_a_stop_still_sees_the_other_users() -> None:
    scene = line_of([(50, 0), (60, 0)], steps=5)

    seen = looked(ROOM, slow.Eye(0, 100, 300, SURE, 4), scene, 7, (False, True))

    assert seen.done == 1
    assert [(7, 0, USER_SEEN), (7, 1, USER_SEEN)] == seen.events
    assert len(seen.sightings) == 2


def test_look_without_users_does_all_steps() -> None:
    empty = Scene(line_of([(0, 0)], 6).robot, np.empty((0, 6, 3), np.int64), np.empty(0, np.uint64))

    seen = looked(ROOM, slow.Eye(0, 100, 300, SURE, 4), empty, 0, (True, True))

    assert Seen(6, [], [], [], []) == seen
