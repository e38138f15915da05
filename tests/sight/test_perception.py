"""What perception makes of what is there happens as often as configured, for every part of it.

Each `agree` fails a true model in one of 150,000 cases; draws are seeded, so none does by chance.
"""

import math

import numpy as np
import pytest
import shapely
from tests.sight.watching import PILLAR, SIDE_M, UNITS_PER_M, Watch, agree, around, hall

from fleet2d.kernels import SightingColumn as Column

N = 60_000
RNG = np.random.default_rng(0)
DISTANCE = RNG.uniform(0.5, 8.5, N)
BEARING = RNG.uniform(-180, 180, N)
FACING = RNG.uniform(-180, 180, N)


def check_by(values, edges, hits, expected):
    """Check rates in each bin of a quantity."""
    group = np.digitize(values, np.asarray(edges))
    for g in np.unique(group):
        inside = group == g
        assert agree(hits[inside], expected[inside]), (
            g,
            hits[inside].mean(),
            expected[inside].mean(),
        )


# --- Who is noticed -------------------------------------------------------------------------------


def noticed(watch):
    """Return for each step whether the only user is noticed."""
    result = np.zeros(N, bool)
    result[watch.look()[:, Column.STEP]] = True
    return result


@pytest.mark.parametrize("turned", [0.0, 200.0])
def test_all_factors_of_who_is_noticed_multiply(turned):
    """Bearings are from where the camera looks, those to the left are positive.

    From Monday 18:00 on, a look every ten minutes, past midnight more than once.
    """
    posture = RNG.integers(0, 2, (1, N)).astype(np.int8)
    detection = {
        "distance": [[0, 1], [9, 0.4]],
        "bearing": [[-180, 0.5], [180, 1]],
        "orientation": [[0, 1], [180, 0.5]],
        "posture": {"sit": 0.6},
        "light": [[6, 0.4], [8, 1.0], [20, 1.0], [22, 0.4]],
    }
    watch = Watch(
        around(DISTANCE, BEARING, FACING),
        camera={"detection": 0.95, "heading_deg": 30, "lost_after": "1 h"},
        perception={"detection": detection},
        robot=np.tile([SIDE_M / 2, SIDE_M / 2, turned - 30], (N, 1)),
        posture=posture,
        step_s=600,
        start_h=18,
    )
    bearing = (BEARING - turned + 180) % 360 - 180
    away = np.abs((FACING - (BEARING + 180) + 180) % 360 - 180)
    hour = (18 + np.arange(N) / 6) % 24
    expected = (
        0.95 * (1 - 0.6 * DISTANCE / 9) * (0.75 + bearing / 720) * (1 - away / 360)
        * np.where(posture[0] == 1, 0.6, 1)
        * np.interp(hour, [6, 8, 20, 22], [0.4, 1, 1, 0.4])
    )  # fmt: skip
    hits = noticed(watch)
    check_by(expected, [0.1, 0.2, 0.3, 0.4, 0.5, 0.6], hits, expected)
    check_by(bearing, [-90, -45, 0, 45, 90], hits, expected)
    check_by(hour, [2, 6, 7, 8, 14, 20, 21, 22], hits, expected)


# --- Misses in a row ------------------------------------------------------------------------------


@pytest.mark.parametrize(("memory", "period", "step_s"), [(20, 1, 1), (20, 3, 0.5), (0.8, 1, 0.1)])
def test_misses_are_correlated_with_their_time_constant(memory, period, step_s):
    """The chance to stay as before is that of a two-state Markov chain."""
    still = np.full(N, 3.0)
    watch = Watch(
        around(still, 0 * still),
        camera={"detection": 0.6, "period": f"{period * step_s} s", "lost_after": "60 s"},
        perception={"detection": {"memory": f"{memory} s"}},
        step_s=step_s,
    )
    hits = noticed(watch)[::period]
    stay = np.exp(-period * step_s / memory)
    before, after = hits[:-1], hits[1:]
    assert agree(after[before], stay + (1 - stay) * 0.6)
    assert agree(after[~before], (1 - stay) * 0.6)
    # Far apart, looks are independent, and as often as configured.
    assert agree(hits[:: int(12 * memory / (period * step_s))], 0.6)


# --- False positives ------------------------------------------------------------------------------


def ghosts(**more):
    """Return the false positives of a camera that sees up to 3 m, in a hall with nobody near."""
    camera = {"range": [1, 3], "angle_deg": 120, **more.pop("camera", {})}
    rows = Watch(around(np.full(N, 9.9), np.zeros(N)), camera=camera, **more).look()
    assert (rows[:, Column.USER] == -1).all()
    return rows


@pytest.mark.parametrize(("period", "step_s"), [(1, 1.0), (4, 0.5)])
def test_false_positives_come_at_their_rate_whatever_the_period_and_the_step(period, step_s):
    camera = {"period": f"{period * step_s} s"}
    rows = ghosts(camera=camera, perception={"false_positives": {"per_hour": 900}}, step_s=step_s)
    mean = 900 * period * step_s / 3600
    per_look = np.bincount(rows[:, Column.STEP], minlength=N)[::period]
    assert per_look.sum() == len(rows)
    for count in range(4):
        share = math.exp(-mean) * mean**count / math.factorial(count)
        assert agree(per_look == count, share)


def test_false_positives_are_uniform_over_the_view():
    rows = ghosts(perception={"false_positives": {"per_hour": 1800}}, walls=hall(PILLAR))
    offset = rows[:, [Column.X, Column.Y]] / UNITS_PER_M - SIDE_M / 2
    distance, angle = np.hypot(*offset.T), np.rad2deg(np.arctan2(offset[:, 1], offset[:, 0]))
    assert ((0.99 < distance) & (distance < 3.01) & (np.abs(angle) < 60.1)).all()
    # What is in view, by many points of the wedge.
    rng = np.random.default_rng(3)
    radius, turn = np.sqrt(rng.uniform(1, 9, 200_000)), rng.uniform(-60, 60, 200_000)
    points = around(radius, turn)[0, :, :2]
    eye = np.full_like(points, SIDE_M / 2)
    seen = ~shapely.intersects(shapely.linestrings(np.stack([eye, points], axis=1)), PILLAR)
    for (near, far), (right, left) in [
        ((1, 3), (0, 60)),
        ((1, 3), (30, 60)),
        ((1, 2), (-60, 60)),
        ((1, 2), (-60, -20)),
        ((2.3, 3), (5, 60)),
    ]:
        inside, expected = (
            (near < far_) & (far_ < far) & (right < deg) & (deg < left)
            for far_, deg in ((distance, angle), (radius[seen], turn[seen]))
        )
        assert agree(inside, expected.mean(), z=5)


def test_false_positives_at_a_spot_occur_only_while_it_is_in_view():
    robot = np.tile([SIDE_M / 2, SIDE_M / 2, 0.0], (N, 1))
    robot[N // 2 :, 2] = 180
    spots = [
        {"at": [12, 10], "per_hour": 360, "spread": 0.1},
        {"at": [10, 12.9], "per_hour": 360},  # not within 60 degrees
        {"at": [13.5, 10], "per_hour": 360},  # too far
    ]
    rows = ghosts(perception={"false_positives": {"spots": spots}}, robot=robot)
    expected = N / 2 * 0.1
    assert abs(len(rows) - expected) < 4.5 * np.sqrt(expected)
    assert (rows[:, Column.STEP] < N // 2).all()
    offset = rows[:, [Column.X, Column.Y]] / UNITS_PER_M - [12, 10]
    for axis in (0, 1):
        assert abs(offset[:, axis].mean()) < 5 * 0.1 / np.sqrt(len(rows))
        assert abs(offset[:, axis].std() / 0.1 - 1) < 5 / np.sqrt(2 * len(rows))


def test_false_positives_have_the_configured_identities():
    users = np.concatenate([around(np.full(N, 9.9), np.zeros(N))] * 3)
    perception = {"false_positives": {"per_hour": 900, "looks_like": {"cleo": 0.5, "ana": 0.2}}}
    rows = Watch(users, camera={"range": [1, 3]}, perception=perception).look()
    for identity, share in ((0, 0.2), (1, 0.0), (2, 0.5), (-1, 0.3)):
        assert agree(rows[:, Column.IDENTITY] == identity, share)


# --- Who it is taken for --------------------------------------------------------------------------


def test_users_are_recognized_mistaken_or_unknown_by_distance():
    identity = {"right": [[0, 0.9], [8, 0.3]], "mistaken": [[0, 0.05], [8, 0.4]]}
    users = np.concatenate([around(DISTANCE, BEARING)] * 2)
    rows = Watch(users, perception={"identity": identity}).look()
    rows = rows[rows[:, Column.USER] == 0]
    distance = DISTANCE[rows[:, Column.STEP]]
    right, mistaken = 0.9 - 0.6 * distance / 8, 0.05 + 0.35 * distance / 8
    edges = [2, 4, 6, 8]
    for who, share in ((0, right), (1, mistaken), (-1, 1 - right - mistaken)):
        check_by(distance, edges, rows[:, Column.IDENTITY] == who, share)


def test_users_are_mistaken_like_the_confusion_matrix():
    """No row is like a column: a transposed matrix would fail."""
    shares = {
        "ana": {"ben": 0.7, "cleo": 0.3},
        "ben": {"ana": 0.1, "dora": 0.9},
        "cleo": {"dora": 1.0},
    }
    users = np.concatenate([around(DISTANCE, BEARING)] * 4)
    perception = {"identity": {"mistaken": 0.6, "confusion": shares}}
    rows = Watch(users, perception=perception).look()
    names = ("ana", "ben", "cleo", "dora")
    shares["dora"] = dict.fromkeys(("ana", "ben", "cleo"), 1 / 3)
    for u, true in enumerate(names):
        identities = rows[rows[:, Column.USER] == u, Column.IDENTITY]
        assert (identities >= 0).all()
        for v, perceived in enumerate(names):
            share = 0.4 if u == v else 0.6 * shares[true].get(perceived, 0.0)
            assert agree(identities == v, share), (true, perceived)


# --- Where, and how -------------------------------------------------------------------------------


def polar(rows):
    """Return true distance [m], and the errors in distance [m] and bearing [deg]."""
    eye = SIDE_M / 2
    true, perceived = (
        rows[:, columns] / UNITS_PER_M - eye
        for columns in (
            [Column.TRUE_X, Column.TRUE_Y],
            [Column.X, Column.Y],
        )
    )
    bearings = [np.arctan2(xy[:, 1], xy[:, 0]) for xy in (true, perceived)]
    turn = np.rad2deg((bearings[1] - bearings[0] + np.pi) % (2 * np.pi) - np.pi)
    distance = np.hypot(*true.T)
    return distance, np.hypot(*perceived.T) - distance, turn


def check_noise(values, std):
    """Check that values are bell-shaped noise of a standard deviation, without a bias."""
    z = values / std
    n = len(z)
    assert abs(z.mean()) < 4.5 / np.sqrt(n)
    assert abs(z.std() - 1) < 4.5 / np.sqrt(2 * n) + 1e-3
    assert agree(np.abs(z) < 1, 0.6827, z=6)
    assert agree(np.abs(z) < 2, 0.9545, z=6)


def test_postures_are_confused_as_configured():
    posture = RNG.integers(0, 3, (1, N)).astype(np.int8)
    confusion = {"stand": {"sit": 0.1}, "sit": {"stand": 0.2, "lie": 0.05}}
    watch = Watch(
        around(DISTANCE, BEARING),
        perception={"attributes": {"posture": confusion}},
        posture=posture,
    )
    rows = watch.look()
    expected = [[0.9, 0.1, 0], [0.2, 0.75, 0.05], [0, 0, 1]]
    for true in range(3):
        perceived = rows[posture[0, rows[:, Column.STEP]] == true, Column.POSTURE]
        for code in range(3):
            assert agree(perceived == code, expected[true][code])


def test_noise_has_its_size_at_each_distance_and_bearing_and_heading_have_theirs():
    attributes = {
        "range_noise": "5 cm", "range_noise_share": "2 %", "bearing_noise_deg": 3,
        "heading_noise_deg": 10,
    }  # fmt: skip
    users = around(DISTANCE, BEARING, FACING)
    rows = Watch(users, perception={"attributes": attributes}).look()
    distance, error, turn = polar(rows)
    for low, high in ((0.5, 2), (2, 5), (5, 8.5)):
        inside = (low <= distance) & (distance < high)
        check_noise(error[inside], 0.05 + 0.02 * distance[inside])
    facing = rows[:, Column.HEADING] * 360 / 4096 - FACING[rows[:, Column.STEP]]
    check_noise(turn, 3.0)
    check_noise((facing + 180) % 360 - 180, 10.0)
    assert abs(np.corrcoef(error, turn)[0, 1]) < 4.5 / np.sqrt(N)


def test_a_perception_that_never_errs_perceives_the_truth():
    perception = {"identity": {"per_track": True}}
    users = np.concatenate([around(DISTANCE, BEARING, FACING)] * 2)
    rows = Watch(users, perception=perception).look()
    assert 2 * N == len(rows)
    assert (rows[:, Column.USER] == rows[:, Column.IDENTITY]).all()
    assert (rows[:, Column.X : Column.POSTURE + 1] == rows[:, Column.TRUE_X :]).all()
