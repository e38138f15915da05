"""Evidence: what robots watched, and which users they perceived there, in bins of time."""

from collections.abc import Sequence
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from fleet2d.algorithms.patches import Patches
from fleet2d.floorplan.cache import read_only
from fleet2d.kernels import F64, I64, U8, Bool
from fleet2d.kernels.presence import gather_views, list_sightings

# Length of a bin [us]; one step where a step is longer.
BIN_US = 60_000_000


class SightingCounts(NamedTuple):
    """At how many steps of each bin users were perceived in each place, where that isn't 0.

    Attributes:
        user: int64 (n,), ascending, row of the user; the last row counts anybody.
        bin: int64 (n,), ascending for each user.
        place: int64 (n,), ascending for each user and bin; a patch, or a room.
        steps: int64 (n,), number of steps.
        shape: Numbers of bins, of users + 1, and of places.
    """

    user: I64
    bin: I64
    place: I64
    steps: I64
    shape: tuple[int, int, int]

    @classmethod
    def of(cls, seen: I64) -> Self:
        """Return the counts in an array (bins, users + 1, places).

        Example:
            >>> counts = SightingCounts.of(np.array([[[0, 7], [0, 7]]]))
            >>> counts.user.tolist(), counts.place.tolist(), counts.dense.tolist()
            ([0, 1], [1, 1], [[[0, 7], [0, 7]]])
        """
        by_user = seen.transpose(1, 0, 2)
        user, seen_bin, place = np.nonzero(by_user)
        bins, users, places = seen.shape
        return cls(user, seen_bin, place, by_user[user, seen_bin, place], (bins, users, places))

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """Return the counts of consecutive bins as one."""
        if len(parts) == 1:
            return parts[0]
        first = np.cumsum([0, *(part.shape[0] for part in parts)]).tolist()
        user, place, steps = (
            np.concatenate([getattr(part, name) for part in parts])
            for name in ("user", "place", "steps")
        )
        bins = np.concatenate([part.bin + begin for part, begin in zip(parts, first, strict=False)])
        order = np.argsort(user, kind="stable")
        shape = (first[-1], *parts[0].shape[1:])
        return cls(user[order], bins[order], place[order], steps[order], shape)

    def between(self, begin: int, end: int) -> Self:
        """Return the counts of the bins `begin` to `end` - 1."""
        rows = (begin <= self.bin) & (self.bin < end)
        columns = (self.user[rows], self.bin[rows] - begin, self.place[rows], self.steps[rows])
        return type(self)(*columns, (end - begin, *self.shape[1:]))

    def of_user(self, user: int) -> tuple[I64, I64, I64]:
        """Return a user's sightings: bin, place and number of steps of each, int64 (n,)."""
        begin, end = np.searchsorted(self.user, [user, user + 1])
        return self.bin[begin:end], self.place[begin:end], self.steps[begin:end]

    @property
    def dense(self) -> I64:
        """The counts as an array: int64 (bins, users + 1, places)."""
        seen = np.zeros(self.shape, np.int64)
        seen[self.bin, self.user, self.place] = self.steps
        return read_only(seen)

    @property
    def unknown(self) -> Bool:
        """Whether somebody was perceived who wasn't recognized as a user: bool (bins, places).

        True where somebody was perceived at more steps than all users were recognized, added up.
        """
        bins, users, places = self.shape
        signed = np.where(self.user == users - 1, self.steps, -self.steps)
        excess = np.bincount(self.bin * places + self.place, signed, bins * places)
        return read_only((excess > 0).reshape(bins, places))


class Parts(NamedTuple):
    """Evidence by patches of rooms, each of which is mostly in view as a whole or not at all.

    Attributes:
        room: int64 (patches,), ascending, the room of each patch.
        cells: int64 (patches,), number of cells of each patch.
        watched: float64 (bins, patches), as in Evidence.
        shown: float64 (bins, patches), the largest share of each patch's cells in view at one step
            of the bin; with several robots, that of the robot that saw most of it.
        sightings: Where users were perceived, by patches.
        shown_parts: uint8 (bins, patches), `shown` times 255; None: not computed yet.
        island: int64 (rooms,), which part of the home holds each room, where nothing joins the
            parts; None: it has one part.
    """

    room: I64
    cells: I64
    watched: F64
    shown: F64
    sightings: SightingCounts
    shown_parts: U8 | None = None
    island: I64 | None = None

    @property
    def seen(self) -> I64:
        """As in Evidence, by patches: int64 (bins, users + 1, patches), made anew."""
        return self.sightings.dense


class Evidence(NamedTuple):
    """What robots watched, and which users they perceived there, in bins of equal length.

    Looks at which nobody was perceived are evidence, too: they distinguish a user who is somewhere
    else from one in a room that no robot looked at.

    Attributes:
        begin: First step of the first bin.
        bin_steps: Steps of a bin; bins begin at step 0, and last a minute, or a step if that is
            longer.
        watched: float64 (bins, rooms), share of each room's cells in view, averaged over the steps
            of the bin; with several robots, that of the robot that saw most of the room.
        sightings: Where users were perceived, by rooms.
        parts: The same by patches of rooms; None: each room is one patch.

    Example:
        >>> counts = SightingCounts.of(np.array([[[30, 0], [30, 0]]]))
        >>> Evidence(0, 60, np.array([[0.5, 0.0]]), counts).seen.tolist()
        [[[30, 0], [30, 0]]]
    """

    begin: int
    bin_steps: int
    watched: F64
    sightings: SightingCounts
    parts: Parts | None = None

    @property
    def seen(self) -> I64:
        """Steps of each bin at which each user was perceived in each room, made anew.

        int64 (bins, users + 1, rooms); the last row counts anybody, recognized or not.
        """
        return self.sightings.dense

    def __len__(self) -> int:
        """Return the number of bins."""
        return len(self.watched)


def steps_of_bin(step_us: int) -> int:
    """Return the number of steps of a bin.

    Example:
        >>> steps_of_bin(1_000_000), steps_of_bin(25_000_000), steps_of_bin(300_000_000)
        (60, 2, 1)
    """
    return max(1, BIN_US // step_us)


class SightingRows(NamedTuple):
    """Users that were perceived, in order of time; arrays of one length."""

    step: I64
    user: I64  # index of the recognized user, below 0 if not recognized
    room: NDArray[np.integer[Any]]  # NOWHERE for none


def gather(
    first: int,
    bin_steps: int,
    patches: Patches,
    cells: I64,
    sightings: SightingRows,
    users: int,
) -> Evidence:
    """Return the evidence of consecutive bins.

    Args:
        first: First step of the first bin.
        bin_steps: Steps of a bin.
        patches: The patches of the rooms.
        cells: int64 (bins, robots, 2, patches), number of cells of each patch in view of each
            robot: the sum over the steps of the bin, and the maximum.
        sightings: Users that were perceived, with patches in place of rooms.
        users: Number of users.
    """
    watched, by_patch, shown, shown_parts = gather_views(
        cells, patches.room, patches.cells, patches.room_cells, bin_steps
    )
    bins, in_room = len(cells), sightings._replace(room=patches.room[sightings.room])
    parts = Parts(
        patches.room,
        patches.cells,
        by_patch,
        shown,
        count_seen(sightings, first, bins, bin_steps, users, len(patches.room)),
        shown_parts,
        patches.island,
    )
    in_rooms = count_seen(in_room, first, bins, bin_steps, users, len(patches.first))
    return Evidence(first, bin_steps, watched, in_rooms, parts)


def count_seen(
    sightings: SightingRows, begin: int, bins: int, bin_steps: int, users: int, rooms: int
) -> SightingCounts:
    """Count, per bin and room, the steps at which each user was perceived.

    Several sightings of a user in a room in one step count once.
    """
    shape = (bins, users + 1, rooms)
    user, room = sightings.user.astype(np.int64), sightings.room.astype(np.int64)
    counts = list_sightings(sightings.step - begin, user, room, bin_steps, *shape)
    return SightingCounts(*counts, shape)
