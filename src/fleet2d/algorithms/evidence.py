"""Evidence: views of robots, and sightings of users in them, by rooms and by patches of rooms.

Rows of observations are counted by user, bin and patch; with the share of each patch in view, these
counts are what algorithms learn presence from.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple, Self

import numpy as np

from fleet2d.algorithms.observations import NOWHERE, PlacedSightings, frozen
from fleet2d.floorplan.plan import FloorPlan, read_only
from fleet2d.kernels import (
    F64,
    I16,
    I64,
    U8,
    Bool,
    gather_views,
    label_triangles,
    list_sightings,
    rasterize_cells,
)
from fleet2d.runtime.clock import DAY_US, Clock
from fleet2d.runtime.local_time import EPOCH, readings_of

# Side of a patch [m], approximately; larger where a room would have more than about MAX_PATCHES.
SIDE_M = 1.0
MAX_PATCHES = 12

# Length of a bin [us]; one step where a step is longer.
BIN_US = 60_000_000


@dataclass(frozen=True)
class Patches:
    """The rooms of a floor plan, divided into patches.

    Attributes:
        of_cell: int16 (rows, columns), the patch of each cell; NOWHERE outside rooms.
        room: int64 (patches,), ascending, the room of each patch; each room has at least one.
        cells: int64 (patches,), number of cells of each patch.
        island: int64 (rooms,), which island of the free space holds each room, where nothing joins
            the islands; None: all rooms are connected.
    """

    of_cell: I16
    room: I64
    cells: I64
    island: I64 | None = None

    @cached_property
    def first(self) -> I64:
        """The first patch of each room: int64 (rooms,)."""
        return read_only(np.flatnonzero(np.diff(self.room, prepend=-1)))

    @cached_property
    def room_cells(self) -> I64:
        """Number of cells of each room, at least 1: int64 (rooms,)."""
        cells: I64 = np.maximum(np.add.reduceat(self.cells, self.first), 1)
        return read_only(cells)


def whole_rooms(plan: FloorPlan) -> Patches:
    """Return each room as one patch."""
    rooms = plan.room_of_cell
    count = len(plan.rooms)
    cells = np.bincount(rooms[rooms != NOWHERE], minlength=count)
    return Patches(rooms, read_only(np.arange(count)), read_only(cells), islands(plan))


def patches_of(plan: FloorPlan) -> Patches:
    """Divide the bounding box of each room into equal boxes along both axes.

    Example:
        >>> import fleet2d
        >>> plan = fleet2d.load_floorplan()
        >>> patches = patches_of(plan)
        >>> len(plan.rooms), len(patches.room), round(float(plan.rooms[2].area_m2))
        (14, 122, 40)
        >>> living = patches.room == 2
        >>> int(living.sum()), bool(patches.cells[living].sum() == plan.rooms[2].cells)
        (12, True)
    """
    rooms = plan.room_of_cell
    count = len(plan.rooms)
    row, column = np.nonzero(rooms != NOWHERE)
    room = rooms[row, column].astype(np.int64)
    total = np.bincount(room, minlength=count)
    side = np.maximum(SIDE_M / plan.lattice.cell, np.sqrt(np.ceil(total / MAX_PATCHES)))
    box_row, box_rows = _divide(row, room, side, rooms.shape[0])
    box_column, box_columns = _divide(column, room, side, rooms.shape[1])
    boxes = box_rows * box_columns
    first = np.cumsum(boxes) - boxes
    box_row = first[:, np.newaxis] + box_row * box_columns[:, np.newaxis]
    box = box_row[room, row] + box_column[room, column]
    cells = np.bincount(box, minlength=int(boxes.sum()))
    is_patch = cells > 0
    is_patch[first[total == 0]] = True
    number = np.cumsum(is_patch) - 1
    of_cell = np.full(rooms.shape, NOWHERE, np.int16)
    of_cell[row, column] = number[box]
    room = np.repeat(np.arange(count), boxes)[is_patch]
    cells = read_only(cells[is_patch])
    return Patches(read_only(of_cell), read_only(room), cells, islands(plan))


def islands(plan: FloorPlan) -> I64 | None:
    """Return the island of the free space that holds each room: int64 (rooms,).

    Rooms with floor in the same part, and parts with floor in the same room, count as one. None if
    the free space is in one part.

    Example:
        >>> import fleet2d
        >>> print(islands(fleet2d.load_floorplan()))
        None
    """
    if len(plan.polygons) == 1:
        return None
    triangle = rasterize_cells(plan.mesh, plan.lattice.rows, plan.lattice.columns)
    part = np.where(triangle >= 0, label_triangles(plan.mesh.neighbors)[triangle], NOWHERE)
    is_floor = (plan.room_of_cell != NOWHERE) & (part != NOWHERE)
    pairs = np.unique(np.stack([plan.room_of_cell, part], axis=-1)[is_floor], axis=0)
    island = np.arange(len(plan.rooms))
    for number in np.unique(pairs[:, 1]):
        rooms = pairs[pairs[:, 1] == number, 0]
        island[np.isin(island, island[rooms])] = island[rooms].min()
    return read_only(island)


def _divide(place: I64, room: I64, side: F64, places: int) -> tuple[I64, I64]:
    """Divide the extent of each room along one axis into equal parts.

    Args:
        place: int64 (cells,), row or column of each cell.
        room: int64 (cells,), room of each cell.
        side: float64 (rooms,), length of a part, approximately [cells].
        places: Number of rows or columns.

    Returns:
        The part of each room that each row or column is in, int64 (rooms, places), and the number
        of parts, int64 (rooms,).
    """
    count = len(side)
    is_there = np.bincount(room * places + place, minlength=count * places).reshape(count, -1) > 0
    low = is_there.argmax(axis=1)
    extent = np.maximum(places - is_there[:, ::-1].argmax(axis=1) - low, 1)
    parts = np.maximum(1, np.rint(extent / side)).astype(np.int64)
    part = (np.arange(places) - low[:, np.newaxis]) * parts[:, np.newaxis] // extent[:, np.newaxis]
    return part, parts


class SightingCounts(NamedTuple):
    """The steps of each bin at which users were perceived in each place, where that isn't 0.

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
    def of_observations(
        cls, seen: PlacedSightings, bin_steps: int, shape: tuple[int, int, int]
    ) -> Self:
        """Count observations; several of a user in a place at one step count once.

        Args:
            seen: The observations, with steps since the first bin began.
            bin_steps: Steps of a bin.
            shape: Numbers of bins, of users + 1, and of places.

        Example:
            >>> zero = np.array([0])
            >>> seen = PlacedSightings(zero, zero.astype(np.int32), zero, zero)
            >>> SightingCounts.of_observations(seen, 1, (1, 2, 1)).dense.tolist()
            [[[1], [1]]]
        """
        return cls(*list_sightings(*seen, bin_steps, *shape), shape)

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
        """Whether an unknown person, not recognized as a user, was perceived: bool (bins, places).

        True where somebody was perceived at more steps than all users were recognized, added up;
        nowhere without users, where everybody is the same person.
        """
        bins, users, places = self.shape
        if users == 1:
            return read_only(np.zeros((bins, places), np.bool_))
        signed = np.where(self.user == users - 1, self.steps, -self.steps)
        excess = np.bincount(self.bin * places + self.place, signed, bins * places)
        return read_only((excess > 0).reshape(bins, places))


class PatchEvidence(NamedTuple):
    """Evidence by patches of rooms, each of which is usually in view entirely or not at all.

    Attributes:
        room: int64 (patches,), ascending, the room of each patch.
        cells: int64 (patches,), number of cells of each patch.
        watched: float64 (bins, patches), as in Evidence.
        shown: float64 (bins, patches), the largest share of each patch's cells in view at one step
            of the bin; with several robots, that of the robot that saw most of it.
        shown_255: uint8 (bins, patches), `shown` times 255, rounded.
        sightings: Where users were perceived, by patches.
        island: int64 (rooms,), which island of the home holds each room, where nothing joins the
            islands; None: all rooms are connected.
    """

    room: I64
    cells: I64
    watched: F64
    shown: F64
    shown_255: U8
    sightings: SightingCounts
    island: I64 | None = None

    @property
    def seen(self) -> I64:
        """As in Evidence, by patches: int64 (bins, users + 1, patches), computed on each access."""
        return self.sightings.dense


@dataclass(frozen=True)
class Evidence:
    """Views of robots, and sightings of users in them, in bins of equal length.

    Looks at which nobody was perceived are evidence, too: they distinguish a user who is somewhere
    else from one in a room that no robot looked at.

    Attributes:
        day: int64 (bins,), the day of each bin, as `date.toordinal` counts.
        minute: int64 (bins,), start of each bin [minutes since midnight].
        bin_steps: Steps of a bin; bins begin at step 0, and last a minute, or a step if that is
            longer.
        watched: float64 (bins, rooms), share of each room's cells in view, averaged over the steps
            of the bin; with several robots, that of the robot that saw most of the room.
        sightings: Where users were perceived, by rooms.
        by_patch: The same by patches of rooms.
        begin: First step of the first bin.
    """

    day: I64
    minute: I64
    bin_steps: int
    watched: F64
    sightings: SightingCounts
    by_patch: PatchEvidence
    begin: int

    @property
    def seen(self) -> I64:
        """Steps of each bin at which each user was perceived in each room, computed on each access.

        int64 (bins, users + 1, rooms); the last row counts anybody, recognized or not.
        """
        return self.sightings.dense

    def __len__(self) -> int:
        """Return the number of bins."""
        return len(self.watched)

    def between(self, begin: int, end: int) -> Self:
        """Return the evidence of the bins `begin` to `end` - 1."""
        rows = slice(begin, end)
        patches = self.by_patch
        return replace(
            self,
            day=self.day[rows],
            minute=self.minute[rows],
            watched=self.watched[rows],
            sightings=self.sightings.between(begin, end),
            by_patch=patches._replace(
                watched=patches.watched[rows],
                shown=patches.shown[rows],
                shown_255=patches.shown_255[rows],
                sightings=patches.sightings.between(begin, end),
            ),
            begin=self.begin + begin * self.bin_steps,
        )

    @property
    def days(self) -> list[Self]:
        """The evidence of each day."""
        if len(self) and self.day[0] == self.day[-1]:
            return [self]
        ends = [*(np.flatnonzero(np.diff(self.day)) + 1).tolist(), len(self)]
        return [self.between(a, b) for a, b in pairwise([0, *ends]) if a < b]


def steps_of_bin(step_us: int) -> int:
    """Return the number of steps of a bin.

    Example:
        >>> steps_of_bin(1_000_000), steps_of_bin(25_000_000), steps_of_bin(300_000_000)
        (60, 2, 1)
    """
    return max(1, BIN_US // step_us)


def gather(
    clock: Clock,
    begin: int,
    bin_steps: int,
    patches: Patches,
    cells: I64,
    observed: PlacedSightings,
    users: int,
) -> Evidence:
    """Return the evidence of consecutive bins, with read-only arrays.

    Args:
        clock: The steps of the run.
        begin: First step of the first bin.
        bin_steps: Steps of a bin.
        patches: The patches of the rooms.
        cells: int64 (bins, robots, 2, patches), number of cells of each patch in view of each
            robot: the sum over the steps of the bin, and the maximum.
        observed: The observations in order, by patches.
        users: Number of users.
    """
    watched, by_patch, shown, shown_255 = gather_views(
        cells, patches.room, patches.cells, patches.room_cells, bin_steps
    )
    size = len(cells), users + 1
    seen = observed._replace(step=observed.step - begin)
    in_patches = SightingCounts.of_observations(seen, bin_steps, (*size, len(patches.room)))
    seen = seen._replace(place=patches.room[seen.place])
    in_rooms = SightingCounts.of_observations(seen, bin_steps, (*size, len(patches.first)))
    day, minute = times_of_bins(clock, begin, bin_steps, len(cells))
    of_patches = PatchEvidence(
        patches.room, patches.cells, by_patch, shown, shown_255, in_patches, patches.island
    )
    return Evidence(*frozen((day, minute, bin_steps, watched, in_rooms, of_patches, begin)))


def times_of_bins(clock: Clock, begin: int, bin_steps: int, bins: int) -> tuple[I64, I64]:
    """Return the day of each bin, as `date.toordinal` counts, and its first minute of the day."""
    steps = begin + np.arange(bins, dtype=np.int64) * bin_steps
    day, time_us = np.divmod(readings_of(clock.start, steps * clock.step_us), DAY_US)
    return EPOCH.toordinal() + day, time_us // 60_000_000
