"""The facts of a running simulation that the page receives before the first frame."""

from fleet2d import __version__
from fleet2d.artifacts.manifest import plain
from fleet2d.engine.simulation import Simulation
from fleet2d.entities.objects.door import Door
from fleet2d.viewer.facts.contract import DoorFacts, RunFacts, WallsChange
from fleet2d.viewer.facts.home_facts import home_facts
from fleet2d.viewer.facts.run_facts import bodies_of
from fleet2d.viewer.facts.walls import door_facts


def live_facts(simulation: Simulation) -> RunFacts:
    """Return what the page receives about a running simulation, which has no tables yet."""
    scenario = plain(simulation.scenario.resolved())
    clock = simulation.clock
    entities = {
        "users": list(simulation.scenario.users),
        "robots": list(simulation.scenario.robots),
    }
    return RunFacts(
        title=simulation.scenario.name or "live run",
        status="running",
        notes=[],
        start=clock.start.isoformat(),
        step_us=clock.step_us,
        steps=clock.steps,
        first_step=0,
        end_step=clock.steps,
        seed=simulation.seed,
        digest=None,
        version=__version__,
        home=home_facts(simulation.home.plan, _doors(simulation)),
        bodies=bodies_of(scenario, entities),
        tables=[],
        walls=[WallsChange(step=0, walls=0)],
        marks=[],
        metrics={},
        scenario=scenario,
        walks_every_s=0.0,
    )


def _doors(simulation: Simulation) -> list[DoorFacts]:
    return [
        door_facts(name, door, door.find(simulation.home.plan))
        for name, door in simulation.scenario.objects.items()
        if isinstance(door, Door)
    ]
