"""Observations: sightings of people and their activities by robots, and the truth behind them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from fleet2d.floorplan.plan import FloorPlan, read_only
from fleet2d.kernels import (
    F64,
    I8,
    I16,
    I32,
    I64,
    ONE,
    U64,
    fill_from_neighbors,
    in_radians,
    random_shares,
    rooms_at,
)
from fleet2d.kernels import SightingColumn as Column

Names = NDArray[np.object_]  # str, or None where no activity is known

# Columns of observations are those of the sight kernel, followed by the robot's index.
ROBOT = len(Column)
NOTHING = 0  # the code for no known activity
NOWHERE = -1  # the room of a body that is away
OBSERVATION = ROBOT + 1  # number of columns of a row of observations


@dataclass(frozen=True, slots=True)
class SightingTable:
    """Sightings, or observations, in order of step.

    While nobody moves, most repeat the one before at another step, so what was seen is stored once.

    Attributes:
        step: int64 (n,), when each became known.
        index: int32 (n,), the number of each among the distinct ones.
        distinct: int64 (k, columns), sightings that differ not only in the step.

    Example:
        >>> rows = np.zeros((2, OBSERVATION), np.int64)
        >>> rows[:, Column.STEP] = 5, 9
        >>> both = SightingTable(np.array([5, 6, 7]), np.array([0, 0, 0], np.int32), rows[:1])
        >>> len(both), both.between(6, 9).step.tolist()
        (3, [6, 7])
        >>> SightingTable.joined([both, SightingTable.of_rows(rows)]).index.tolist()
        [0, 0, 0, 1, 2]
    """

    step: I64
    index: I32
    distinct: I64

    def __len__(self) -> int:
        """Return the number of sightings."""
        return len(self.step)

    @classmethod
    def of_rows(cls, rows: I64) -> Self:
        """Return sightings from all columns of each: int64 (n, columns)."""
        return cls(rows[:, Column.STEP], np.arange(len(rows), dtype=np.int32), rows)

    @classmethod
    def joined(cls, blocks: "Sequence[SightingTable]") -> "SightingTable":
        """Return one or more blocks, one after the other."""
        if len(blocks) == 1:
            return blocks[0]
        counts = [len(block.distinct) for block in blocks]
        index = np.concatenate([block.index for block in blocks])
        index += np.repeat(np.cumsum([0, *counts[:-1]]), [len(block) for block in blocks])
        return cls(
            np.concatenate([block.step for block in blocks]),
            index,
            np.concatenate([block.distinct for block in blocks]),
        )

    def between(self, first: int, end: int) -> "SightingTable":
        """Return those of the steps from `first` to `end` - 1."""
        part = slice(*np.searchsorted(self.step, (first, end)).tolist())
        index = self.index[part]
        distinct = self.distinct
        if len(index) < len(distinct):
            is_used = np.bincount(index, minlength=len(distinct)) > 0
            index = (np.cumsum(is_used, dtype=np.int32) - 1)[index]
            distinct = distinct[is_used]
        return SightingTable(self.step[part], index, distinct)

    def rows(self) -> I64:
        """Return all columns of each: int64 (n, columns), stored by column."""
        rows: I64 = np.take(self.distinct.T, self.index, axis=1).T
        rows[:, Column.STEP] = self.step
        return rows


class PlacedSightings(NamedTuple):
    """When and where users were perceived; as in `SightingTable`, what was seen is stored once.

    Attributes:
        step: int64 (n,), when each became known.
        number: int32 (n,), that of each among the distinct ones.
        user: int64 (k,), the recognized user of each distinct one, below 0 if not recognized.
        place: int64 (k,), the room or the patch where each was perceived.
    """

    step: I64
    number: I32
    user: I64
    place: I64


@dataclass(frozen=True)
class ActivitySense:
    """How one camera perceives activities.

    Attributes:
        latency: Steps from a look to its observations.
        keys: uint64 (users,), the key of the random stream of each user.
        confusion: For each activity, the probabilities of being mistaken for others; None: this
            camera perceives no activities.
    """

    latency: int
    keys: U64
    confusion: Mapping[str, Mapping[str, float]] | None


class Activities:
    """The activities of each user over time, and how the cameras of each robot perceive them.

    Attributes:
        are_perceived: Whether any camera perceives activities.

    Example:
        >>> sense = ActivitySense(0, np.array([7], np.uint64), {"cook": {"bake": 1.0}})
        >>> activities = Activities(1, {(0, 0): sense})
        >>> activities.begin(0, 10, "cook")
        >>> rows = np.zeros((2, ROBOT + 1), np.int64)
        >>> rows[:, Column.STEP] = 9, 10
        >>> activities.true(rows).tolist(), activities.perceived(rows).tolist()
        ([None, 'cook'], [None, 'bake'])
    """

    def __init__(self, users: int, senses: Mapping[tuple[int, int], ActivitySense]) -> None:
        """Begin without activities; `senses` are by index of the robot and of its camera."""
        self._senses = dict(senses)
        self.are_perceived = any(sense.confusion is not None for sense in senses.values())
        self._codes: dict[str | None, int] = {None: NOTHING}
        self._starts: list[tuple[list[int], list[int]]] = [([], [NOTHING]) for _ in range(users)]

    @property
    def users(self) -> int:
        """Number of users."""
        return len(self._starts)

    def begin(self, user: int, step: int, activity: str) -> None:
        """Record the activity of a user from a step on; steps must not decrease."""
        steps, codes = self._starts[user]
        if not self.are_perceived:  # then only the present one is asked for
            steps.clear()
            codes.clear()
        steps.append(step)
        codes.append(self._code(activity))

    def now(self, user: int) -> str | None:
        """Return the activity that a user began last; None if none is known."""
        return list(self._codes)[self._starts[user][1][-1]]

    def true(self, rows: I64) -> Names:
        """Return the true activity of the user of each row at its look: object (n,)."""
        return self._names(self._codes_of(rows)[0])

    def perceived(self, rows: I64) -> Names:
        """Return the perceived activity of the user of each row: object (n,)."""
        return self._names(self._codes_of(rows)[1])

    def _code(self, activity: str) -> int:
        return self._codes.setdefault(activity, len(self._codes))

    def _names(self, codes: I64) -> Names:
        return np.array(list(self._codes), object)[codes]

    def _codes_of(self, rows: I64) -> tuple[I64, I64]:
        """Return the codes of the true and of the perceived activities: int64 (n,) each."""
        true, perceived = (np.full(len(rows), NOTHING, np.int64) for _ in range(2))
        if not self.are_perceived:
            return true, perceived
        for (robot, camera), sense in self._senses.items():
            is_camera = (rows[:, ROBOT] == robot) & (rows[:, Column.CAMERA] == camera)
            for user, (steps, codes) in enumerate(self._starts):
                index = np.flatnonzero(is_camera & (rows[:, Column.USER] == user))
                looks = rows[index, Column.STEP] - sense.latency
                position = np.searchsorted(np.array(steps, np.int64), looks, side="right")
                true[index] = np.array(codes, np.int64)[position]
                if sense.confusion is not None:
                    draws = random_shares(sense.keys[user], looks)
                    perceived[index] = self._confused(true[index], draws, sense.confusion)
        return true, perceived

    def _confused(self, true: I64, draws: I64, confusion: Mapping[str, Mapping[str, float]]) -> I64:
        """Return the codes of perceived activities, by random draws [2**-31]."""
        perceived = true.copy()
        for activity, others in confusion.items():
            ends = np.rint(np.cumsum(list(others.values())) * ONE).astype(np.int64)
            outcomes = np.array([self._code(name) for name in (*others, activity)], np.int64)
            index = np.flatnonzero(true == self._code(activity))
            perceived[index] = outcomes[np.searchsorted(ends, draws[index], side="right")]
        return perceived


def frozen(value: Any) -> Any:
    """Return a value with read-only views in place of its arrays, in tuples of any depth.

    Components share arrays, so none of them may change one.

    Example:
        >>> counts = np.zeros(3)
        >>> frozen((counts, "x"))[0].flags.writeable, counts.flags.writeable
        (False, True)
    """
    if isinstance(value, np.ndarray):
        view = value.view()
        view.setflags(write=False)
        return view
    if isinstance(value, tuple):
        parts = map(frozen, value)
        return type(value)(*parts) if hasattr(value, "_fields") else tuple(parts)
    return value


class Observations:
    """The sightings of robots, in order of step and robot; all arrays of one length.

    `step` is when it became known. Users, robots and rooms are indices into the scenario's users
    and robots and the home's rooms. Errors aren't marked: a user may be mistaken for another, or
    not be there at all. Arrays are read-only, and computed on demand.
    """

    def __init__(
        self,
        plan: FloorPlan,
        rooms: "NearestRooms",
        blocks: Sequence[SightingTable],
        activities: Activities,
    ) -> None:
        """Keep the blocks.

        Args:
            plan: The floor plan.
            rooms: The rooms of the plan.
            blocks: Consecutive ones, with the columns of observations; joined on demand.
            activities: What users do.
        """
        self._plan = plan
        self._rooms = rooms
        self._activities = activities
        self._blocks = blocks or [SightingTable.of_rows(np.empty((0, OBSERVATION), np.int64))]

    def __len__(self) -> int:
        """Return the number of observations."""
        return sum(map(len, self._blocks))

    @cached_property
    def _all(self) -> SightingTable:
        return SightingTable.joined(self._blocks)

    def _spread(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return of each observation the value of its distinct one, read-only."""
        return read_only(values[self._all.index])

    @cached_property
    def step(self) -> I64:
        """Step at which the observation became known: int64 (n,)."""
        return read_only(self._all.step)

    @cached_property
    def robot(self) -> I32:
        """Index of the robot: int32 (n,)."""
        return self._spread(self._all.distinct[:, ROBOT].astype(np.int32))

    @cached_property
    def user(self) -> I32:
        """Index of the recognized user, NOBODY if not recognized: int32 (n,)."""
        return self._spread(self._all.distinct[:, Column.IDENTITY].astype(np.int32))

    @cached_property
    def _xy(self) -> F64:
        return self._plan.lattice.to_metres(self._all.distinct[:, [Column.X, Column.Y]])

    @cached_property
    def x(self) -> F64:
        """Perceived position along x [m]: float64 (n,)."""
        return self._spread(self._xy[:, 0])

    @cached_property
    def y(self) -> F64:
        """Perceived position along y [m]: float64 (n,)."""
        return self._spread(self._xy[:, 1])

    @cached_property
    def room(self) -> I16:
        """Room of the perceived position, or the nearest room: int16 (n,)."""
        distinct = self._all.distinct
        return self._spread(self._rooms.of(distinct[:, Column.X], distinct[:, Column.Y]))

    def placed_in(self, rooms: "NearestRooms | None") -> PlacedSightings:
        """Return the sightings by the nearest of some rooms, or patches; None: all by one place."""
        seen = self._all
        user = seen.distinct[:, Column.IDENTITY]
        place = np.zeros(len(user), np.int64)
        if rooms is not None:
            place[:] = rooms.of(seen.distinct[:, Column.X], seen.distinct[:, Column.Y])
        return PlacedSightings(seen.step, seen.index, user, place)

    @cached_property
    def heading(self) -> F64:
        """Perceived heading [rad]: float64 (n,)."""
        return self._spread(in_radians(self._all.distinct[:, Column.HEADING]))

    @cached_property
    def posture(self) -> I8:
        """Perceived posture, 0 stands, 1 sits, 2 lies: int8 (n,)."""
        return self._spread(self._all.distinct[:, Column.POSTURE].astype(np.int8))

    @cached_property
    def camera(self) -> I8:
        """Index among the robot's cameras: int8 (n,)."""
        return self._spread(self._all.distinct[:, Column.CAMERA].astype(np.int8))

    @cached_property
    def activity(self) -> Names:
        """Perceived activity; None where activities aren't perceived: object (n,)."""
        return read_only(self._activities.perceived(self._all.rows()))


class Truth(NamedTuple):
    """The truth, row by row of the observations; for metrics only.

    For a false positive, `user` is NOBODY; for an observation of a real robot, of which nobody
    knows the truth, UNKNOWN_TRUTH. The other columns mean nothing then.
    """

    user: I32
    x: F64  # position of the user at the look [m]
    y: F64
    heading: F64  # [rad]
    posture: I8
    activity: Names  # activity of the user; None where its behavior records none

    @classmethod
    def behind(cls, observations: Observations) -> Self:
        """Return the truth behind observations."""
        rows = observations._all.rows()
        xy = observations._plan.lattice.to_metres(rows[:, [Column.TRUE_X, Column.TRUE_Y]])
        return cls(
            rows[:, Column.USER].astype(np.int32),
            xy[:, 0],
            xy[:, 1],
            in_radians(rows[:, Column.TRUE_HEADING]),
            rows[:, Column.TRUE_POSTURE].astype(np.int8),
            observations._activities.true(rows),
        )


class Looks(NamedTuple):
    """How often each camera looked at a user in view, and how often it noticed; for metrics."""

    robot: I32  # (cameras,) index of the camera's robot
    camera: tuple[str, ...]  # (cameras,) name of the camera
    in_view: I64  # (cameras, users) looks with the user in view
    detected: I64  # (cameras, users) looks with the user in view and noticed


class NearestRooms:
    """The room of any place; in a wall or outside, the nearest room."""

    def __init__(self, plan: FloorPlan, of_cell: I16 | None = None) -> None:
        """Use the rooms of a plan, or other parts of it, such as the patches of its rooms.

        Args:
            plan: The floor plan.
            of_cell: int16 (rows, columns), the part that each cell belongs to, NOWHERE for none;
                None: its room.
        """
        self._plan = plan
        self._rooms = None if of_cell is None else read_only(fill_from_neighbors(of_cell))

    def of(self, x: I64, y: I64) -> I16:
        """Return the rooms of places [lattice units]; NOWHERE only in a home without rooms."""
        if self._rooms is None:
            self._rooms = self._plan.room_of_place
        rooms: I16 = rooms_at(self._rooms, x, y)
        while len(rooms) and rooms.min() == NOWHERE and self._plan.rooms:
            padded = np.pad(self._rooms, 1, constant_values=NOWHERE)
            filled = fill_from_neighbors(padded)[1:-1, 1:-1]
            self._rooms = read_only(np.ascontiguousarray(filled))
            rooms = rooms_at(self._rooms, x, y)
        return rooms
