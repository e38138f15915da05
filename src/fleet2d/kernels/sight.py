"""What is in sight of a place, what cameras detect, and which cells they have covered.

Sight lines follow the strict rule: a sight line touches no wall, not even a corner. All of it is
integer arithmetic on the mesh of free space, so verdicts are exact and symmetric, and they don't
depend on how the free space is cut into triangles.

A visible region is a list of pieces, counter-clockwise, each a triangle between the eye and a wall.
A piece is stored as two numbers: the vertex that its right border runs through, and the wall edge
that it ends at (``3 * triangle + k``). The piece's left border is the right border of the next
piece, so every direction belongs to exactly one piece. Coordinates appear only when a region is
measured or drawn. The method is triangular expansion (Bungiu, Hemmer et al. 2014, arXiv 1403.3905):
see ``src/core/region.hpp``.

Cameras err: misses, mistaken identities, noise, and people that aren't there. Probabilities are
integers in units of 2**-31, read from tables that set-up has filled, so that every draw is a
comparison of integers: the same on every machine.

A robot stands most of the time, and it returns to the same poses on its rounds, so the view of a
pose is cached: the number of cells of each room, and the last step at which the robot had the pose.
The cells themselves are computed again when the last steps are needed.
"""

from typing import NamedTuple

import numpy as np

# Names that are imported as themselves are part of this module.
# isort: off
from fleet2d._core import (
    About as About,
    BINS as BINS,
    cells_in_view as cells_in_view,
    detect as detect,
    DOUBLINGS as DOUBLINGS,
    FORCED_IDENTITY as FORCED_IDENTITY,
    FORCED_MISS as FORCED_MISS,
    GhostDraw as GhostDraw,
    line_of_sight as line_of_sight,
    mark_spans as mark_spans,
    MINUTES as MINUTES,
    MAX_GHOSTS as MAX_GHOSTS,
    NEVER as NEVER,
    NOBODY as NOBODY,
    ONE as ONE,
    points_in_reach as points_in_reach,
    points_in_sight as points_in_sight,
    random_shares as random_shares,
    record_coverage as record_coverage,
    region_contains_points as region_contains_points,
    region_outline as region_outline,
    regions_of_cells as regions_of_cells,
    settle_coverage as settle_coverage,
    SightingColumn as SightingColumn,
    TABLE as TABLE,
    TablePart as TablePart,
    USER_LOST as USER_LOST,
    USER_SEEN as USER_SEEN,
    UserDraw as UserDraw,
    view_queries as view_queries,
    ViewQueryColumn as ViewQueryColumn,
    visible_region as visible_region,
)
# isort: on

from fleet2d._core import Mesh
from fleet2d.kernels import I8, I16, I32, I64, U8, U64
from fleet2d.kernels.numbers import TURN, turned

UNKNOWN_TRUTH = -2
"""The true user of a sighting in a real home, where nobody knows it; see SightingColumn.USER."""


class Lenses(NamedTuple):
    """The constants of a robot's cameras; int64 (cameras,) unless noted otherwise."""

    near_squared: I64  # lattice units squared
    far_squared: I64
    half_angle: I64  # 1/8192 of a turn; 4096 and more is all round
    chance: I64  # probability of noticing a user in view, times 2**53
    moves: I64  # 0 if it is at the robot's centre and looks straight ahead
    forward: I64  # its position in the robot's frame [lattice units]
    left: I64
    heading: I64  # its heading relative to the robot's
    pans: I64  # (cameras, headings): added to `heading`, one after the other
    pan_count: I64
    pan_us: I64  # time at each of these headings
    period: I64  # steps from look to look
    latency: I64  # steps until a sighting is known
    errs: I64  # 1 where what is perceived can be wrong
    points: I64  # points of a user's body besides its centre that are looked at
    bodies: I64  # (cameras, users, points + 1, 2): where they are, from the centre; it is first
    reach: I64  # (cameras, users): how far they are from it
    widest: I64  # (cameras, users): farthest distance of a centre in view, squared


def camera_poses(
    lenses: Lenses, camera: int, body: tuple[I64, I64, I64], moments_us: I64
) -> tuple[I64, I64, I64]:
    """Return where a camera is and where it looks at some moments, as `camera_pose` does.

    Args:
        lenses: The cameras of a body.
        camera: The number of the camera.
        body: x, y [lattice units] and heading of the body, int64 (n,) each.
        moments_us: The times since the start, int64 (n,).
    """
    x, y, heading = body
    dx, dy = turned(lenses.forward[camera], lenses.left[camera], 2 * heading)
    looks = heading + lenses.heading[camera]
    if lenses.pan_count[camera]:
        looks = (
            looks
            + lenses.pans[camera][moments_us // lenses.pan_us[camera] % lenses.pan_count[camera]]
        )
    return x + dx, y + dy, looks % TURN


class Reach(NamedTuple):
    """How far and how wide a camera sees."""

    near_squared: int  # lattice units squared, below 2**52
    far_squared: int
    half_angle: int  # 1/8192 of a turn; 4096 and more is all round


class ErrorTables(NamedTuple):
    """The errors of the cameras of one robot. The first axis of every array is the camera.

    "Cumulative" tables hold in entry i the probability of all outcomes up to i.
    """

    table: I64  # (cameras, TABLE): the parts of TablePart, one after the other
    confusion: I64  # (cameras, users, users): which user one is mistaken for, cumulative
    has_ghosts: I64  # (cameras,): 1 if there are false positives
    ghosts: I64  # (cameras, MAX_GHOSTS): number in one look, of all sources, cumulative
    source: I64  # (cameras, sources): the source of one, cumulative
    spot: I64  # (cameras, sources, 3): x, y, noise as RANGE_NOISE; source 0 is the whole view
    looks_like: I64  # (cameras, users + 1): identity of a false positive, nobody last, cumulative
    keys: U64  # (cameras, users, len(UserDraw)): streams
    ghost_keys: U64  # (cameras, len(GhostDraw)): streams
    injected: I64 = np.zeros((0, 5), np.int64)  # (n, 5): camera, identity, x, y, heading


class UserPoses(NamedTuple):
    """The poses of all users over a span: row u is user u, column j is step first + j."""

    x: I64
    y: I64
    heading: I64
    away: U8
    posture: I8


class SightMemory(NamedTuple):
    """The state of a robot's perception between spans.

    An axis of identities has a row for each user, and last one for people who weren't recognized.
    """

    noticed: I64  # (identities,): last step at which the identity was noticed; -1: never
    seen: I64  # (identities,): 1 while the identity counts as seen
    about: I64  # (cameras, users, len(About)): see fleet2d.kernels.sight.About
    backlog: I64  # (cameras, rows, columns): a ring buffer of sightings that aren't known yet
    waiting: I64  # (cameras, 2): first row and length of the backlog


class SightEvents(NamedTuple):
    """Identities that come into view or are lost, in order of (step, identity)."""

    step: I64
    user: I32
    kind: I32  # USER_SEEN | USER_LOST


class DetectionRule(NamedTuple):
    """The settings that all cameras of a robot share."""

    patience: int  # steps without a sighting after which an identity counts as lost
    step_us: int
    start_us: int  # time of day at step 0
    burst: int  # maximum number of sightings that become known in one step
    stop_lost: bool  # whether an event ends the span
    stop_seen: bool


def new_memory(cameras: int, users: int, backlog: int) -> SightMemory:
    """Return the memory of a robot that has not seen anybody."""
    never = -1
    about = np.zeros((cameras, users, len(About)), np.int64)
    about[..., [About.DRAW_STEP.value, About.TRACK_STEP.value]] = never
    return SightMemory(
        noticed=np.full(users + 1, never, np.int64),
        seen=np.zeros(users + 1, np.int64),
        about=about,
        backlog=np.zeros((cameras, backlog, len(SightingColumn)), np.int64),
        waiting=np.zeros((cameras, 2), np.int64),
    )


class PoseCache(NamedTuple):
    """What cameras see at each pose: an open hash table of 2**n slots, at most half full.

    Attributes:
        pose: int64 (slots, 4), x, y [lattice units], heading, and pan position of the cameras.
        last: int64 (slots,), last step with the pose, -1 for an empty slot.
        settled: int64 (slots,), the last of these steps that `CoverageRecord.last` has counted.
        cells: int32 (slots, patches), number of cells of each patch in view.
        used: int64 (1,), number of used slots.
    """

    pose: I64
    last: I64
    settled: I64
    cells: I32
    used: I64


class CoverageRecord(NamedTuple):
    """What a robot has seen since the start.

    Attributes:
        first: int64 (rows, columns), first step at which each cell was in view, -1 for never.
        last: int64 (rows, columns), the last such step, up to the last call of `settle_coverage`;
            empty: not recorded.
        exposure: int64 (patches,), cells of each patch in view, summed over the steps.
        counted: int64 (rows, columns), the last look that counted each cell, which several cameras
            may show; empty for one camera.
        binned: int64 (bins, patches), as `exposure`, by time: `record_coverage` overwrites the bins
            of its steps; empty: not recorded.
        peak: int64 (bins, patches), largest number of cells of each patch in view at a step,
            likewise.
    """

    first: I64
    last: I64
    exposure: I64
    counted: I64
    binned: I64
    peak: I64


class CoverageSetup(NamedTuple):
    """The constants of a robot's coverage.

    Attributes:
        walls: Mesh of the space that is free for sight; its borders are the walls.
        lenses: The robot's cameras.
        patch_of_cell: int16 (rows, columns), the patch of each cell, a room or a part of one; -1
            for none.
        step_us: Length of a step.
        every: It looks at multiples of this step; each look counts for this many steps.
        bin_steps: Steps of a bin of `CoverageRecord.binned`; bins begin at step 0.
    """

    walls: Mesh
    lenses: Lenses
    patch_of_cell: I16
    step_us: int
    every: int
    bin_steps: int


def empty_pose_cache(slots: int, patches: int) -> PoseCache:
    """Return an empty cache; `slots` is a power of two, each of 48 bytes and 4 per patch."""
    return PoseCache(
        pose=np.zeros((slots, 4), np.int64),
        last=np.full(slots, NEVER, np.int64),
        settled=np.full(slots, NEVER, np.int64),
        cells=np.zeros((slots, patches), np.int32),
        used=np.zeros(1, np.int64),
    )
