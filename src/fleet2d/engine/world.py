"""Scripts in a run: the world that interventions read and change, and the times of applying them.

Entries of a scenario's script and requests from outside are checked, then scheduled at their time
or until their event.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from datetime import datetime, timedelta
from functools import cached_property
from pathlib import Path
from typing import Any

from fleet2d.configuration.problems import check_known, did_you_mean, suggest
from fleet2d.configuration.units import format_duration, micros
from fleet2d.engine import power
from fleet2d.engine.intervention_queue import (
    OUTSIDE,
    SCRIPT,
    DueIntervention,
    PendingIntervention,
    read_record,
)
from fleet2d.engine.possible_events import possible_details, possible_events
from fleet2d.engine.sensors import Sensors
from fleet2d.engine.state import State
from fleet2d.entities.body import Pose
from fleet2d.entities.decisions import Arbiter, DecidingActor
from fleet2d.entities.sensor import Sensor, SensorFault
from fleet2d.errors import ScenarioError
from fleet2d.floorplan.home import HomeChange
from fleet2d.floorplan.slow_area import SlowArea
from fleet2d.interventions.intervention import (
    ENTRY_KEYS,
    ClockTime,
    Entry,
    Intervention,
    Trigger,
    parse_entry,
    parse_intervention,
)
from fleet2d.runtime.clock import Clock
from fleet2d.runtime.events import KINDS, Event, EventKind
from fleet2d.sight.camera import Disturbance, FalseSighting, dark_cameras


class EngineWorld:
    """A run at the step of an intervention; see `fleet2d.interventions.intervention`."""

    def __init__(self, state: State, step: int) -> None:
        self._state = state
        self.step = step
        self.home = state.home
        self.clock = state.changes.clock
        self.doors: Sequence[str] = state.changes.names
        sensors = state.find(Sensors)
        self.sensors: Mapping[str, Sensor] = {} if sensors is None else sensors.sensors
        self.algorithms: Sequence[str] = state.learners.known

    @cached_property
    def users(self) -> dict[str, DecidingActor]:
        """The people, by name."""
        return {actor.name: actor for actor in self._state.users}

    @cached_property
    def robots(self) -> dict[str, DecidingActor]:
        """The robots, by name."""
        return {actor.name: actor for actor in self._state.robots}

    @property
    def acts(self) -> Sequence[Mapping[str, Any]]:
        """All interventions, done and scheduled, as data."""
        return self._state.interventions.acts

    @property
    def lasting(self) -> Sequence[object]:
        """The active interventions with a duration, in order of beginning."""
        return self._state.interventions.lasting

    def undo(self, applies: Callable[[object], bool]) -> None:
        """End the active interventions to which a condition applies."""
        for act in self._state.interventions.undo(applies):
            act.end(self)

    def keeps_truth(self, robot: str) -> bool:
        """Whether the run stores the truth beside the sightings of a robot."""
        return any(c.owner.name == robot and c.errs for c in self._state.cameras)

    def disturb(self, robot: str, disturbances: Sequence[Disturbance]) -> None:
        """Set all disturbances of the cameras of a robot from the present step on."""
        self._state.settle(self.step)
        row = self.robots[robot].row
        eyes = self.robots[robot].entity.eyes
        for cameras in self._state.cameras:
            if cameras.row == row:
                cameras.disturb(disturbances)
        dark = dark_cameras(eyes, disturbances)
        for area in self._state.layers.areas:
            if area.row == row:
                area.darken(dark)

    def perceive(self, robot: str, sightings: Sequence[FalseSighting]) -> None:
        """Let a robot perceive people at the present step."""
        from fleet2d.engine.real_sight import RealSight

        row = self.robots[robot].row
        for cameras in self._state.cameras:
            if isinstance(cameras, RealSight) and cameras.row == row:
                cameras.receive(self.step, sightings)

    def stick(self, sensor: str, says: SensorFault | None) -> None:
        """Set the fault of a sensor from the present step on; None: it works."""
        self._state.settle(self.step)
        sensors = self._state.find(Sensors)
        assert sensors is not None
        sensors.stuck.pop(sensor, None)
        if says is not None:
            sensors.stuck[sensor] = says

    def reset(self, algorithm: str, learned: Path | None) -> None:
        """Restart an algorithm with nothing learned, or with the learned state of a file."""
        self._state.learners.reset(algorithm, learned)

    def replace(self, algorithm: str, output: object) -> None:
        """Let all but metrics read another output of an algorithm; see `Learners.replace`."""
        self._state.learners.replace(algorithm, output)

    def move(self, actor: DecidingActor, pose: Pose) -> None:
        """Put a body at a pose, where it replans."""
        self._state.recorder.move_body(actor.row, self.step)
        actor.put(pose, self.step)

    def later(self, act: Intervention, delay: timedelta) -> None:
        """Apply an intervention that follows from this one, after a time."""
        queue = self._state.interventions
        steps = max(1, self.clock.step_at_or_after(micros(delay)))
        queue.follow(act, self.step + steps)

    def switch_off(self, actor: DecidingActor) -> None:
        """Let a robot lose its power at the present step."""
        power.switch_off(self._state, actor, self.step)

    def switch_on(self, actor: DecidingActor) -> bool:
        """Let a robot begin anew at the present step; return whether it was carried elsewhere."""
        return power.switch_on(self._state, actor, self.step)

    def drive(self, actor: DecidingActor) -> None:
        """Let a body follow plans from outside from now on, instead of its behaviors."""
        actor.behaviors = []
        actor.arbiter = Arbiter([])
        actor.order = None
        self._state.driven.add(actor.row)
        actor.decide_again(self.step)

    def check_change(self, change: HomeChange) -> None:
        """Refuse an impossible change of the home.

        Raises:
            ScenarioError: It names something unknown.
        """
        self._state.changes.check_names(change)

    def change(self, change: HomeChange) -> None:
        """Change the home at the present step."""
        self._state.changes.ask(change, self.step, "a script")

    def slow(self, areas: Sequence[SlowArea]) -> None:
        """Set the areas that slow robots down, besides those of the floor plan."""
        self._state.changes.slow(areas, self.step)

    def emit(self, entity: str, event: EventKind, detail: str) -> None:
        """Record an event at the present step."""
        self._state.events.emit([Event(self.step, entity, event, detail)])


def request(state: State, act: Mapping[str, Any] | Intervention, step: int) -> bool:
    """Schedule an intervention from outside, at a step or as its entry in a script says.

    Args:
        state: The run.
        act: The intervention, or a mapping as in a scenario's script.
        step: The present step.

    Returns:
        Whether the intervention waits for a later time or an event.

    Raises:
        ScenarioError: The intervention is not valid, names something unknown, or can never happen.
        PlacementError: There is no such place, or it can't be reached.
    """
    world = EngineWorld(state, step)
    if isinstance(act, Mapping) and not ENTRY_KEYS.isdisjoint(act):
        entry = parse_entry(act)
        _check(entry, world)
        _schedule(state, entry, world)
        return True
    if isinstance(act, Mapping):
        act = parse_intervention(act)
    act.check(world)
    state.interventions.request(act, step)
    return False


def repeat(state: State, records: Iterable[Mapping[str, Any]]) -> None:
    """Schedule the requests of another run, by their records in its manifest."""
    for record in records:
        step, content = read_record(record)
        if ENTRY_KEYS.isdisjoint(content):
            state.interventions.request(parse_intervention(content), step)
        else:
            _schedule(state, parse_entry(content), EngineWorld(state, step))


def schedule_script(state: State, entry: Entry, index: int) -> None:
    """Schedule an entry of the scenario's script, before the first step.

    Args:
        state: The run.
        entry: The entry.
        index: The place of the entry in the script.

    Raises:
        ScenarioError: The entry names something unknown, its event can never happen, or its time
            isn't within the run.
        PlacementError: There is no such place, or it can't be reached.
    """
    world = EngineWorld(state, 0)
    _check(entry, world)
    _schedule(state, entry, world, index)


def _check(entry: Entry, world: EngineWorld) -> None:
    entry.act.check(world)
    if entry.on is not None:
        check_trigger(world, entry.on)


def _schedule(state: State, entry: Entry, world: EngineWorld, index: int | None = None) -> None:
    """Schedule an entry at its time or event, from the step of `world` on."""
    interventions = state.interventions
    first = world.step
    steps = steps_of(entry, world.clock, first) if entry.on is None else []
    rank = SCRIPT
    number = index
    by = f"script.{index}"
    if number is None:
        rank = OUTSIDE
        number = len(interventions.requests)
        by = ""
        content = entry.model_dump(mode="json", exclude_defaults=True)
        interventions.requests.append({"do": content.pop("do"), "step": first, **content})
    due = DueIntervention(first, rank, number, entry.act, by)
    for step in steps:
        interventions.add(due._replace(step=step))
    if entry.on is None:
        return
    pending = PendingIntervention(entry.on, entry.each, micros(entry.delay), due)
    interventions.waiting.append(pending)
    if interventions not in state.events.sinks:
        state.events.sinks.append(interventions)
    state.wait_for(state.requested)


def steps_of(entry: Entry, clock: Clock, first: int) -> list[int]:
    """Return the steps at which an entry is applied: from `first` on, within the run.

    Raises:
        ScenarioError: There are no such steps.
    """
    time = entry.at
    if isinstance(time, ClockTime):
        moments = [clock.elapsed(moment) for moment in time.moments(clock)]
        steps = [clock.step_at_or_after(moment) for moment in moments]
        steps = [step for step in steps if first <= step < clock.steps]
        steps = steps if entry.each else steps[:1]
        text = time.text
    elif isinstance(time, datetime):
        steps = [clock.step_at_or_after(clock.elapsed(time))]
        text = f"{time:%Y-%m-%d %H:%M:%S}"
    else:
        assert time is not None
        steps = [clock.step_at_or_after(micros(time))]
        text = format_duration(time)
    if not steps or not first <= steps[0] < clock.steps:
        begins = clock.time(first)
        ends = clock.time(clock.steps)
        raise ScenarioError(
            f"at: {text} is not within the run, which goes from {begins:%A %Y-%m-%d %H:%M:%S}"
            f" to {ends:%Y-%m-%d %H:%M:%S}"
        )
    return steps


def check_trigger(world: EngineWorld, trigger: Trigger) -> None:
    """Refuse an event that can never happen.

    Raises:
        ScenarioError: The event can't happen; the message lists the events that can.
    """
    users = world.users.values()
    robots = world.robots.values()
    possible = possible_events(users, robots, world.home, world.doors, world.sensors)
    if trigger.entity is not None and (not trigger.entity or trigger.entity not in possible):
        names = [name for name in possible if name]
        raise ScenarioError(
            f"there is nobody and nothing named {trigger.entity!r}{suggest(trigger.entity, names)}"
        )
    kinds = sorted(frozenset().union(*possible.values()))
    if trigger.event not in {*KINDS, *kinds}:
        raise ScenarioError(
            f"there is no event {trigger.event!r}{did_you_mean(trigger.event, [*kinds, *KINDS])}"
            f" What can happen in this run: {', '.join(kinds)}"
        )
    if trigger.entity is not None:
        kinds = sorted(possible[trigger.entity])
    if trigger.event not in kinds:
        place = "in this run" if trigger.entity is None else f"to {trigger.entity}"
        raise ScenarioError(
            f"{trigger.event!r} can never happen {place}{suggest(trigger.event, kinds, 'What can')}"
        )
    details = possible_details(users, robots, world.acts)
    own = f"{trigger.event} {trigger.entity}"  # like a user's activities
    known = details.get(own if own in details else trigger.event)
    # An empty detail is somebody who isn't recognized.
    if known is None or not trigger.detail or trigger.detail.startswith("come "):
        return
    check_known(trigger.detail, f"{trigger.event!r} with the detail", known)
