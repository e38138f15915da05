"""Algorithms: components that learn from the history of a run, their outputs, and learned state."""

from collections.abc import Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fleet2d.algorithms.history import History
from fleet2d.bounds import LEARNED_BYTES, one_line
from fleet2d.configuration.components import Component
from fleet2d.configuration.problems import suggest
from fleet2d.configuration.units import InputPath, PositiveDuration
from fleet2d.errors import ComponentError, InputError
from fleet2d.floorplan.home import Home, HomeChanges
from fleet2d.kernels import F64
from fleet2d.runtime.clock import Clock
from fleet2d.runtime.determinism import Draws, stream_key
from fleet2d.storage.archives import read_arrays

# Joins the names of nested mappings in the names of the file's arrays.
SEPARATOR = "/"
WITHHELD = "withheld"
"""Stands for an output that nobody may read."""
FROZEN = "frozen"
"""Stands for the newest output at the moment at which an intervention freezes it."""
# The columns of every table.
RESERVED = frozenset({"step", "time"})


def save_learned(state: Mapping[str, Any], path: Path, where: str) -> None:
    """Write the learned state of an algorithm: arrays, numbers and texts in nested mappings.

    Args:
        state: The return value of `Algorithm.remember`.
        path: The file to write, .npz as NumPy reads it.
        where: The algorithm's path in the scenario, for errors.

    Raises:
        ComponentError: It has a value of another type; the message names it.
    """
    arrays = dict(_flat(state, "", where))
    with path.open("wb") as file:
        np.savez(file, **arrays)  # type: ignore[arg-type]


def load_learned(path: Path) -> dict[str, Any]:
    """Read the learned state of an algorithm: nested mappings of arrays, numbers and texts.

    Raises:
        InputError: The file is damaged, or holds no learned state.
    """
    state: dict[str, Any] = {}
    try:
        for name, array in read_arrays(path, LEARNED_BYTES).items():
            *parents, last = name.split(SEPARATOR)
            mapping = state
            for key in parents:
                mapping = mapping.setdefault(key, {})
            mapping[last] = array if array.ndim else array.item()
    except InputError:
        raise
    except Exception as error:  # noqa: BLE001 - a damaged archive raises almost anything
        raise InputError(
            f"{path} is not a file of learned state ({one_line(error, 100)}): give a .npz file of"
            " the folder learned/ of a run"
        ) from None
    return state


def run_state(component: Any) -> dict[str, Any]:
    """Return the attributes of a component that are not configuration."""
    fields = type(component).model_fields
    return {name: value for name, value in vars(component).items() if name not in fields}


def check_shapes(initial: Mapping[str, Any], learned: Mapping[str, Any], where: str) -> None:
    """Refuse learned arrays whose shapes differ from those that `start` made.

    Raises:
        ComponentError: A shape differs, as of another home; or there is a NaN.
    """
    for name, value in learned.items():
        start = initial.get(name)
        if isinstance(value, Mapping) and isinstance(start, Mapping):
            check_shapes(start, value, where)
            continue
        check_numbers(name, value, where)
        if isinstance(start, np.ndarray) and start.size and np.shape(value) != start.shape:
            raise ComponentError(
                f"{where}: the learned state has {name!r} of shape {np.shape(value)}, but this home"
                f" and its users need {start.shape}: it was learned in another home"
            )


def check_numbers(name: str, value: Any, where: str) -> None:
    """Refuse NaN in a learned state.

    Raises:
        ComponentError: There is a NaN.
    """
    if isinstance(value, Mapping):
        for inner, entry in value.items():
            check_numbers(f"{name}{SEPARATOR}{inner}", entry, where)
    elif np.asarray(value).dtype.kind == "f" and np.isnan(value).any():
        raise ComponentError(f"{where}: the learned state has NaN in {name!r}: it is damaged")


def _flat(state: Mapping[str, Any], above: str, where: str) -> Iterator[tuple[str, NDArray[Any]]]:
    for name, value in state.items():
        path = f"{above}{name}"
        if SEPARATOR in str(name) or not name:
            raise ComponentError(
                f"{where}: remember() returned the name {name!r}: names can't contain {SEPARATOR!r}"
            )
        if isinstance(value, Mapping):
            yield from _flat(value, f"{path}{SEPARATOR}", where)
            continue
        array = np.asarray(value)
        if array.dtype.kind not in "biufU":
            raise ComponentError(
                f"{where}: remember() returned {path!r}, a {type(value).__name__}: only arrays,"
                " numbers and texts can be stored; write remember() and recall() that convert it"
            )
        yield path, array


class RoomDistribution:
    """A probability for each room: weights divided by their sum (uniform if the sum is zero).

    Attributes:
        share: float64 (rooms,), sums to one.

    Raises:
        ComponentError: A weight is negative or not a number.

    Example:
        >>> RoomDistribution([3, 1, 0, 0]).share
        array([0.75, 0.25, 0.  , 0.  ])
    """

    def __init__(self, weights: ArrayLike) -> None:
        values = np.array(weights, dtype=np.float64)
        if values.ndim != 1 or not len(values):
            raise ComponentError(
                f"a room distribution needs one weight per room, got shape {values.shape}"
            )
        if not (np.isfinite(values).all() and (values >= 0).all()):
            raise ComponentError(
                f"a room distribution needs finite weights of 0 or more, got {values}"
            )
        total = values.sum()
        self.share: F64 = values / total if total > 0 else np.full(len(values), 1 / len(values))

    def __repr__(self) -> str:
        """Show the shares."""
        return f"RoomDistribution({self.share.round(4).tolist()})"


class Outputs(Mapping[str, Any]):
    """The newest output of each algorithm: a read-only mapping by name.

    Args:
        newest: The outputs, by name.
        known: The names of all algorithms, also of those without an output so far.

    Example:
        >>> outputs = Outputs({"ltp": 3}, ["ltp", "rtp"])
        >>> outputs["ltp"], outputs.get("rtp"), "rtp" in outputs
        (3, None, False)
        >>> outputs["xyz"]
        Traceback (most recent call last):
        fleet2d.errors.ComponentError: there is no algorithm 'xyz'. There are: ltp, rtp
    """

    def __init__(self, newest: Mapping[str, Any], known: Iterable[str]) -> None:
        self._newest = newest
        self._known = tuple(known)

    def __getitem__(self, name: str) -> Any:
        """Return an output.

        Raises:
            ComponentError: There is no such algorithm, or it has no output so far.
        """
        if name in self._newest:
            return self._newest[name]
        if name in self._known:
            raise ComponentError(
                f"{name!r} has no output yet: use outputs.get({name!r}), which is None until then"
            )
        raise ComponentError(f"there is no algorithm {name!r}{suggest(name, self._known)}")

    def get(self, name: str, default: Any = None) -> Any:
        """Return an output, or `default` if there is none so far."""
        return self._newest.get(name, default)

    def __contains__(self, name: object) -> bool:
        """Return whether an algorithm has an output so far."""
        return name in self._newest

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names of the algorithms with an output."""
        return iter(self._newest)

    def __len__(self) -> int:
        """Return the number of outputs."""
        return len(self._newest)


def to_columns(output: Any, rooms: Sequence[str], where: str) -> dict[str, NDArray[Any]]:
    """Return an output as columns of equal length: a distribution, one row, or arrays.

    Args:
        output: A RoomDistribution (columns room, share), HomeChanges (change, target), a mapping
            of names to numbers or strings (one row), a mapping of names to arrays of one length,
            or an object whose `to_columns(rooms)` returns such a mapping.
        rooms: The names of the rooms.
        where: The component's path, for errors.

    Raises:
        ComponentError: The output is none of these, or holds a number that isn't finite.

    Example:
        >>> to_columns({"sightings": 3}, [], "algorithms.mine")
        {'sightings': array([3])}
    """
    if isinstance(output, RoomDistribution):
        if len(output.share) != len(rooms):
            raise ComponentError(
                f"{where} returned {len(output.share)} shares, but the home has {len(rooms)} rooms"
            )
        return {"room": np.array(rooms, dtype=object), "share": output.share}
    if isinstance(output, HomeChanges):
        return output.to_columns()
    if not isinstance(output, Mapping) and hasattr(output, "to_columns"):
        output = output.to_columns(rooms)
    if not isinstance(output, Mapping) or not output:
        raise ComponentError(
            f"{where} returned {output!r}, expected a RoomDistribution, or a mapping of names to"
            " numbers or to arrays of one length"
        )
    columns = {str(name): _column(str(name), value, where) for name, value in output.items()}
    lengths = {name: len(values) for name, values in columns.items()}
    if len(set(lengths.values())) > 1:
        raise ComponentError(f"{where} returned arrays of different lengths: {lengths}")
    return columns


def _column(name: str, value: Any, where: str) -> NDArray[Any]:
    """Return numbers, or texts as objects, of one dimension; refuse others."""
    values = np.atleast_1d(np.asarray(value))
    values = values.astype(object) if values.dtype.kind == "U" else values
    if name in RESERVED:
        raise ComponentError(f"{where} returned {name!r}, a column that every table has: rename it")
    if values.ndim != 1:
        raise ComponentError(
            f"{where} returned {name!r} of shape {values.shape}, expected a number or an array of"
            " one dimension"
        )
    is_text = values.dtype.kind == "O" and all(
        issubclass(cls, str) for cls in set(map(type, values.tolist()))
    )
    if values.dtype.kind not in "biuf" and not is_text:
        example = values.tolist()[0] if values.dtype.kind == "O" else values.dtype
        raise ComponentError(
            f"{where} returned {name!r} with {example}, expected numbers or strings"
        )
    if values.dtype.kind == "f" and not np.isfinite(values).all():
        raise ComponentError(f"{where} returned {name!r} with a value that is not finite: {values}")
    return values


@dataclass(frozen=True)
class Present:
    """The state of a run when an algorithm or a metric is updated.

    Attributes:
        path: The component's path in the scenario, "algorithms.ltp".
        step: The present step; its history ends with it.
        time: Its local time.
        start: The local time of step 0.
        home: The home.
        users: Names of the users, in the order of their indices.
        robots: Names of the robots.
        outputs: The newest output of each algorithm updated before, by name.
    """

    path: str
    step: int
    time: datetime
    start: datetime
    home: Home
    users: tuple[str, ...]
    robots: tuple[str, ...]
    outputs: Mapping[str, Any]
    seed: int

    def random(self, purpose: str) -> Draws:
        """Return the random draws of this component for one purpose, at this step."""
        return Draws(np.uint64(stream_key(self.seed, self.path, purpose)), self.step)


class Algorithm(Component):
    """Base of algorithms, which compute outputs from the history; a subclass writes `update`.

    It is updated after every full `period`, with the history of exactly that period; or, with `on`,
    at the end of each step in which one of these events happens, with the history since the last
    update. What `update` returns (a RoomDistribution, or a mapping of names to numbers or arrays;
    None for nothing) is stored as rows of the algorithm's table, and all components read it from
    the next step on. Run state is set in `start`.

    Attributes:
        period: How often it is updated.
        on: Events that update it, instead of the period: user_seen, user_lost, sensor, or what a
            robot's plan notes.
        reads: Algorithms whose output it uses; they are updated before it.
        learned: Learned state to start from: a file of the folder learned/ of another run.

    Example:
        >>> import numpy as np
        >>> from fleet2d import Algorithm, RoomDistribution
        >>> class SightingShare(Algorithm):
        ...     '''Share of sightings per room.'''
        ...     def start(self, home):
        ...         self.counts = np.zeros(len(home.rooms))
        ...     def update(self, history, state):
        ...         rooms = history.observations.room
        ...         self.counts += np.bincount(rooms, minlength=len(self.counts))
        ...         return RoomDistribution(self.counts)
        >>> SightingShare(period="30 min").period.total_seconds()
        1800.0
    """

    kind = "algorithm"
    # How far before its period it reads the history; timedelta.max: all of it.
    looks_back: ClassVar[timedelta] = timedelta(0)
    # Whether it is about the present: what it knows is lost while no robot is on.
    is_real_time: ClassVar[bool] = False
    # The data that it needs computed: evidence, exposure, explored, first_seen, last_seen …
    needs: ClassVar[Set[str]] = frozenset()

    period: PositiveDuration = timedelta(hours=1)
    on: tuple[str, ...] = ()
    reads: tuple[str, ...] = ()

    learned: InputPath | None = None

    def start(self, home: Home) -> None:
        """Prepare for a run."""

    def remember(self) -> Mapping[str, Any]:
        """Return the learned state: arrays, numbers and texts, in mappings of any depth.

        By default that is all run state: the attributes that are not configuration.
        """
        return run_state(self)

    def recall(self, learned: Mapping[str, Any]) -> None:
        """Restore what `remember` returned in another run; called after `start`.

        Raises:
            ComponentError: It was learned in a home with other rooms.
        """
        check_shapes(run_state(self), learned, type(self).__name__)
        for name, value in learned.items():
            setattr(self, name, value)

    def long_term_state(self) -> Mapping[str, Any]:
        """Return what a real-time algorithm keeps while no robot is on; see `remember`."""
        return self.remember()

    def check_times(self, clock: Clock) -> None:
        """Refuse input whose times are all outside of the run; called before the run begins.

        Args:
            clock: The steps of the run.

        Raises:
            InputError: They are.
        """

    def check_learned(self, users: Sequence[str], start: datetime) -> None:
        """Refuse a state learned with other users; called after `recall`, before the run begins.

        Args:
            users: Names of the users of this run.
            start: Local time of step 0.

        Raises:
            ComponentError: The learned state doesn't fit.
        """

    def check_sources(self, sources: "Mapping[str, Algorithm]") -> None:
        """Refuse algorithms in `reads` with unusable outputs; called before the run begins.

        Args:
            sources: Those algorithms, by name.

        Raises:
            ComponentError: It can't use the output of one of them.
        """

    def files(self) -> list[Path]:
        """Return the files that it reads: the run stores their digests, to be reproducible."""
        return [] if self.learned is None else [self.learned]

    def update(self, history: History, state: Present) -> Any:
        """Process the history since the last update; return the output, or None."""
        raise NotImplementedError
