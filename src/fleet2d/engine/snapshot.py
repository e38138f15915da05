"""Snapshots: copies of the state of a run in memory and in files, by one mechanism.

A state refers to constants of the run: its scenario, floor plan, clock. A snapshot contains only
their names. A copy shares the constants; a file is read with those of a run that was set up from
the same scenario.

Arrays are stored in files as a plain type and the bytes: NumPy's own pickle format trusts the sizes
and flags in a file, so that a wrong file can crash the process or worse.
"""

import copy
import copyreg
import hashlib
import io
import json
import pickle
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from functools import cache
from pathlib import Path
from types import BuiltinFunctionType, FunctionType
from typing import Any, BinaryIO, Literal, Self

import numpy as np
from numpy.typing import NDArray
from shapely import Polygon

from fleet2d import __version__
from fleet2d.algorithms.observations import SightingTable
from fleet2d.artifacts.manifest import plain
from fleet2d.artifacts.table import Column, ColumnChunk, TableSpec
from fleet2d.configuration.trust import current_trust, is_listed, is_scenario_module, public_name
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
from fleet2d.routines.persona import Persona
from fleet2d.runtime.events import Event
from fleet2d.scenario.model import Scenario
from fleet2d.storage.files import partial_file

# Booleans, numbers, times and text of a fixed length.
_PLAIN = frozenset("biufcmMSU")
# Arrays of fewer bytes are copied when they are written.
_SMALL_BYTES = 4096


def plain_type(text: str) -> np.dtype[Any]:
    """Return a type of plain values.

    Raises:
        ArtifactError: It is another type.
    """
    dtype = np.dtype(str(text))
    if dtype.kind not in _PLAIN:
        raise ArtifactError(f"arrays of {dtype} can't be stored in a file: use a plain type")
    return dtype


def plain_array(
    text: str, shape: Sequence[int], content: bytes, order: str, is_writable: bool
) -> NDArray[Any]:
    """Return an array of plain values from its bytes.

    Example:
        >>> plain_array("<i4", (2,), bytes(8), "C", True)
        array([0, 0], dtype=int32)
    """
    kind = plain_type(text)
    values = np.frombuffer(bytes(content), kind) if content else np.empty(0, kind)
    array = np.array(values).reshape(tuple(shape), order="F" if order == "F" else "C")
    array.setflags(write=bool(is_writable))
    return array


def object_array(shape: Sequence[int], content: Sequence[Any]) -> NDArray[Any]:
    """Return an array of Python objects."""
    values = np.empty(len(content), object)
    values[:] = content
    return values.reshape(tuple(shape))


def plain_scalar(text: str, content: bytes) -> Any:
    """Return a single value of a plain type."""
    return np.frombuffer(bytes(content), plain_type(text))[0]


def _reduce_array(array: NDArray[Any]) -> tuple[Any, ...]:
    if array.dtype == object:
        return object_array, (array.shape, list(array.ravel()))
    text = plain_type(array.dtype.str).str
    is_fortran = array.flags.f_contiguous and not array.flags.c_contiguous
    order: Literal["C", "F"] = "F" if is_fortran else "C"
    return plain_array, (text, array.shape, _content(array, order), order, array.flags.writeable)


def _content(array: NDArray[Any], order: Literal["C", "F"]) -> bytes | pickle.PickleBuffer:
    """Return the bytes of an array; those of a large one are not copied."""
    if array.nbytes < _SMALL_BYTES or not (array.flags.c_contiguous or array.flags.f_contiguous):
        return array.tobytes(order)
    view = array.ravel(order).view(np.uint8)
    view.setflags(write=False)  # else it would be stored as a bytearray
    return pickle.PickleBuffer(view.data)


def _reduce_scalar(value: Any) -> tuple[Any, ...]:
    return plain_scalar, (plain_type(value.dtype.str).str, value.tobytes())


def _reduce_type(kind: np.dtype[Any]) -> tuple[Any, ...]:
    return plain_type, (plain_type(kind.str).str,)


_SCALARS = set(np.sctypeDict.values()) - {np.void, np.object_}
_DTYPES = {type(np.dtype(scalar)) for scalar in _SCALARS}

REDUCERS: dict[type, Any] = {
    **copyreg.dispatch_table,
    np.ndarray: _reduce_array,
    **dict.fromkeys(_SCALARS, _reduce_scalar),
    **dict.fromkeys(_DTYPES, _reduce_type),
}
"""The `dispatch_table` of a pickler for arrays, their values and their types."""


# Types of objects that never change: copies in one process share them. Some by name, as few runs
# need their modules.
_SHARED = frozenset(
    {
        *(Column, ColumnChunk, CostedSpace, Event, FloorPlan, FunctionType, KeySegment, Mesh, Note),
        *(Persona, PlacedObject, Polygon, RandomWalk, Room, SightingTable, Space, TableSpec, Track),
        UsePlace,
        *(datetime, timedelta, *_DTYPES),
    }
)
# What is copied by `copy.copy`, as its parts never change.
_COPIED = frozenset({ImmutableRows, RecentEvents, Timelines})
_SHARED_NAMES = frozenset(
    {
        "fleet2d.entities.users.resident.Seat",
        "fleet2d.entities.users.resident.Venue",
        "fleet2d.routines.activity.Activity",
        "fleet2d.routines.activity.DurationDistribution",
        "fleet2d.routines.distributions.Distribution",
    }
)

# Names that a file may refer to besides classes of Fleet2D and of the scenario's own modules.
_ALLOWED = {
    "builtins": {"bool", "complex", "float", "int", "object", "range", "slice", "str"}
    | {"bytearray", "dict", "frozenset", "list", "set", "tuple"},
    "collections": {"Counter", "OrderedDict", "defaultdict", "deque"},
    "copyreg": {"_reconstructor"},
    "datetime": {"date", "datetime", "time", "timedelta"},
    "decimal": {"Decimal"},
    "fractions": {"Fraction"},
    "shapely.io": {"from_wkb"},
    "pathlib": {"Path", "PosixPath", "PurePosixPath", "PureWindowsPath", "WindowsPath"},
}

# Functions of Fleet2D that a file may call: they create plain values.
_CONSTRUCTORS = frozenset({"object_array", "plain_array", "plain_scalar", "plain_type"})

# Packages without classes of states: their objects could read, write or run something.
_NO_STATE = (
    "artifacts.arrow", "artifacts.unfinished", "storage", "runs", "scenario", "options",
    "configuration.components", "configuration.documents", "configuration.trust",
    "engine.checkpoint", "engine.repeat", "engine.simulation", "engine.snapshot",
    "cli", "fit", "paper", "pictures", "published", "studies", "testing", "viewer",
)  # fmt: skip

# Objects that are written as a module and a name.
_REFERENCES = (type, FunctionType, BuiltinFunctionType)

MAGIC = b"fleet2d simulation"
_DIGEST_BYTES = 64  # at the end of the file: SHA-256 of all before, in hexadecimal digits
# Size of the parts of a file [bytes]: as few as possible, and little memory.
_PART_BYTES = 1 << 22

Constants = Mapping[str, object]


class UnstorableStateError(ArtifactError):
    """A component of the user holds something that can't be written to a file."""


def copy_state(state: State, constants: Constants) -> State:
    """Return an independent copy of a state, which shares only objects that never change."""
    buffer, arrays = io.BytesIO(), list[pickle.PickleBuffer]()
    copier = _StateCopier(buffer, constants, arrays)
    copier.dump(state)
    content = (a if (raw := a.raw()).readonly else bytearray(raw) for a in arrays)
    return _CopyReader(io.BytesIO(buffer.getbuffer()), copier.shared, content).load()


def read_state(file: BinaryIO, constants: Constants) -> State:
    """Read a state from a file, for a run that was set up from the same scenario.

    Raises:
        ArtifactError: The file contains something else, or is damaged.
    """
    try:
        state = _StateReader(file, constants).load()
    except ArtifactError:
        raise
    except Exception as error:  # a damaged pickle may raise anything
        raise ArtifactError(f"the file holds no state of a run: {error}") from error
    if not isinstance(state, State):
        raise ArtifactError("the file holds no state of a run")
    return state


def write_snapshot(
    write: Callable[[bytes], object], state: State, constants: Constants, header: Mapping[str, Any]
) -> None:
    """Write a state after a header that describes the run.

    Args:
        write: Called with one part of the content after the other.
        state: The state.
        constants: The constants of the run by name.
        header: Plain values.

    Raises:
        UnstorableStateError: A component of the user holds something that can't be written, such as
            an open file.
        OSError: `write` failed.
    """
    parts = _SnapshotParts(write)
    parts.write(MAGIC + b"\n")
    parts.write(json.dumps({"fleet2d": __version__, **plain(header)}).encode() + b"\n")
    try:
        _StateWriter(parts, constants).dump(state)
    except ArtifactError as error:
        raise UnstorableStateError(str(error)) from error
    except Exception as error:  # a component's own pickling may raise anything
        if error is parts.error:
            raise
        raise UnstorableStateError(f"the state of the run can't be written: {error}") from error
    parts.finish()


def save_snapshot(
    path: str | Path | BinaryIO, state: State, constants: Constants, header: Mapping[str, Any]
) -> None:
    """Write a snapshot to a file.

    Raises:
        ArtifactError: The state, or the file, can't be written.
    """
    if not isinstance(path, str | Path):
        write_snapshot(path.write, state, constants, header)
        return
    with (
        os_errors_as(ArtifactError, f"{path} can't be written"),
        partial_file(Path(path)) as partial,
        partial.open("wb") as file,
    ):
        write_snapshot(file.write, state, constants, header)


class _SnapshotParts:
    """The output of a pickler and its digest, written in parts, as a state may be large.

    Attributes:
        error: The error of the function that writes, if it failed.
    """

    def __init__(self, write: Callable[[bytes], object]) -> None:
        self._write, self._hash, self._buffer = write, hashlib.sha256(), bytearray()
        self.error: OSError | None = None

    def write(self, content: bytes) -> None:
        """Add content, and write it when there is enough."""
        self._buffer += content
        if len(self._buffer) >= _PART_BYTES:
            self._hash.update(self._buffer)
            self._flush()

    def finish(self) -> None:
        """Write what remains, and the digest of everything."""
        self._hash.update(self._buffer)
        self._buffer += self._hash.hexdigest().encode()
        self._flush()

    def _flush(self) -> None:
        content, self._buffer = bytes(self._buffer), bytearray()
        try:
            self._write(content)
        except OSError as error:
            self.error = error
            raise


def open_snapshot(path: str | Path | BinaryIO) -> tuple[dict[str, Any], BinaryIO]:
    """Return the header of a snapshot, and the state after it for `read_state`.

    Raises:
        ArtifactError: It is not a snapshot, is damaged, or is of another version of Fleet2D.
    """
    with os_errors_as(ArtifactError, f"{path} can't be read"):
        if isinstance(path, str | Path):
            with open_input(path, ArtifactError) as file:
                content = file.read()
        else:
            content = path.read()
    first, _, body = content.removeprefix(MAGIC + b"\n").partition(b"\n")
    if not content.startswith(MAGIC + b"\n"):
        raise ArtifactError(f"{path} is not a saved simulation")
    view, digest = memoryview(content)[:-_DIGEST_BYTES], content[-_DIGEST_BYTES:]
    if hashlib.sha256(view).hexdigest().encode() != digest:
        raise ArtifactError(f"{path} is damaged (its digest differs): save the simulation again")
    try:
        header: dict[str, Any] = json.loads(first)
        _ = [header[key] for key in ("fleet2d", "scenario", "seed", "wall_s")]
    except (ValueError, TypeError, KeyError):
        raise ArtifactError(f"{path} is not a saved simulation") from None
    if header["fleet2d"] != __version__:
        raise ArtifactError(
            f"{path} was written by Fleet2D {header['fleet2d']}, and this is {__version__}: only"
            " the same version can load it"
        )
    return header, io.BytesIO(memoryview(body)[:-_DIGEST_BYTES])


@cache
def _is_shared(kind: Any) -> bool:
    name = f"{kind.__module__}.{kind.__qualname__}"
    return kind in _SHARED or issubclass(kind, type) or name in _SHARED_NAMES


def shared_object(number: int) -> object:
    """Stand for a shared object in a copy, whose reader replaces this function by its own."""
    raise NotImplementedError


class _StateCopier(pickle.Pickler):
    """Leaves out what a copy shares, and the content of arrays.

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
    """Reads what a `_StateCopier` wrote."""

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
        self.dispatch_table = REDUCERS
        self._code = _OwnCode.of(constants)
        self._checked: set[int] = set()  # references to classes that are allowed, by id

    def persistent_id(self, obj: Any) -> object:
        name = self._names.get(id(obj))
        if name is not None:
            return name
        if isinstance(obj, _REFERENCES) and id(obj) not in self._checked:
            module, name = obj.__module__ or "builtins", obj.__qualname__
            if not may_refer(module, name, self._code) and obj is not type(None):
                raise ArtifactError(
                    f"the state of the run can't be written: it refers to {module}.{name}"
                )
            self._checked.add(id(obj))
        return ("space", obj.key) if type(obj) is Space else None


class _StateReader(pickle.Unpickler):
    """Looks constants up by name; creates only plain values, and objects of allowed classes."""

    def __init__(self, file: BinaryIO, constants: Constants) -> None:
        super().__init__(file)
        self._constants, self._code = constants, _OwnCode.of(constants)

    def persistent_load(self, pid: Any) -> object:
        if isinstance(pid, tuple) and pid[0] == "space":
            return self._constants["shapes"].space_of(*pid[1])  # type: ignore[attr-defined]
        return self._constants[pid]

    def find_class(self, module: str, name: str) -> Any:
        if not is_scenario_module(module):  # it may be one under another name in this process
            top, dot, rest = public_name(module).partition(".")
            module = self._code.packages.get(top, top) + dot + rest
        # The state of a run in a directory names its store only.
        is_other_store = module == "fleet2d.artifacts.store" and "store" in self._constants
        # A file imports nothing of the user's: the scenario has imported what was listed.
        is_ours = module.partition(".")[0] == "fleet2d" or name in _ALLOWED.get(module, ())
        is_missing = not is_ours and module not in sys.modules
        if not is_other_store and not is_missing and may_refer(module, name, self._code):
            value = super().find_class(module, name)
            if name in _ALLOWED.get(module, ()) or module == __name__:
                return value
            # Only a class that the module defines: a class that it imports could be any.
            if isinstance(value, type) and (value.__module__, value.__qualname__) == (module, name):
                return value
        raise ArtifactError(f"the file refers to {module}.{name}, which can't be part of a state")


@dataclass(frozen=True)
class _OwnCode:
    """The code outside Fleet2D whose classes a state may hold.

    Attributes:
        packages: The packages that the scenario's components come from: the name of each in this
            process by its public name, since it may be installed in one process, and come from the
            folder of the scenario in another.
        classes: The classes of the scenario's components; None: all classes of these packages and
            of scenarios' folders, in which all code is the user's own.
    """

    packages: Mapping[str, str] = field(default_factory=dict)
    classes: frozenset[type] | None = None

    @classmethod
    def of(cls, constants: Constants) -> Self:
        """Return that of the scenario of a run."""
        scenario = constants.get("scenario")
        types = map(type, components_of(scenario)) if isinstance(scenario, Scenario) else ()
        own = frozenset(kind for kind in types if not kind.__module__.startswith("fleet2d."))
        packages = {}
        for kind in own:
            public = public_name(kind.__module__)
            package = public.partition(".")[0]
            packages[package] = kind.__module__.removesuffix(public) + package
        return cls(packages, None if current_trust() is None else own)

    def may_hold(self, module: str) -> bool:
        """Whether the classes of a module outside of Fleet2D may be part of a state."""
        if self.classes is not None:
            return is_listed(module, self.classes)
        return module.partition(".")[0] in self.packages or is_scenario_module(module)


def may_refer(module: str, name: str, code: _OwnCode | None = None) -> bool:
    """Whether the file of a state may refer to a name.

    Args:
        module: The module of the name.
        name: The qualified name in that module.
        code: The user's own code; None: there is none.

    Example:
        >>> may_refer("fleet2d.engine.state", "State"), may_refer("os", "system")
        (True, False)
    """
    if name in _ALLOWED.get(module, ()) or (module == __name__ and name in _CONSTRUCTORS):
        return True
    if f"{module}.".startswith(tuple(f"fleet2d.{package}." for package in _NO_STATE)):
        return False
    if module.partition(".")[0] == "fleet2d":
        return True
    return (_OwnCode() if code is None else code).may_hold(module)
