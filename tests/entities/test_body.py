"""Bodies keep their distance from walls, their speed and their turn rate, whatever they do."""

import numpy as np
import pytest
import shapely
from tests.scenes import OWN, everything, path, run, scenario

import fleet2d

# What rounding to the lattice (0.8 mm) and to a step may add.
LATTICE_M = 2e-3


def free_space(stored):
    """The space between the walls [m], as shapely has it."""
    lattice = stored.plan.lattice
    return shapely.union_all(
        [shapely.transform(p, lattice.to_metres) for p in stored.plan.polygons]
    )


def check_body(stored, name, radius, speed, turn_rate_deg):
    """Check every pose of a body, and the way between every two."""
    poses = path(stored, name)
    step_s = stored.manifest["step_us"] / 1e6
    space = free_space(stored)
    walls = space.boundary
    here = ~poses.away
    points = shapely.points(poses.x[here], poses.y[here])
    assert shapely.contains_properly(space, points).all()
    assert shapely.distance(walls, points).min() >= radius - 1e-3
    xy = np.stack([poses.x, poses.y], axis=-1)
    moves = np.sqrt((np.diff(xy, axis=0) ** 2).sum(axis=1))
    assert moves.max() <= speed * step_s + LATTICE_M
    turns = (np.diff(poses.heading) + np.pi) % (2 * np.pi) - np.pi
    assert np.rad2deg(np.abs(turns)).max() <= min(180, turn_rate_deg * step_s) + 0.2


BODIES = {
    "ana": (0.2, 1.0, 180),
    "ben": (0.2, 0.7, 180),
    "astro": (0.15, 0.6, 90),
    "bolt": (0.15, 0.6, 90),
    "curio": (0.15, 0.6, 90),
    "drift": (0.1, 0.6, 90),
    "ego": (0.15, 1.2, 90),
}


@pytest.fixture(scope="module")
def fine():
    """Twenty minutes in steps of a tenth of a second: who goes round a corner hugs it."""
    content = everything("20 min")
    content["simulation"]["step"] = "100 ms"
    return run(content)


@pytest.fixture(scope="module")
def whole():
    """Two hours with every behavior."""
    return run(everything())


@pytest.mark.parametrize("name", BODIES)
def test_a_body_keeps_its_radius_speed_and_turn_rate(whole, name):
    check_body(whole, name, *BODIES[name])


@pytest.mark.parametrize("name", BODIES)
def test_no_move_crosses_a_wall_between_two_steps(fine, name):
    poses = path(fine, name)
    xy = np.stack([poses.x, poses.y], axis=-1)
    lines = shapely.linestrings(np.stack([xy[:-1], xy[1:]], axis=1))
    assert shapely.distance(free_space(fine).boundary, lines).min() > BODIES[name][0] - 0.02


@pytest.mark.parametrize("radius", [0.05, 0.3, 0.44])
def test_wide_and_narrow_bodies_keep_their_radius(radius):
    robot = {"type": "patrol", "radius": radius, "dwell": 0, "order": "random", "speed": 2}
    stored = run(scenario("1 h", robots={"astro": robot}))
    check_body(stored, "astro", radius, 2, 90)
    assert len(set(path(stored, "astro").room.tolist())) >= 4


def test_who_stands_where_a_walk_was_broken_off_can_go_on():
    """Interrupted at any step, also at a corner of the space: there is always a way."""
    scripts = [f"{room}" for room in ("kitchen", "bedroom", "bathroom", "living_room") * 20]
    behaviors = [{"type": f"{OWN}:Scripted", "script": scripts}]
    stored = run(scenario("1 h", users={"ana": {"behaviors": behaviors}}))
    check_body(stored, "ana", 0.2, 1.0, 180)


def test_a_body_too_wide_for_the_home_is_refused():
    with pytest.raises(fleet2d.Fleet2DError, match="radius") as caught:
        fleet2d.Simulation(scenario(users={"ana": {"radius": 2}}))
    assert "2 m" in str(caught.value)
