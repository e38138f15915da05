"""Giving way: ways round others that stand."""

import numpy as np

import fleet2d
from fleet2d.entities.giving_way import RoutesAround


def test_from_a_corner_it_goes_round_nobody_by_the_shortest_way() -> None:
    simulation = fleet2d.Simulation("bundled:paper", "simulation.duration=1 h")
    robot = simulation._state.actors[-1]
    goal = robot.state.position
    around = RoutesAround(robot, np.empty((0, 3), np.int64))
    corners = [(int(x), int(y)) for x, y in robot.space.mesh.vertices]
    routes = [(around(at, goal), robot.space.route(at, goal)) for at in corners]
    found = [(one, other) for one, other in routes if other is not None]
    assert len(found) > 100
    assert all(one is not None and np.array_equal(one, other) for one, other in found)
