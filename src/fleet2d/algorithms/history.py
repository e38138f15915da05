"""What happened: motions and observations of a stretch of steps, as arrays."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fleet2d.entities.plan import Motion, State
from fleet2d.errors import ComponentError
from fleet2d.kernels.mesh import SUB
from fleet2d.kernels.motion import Poses

if TYPE_CHECKING:
    from fleet2d.entities.actor import Actor
    from fleet2d.floorplan.home import Home

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


class BodyPoses(NamedTuple):
    """Poses of one body, one entry per step."""

    x: NDArray[np.float64]  # [m]
    y: NDArray[np.float64]
    heading: NDArray[np.int64]  # 1/4096 turn
    away: NDArray[np.bool_]
    room: NDArray[np.int16]  # NOWHERE while away


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

    def forget(self, before: int) -> None:
        """Drop what is only needed for steps earlier than `before`."""
        for pieces in self.pieces:
            keep = max((i for i, piece in enumerate(pieces) if piece.first <= before), default=0)
            del pieces[:keep]
        self.observations = [o for o in self.observations if len(o.step) and o.step[-1] >= before]

    def poses(self, name: str, first: int, end: int) -> BodyPoses:
        """Return the poses of a body in the steps from `first` to `end` - 1."""
        count = end - first
        out = Poses(*(np.empty(count, np.int64) for _ in range(3)), np.empty(count, np.uint8))
        pieces = self.pieces[self.index[name]]
        for i, piece in enumerate(pieces):
            stop = pieces[i + 1].first if i + 1 < len(pieces) else end
            begin, stop = max(first, piece.first), min(end, stop)
            if begin < stop:
                skipped = begin - piece.first
                part = Poses(*(np.empty(stop - piece.first, a.dtype) for a in out))
                piece.motion.trace(piece.first, piece.start, part)
                for whole, values in zip(out, part, strict=True):
                    whole[begin - first : stop - first] = values[skipped:]
        return _in_metres(self.home, out)

    def seen(self, first: int, end: int) -> Observations:
        """Return the observations of the steps from `first` to `end` - 1."""
        blocks = [b for b in self.observations if len(b.step) and b.step[-1] >= first and b.step[0] < end]
        if not blocks:
            blocks = [no_observations()]
        joined = Observations(*(np.concatenate(columns) for columns in zip(*blocks, strict=True)))
        keep = slice(*np.searchsorted(joined.step, (first, end)).tolist())
        return Observations(*(column[keep] for column in joined))


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

    @property
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
            why = "only metrics know where users are" if name in self.log.index else "there is no such body"
            raise ComponentError(f"poses of {name!r} were asked for, but {why}; available: {known}")
        return self.log.poses(name, self.first, self.end)


def no_observations() -> Observations:
    """Return observations without a row."""
    return Observations(
        np.empty(0, np.int64), np.empty(0, np.int32), np.empty(0, np.int32),
        np.empty(0, np.float64), np.empty(0, np.float64), np.empty(0, np.int16),
    )  # fmt: skip


def _in_metres(home: "Home", poses: Poses) -> BodyPoses:
    room = home.plan.room_of_cell[poses.y // SUB, poses.x // SUB]
    xy = home.plan.lattice.to_metres(np.stack([poses.x, poses.y], axis=-1))
    away = poses.away.astype(bool)
    return BodyPoses(xy[:, 0], xy[:, 1], poses.heading, away, np.where(away, NOWHERE, room))
