"""What a robot has seen over time, against a twin that looks from every pose by brute force."""

from typing import NamedTuple

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
    I64,
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


class Seen(NamedTuple):
    """What a robot has seen: first and last step of each cell, exposure of rooms, also by bins."""

    first: I64
    last: I64
    exposure: list[int]
    binned: list[list[int]]
    most: list[list[int]]


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


def by_brute_force(poses, lenses, every):
    """Return what is seen, step by step and cell by cell."""
    shape = (FLAT.rows, FLAT.columns)
    first, last = np.full(shape, NEVER), np.full(shape, NEVER)
    rooms, exposure = rooms_of(FLAT), np.zeros(ROOMS, np.int64)
    binned, most = np.zeros((8, ROOMS), np.int64), np.zeros((8, ROOMS), np.int64)
    for step in range(0, len(poses.x), every):
        if poses.away[step]:
            continue
        seen = np.zeros(shape, bool)
        for c in range(len(lenses.near_squared)):
            robot = (int(poses.x[step]), int(poses.y[step]), int(poses.heading[step]))
            pose = camera_pose(lenses, c, *robot, step * SECOND)
            near, far = (
                round(float(v) ** 0.5) for v in (lenses.near_squared[c], lenses.far_squared[c])
            )
            half = int(lenses.half_angle[c])
            seen |= slow.cells_in_view(FLAT.walls, shape, pose, near, far, half, SINES)
        first[seen & (first == NEVER)] = step
        last[seen] = step
        counts = every * np.bincount(rooms[seen & (rooms >= 0)], minlength=ROOMS)
        exposure += counts
        binned[step // BIN] += counts
        most[step // BIN] = np.maximum(most[step // BIN], counts // every)
    return Seen(first, last, exposure.tolist(), binned.tolist(), most.tolist())


def by_kernel(
    poses,
    lenses,
    every,
    slots,
    ends,
    body=None,
):
    """Return what the kernel makes of it, in spans that end at the given steps.

    Each span has a window of its own, or all have one in which the robot is one of three bodies.
    """
    shape = (FLAT.rows, FLAT.columns)
    several = len(lenses.near_squared) > 1
    record = CoverageRecord(
        np.full(shape, NEVER, np.int64), np.full(shape, NEVER, np.int64), np.zeros(ROOMS, np.int64),
        np.full(shape if several else (0, 0), NEVER, np.int64), np.zeros((8, ROOMS), np.int64),
        np.zeros((8, ROOMS), np.int64),
    )  # fmt: skip
    setup = CoverageSetup(FLAT.mesh, lenses, rooms_of(FLAT), SECOND, every, BIN)
    binned, most = np.zeros((8, ROOMS), np.int64), np.zeros((8, ROOMS), np.int64)
    cache = empty_pose_cache(slots, ROOMS)
    begin = 0
    for end in [*ends, len(poses.x)]:
        if body is None:
            part = Poses(*(column[begin:end] for column in poses))
            record_coverage(setup, window_of(part, begin), 0, begin, end, cache, record)
        else:
            record_coverage(setup, window_of(poses, 0, 3, body), body, begin, end, cache, record)
        reached = slice(begin // BIN, (end - 1) // BIN + 1)
        length = reached.stop - reached.start
        binned[reached] += record.binned[:length]
        most[reached] = np.maximum(most[reached], record.peak[:length])
        begin = end
    settle_coverage(setup, cache, record.last)
    lists = (record.exposure.tolist(), binned.tolist(), most.tolist())
    return Seen(record.first, record.last, *lists)


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


@pytest.mark.parametrize("cameras", [ONE, WIDE, TWO], ids=["one", "wide", "two, one of them pans"])
@pytest.mark.parametrize(("every", "slots"), [(1, 64), (1, 2), (3, 8)])
@pytest.mark.parametrize("ends", [[], [1, 2, 17, 18, 40]], ids=["whole", "in spans"])
@pytest.mark.parametrize("body", [None, 2], ids=["alone", "among others"])
def test_sight_record_equals_brute_force(cameras, every, slots, ends, body):
    poses = random_poses(np.random.default_rng(len(cameras)), 60)
    lenses = lenses_of(*cameras)

    expected = by_brute_force(poses, lenses, every)
    result = by_kernel(poses, lenses, every, slots, ends, body)

    assert expected.exposure == result.exposure
    assert expected.binned == result.binned
    assert expected.most == result.most
    assert np.array_equal(expected.first, result.first)
    assert np.array_equal(expected.last, result.last)
    assert (expected.first >= 0).sum() > 20


def test_first_steps_may_be_left_out():
    """`explored` and `first_seen` are kept only if something reads them; the counts are the same."""
    shape, window = (FLAT.rows, FLAT.columns), window_of(random_poses(np.random.default_rng(1), 60))
    setup = CoverageSetup(FLAT.mesh, lenses_of(*ONE), rooms_of(FLAT), SECOND, 1, BIN)
    records = [
        CoverageRecord(
            np.full(grid, NEVER), np.zeros((0, 0), np.int64), np.zeros(ROOMS, np.int64),
            np.zeros((0, 0), np.int64), *np.zeros((2, 8, ROOMS), np.int64),
        )
        for grid in (shape, (0, 0))
    ]  # fmt: skip
    for record in records:
        record_coverage(setup, window, 0, 0, 60, empty_pose_cache(64, ROOMS), record)

    assert records[0].exposure.tolist() == records[1].exposure.tolist()
    assert records[0].exposure.sum() > 0


@quick
@given(seeds(), st.sampled_from([ONE, TWO]), st.integers(1, 4), st.lists(st.integers(1, 59)))
def test_sight_record_in_spans_equals_brute_force(seed, cameras, every, cuts):
    rng = np.random.default_rng(seed)
    poses, lenses = random_poses(rng, 60), lenses_of(*cameras)
    slots = int(rng.choice([2, 4, 64]))

    expected = by_brute_force(poses, lenses, every)
    result = by_kernel(poses, lenses, every, slots, sorted(set(cuts)))

    for one, other in zip(expected, result, strict=True):
        assert np.array_equal(one, other)


def test_tables_that_do_not_fit_are_refused():
    shape, rooms = (FLAT.rows, FLAT.columns), rooms_of(FLAT)
    none = np.zeros((0, ROOMS), np.int64)
    record = CoverageRecord(
        np.full(shape, NEVER), np.zeros((0, 0), np.int64), np.zeros(ROOMS, np.int64),
        np.zeros((0, 0), np.int64), none, none,
    )  # fmt: skip
    setup = CoverageSetup(FLAT.mesh, lenses_of(*ONE), rooms, SECOND, 1, BIN)
    window = window_of(random_poses(np.random.default_rng(1), 60))
    far = window_of(Poses(*[np.full(3, 2**41)] * 3, np.zeros(3, np.uint8)))
    cache = empty_pose_cache(8, ROOMS)
    full = empty_pose_cache(8, ROOMS)
    full.number[:] = 0
    bins = record._replace(
        binned=np.zeros((2, ROOMS), np.int64), peak=np.zeros((2, ROOMS), np.int64)
    )

    steps = (window, 0, 0, 60)
    for arguments, message in [
        ((setup, *steps, empty_pose_cache(6, ROOMS), record), "a power of two"),
        ((setup, *steps, empty_pose_cache(8, 2), record), "cells must be"),
        ((setup, *steps, full, record), "more slots of cache"),
        ((setup, *steps, cache._replace(number=cache.number[:4]), record), "twice as many slots"),
        ((setup._replace(patch_of_cell=rooms + np.int16(9)), *steps, cache, record), "patches"),
        ((setup._replace(patch_of_cell=rooms[1:]), *steps, cache, record), "patch_of_cell"),
        ((setup._replace(every=0), *steps, cache, record), "every"),
        ((setup, window, 1, 0, 60, cache, record), "no such body"),
        ((setup, window, -1, 0, 60, cache, record), "no such body"),
        ((setup, window, 0, -1, 60, cache, record), "within the window"),
        ((setup, window, 0, 0, 61, cache, record), "within the window"),
        ((setup, window, 0, 9, 8, cache, record), "within the window"),
        ((setup, far, 0, 0, 3, cache, record), "lattice units"),
        ((setup, *steps, cache, bins), "a row for every bin"),
    ]:
        with pytest.raises(ValueError, match=message):
            record_coverage(*arguments)
    known, poses = empty_pose_cache(8, ROOMS), random_poses(np.random.default_rng(1), 1)
    still = window_of(Poses(*[np.repeat(column, 60) for column in poses]))
    record_coverage(setup, still, 0, 0, 60, known, record)
    for wrong in ([-1, 1], [0, ROOMS + 1]):
        known.shown[:] = wrong
        with pytest.raises(ValueError, match="shown must hold ranges"):
            record_coverage(setup, still, 0, 0, 60, known, record)
    with pytest.raises(ValueError, match="seen must be"):
        settle_coverage(setup, cache, record.last)
