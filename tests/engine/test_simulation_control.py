"""Scripts that steer: bodies by name, a decision on demand, branches that differ by it."""

import copy

import pytest

from fleet2d import Behavior, Simulation, Situation
from fleet2d.interventions import Replan


class Errand(Behavior):
    """Wait where the script says."""

    def start(self, actor):
        self.goal = "entryway"

    def decide(self, now):
        return now.plan().go_to(self.goal).stay()


def simulation():
    robots = {"astro": {"behaviors": [Errand()]}}
    return Simulation("bundled:paper", "simulation.duration=2 h", robots=robots)


def test_replan_lets_a_branch_go_elsewhere_and_leaves_the_original():
    history = simulation()
    history.advance(600)
    future = copy.deepcopy(history)
    future.actors["astro"].behaviors[0].goal = "kitchen"
    future.do(Replan("astro"))
    future.advance(600)
    history.advance(600)
    assert ("kitchen_1", "entryway_1") == tuple(s.state["astro"]["room"] for s in (future, history))


@pytest.mark.parametrize("xy", [(-3.0, -3.0), (0.0, 0.0), (100.0, 2.0)])
def test_nearest_free_is_a_place_that_the_body_can_go_to(xy):
    start = simulation()
    now = Situation(start.actors["astro"], 0)
    plan = now.plan().go_to(now.nearest_free(*xy))
    assert plan.time_us > 0
    assert now.nearest_free(*now.xy) == now.xy
