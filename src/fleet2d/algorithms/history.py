"""What happened: motions and observations of a stretch of steps, as arrays."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from fleet2d.entities.plan import Motion, State
from fleet2d.errors import ComponentError
from fleet2d.kernels.headings import in_radians
from fleet2d.kernels.measure import count_rooms, sum_moves
from fleet2d.kernels.mesh import SUB
from fleet2d.kernels.motion import Poses, empty_poses, paste_poses

if TYPE_CHECKING:
    from fleet2d.entities.actor import Actor
    from fleet2d.floorplan.home import Home

Array = TypeVar("Array", bound=NDArray[Any])

NOWHERE = -1  # the room of who is away


class Observations(NamedTuple):
    """Detections in order of step, robot, user; all arrays of one length.

    Users, robots and rooms are indices into the scenario's users and robots and the home's rooms.
    """

    step: NDArray[np.int64]
    robot: NDArray[np.int32]
    user: NDArray[np.int32]
    x: NDArray[np.float64]  # perceived position [m]
    y: NDArray[np.float64]
    room: NDArray[np.int16]


class BodyPoses:
    """Poses of one body, one entry per step; columns are worked out when they are asked for."""

    def __init__(self, home: "Home", poses: Poses) -> None:
        self._home, self._poses = home, poses

    def __len__(self) -> int:
        """Return the number of steps."""
        return len(self._poses.x)

    @cached_property
    def xy(self) -> NDArray[np.float64]:
        """Positions (n, 2) [m]; where it left while it is away."""
        lattice = self._home.plan.lattice
        return _shared(lattice.to_metres(np.stack([self._poses.x, self._poses.y], axis=-1)))

    def at(self, index: int) -> tuple[float, float]:
        """Return the position (x, y) [m] at one step; -1 is the last."""
        point = self._poses.x[index], self._poses.y[index]
        x, y = self._home.plan.lattice.to_metres(point).tolist()
        return x, y

    @property
    def x(self) -> NDArray[np.float64]:
        """Positions along x [m]."""
        return self.xy[:, 0]

    @property
    def y(self) -> NDArray[np.float64]:
        """Positions along y [m]."""
        return self.xy[:, 1]

    @cached_property
    def heading(self) -> NDArray[np.float64]:
        """Headings, counter-clockwise from +x, 0 to 2 pi [rad]."""
        radians: NDArray[np.float64] = in_radians(self._poses.heading)
        return _shared(radians)

    @cached_property
    def away(self) -> NDArray[np.bool_]:
        """Whether it is out of the home."""
        return _shared(self._poses.away.astype(bool))

    @cached_property
    def room(self) -> NDArray[np.int16]:
        """Index of the room, NOWHERE while it is away."""
        room = self._home.plan.room_of_place[self._poses.y // SUB, self._poses.x // SUB]
        return _shared(np.where(self.away, np.int16(NOWHERE), room))

    @cached_property
    def time_in_rooms(self) -> NDArray[np.int64]:
        """Number of steps in each room, and last away: int64 (rooms + 1,)."""
        counts = np.zeros(len(self._home.rooms) + 1, np.int64)
        count_rooms(self._poses, self._home.plan.room_of_place, counts)
        return _shared(counts)

    @cached_property
    def distance(self) -> float:
        """Length of the way from the first to the last step [m]."""
        return float(sum_moves(self._poses)) / self._home.plan.lattice.units_per_m


def _shared(array: Array) -> Array:
    """Refuse changes: whoever is updated at the same step gets the same array."""
    array.setflags(write=False)
    return array


@dataclass(frozen=True)
class Piece:
    """A motion followed from step `first` on, by a body that was at `start` then."""

    first: int
    start: State
    motion: Motion


class Log:
    """The motions and observations of a run, as far back as somebody may ask."""

    def __init__(self, home: "Home", actors: "Sequence[Actor]") -> None:
        self.home = home
        self.index = {actor.name: i for i, actor in enumerate(actors)}
        self.pieces: list[list[Piece]] = [[] for _ in actors]
        self.observations: list[Observations] = []
        self._traced: dict[tuple[str, int, int], BodyPoses] = {}

    def forget(self, before: int) -> None:
        """Drop what is only needed for steps earlier than `before`."""
        self._traced.clear()
        for pieces in self.pieces:
            keep = max((i for i, piece in enumerate(pieces) if piece.first <= before), default=0)
            del pieces[:keep]
        self.observations = [o for o in self.observations if len(o.step) and o.step[-1] >= before]

    def poses(self, name: str, first: int, end: int) -> BodyPoses:
        """Return the poses of a body in the steps from `first` to `end` - 1."""
        key = (name, first, end)
        if key not in self._traced:  # whoever is updated at the same time asks for the same
            self._traced[key] = BodyPoses(self.home, self._trace(name, first, end))
        return self._traced[key]

    def _trace(self, name: str, first: int, end: int) -> Poses:
        count = end - first
        out = empty_poses(count)
        pieces = self.pieces[self.index[name]]
        for i, piece in enumerate(pieces):
            stop = pieces[i + 1].first if i + 1 < len(pieces) else end
            begin, stop = max(first, piece.first), min(end, stop)
            if begin < stop:
                here = slice(begin - first, stop - first)
                if begin == piece.first:
                    part = Poses(out.x[here], out.y[here], out.heading[here], out.away[here])
                    piece.motion.trace(piece.first, piece.start, part)
                    continue
                part = empty_poses(stop - piece.first)
                piece.motion.trace(piece.first, piece.start, part)
                paste_poses(out, here.start, part, slice(begin - piece.first, None))
        return out

    def seen(self, first: int, end: int) -> Observations:
        """Return the observations of the steps from `first` to `end` - 1."""
        blocks = [
            b for b in self.observations if len(b.step) and b.step[-1] >= first and b.step[0] < end
        ]
        if not blocks:
            blocks = [no_observations()]
        joined = join_observations(blocks)
        keep = slice(*np.searchsorted(joined.step, (first, end)).tolist())
        return Observations._make(column[keep] for column in joined)


@dataclass(frozen=True)
class History:
    """The steps since a component was asked last, `first` to `end` - 1.

    Attributes:
        first: First step.
        end: One past the last step.
        step_s: Length of a step [s].
        observations: What the robots perceived.
    """

    log: Log
    first: int
    end: int
    step_s: float
    visible: frozenset[str]  # the bodies whose poses may be asked for

    def __len__(self) -> int:
        """Return the number of steps."""
        return self.end - self.first

    @cached_property
    def observations(self) -> Observations:
        """What the robots perceived."""
        return self.log.seen(self.first, self.end)

    def poses(self, name: str) -> BodyPoses:
        """Return the poses of a body. Algorithms may ask for robots, metrics for users, too.

        Raises:
            ComponentError: There is no such body, or it is a user and the asker an algorithm.
        """
        if name not in self.visible:
            known = ", ".join(sorted(self.visible))
            why = (
                "only metrics know where users are"
                if name in self.log.index
                else "there is no such body"
            )
            raise ComponentError(f"poses of {name!r} were asked for, but {why}; available: {known}")
        return self.log.poses(name, self.first, self.end)


def join_observations(blocks: Sequence[Observations]) -> Observations:
    """Return observations one behind the other."""
    return Observations._make(np.concatenate(columns) for columns in zip(*blocks, strict=True))


def no_observations() -> Observations:
    """Return observations without a row."""
    return Observations(
        np.empty(0, np.int64), np.empty(0, np.int32), np.empty(0, np.int32),
        np.empty(0, np.float64), np.empty(0, np.float64), np.empty(0, np.int16),
    )  # fmt: skip
