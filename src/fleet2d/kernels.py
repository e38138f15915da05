"""The Python interface of the compiled core: arrays and integers in, arrays and integers out.

It exports the functions and constants of :mod:`fleet2d._core` that other modules need, and defines
the named tuples that these take and return, with shapes and units.

The types of arrays, which the whole project uses, are named by their elements: `I64` is an array
of int64 of any shape, `F64` one of float64, `Bool` one of booleans.

**Random bits** are a pure function of (key, counter), so no draw depends on another. The generator
is SplitMix64 (Steele, Lea, Flood: "Fast splittable pseudorandom number generators", OOPSLA 2014)
addressed by counter instead of by state. Keys come from :mod:`fleet2d.runtime.determinism`.

**Headings** are integers: 4096 (`TURN`) to a turn, counter-clockwise from +x, with one table of
sines. No sine or arc tangent is computed at run time: they differ in the last bit between machines.
`SINES` has `UNIT` times the sines of a quarter turn at half-heading resolution, int64 (2049,):
entry i is the angle i * 2 pi / 8192, rounded to 2**-30, where all math libraries agree.

**The space between walls** is a mesh, a triangulation of the free space whose vertices are all wall
vertices. Everything that sight and paths need follows from it by integer arithmetic. Results don't
depend on which of the possible triangulations it is. The neighbor across a wall edge is `WALL`. A
cell has `SUB` lattice units; `CELL_CENTRE`, the offset of its centre, is odd, so that no
axis-parallel wall runs through a centre. Pixels outside a mask count as not in the mask.

**A shortest path** in a polygonal space bends only at its reflex corners (Lozano-Pérez and Wesley,
Communications of the ACM 22, 1979): `Routes` is A* over the corners that a taut string can touch.
The space is the free space shrunk by a body's radius, so a path may touch its border. Which corners
see each other is decided in integers; lengths are the only floats (sums of correctly rounded square
roots, the same on every machine).

**Sight lines** follow the strict rule: a sight line touches no wall, not even a corner. Verdicts
are exact and symmetric, and they don't depend on how the free space is cut into triangles. A
visible region is a list of pieces, counter-clockwise, each a triangle between the eye and a wall. A
piece is stored as two numbers: the vertex that its right border runs through, and the wall edge
that it ends at (``3 * triangle + k``). The piece's left border is the right border of the next
piece, so every direction belongs to exactly one piece. Coordinates appear only when a region is
measured or drawn. The method is triangular expansion (Bungiu, Hemmer et al. 2014, arXiv 1403.3905):
see ``src/core/region.hpp``.

**Cameras err**: misses, mistaken identities, noise, and people that aren't there. Probabilities are
integers in units of 2**-31, read from tables that set-up has filled, so that every draw is a
comparison of integers. A robot stands most of the time, and it returns to the same poses on its
rounds, so the view of a pose is cached: the number of cells of each room, and the last step at
which the robot had the pose. The cells themselves are computed again when the last steps are
needed.

**A track** is five arrays over its breakpoints i: time [us], x, y [lattice], heading [1/4096 turn],
and away (1 = not at home). Between two breakpoints the pose moves in a straight line and turns the
shorter way, both at constant rate; before the first and after the last one it stays. `Timelines`
holds the tracks of all bodies. `DayPlanner`, `Interruptions` and `Resident` make those of people
who follow a routine.

**The stays of a person** are a hidden semi-Markov chain over patches of rooms, which is forecast,
filtered and smoothed. BLAS and einsum add in an order that depends on the machine. These loops
don't, and use no logarithms, so learned models, and the decisions of robots that follow from them,
are the same everywhere.
"""

import math
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

# All names of the core are names of this module; those below are used here, too.
from fleet2d._core import *  # noqa: F403 - its stub lists them
from fleet2d._core import NEVER, QUARTER, SINES, TURN, UNIT, About, Mesh, SightingColumn

Bool = NDArray[np.bool_]
F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
I8 = NDArray[np.int8]
I16 = NDArray[np.int16]
I32 = NDArray[np.int32]
I64 = NDArray[np.int64]
U8 = NDArray[np.uint8]
U64 = NDArray[np.uint64]


def in_radians(heading: int | I64) -> Any:
    """Return headings in radians, 0 to 2 pi."""
    return heading * (2 * math.pi / TURN)


def rounded(values: Any) -> I64:
    """Return values rounded to integers, half to even: int64 of the same shape."""
    return np.rint(values).astype(np.int64)


def turned(x: I64, y: I64, angle: I64) -> tuple[I64, I64]:
    """Return points turned about the origin, rounded: x and y.

    Args:
        x: int64 (n,), at most 2**31.
        y: int64 (n,), at most 2**31.
        angle: Any integers, 1/8192 of a turn, which is half a heading, int64 (n,).

    Example:
        >>> turned(np.array([10, 10]), np.array([0, 5]), np.array([2048, -2048]))
        (array([0, 5]), array([ 10, -10]))
    """
    sines = half_sines()
    half = UNIT // 2
    along = sines[(angle + 2 * QUARTER) % (2 * TURN)]
    up = sines[angle % (2 * TURN)]
    return (x * along - y * up + half) // UNIT, (x * up + y * along + half) // UNIT


@cache
def half_sines() -> I64:
    """Return UNIT times the sines of a whole turn: entry i is the angle i * 2 pi / 8192."""
    rising = SINES[:-1]
    falling = SINES[:0:-1]
    return np.concatenate([rising, falling, -rising, -falling])


class Corners(NamedTuple):
    """The reflex corners of a space: the nodes of its route graph."""

    vertex: I64  # (nodes,) the vertex of the mesh at each, ascending
    before: I64  # (nodes, 2) the vertex of the border before the corner [lattice]
    after: I64  # (nodes, 2) the vertex of the border after the corner [lattice]
    simple: Bool  # (nodes,) False where several walls meet, so none is before or after


UNKNOWN_TRUTH = -2
"""The true user of a sighting in a real home, where nobody knows it; see SightingColumn.USER."""


class RoomFloor(NamedTuple):
    """The floor of a room and what surrounds it; (rows, columns) unless noted otherwise."""

    holds: Bool  # cells that furniture may cover
    whole: Bool  # cells that no wall cuts; the floor kept empty in front of furniture is of these
    before_walls: I32  # (4, rows + 1, columns + 1) corner_sums of cells before a wall, by turn
    from_doors: I64  # squared distance from the floor before doors [cells]


class GroupRule(NamedTuple):
    """A group of furniture, and the points that a place earns."""

    width: int  # extent along the back [cells]
    depth: int  # extent away from the back [cells]
    front: int  # depth of the floor before it that stays empty [cells]
    backed: int  # least part of its back that is before a wall [cells]
    corner: int  # points for a place in a corner
    away: int  # points for a place far from doors
    far: int  # distance from doors beyond which more distance earns no points [cells]


class Divisions(NamedTuple):
    """Trees by which rectangles are cut into rooms; their nodes stand in preorder."""

    # (nodes, 2): a room and the percent of its area, or of a cut -1 (along y) or -2, and its parts
    nodes: I64
    starts: I64  # (trees,) the first node of each tree


class CorridorRule(NamedTuple):
    """A corridor along a strip of rooms of a synthetic home."""

    hall: int  # index of the hallway
    width: int  # its gross width [units]
    suite: bool  # whether the last room of the strip ends the corridor, and is as much deeper
    closet: int  # a small room at its end, or -1


class Lenses(NamedTuple):
    """The constants of a robot's cameras; int64 (cameras,) unless noted otherwise."""

    near_squared: I64  # lattice units squared
    far_squared: I64
    half_angle: I64  # 1/8192 of a turn; 4096 and more is all round
    chance: I64  # probability of noticing a user in view, times 2**53
    moves: I64  # 0 if the camera is at the robot's centre and looks straight ahead
    forward: I64  # the camera's position in the robot's frame [lattice units]
    left: I64
    heading: I64  # the camera's heading relative to the robot's
    pans: I64  # (cameras, headings): added to `heading`, one after the other
    pan_count: I64
    pan_us: I64  # time at each of these headings [us]
    period: I64  # steps from look to look
    latency: I64  # steps until a sighting is known
    errs: I64  # 1 where what is perceived can be wrong
    points: I64  # points of a user's body besides its centre that are looked at
    bodies: I64  # (cameras, users, points + 1, 2): centre and points, relative to the centre
    reach: I64  # (cameras, users): distance of the points from the centre
    widest: I64  # (cameras, users): farthest distance of a centre in view, squared


class Heights(NamedTuple):
    """The heights of cameras, bodies and low furniture [mm], int64 below 2**13."""

    eyes: I64  # (cameras, postures): of each camera, by the posture of its owner
    points: I64  # (cameras, users, postures, points + 1): of the points of a body, as Lenses.bodies
    tops: I64  # (bodies, postures): of all bodies
    corners: I64  # (corners, 2): the outlines of furniture, piece after piece [lattice units]
    start: I64  # (pieces + 1,): where each piece begins in `corners`
    boxes: I64  # (pieces, 4): smallest x and y, and largest, of each piece
    top: I64  # (pieces,): height of each piece


def camera_poses(
    lenses: Lenses, camera: int, body: tuple[I64, I64, I64], moments_us: I64
) -> tuple[I64, I64, I64]:
    """Return the positions and headings of a camera at some moments, as `camera_pose` does.

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
        pan = moments_us // lenses.pan_us[camera] % lenses.pan_count[camera]
        looks = looks + lenses.pans[camera][pan]
    return x + dx, y + dy, looks % TURN


class Reach(NamedTuple):
    """The range and angle of a camera."""

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
    ghosts: I64  # (cameras, MAX_GHOSTS): number of them in one look, cumulative
    source: I64  # (cameras, sources): the source of a false positive, cumulative
    spot: I64  # (cameras, sources, 3): x, y, noise as RANGE_NOISE; source 0 is the whole view
    looks_like: I64  # (cameras, users + 1): identity of a false positive, nobody last, cumulative
    keys: U64  # (cameras, users, len(UserDraw)): streams
    ghost_keys: U64  # (cameras, len(GhostDraw)): streams
    injected: I64 = np.zeros((0, 5), np.int64)  # (n, 5): camera, identity, x, y, heading


class PoseBlock(NamedTuple):
    """The poses of several bodies at consecutive steps, a row each; column j is step first + j.

    Attributes:
        x: int64 (bodies, steps), lattice units.
        y: int64 (bodies, steps), lattice units.
        heading: int64 (bodies, steps), 1/4096 turn.
        away: uint8 (bodies, steps), nonzero while a body is away.
        posture: int8 (bodies, steps), number of the posture.
    """

    x: I64
    y: I64
    heading: I64
    away: U8
    posture: I8


class SightMemory(NamedTuple):
    """The state of a robot's perception between spans.

    An axis of identities has an entry for each user, and a last one for people not recognized.
    """

    noticed: I64  # (identities,): last step at which the identity was noticed; -1: never
    seen: I64  # (identities,): 1 while the identity counts as seen
    about: I64  # (cameras, users, len(About)): see fleet2d.kernels.About
    backlog: I64  # (cameras, rows, columns): a ring buffer of sightings that aren't known yet
    waiting: I64  # (cameras, 2): first row and length of the backlog

    def waiting_rows(self, camera: int) -> I64:
        """Return the rows of a camera's backlog with sightings that aren't known yet, in order."""
        begin, length = self.waiting[camera].tolist()
        return (begin + np.arange(length)) % max(1, self.backlog.shape[1])


class DetectionRule(NamedTuple):
    """The settings that all cameras of a robot share."""

    patience: int  # steps without a sighting after which an identity counts as lost
    step_us: int
    start_us: int  # time of day at step 0
    burst: int  # maximum number of sightings that become known in one step
    stop_lost: bool  # whether the loss of an identity ends the span
    stop_seen: bool


def new_memory(cameras: int, users: int, backlog: int) -> SightMemory:
    """Return the memory of a robot that has not seen anybody."""
    about = np.zeros((cameras, users, len(About)), np.int64)
    about[..., [About.DRAW_STEP.value, About.TRACK_STEP.value]] = NEVER
    return SightMemory(
        noticed=np.full(users + 1, NEVER, np.int64),
        seen=np.zeros(users + 1, np.int64),
        about=about,
        backlog=np.zeros((cameras, backlog, len(SightingColumn)), np.int64),
        waiting=np.zeros((cameras, 2), np.int64),
    )


class BatteryState(NamedTuple):
    """A battery at a moment; its charge changes at one of three rates."""

    level: float  # 0 to 1
    since_us: int  # time of `level` since the start
    driving: float  # rates [1/us]: driving or turning,
    standing: float  # standing still,
    charging: float  # and at the charger
    charger_x: int  # lattice units
    charger_y: int
    is_broken: bool  # whether the charger doesn't charge


class RoomMemory(NamedTuple):
    """Sightings of people by room; the last two rows are of people not recognized, and of anyone.

    Attributes:
        last: int64 (people + 2, rooms), the step of the last sighting, -1 for none.
        looks: int64 (people + 2, rooms, 24), number of sightings in each hour of the day.
        total: int64 (people + 2, rooms), number of sightings.
    """

    last: I64
    looks: I64
    total: I64


class ShownMemory(NamedTuple):
    """Which rows of a `RoomMemory` an observation shows, and in which of its columns.

    Attributes:
        fresh_rows: int64 (n,), rows of `last`; -1: the robot's own visits.
        fresh_at: int64 (n,), their columns.
        scale_s: float64 (n,), age at which a sighting counts half [s].
        habit_rows: int64 (m,), first a row of `total`, then rows of `looks` in the present hour.
        habit_at: int64 (m,), their columns.
    """

    fresh_rows: I64
    fresh_at: I64
    scale_s: F64
    habit_rows: I64
    habit_at: I64


class PoseCache(NamedTuple):
    """The cells in view at each pose: poses in order, and an open hash table of 2**n slots.

    Attributes:
        number: int32 (slots,), number of the pose in each slot, -1 for an empty slot.
        pose: int64 (poses, 4), x, y [lattice units], heading, and pan position of the cameras.
        last: int64 (poses,), last step with the pose.
        settled: int64 (poses,), the last of these steps that `CoverageRecord.last` has counted.
        cells: int32 (poses, patches), number of cells of each patch in view.
        shown: int32 (poses, 2), the first patch in view, and one past the last.
        used: int64 (1,), number of poses that are cached.
    """

    number: I32
    pose: I64
    last: I64
    settled: I64
    cells: I32
    shown: I32
    used: I64


class CoverageRecord(NamedTuple):
    """The area that a robot has seen since the start.

    Attributes:
        first: int64 (rows, columns), first step at which each cell was in view, -1 for never;
            empty: not recorded.
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
        every: The robot looks at multiples of this step; each look counts for this many steps.
        bin_steps: Steps of a bin of `CoverageRecord.binned`; bins begin at step 0.
    """

    walls: Mesh
    lenses: Lenses
    patch_of_cell: I16
    step_us: int
    every: int
    bin_steps: int


def empty_pose_cache(slots: int, patches: int) -> PoseCache:
    """Return an empty cache for half as many poses as slots, which are a power of two."""
    poses = slots // 2
    return PoseCache(
        number=np.full(slots, NEVER, np.int32),
        pose=np.zeros((poses, 4), np.int64),
        last=np.zeros(poses, np.int64),
        settled=np.zeros(poses, np.int64),
        cells=np.zeros((poses, patches), np.int32),
        shown=np.zeros((poses, 2), np.int32),
        used=np.zeros(1, np.int64),
    )


class Breakpoints(NamedTuple):
    """The arrays of a track, all of one length."""

    time: I64
    x: I64
    y: I64
    heading: I64
    away: U8


class Distances(NamedTuple):
    """The distances that bodies keep from each other, (rows, bodies) each."""

    lead: I64  # steps by which it reacts before a meeting; below 0: it ignores the other one
    near: I64  # distance of the middles below which they mustn't approach [lattice]
    hard: I64  # distance below which they overlap, and must part [lattice]; 0: they needn't
    counts: U8  # whose motion counts: 0 that of both, 1 its own, 2 that of the other one


class Poses(NamedTuple):
    """Poses of one body over consecutive steps, all arrays of one length."""

    x: I64
    y: I64
    heading: I64
    away: U8


class WalkRule(NamedTuple):
    """The motion of a meandering body in one step."""

    key: np.uint64  # of its random stream
    stride: int  # 1/256 lattice units forward
    sway: int  # standard deviation of the turn, in 2**-16 headings per unit of random_bell
    turn_limit: int  # headings, half a turn at most
    stays: int = 0  # 1: at a wall it keeps its position and its heading only sways


def empty_poses(count: int) -> Poses:
    """Return uninitialized poses, to be filled."""
    x, y, heading = (np.empty(count, np.int64) for _ in range(3))
    return Poses(x, y, heading, np.empty(count, np.uint8))


class Stretches(NamedTuple):
    """Evidence of one user, with runs of identical consecutive bins merged.

    Attributes:
        bins: int64 (stretches,), number of bins of each stretch.
        view: int64 (stretches,), the row of `views`.
        views: uint8 (views, patches), the part of each patch in view, in 1/255; 0 for away, the
            last patch. The stretches of all users share it.
        begin: int64 (stretches + 1,), offsets of each stretch's sightings in `patch` and `share`.
        patch: int64 (sightings,), where the user was perceived.
        share: float64 (sightings,), share of the steps with a sighting.
    """

    bins: I64
    view: I64
    views: U8
    begin: I64
    patch: I64
    share: F64


class StayModel(NamedTuple):
    """The transition probabilities of a person: between stages of a stay, and between rooms.

    Each room, and being away, the last one, has the same number of stages of a stay. A node is a
    stage in a room, by number room * stages per room + stage. A patch is a part of a room's floor.

    Attributes:
        stay: float64 (nodes,), probability of remaining in the stage for another bin.
        follow: float64 (nodes, rooms + 2), distribution after a stage: each room, away, and the
            next stage of the same room; rows sum to one.
        spread: float64 (patches,), probability of the patch given that a person comes to its room.
        restless: float64 (rooms + 1,), probability per bin of changing patch during a stay.
        first: int64 (rooms + 2,), the first patch of each room and of away, then the
            number of patches.
        detection: Probability that a person in view is perceived in a bin.
    """

    stay: F64
    follow: F64
    spread: F64
    restless: F64
    first: I64
    detection: float


class Moments(NamedTuple):
    """Expected moments of a person's stays, given all evidence.

    Attributes:
        time: float64 (nodes,), bins spent in the stage.
        exits: float64 (nodes, rooms + 2), transitions to each room, away, and the next stage.
        arrivals: float64 (patches,), arrivals at the patch, from another room or patch.
        moves: float64 (rooms + 1,), changes of patch.
        rests: float64 (rooms + 1,), bins without a change of patch.
    """

    time: F64
    exits: F64
    arrivals: F64
    moves: F64
    rests: F64


class DayEvidence(NamedTuple):
    """Evidence of a day, or of consecutive bins of it, as stays are learned from it.

    Attributes:
        minute: int64 (bins,), beginning of each bin [minutes since midnight].
        view: int64 (bins,), the row of `views`; consecutive bins with the same view have the same.
        views: uint8 (views, patches), how much of each patch was watched, as in
            `fleet2d.kernels.Stretches`; consecutive rows differ.
        user: int64 (sightings,), ascending, row of the user of each sighting.
        bin: int64 (sightings,), ascending for each user.
        patch: int64 (sightings,), where the user was perceived, ascending within each bin.
        steps: int64 (sightings,), number of steps with a sighting in that bin and patch.
    """

    minute: I64
    view: I64
    views: U8
    user: I64
    bin: I64
    patch: I64
    steps: I64


class PeoplePlaces(NamedTuple):
    """Where people were in consecutive stretches of bins, those of one person after the other.

    Attributes:
        probability: float64 (stretches, rooms + 1), of each room, and of away.
        bins: int64 (stretches,), number of bins of each stretch.
        begin: int64 (people + 1,), offsets of each person's stretches.
    """

    probability: F64
    bins: I64
    begin: I64


class TracedRooms(NamedTuple):
    """The rooms of a home, as `trace_evidence` takes them.

    Attributes:
        share: float64 (rooms,), the share of each room in the floor of all.
        distance: float64 (rooms, rooms), from middle to middle [10 m].
    """

    share: F64
    distance: F64


class TracedEvidence(NamedTuple):
    """Evidence of one person in consecutive bins.

    Attributes:
        day: int64 (bins,), the day of each bin, as `date.toordinal` counts.
        minute: int64 (bins,), its beginning [minutes since midnight].
        watched: float64 (bins, rooms), the share of the room in view.
        seen: float64 (bins, rooms), the share of the steps at which the person was perceived there.
        unknown: uint8 (bins, rooms), 1 where an unknown person was perceived.
        belief: float64 (bins, rooms + 1), the belief of another model, away last.
    """

    day: I64
    minute: I64
    watched: F64
    seen: F64
    unknown: U8
    belief: F64


class PlaceNetwork(NamedTuple):
    """The weights of a network over the set of places, in which all places share their weights.

    With x the features of a place and z what doesn't change of it, a = max(x first + z, 0), b =
    max(a second + mean(a) context + bias, 0), and the score of the place is b score + x_last; the
    mean is over all places. Probabilities are the softmax of the scores.

    Attributes:
        first: float64 (features, hidden).
        second: float64 (hidden, hidden).
        context: float64 (hidden, hidden).
        bias: float64 (hidden,).
        score: float64 (hidden,).
    """

    first: F64
    second: F64
    context: F64
    bias: F64
    score: F64
