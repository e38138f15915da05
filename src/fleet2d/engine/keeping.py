"""What a run keeps besides its tables: the manifest, the floor plan, a way to be stopped."""

import json
import os
import signal
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from typing import Any

from fleet2d.artifacts.directory import cannot_write
from fleet2d.artifacts.manifest import Entities, Manifest, input_record, versions
from fleet2d.artifacts.store import RunStore
from fleet2d.blame import blame
from fleet2d.clock import Clock
from fleet2d.engine.inputs import input_files
from fleet2d.engine.pace import Pace
from fleet2d.errors import ArtifactError
from fleet2d.floorplan.formats.native import native_document
from fleet2d.floorplan.home.home import Home
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.runs.run import FLOORPLAN_NAME
from fleet2d.scenario.model import Scenario

SLOW = "simulation.speedup asked for"
"""How the note begins that a run was slower than it should be."""

# Ctrl-C, and what systemd, Docker and Slurm send before they kill.
_STOPPING = (signal.SIGINT, signal.SIGTERM)
_HEARD = {
    signal.SIGINT: b"interrupted: storing what was simulated; Ctrl-C again stops at once\n",
    signal.SIGTERM: b"told to stop: storing what was simulated\n",
}


def describe_start(
    manifest: Manifest, scenario: Scenario, seed: int, clock: Clock, plan: FloorPlan
) -> None:
    """Fill in what is known before the first step."""
    manifest.scenario = scenario.resolved()
    manifest.scenario["simulation"]["seed"] = seed
    manifest.seed = seed
    manifest.step_us = clock.step_us
    manifest.start = clock.start.isoformat()
    manifest.entities = Entities(users=list(scenario.users), robots=list(scenario.robots))
    manifest.versions = versions()
    manifest.inputs = [input_record(path) for path in input_files(scenario)]
    manifest.notes = list(plan.notes)
    for bucket, entities in (("users", scenario.users), ("robots", scenario.robots)):
        manifest.notes += [
            f"{bucket}.{name} has no behavior: it stays where it is"
            for name, entity in entities.items()
            if not entity.behaviors
        ]


def describe_end(
    manifest: Manifest,
    clock: Clock,
    step: int,
    results: Mapping[str, Any],
    wall_s: Mapping[str, float],
    pace: Pace | None,
) -> None:
    """Fill in what is known after the last step."""
    manifest.steps = step
    manifest.simulated_s = step * clock.step_us / 1e6
    manifest.metrics = dict(results)
    manifest.wall_s = dict(wall_s)
    reached = pace.reached(manifest.simulated_s) if pace else 0.0
    if pace and reached < 0.98 * pace.speedup:
        manifest.notes.append(
            f"{SLOW} {pace.speedup:g} times real time;"
            f" {reached:.0f} was reached, for computing took that long"
        )


def open_store(store: RunStore, home: Home) -> None:
    """Make the run directory, and put the floor plan in it.

    Raises:
        RunDirectoryError: The directory can't be used; nothing is left behind.
        ArtifactError: The disk is full; nothing is left behind.
    """
    store.open()
    if store.directory is None:
        return
    try:
        keep_plan(store, home)
    except ArtifactError as error:
        store.discard()
        reason = error.__cause__
        raise (
            cannot_write(store.directory, reason) if isinstance(reason, OSError) else error
        ) from reason


def keep_plan(store: RunStore, home: Home) -> None:
    """Put the floor plan into the run directory.

    Raises:
        ArtifactError: It can't be written.
    """
    document = home.cached("document", lambda: json.dumps(native_document(home.plan)))
    store.keep(FLOORPLAN_NAME, document)


@contextmanager
def deferred_interrupt(stop: Callable[[], None]) -> Iterator[None]:
    """Call `stop` on the first Ctrl-C or SIGTERM, so that no row is half stored.

    It says on stderr that it was heard; a second one acts at once.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.getsignal(number) for number in _STOPPING}

    def put_back() -> None:
        blame.interrupts = True
        for number, handler in before.items():
            signal.signal(number, handler)

    def on_signal(number: int, _: Any) -> None:
        stop()
        put_back()
        with suppress(OSError):  # not by sys.stderr, which may be at work just now
            os.write(2, _HEARD[signal.Signals(number)])

    for number in _STOPPING:
        signal.signal(number, on_signal)
    blame.interrupts = False
    try:
        yield
    finally:
        put_back()
