"""What is known of a run for its manifest, its floor plan on disk, and its end by a signal."""

import json
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fleet2d.artifacts.manifest import FLOORPLAN_NAME
from fleet2d.artifacts.store import RunStore, cannot_write
from fleet2d.engine.inputs import input_files
from fleet2d.engine.pace import Pace
from fleet2d.engine.state import State
from fleet2d.errors import ArtifactError, blame
from fleet2d.floorplan.formats.native import native_document
from fleet2d.floorplan.home.home import Home
from fleet2d.runtime.clock import Clock
from fleet2d.scenario.model import Scenario

# The messages of Ctrl-C, and of the signal that systemd, Docker and Slurm send before they kill.
_MESSAGES = {
    signal.SIGINT: b"interrupted: storing what was simulated; Ctrl-C again stops at once\n",
    signal.SIGTERM: b"terminated: storing what was simulated\n",
}


@dataclass
class EngineFacts:
    """All that the engine knows of a run: what `ManifestFacts` has."""

    scenario: Scenario
    seed: int
    clock: Clock
    state: State
    wall_s: Mapping[str, float]
    pace: Pace | None
    results: Mapping[str, Any]

    @property
    def input_files(self) -> list[Path]:
        """The files that the run reads."""
        return input_files(self.scenario)


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
        # Not by sys.stderr, whose methods the signal may have interrupted. If stderr was closed,
        # its number may be that of another file.
        if sys.__stderr__ is not None:
            with suppress(OSError):
                os.write(2, _MESSAGES[signal.Signals(number)])

    for number in _MESSAGES:
        signal.signal(number, on_signal)
    blame.interrupts = False
    try:
        yield
    finally:
        restore()
