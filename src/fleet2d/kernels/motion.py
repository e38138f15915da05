"""Bodies over time: tracks and timelines of poses, measurements of them, and the days of people.

A *track* is five arrays over its breakpoints i: time [us], x, y [lattice], heading [1/4096 turn],
and away (1 = not at home). Between two breakpoints the pose moves in a straight line and turns the
shorter way, both at constant rate; before the first and after the last one it stays. `Timelines`
holds the tracks of all bodies. `DayPlanner`, `Interruptions` and `Resident` make those of people
who follow a routine.
"""

from typing import NamedTuple

import numpy as np

# Names that are imported as themselves are part of this module.
# isort: off
from fleet2d._core import (
    ANY_ROOM as ANY_ROOM,
    CHANCE_BITS as CHANCE_BITS,
    CoreVenue as CoreVenue,
    count_together as count_together,
    DayPlanner as DayPlanner,
    distances_between as distances_between,
    distances_to_shape as distances_to_shape,
    Happening as Happening,
    Interruptions as Interruptions,
    LastStint as LastStint,
    Legs as Legs,
    MoveKind as MoveKind,
    NO_GAP_S as NO_GAP_S,
    QUANTILE_BITS as QUANTILE_BITS,
    Resident as Resident,
    Role as Role,
    RoomPolicy as RoomPolicy,
    rooms_at as rooms_at,
    RoomUse as RoomUse,
    sliding_max as sliding_max,
    speeds as speeds,
    sum_moves as sum_moves,
    time_route as time_route,
    Timelines as Timelines,
    trace_meander as trace_meander,
    trace_track as trace_track,
    until as until,
    Waits as Waits,
    Window as Window,
)
# isort: on

from fleet2d.kernels import I64, U8


class Breakpoints(NamedTuple):
    """The arrays of a track, all of one length."""

    time: I64
    x: I64
    y: I64
    heading: I64
    away: U8


class Poses(NamedTuple):
    """Poses of one body over consecutive steps, all arrays of one length."""

    x: I64
    y: I64
    heading: I64
    away: U8


class WalkRule(NamedTuple):
    """How a meandering body moves in one step."""

    key: np.uint64  # of its random stream
    stride: int  # 1/256 lattice units forward
    sway: int  # standard deviation of the turn, in 2**-16 headings per unit of random_bell
    turn_limit: int  # headings, half a turn at most
    stays: int = 0  # 1: at a wall it keeps its position and its heading only sways


def empty_poses(count: int) -> Poses:
    """Return uninitialized poses, to be filled."""
    x, y, heading = (np.empty(count, np.int64) for _ in range(3))
    return Poses(x, y, heading, np.empty(count, np.uint8))


def paste_poses(out: Poses, begin: int, part: Poses, rows: slice) -> None:
    """Copy the rows of `part` to `out`, from `begin` on."""
    count = len(part.x[rows])
    for name in Poses._fields:
        getattr(out, name)[begin : begin + count] = getattr(part, name)[rows]
