"""Glass is seen through and not walked through; outer windows show nothing."""

import numpy as np
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.reference.line_of_sight import visible
from tests.thorough import examples

import fleet2d
from fleet2d.floorplan.home import Home
from fleet2d.floorplan.load import save_floorplan
from fleet2d.floorplan.placed_objects import PlacedObject
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.floorplan.rooms.doorways import DoorLine
from fleet2d.kernels import line_of_sight, locate, points_in_sight

LEFT, RIGHT = shapely.box(0, 0, 4, 5), shapely.box(4.1, 0, 8, 5)
DOOR, PANE = shapely.box(4, 4, 4.1, 4.9), shapely.box(4, 1, 4.1, 3)
FREE = shapely.union_all([LEFT, RIGHT, DOOR])
WITHOUT_DOOR = shapely.MultiPolygon([LEFT, RIGHT])


def office(free=FREE, **parts):
    doors = [DoorLine((4.05, 4), (4.05, 4.9))] if free is FREE else None
    return FloorPlan.build("office", free, **{"glass": [PANE], "doorways": doors, **parts})


def stored(plan, folder):
    """Return the floor plan of a scenario that reads a plan."""
    path = folder / f"{plan.digest[:8]}.json"
    save_floorplan(plan, path)
    return {"type": "native", "path": str(path)}


def walls_of(shape):
    """Return the sides of a shape [lattice], int64 (n, 4), computed without the core."""
    rings = [np.asarray(ring.coords, np.int64) for ring in shapely.get_rings(shape)]
    return np.concatenate([np.concatenate([ring[:-1], ring[1:]], axis=1) for ring in rings])


def sees(home, eye, point):
    (x, y), at = home.plan.lattice.point_at(eye), home.plan.lattice.point_at(point)
    return bool(line_of_sight(home.walls, x, y, locate(home.walls, x, y), *at))


@settings(max_examples=examples(40))
@given(st.integers(0, 2**32))
def test_views_through_glass_are_those_of_the_slow_reference(seed):
    rng = np.random.default_rng(seed)
    low, high = sorted(rng.integers(4, 70, 2).tolist())
    pane = shapely.box(3.9, low / 20, 4.3, (high + 4) / 20)
    plan = office(
        shapely.union_all([LEFT, shapely.Polygon([(4.1, 0), (8, 0), (8, 5), (4.3, 5)])]),
        glass=[pane],
    )
    eye, *points = plan.lattice.to_lattice(rng.uniform((0.1, 0.1), (7.9, 4.9), (40, 2)))
    sight = shapely.union_all([*plan.polygons, *plan.glass])

    seen = points_in_sight(plan.sight_mesh, *eye.tolist(), np.array(points))

    snapped = shapely.set_precision(sight, 2)
    assert visible(walls_of(snapped), eye, np.array(points)).tolist() == seen.tolist()


def test_robot_sees_through_glass_and_drives_round_it():
    home = Home(office())
    space, point_at = home.space(0.15), home.plan.lattice.point_at
    route = space.route(point_at((3.0, 2.0)), point_at((5.0, 2.0)))

    assert sees(home, (1, 2), (7, 2))
    assert not sees(home, (1, 0.5), (7, 0.5))
    assert route[:, 1].max() > point_at((0, 4))[1]
    assert [] == list(home.plan.notes)


def test_bodies_on_the_border_of_their_space_get_inside_on_their_side_of_the_glass():
    home = Home(office(WITHOUT_DOOR))
    (x, y), beyond = (home.plan.lattice.point_at(at) for at in ((3.9, 2), (4.3, 2)))

    assert sees(home, (3.9, 2), (4.3, 2))
    assert not line_of_sight(home.barriers, x, y, locate(home.barriers, x, y), *beyond)
    assert home.space(0.15).walls is home.barriers


def test_person_behind_glass_is_observed_and_behind_a_wall_is_not(tmp_path):
    def sightings(plan):
        run = fleet2d.run(
            {
                "floorplan": stored(plan, tmp_path),
                "simulation": {"duration": {"minutes": 5}, "seed": 1},
                "users": {"u": {"start": [5.5, 2], "type": "live"}},
                "robots": {
                    "r": {
                        "start": [2, 2],
                        "start_heading_deg": 0,
                        "behaviors": [],
                        "camera": {},
                    }
                },
            }
        )
        return len(run.polars("observations"))

    assert sightings(office(WITHOUT_DOOR)) > 200
    assert 0 == sightings(office(WITHOUT_DOOR, glass=[]))


def test_tall_furniture_and_shut_doors_hide_what_is_behind_them():
    plan = office(objects=[PlacedObject("", "wardrobe", shapely.box(3.2, 0.9, 3.8, 3.1), "sight")])
    behind = Home(plan, plan.doorways)
    assert not sees(behind, (1, 2), (7, 2))

    home = Home(office(), office().doorways)
    home.set_door(0, is_open=False)
    assert not sees(home, (3.5, 4.45), (5, 4.45))
    assert sees(home, (1, 2), (7, 2))


def test_outer_windows_and_glass_off_walls_are_noted_and_change_nothing():
    outer, free = shapely.box(8, 1, 8.2, 2), shapely.box(1, 1, 1.2, 2)
    plan = office(glass=[outer, free])

    assert plan == office(glass=[])
    assert plan.sight_mesh is plan.mesh
    assert Home(plan).barriers is Home(plan).walls
    assert any("the glass at (1.10, 1.50) m is in no wall" in note for note in plan.notes)
    assert "windows in outer walls, through which nobody is seen: 1" in plan.notes
