"""Random free space for property tests, with the degenerate cases that real homes are full of."""

import shapely
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from shapely.geometry import Polygon
from tests.thorough import examples

GRID = 2
"""Walls lie on even lattice units."""
STEP = 64
"""Corners of random homes lie on a coarse raster, so that many are in line and many rings touch."""

quick = settings(
    max_examples=examples(60),
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.filter_too_much],
)
"""For property tests over homes: enough examples to hit what is odd, few enough for every run."""


def _parts(shape: shapely.Geometry) -> list[Polygon]:
    parts = [part for part in shapely.get_parts(shape) if part.geom_type == "Polygon"]
    return [part for part in parts if part.area > 0]


@st.composite
def _boxes(draw: st.DrawFn, least: int) -> shapely.Geometry:
    cell = st.tuples(*[st.integers(2, 9)] * 2, *[st.integers(1, 5)] * 2)
    corners = draw(st.lists(cell, min_size=least, max_size=6))
    boxes = [shapely.box(x, y, x + width, y + height) for x, y, width, height in corners]
    return shapely.union_all([shapely.transform(box, lambda xy: xy * STEP) for box in boxes])


@st.composite
def _blobs(draw: st.DrawFn, least: int) -> shapely.Geometry:
    even = st.integers(STEP, 7 * STEP).map(lambda value: value * GRID)
    corner = st.tuples(even, even)
    outlines = draw(st.lists(st.lists(corner, min_size=3, max_size=5), min_size=least, max_size=4))
    hulls = [shapely.convex_hull(shapely.multipoints(outline)) for outline in outlines]
    return shapely.union_all([hull for hull in hulls if hull.area > 0], grid_size=GRID)


@st.composite
def rectilinear_homes(draw: st.DrawFn) -> list[Polygon]:
    """Free space of boxes minus boxes: holes, several parts, rings that touch at corners."""
    home = shapely.difference(draw(_boxes(1)), draw(_boxes(0)), grid_size=GRID)
    return _parts(home)


@st.composite
def lattice_homes(draw: st.DrawFn) -> list[Polygon]:
    """Free space of convex shapes minus convex shapes, with walls at any angle."""
    home = shapely.difference(draw(_blobs(1)), draw(_blobs(0)), grid_size=GRID)
    return _parts(home)


def homes() -> st.SearchStrategy[list[Polygon]]:
    """Free space of either kind; never empty."""
    return st.one_of(rectilinear_homes(), lattice_homes()).filter(bool)


def seeds() -> st.SearchStrategy[int]:
    """Seeds for what hypothesis would draw too slowly, such as many points."""
    return st.integers(0, 2**32 - 1)
