"""The kernel's tables hold what the settings say, at the entry at which the kernel looks it up."""

import numpy as np
import pytest
from tests.sight.watching import LATTICE, UNITS_PER_M, scene

import fleet2d.kernels as k
from fleet2d.errors import ScenarioError
from fleet2d.sight.camera import Camera, error_tables, is_perfect, stack_lenses
from fleet2d.sight.perception import Perception

USERS = ("ana", "ben", "cleo")


def tables(perception, users=USERS, **camera):
    """Return the tables of one camera."""
    lens = Camera.model_validate(camera).lens(UNITS_PER_M, 10**6)
    return error_tables([lens], [Perception.model_validate(perception)], scene(users))


def shares(error_tables, begin, count):
    return error_tables.table[0, begin : begin + count] / k.ONE


@pytest.mark.parametrize("farthest", [0.3, 1.0, 4.5, 12.8, 100.0])
def test_distances_up_to_the_farthest_body_have_an_entry(farthest):
    """The entry of a distance in lattice units holds the curve within an entry's width of there."""
    curve = {"midpoint": farthest / 2, "width": farthest / 10}
    error_tables = tables({"detection": {"distance": curve}}, range=[0, farthest], body_points=4)
    shift = int(error_tables.table[0, k.TablePart.SHIFT])
    reach = round(farthest * UNITS_PER_M) + 257
    assert reach >> shift < k.BINS
    assert farthest < 0.5 or reach >> shift >= k.BINS // 2 - 1  # none is wasted
    for metres in np.linspace(0, farthest, 50):
        entry = round(metres * UNITS_PER_M) >> shift
        expected = 1 / (1 + np.exp((metres - farthest / 2) / (farthest / 10)))
        slope = (1 << shift) / UNITS_PER_M / (farthest / 10) / 4
        assert expected == pytest.approx(shares(error_tables, entry, 1)[0], abs=slope + 1e-9)


def test_bearings_left_are_behind_the_middle_of_their_table():
    error_tables = tables({"detection": {"bearing": [[-90, 0], [90, 1]]}})
    at = shares(error_tables, k.TablePart.BEARING, 4096)
    assert [0, 0.25, 0.5, 0.75, 1] == pytest.approx(
        at[[0, 1536, 2048, 2560, 4095]].tolist(), abs=1e-9
    )


def test_bearings_without_a_sign_equal_both_sides():
    at = shares(tables({"detection": {"bearing": [[0, 1], [180, 0]]}}), k.TablePart.BEARING, 4096)
    assert at[1:2048].tolist() == at[2049:][::-1].tolist()


def test_light_is_by_minute_and_orientation_by_the_turn():
    error_tables = tables(
        {"detection": {"light": [[0, 0], [24, 1]], "orientation": [[0, 1], [180, 0]]}}
    )
    facing = shares(error_tables, k.TablePart.FACING, 2049)
    assert [1, 0.5, 0] == pytest.approx(facing[[0, 1024, 2048]].tolist(), abs=1e-9)
    assert 0.5 == pytest.approx(shares(error_tables, k.TablePart.LIGHT, 1440)[720], abs=1e-3)


def test_shares_of_a_body_are_by_the_number_of_points_in_view():
    curve = {"detection": {"visible_share": [[0, 0], [1, 1]]}}
    by_points = shares(tables(curve, body_points=3), k.TablePart.SHOWN, 5)
    assert [0, 0.25, 0.5, 0.75, 1] == pytest.approx(by_points.tolist(), abs=1e-9)


def test_confusions_are_cumulative_and_end_at_1():
    error_tables = tables(
        {"identity": {"mistaken": 0.5, "confusion": {"ana": {"ben": 0.3, "cleo": 0.7}}}}
    )
    confusion = error_tables.confusion[0] / k.ONE
    assert [0, 0.3, 1] == pytest.approx(confusion[0].tolist(), abs=1e-9)
    assert [0.5, 0.5, 1] == pytest.approx(confusion[1].tolist(), abs=1e-9)
    assert (
        k.ONE == error_tables.confusion[0, 0, 2] == error_tables.confusion[0, 2, 1]
    )  # thirds, too, end at 1


def test_memory_outlasts_twice_the_steps_with_the_square_of_the_probability():
    stay = shares(tables({"detection": {"memory": "10 s"}}), k.TablePart.STAY, k.DOUBLINGS)
    assert np.exp(-0.1) == pytest.approx(stay[0], abs=1e-9)
    assert stay[:4] ** 2 == pytest.approx(stay[1:5], abs=1e-8)
    assert 0 == stay[-1]


def test_numbers_of_false_positives_are_poissons():
    error_tables = tables({"false_positives": {"per_hour": 1800}})
    mean = 0.5
    assert np.exp(-mean) == pytest.approx(error_tables.ghosts[0, 0] / k.ONE, abs=1e-9)
    assert np.exp(-mean) * (1 + mean) == pytest.approx(error_tables.ghosts[0, 1] / k.ONE, abs=1e-9)
    assert (np.diff(error_tables.ghosts[0]) >= 0).all()


def test_cameras_without_false_positives_are_not_haunted():
    assert 0 == tables({"false_positives": {"per_hour": 0, "spots": []}}).has_ghosts[0]
    spot = {"at": [1, 2], "per_hour": 3}
    error_tables = tables({"false_positives": {"spots": [spot]}})
    assert 1 == error_tables.has_ghosts[0]
    assert 0 == error_tables.source[0, 0]  # nothing appears just anywhere
    assert LATTICE.to_lattice((1.0, 2.0)).tolist() == error_tables.spot[0, 1, :2].tolist()


def test_a_home_of_one_user_or_of_none_has_nobody_to_be_mistaken_for():
    assert [[k.ONE]] != tables({"identity": {"mistaken": 1}}, ("ana",)).confusion[0].tolist()
    assert (1, 0, 0) == tables({"identity": {"mistaken": 1}}, ()).confusion.shape


def test_probabilities_that_add_up_to_more_than_1_somewhere_are_refused_with_the_place():
    identity = {"right": [[0, 0.5], [4, 0.9]], "mistaken": 0.3}
    with pytest.raises(ScenarioError, match=r"at 2\.\d+ m, right \(0\.7"):
        tables({"identity": identity})


def test_where_no_camera_errs_the_tables_are_empty():
    lens = Camera().lens(UNITS_PER_M, 10**6)
    assert 1 == error_tables([lens], [None], scene()).table.size


def test_only_an_empty_perception_is_perfect():
    assert is_perfect(None)
    assert is_perfect(Perception.model_validate({"detection": {"distance": 1, "posture": {}}}))
    assert not is_perfect(Perception.model_validate({"attributes": {"activity": {}}}))
    assert not is_perfect(Perception.model_validate({"detection": {"memory": "1 s"}}))


def test_lenses_of_several_cameras_are_padded_to_one_shape():
    cameras = [{"body_points": 4, "range": [0, 2]}, {"pan": {"headings_deg": [0, 90]}}]
    lenses = [Camera.model_validate(camera).lens(UNITS_PER_M, 10**6) for camera in cameras]
    stacked = stack_lenses(lenses, [True, False], scene())
    assert (2, 3, 5, 2) == stacked.bodies.shape
    assert [256, 0, -256, 0] == stacked.bodies[0, 0, 1:, 0].tolist()
    assert [257, 0] == stacked.reach[:, 0].tolist()
    assert [(2 * UNITS_PER_M + 257) ** 2, round(4.5 * UNITS_PER_M) ** 2] == stacked.widest[
        :, 0
    ].tolist()
    assert [[0, 0], [0, 1024]] == stacked.pans.tolist()
    assert [0, 1] == stacked.moves.tolist()
