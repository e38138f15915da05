import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.lattice import Lattice


def test_around_leaves_two_cells_on_every_side():
    lattice = Lattice.around((0.1, 0.1, 5.06, 5.06), 0.05)

    assert (0.0, 0.0) == lattice.origin
    assert [[128, 128], [6477, 6477]] == lattice.to_lattice([[0.1, 0.1], [5.06, 5.06]]).tolist()
    assert (104, 104) == (lattice.columns, lattice.rows)


@given(
    st.sampled_from([0.01, 0.03, 0.05, 0.1, 0.2, 0.25, 1.0]),
    st.integers(-2000, 2000),
    st.integers(-2000, 2000),
    st.integers(0, 2**19),
)
def test_to_metres_and_back_is_exact(cell, x, y, point):
    lattice = Lattice(cell, (x * cell, y * cell), 8192, 1024)
    points = np.array([point, 2**19 - point])

    assert points.tolist() == lattice.to_lattice(lattice.to_metres(points)).tolist()


def test_to_lattice_rounds_half_to_even():
    lattice = Lattice(1.0, (0.0, 0.0), 10, 10)

    halves = np.array([[0.5, 1.5], [2.5, 3.5]]) / 64

    assert [[0, 2], [2, 4]] == lattice.to_lattice(halves).tolist()


@pytest.mark.parametrize("cell", [0.01, 0.05, 0.3, 1.0])
def test_single_point_is_converted_as_arrays_are(cell):
    lattice = Lattice.around((-3.0, 2.0, 9.0, 7.0), cell)
    for x, y in np.random.default_rng(1).uniform(-3, 9, (500, 2)).tolist():
        point = lattice.point_at((x, y))
        assert lattice.to_lattice((x, y)).tolist() == list(point)
        assert lattice.to_metres(point).tolist() == list(lattice.xy_of(*point))


@pytest.mark.parametrize("cell", [0.0, 0.009, 1.01, -0.05, float("nan"), float("inf")])
def test_cell_out_of_range_is_refused(cell):
    with pytest.raises(FloorPlanError, match=r"choose a cell size from 0\.01 m to 1 m"):
        Lattice.around((0, 0, 5, 5), cell)


def test_too_large_a_plan_is_refused_with_a_cell_that_works():
    with pytest.raises(FloorPlanError, match=r"set floorplan\.cell to 0\.13 or more") as caught:
        Lattice.around((0, 0, 2000, 10), 0.05)

    assert "check that the file is in metres" in str(caught.value)
    assert Lattice.around((0, 0, 2000, 10), 0.13).columns < 2**14


def test_bounds_that_are_not_finite_are_refused():
    with pytest.raises(FloorPlanError, match="not finite"):
        Lattice.around((0, 0, float("nan"), 1), 0.05)


def test_lattice_of_more_cells_than_are_read_is_refused_with_a_cell_that_fits():
    with pytest.raises(FloorPlanError, match=r"81 million.*set floorplan.cell to 0.15 or more"):
        Lattice.around((0.0, 0.0, 450.0, 450.0), 0.05)
    assert Lattice.around((0.0, 0.0, 450.0, 450.0), 0.15).columns > 3000
