"""The basis of a run: what its parts are made from."""

from dataclasses import dataclass

from fleet2d.artifacts.store import RunStore
from fleet2d.engine.bodies import Bodies
from fleet2d.entities.decisions import DecidingActor
from fleet2d.floorplan.home.home import Home
from fleet2d.runtime.clock import Clock
from fleet2d.scenario.model import Scenario


@dataclass(frozen=True)
class Basis:
    """What the parts of a run are made from.

    Attributes:
        scenario: The scenario.
        clock: The steps of the run.
        seed: The seed of all random draws.
        store: The store of its tables.
        home: The home before the first step.
        actors: Users, then robots.
        bodies: Their poses, in the same order.
    """

    scenario: Scenario
    clock: Clock
    seed: int
    store: RunStore
    home: Home
    actors: list[DecidingActor]
    bodies: Bodies

    @property
    def users(self) -> list[DecidingActor]:
        """The users."""
        return self.actors[: self.bodies.users]

    @property
    def robots(self) -> list[DecidingActor]:
        """The robots."""
        return self.actors[self.bodies.users :]

    @property
    def may_change(self) -> bool:
        """Whether the home may change during the run."""
        scenario = self.scenario
        if not scenario.script:
            return bool(scenario.objects or scenario.changes)
        from fleet2d.interventions.home import HomeIntervention  # only scripts need it

        moves = any(isinstance(entry.act, HomeIntervention) for entry in scenario.script)
        return bool(scenario.objects or scenario.changes or moves)
