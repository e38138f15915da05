"""Scripts that steer: bodies by name, a decision on demand, branches that differ by it."""

import copy

import pytest

from fleet2d import Behavior, Plan, Simulation, Situation, load_scenario
from fleet2d.errors import ScenarioError
from fleet2d.interventions import Replan


class Errand(Behavior):
    """Wait where the script says."""

    def start(self, actor: object) -> None:
        self.goal = "entryway"

    def decide(self, now: Situation) -> Plan:
        return now.plan().go_to(self.goal).stay()


def simulation() -> Simulation:
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


def test_replan_is_kept_in_the_manifest():
    steered = simulation()
    steered.advance(10)
    steered.do(Replan("astro"))
    steered.do(Replan("astro"))
    done = steered.run().manifest["interventions"]
    assert 2 * [{"do": "replan", "step": 10, "entity": "astro"}] == done


def test_replan_of_somebody_unknown_names_who_there_is():
    with pytest.raises(ScenarioError, match="did you mean 'astro'"):
        simulation().do(Replan("asto"))


def test_override_in_the_place_of_the_file_changes_the_bundled_scenario():
    assert 7200 == load_scenario("bundled:paper", "simulation.duration=2 h").simulation.steps


@pytest.mark.parametrize("xy", [(-3.0, -3.0), (0.0, 0.0), (100.0, 2.0)])
def test_nearest_free_is_a_place_that_the_body_can_go_to(xy):
    start = simulation()
    now = Situation(start.actors["astro"], 0)
    plan = now.plan().go_to(now.nearest_free(*xy))
    assert plan.time_us > 0


def test_nearest_free_of_a_free_place_is_that_place():
    now = Situation(simulation().actors["astro"], 0)
    assert now.nearest_free(*now.xy) == now.xy
