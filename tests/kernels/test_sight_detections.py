"""What a camera sees, against a twin that looks at every wall and at sixty digits of a cosine."""

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from tests.meshed_homes import home_of
from tests.reference import detections as slow
from tests.reference.random import key_of_word
from tests.strategies import homes, quick, seeds

from fleet2d._core import in_wedge
from fleet2d.algorithms.observations import SightingTable
from fleet2d.engine.cameras import newest_of
from fleet2d.floorplan.lattice import Lattice
from fleet2d.kernels import (
    I64,
    MAX_GHOSTS,
    U64,
    About,
    DetectionRule,
    Heights,
    UserDraw,
    Window,
    detect,
    new_memory,
)
from fleet2d.sight.camera import Camera, Lens, TableContext, error_tables, stack_lenses
from fleet2d.sight.perception import Perception

ANGLES = [1, 90, 180, 181, 359, 360]
EIGHTHS = [0, 512, 1024, 1536, 2048, 2560, 3072, 3584]
STEPS = 24
RADIUS = 100  # of users, lattice units
STEP_US = 1_000_000
START_US = 86_340_000_000
"""A minute before midnight."""
FIRST = 40
"""A step 20 s before it."""
SURE = 2**53
ROOM = home_of([shapely.box(0, 0, 1280, 1280)])


@dataclass(frozen=True)
class Scene:
    """A robot and users over a span, and what its cameras make of them.

    Attributes:
        robot: int64 (steps, 4), x, y, heading and away of the robot.
        users: int64 (users, steps, 5), x, y, away, heading and posture of each user.
        keys: uint64 (users,), what their streams come from.
        strangers: How many bodies stand before and behind the others in the window, and between
            users and robot, whom no camera of this robot looks for.
        is_first: Whether the robot comes before the users in the window.
        perceptions: How each camera errs; None for one that doesn't. Empty for none of them.
        shown: uint64 (cameras, users, steps), what another method says; None: lines of sight do.
        thickness: Of the bodies, which hide each other, the first one's radius, that of each more is
            7 units larger [lattice units]; 0: nobody hides anybody.
        heights: Seed of the heights and the furniture; 0: height doesn't matter.
    """

    robot: I64
    users: I64
    keys: U64
    strangers: int = 0
    is_first: bool = True
    perceptions: Any = ()
    shown: U64 | None = None
    thickness: int = 0
    heights: int = 0

    def part(self, begin, end):
        """Return some steps of it."""
        shown = None if self.shown is None else self.shown[..., begin:end]
        robot, users = self.robot[begin:end], self.users[:, begin:end]
        return replace(self, robot=robot, users=users, shown=shown)

    def window(self, first):
        """Return how all bodies move, the number of the robot, and that of the first user."""
        robot = np.insert(self.robot[None][..., [0, 1, 3, 2]], 4, 0, axis=2)
        stranger = np.repeat(robot, self.strangers, axis=0)  # at the robot: in view if anybody is
        stranger[..., 2] = 0
        parts = [robot, stranger, self.users] if self.is_first else [self.users, stranger, robot]
        x, y, away, heading, posture = np.concatenate([stranger, *parts, stranger]).transpose(
            2, 0, 1
        )
        window = Window(first, x, y, heading, away.astype(np.uint8), posture.astype(np.int8))
        one, other = self.strangers, len(self.users)
        return (window, one, 2 * one + 1) if self.is_first else (window, 2 * one + other, one)

    @property
    def radii(self):
        """The radii of all bodies of the window, None if they don't hide each other."""
        count = len(self.users) + 1 + 3 * self.strangers
        return self.thickness + 7 * np.arange(count) if self.thickness else None

    def heights_for(self, cameras):
        """Return the heights of cameras, bodies and furniture, for the kernel and for the twin."""
        if not self.heights:
            return None, None
        rng, users = np.random.default_rng(self.heights), len(self.users)
        count, points = users + 1 + 3 * self.strangers, max(eye.points for eye in cameras) + 1
        low = np.array([0, 300, 500, 800, 1700])  # several are equal, so that lines graze
        pieces = [_piece(rng) for _ in range(rng.integers(0, 6))]
        corners = [corner for piece in pieces for corner in piece.corners]
        boxes = [[*np.min(p.corners, axis=0), *np.max(p.corners, axis=0)] for p in pieces]
        levels = Heights(
            eyes=rng.choice(low, (len(cameras), 3)),
            points=rng.choice(low, (len(cameras), users, 3, points)),
            tops=rng.choice(low, (count, 3)),
            corners=np.array(corners, np.int64).reshape(-1, 2),
            start=np.cumsum([0, *(len(piece.corners) for piece in pieces)]),
            boxes=np.array(boxes, np.int64).reshape(-1, 4),
            top=np.array([piece.top for piece in pieces], np.int64),
        )
        return levels, slow.Heights(levels.eyes.tolist(), levels.points.tolist(), pieces)

    def watched(self, walls, cameras):
        """Return what the twin looks at."""
        levels, heights = self.heights_for(cameras)
        robot = [
            slow.Body(x, y, bool(away), heading) for x, y, heading, away in self.robot.tolist()
        ]
        users = [
            [slow.Body(x, y, bool(away), heading, posture) for x, y, away, heading, posture in user]
            for user in self.users.tolist()
        ]
        here = [slow.Body(x, y, False) for x, y, *_ in robot]
        _, robots_number, first_user = self.window(0)
        obstacles = {}
        for number, radius in enumerate([] if self.radii is None else self.radii.tolist()):
            tops = None if levels is None else levels.tops[number].tolist()
            user = number - first_user
            if 0 <= user < len(users):
                obstacles[user] = slow.Obstacle(users[user], radius, tops)
            elif number != robots_number:
                obstacles[-1 - number] = slow.Obstacle(here, radius, tops)
        method = None if self.shown is None else lambda c, u, j: int(self.shown[c, u, j])
        keys = self.keys.tolist()
        return slow.Watched(walls, robot, users, RADIUS, keys, STEP_US, method, obstacles, heights)


def _piece(rng):
    """Return a piece of furniture: a box on cells' borders, an L, or a triangle."""
    x, y, w, h = (64 * rng.integers(0, 12, 4) + [0, 0, 32, 32]).tolist()
    shapes = [
        [(x, y), (x + w, y), (x + w, y + h), (x, y + h)],
        [(x, y), (x + w, y), (x + w, y + h // 2), (x + 8, y + h // 2), (x + 8, y + h), (x, y + h)],
        [(x, y), (x + w, y + 7), (x + 3, y + h)],
    ]
    return slow.Piece(shapes[rng.integers(0, 3)], int(rng.choice([300, 500, 800])))


class Seen(NamedTuple):
    """What came of a look: steps done, sightings, events, counts, and the memory afterwards."""

    done: int
    sightings: list[tuple[int, ...]]
    events: list[tuple[int, ...]]
    counts: list[list[list[int]]]
    noticed: list[int]
    seen: list[int]


def half_angle(degrees):
    """Return the half of a field of view as a lens has it."""
    return round(degrees / 360 * 4096)


def tables_of(cameras, scene):
    """Return lenses as the kernel has them, and how they err, with a stream for each draw."""
    perceptions = list(scene.perceptions) or [None] * len(cameras)
    lenses, count = [Lens(**eye._asdict()) for eye in cameras], len(scene.users)
    lattice = Lattice(cell=0.05, origin=(0.0, 0.0), columns=20, rows=20)
    names = [f"u{i}" for i in range(count)]
    context = TableContext(names, [RADIUS] * count, lattice, STEP_US, "r")
    errors = error_tables(lenses, perceptions, context)
    for c in range(len(cameras)):
        for draw in UserDraw:
            errors.keys[c, :, draw] = scene.keys + np.uint64(c + 100 * (draw - UserDraw.DETECT))
        errors.ghost_keys[c] = scene.keys.sum() + np.arange(5, dtype=np.uint64) * np.uint64(7 + c)
    errs = [perception is not None for perception in perceptions]
    return stack_lenses(lenses, errs, context), errors


def nothing_known(cameras, scene):
    """Return what a robot carries that has seen nobody, for the kernel and for the twin."""
    count = len(scene.users)
    _, errors = tables_of(cameras, scene)
    bursts = count + MAX_GHOSTS * errors.has_ghosts
    looks = np.array([eye.latency // eye.period + 2 for eye in cameras])
    errs = [
        None if perception is None else slow.Errors(errors, c, START_US)
        for c, perception in enumerate(scene.perceptions or [None] * len(cameras))
    ]
    carried = slow.Carried([-1] * (count + 1), [False] * (count + 1), errs)
    return new_memory(len(cameras), count, int((looks * bursts).max())), carried


def looked(home, cameras, scene, first, stops=(False, False), memory=None):
    """Return what the kernel sees."""
    memory = memory or nothing_known(cameras, scene)[0]
    lenses, errors = tables_of(cameras, scene)
    burst = int((len(scene.users) + MAX_GHOSTS * errors.has_ghosts).sum())
    patience = max(eye.patience for eye in cameras)
    rule = DetectionRule(patience, STEP_US, START_US, burst, *stops)
    before = memory.about.copy()
    heights, _ = scene.heights_for(cameras)
    done, step, index, distinct, newest, events = detect(
        home.mesh, lenses, errors, rule, *scene.window(first), memory, scene.shown, scene.radii, heights
    )  # fmt: skip
    rows = SightingTable(step, index, distinct.T).rows()
    assert newest_of(rows, len(newest)) == [
        int(np.flatnonzero(index == number)[-1]) if number >= 0 else -1 for number in newest
    ]
    sightings = [tuple(row) for row in rows.tolist()]
    counts = (memory.about - before)[..., [About.IN_VIEW, About.NOTICED]].tolist()
    return Seen(done, sightings, events, counts, memory.noticed.tolist(), memory.seen.tolist())


def assert_same(home, cameras, scene, first, stops=(False, False), cuts=()):
    """Compare what the kernel and its twin see, look by look; return all sightings.

    A look ends at a cut, and where the look before stopped the next one goes on.
    """
    (memory, carried), at, sightings = nothing_known(cameras, scene), 0, []
    while at < len(scene.robot):
        end = min((cut for cut in cuts if cut > at), default=len(scene.robot))
        part = scene.part(at, end)
        watched = part.watched(home.walls, cameras)
        result = slow.detect(watched, cameras, first + at, carried, stops)
        expected = Seen(*result, carried.noticed, [int(seen) for seen in carried.seen])
        assert expected == looked(home, cameras, part, first + at, stops, memory)
        at += expected.done
        sightings += expected.sightings
    return sightings


def rested(rng, poses, moves):
    """Return poses (steps, …) of which each lasts: another one comes with a probability."""
    steps = np.arange(len(poses))
    return poses[np.maximum.accumulate(np.where(rng.random(len(poses)) < moves, steps, 0))]


def scene_in(home, rng, count, steps, moves):
    """Return a scene where much goes on: bodies at one point, on borders, on walls, away.

    Bodies take another pose with the probability `moves`, each for itself.
    """
    size = [64 * home.columns, 64 * home.rows]
    cells = home.cells if len(home.cells) else rng.integers(0, size, (5, 2))
    robot = np.empty((steps, 4), np.int64)
    robot[:, :2] = rng.choice(cells, steps)
    robot[:, 2] = np.where(
        rng.random(steps) < 0.5, rng.choice(EIGHTHS, steps), rng.integers(0, 4096, steps)
    )
    robot[:, 3] = rng.random(steps) < 0.1
    robot = rested(rng, robot, moves)
    users = np.zeros((count, steps, 5), np.int64)
    users[..., :2] = rng.choice(cells, (count, steps))
    users[..., 3] = rng.integers(0, 4096, (count, steps))
    users[..., 4] = rng.integers(0, 3, (count, steps))
    for u, user in enumerate(users):
        kind = rng.integers(0, 8, steps)
        offset = rng.integers(1, 400, (steps, 1)) * rng.integers(-1, 2, (steps, 2))
        user[kind == 0, :2] = robot[kind == 0, :2]
        near = (kind == 1) | (kind == 2) | (kind == 3)
        user[near, :2] = (robot[:, :2] + offset)[near]
        user[kind == 4, :2] = rng.integers(0, size, (steps, 2))[kind == 4]
        user[kind == 5, :2] = rng.choice(home.walls, steps)[kind == 5, :2]
        user[:, 2] = rng.random(steps) < 0.1
        users[u] = rested(rng, user, moves)
    keys = rng.integers(0, 2**64, count, np.uint64)
    return Scene(robot, users, keys, int(rng.integers(0, 2)), bool(rng.integers(0, 2)))


HEADINGS = st.sampled_from([*EIGHTHS, 1, 300, 4000])


@st.composite
def odd_eyes(draw):
    """Cameras mounted anywhere, that pan, wait and lag, and look at whole bodies."""
    near = draw(st.sampled_from([0, 0, 1, 100]))
    return slow.Eye(
        near=near,
        far=near + draw(st.sampled_from([0, 150, 400, 5000])),
        half_angle=half_angle(draw(st.one_of(st.sampled_from(ANGLES), st.floats(0.1, 360)))),
        chance=draw(st.sampled_from([0, SURE // 2, SURE, SURE])),
        patience=draw(st.sampled_from([1, 2, 5])),
        forward=draw(st.sampled_from([0, 0, 60, -130])),
        left=draw(st.sampled_from([0, 0, 25, -300])),
        heading=draw(HEADINGS),
        pans=tuple(draw(st.lists(HEADINGS, max_size=3))),
        pan_us=draw(st.sampled_from([1_000_000, 2_500_000])),
        period=draw(st.sampled_from([1, 1, 2, 5])),
        latency=draw(st.sampled_from([0, 0, 1, 4])),
        points=draw(st.sampled_from([0, 0, 1, 4, 7])),
    )


CURVES = {
    "distance": [[0, 1], [0.3, 0.4]], "bearing": [[-90, 0.5], [90, 1]],
    "orientation": [[0, 1], [180, 0.6]], "posture": {"sit": 0.8, "lie": 0.3},
    "visible_share": [[0, 0], [1, 1]], "light": [[0, 0.3], [0.02, 1], [23, 1]],
}  # fmt: skip
NOISE = {
    "range_noise": 0.02, "range_noise_share": 0.1, "bearing_noise_deg": 5, "heading_noise_deg": 20,
    "posture": {"stand": {"sit": 0.3}, "sit": {"stand": 0.2, "lie": 0.2}},
}  # fmt: skip


@st.composite
def perceptions(draw, period, users):
    """Ways to err of a camera with a period [steps]: misses, mistakes, noise, false positives."""
    detection = dict(draw(st.sampled_from([{}, CURVES, {"distance": 0.6}])))
    detection["memory"] = draw(st.sampled_from(["0 s", "2 s", "10 s"]))
    identity = {"per_track": draw(st.booleans())}
    if draw(st.booleans()):
        identity |= {"right": [[0, 0.7], [0.5, 0.3]], "mistaken": 0.25}
    false = {}
    if draw(st.booleans()):
        most = 3600 / period  # one in each look
        places = st.tuples(*[st.integers(2, 14).map(lambda cells: cells * 0.05)] * 2)
        spots = [
            {"at": at, "per_hour": 0.2 * most, "spread": spread}
            for at, spread in draw(
                st.lists(st.tuples(places, st.sampled_from([0, 0.05])), max_size=2)
            )
        ]
        looks_like = {f"u{i}": 0.4 for i in range(min(users, 2))}
        false = {"per_hour": 0.5 * most, "spots": spots, "looks_like": looks_like}
    return Perception.model_validate(
        {
            "detection": detection,
            "identity": identity,
            "attributes": draw(st.sampled_from([{}, NOISE])),
            "false_positives": false,
        }
    )


@st.composite
def errors_of(draw, cameras, users):
    """Ways to err of several cameras, of which some don't."""
    return [draw(st.one_of(st.none(), perceptions(eye.period, users))) for eye in cameras]


@pytest.mark.parametrize(
    "features",
    [[], ["thick"], ["thick", "high"], ["errs"], ["errs", "thick", "shown"]],
    ids=lambda features: " ".join(features) or "plain",
)
@quick
@given(
    st.data(),
    homes(),
    st.lists(odd_eyes(), min_size=1, max_size=3),
    seeds(),
    st.integers(0, 3),
    st.tuples(st.booleans(), st.booleans()),
)
def test_looks_equal_the_reference(features, data, polygons, cameras, seed, count, stops):
    """Where neither body moves, one verdict holds for many steps: until a camera pans."""
    home, rng = home_of(polygons), np.random.default_rng(seed)
    moves = data.draw(st.sampled_from([0.05, 0.2, 0.5, 1.0]))
    scene = scene_in(home, rng, count, STEPS, moves)
    if "thick" in features:
        scene = replace(scene, thickness=data.draw(st.sampled_from([0, 1, 30, 100])))
    if "high" in features:
        scene = replace(scene, heights=seed + 1)
    if "errs" in features:
        scene = replace(scene, perceptions=data.draw(errors_of(cameras, count)))
    if "shown" in features:
        shown = np.zeros((len(cameras), count, STEPS), np.uint64)
        for c, u in np.ndindex(shown.shape[:2]):
            points = rng.integers(0, 2 ** (cameras[c].points + 1), STEPS, np.uint64)
            shown[c, u] = rested(rng, np.where(rng.random(STEPS) < 0.7, points, 0), moves)
        scene = replace(scene, shown=shown)
    cuts = data.draw(st.lists(st.integers(1, STEPS - 1), max_size=2))
    first = data.draw(st.sampled_from([FIRST, 7, 10**9]))

    assert_same(home, cameras, scene, first, stops, cuts)


@quick
@given(st.data(), homes(), st.lists(odd_eyes(), min_size=1, max_size=3), seeds())
def test_looks_of_cameras_that_err_are_the_same_in_two_spans_as_in_one(
    data, polygons, cameras, seed
):
    home, rng = home_of(polygons), np.random.default_rng(seed)
    scene = scene_in(home, rng, 3, STEPS, data.draw(st.sampled_from([1.0, 0.2])))
    errs, thickness = data.draw(errors_of(cameras, 3)), data.draw(st.sampled_from([0, 30]))
    scene = replace(scene, perceptions=errs, thickness=thickness)
    cut = data.draw(st.integers(1, STEPS - 1))

    whole = looked(home, cameras, scene, 50)
    memory, _ = nothing_known(cameras, scene)
    first = looked(home, cameras, scene.part(0, cut), 50, memory=memory)
    second = looked(home, cameras, scene.part(cut, STEPS), 50 + cut, memory=memory)

    assert whole.sightings == first.sightings + second.sightings
    assert whole.events == first.events + second.events
    assert (whole.noticed, whole.seen) == (second.noticed, second.seen)


@pytest.mark.parametrize("heights", [0, 7])
def test_looks_past_bodies_and_furniture_in_one_room_equal_the_reference(heights):
    """Where they hide people often, and parts of them."""
    cameras = [
        slow.Eye(0, 900, 4096, SURE, 2, points=7),
        slow.Eye(0, 900, 300, SURE, 2, forward=40),
    ]
    scene = scene_in(ROOM, np.random.default_rng(8), 5, 60, 0.3)
    hidden = replace(scene, thickness=60, heights=heights)

    sightings = assert_same(ROOM, cameras, hidden, FIRST)
    assert 100 < len(sightings) < len(looked(ROOM, cameras, scene, FIRST).sightings)


def test_looks_that_notice_half_of_those_in_view_equal_the_reference():
    """Somebody who isn't noticed is lost in the first step after the patience, not one later."""
    home = home_of([shapely.box(0, 0, 1280, 960) - shapely.box(500, 300, 640, 700)])
    scene = scene_in(home, np.random.default_rng(180), 4, 150, 1.0)

    assert assert_same(home, [slow.Eye(0, 700, half_angle(180), SURE // 2, 2)], scene, 1000)


@pytest.mark.parametrize(("per_track", "memory", "patience"), [(True, "0 s", 2), (False, "4 s", 5)])
def test_looks_in_one_room_of_cameras_that_err_equal_the_reference(per_track, memory, patience):
    """Where users are in view most of the time, so that every way to err happens often."""
    cameras = [
        slow.Eye(0, 900, half_angle(200), SURE, patience, pans=(0, 1024, 3072), pan_us=2_500_000),
        slow.Eye(0, 700, 4096, SURE, patience, forward=40, period=2, latency=3, points=6),
    ]
    identity = {"right": [[0, 0.6], [0.5, 0.4]], "mistaken": 0.3, "per_track": per_track}
    spot = {"at": [0.2, 0.3], "per_hour": 700, "spread": 0.03}
    errs = Perception.model_validate(
        {
            "detection": {**CURVES, "memory": memory},
            "identity": identity,
            "attributes": NOISE,
            "false_positives": {"per_hour": 1000, "spots": [spot], "looks_like": {"u0": 0.5}},
        }
    )
    scene = scene_in(ROOM, np.random.default_rng(per_track), 3, 150, 0.1)
    scene = replace(scene, perceptions=[errs, errs])

    users = [row[2:4] for row in assert_same(ROOM, cameras, scene, FIRST)]
    assert min(users.count((u, u)) for u in range(3)) > 5
    assert len([1 for u, who in users if u >= 0 > who]) > 5
    assert len([1 for u, who in users if u >= 0 and who not in (u, -1)]) > 5
    assert min(users.count((-1, who)) for who in (-1, 0)) > 5


def test_a_look_at_another_user_leaves_the_draws_of_the_first_alone():
    """Known failure 9: adding a user changed the robot's random numbers."""
    cameras = [slow.Eye(0, 700, half_angle(180), 2**52, 2)]
    both = scene_in(ROOM, np.random.default_rng(4), 2, 60, 1.0)
    second = replace(both, users=both.users[1:], keys=both.keys[1:])

    of_both = [row for row in looked(ROOM, cameras, both, 0).sightings if row[2] == 1]
    alone = looked(ROOM, cameras, second, 0).sightings

    assert len(alone) > 3
    assert [(row[0], *row[4:]) for row in of_both] == [(row[0], *row[4:]) for row in alone]


def line_of(users, steps=1, heading=0):
    """Return a robot at (501, 501) that looks at users who stand still."""
    robot = np.tile([501, 501, heading, 0], (steps, 1))
    still = [[[501 + dx, 501 + dy, 0, 0, 0]] * steps for dx, dy in users]
    return Scene(robot, np.array(still, np.int64), np.arange(len(users), dtype=np.uint64))


def sees(eye, scene, home=ROOM):
    """Return whether the first look sees somebody."""
    return bool(looked(home, [eye], scene, 0).sightings)


def test_a_look_returns_any_number_of_sightings():
    scene = line_of([(50 + i, 0) for i in range(20)], steps=5000)

    sightings = looked(ROOM, [slow.Eye(0, 100, 300, SURE, 4)], scene, 0).sightings

    expected = [(step, 0, u) for step in range(5000) for u in range(20)]
    assert expected == [row[:3] for row in sightings]


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
def test_a_look_sees_between_its_ranges_ends_included(near, far, distance, expected):
    assert expected == sees(slow.Eye(near, far, 300, SURE, 1), line_of([(distance, 0)]))


@pytest.mark.parametrize(
    ("degrees", "heading", "offset", "expected"),
    [
        (90, 0, (60, -60), True),
        (90, 0, (60, 61), False),
        (90, 2560, (0, -60), True),
        (180, 0, (0, 60), True),
        (180, 512, (60, -61), False),
        (181, 0, (-1, 200), True),
        (359, 0, (-60, 0), False),
        (360, 0, (-60, 0), True),
        (1, 0, (0, 0), True),
    ],
)
def test_a_look_sees_within_its_angle_borders_included(degrees, heading, offset, expected):
    eye = slow.Eye(0, 600, half_angle(degrees), SURE, 1)

    assert expected == sees(eye, line_of([offset], heading=heading))
    assert expected == slow.in_wedge(heading, eye.half_angle, *offset)


@pytest.mark.parametrize("half", [1, 11, 1024, 2047, 2048, 2049, 3072, 4085, 4095, 4096])
def test_in_wedge_of_every_direction_equals_cosines(half):
    rng = np.random.default_rng(half)
    for heading in [0, 512, 2048, 4095, *rng.integers(0, 4096, 12).tolist()]:
        ahead, right, left = 2 * heading, 2 * heading - half, 2 * heading + half
        for part in (ahead, right - 3, right + 3, left - 3, left + 3, ahead + 4096):
            dx, dy = (round(5760 * float(slow.cosine(angle))) for angle in (part, part - 2048))

            assert slow.in_wedge(heading, half, dx, dy) == in_wedge(heading, half, dx, dy)


def test_the_narrowest_camera_does_not_see_behind():
    """Rounded to a half angle of 0, its wedge was a line through the robot."""
    lens = Camera(angle_deg=0.01).lens(1280, 1_000_000)

    assert in_wedge(0, lens.half_angle, 300, 0)
    assert not in_wedge(0, lens.half_angle, -300, 0)


@pytest.mark.parametrize(
    ("word", "chance", "expected"),
    [(0, 0, False), (0, 1, True), (2**64 - 1, SURE - 1, False), (2**64 - 1, SURE, True)],
)
def test_a_look_notices_never_at_chance_0_and_always_at_chance_1(word, chance, expected):
    """Even where the random bits are all zeros or all ones."""
    scene = replace(line_of([(50, 0)]), keys=np.array([key_of_word(word)], np.uint64))

    assert expected == sees(slow.Eye(0, 100, 300, chance, 1), scene)


def test_a_look_from_the_corner_of_the_lattice_is_from_outside():
    """The first camera of a look at (0, 0) was taken to be located, in a triangle that there isn't."""
    scene = line_of([(50, 0)])
    scene.robot[:, :2] = 0

    home = home_of([shapely.box(64, 64, 1280, 1280)])
    assert not sees(slow.Eye(0, 5000, 4096, SURE, 1), scene, home)
