"""What perception makes of what is there happens as often as configured, for every part of it.

Each `agree` fails a true model in one of 150,000 cases; draws are seeded, so none does by chance.
"""

import numpy as np
import pytest
import shapely
from tests.sight.watching import PILLAR, SIDE_M, UNITS_PER_M, Watch, agree, around, changed, hall

from fleet2d.kernels import SightingColumn as Column

N = 60_000
RNG = np.random.default_rng(0)
DISTANCE = RNG.uniform(0.5, 8.5, N)
BEARING = RNG.uniform(-180, 180, N)
FACING = RNG.uniform(-180, 180, N)


def noticed(watch, user=0):
    """Return for each step whether a user is noticed."""
    rows = watch.look()
    result = np.zeros(watch.users.shape[1], bool)
    result[rows[rows[:, Column.USER] == user, Column.STEP] - watch.first] = True
    return result


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

TABLE = [[1, 0.95], [3, 0.8], [4, 0.3], [8, 0.1]]


def test_detection_falls_with_distance_like_its_table():
    hits = noticed(Watch(around(DISTANCE, BEARING), perception={"detection": {"distance": TABLE}}))
    check_by(DISTANCE, range(1, 9), hits, np.interp(DISTANCE, *np.array(TABLE).T))


def test_detection_falls_with_distance_like_its_logistic():
    curve = {"midpoint": 4, "width": 0.6, "top": 0.9}
    hits = noticed(Watch(around(DISTANCE, BEARING), perception={"detection": {"distance": curve}}))
    check_by(DISTANCE, range(1, 9), hits, 0.9 / (1 + np.exp((DISTANCE - 4) / 0.6)))


def test_detection_can_differ_left_and_right_of_the_axis():
    """Left, counter-clockwise, is positive: a sign error would swap 0.9 and 0.2."""
    table = [[-60, 0.2], [0, 0.5], [60, 0.9]]
    watch = Watch(around(DISTANCE, BEARING), perception={"detection": {"bearing": table}})
    expected = np.interp(BEARING, *np.array(table, float).T)
    check_by(BEARING, [-90, -45, -20, 0, 20, 45, 90], noticed(watch), expected)


@pytest.mark.parametrize("heading", [90.0, 200.0])
def test_bearing_is_from_where_the_camera_looks(heading):
    robot = np.tile([SIDE_M / 2, SIDE_M / 2, heading - 30], (N, 1))
    table = [[-60, 0.1], [60, 0.9]]
    watch = Watch(
        around(DISTANCE, BEARING),
        camera={"heading_deg": 30},
        perception={"detection": {"bearing": table}},
        robot=robot,
    )
    off_axis = (BEARING - heading + 180) % 360 - 180
    expected = np.interp(off_axis, *np.array(table, float).T)
    check_by(off_axis, [-90, -45, 0, 45, 90], noticed(watch), expected)


def test_a_curve_of_bearing_without_negative_angles_is_used_for_both_sides():
    table = [[0, 0.9], [54, 0.2]]
    watch = Watch(around(DISTANCE, BEARING), perception={"detection": {"bearing": table}})
    expected = np.interp(np.abs(BEARING), *np.array(table, float).T)
    check_by(BEARING, [-90, -45, -20, 0, 20, 45, 90], noticed(watch), expected)


def test_detection_falls_as_the_user_turns_away():
    """0 degrees is a face turned to the camera, 180 a back."""
    table = [[0, 0.9], [90, 0.5], [180, 0.3]]
    watch = Watch(
        around(DISTANCE, BEARING, FACING), perception={"detection": {"orientation": table}}
    )
    away = np.abs((FACING - (BEARING + 180) + 180) % 360 - 180)
    expected = np.interp(away, *np.array(table, float).T)
    check_by(away, [30, 60, 90, 120, 150], noticed(watch), expected)


def test_detection_depends_on_posture():
    posture = RNG.integers(0, 3, (1, N)).astype(np.int8)
    shares = {"sit": 0.7, "lie": 0.2}
    watch = Watch(
        around(DISTANCE, BEARING), perception={"detection": {"posture": shares}}, posture=posture
    )
    hits = noticed(watch)
    for code, share in enumerate((1.0, 0.7, 0.2)):
        assert agree(hits[posture[0] == code], share)


def test_detection_follows_the_light_of_the_day():
    """From Monday 18:00 on, a look every ten minutes, past midnight more than once."""
    table = [[6, 0.2], [8, 1.0], [20, 1.0], [22, 0.2]]
    watch = Watch(
        around(DISTANCE, BEARING),
        perception={"detection": {"light": table}},
        step_s=600,
        start_h=18,
        camera={"lost_after": "1 h"},
    )
    hour = (18 + np.arange(N) / 6) % 24
    x, y = np.array(table).T
    expected = np.interp(hour, np.concatenate([x - 24, x, x + 24]), np.tile(y, 3))
    check_by(hour, [2, 6, 7, 8, 14, 20, 21, 22], noticed(watch), expected)


@pytest.mark.slow
def test_detection_falls_with_the_part_of_a_body_that_a_pillar_hides():
    count = 12
    users = around(RNG.uniform(3, 5, N // 4), RNG.uniform(0, 35, N // 4))
    watch = Watch(
        users,
        camera={"body_points": count},
        perception={"detection": {"visible_share": [[0, 0], [1, 0.8]]}},
        walls=hall(PILLAR),
        radius=0.3,
    )
    angles = np.linspace(0, 2 * np.pi, count, endpoint=False)
    circle = 0.3 * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    points = users[0, :, None, :2] + np.concatenate([[[0, 0]], circle])[None]
    eye = np.broadcast_to([SIDE_M / 2] * 2, points.shape)
    lines = shapely.linestrings(np.stack([eye, points], axis=-2))
    share = (~shapely.intersects(lines, PILLAR)).mean(axis=1)
    # Not in the pillar, and no line so near to a corner that the lattice decides.
    free = ~shapely.intersects(shapely.points(users[0, :, :2]), PILLAR.buffer(0.31))
    thick, thin = (shapely.intersects(lines, PILLAR.buffer(d)) for d in (0.003, -0.003))
    free &= (thick == thin).all(axis=1)
    assert 0.1 < (share[free] == 0).mean() < 0.9
    assert ((share[free] > 0) & (share[free] < 1)).mean() > 0.05
    hits = noticed(watch)
    check_by(share[free], [0.01, 0.3, 0.6, 0.99], hits[free], 0.8 * share[free])


def test_all_factors_multiply():
    posture = RNG.integers(0, 2, (1, N)).astype(np.int8)
    detection = {
        "distance": [[0, 1], [9, 0.4]],
        "bearing": [[-180, 0.5], [180, 1]],
        "orientation": [[0, 1], [180, 0.5]],
        "posture": {"sit": 0.6},
        "light": 0.9,
    }
    watch = Watch(
        around(DISTANCE, BEARING, FACING),
        camera={"detection": 0.95},
        perception={"detection": detection},
        posture=posture,
    )
    away = np.abs((FACING - (BEARING + 180) + 180) % 360 - 180)
    expected = (
        0.95 * 0.9 * (1 - 0.6 * DISTANCE / 9) * (0.75 + BEARING / 720) * (1 - away / 360)
        * np.where(posture[0] == 1, 0.6, 1)
    )  # fmt: skip
    check_by(expected, [0.1, 0.2, 0.3, 0.4, 0.5, 0.6], noticed(watch), expected)


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


def test_attention_fades_while_a_user_is_out_of_view():
    """Looks come in pairs a second apart, with gaps of 30 s."""
    distance = np.full(N, 50.0)
    distance[::31] = distance[1::31] = 3
    watch = Watch(
        around(np.minimum(distance, 9.5), 0 * distance),
        camera={"detection": 0.5, "range": [0, 9]},
        perception={"detection": {"memory": "30 s"}},
    )
    hits = noticed(watch)
    first, second, following = hits[:-31:31], hits[1:-31:31], hits[31::31]
    for before, after, gap in ((first, second, 1), (second, following, 30)):
        stay = np.exp(-gap / 30)
        assert agree((before == after[: len(before)]), stay + (1 - stay) * 0.5)


def test_misses_of_two_users_are_independent():
    still = np.full(N, 3.0)
    users = np.concatenate([around(still, 0 * still), around(still, 90 + 0 * still)])
    watch = Watch(users, camera={"detection": 0.5}, perception={"detection": {"memory": "1 s"}})
    rows = watch.look()
    ana, ben = (
        np.bincount(rows[rows[:, Column.USER] == u, Column.STEP], minlength=N) for u in (0, 1)
    )
    apart = slice(None, None, 12)
    assert agree(ana[apart] * ben[apart], 0.25)


# --- False positives ------------------------------------------------------------------------------

NOBODY_THERE = around(np.full(N, 9.9), np.zeros(N))


def ghosts(**more):
    """Return the false positives of a camera that sees up to 3 m, in a hall with nobody near."""
    camera = {"range": [1, 3], "angle_deg": 120, **more.pop("camera", {})}
    rows = Watch(NOBODY_THERE, camera=camera, **more).look()
    assert (rows[:, Column.USER] == -1).all()
    return rows


def test_false_positives_come_at_their_rate():
    rows = ghosts(perception={"false_positives": {"per_hour": 900}})
    assert abs(len(rows) - N * 0.25) < 4.5 * np.sqrt(N * 0.25)
    per_step = np.bincount(rows[:, Column.STEP], minlength=N)
    for count, share in enumerate((0.7788, 0.1947, 0.02434, 0.002028)):
        assert agree(per_step == count, share)


def test_false_positives_come_at_their_rate_whatever_the_period_and_the_step():
    rows = ghosts(
        camera={"period": "2 s"}, perception={"false_positives": {"per_hour": 900}}, step_s=0.5
    )
    expected = N * 0.5 / 3600 * 900
    assert abs(len(rows) - expected) < 4.5 * np.sqrt(expected)
    assert (rows[:, Column.STEP] % 4 == 0).all()


def test_false_positives_are_uniform_over_the_view():
    rows = ghosts(perception={"false_positives": {"per_hour": 1800}}, walls=hall(PILLAR))
    xy = rows[:, [Column.X, Column.Y]] / UNITS_PER_M
    eye = np.array([SIDE_M / 2] * 2)
    offset = xy - eye
    distance, angle = np.hypot(*offset.T), np.rad2deg(np.arctan2(offset[:, 1], offset[:, 0]))
    assert (1 - 1e-2 < distance).all()
    assert (distance < 3 + 1e-2).all()
    assert (np.abs(angle) < 60.1).all()
    # What is in view, by many points of the wedge.
    rng = np.random.default_rng(3)
    radius, turn = np.sqrt(rng.uniform(1, 9, 200_000)), np.deg2rad(rng.uniform(-60, 60, 200_000))
    points = eye + radius[:, None] * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    lines = shapely.linestrings(np.stack([np.broadcast_to(eye, points.shape), points], axis=1))
    seen = ~shapely.intersects(lines, PILLAR)
    points, radius, turn = points[seen], radius[seen], np.rad2deg(turn[seen])
    for inside, area in (
        (angle > 0, turn > 0),
        (angle > 30, turn > 30),
        (distance < 2, radius < 2),
        ((distance < 2) & (angle < -20), (radius < 2) & (turn < -20)),
        ((distance > 2.3) & (angle > 5), (radius > 2.3) & (turn > 5)),
    ):
        assert agree(inside, area.mean(), z=5)


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
    users = np.concatenate([NOBODY_THERE] * 3)
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


def test_the_only_user_is_mistaken_for_nobody_known():
    rows = Watch(around(DISTANCE, BEARING), perception={"identity": {"mistaken": 0.3}}).look()
    assert agree(rows[:, Column.IDENTITY] == -1, 0.3)


def test_an_identity_lasts_as_long_as_its_track():
    """In view for 20 steps, then out of view for 10: the track is over after 5."""
    distance = np.where(np.arange(N) % 30 < 20, 3.0, 9.9)
    users = np.concatenate([around(distance, 0 * distance)] * 2)
    perception = {"identity": {"mistaken": 0.4, "per_track": True}}
    rows = Watch(users, perception=perception).look()
    rows = rows[rows[:, Column.USER] == 0]
    identities = rows[:, Column.IDENTITY].reshape(-1, 20)
    assert (identities == identities[:, :1]).all()
    assert agree(identities[:, 0] == 1, 0.4)


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


def test_range_noise_grows_with_distance():
    attributes = {"range_noise": "5 cm", "range_noise_share": "2 %"}
    rows = Watch(around(DISTANCE, BEARING), perception={"attributes": attributes}).look()
    distance, error, turn = polar(rows)
    for low, high in ((0.5, 2), (2, 5), (5, 8.5)):
        inside = (low <= distance) & (distance < high)
        check_noise(error[inside], 0.05 + 0.02 * distance[inside])
    assert np.abs(turn).max() < 0.15  # a lattice unit at half a metre


def test_bearing_noise_turns_and_does_not_stretch():
    rows = Watch(
        around(DISTANCE, BEARING), perception={"attributes": {"bearing_noise_deg": 3}}
    ).look()
    _, error, turn = polar(rows)
    check_noise(turn, 3.0)
    assert np.abs(error).max() < 2 / UNITS_PER_M


def test_range_and_bearing_noise_are_independent():
    attributes = {"range_noise": 0.1, "bearing_noise_deg": 2}
    rows = Watch(around(DISTANCE, BEARING), perception={"attributes": attributes}).look()
    _, error, turn = polar(rows)
    assert abs(np.corrcoef(error, turn)[0, 1]) < 4.5 / np.sqrt(N)


def test_heading_noise_is_that_configured():
    watch = Watch(
        around(DISTANCE, BEARING, FACING), perception={"attributes": {"heading_noise_deg": 10}}
    )
    rows = watch.look()
    turn = (rows[:, Column.HEADING] * 360 / 4096 - FACING[rows[:, Column.STEP]] + 180) % 360 - 180
    check_noise(turn, 10.0)


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


# --- Together -------------------------------------------------------------------------------------

EVERYTHING = {
    "detection": {
        "distance": {"midpoint": 6, "width": 1},
        "bearing": [[-180, 0.6], [180, 1]],
        "orientation": [[0, 1], [180, 0.7]],
        "light": [[0, 0.5], [12, 1]],
        "memory": "10 s",
    },
    "false_positives": {"per_hour": 60, "spots": [{"at": [12, 12], "per_hour": 60}]},
    "identity": {"right": 0.8, "mistaken": 0.1, "per_track": True},
    "attributes": {"range_noise": 0.05, "bearing_noise_deg": 1, "heading_noise_deg": 5},
}


def test_a_perception_that_never_errs_perceives_the_truth():
    perception = {"identity": {"per_track": True}}
    users = np.concatenate([around(DISTANCE, BEARING, FACING)] * 2)
    rows = Watch(users, perception=perception).look()
    assert 2 * N == len(rows)
    assert (rows[:, Column.USER] == rows[:, Column.IDENTITY]).all()
    assert (rows[:, Column.X : Column.POSTURE + 1] == rows[:, Column.TRUE_X :]).all()


def test_spans_do_not_change_perception():
    users = np.concatenate([around(DISTANCE, BEARING, FACING)] * 2)[:, :2000]
    whole = Watch(users, perception=EVERYTHING, camera={"latency": "3 s"})
    expected = whole.look()
    parts, memory = [], None
    for begin, end in ((0, 1), (1, 700), (700, 705), (705, 2000)):
        part = changed(whole, users=users[:, begin:end], first=begin)
        part.memory = memory
        parts.append(part.look())
        memory = part.memory
    assert expected.tolist() == np.concatenate(parts).tolist()


def test_a_user_more_changes_nothing_of_the_others():
    perception = {**EVERYTHING, "identity": {"mistaken": 0.1, "confusion": {"ana": {"ben": 1}}}}
    three = np.concatenate([around(DISTANCE, BEARING, FACING)] * 3)[:, :3000]
    rows = Watch(three, perception=perception).look()
    fewer = Watch(three[:2], perception=perception).look()
    for user in (0, -1):
        assert (
            rows[rows[:, Column.USER] == user].tolist()
            == fewer[fewer[:, Column.USER] == user].tolist()
        )
