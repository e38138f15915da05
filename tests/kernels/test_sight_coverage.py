"""What a robot has seen over time, against a twin that looks from every pose by brute force."""

from itertools import pairwise

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from tests.meshed_homes import home_of
from tests.reference import visible_cells as slow
from tests.strategies import quick, seeds

from fleet2d._core import camera_pose
from fleet2d.floorplan.lattice import Lattice
from fleet2d.kernels import (
    NEVER,
    CoverageRecord,
    CoverageSetup,
    Poses,
    Window,
    empty_pose_cache,
    half_sine,
    record_coverage,
    settle_coverage,
)
from fleet2d.sight.camera import Camera, TableContext, stack_lenses

SINES = np.array([half_sine(half) for half in range(8192)], np.int64)
SECOND = 1_000_000
ROOMS = 3
BIN = 9
FLAT = home_of(
    [
        shapely.union_all([shapely.box(128, 128, 900, 700), shapely.box(960, 128, 1500, 700)])
        .union(shapely.box(890, 300, 970, 420))
        .difference(shapely.box(400, 300, 480, 380))
    ]
)


def lenses_of(*cameras):
    """Return cameras as the kernel has them, with 64 lattice units to 5 cm."""
    lenses = [camera.lens(1280, SECOND) for camera in cameras]
    lattice = Lattice(0.05, (0.0, 0.0), FLAT.columns, FLAT.rows)
    return stack_lenses(
        lenses, [False] * len(lenses), TableContext([], [], lattice, SECOND, "robots.a")
    )


def rooms_of(home):
    """Return three rooms: strips of columns, with cells of no room between."""
    rooms = np.full((home.rows, home.columns), -1, np.int16)
    for room in range(ROOMS):
        rooms[:, 8 * room : 8 * room + 7] = room
    rooms.setflags(write=False)  # as a floor plan's are
    return rooms


def random_poses(rng, count):
    """Return poses of a robot that stands, comes back to a few places, and is away at times."""
    cells = FLAT.cells
    spots = rng.choice(cells, 6) + rng.integers(-30, 30, (6, 2))
    at = np.repeat(rng.integers(0, 6, count), rng.integers(1, 5, count))[:count]
    headings = np.repeat(rng.choice([0, 512, 1900, 3333], count), rng.integers(1, 4, count))[:count]
    away = np.repeat(rng.random(count) < 0.1, rng.integers(1, 6, count))[:count]
    return Poses(
        np.ascontiguousarray(spots[at, 0]), np.ascontiguousarray(spots[at, 1]),
        headings.astype(np.int64), away.astype(np.uint8),
    )  # fmt: skip


def window_of(poses, first=0, bodies=1, body=0):
    """Return how one of several bodies moves; the others are where it is in another step."""
    columns = [np.stack([np.roll(column, b - body) for b in range(bodies)]) for column in poses]
    return Window(first, *columns, np.zeros(columns[0].shape, np.int8))


def empty_record(*, several, counts_only=False):
    """Return a record of what nobody has seen, which has a layer more for several cameras."""
    kept, left_out = (np.full(shape, NEVER) for shape in ((FLAT.rows, FLAT.columns), (0, 0)))
    first, both = (left_out if counts_only else kept), (kept if several else left_out)
    bins = np.zeros((2, 8, ROOMS), np.int64)
    return CoverageRecord(first.copy(), kept.copy(), np.zeros(ROOMS, np.int64), both, *bins)


def by_brute_force(poses, lenses, every):
    """Return what is seen, step by step and cell by cell: first and last step, counts by bin."""
    first, last = np.full((2, FLAT.rows, FLAT.columns), NEVER)
    rooms, counts, most = rooms_of(FLAT), *np.zeros((2, 8, ROOMS), np.int64)
    reaches = np.sqrt([lenses.near_squared, lenses.far_squared]).round().astype(int).T.tolist()
    for step in np.flatnonzero(poses.away == 0).tolist():
        if step % every:
            continue
        seen = np.zeros(first.shape, bool)
        robot = [int(column[step]) for column in poses[:3]]
        for c, (near, far) in enumerate(reaches):
            pose, half = camera_pose(lenses, c, *robot, step * SECOND), int(lenses.half_angle[c])
            seen |= slow.cells_in_view(FLAT.walls, first.shape, pose, near, far, half, SINES)
        first[seen & (first == NEVER)] = step
        last[seen] = step
        in_view = np.bincount(rooms[seen & (rooms >= 0)], minlength=ROOMS)
        counts[step // BIN] += every * in_view
        most[step // BIN] = np.maximum(most[step // BIN], in_view)
    return first, last, counts.sum(axis=0), counts, most


def by_kernel(poses, lenses, every, slots, ends, body):
    """Return what the kernel makes of it, in spans that end at the given steps.

    Each span has a window of its own, or all have one in which the robot is one of three bodies.
    """
    record = empty_record(several=len(lenses.near_squared) > 1)
    setup = CoverageSetup(FLAT.mesh, lenses, rooms_of(FLAT), SECOND, every, BIN)
    counts, most = np.zeros((2, 8, ROOMS), np.int64)
    cache = empty_pose_cache(slots, ROOMS)
    for begin, end in pairwise([0, *ends, len(poses.x)]):
        if body is None:
            window = window_of(Poses(*(column[begin:end] for column in poses)), begin)
        else:
            window = window_of(poses, 0, 3, body)
        record_coverage(setup, window, body or 0, begin, end, cache, record)
        reached = slice(begin // BIN, (end - 1) // BIN + 1)
        length = reached.stop - reached.start
        counts[reached] += record.binned[:length]
        most[reached] = np.maximum(most[reached], record.peak[:length])
    settle_coverage(setup, cache, record.last)
    return record.first, record.last, record.exposure, counts, most


ONE = [Camera(range=(0.1, 0.6), angle_deg=108)]
WIDE = [Camera(range=(0, 3), angle_deg=250)]
TWO = [
    Camera(range=(0, 0.5), angle_deg=90),
    Camera.model_validate(
        {
            "range": [0, 0.4], "angle_deg": 120, "offset": [0.05, -0.02], "heading_deg": 40,
            "pan": {"headings_deg": [-60, 0, 60], "dwell": "2 s"},
        }
    ),
]  # fmt: skip


@quick
@given(
    seeds(),
    st.sampled_from([ONE, WIDE, TWO]),
    st.integers(1, 4),
    st.sampled_from([2, 4, 64]),
    st.lists(st.integers(1, 59)),
    st.sampled_from([None, 2]),
)
def test_sight_record_in_spans_equals_brute_force(seed, cameras, every, slots, cuts, body):
    poses, lenses = random_poses(np.random.default_rng(seed), 60), lenses_of(*cameras)

    expected = by_brute_force(poses, lenses, every)
    result = by_kernel(poses, lenses, every, slots, sorted(set(cuts)), body)

    assert all(map(np.array_equal, expected, result))


def test_first_steps_may_be_left_out():
    """`explored` and `first_seen` are kept only if something reads them; the counts are the same."""
    window = window_of(random_poses(np.random.default_rng(1), 60))
    setup = CoverageSetup(FLAT.mesh, lenses_of(*ONE), rooms_of(FLAT), SECOND, 1, BIN)
    whole, counts = (empty_record(several=False, counts_only=value) for value in (False, True))
    for record in (whole, counts):
        record_coverage(setup, window, 0, 0, 60, empty_pose_cache(64, ROOMS), record)

    assert whole.exposure.tolist() == counts.exposure.tolist()
    assert whole.exposure.sum() > 0


@pytest.mark.parametrize("shown", [[-1, 1], [0, ROOMS + 1]])
def test_a_kept_view_of_rooms_that_are_none_is_refused(shown):
    still = Poses(
        *(np.repeat(column[:1], 60) for column in random_poses(np.random.default_rng(1), 1))
    )
    setup = CoverageSetup(FLAT.mesh, lenses_of(*ONE), rooms_of(FLAT), SECOND, 1, BIN)
    cache, record = empty_pose_cache(8, ROOMS), empty_record(several=False)
    record_coverage(setup, window_of(still), 0, 0, 60, cache, record)
    cache.shown[:] = shown
    with pytest.raises(ValueError, match="shown must hold ranges"):
        record_coverage(setup, window_of(still), 0, 0, 60, cache, record)
