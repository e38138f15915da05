"""What a camera sees, against a twin that looks at every wall and at sixty digits of a cosine."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

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
    USER_LOST,
    USER_SEEN,
    About,
    DetectionRule,
    Heights,
    SightMemory,
    UserDraw,
    Window,
    detect,
    new_memory,
)
from fleet2d.sight.camera import Camera, Lens, TableContext, error_tables, stack_lenses
from fleet2d.sight.perception import Perception

ANGLES = [1, 90, 180, 181, 359, 360]
EIGHTHS = [0, 512, 1024, 1536, 2048, 2560, 3072, 3584]
STEPS = 12
RADIUS = 100  # of users, lattice units
STEP_US = 1_000_000
START_US = 86_340_000_000
"""A minute before midnight."""
FIRST = 40
"""A step 20 s before it."""


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
    perceptions: Sequence[Perception | None] = ()
    shown: U64 | None = None
    thickness: int = 0
    heights: int = 0

    def part(self, begin, end):
        """Return some steps of it."""
        shown = None if self.shown is None else self.shown[..., begin:end]
        return replace(
            self, robot=self.robot[begin:end], users=self.users[:, begin:end], shown=shown
        )

    def window(self, first):
        """Return how all bodies move, the number of the robot, and that of the first user."""
        robot = self.robot[None][..., [0, 1, 3, 2]]
        robot = np.concatenate([robot, np.zeros_like(robot[..., :1])], axis=2)
        stranger = np.repeat(robot, self.strangers, axis=0)  # at the robot: in view if anybody is
        stranger[..., 2] = 0
        parts = [robot, stranger, self.users] if self.is_first else [self.users, stranger, robot]
        bodies = np.concatenate([stranger, *parts, stranger])
        x, y, away, heading, posture = bodies.transpose(2, 0, 1)
        window = Window(first, x, y, heading, away.astype(np.uint8), posture.astype(np.int8))
        one, other = self.strangers, len(self.users)
        if self.is_first:
            return window, one, 2 * one + 1
        return window, 2 * one + other, one

    def radii(self):
        """Return the radii of all bodies of the window, None if they don't hide each other."""
        count = len(self.users) + 1 + 3 * self.strangers
        return self.thickness + 7 * np.arange(count) if self.thickness else None

    def obstacles(self):
        """Return the obstacles that hide users, for the reference."""
        radii = self.radii()
        if radii is None:
            return None
        _, robot, first_user = self.window(0)
        here = [slow.Body(x, y, False) for x, y, *_ in self.robot.tolist()]
        result = {}
        for number, radius in enumerate(radii.tolist()):
            user = number - first_user
            if 0 <= user < len(self.users):
                poses = [
                    slow.Body(x, y, bool(away), heading, posture)
                    for x, y, away, heading, posture in self.users[user].tolist()
                ]
                result[user] = slow.Obstacle(poses, radius)
            elif number != robot:
                result[-1 - number] = slow.Obstacle(here, radius)
        return result

    def heights_for(self, eyes):
        """Return the heights of cameras, bodies and furniture, for the kernel and for the twin."""
        if not self.heights:
            return None
        rng, users = np.random.default_rng(self.heights), len(self.users)
        count, points = users + 1 + 3 * self.strangers, max(eye.points for eye in eyes) + 1
        low = np.array([0, 300, 500, 800, 1700])  # several are equal, so that lines graze
        levels = Heights(
            eyes=rng.choice(low, (len(eyes), 3)),
            points=rng.choice(low, (len(eyes), users, 3, points)),
            tops=rng.choice(low, (count, 3)),
            corners=np.zeros((0, 2), np.int64),
            start=np.zeros(1, np.int64),
            boxes=np.zeros((0, 4), np.int64),
            top=np.zeros(0, np.int64),
        )
        pieces = [_piece(rng) for _ in range(rng.integers(0, 6))]
        if pieces:
            corners = [np.array(piece.corners) for piece in pieces]
            levels = levels._replace(
                corners=np.concatenate(corners),
                start=np.cumsum([0, *map(len, corners)]),
                boxes=np.array([[*c.min(axis=0), *c.max(axis=0)] for c in corners]),
                top=np.array([piece.top for piece in pieces]),
            )
        *_, first_user = self.window(0)
        tops = {
            n - first_user if 0 <= n - first_user < users else -1 - n: levels.tops[n].tolist()
            for n in range(count)
        }
        return levels, slow.Heights(levels.eyes.tolist(), levels.points.tolist(), tops, pieces)


def _piece(rng):
    """Return a piece of furniture: a box on cells' borders, an L, or a triangle."""
    x, y, w, h = (64 * rng.integers(0, 12, 4) + [0, 0, 32, 32]).tolist()
    shapes = [
        [(x, y), (x + w, y), (x + w, y + h), (x, y + h)],
        [(x, y), (x + w, y), (x + w, y + h // 2), (x + 8, y + h // 2), (x + 8, y + h), (x, y + h)],
        [(x, y), (x + w, y + 7), (x + 3, y + h)],
    ]
    return slow.Piece(shapes[rng.integers(0, 3)], int(rng.choice([300, 500, 800])))


@dataclass
class Carried:
    """What a robot carries from span to span: in the kernel, and in the twin."""

    memory: SightMemory
    known: list[slow.Known]
    errors: list[slow.Errors | None] = field(default_factory=list)


class Seen(NamedTuple):
    """What came of a look: steps done, sightings, events, counts, and the memory afterwards."""

    done: int
    sightings: list[tuple[int, ...]]
    events: list[tuple[int, ...]]
    counts: list[list[list[int]]]
    noticed: list[int]
    seen: list[int]

    @property
    def places(self):
        """Sightings by step, camera, user, x and y."""
        return [(step, camera, user, x, y) for step, camera, user, _, x, y, *_ in self.sightings]


def half_angle(degrees):
    """Return the half of a field of view as a lens has it."""
    return round(degrees / 360 * 4096)


def lattice():
    """Return a lattice whose units are those of the homes here."""
    return Lattice(cell=0.05, origin=(0.0, 0.0), columns=20, rows=20)


def listed(eye):
    """Return one camera, or several, as a list."""
    return [eye] if isinstance(eye, slow.Eye) else list(eye)


def tables_of(eyes, scene):
    """Return how cameras err, with a stream for each draw."""
    perceptions = list(scene.perceptions) or [None] * len(eyes)
    count = len(scene.users)
    context = TableContext(
        [f"u{i}" for i in range(count)], [RADIUS] * count, lattice(), STEP_US, "r"
    )
    errors = error_tables([Lens(**eye._asdict()) for eye in eyes], perceptions, context)
    for c in range(len(eyes)):
        for draw in UserDraw:
            errors.keys[c, :, draw] = scene.keys + np.uint64(c + 100 * (draw - UserDraw.DETECT))
        errors.ghost_keys[c] = scene.keys.sum() + np.arange(5, dtype=np.uint64) * np.uint64(7 + c)
    return errors


def kernel_args(eyes, scene):
    """Return cameras as the kernel wants them."""
    lenses = [Lens(**eye._asdict()) for eye in eyes]
    count = len(scene.users)
    about = TableContext([f"u{i}" for i in range(count)], [RADIUS] * count, lattice(), STEP_US, "r")
    errs = [p is not None for p in scene.perceptions] or [False] * len(eyes)
    patience = max(eye.patience for eye in eyes)
    errors = tables_of(eyes, scene)
    burst = int((count + MAX_GHOSTS * errors.has_ghosts).sum())
    rule = DetectionRule(patience, STEP_US, START_US, burst, False, False)
    return stack_lenses(lenses, errs, about), errors, rule


def nothing_known(eye, scene):
    """Return what a robot carries that has seen nobody."""
    eyes, count, errors = listed(eye), len(scene.users), tables_of(listed(eye), scene)
    bursts = count + MAX_GHOSTS * errors.has_ghosts
    rows = max(
        int((eye.latency // eye.period + 2) * burst)
        for eye, burst in zip(eyes, bursts, strict=True)
    )
    known = [slow.Known(-1, False) for _ in range(count + 1)]
    errs = [
        None if perception is None else slow.Errors(errors, c, START_US)
        for c, perception in enumerate(scene.perceptions)
    ]
    return Carried(new_memory(len(eyes), count, rows), known, errs)


def looked(
    home,
    eye,
    scene,
    first,
    stops=(False, False),
    carried=None,
):
    """Return what the kernel sees."""
    eyes = listed(eye)
    memory = (carried or nothing_known(eyes, scene)).memory
    lenses, errors, rule = kernel_args(eyes, scene)
    rule = rule._replace(stop_lost=stops[0], stop_seen=stops[1])
    before = memory.about.copy()
    heights = scene.heights_for(eyes)
    done, step, index, distinct, newest, events = detect(
        home.mesh,
        lenses,
        errors,
        rule,
        *scene.window(first),
        memory,
        scene.shown,
        scene.radii(),
        heights and heights[0],
    )
    rows = SightingTable(step, index, distinct.T).rows()
    assert newest_of(rows, len(newest)) == [
        int(np.flatnonzero(index == number)[-1]) if number >= 0 else -1 for number in newest
    ]
    counts = (memory.about - before)[..., [About.IN_VIEW, About.NOTICED]]
    return Seen(
        done,
        [tuple(row) for row in rows.tolist()],
        events,
        counts.tolist(),
        memory.noticed.tolist(),
        memory.seen.tolist(),
    )


def looked_slowly(
    home,
    eye,
    scene,
    first,
    stops=(False, False),
    carried=None,
):
    """Return what the twin sees."""
    eyes, carried = listed(eye), carried or nothing_known(eye, scene)
    shown, heights = scene.shown, scene.heights_for(eyes)
    result = slow.detect(
        home.walls,
        eyes,
        [slow.Body(x, y, bool(away), heading) for x, y, heading, away in scene.robot.tolist()],
        [
            [slow.Body(x, y, bool(away), heading, posture) for x, y, away, heading, posture in user]
            for user in scene.users.tolist()
        ],
        [RADIUS] * len(scene.users),
        [[(key + c) % 2**64 for key in scene.keys.tolist()] for c in range(len(eyes))],
        STEP_US,
        first,
        carried.known,
        stops,
        carried.errors,
        None if shown is None else lambda c, u, j: int(shown[c, u, j]),
        scene.obstacles(),
        heights and heights[1],
    )
    known = carried.known
    return Seen(*result, [k.noticed for k in known], [int(k.seen) for k in known])


def rested(rng, poses, moves):
    """Return poses (steps, …) of which each lasts: another one comes with a probability."""
    steps = np.arange(len(poses))
    return poses[np.maximum.accumulate(np.where(rng.random(len(poses)) < moves, steps, 0))]


def scene_in(home, rng, count, steps=STEPS, moves=1.0):
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


@st.composite
def eyes(draw):
    """Cameras of all kinds."""
    near = draw(st.sampled_from([0, 0, 1, 100]))
    return slow.Eye(
        near=near,
        far=near + draw(st.sampled_from([0, 150, 400, 5000])),
        half_angle=half_angle(draw(st.one_of(st.sampled_from(ANGLES), st.floats(0.1, 360)))),
        chance=round(draw(st.sampled_from([0.0, 0.5, 1.0, 1.0])) * 2**53),
        patience=draw(st.sampled_from([1, 2, 5])),
    )


@st.composite
def odd_eyes(draw):
    """Cameras mounted anywhere, that pan, wait and lag, and look at whole bodies."""
    headings = st.sampled_from([*EIGHTHS, 1, 300, 4000])
    return draw(eyes())._replace(
        forward=draw(st.sampled_from([0, 0, 60, -130])),
        left=draw(st.sampled_from([0, 0, 25, -300])),
        heading=draw(headings),
        pans=tuple(draw(st.lists(headings, max_size=3))),
        pan_us=draw(st.sampled_from([1_000_000, 2_500_000])),
        period=draw(st.sampled_from([1, 1, 2, 5])),
        latency=draw(st.sampled_from([0, 0, 1, 4])),
        points=draw(st.sampled_from([0, 0, 1, 4, 7])),
    )


stoppings = st.tuples(st.booleans(), st.booleans())

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


def assert_same(
    home,
    eye,
    scene,
    first,
    stops=(False, False),
):
    """Compare what the kernel and its twin see, and return it."""
    expected = looked_slowly(home, eye, scene, first, stops)
    assert expected == looked(home, eye, scene, first, stops)
    return expected


@quick
@given(homes(), eyes(), seeds(), st.integers(0, 3), st.integers(0, 10**9), stoppings)
def test_look_equals_the_reference(polygons, eye, seed, count, first, stops):
    home = home_of(polygons)
    scene = scene_in(home, np.random.default_rng(seed), count)

    assert_same(home, eye, scene, first, stops)


@quick
@given(homes(), st.lists(odd_eyes(), min_size=1, max_size=3), seeds(), st.integers(0, 3), stoppings)
def test_look_of_several_cameras_equals_the_reference(polygons, cameras, seed, count, stops):
    home = home_of(polygons)
    scene = scene_in(home, np.random.default_rng(seed), count)
    assert_same(home, cameras, scene, 7, stops)


MOVES = st.sampled_from([0.05, 0.2, 0.5])
LONG = 3 * STEPS
THICKNESSES = st.sampled_from([0, 1, 30, 100])


@quick
@given(homes(), st.lists(odd_eyes(), min_size=1, max_size=3), seeds(), MOVES, stoppings)
def test_look_at_bodies_that_mostly_rest_equals_the_reference(
    polygons, cameras, seed, moves, stops
):
    """Where neither moves, one verdict holds for many steps: until a camera pans."""
    home = home_of(polygons)
    scene = scene_in(home, np.random.default_rng(seed), 2, LONG, moves)

    assert_same(home, cameras, scene, FIRST, stops)


@quick
@given(
    homes(),
    st.lists(odd_eyes(), min_size=1, max_size=3),
    seeds(),
    st.sampled_from([0.05, 0.2, 1.0]),
    stoppings,
    st.sampled_from([1, 30, 100]),
)
def test_look_past_bodies_that_hide_each_other_equals_the_reference(
    polygons, cameras, seed, moves, stops, thickness
):
    home = home_of(polygons)
    scene = scene_in(home, np.random.default_rng(seed), 3, LONG, moves)
    scene = replace(scene, thickness=thickness)

    assert_same(home, cameras, scene, FIRST, stops)


@pytest.mark.parametrize("moves", [0.1, 1.0])
def test_look_past_bodies_in_one_room_equals_the_reference(moves):
    """Where bodies hide each other often, and parts of each other."""
    eyes_ = [slow.Eye(0, 900, 4096, SURE, 2, points=7), slow.Eye(0, 900, 300, SURE, 2, forward=40)]
    scene = scene_in(ROOM, np.random.default_rng(8), 6, 120, moves)
    scene = replace(scene, thickness=60)
    expected = assert_same(ROOM, eyes_, scene, FIRST)
    assert (
        100 < len(expected.sightings) < len(looked(ROOM, eyes_, replace(scene, thickness=0), 0)[1])
    )


@quick
@given(homes(), st.lists(odd_eyes(), min_size=1, max_size=3), seeds(), MOVES, THICKNESSES)
def test_look_over_furniture_and_bodies_equals_the_reference(
    polygons, cameras, seed, moves, thickness
):
    home = home_of(polygons)
    scene = scene_in(home, np.random.default_rng(seed), 3, LONG, moves)
    scene = replace(scene, thickness=thickness, heights=seed + 1)

    assert_same(home, cameras, scene, FIRST)


@pytest.mark.slow
@pytest.mark.parametrize("thickness", [0, 60])
def test_look_over_furniture_in_one_room_equals_the_reference(thickness):
    """Where furniture hides people often, and parts of them."""
    eyes_ = [slow.Eye(0, 900, 4096, SURE, 2, points=7), slow.Eye(0, 900, 300, SURE, 2, forward=40)]
    scene = scene_in(ROOM, np.random.default_rng(8), 5, 60, 0.3)
    scene = replace(scene, thickness=thickness, heights=7)
    expected = assert_same(ROOM, eyes_, scene, FIRST)
    flat = looked(ROOM, eyes_, replace(scene, heights=0), FIRST)
    assert 100 < len(expected.sightings)
    assert expected.places != flat.places


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"eyes": np.full((1, 3), 2**13)}, "heights must be in 0"),
        ({"eyes": np.zeros((2, 3), np.int64)}, "eyes must be"),
        ({"tops": np.zeros((1, 3), np.int64)}, "tops"),
        ({"points": np.zeros((1, 1, 3, 1), np.int64)}, "points must be"),
        ({"start": np.array([0, 1])}, "start must have one more"),
        ({"corners": np.zeros((3, 2), np.int64)}, "start must cover"),
        ({"start": np.zeros(2, np.int64), "top": np.ones(1, np.int64),
          "boxes": np.zeros((1, 4), np.int64)}, "each piece must have corners"),
    ],
)  # fmt: skip
def test_heights_that_do_not_fit_are_refused(change, message):
    eye = slow.Eye(0, 900, 4096, SURE, 2, points=2)
    scene = replace(scene_in(ROOM, np.random.default_rng(3), 2, 5), heights=1, strangers=0)
    given_heights = scene.heights_for([eye])
    assert given_heights is not None
    empty = {"corners": np.zeros((0, 2), np.int64), "start": np.zeros(1, np.int64),
             "boxes": np.zeros((0, 4), np.int64), "top": np.zeros(0, np.int64)}  # fmt: skip
    heights = given_heights[0]._replace(**empty)._replace(**change)
    lenses, errors, rule = kernel_args([eye], scene)
    memory = nothing_known(eye, scene).memory

    with pytest.raises(ValueError, match=message):
        detect(ROOM.mesh, lenses, errors, rule, *scene.window(0), memory, heights=heights)


@quick
@given(st.data(), st.lists(odd_eyes(), min_size=1, max_size=2), seeds(), MOVES, stoppings)
def test_look_of_cameras_that_err_equals_the_reference(data, cameras, seed, moves, stops):
    rng = np.random.default_rng(seed)
    home, count = home_of(data.draw(homes())), int(rng.integers(0, 4))
    errs = data.draw(errors_of(cameras, count))
    scene = replace(scene_in(home, rng, count, LONG, moves), perceptions=errs)

    assert_same(home, cameras, scene, FIRST, stops)


@quick
@given(
    st.data(), st.lists(odd_eyes(), min_size=1, max_size=3), seeds(), MOVES, stoppings, THICKNESSES
)
def test_look_by_another_method_equals_the_reference(data, cameras, seed, moves, stops, thickness):
    rng = np.random.default_rng(seed)
    home, errs = home_of(data.draw(homes())), data.draw(errors_of(cameras, 2))
    scene = scene_in(home, rng, 2, LONG, moves)
    shown = np.zeros((len(cameras), 2, LONG), np.uint64)
    for c, eye in enumerate(cameras):
        points = rng.integers(0, 2 ** (eye.points + 1), (2, LONG), np.uint64)
        for u in range(2):
            shown[c, u] = rested(rng, np.where(rng.random(LONG) < 0.7, points[u], 0), moves)
    scene = replace(scene, shown=shown, perceptions=errs, thickness=thickness)

    assert_same(home, cameras, scene, FIRST, stops)


@quick
@given(st.data(), st.lists(odd_eyes(), min_size=1, max_size=3), seeds(), st.integers(1, LONG - 1))
def test_look_of_several_cameras_at_two_spans_is_that_at_one(data, cameras, seed, cut):
    home, rng = home_of(data.draw(homes())), np.random.default_rng(seed)
    scene = scene_in(home, rng, 3, LONG, data.draw(st.sampled_from([1.0, 0.2])))
    errs, thickness = data.draw(errors_of(cameras, 3)), data.draw(THICKNESSES)
    scene = replace(scene, perceptions=errs, thickness=thickness)
    whole = looked(home, cameras, scene, 50)

    carried = nothing_known(cameras, scene)
    first = looked(home, cameras, scene.part(0, cut), 50, carried=carried)
    second = looked(home, cameras, scene.part(cut, LONG), 50 + cut, carried=carried)

    assert whole.sightings == first.sightings + second.sightings
    assert whole.events == first.events + second.events
    assert (whole.noticed, whole.seen) == (second.noticed, second.seen)


def test_look_returns_any_number_of_sightings():
    scene = line_of([(50 + i, 0) for i in range(20)], steps=5000)

    seen = looked(ROOM, slow.Eye(0, 100, 300, SURE, 4), scene, 0)

    assert 5000 == seen.done
    assert [(step, 0, u) for step in range(5000) for u in range(20)] == [
        row[:3] for row in seen.sightings
    ]


@pytest.mark.parametrize("degrees", ANGLES)
@pytest.mark.parametrize("detection", [0.0, 0.5, 1.0])
def test_look_in_one_room_equals_the_reference(degrees, detection):
    home = home_of([shapely.box(0, 0, 1280, 960).difference(shapely.box(500, 300, 640, 700))])
    eye = slow.Eye(0, 700, half_angle(degrees), round(detection * 2**53), 2)
    scene = scene_in(home, np.random.default_rng(degrees), 4, 150)

    expected = assert_same(home, eye, scene, 1000)
    assert (detection > 0) == bool(expected.sightings)


@pytest.mark.parametrize("per_track", [True, False])
@pytest.mark.parametrize(("memory", "patience"), [("0 s", 2), ("4 s", 5)])
def test_look_in_one_room_of_cameras_that_err_equals_the_reference(per_track, memory, patience):
    """Where users are in view most of the time, so that every way to err happens often."""
    home = home_of([shapely.box(0, 0, 1280, 960).difference(shapely.box(500, 300, 640, 700))])
    cameras = [
        slow.Eye(0, 900, half_angle(200), SURE, patience, pans=(0, 1024, 3072), pan_us=2_500_000),
        slow.Eye(0, 700, 4096, SURE, patience, forward=40, period=2, latency=3, points=6),
    ]
    identity = {"right": [[0, 0.6], [0.5, 0.4]], "mistaken": 0.3, "per_track": per_track}
    spot = {"at": [0.2, 0.3], "per_hour": 700, "spread": 0.03}
    false = {"per_hour": 1000, "spots": [spot], "looks_like": {"u0": 0.5}}
    errs = Perception.model_validate(
        {
            "detection": {**CURVES, "memory": memory},
            "identity": identity,
            "attributes": NOISE,
            "false_positives": false,
        }
    )
    scene = scene_in(home, np.random.default_rng(per_track), 3, 150, 0.1)
    scene = replace(scene, perceptions=[errs, errs])

    expected = assert_same(home, cameras, scene, FIRST)
    users = [row[2:4] for row in expected.sightings]
    assert min(users.count((u, u)) for u in range(3)) > 5
    assert len([1 for u, who in users if u >= 0 > who]) > 5
    assert len([1 for u, who in users if u >= 0 and who not in (u, -1)]) > 5
    assert min(users.count((-1, who)) for who in (-1, 0)) > 5


@quick
@given(homes(), eyes(), seeds(), st.integers(1, STEPS - 1))
def test_look_at_two_spans_is_that_at_one(polygons, eye, seed, cut):
    home = home_of(polygons)
    scene = scene_in(home, np.random.default_rng(seed), 3)
    whole = looked(home, eye, scene, 50)

    carried = nothing_known(eye, scene)
    first = looked(home, eye, scene.part(0, cut), 50, carried=carried)
    second = looked(home, eye, scene.part(cut, STEPS), 50 + cut, carried=carried)

    assert whole == Seen(
        first.done + second.done,
        first.sightings + second.sightings,
        first.events + second.events,
        (np.array(first.counts) + np.array(second.counts)).tolist(),
        second.noticed,
        second.seen,
    )


@quick
@given(homes(), eyes(), seeds(), stoppings)
def test_looks_with_stops_equal_looks_without(polygons, eye, seed, stops):
    home = home_of(polygons)
    scene = scene_in(home, np.random.default_rng(seed), 3)
    whole = looked(home, eye, scene, 0)

    carried, at, sightings, events = nothing_known(eye, scene), 0, [], []
    while at < STEPS:
        seen = looked(home, eye, scene.part(at, STEPS), at, stops, carried)
        stopping = [step for step, _, kind in seen.events if stops[kind]]
        at += seen.done
        assert [at - 1] * len(stopping) == stopping
        assert stopping or at == STEPS
        sightings += seen.sightings
        events += seen.events

    assert (whole.sightings, whole.events) == (sightings, events)
    memory = carried.memory
    assert (whole.noticed, whole.seen) == (memory.noticed.tolist(), memory.seen.tolist())


def test_look_at_another_user_leaves_the_draws_of_the_first_alone():
    """Known failure 9: adding a user changed the robot's random numbers."""
    home = home_of([shapely.box(0, 0, 1280, 960)])
    eye = slow.Eye(0, 700, half_angle(180), 2**52, 2)
    both = scene_in(home, np.random.default_rng(4), 2, 60)
    second = replace(both, users=both.users[1:], keys=both.keys[1:])

    of_both = [(s, x, y) for s, _, user, x, y in looked(home, eye, both, 0).places if user == 1]

    assert len(of_both) > 3
    assert of_both == [(s, x, y) for s, _, _, x, y in looked(home, eye, second, 0).places]


def line_of(users, steps=1, heading=0):
    """Return a robot at (501, 501) that looks at users who stand still."""
    robot = np.tile([501, 501, heading, 0], (steps, 1))
    still = [[[501 + dx, 501 + dy, 0, 0, 0]] * steps for dx, dy in users]
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
def test_look_sees_between_its_ranges_ends_included(near, far, distance, expected):
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
def test_look_sees_within_its_angle_borders_included(degrees, heading, offset, expected):
    eye = slow.Eye(0, 600, half_angle(degrees), SURE, 1)
    scene = line_of([offset], heading=heading)

    assert expected == bool(looked(ROOM, eye, scene, 0).sightings)
    assert expected == slow.in_wedge(heading, eye.half_angle, *offset)


@pytest.mark.parametrize("half", [1, 11, 1024, 2047, 2048, 2049, 3072, 4085, 4095, 4096])
def test_in_wedge_of_every_direction_equals_cosines(half):
    rng = np.random.default_rng(half)
    for heading in [0, 512, 2048, 4095, *rng.integers(0, 4096, 12).tolist()]:
        ahead, right, left = 2 * heading, 2 * heading - half, 2 * heading + half
        for part in (ahead, right - 3, right + 3, left - 3, left + 3, ahead + 4096):
            dx, dy = (round(5760 * float(f(part))) for f in (slow.cosine, _sine))

            assert slow.in_wedge(heading, half, dx, dy) == in_wedge(heading, half, dx, dy)


def _sine(part):
    return slow.cosine(part - 2048)


def test_look_of_the_narrowest_camera_does_not_see_behind():
    """Rounded to a half angle of 0, its wedge was a line through the robot."""
    lens = Camera(angle_deg=0.01).lens(1280, 1_000_000)

    assert in_wedge(0, lens.half_angle, 300, 0)
    assert not in_wedge(0, lens.half_angle, -300, 0)


@pytest.mark.parametrize("half", [1, 300, 2047])
def test_in_wedge_excludes_points_right_behind(half):
    for heading in range(0, 4096, 64):
        behind = [round(-1000 * float(f(2 * heading))) for f in (slow.cosine, _sine)]

        assert not in_wedge(heading, half, *behind)


def test_look_counts_a_user_as_lost_after_its_patience():
    """Seen in steps 0 and 1, then away: lost in the first step that is `patience` after step 1."""
    scene = line_of([(50, 0)], steps=9)
    scene.users[0, 2:, 2] = 1

    seen = looked(ROOM, slow.Eye(0, 100, 300, SURE, 4), scene, 100)

    assert [(100, 0, 0, 551, 501), (101, 0, 0, 551, 501)] == seen.places
    assert [(100, 0, USER_SEEN), (105, 0, USER_LOST)] == seen.events


def test_look_does_not_lose_a_user_who_is_back_in_time():
    scene = line_of([(50, 0)], steps=9)
    scene.users[0, 2:5, 2] = 1

    seen = looked(ROOM, slow.Eye(0, 100, 300, SURE, 4), scene, 100)

    assert [(100, 0, USER_SEEN)] == seen.events


@pytest.mark.parametrize(
    ("word", "chance", "expected"),
    [(0, 0, False), (0, 1, True), (2**64 - 1, SURE - 1, False), (2**64 - 1, SURE, True)],
)
def test_look_notices_never_at_chance_0_and_always_at_chance_1(word, chance, expected):
    """Even where the random bits are all zeros or all ones."""
    scene = replace(line_of([(50, 0)]), keys=np.array([key_of_word(word)], np.uint64))

    assert expected == bool(looked(ROOM, slow.Eye(0, 100, 300, chance, 1), scene, 0).sightings)


def test_look_of_a_robot_that_is_away_sees_nobody():
    scene = line_of([(50, 0), (0, 0)], steps=3)
    scene.robot[:, 3] = 1

    assert [] == looked(ROOM, slow.Eye(0, 100, 4096, SURE, 1), scene, 0).sightings


def test_look_from_the_corner_of_the_lattice_is_from_outside():
    """The first camera of a look at (0, 0) was taken to be located, in a triangle that there isn't."""
    home = home_of([shapely.box(64, 64, 1280, 1280)])
    scene = line_of([(50, 0)])
    scene.robot[:, :2] = 0

    assert [] == looked(home, slow.Eye(0, 5000, 4096, SURE, 1), scene, 0).sightings


def test_look_in_the_step_of_a_stop_still_sees_the_other_users():
    scene = line_of([(50, 0), (60, 0)], steps=5)

    seen = looked(ROOM, slow.Eye(0, 100, 300, SURE, 4), scene, 7, (False, True))

    assert seen.done == 1
    assert [(7, 0, USER_SEEN), (7, 1, USER_SEEN)] == seen.events
    assert len(seen.sightings) == 2


def test_look_without_users_does_all_steps():
    empty = Scene(line_of([(0, 0)], 6).robot, np.empty((0, 6, 5), np.int64), np.empty(0, np.uint64))

    seen = looked(ROOM, slow.Eye(0, 100, 300, SURE, 4), empty, 0, (True, True))

    assert Seen(6, [], [], [[]], [-1], [0]) == seen


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"step_us": 0}, "step_us"),
        ({"step_us": -1}, "step_us"),
        ({"step_us": 2**61}, "before"),
        ({"start_us": -1}, "start_us"),
        ({"start_us": 2**61}, "start_us"),
        ({"pan_us": 2**61}, "pan_us"),
        ({"first_other": 2**63 - 1}, "fewer others"),
        ({"body": 2}, "no such body"),
    ],
)
def test_look_refuses_times_and_bodies_that_are_none(change, message):
    """A step of no length divided by 0, a long pan never ended, others were read beyond the window."""
    scene, eye = line_of([(50, 0)]), slow.Eye(0, 100, 300, SURE, 4, pans=(5, 7), pan_us=STEP_US)
    lenses, errors, rule = kernel_args([eye], scene)
    window, body, first_other = scene.window(0)
    times = {key: value for key, value in change.items() if key in rule._fields}
    pan_us = np.array([change.get("pan_us", STEP_US)])

    with pytest.raises(ValueError, match=message):
        detect(
            ROOM.mesh,
            lenses._replace(pan_us=pan_us),
            errors,
            rule._replace(**times),
            window,
            change.get("body", body),
            change.get("first_other", first_other),
            nothing_known(eye, scene).memory,
        )
