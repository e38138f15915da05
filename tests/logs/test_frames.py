"""Transforms between frames: against SciPy's rotations, and between stamps as tf2 has them."""

import numpy as np
import pytest

from fleet2d.logs.frames import FrameLink, RigidMotions

spatial = pytest.importorskip("scipy.spatial.transform", reason="SciPy is not installed")


def drawn(seed, count=50):
    numbers = np.random.default_rng(seed).normal(size=(count, 7))
    return RigidMotions.of_rows(numbers.tolist())


def matrices(motions):
    whole = np.tile(np.eye(4), (len(motions.place), 1, 1))
    whole[:, :3, :3] = spatial.Rotation.from_quat(motions.turn).as_matrix()
    whole[:, :3, 3] = motions.place
    return whole


def test_motions_after_each_other_are_products_of_matrices():
    first, then = drawn(1), drawn(2)
    np.testing.assert_allclose(
        matrices(then.after(first)), matrices(then) @ matrices(first), atol=1e-12
    )


def test_a_motion_and_its_inverse_are_none():
    motions = drawn(3)
    whole = matrices(motions.inverse().after(motions))
    np.testing.assert_allclose(whole, np.tile(np.eye(4), (50, 1, 1)), atol=1e-12)


@pytest.mark.parametrize("count", [2, 5])
def test_turns_between_stamps_are_slerped_and_places_on_a_line(count):
    motions = drawn(count, count)
    stamps = np.arange(count) * 10**9 + 7
    link = FrameLink(False, {("map", "/tf")}, stamps.tolist(), stamps.tolist())
    link.rows = np.hstack([motions.place, motions.turn]).tolist()
    time = np.linspace(stamps[0], stamps[-1], 40).astype(np.int64)

    at = link.at(time)

    turns = spatial.Rotation.from_quat(motions.turn)
    expected = spatial.Slerp(stamps - 7, turns)(time - 7)
    assert (expected.inv() * spatial.Rotation.from_quat(at.turn)).magnitude().max() < 1e-7
    for axis in range(3):
        line = np.interp(time, stamps, motions.place[:, axis])
        np.testing.assert_allclose(at.place[:, axis], line, atol=1e-9)


def test_nearly_equal_turns_are_interpolated_too():
    rows = [[0.0] * 6 + [1.0], [2.0, 0.0, 0.0, 0.0, 0.0, 1e-9, 1.0]]
    link = FrameLink(False, {("map", "/tf")}, [0, 10], [0, 10], rows)

    at = link.at(np.array([5, 10, 99]))

    assert at.place[:, 0].tolist() == [1.0, 2.0, 2.0]
    assert np.isfinite(at.turn).all()


def test_a_static_link_holds_at_all_times():
    link = FrameLink(True, {("map", "/tf_static")}, [5], [5], [[1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]])
    assert link.at(np.array([-9, 0, 9])).place[:, 0].tolist() == [1.0, 1.0, 1.0]
