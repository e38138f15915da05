"""Snapshots: copies of the state of a run in memory and in files, by one mechanism.

A state refers to constants of the run: its scenario, floor plan, clock. A snapshot contains only
their names. A copy shares the constants; a file is read with those of a run that was set up from
the same scenario. A pickle can run any command when it is read: only files are read that this user
has signed.
"""

import copy
import hmac
import io
import json
import pickle
from collections.abc import Callable, Iterable, Mapping
from datetime import datetime, timedelta
from functools import cache
from pathlib import Path
from types import FunctionType
from typing import Any, BinaryIO

import numpy as np
from shapely import Polygon

from fleet2d import __version__
from fleet2d.algorithms.observations import SightingTable
from fleet2d.artifacts.manifest import plain
from fleet2d.artifacts.table import Column, ColumnChunk, TableSpec
from fleet2d.configuration.importing import is_scenario_module, public_name
from fleet2d.engine.basis import ImmutableRows, components_of
from fleet2d.engine.state import RecentEvents, State
from fleet2d.engine.trajectories import KeySegment
from fleet2d.entities.body import RandomWalk, Track
from fleet2d.entities.plan import Note
from fleet2d.errors import ArtifactError, os_errors_as
from fleet2d.floorplan.costmap import CostedSpace
from fleet2d.floorplan.placed_objects import PlacedObject, UsePlace
from fleet2d.floorplan.plan import FloorPlan, Room
from fleet2d.floorplan.space import Space
from fleet2d.inputs import open_input
from fleet2d.kernels import Mesh, Timelines
from fleet2d.runtime.events import Event
from fleet2d.runtime.local_time import LocalTime, Zone
from fleet2d.storage.files import partial_file
from fleet2d.storage.secret_files import SIGNATURE_CHARACTERS, signature

_SCALARS = set(np.sctypeDict.values()) - {np.void, np.object_}
_DTYPES = {type(np.dtype(scalar)) for scalar in _SCALARS}

# Copies in one process share objects of these types, which never change. Some are given by name, as
# few runs need their modules.
_SHARED = frozenset(
    {
        *(Column, ColumnChunk, CostedSpace, Event, FloorPlan, FunctionType, KeySegment, Mesh, Note),
        *(PlacedObject, Polygon, RandomWalk, Room, SightingTable, Space, TableSpec, Track),
        UsePlace,
        *(datetime, timedelta, LocalTime, Zone, *_DTYPES),
    }
)
# Types that are copied by `copy.copy`, as their parts never change.
_COPIED = frozenset({ImmutableRows, RecentEvents, Timelines})
_SHARED_NAMES = frozenset(
    {
        "fleet2d.entities.users.resident.Seat",
        "fleet2d.entities.users.resident.Venue",
        "fleet2d.routines.activity.Activity",
        "fleet2d.routines.activity.DurationDistribution",
        "fleet2d.routines.distributions.Distribution",
        "fleet2d.routines.persona.Persona",
    }
)

MAGIC = b"fleet2d simulation"
# The size of the parts of a file: few parts, and little memory [bytes].
_PART_BYTES = 1 << 22

Constants = Mapping[str, object]


class UnstorableStateError(ArtifactError):
    """A user's component holds something that can't be written to a file."""


def copy_state(state: State, constants: Constants) -> State:
    """Return an independent copy of a state, which shares only objects that never change."""
    buffer = io.BytesIO()
    arrays = list[pickle.PickleBuffer]()
    copier = _StateCopier(buffer, constants, arrays)
    copier.dump(state)
    content = (a if (raw := a.raw()).readonly else bytearray(raw) for a in arrays)
    return _CopyReader(io.BytesIO(buffer.getbuffer()), copier.shared, content).load()


def write_state(file: "BinaryIO | _SnapshotParts", state: State, constants: Constants) -> None:
    """Write a state to a file, by `pickle`.

    Raises:
        UnstorableStateError: A component of the user holds something that can't be written, such as
            an open file.
        OSError: The file can't be written.
    """
    try:
        _StateWriter(file, constants).dump(state)
    except Exception as error:  # a component's own pickling may raise anything
        if error is getattr(file, "error", None):
            raise
        raise UnstorableStateError(f"the state of the run can't be written: {error}") from error


def read_state(file: BinaryIO, constants: Constants) -> State:
    """Read a state that this user wrote, for a run that was set up from the same scenario.

    Raises:
        ArtifactError: The file contains something else, such as classes that are gone by now.
    """
    try:
        state = _StateReader(file, constants).load()
    except Exception as error:  # classes may have changed in any way
        raise ArtifactError(f"the file holds no state of a run: {error}") from error
    if not isinstance(state, State):
        raise ArtifactError("the file holds no state of a run")
    return state


def write_snapshot(
    write: Callable[[bytes], object],
    state: State,
    constants: Constants,
    header: Mapping[str, Any],
    seal: hmac.HMAC,
) -> None:
    """Write a state after a header that describes the run, and the signature of both.

    Args:
        write: Called with one part of the content after the other.
        state: The state.
        constants: The constants of the run by name.
        header: Plain values.
        seal: The signature, of nothing yet.

    Raises:
        UnstorableStateError: See `write_state`.
        OSError: `write` failed.
    """
    parts = _SnapshotParts(write, seal)
    parts.write(MAGIC + b"\n")
    parts.write(json.dumps({"fleet2d": __version__, **plain(header)}).encode() + b"\n")
    write_state(parts, state, constants)
    parts.finish()


def save_snapshot(
    path: str | Path | BinaryIO,
    state: State,
    constants: Constants,
    header: Mapping[str, Any],
    purpose: str,
) -> None:
    """Write a signed snapshot to a file.

    Raises:
        ArtifactError: The state, or the file, can't be written, or this user has no key.
    """
    seal = signature(purpose)
    if not isinstance(path, str | Path):
        write_snapshot(path.write, state, constants, header, seal)
        return
    with (
        os_errors_as(ArtifactError, f"{path} can't be written"),
        partial_file(Path(path)) as partial,
        partial.open("wb") as file,
    ):
        write_snapshot(file.write, state, constants, header, seal)


class _SnapshotParts:
    """The output of a pickler and its signature, written in parts, as a state may be large.

    Attributes:
        error: The error of the function that writes, if it failed.
    """

    def __init__(self, write: Callable[[bytes], object], seal: hmac.HMAC) -> None:
        self._write = write
        self._seal = seal
        self._buffer = bytearray()
        self.error: OSError | None = None

    def write(self, content: bytes) -> None:
        """Add content, and write whole parts."""
        self._buffer += content
        if len(self._buffer) >= _PART_BYTES:
            self._seal.update(self._buffer)
            self._flush()

    def finish(self) -> None:
        """Write the remaining bytes, and the signature of everything."""
        self._seal.update(self._buffer)
        self._buffer += self._seal.hexdigest().encode()
        self._flush()

    def _flush(self) -> None:
        content = bytes(self._buffer)
        self._buffer = bytearray()
        try:
            self._write(content)
        except OSError as error:
            self.error = error
            raise


def open_snapshot(path: str | Path | BinaryIO, purpose: str) -> tuple[dict[str, Any], BinaryIO]:
    """Return the header of a snapshot, and the state after it for `read_state`.

    The signature of the very bytes that are read is checked before anything is interpreted.

    Raises:
        ArtifactError: The file is no snapshot by this user, is damaged, or is of another version of
            Fleet2D.
    """
    with os_errors_as(ArtifactError, f"{path} can't be read"):
        if isinstance(path, str | Path):
            with open_input(path, ArtifactError) as file:
                content = file.read()
        else:
            content = path.read()
    if not content.startswith(MAGIC + b"\n"):
        raise ArtifactError(f"{path} is not a {purpose}")
    seal = signature(purpose)
    view = memoryview(content)
    seal.update(view[:-SIGNATURE_CHARACTERS])
    if not hmac.compare_digest(seal.hexdigest().encode(), view[-SIGNATURE_CHARACTERS:]):
        raise ArtifactError(
            f"{path} is not signed by this user on this machine, or is damaged: it could run any"
            " command, and isn't loaded"
        )
    body = content.index(b"\n", len(MAGIC) + 1) + 1
    header: dict[str, Any] = json.loads(content[len(MAGIC) : body])
    if header["fleet2d"] != __version__:
        raise ArtifactError(
            f"{path} was written by Fleet2D {header['fleet2d']}, and this is {__version__}: only"
            " the same version can load it"
        )
    return header, io.BytesIO(view[body:-SIGNATURE_CHARACTERS])


@cache
def _is_shared(kind: Any) -> bool:
    name = f"{kind.__module__}.{kind.__qualname__}"
    return kind in _SHARED or issubclass(kind, type) or name in _SHARED_NAMES


def shared_object(number: int) -> object:
    """Stand for a shared object in a copy; the reader replaces this function by its own."""
    raise NotImplementedError


class _StateCopier(pickle.Pickler):
    """Leaves out shared objects, and the content of arrays.

    Attributes:
        shared: The shared objects; in the copy each is a call of `shared_object`.
    """

    def __init__(
        self, file: BinaryIO, constants: Constants, arrays: list[pickle.PickleBuffer]
    ) -> None:
        super().__init__(file, pickle.HIGHEST_PROTOCOL, buffer_callback=arrays.append)
        self._constants = {id(value) for value in constants.values()}
        self.shared: list[object] = []

    def reducer_override(self, obj: Any) -> Any:
        """Share an object; not called for plain values, lists and mappings."""
        kind: Any = type(obj)
        if obj is shared_object:
            return NotImplemented
        if kind in _COPIED:
            obj = copy.copy(obj)
        elif not (_is_shared(kind) or id(obj) in self._constants):
            return NotImplemented
        self.shared.append(obj)
        return shared_object, (len(self.shared) - 1,)


class _CopyReader(pickle.Unpickler):
    """Reads the output of a `_StateCopier`."""

    def __init__(self, file: BinaryIO, shared: list[object], arrays: Iterable[Any]) -> None:
        super().__init__(file, buffers=arrays)
        self._shared = shared

    def find_class(self, module: str, name: str) -> Any:
        is_shared = name == shared_object.__name__ and module == __name__
        return self._shared.__getitem__ if is_shared else super().find_class(module, name)


class _StateWriter(pickle.Pickler):
    """Replaces constants by their names."""

    def __init__(self, file: "BinaryIO | _SnapshotParts", constants: Constants) -> None:
        super().__init__(file, pickle.HIGHEST_PROTOCOL)
        self._names = {id(value): name for name, value in constants.items()}

    def persistent_id(self, obj: Any) -> object:
        name = self._names.get(id(obj))
        if name is not None:
            return name
        return ("space", obj.key) if type(obj) is Space else None


class _StateReader(pickle.Unpickler):
    """Looks constants up by name."""

    def __init__(self, file: BinaryIO, constants: Constants) -> None:
        super().__init__(file)
        self._constants = constants
        self._packages = _own_packages(constants["scenario"])

    def persistent_load(self, pid: Any) -> object:
        if isinstance(pid, tuple) and pid[0] == "space":
            return self._constants["shapes"].space_of(*pid[1])  # type: ignore[attr-defined]
        return self._constants[pid]

    def find_class(self, module: str, name: str) -> Any:
        if not is_scenario_module(module):  # this process may know the module by another name
            top, dot, rest = public_name(module).partition(".")
            module = self._packages.get(top, top) + dot + rest
        return super().find_class(module, name)


def _own_packages(scenario: Any) -> dict[str, str]:
    """Return the packages of a scenario's own components in this process by their public names.

    A package may be installed in one process, and come from the scenario's folder in another.
    """
    packages = {}
    for module in {type(component).__module__ for component in components_of(scenario)}:
        public = public_name(module)
        package = public.partition(".")[0]
        packages[package] = module.removesuffix(public) + package
    return packages
