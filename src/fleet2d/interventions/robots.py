"""Interventions on robots: calls, batteries, faults, and perceptions."""

from datetime import timedelta
from typing import TypeGuard

from pydantic import Field

from fleet2d.configuration.components import Settings
from fleet2d.configuration.problems import check_known, problem, suggest
from fleet2d.configuration.units import AngleDeg, PositiveDuration, Share
from fleet2d.entities.behavior import Actor, Command
from fleet2d.entities.body import NEVER, Pose
from fleet2d.entities.decisions import DecidingActor
from fleet2d.entities.equipment import Charge, Displacement
from fleet2d.entities.place import Place
from fleet2d.entities.power import EMPTY, PLACE, PowerState, power_of
from fleet2d.errors import PlacementError, ScenarioError
from fleet2d.floorplan.plan import Room
from fleet2d.interventions.bodies import BodyIntervention, Put, behavior_number, heading_of
from fleet2d.interventions.intervention import Lasting, World, body, robot, user
from fleet2d.kernels import turn_between
from fleet2d.runtime.events import EventKind
from fleet2d.sight.camera import Disturbance, FalseSighting, dark_cameras
from fleet2d.sight.perception import Perception

UNKNOWN = "unknown"
# No home has coordinates beyond this [m].
MAX_PLACE_M = 1e4
# The behavior of the same name responds to each of these commands.
RESPONDERS = ("come", "find", "dock")


class RobotIntervention(BodyIntervention):
    """Base of interventions on a robot.

    Attributes:
        entity: The robot.
    """

    def actor(self, world: World) -> DecidingActor:
        """Return the robot in the run."""
        return robot(world, self.entity)


class Call(RobotIntervention):
    """Call a robot, as a user or an app does: to a place, to find a person, or to dock.

    The first of its behaviors that responds follows the call: at once, or when the behaviors before
    it are idle. A later call replaces one that is still pending. Event: `called`.

    Attributes:
        to: A place to come to, by the behavior `come`.
        find: A person to find, by the behavior `find`.
        dock: Whether to go to the charger, by the behavior `dock`.
        command: A word that a behavior of your own responds to.

    Example:
        >>> Call("astro", find="ana").find
        'ana'
    """

    to: Place | None = None
    find: str | None = None
    dock: bool = False
    command: str | None = Field(default=None, min_length=1)

    def model_post_init(self, _: object, /) -> None:
        """Require exactly one command."""
        is_set = (self.to is not None, self.find is not None, self.dock, self.command is not None)
        if sum(is_set) != 1:
            raise problem("give exactly one of 'to', 'find', 'dock: true' and 'command'")

    @property
    def order(self) -> Command:
        """The command that the robot's behaviors receive."""
        if self.to is not None:
            return Command("come", place=self.to)
        if self.find is not None:
            return Command("find", self.find)
        return Command(self.command or "dock")

    def check(self, world: World) -> None:
        """Refuse a call to which no behavior of the robot responds."""
        actor = self.actor(world)
        command = self.order
        if self.to is not None:
            self.check_reach(world, self.to)
        if not any(behavior.takes(command) for behavior in actor.behaviors):
            hint = f": give it one, like behaviors: [{{type: {command.do}}}, …]"
            raise ScenarioError(
                f"none of the behaviors of {self.entity} answers the call {command.text!r}"
                f"{hint if command.do in RESPONDERS else ''}"
            )

    def begin(self, world: World) -> None:
        """Pass the command to the robot's behaviors."""
        command = self.order
        if self.actor(world).is_off:
            return
        world.emit(self.entity, EventKind.CALLED, command.text)
        self.actor(world).receive(command, world.step)


class Dismiss(RobotIntervention):
    """Send a robot away: it gives up calls, following and searching.

    Example:
        >>> Dismiss("astro").entity
        'astro'
    """

    def begin(self, world: World) -> None:
        """Make the robot replan without these tasks."""
        self.actor(world).dismiss(world.step)


class KeepOut(RobotIntervention, Lasting):
    """Ban a robot from rooms: it leaves them, and goes round them until the ban ends.

    Events: `banned` and `allowed`, with the room.

    Attributes:
        entity: The robot.
        of: The rooms, or kinds of rooms if the home has them.

    Example:
        >>> KeepOut("astro", "bedroom", duration="1 h").of
        'bedroom'
    """

    of: tuple[str, ...] | str
    # The rooms are kept from the beginning, since their kinds may change until the end.
    _banned_rooms: tuple[int, ...] = ()

    def check(self, world: World) -> None:
        """Refuse an unknown robot or room."""
        super().check(world)
        self._rooms(world)

    def begin(self, world: World) -> None:
        """Ban the robot from the rooms, and let it leave them."""
        rooms = self._rooms(world)
        self._banned_rooms = tuple(room.index for room in rooms)
        for room in rooms:
            world.emit(self.entity, EventKind.BANNED, room.name)
            self.actor(world).keep_out(room.index, world.step, NEVER, room.name)

    def end(self, world: World) -> None:
        """Let the robot in again, unless another ban remains."""
        actor = self.actor(world)
        others = {room for act in self.active(world) for room in act._banned_rooms}
        for room in self._banned_rooms:
            if room not in others:
                actor.bans.pop(room, None)
                world.emit(self.entity, EventKind.ALLOWED, world.home.rooms[room].name)
        actor.decide_again(world.step)

    def _rooms(self, world: World) -> list[Room]:
        """Return the rooms.

        Raises:
            PlacementError: A name is neither a room of the home nor a kind of its rooms.
        """
        rooms = world.home.rooms
        known = dict.fromkeys(name for room in rooms for name in room.words)
        names = (self.of,) if isinstance(self.of, str) else self.of
        for name in names:
            check_known(name, "room", known, PlacementError)
        return [room for room in rooms if not set(room.words).isdisjoint(names)]


class SetBattery(RobotIntervention):
    """Set the charge of a robot's battery; a robot that was off because it was empty is on again.

    Attributes:
        charge: The charge at that moment, 0 to 1.

    Example:
        >>> SetBattery("astro", "20 %").charge
        0.2
    """

    charge: Share

    def check(self, world: World) -> None:
        """Refuse a robot without a battery."""
        battery_of(self.actor(world))

    def begin(self, world: World) -> None:
        """Set the charge, and make the behaviors replan."""
        actor = self.actor(world)
        charge = battery_of(actor)
        charge.follow(actor.motion, world.step * world.clock.step_us)
        charge.level = self.charge
        actor.decide_again(world.step)
        if not charge.is_empty:
            world.undo(lambda act: is_off(act, self.entity) and act.state == EMPTY)


def battery_of(actor: Actor) -> Charge:
    """Return the charge of a robot's battery.

    Raises:
        ScenarioError: The robot has no battery.
    """
    if actor.charge is None:
        raise ScenarioError(f"{actor.name} has no battery: add `battery` to the robot")
    return actor.charge


class Switch(Lasting):
    """Base of interventions that switch a camera or a behavior of a body.

    Attributes:
        entity: The robot; for a behavior also a person.
        camera: The camera, by name if the robot has several; true: all.
        behavior: The behavior, by its type.
    """

    entity: str
    camera: bool | str | None = None
    behavior: str | None = None

    def model_post_init(self, _: object, /) -> None:
        """Require exactly one subject."""
        if (self.behavior is None) == (not self.camera):
            raise problem("give exactly one of 'camera' (true, or a camera's name) and 'behavior'")

    def check(self, world: World) -> None:
        """Refuse an unknown camera or behavior."""
        if self.behavior is None:
            check_camera(robot(world, self.entity), self.camera)
            return
        behavior_number(body(world, self.entity), self.behavior)


class SwitchOff(Switch):
    """Switch a camera or a behavior off: the camera sees nothing, the behavior never decides.

    Example:
        >>> SwitchOff("astro", camera=True, duration="10 min").camera
        True
    """

    @property
    def disturbance(self) -> Disturbance | None:
        """The effect on cameras."""
        return Disturbance(camera_name(self.camera), dark=True) if self.camera else None

    def begin(self, world: World) -> None:
        """Switch the camera or behavior off."""
        if self.behavior is None:
            disturb(world, self.entity)
            return
        actor = body(world, self.entity)
        off = {act.behavior for act in self.active(world)}
        numbers = [i for i, behavior in enumerate(actor.behaviors) if behavior.type_name in off]
        actor.arbiter.off = frozenset(numbers)
        actor.decide_again(world.step)


class SwitchOn(Switch):
    """Switch a camera or a behavior on again.

    Attributes:
        duration: Not used: the camera or behavior stays on.

    Example:
        >>> SwitchOn("astro", behavior="patrol").behavior
        'patrol'
    """

    duration: None = None

    def begin(self, world: World) -> None:
        """Switch it on."""
        world.undo(self._switches_on)

    def _switches_on(self, act: object) -> bool:
        """Return whether this undoes an intervention."""
        if not isinstance(act, SwitchOff):
            return False
        names = {camera_name(self.camera), camera_name(act.camera)} - {None}
        is_same = (act.entity, act.behavior) == (self.entity, self.behavior)
        return is_same and len(names) <= 1


class Trouble(RobotIntervention, Lasting):
    """Base of interventions that hinder a robot for a while; `begin` and `end` apply all of them.

    Attributes:
        entity: The robot.
    """

    @property
    def disturbance(self) -> Disturbance | None:
        """The effect on cameras."""
        return None

    @property
    def loses_place(self) -> bool:
        """Whether the robot doesn't know where it is."""
        return False

    @property
    def immobilizes(self) -> bool:
        """Whether the robot can't drive."""
        return self.loses_place

    def begin(self, world: World) -> None:
        """Apply the trouble; a robot that is lost may find its place again by sight."""
        if self.loses_place:
            world.emit(self.entity, EventKind.LOCALIZATION_LOST, "")
            after = relocalizes_after(self.actor(world))
            if after is not None:
                world.later(Relocalize(entity=self.entity, by_sight=True), after)
        self._apply(world)

    def end(self, world: World) -> None:
        """End the trouble; the robot knows its place again unless it is lost otherwise."""
        self._apply(world)  # the others may still be active
        is_lost_still = any(is_lost(act, self.entity) for act in world.lasting)
        if is_lost_still or not self.loses_place:
            return
        displacements = self.actor(world).displacements
        if displacements and displacements[-1].end > world.step:
            displacements[-1] = displacements[-1]._replace(end=world.step)
        world.emit(self.entity, EventKind.RELOCALIZED, "")

    def _apply(self, world: World) -> None:
        """Apply all that are active."""
        if self.disturbance is not None:
            disturb(world, self.entity)
        if self.immobilizes:
            actor = self.actor(world)
            troubles = (act for act in world.lasting if isinstance(act, Trouble))
            actor.is_stuck = any(t.immobilizes and t.entity == self.entity for t in troubles)
            actor.decide_again(world.step)


def is_lost(act: object, name: str) -> bool:
    """Return whether an active intervention makes a robot lost."""
    return isinstance(act, Trouble) and act.loses_place and act.entity == name


def relocalizes_after(actor: Actor) -> timedelta | None:
    """Return the time for which a robot has to see the home to know its place; None: it can't."""
    settings = getattr(actor.entity, "localization", None)
    return None if settings is None else settings.relocalizes


# Crashes and updates last for these times by default.
CRASH_LASTS = timedelta(minutes=1)
UPDATE_LASTS = timedelta(minutes=15)
# By default, a robot that is on again needs this time to find out where it is.
LOST_AFTER_BOOT = timedelta(minutes=1)


class SetPower(Trouble):
    """Switch a robot off or on, or let it crash or update.

    While it is off it stands where it is, sees and hears nothing, and its charge doesn't fall. When
    it is on again, it begins anew there, with what it `persists` (see `Power`). If somebody has
    carried it elsewhere meanwhile, or it keeps no place, it is lost at first. Events: `power_off`,
    with the state, `broken_off`, with what it wanted of a person just then, and `power_on`.

    Attributes:
        entity: The robot.
        state: `off`: the robot is switched off, or its power cut; `crash` and `update`: it is on
            again by itself; `on`. A robot with an `empty` battery is off by itself (`battery` sets
            the charge).
        ends: With `on`: the only reason that ends; left out: all but an empty battery.
        duration: Time for which it is off; left out: until it is switched on, 1 min for a crash,
            and 15 min for an update, unless the robot's `power` says otherwise.

    Example:
        >>> SetPower("astro", state="off", duration="2 h").state
        'off'
    """

    state: PowerState = "off"
    ends: PowerState | None = None

    def model_post_init(self, _: object, /) -> None:
        """Refuse keys that don't go together."""
        if self.state == "on" and self.duration is not None:
            raise problem("'duration' is how long it is off: it doesn't go with 'state: on'")
        if self.ends is not None and self.state != "on":
            raise problem("'ends' goes with 'state: on'")

    @property
    def disturbance(self) -> Disturbance | None:
        """The effect on cameras."""
        return None if self.state == "on" else Disturbance(dark=True)

    @property
    def immobilizes(self) -> bool:
        """Whether the robot can't drive."""
        return self.state != "on"

    def check(self, world: World) -> None:
        """Refuse an unknown robot, and the state `empty` of a charged battery."""
        actor = self.actor(world)
        if self.state == EMPTY and not battery_of(actor).is_empty:
            raise ScenarioError(f"the battery of {self.entity} isn't empty: set its charge instead")

    def _lasts(self, actor: Actor) -> timedelta | None:
        """Return the time until the robot is on again; None: until it is switched on."""
        power = power_of(actor.entity)
        if self.duration is not None or self.state not in ("crash", "update"):
            return self.duration
        if self.state == "crash":
            return CRASH_LASTS if power.crashes is None else power.crashes.lasts
        return UPDATE_LASTS if power.updates is None else power.updates.lasts

    def begin(self, world: World) -> None:
        """Switch the robot at once."""
        actor = self.actor(world)
        if self.state == "on":
            is_empty = actor.charge is not None and actor.charge.is_empty
            world.undo(lambda act: self._switches(act, is_empty=is_empty))
            return
        # This is a copy of the request, so its duration may be set here.
        vars(self)["duration"] = self._lasts(actor)
        was_on = not actor.is_off
        actor.off_for = actor.off_for or self.state
        super().begin(world)
        if was_on:
            world.switch_off(actor)

    def end(self, world: World) -> None:
        """Let the robot begin anew, unless it is off for another reason."""
        actor = self.actor(world)
        if self.state == "on" or not actor.is_off:
            return
        reasons = [act for act in world.lasting if is_off(act, self.entity)]
        if reasons:
            actor.off_for = reasons[0].state
            return
        reason = actor.off_for or self.state
        actor.off_for = None
        self._apply(world)
        was_carried = world.switch_on(actor)
        world.emit(self.entity, EventKind.POWER_ON, reason)
        if was_carried or not power_of(actor.entity).keeps(PLACE):
            actor.is_stuck = True  # the robot notices in the next step
            lasts = None if relocalizes_after(actor) else LOST_AFTER_BOOT
            world.later(Fault(entity=self.entity, lost=True, duration=lasts), timedelta(0))

    def _switches(self, act: object, *, is_empty: bool) -> bool:
        """Return whether this ends the reason for which a robot is off."""
        if not is_off(act, self.entity):
            return False
        if self.ends is not None:
            return act.state == self.ends
        return act.state != EMPTY or not is_empty


def is_off(act: object, name: str) -> "TypeGuard[SetPower]":
    """Return whether an active intervention keeps a robot off."""
    return isinstance(act, SetPower) and act.state != "on" and act.entity == name


class Fault(Trouble):
    """Let a part of a robot fail for a while: stuck wheels, or a camera that sees less.

    With stuck wheels the robot can neither drive nor turn, and its behaviors don't decide. A robot
    that is lost doesn't know where it is, and stands still until it does. A broken charger doesn't
    charge. A dark camera sees nothing; with `detection` and `errs` it perceives with errors.

    Attributes:
        entity: The robot.
        wheels: Whether its wheels are stuck.
        lost: Whether its localization is lost.
        charger: Whether its charger is broken.
        dark: A camera that is dark, by name if the robot has several; true: all.
        detection: Factor of the probability that a user in view is noticed.
        errs: The errors of its cameras instead of the usual ones.

    Example:
        >>> Fault("astro", wheels=True, duration="10 min").wheels
        True
    """

    wheels: bool = False
    lost: bool = False
    charger: bool = False
    dark: bool | str = False
    detection: Share = 1.0
    errs: Perception | None = None

    def model_post_init(self, _: object, /) -> None:
        """Refuse a fault without effect."""
        if not (self.immobilizes or self.charger or self.disturbance):
            raise problem(
                "nothing fails: give 'wheels', 'lost', 'charger', 'dark', 'detection' or 'errs'"
            )

    @property
    def loses_place(self) -> bool:
        """Whether its localization is lost."""
        return self.lost

    @property
    def immobilizes(self) -> bool:
        """Whether the robot can't drive."""
        return self.wheels or self.lost

    @property
    def disturbance(self) -> Disturbance | None:
        """The effect on cameras."""
        if self.dark:
            return Disturbance(camera_name(self.dark), dark=True)
        if self.errs or self.detection < 1:
            return Disturbance(detection=self.detection, errs=self.errs)
        return None

    def check(self, world: World) -> None:
        """Refuse an unknown robot or camera."""
        actor = self.actor(world)
        if self.disturbance is not None:
            check_camera(actor, self.dark or True)
        if self.errs is not None:
            check_truth(world, self.entity)
        if self.charger:
            battery_of(actor)

    def _apply(self, world: World) -> None:
        super()._apply(world)
        if self.charger:
            actor = self.actor(world)
            charge = battery_of(actor)
            charge.follow(actor.motion, world.step * world.clock.step_us)
            charge.is_broken = any(act.charger for act in self.active(world))
            actor.decide_again(world.step)


class RealDetection(Settings):
    """A person whom a real robot detects.

    Attributes:
        user: The person, or 'unknown'.
        x: Its place along x [m].
        y: Its place along y [m].
        heading_deg: Its heading, counter-clockwise from +x.
    """

    user: str = UNKNOWN
    x: float = Field(ge=-MAX_PLACE_M, le=MAX_PLACE_M)
    y: float = Field(ge=-MAX_PLACE_M, le=MAX_PLACE_M)
    heading_deg: AngleDeg = 0.0


class Perceive(RobotIntervention):
    """Let a robot with `perceives: live` perceive people now, as a real robot did.

    Attributes:
        detections: The people, as {user: ana, x: 1.5, y: 2}.

    Example:
        >>> Perceive("astro", [{"user": "ana", "x": 1.5, "y": 2}]).detections[0].x
        1.5
    """

    detections: tuple[RealDetection, ...] = Field(min_length=1)

    def check(self, world: World) -> None:
        """Refuse a robot that perceives in another way, and unknown people."""
        super().check(world)
        source = getattr(self.actor(world).entity, "perceives", None)
        if source is None or source.type_name != "live":
            raise ScenarioError(
                f"{self.entity} perceives what its cameras see: set"
                f" robots.{self.entity}.perceives=live"
            )
        for detection in self.detections:
            if detection.user != UNKNOWN:
                user(world, detection.user)

    def begin(self, world: World) -> None:
        """Let the robot perceive the people."""
        sightings = [
            false_sighting(each.user, (each.x, each.y), each.heading_deg)
            for each in self.detections
        ]
        world.perceive(self.entity, sightings)


def false_sighting(user: str, spot: tuple[float, float], heading_deg: float) -> FalseSighting:
    """Return the false sighting of a person or 'unknown' in the form of cameras."""
    return FalseSighting("" if user == UNKNOWN else user, *spot, heading_of(heading_deg) or 0)


class Relocalize(RobotIntervention):
    """Let a robot know where it is, and end the interventions that keep it lost.

    Attributes:
        by_sight: Whether one of its cameras has to see; else the robot tries again, as often as its
            `localization.relocalizes` says.

    Example:
        >>> Relocalize("astro").entity
        'astro'
    """

    by_sight: bool = False

    def begin(self, world: World) -> None:
        """End the interventions that keep the robot lost, if it sees."""
        if not any(is_lost(act, self.entity) for act in world.lasting):
            return
        after = relocalizes_after(self.actor(world))
        if self.by_sight and after is not None and not self._sees(world):
            world.later(self, after)
        else:
            world.undo(lambda act: is_lost(act, self.entity))

    def _sees(self, world: World) -> bool:
        """Return whether one of the robot's cameras isn't dark."""
        eyes = self.actor(world).entity.eyes
        return eyes.keys() != dark_cameras(eyes, disturbances_of(world, self.entity))


class Kidnap(Trouble):
    """Carry a robot elsewhere without its knowledge: it is lost there, until it knows its place.

    Meanwhile it stands still, and its behaviors don't decide. If it has errors of `localization`,
    it believes itself to be where it was, and places people accordingly. `put` moves it with its
    knowledge.

    Attributes:
        entity: The robot.
        to: The place: a room, furniture, or a point.
        duration: Longest time until the robot knows where it is; left out: until it is restored, or
            knows by sight (`localization.relocalizes`).

    Example:
        >>> Kidnap("astro", "office").duration
        datetime.timedelta(seconds=60)
    """

    to: Place
    duration: PositiveDuration | None = timedelta(minutes=1)

    @property
    def loses_place(self) -> bool:
        """Whether the robot doesn't know where it is."""
        return True

    def check(self, world: World) -> None:
        """Refuse an unknown robot, and a place where it doesn't fit."""
        super().check(world)
        self._put.check(world)

    def begin(self, world: World) -> None:
        """Put the robot there, lost."""
        actor = self.actor(world)
        before = actor.state
        self._put.begin(world)
        if getattr(actor.entity, "localization", None) is not None:
            displacements = actor.displacements
            moved = displaced(world.step, before, actor.state)
            last = displacements[-1] if displacements else None
            if last is not None and last.end > world.step:  # carried off again
                displacements[-1] = last._replace(end=world.step)
                turn = moved.turn + last.turn
                moved = moved._replace(x=moved.x + last.x, y=moved.y + last.y, turn=turn)
            displacements.append(moved)
        super().begin(world)

    @property
    def _put(self) -> Put:
        return Put(entity=self.entity, to=self.to)


def displaced(step: int, believed: Pose, true: Pose) -> Displacement:
    """Return the error of a robot that isn't where it believes to be, from a step on."""
    turn = turn_between(true.heading, believed.heading)
    return Displacement(step, NEVER, believed.x - true.x, believed.y - true.y, turn)


def camera_name(camera: bool | str | None) -> str | None:
    """Return the name of a camera; None for all."""
    return camera if isinstance(camera, str) else None


def check_camera(actor: Actor, camera: bool | str | None) -> None:
    """Refuse an unknown camera of a robot.

    Raises:
        ScenarioError: The robot has no such camera, and the message lists its cameras; or it
            perceives the sightings of a log.
    """
    eyes = actor.entity.eyes
    name = camera_name(camera)
    if not eyes:
        raise ScenarioError(f"{actor.name} has no camera: give it one")
    source = getattr(actor.entity, "perceives", None)
    if source is not None and not source.besides_cameras:
        raise ScenarioError(
            f"{actor.name} perceives what robots.{actor.name}.perceives has, so its cameras can't"
            " be changed: leave one of them out"
        )
    if name is not None and name not in eyes:
        raise ScenarioError(f"{actor.name} has no camera {name!r}{suggest(name, eyes, 'It has')}")


def check_truth(world: World, name: str) -> None:
    """Refuse detections of unknown people in a run whose tables can't store them.

    Raises:
        ScenarioError: The cameras of the robot don't err in this run.
    """
    if not world.keeps_truth(name):
        raise ScenarioError(
            f"the table of observations has no column for people that {name} doesn't recognize, as"
            " its cameras don't err: put this into the scenario's script, or let them err, as by"
            f" robots.{name}.perception: {{false_positives: {{per_hour: 1e-9}}}}"
        )


def check_perceived(world: World, name: str, person: str) -> None:
    """Refuse an unknown person, and 'unknown' if the run's tables can't store it.

    Raises:
        ScenarioError: There is no such person, or the cameras of the robot don't err in this run.
    """
    if person == UNKNOWN:
        check_truth(world, name)
    else:
        user(world, person)


def disturbances_of(world: World, name: str) -> list[Disturbance]:
    """Return the disturbances of all active interventions on the cameras of a robot."""
    acts = (act for act in world.lasting if getattr(act, "entity", None) == name)
    disturbances = (getattr(act, "disturbance", None) for act in acts)
    return [item for item in disturbances if item is not None]


def disturb(world: World, name: str) -> None:
    """Apply the disturbances of all active interventions to the cameras of a robot."""
    world.disturb(name, disturbances_of(world, name))


class PerceptionIntervention(Trouble):
    """Base of interventions on perception; they don't change the random draws of cameras.

    Attributes:
        entity: The robot.
        camera: The camera, by name if the robot has several; left out: all.
    """

    camera: str | None = None

    def check(self, world: World) -> None:
        """Refuse an unknown robot or camera."""
        check_camera(self.actor(world), self.camera)


class Suppress(PerceptionIntervention):
    """Let a robot miss a person who is in view.

    Attributes:
        user: The person.

    Example:
        >>> Suppress("astro", "ana").user
        'ana'
    """

    user: str

    @property
    def disturbance(self) -> Disturbance:
        """The effect on cameras."""
        return Disturbance(self.camera, missed=self.user)

    def check(self, world: World) -> None:
        """Refuse an unknown person."""
        super().check(world)
        user(world, self.user)


class Mistake(PerceptionIntervention):
    """Let a robot mistake a person whom it notices for another one.

    Attributes:
        user: The person.
        taken_for: The other person, or 'unknown'.

    Example:
        >>> Mistake("astro", "ana", "ben").taken_for
        'ben'
    """

    user: str
    taken_for: str

    @property
    def disturbance(self) -> Disturbance:
        """The effect on cameras."""
        other = "" if self.taken_for == UNKNOWN else self.taken_for
        return Disturbance(self.camera, mistaken=(self.user, other))

    def check(self, world: World) -> None:
        """Refuse unknown people."""
        super().check(world)
        user(world, self.user)
        check_perceived(world, self.entity, self.taken_for)


class Inject(PerceptionIntervention):
    """Let a robot perceive a person who isn't there, in every look, wherever it looks.

    In the table of observations this is a false positive, without a true user.

    Attributes:
        user: The perceived person, or 'unknown'.
        spot: The apparent place, [x, y] in metres.
        heading_deg: The apparent heading, counter-clockwise from +x.

    Example:
        >>> Inject("astro", "ana", (2, 1)).spot
        (2.0, 1.0)
    """

    user: str
    spot: tuple[float, float]
    heading_deg: AngleDeg = 0.0

    @property
    def disturbance(self) -> Disturbance:
        """The effect on cameras."""
        sighting = false_sighting(self.user, self.spot, self.heading_deg)
        return Disturbance(self.camera, injected=sighting)

    def check(self, world: World) -> None:
        """Refuse an unknown person, and a place outside the home."""
        super().check(world)
        check_perceived(world, self.entity, self.user)
        if world.home.plan.room_at(*self.spot) is None:
            x, y = self.spot
            raise PlacementError(f"({x:g}, {y:g}) m is outside the home")
