"""The world of a run: its home, its bodies, and all that watches them, set up from a scenario."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from fleet2d.algorithms.log import Log
from fleet2d.artifacts.store import RunStore
from fleet2d.clock import Clock
from fleet2d.engine.buckets import Eye, PoseBlock, open_eyes
from fleet2d.engine.changes import Changes
from fleet2d.engine.clearance import Clearance
from fleet2d.engine.encounters import Encounters
from fleet2d.engine.layers import LayerBook, lay_layers
from fleet2d.engine.learners import Learners
from fleet2d.engine.recorder import Recorder, activities_of
from fleet2d.engine.sensors import Sensors
from fleet2d.engine.tables import sensor_table, table_specs, told_cameras
from fleet2d.entities.actor import Actor
from fleet2d.entities.objects.door import Door
from fleet2d.errors import PlacementError, ScenarioError
from fleet2d.floorplan.home import Home
from fleet2d.problems import did_you_mean
from fleet2d.scenario.model import Scenario


@dataclass
class World:
    """All that takes part in a run.

    Attributes:
        home: The home.
        users: The people.
        robots: The robots.
        block: Everybody's poses in the present span, users first.
        gazes: The cameras, or eyes, of users.
        eyes: The cameras of robots.
        encounters: Between robots and people who react to them.
        clearance: What robots keep from people.
        changes: Of the home.
        sensors: Of the home.
        recorder: Writes down what happens.
        layers: What robots have seen, and what else the home is covered with.
        learners: Algorithms and metrics.
        log: What learners may ask for; None where there are no learners.
    """

    home: Home
    users: list[Actor]
    robots: list[Actor]
    block: PoseBlock
    gazes: list[Eye]
    eyes: list[Eye]
    encounters: Encounters
    clearance: Clearance
    changes: Changes
    sensors: Sensors
    recorder: Recorder
    layers: LayerBook
    learners: Learners
    log: Log | None

    @property
    def actors(self) -> list[Actor]:
        """Users, then robots."""
        return [*self.users, *self.robots]


def set_up(scenario: Scenario, clock: Clock, seed: int, store: RunStore) -> World:
    """Set up what a scenario describes, and add the tables of the run to its store.

    Raises:
        InputError: The floor plan or a place in the scenario is wrong, or names what there isn't.
    """
    home = _furnished_home(scenario)
    users = _actors(scenario, "users", home, clock, seed)
    robots = _actors(scenario, "robots", home, clock, seed)
    actors = [*users, *robots]
    block = PoseBlock(actors)
    gazes, eyes = open_eyes(users, robots, block, scenario.sight.method.model_copy())
    for eye in [*gazes, *eyes]:
        eye.owner.in_view = partial(_in_view, eye)
    _check_reads(scenario, actors)
    encounters, clearance = Encounters(users, robots), Clearance(users, robots)
    changes = Changes(scenario.objects, home, clock)
    for index, change in enumerate(scenario.changes):
        with _placing(scenario, f"changes.{index}"):
            changes.declare(index, change)
    with _placing(scenario, "objects"):
        sensors = Sensors(scenario.objects, changes.names, home, clock, len(users))
    _add_tables(store, scenario, home, eyes, sensors)
    recorder = Recorder(
        store,
        scenario.artifacts,
        clock,
        home,
        actors,
        list(scenario.objects),
        changes=_may_change(scenario),
        eyes=eyes,
        sensors=sensors,
    )
    layers = LayerBook(scenario, home, actors, store, clock)
    learners = _learners(scenario, home, clock, seed, store)
    for eye in [*gazes, *eyes]:
        eye.awaited = learners.awaited
    log = _log(home, actors, eyes, recorder) if learners.all else None
    return World(
        home, users, robots, block, gazes, eyes, encounters, clearance, changes, sensors, recorder,
        layers, learners, log,
    )  # fmt: skip


def _furnished_home(scenario: Scenario) -> Home:
    """Return the home, with a door in every doorway that the scenario names."""
    plan = scenario.floorplan.plan()
    doors, taken = [], dict[int, str]()
    for name, door in scenario.objects.items():
        if isinstance(door, Door):
            with _placing(scenario, f"objects.{name}"):
                doorway = door.find(plan)
                if doorway.index in taken:
                    raise PlacementError(
                        f"objects.{name}: {taken[doorway.index]} hangs in the doorway"
                        f" {doorway.name} already"
                    )
            taken[doorway.index] = name
            doors.append(doorway)
    home = Home(plan, doors)
    lay_layers(home, scenario.floorplan)
    return home


@contextmanager
def _placing(scenario: Scenario, path: str) -> Iterator[None]:
    """Say where in the scenario somebody was put that can't be there."""
    try:
        yield
    except (PlacementError, ScenarioError) as error:
        where = scenario.where(path)
        if not where or str(error).startswith(where):
            raise
        raise type(error)(f"{where}: {error}") from error


def _actors(scenario: Scenario, bucket: str, home: Home, clock: Clock, seed: int) -> list[Actor]:
    entities: Mapping[str, Any] = getattr(scenario, bucket)
    actors = []
    for name, entity in entities.items():
        path = f"{bucket}.{name}"
        with _placing(scenario, path):
            actors.append(Actor(name, path, entity, home, clock, seed))
    return actors


def _check_reads(scenario: Scenario, actors: list[Actor]) -> None:
    """Refuse behaviors that go by an algorithm that there isn't."""
    known = scenario.algorithms
    for actor in actors:
        for read in (read for behavior in actor.behaviors for read in behavior.reads()):
            if read not in known:
                raise ScenarioError(
                    f"{actor.path} goes by {read!r}, which is no algorithm of the scenario"
                    f"{did_you_mean(read, known)} There are: {', '.join(known) or 'none'}"
                )


def _may_change(scenario: Scenario) -> bool:
    """Tell whether the home may change during the run."""
    return bool(scenario.objects or scenario.changes)


def _add_tables(
    store: RunStore, scenario: Scenario, home: Home, eyes: list[Eye], sensors: Sensors
) -> None:
    users, robots = list(scenario.users), list(scenario.robots)
    specs = table_specs(
        users,
        robots,
        [room.name for room in home.rooms],
        scenario.artifacts,
        list(scenario.objects),
        changes=_may_change(scenario),
        cameras=told_cameras(eyes),
        activities=activities_of(eyes, len(users)).are_told,
    )
    if sensors.names:
        specs.append(sensor_table(sensors))
    for spec in specs:
        store.add_table(spec)


def _learners(scenario: Scenario, home: Home, clock: Clock, seed: int, store: RunStore) -> Learners:
    return Learners(
        scenario.algorithms,
        scenario.metrics,
        home,
        clock,
        seed,
        (list(scenario.users), list(scenario.robots)),
        store if scenario.artifacts.outputs else None,
    )


def _log(home: Home, actors: list[Actor], eyes: list[Eye], recorder: Recorder) -> Log:
    log = Log(home, actors)
    log.activities = recorder.activities
    log.cameras = [(eye.index, name) for eye in eyes for name in eye.cameras]
    return log


def _in_view(eye: Eye) -> dict[str, tuple[float, float]]:
    """Return whom the cameras of a body have in view, and where each was perceived last [m]."""
    lattice, found = eye.owner.home.plan.lattice, {}
    for who in np.flatnonzero(eye.memory.seen).tolist():
        x, y = lattice.to_metres(eye.perceived[who]).tolist()
        found[eye.name_of(who)] = (x, y)
    return found
