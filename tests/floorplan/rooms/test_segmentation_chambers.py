"""Free space cut at passages."""

import numpy as np
import shapely

from fleet2d.floorplan.lattice import Lattice
from fleet2d.floorplan.mesh import build_mesh
from fleet2d.floorplan.rooms.segmentation import cut_chambers
from fleet2d.kernels import rasterize_cells

LATTICE = Lattice(0.05, (0.0, 0.0), 120, 60)
M = int(LATTICE.units_per_m)


def cut(*xs, width_m=6.0):
    """Cut a box 2 m deep and `width_m` wide at lines across it, at these places [lattice]."""
    box = shapely.box(0, 0, width_m * M, 2 * M)
    mesh = build_mesh([box], LATTICE.columns, LATTICE.rows)
    free = rasterize_cells(mesh, LATTICE.rows, LATTICE.columns) >= 0
    lines = [((x, 0), (x, 2 * M)) for x in xs]
    chambers = cut_chambers(LATTICE, [box], mesh, free, lines)
    assert np.array_equal(free, chambers.of_cell >= 0)
    return chambers


def sizes(chambers):
    cells = np.bincount(chambers.of_cell[chambers.of_cell >= 0])
    return (cells * LATTICE.cell**2).round(2).tolist()


def test_space_without_passages_is_one_chamber():
    assert [12.0] == sizes(cut())


def test_passages_cut_space_into_chambers_that_are_linked_in_the_order_of_the_lines():
    chambers = cut(4 * M, 2 * M)
    assert [4.0, 4.0, 4.0] == sizes(chambers)
    assert [(0, (1, 2)), (1, (0, 1))] == [(link.line, link.chambers) for link in chambers.links]


def test_sliver_between_two_passages_belongs_to_a_chamber_beside_it():
    chambers = cut(2 * M, 2 * M + M // 10)
    assert [4.2, 7.8] == sizes(chambers)
    assert [(0, 1)] == [link.chambers for link in chambers.links]
