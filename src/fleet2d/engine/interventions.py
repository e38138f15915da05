"""Interventions: what a script, a test or a person does to a run from outside.

They are data: each is kept with its step, so that a run is reproduced from its manifest. What is
done at a step holds for everything in that step: interventions come before the floor plan.
"""

from typing import Annotated, Any, Literal

from pydantic import Field, TypeAdapter

from fleet2d.component import Settings
from fleet2d.engine.state import State
from fleet2d.entities.actor import Actor
from fleet2d.entities.arbitration import Arbiter
from fleet2d.entities.plan import Plan, Pose
from fleet2d.errors import PlacementError
from fleet2d.floorplan.change import HomeChange
from fleet2d.kernels.headings import TURN


class Intervention(Settings):
    """Something done to a run at a step."""

    step: int = Field(ge=0, description="the step at which it is done")

    def apply(self, state: State) -> None:
        """Do it at the present step."""
        raise NotImplementedError


class Put(Intervention):
    """Put a body somewhere, at once; it decides anew from there."""

    do: Literal["put"] = "put"
    entity: str = Field(description="name of the body")
    x: int = Field(description="where its centre is put [lattice units]")
    y: int = Field(description="where its centre is put [lattice units]")
    heading: int = Field(ge=0, lt=TURN, description="heading [1/4096 turn]")

    def apply(self, state: State) -> None:
        """Put it there.

        Raises:
            PlacementError: A shut door, or furniture that was moved, leaves no room for it there.
        """
        row, actor = _body(state, self.entity)
        part = actor.space.part_at(self.x, self.y)
        if part < 0:
            x, y = actor.home.plan.lattice.to_metres((self.x, self.y)).round(2).tolist()
            raise PlacementError(f"{actor.path}: there is no room for its body at ({x:g}, {y:g}) m")
        actor.state, actor.part = Pose(self.x, self.y, self.heading, 0), part
        state.recorder.move_body(row)
        _decide_anew(actor, self.step)


class Replan(Intervention):
    """Let a body decide anew, whatever it is doing."""

    do: Literal["replan"] = "replan"
    entity: str = Field(description="name of the body")

    def apply(self, state: State) -> None:
        """Ask its behaviors at the present step."""
        _decide_anew(_body(state, self.entity)[1], self.step)


class Change(Intervention):
    """Change the home."""

    do: Literal["change"] = "change"
    change: HomeChange = Field(description="what changes, as in `changes` of a scenario")

    def apply(self, state: State) -> None:
        """Let the floor plan take it up at the present step."""
        state.changes.ask(self.change, self.step, "a script")


class Drive(Intervention):
    """Take the decisions of a body out of the hands of its behaviors."""

    do: Literal["drive"] = "drive"
    entity: str = Field(description="name of the body")

    def apply(self, state: State) -> None:
        """From now on it follows plans from outside, and stays where it is without one."""
        row, actor = _body(state, self.entity)
        actor.behaviors, actor.arbiter = [], Arbiter([])
        state.driven.add(row)
        _decide_anew(actor, self.step)


class Decide(Intervention):
    """Give a body that is driven from outside a plan."""

    do: Literal["decide"] = "decide"
    entity: str = Field(description="name of the body")
    plan: dict[str, Any] = Field(description="the plan, as Plan.data() writes it")

    def apply(self, state: State) -> None:
        """Let the body follow the plan from the present step on."""
        _, actor = _body(state, self.entity)
        actor.choose(Plan.of(actor, self.step, self.plan))
        _decide_anew(actor, self.step)


AnyIntervention = Annotated[Put | Replan | Change | Drive | Decide, Field(discriminator="do")]

_ADAPTER: TypeAdapter[Intervention] = TypeAdapter(AnyIntervention)


def read_intervention(content: Any) -> Intervention:
    """Return an intervention as a manifest has it.

    Example:
        >>> read_intervention({"do": "replan", "step": 60, "entity": "astro"}).step
        60
    """
    return _ADAPTER.validate_python(content)


def _body(state: State, name: str) -> tuple[int, Actor]:
    return next((row, actor) for row, actor in enumerate(state.actors) if actor.name == name)


def _decide_anew(actor: Actor, step: int) -> None:
    actor.ask(step)
    actor.arbiter.wake_step = None
