"""Setting up a run from a scenario: its home, bodies, cameras, sensors, algorithms and tables."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import numpy as np

from fleet2d.algorithms.history import Log
from fleet2d.artifacts.store import RunStore
from fleet2d.configuration.problems import check_known
from fleet2d.engine.basis import Basis
from fleet2d.engine.cameras import Cameras, SightSetup
from fleet2d.engine.change_queue import ChangeQueue
from fleet2d.engine.interrupt import WATCHED_EVENTS, Interruptions
from fleet2d.engine.intervention_queue import InterventionQueue
from fleet2d.engine.layers import LayerBook, add_layers
from fleet2d.engine.learners import Learners
from fleet2d.engine.recorder import Recorder
from fleet2d.engine.sensors import Sensors
from fleet2d.engine.state import EventStream, InView, Recall, State
from fleet2d.entities.body import Bodies
from fleet2d.entities.decisions import DecidingActor
from fleet2d.entities.home_object import Door
from fleet2d.entities.sensor import Sensor
from fleet2d.errors import ComponentError, PlacementError, ScenarioError, blame, errors_as
from fleet2d.floorplan.home import Home
from fleet2d.interventions.intervention import causes_errors
from fleet2d.runtime.clock import Clock
from fleet2d.runtime.events import EventKind
from fleet2d.scenario.model import Scenario
from fleet2d.sight.fov import LineOfSight

if TYPE_CHECKING:
    from fleet2d.engine.collisions import BlockedWays, Clearance
    from fleet2d.engine.conversations import Conversations
    from fleet2d.engine.encounters import Encounters
    from fleet2d.engine.yielding import Yielding


def set_up(scenario: Scenario, clock: Clock, seed: int, store: RunStore) -> State:
    """Return the state before the first step, and add the tables of the run to its store.

    Raises:
        InputError: The floor plan or a place in the scenario is wrong, or a name is unknown.
    """
    basis = _basis(scenario, clock, seed, store)
    user_cameras, cameras = _open_cameras(basis)
    _check_reads(scenario, basis.actors)
    for group in cameras:
        if any(causes_errors(entry.act, group.owner.name) for entry in scenario.script):
            group.expect_disturbances()
    changes = ChangeQueue(basis)
    with _locate_errors(scenario, "objects"):
        sensors = Sensors(basis, changes.names)
    recorder = Recorder(basis, cameras, sensors)
    layers = LayerBook(basis)
    learners = Learners(basis)
    interventions = InterventionQueue(clock)
    conversations = _conversations(basis, interventions)
    log = _log(basis, cameras, recorder, conversations) if learners.all else None
    names = [*(actor.name for actor in basis.actors), *scenario.objects]
    yielding = _yielding(basis)
    watchers = [
        *_collisions(basis),
        *yielding,
        *user_cameras,
        *cameras,
        *_encounters(basis),
        *conversations,
        Interruptions(basis),
        sensors,
        *layers.areas,
    ]
    state = State(
        bodies=basis.bodies,
        actors=basis.actors,
        home=basis.home,
        changes=changes,
        watchers=[watcher for watcher in watchers if watcher.is_needed],
        user_cameras=user_cameras,
        cameras=cameras,
        layers=layers,
        learners=learners,
        log=log,
        recorder=recorder,
        store=store,
        events=EventStream([recorder, sensors, *([] if log is None else [log])], names),
        interventions=interventions,
        max_span=scenario.simulation.max_span,
    )
    state.yielding = next((watcher for watcher in yielding if watcher.is_needed), None)
    for group in [*user_cameras, *cameras]:
        group.owner.in_view = InView(state, group)
    _remember(state, basis)
    state.wait_for(state.requested)
    _schedule_failures(state, scenario, clock, seed)
    if scenario.script:
        _schedule_script(state, scenario)
    for name, expected in scenario.expect.items():
        with _locate_errors(scenario, f"expect.{name}"):
            state.expect(scenario, name, expected.that, 0)
    return state


def _collisions(basis: Basis) -> "list[Clearance | BlockedWays]":
    """Return the watchers that let bodies wait for each other; empty if none gives way."""
    gives_way = any(robot.gives_way is not None for robot in basis.scenario.robots.values())
    if not gives_way and basis.scenario.simulation.people_block is None:
        return []
    from fleet2d.engine.collisions import BlockedWays, Clearance  # few runs need them

    return [Clearance(basis.users, basis.robots), BlockedWays(basis)]


def _yielding(basis: Basis) -> "list[Yielding]":
    """Return the watcher that lets robots yield; empty if bodies are ghosts to each other."""
    if basis.scenario.simulation.ghosts:
        return []
    from fleet2d.engine.yielding import Yielding  # few runs need it

    return [Yielding(basis)]


def _encounters(basis: Basis) -> "list[Encounters]":
    """Return the encounters of people who react to robots; none if nobody does."""
    if all(user.attention is None for user in basis.users):
        return []
    from fleet2d.engine.encounters import Encounters  # few runs need them

    return [Encounters(basis.users, basis.robots)]


def _conversations(basis: Basis, interventions: InterventionQueue) -> "list[Conversations]":
    """Return the conversations; empty if neither robots nor people want anything."""
    scenario = basis.scenario
    if not scenario.interactions and all(user.answers is None for user in scenario.users.values()):
        return []
    from fleet2d.engine.conversations import Conversations  # few runs need them

    return [Conversations(basis, interventions)]


def _schedule_failures(state: State, scenario: Scenario, clock: Clock, seed: int) -> None:
    """Schedule failures of robots, their cameras, and sensors."""
    robots = scenario.robots.values()
    sensors = [item for item in scenario.objects.values() if isinstance(item, Sensor)]
    causes = [
        *(robot.power for robot in robots),
        *(camera.fails for robot in robots for camera in robot.eyes.values()),
        *(sensor.fails for sensor in sensors),
    ]
    if all(cause is None for cause in causes):
        return
    from fleet2d.engine.power import schedule_failures  # few runs need it

    schedule_failures(state, scenario, clock, seed)


def _schedule_script(state: State, scenario: Scenario) -> None:
    from fleet2d.engine.world import schedule_script  # few runs need it

    # Entries that wait for an event come last: another entry may cause the event.
    entries = sorted(enumerate(scenario.script), key=lambda item: item[1].on is not None)
    for index, entry in entries:
        path = f"script.{index}"
        errors = PlacementError, ScenarioError
        with _locate_errors(scenario, path), errors_as(None, path, of=errors):
            schedule_script(state, entry, index)


def _open_cameras(basis: Basis) -> tuple[list[Cameras], list[Cameras]]:
    """Return the cameras of users and those of robots; none without both users and robots."""
    actors = basis.actors
    users = basis.bodies.users
    real = [actor for actor in actors if getattr(actor.entity, "perceives", None)]
    if real and not users:
        raise ScenarioError(
            f"{real[0].path}.perceives: there are no users to be perceived: add those of the log,"
            " like users: {ana: {type: unknown}} if nobody recorded where they were"
        )
    if not 0 < users < len(actors):
        return [], []
    home = basis.home
    sight = basis.scenario.sight
    method = sight.method.model_copy()
    radii = None
    heights = None
    with blame("sight.method", None):
        method.start(home)
    if sight.people_occlude:
        units = home.lattice.units_per_m
        sizes = [round(actor.entity.radius * units) for actor in actors]
        radii = np.maximum(np.array(sizes, np.int64), 1)
    if sight.heights:
        from fleet2d.engine.heights import BodyHeights  # few runs need it

        heights = BodyHeights(actors)
    own_method = None if isinstance(method, LineOfSight) else method
    shared = SightSetup(actors, users, own_method, radii, heights)
    cameras = [_cameras_of(row, shared) for row, actor in enumerate(actors) if actor.entity.eyes]
    of_users = [group for group in cameras if group.row < users]
    return of_users, cameras[len(of_users) :]


def _cameras_of(row: int, shared: SightSetup) -> Cameras:
    """Return the cameras of one body, or its source of perceptions in their place."""
    if (source := getattr(shared.actors[row].entity, "perceives", None)) is None:
        return Cameras(row, shared)
    from fleet2d.engine.real_sight import RealSight  # few runs need it

    return RealSight(row, shared, source)


def _basis(scenario: Scenario, clock: Clock, seed: int, store: RunStore) -> Basis:
    """Return the basis of a run: its home, and the bodies in it."""
    home = _home_with_doors(scenario)
    people: dict[str, DecidingActor | None] = dict.fromkeys(scenario.users)
    actors = []
    for bucket, entities in (("users", scenario.users), ("robots", scenario.robots)):
        for name, entity in entities.items():
            path = f"{bucket}.{name}"
            with _locate_errors(scenario, path):
                actor = DecidingActor(name, path, entity, home, clock, seed, people=people)
            actors.append(actor)
            if name in people:
                people[name] = actor
    bodies = Bodies(len(scenario.users), len(scenario.robots), clock.step_us)
    for row, actor in enumerate(actors):
        bodies.hold(row, actor.state)
        actor.join(bodies, row)
    return Basis(scenario, clock, seed, store, home, actors, bodies)


def _home_with_doors(scenario: Scenario) -> Home:
    """Return the home, with doors in the doorways that the scenario names."""
    plan = scenario.floorplan.plan()
    doors = []
    door_names = dict[int, str]()
    for name, door in scenario.objects.items():
        if isinstance(door, Door):
            with _locate_errors(scenario, f"objects.{name}"):
                doorway = door.find(plan)
                if doorway.index in door_names:
                    raise PlacementError(
                        f"objects.{name}: {door_names[doorway.index]} hangs in the doorway"
                        f" {doorway.name} already"
                    )
            door_names[doorway.index] = name
            doors.append(doorway)
    home = Home(plan, doors)
    add_layers(home, scenario.floorplan)
    return home


@contextmanager
def _locate_errors(scenario: Scenario, path: str) -> Iterator[None]:
    """Add the place of the key in the scenario to errors."""
    try:
        yield
    except (PlacementError, ScenarioError) as error:
        place = scenario.where(path)
        if not place or str(error).startswith(place):
            raise
        raise type(error)(f"{place}: {error}") from error


def _check_reads(scenario: Scenario, actors: list[DecidingActor]) -> None:
    """Refuse behaviors that read an unknown algorithm, or listen to an unknown event."""
    for actor in actors:
        heard = frozenset().union(*(behavior.listens for behavior in actor.behaviors))
        for name in sorted(heard - WATCHED_EVENTS):
            with errors_as(ScenarioError, f"{actor.path} listens to {name!r}", of=ComponentError):
                actor.entity.check_interrupt(name)
        for behavior in actor.behaviors:
            for name in behavior.reads():
                check_known(name, "algorithm", scenario.algorithms, where=f"{actor.path}: ")


def _remember(state: State, basis: Basis) -> None:
    """Give robots a memory of their sightings if one of their behaviors needs it."""
    for actor in basis.robots:
        cameras = next((group for group in state.cameras if group.owner is actor), None)
        remembered = [] if cameras is None else cameras.remembered
        if actor.rules is not None and actor.rules.minds_sleep:
            from fleet2d.entities.keep_out import SleepMemory

            beliefs = SleepMemory(basis.home.plan)
            actor.sleepers = Recall(state, cameras, beliefs)
            remembered.append(beliefs)
        if not any(behavior.remembers for behavior in actor.behaviors):
            continue
        from fleet2d.entities.robots.policy import SightingMemory  # few robots need it

        memory = SightingMemory(basis.home.plan, len(basis.users), basis.clock)
        actor.recall = Recall(state, cameras, memory)
        remembered.append(memory)


def _log(
    basis: Basis, cameras: list[Cameras], recorder: Recorder, conversations: "list[Conversations]"
) -> Log:
    names = [actor.name for actor in basis.actors]
    log = Log(basis.home, basis.clock, names, basis.bodies, recorder.activities)
    log.cameras = [(group.index, name) for group in cameras for name in group.names]
    log.untracked = frozenset(
        user.name for user in basis.users if user.may_record(EventKind.UNKNOWN)
    )
    for each in conversations:
        log.answers = each.log
        log.wanted = each.wanted
        models = each.answers.items()
        log.answer_models = {basis.users[row].name: model for row, model in models}
    log.beliefs = {c.owner.name: c.drift for c in cameras if c.drift is not None}
    return log
