"""What is done to robots: call, battery, switch_off, switch_on, fault."""

from typing import Self

from pydantic import Field, model_validator

from fleet2d.component import register
from fleet2d.entities.actor import Actor
from fleet2d.entities.behavior import Command
from fleet2d.entities.place import Place
from fleet2d.errors import ScenarioError
from fleet2d.events import EventKind
from fleet2d.interventions.bodies import check_reach
from fleet2d.interventions.intervention import Intervention, Lasting, body, robot
from fleet2d.interventions.world import World
from fleet2d.problems import did_you_mean, problem
from fleet2d.sight.disturbance import Disturbance
from fleet2d.sight.perception import Perception
from fleet2d.units import Share

# The behaviors of Fleet2D that answer.
ANSWERS = {"come": "come", "find": "find", "dock": "dock"}


class OfRobot(Intervention):
    """Base of what is done to a robot."""

    entity: str = Field(description="the robot")

    def check(self, world: World) -> None:
        """Refuse a robot that there isn't."""
        robot(world, self.entity)


@register("intervention", "call")
class Call(OfRobot):
    """Call a robot, as a user or an app does: to a place, to find somebody, or to dock.

    The first of its behaviors that answers takes the call up: at once, or when the behaviors before
    it leave the robot to it. A later call replaces one that still waits. Event: `called`.
    """

    to: Place | None = Field(default=None, description="come there: behavior `come`")
    find: str | None = Field(default=None, description="find this person: behavior `find`")
    dock: bool = Field(default=False, description="go to the charger: behavior `dock`")
    command: str | None = Field(
        default=None, min_length=1, description="a word that a behavior of your own answers to"
    )

    @model_validator(mode="after")
    def _is_one_command(self) -> Self:
        wanted = (self.to is not None, self.find is not None, self.dock, self.command is not None)
        if sum(wanted) != 1:
            raise problem("one of 'to', 'find', 'dock: true' and 'command' is wanted")
        return self

    @property
    def meaning(self) -> Command:
        """What the robot is called to do."""
        if self.to is not None:
            return Command("come", place=self.to)
        if self.find is not None:
            return Command("find", self.find)
        return Command(self.command or "dock")

    def check(self, world: World) -> None:
        """Refuse a call that none of its behaviors answers."""
        actor, command = robot(world, self.entity), self.meaning
        if self.to is not None:
            check_reach(actor, self.to)
        if not any(behavior.takes(command) for behavior in actor.behaviors):
            kind = ANSWERS.get(command.do)
            hint = f": give it one, like behaviors: [{{type: {kind}}}, …]" if kind else ""
            raise ScenarioError(
                f"none of the behaviors of {self.entity} answers the call {command.text!r}{hint}"
            )

    def begin(self, world: World) -> None:
        """Let its behaviors hear of it."""
        command = self.meaning
        world.emit(self.entity, EventKind.CALLED, command.text)
        robot(world, self.entity).hear(command, world.step)


@register("intervention", "battery")
class SetBattery(OfRobot):
    """Set the charge of a robot's battery."""

    charge: Share = Field(description="the charge from then on")

    def check(self, world: World) -> None:
        """Refuse a robot without a battery."""
        if robot(world, self.entity).charge is None:
            raise ScenarioError(f"{self.entity} has no battery: give it one")

    def begin(self, world: World) -> None:
        """Set it, and let the behaviors decide anew."""
        actor = robot(world, self.entity)
        assert actor.charge is not None
        actor.charge.set(self.charge, actor.motion, world.step * world.clock.step_us)
        actor.decide_anew(world.step)


class Switch(Lasting):
    """Base of what switches a camera or a behavior of a body."""

    entity: str = Field(description="the robot; of behaviors, a person, too")
    camera: bool | str | None = Field(
        default=None, description="its camera, by name where it has several; true: all"
    )
    behavior: str | None = Field(default=None, description="its behavior, by its type")

    @model_validator(mode="after")
    def _is_one_thing(self) -> Self:
        if (self.behavior is None) == (not self.camera):
            raise problem("'camera: true', a camera's name, or 'behavior' is wanted, one of them")
        return self

    def check(self, world: World) -> None:
        """Refuse a camera or a behavior that there isn't."""
        if self.behavior is None:
            check_camera(robot(world, self.entity), self.camera)
            return
        known = [behavior.type_name for behavior in body(world, self.entity).behaviors]
        if self.behavior not in known:
            raise ScenarioError(
                f"{self.entity} has no behavior {self.behavior!r}"
                f"{did_you_mean(self.behavior, known)} It has: {', '.join(known) or 'none'}"
            )


@register("intervention", "switch_off")
class SwitchOff(Switch):
    """Switch a camera or a behavior off: it sees nothing, or is never asked."""

    @property
    def disturbance(self) -> Disturbance | None:
        """What it does to cameras."""
        return Disturbance(named(self.camera), dark=True) if self.camera else None

    def begin(self, world: World) -> None:
        """Switch it off."""
        if self.behavior is None:
            disturb(world, self.entity)
        else:
            self._silence(world)

    def end(self, world: World) -> None:
        """Switch it on."""
        self.begin(world)  # both go by all that is switched off at present

    def _silence(self, world: World) -> None:
        actor = body(world, self.entity)
        off = {
            act.behavior
            for act in world.lasting
            if isinstance(act, SwitchOff) and act.entity == self.entity
        }
        numbers = [i for i, behavior in enumerate(actor.behaviors) if behavior.type_name in off]
        actor.arbiter.off = frozenset(numbers)
        actor.decide_anew(world.step)


@register("intervention", "switch_on")
class SwitchOn(Switch):
    """Switch a camera or a behavior on that was switched off."""

    duration: None = Field(default=None, description="none: it stays on")

    def begin(self, world: World) -> None:
        """Switch it on."""
        world.undo(
            lambda act: (
                isinstance(act, SwitchOff)
                and (act.entity, act.behavior) == (self.entity, self.behavior)
                and (self.camera is True or named(act.camera) in (None, named(self.camera)))
            )
        )


@register("intervention", "fault")
class Fault(Lasting):
    """Let something of a robot fail for a while: wheels that are stuck, a camera that sees worse.

    With stuck wheels it can neither drive nor turn, and its behaviors aren't asked. A dark camera
    sees nothing. `detection` and `errs` let it see, but worse.
    """

    entity: str = Field(description="the robot")
    wheels: bool = Field(default=False, description="whether its wheels are stuck")
    dark: bool | str = Field(
        default=False, description="a camera that is dark, by name where it has several; true: all"
    )
    detection: Share = Field(
        default=1.0, description="factor of the probability that a user in view is noticed"
    )
    errs: Perception | None = Field(
        default=None, description="how its cameras err instead of as before"
    )

    @model_validator(mode="after")
    def _is_something(self) -> Self:
        if not (self.wheels or self.dark or self.detection < 1 or self.errs):
            raise problem("nothing fails: say 'wheels', 'dark', 'detection' or 'errs'")
        return self

    @property
    def disturbance(self) -> Disturbance | None:
        """What it does to cameras."""
        if self.dark:
            return Disturbance(named(self.dark), dark=True)
        if self.errs or self.detection < 1:
            return Disturbance(detection=self.detection, errs=self.errs)
        return None

    def check(self, world: World) -> None:
        """Refuse a robot or a camera that there isn't."""
        actor = robot(world, self.entity)
        if self.disturbance is not None:
            check_camera(actor, self.dark or True)
        if self.errs is not None:
            check_truth(world, self.entity)

    def begin(self, world: World) -> None:
        """Let it fail."""
        if self.disturbance is not None:
            disturb(world, self.entity)
        if self.wheels:
            actor = robot(world, self.entity)
            actor.is_stuck = any(
                isinstance(act, Fault) and act.wheels and act.entity == self.entity
                for act in world.lasting
            )
            actor.decide_anew(world.step)

    def end(self, world: World) -> None:
        """Repair it."""
        self.begin(world)  # both go by all that has failed at present


def named(camera: bool | str | None) -> str | None:
    """Return the name of a camera; None for all."""
    return camera if isinstance(camera, str) else None


def check_camera(actor: Actor, camera: bool | str | None) -> None:
    """Refuse a camera that a robot hasn't.

    Raises:
        ScenarioError: Says which it has.
    """
    eyes, name = actor.entity.eyes, named(camera)
    if not eyes:
        raise ScenarioError(f"{actor.name} has no camera: give it one")
    if name is not None and name not in eyes:
        raise ScenarioError(
            f"{actor.name} has no camera {name!r}{did_you_mean(name, eyes)}"
            f" It has: {', '.join(eyes)}"
        )


def makes_wrong(act: Intervention, robot: str) -> bool:
    """Tell whether an intervention lets a robot perceive what isn't true."""
    found = getattr(act, "disturbance", None)
    wrong = found is not None and (found.errs or found.mistaken or found.injected)
    return bool(wrong) and getattr(act, "entity", None) == robot


def check_truth(world: World, name: str) -> None:
    """Refuse to let a robot perceive somebody unknown where the run can't keep that.

    Raises:
        ScenarioError: Says what to do.
    """
    if not world.keeps_truth(name):
        raise ScenarioError(
            f"the table of observations has no column for whom {name} doesn't recognize, as its"
            " cameras don't err: put this into the scenario's script, or let them err, as by"
            f" robots.{name}.perception: {{false_positives: {{per_hour: 1e-9}}}}"
        )


def disturb(world: World, name: str) -> None:
    """Disturb the cameras of a robot by all that is under way at present."""
    acts = (act for act in world.lasting if getattr(act, "entity", None) == name)
    found = (getattr(act, "disturbance", None) for act in acts)
    world.disturb(name, [each for each in found if each is not None])
