"""The manifest and the floor plan of a run, and its end by a signal."""

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

SLOW = "simulation.speedup is"
"""Beginning of the note that a run was slower than its speedup."""

# The messages of Ctrl-C, and of the signal that systemd, Docker and Slurm send before they kill.
_MESSAGES = {
    signal.SIGINT: b"interrupted: storing what was simulated; Ctrl-C again stops at once\n",
    signal.SIGTERM: b"terminated: storing what was simulated\n",
}


def describe_start(
    manifest: Manifest, scenario: Scenario, seed: int, clock: Clock, plan: FloorPlan
) -> None:
    """Set the fields of a manifest that are known before the first step."""
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
    """Set the fields of a manifest that are known after the last step."""
    manifest.steps = step
    manifest.simulated_s = step * clock.step_us / 1e6
    manifest.metrics = dict(results)
    manifest.wall_s = dict(wall_s)
    speedup = pace.speedup_until(manifest.simulated_s) if pace else 0.0
    if pace and speedup < 0.98 * pace.speedup:
        manifest.notes.append(
            f"{SLOW} {pace.speedup:g}, but only {speedup:.0f} times real time was reached, because"
            " computing took longer"
        )


def open_store(store: RunStore, home: Home) -> None:
    """Create the run directory, and store the floor plan in it.

    Raises:
        RunDirectoryError: The directory can't be used; no new file remains.
        ArtifactError: The disk is full; no new file remains.
    """
    store.open()
    if store.directory is None:
        return
    try:
        store_plan(store, home)
    except ArtifactError as error:
        store.discard()
        reason = error.__cause__
        raise (
            cannot_write(store.directory, reason) if isinstance(reason, OSError) else error
        ) from reason


def store_plan(store: RunStore, home: Home) -> None:
    """Store the floor plan in the run directory.

    Raises:
        ArtifactError: It can't be written.
    """
    document = home.cached("document", lambda: json.dumps(native_document(home.plan)))
    store.keep(FLOORPLAN_NAME, document)


@contextmanager
def deferred_interrupt(stop: Callable[[], None]) -> Iterator[None]:
    """Call `stop` on the first Ctrl-C or SIGTERM, so that no row is stored partially.

    A message on stderr confirms the signal; a second signal has its usual effect.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    handlers = {number: signal.getsignal(number) for number in _MESSAGES}

    def restore() -> None:
        blame.interrupts = True
        for number, handler in handlers.items():
            signal.signal(number, handler)

    def on_signal(number: int, _: Any) -> None:
        stop()
        restore()
        with suppress(OSError):  # not by sys.stderr, whose methods the signal may have interrupted
            os.write(2, _MESSAGES[signal.Signals(number)])

    for number in _MESSAGES:
        signal.signal(number, on_signal)
    blame.interrupts = False
    try:
        yield
    finally:
        restore()
