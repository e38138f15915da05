"""The methods of fields of view: one answer, whatever is precomputed, kept or shared."""

import gc
import tracemalloc

import numpy as np
import pytest
import shapely
from tests.scenes import flat_path

import fleet2d
from fleet2d.configuration.components import components
from fleet2d.errors import InputError
from fleet2d.floorplan.home import Home
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.floorplan.rooms.doorways import DoorLine
from fleet2d.kernels import SUB, Reach
from fleet2d.sight import cached_fov
from fleet2d.sight.cached_fov import Flashlight, VisibilityPolygon
from fleet2d.sight.fov import FieldOfView, LineOfSight

POINTS = 300


@pytest.fixture(scope="module")
def home():
    return Home(fleet2d.load_floorplan(flat_path()))


def exact_methods():
    """The methods that answer for any point."""
    return [
        LineOfSight(),
        VisibilityPolygon(),
        VisibilityPolygon(keep=1),
        VisibilityPolygon(precompute="all"),
    ]


def some_poses(home, count):
    """Poses at the centres of cells, beside them, in walls and outside."""
    rng = np.random.default_rng(5)
    cells = np.argwhere(home.plan.free)
    poses = []
    for row, column in rng.choice(cells, count).tolist():
        x, y = home.plan.lattice.cell_centre(row, column)
        dx, dy = rng.choice([0, 0, 1, -31, 17, 400], 2).tolist()
        poses.append((x + dx, y + dy, int(rng.integers(0, 4096))))
    return [*poses, (0, 0, 0), (-5, 9, 100)]


def some_reaches():
    return [Reach(0, 3000**2, 1229), Reach(200**2, 6000**2, 3000), Reach(0, 10**10, 4096)]


def test_methods_agree_on_every_point(home):
    rng = np.random.default_rng(6)
    low, high = (0, 0), (SUB * home.plan.lattice.columns, SUB * home.plan.lattice.rows)
    methods = exact_methods()
    for method in methods:
        method.start(home)
    seen = 0
    for pose in some_poses(home, 25):
        corners = rng.choice(home.plan.mesh.vertices, POINTS)
        points = np.concatenate(
            [rng.integers(low, high, (POINTS, 2)), corners, 2 * corners - pose[:2]]
        )
        for reach in some_reaches():
            answers = [method.sees(home, *pose, reach, points) for method in methods]
            for method, answer in zip(methods[1:], answers[1:], strict=True):
                assert np.array_equal(answers[0], answer), (method, pose, reach)
            seen += int(answers[0].sum())
    assert seen > 1000


def test_methods_agree_on_cells_and_flashlight_on_their_centres(home):
    flashlight = Flashlight()
    rows, columns = np.indices(home.plan.free.shape)
    centres = np.stack([columns.ravel(), rows.ravel()], axis=1).astype(np.int64) * SUB + 33
    for pose in some_poses(home, 6):
        for reach in some_reaches():
            expected = LineOfSight().cells(home, *pose, reach)
            for method in (*exact_methods(), flashlight):
                assert np.array_equal(expected, method.cells(home, *pose, reach)), method
            in_view = flashlight.sees(home, *pose, reach, centres)
            assert np.array_equal(expected.ravel(), in_view)
            nearby = centres + np.random.default_rng(1).integers(-33, 31, centres.shape)
            assert np.array_equal(in_view, flashlight.sees(home, *pose, reach, nearby))


def test_flashlight_stays_within_its_memory_and_gives_the_same_results(home, monkeypatch):
    small = Flashlight()
    large = Flashlight()
    poses = some_poses(home, 60)
    reach = some_reaches()[0]
    for pose in (*poses, *poses[:5]):
        expected = large.cells(home, *pose, reach)
        with monkeypatch.context() as limited:
            limited.setattr(cached_fov, "MEMORY_BYTES", 10_000)
            assert np.array_equal(expected, small.cells(home, *pose, reach))
        assert small._bytes <= 10_000
    assert 1 <= len(small._cache) < len(large._cache) <= len(set(poses))


def test_every_method_follows_a_door():
    free = shapely.union_all(
        [shapely.box(0, 0, 2, 3), shapely.box(2.1, 0, 5, 3), shapely.box(2, 1, 2.1, 1.9)]
    )
    plan = FloorPlan.build("two", free, doorways=[DoorLine((2.05, 1.0), (2.05, 1.9))])
    home = Home(plan, plan.doorways)
    methods = [
        LineOfSight(), VisibilityPolygon(), VisibilityPolygon(precompute="all"), Flashlight(),
    ]  # fmt: skip
    (eye, point) = plan.lattice.to_lattice([(1.025, 1.425), (3.025, 1.475)]) // SUB * SUB + 33
    for is_open in (True, False, True):
        home.set_door(0, is_open=is_open)
        for method in methods:
            assert [is_open] == method.visible(home, *eye.tolist(), point[None]).tolist(), method


@pytest.mark.parametrize(
    ("settings", "why"),
    [
        ({"type": "visibility_polygon", "precompute": "al"}, "visited"),
        ({"type": "visibility_polygon", "keep": 0}, "keep"),
        ({"type": "flash_light"}, "did you mean 'flashlight'"),
        ({"type": "flashlight", "keep": 4}, "keep"),
    ],
)
def test_wrong_method_is_an_error_that_names_the_key(settings, why):
    with pytest.raises(InputError, match=why) as caught:
        fleet2d.load_scenario("bundled:paper", sight={"method": settings})
    assert "sight.method" in str(caught.value)


class XRay(FieldOfView):
    """A user's own method, for which walls don't count."""

    def visible(self, home, x, y, points):
        return np.ones(len(points), np.bool_)


def test_own_method_needs_only_visible(home):
    pose, reach = some_poses(home, 1)[0], some_reaches()[0]
    cells = XRay().cells(home, *pose, reach)

    assert cells.sum() > LineOfSight().cells(home, *pose, reach).sum()
    assert {"flashlight", "line_of_sight", "visibility_polygon"} <= set(components("sight"))


def test_flashlight_uses_the_memory_that_it_reports(home):
    flashlight, reach = Flashlight(), Reach(0, 5760**2, 1229)
    poses = [(x, y, heading) for x, y, heading in some_poses(home, 400) if x > 0]
    flashlight.cells(home, *poses[0], reach)
    gc.collect()  # empties Python's stock of freed tuples, which nobody would see being taken again
    tracemalloc.start()
    for pose in poses:
        flashlight.cells(home, *pose, reach)
    bytes_used, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()

    assert bytes_used == pytest.approx(flashlight._bytes, rel=0.15)
