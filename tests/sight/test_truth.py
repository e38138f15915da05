"""Sight lines and visible areas against those that somebody else computed, and what must never be.

The truth files tell verdicts and areas on the polygons of the published simulator, in its pixels,
from an independent exact line of sight in NumPy.
"""

import json

import numpy as np
import pytest
from shapely.geometry import Polygon
from tests.meshed_homes import SUB, home_of

from fleet2d.floorplan.mesh import snap_polygon
from fleet2d.kernels import line_of_sight, locate, region_outline, visible_region

# A user's position is rounded by at most half a lattice unit on each axis.
MARGIN_PX = 1


def truths(shared_data):
    """Yield each truth file, and its home: a pixel is 64 lattice units."""
    paths = sorted((shared_data / "truth").glob("truth_*.json"))
    assert len(paths) == 3
    for path in paths:
        truth = json.loads(path.read_text())
        yield truth, home_of(snap_polygon(Polygon(SUB * np.array(truth["fp_polygon_px"]))).polygons)


def lattice(x, y):
    """Return the lattice point of a position in pixels."""
    return round(x * SUB), round(y * SUB)


def area_px2(home, x, y):
    """Return the area visible from a lattice point, in square pixels; 0 in a wall."""
    _, area = region_outline(home.mesh, x, y, *visible_region(home.mesh, x, y))
    return area / SUB**2


@pytest.mark.parametrize(
    ("verdict", "margin", "eye_of"),
    [
        ("exact_los_from_source", "exact_los_margin_px", lambda row: row["source_cell"]),
        (
            "exact_los_from_robot",
            "exact_los_robot_margin_px",
            lambda row: (row["robot"]["x"], row["robot"]["y"]),
        ),
    ],
)
def test_verdicts_are_the_true_ones(shared_data, verdict, margin, eye_of):
    compared = 0
    for truth, home in truths(shared_data):
        for row in truth["tuples"]:
            if row[margin] < MARGIN_PX:
                continue
            eye, point = lattice(*eye_of(row)), lattice(row["user"]["x"], row["user"]["y"])
            seen = line_of_sight(home.mesh, *eye, locate(home.mesh, *eye), *point)
            assert row[verdict] == seen, (truth["id"], row)
            assert row[verdict] == line_of_sight(home.mesh, *point, locate(home.mesh, *point), *eye)
            compared += 1
    assert compared > 750


def test_areas_are_the_true_ones_and_not_smaller(shared_data):
    # They shy away from corners by 1e-7 or so of a turn; ours were never the smaller.
    for truth, home in truths(shared_data):
        for row in truth["visibility_polygons"]:
            area = area_px2(home, *lattice(*row["source"]))
            assert row["exact_area_px2"] == pytest.approx(area, rel=2e-7)
            assert row["exact_area_px2"] < area
