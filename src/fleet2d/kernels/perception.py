"""How a camera errs: misses, mistaken identities, noise, and people that aren't there.

Probabilities are integers in units of 2**-31, read from tables that set-up has filled, so that
every draw is a comparison of integers: the same on every machine.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fleet2d.kernels._jit import kernel
from fleet2d.kernels.headings import (
    HALF_TURN,
    QUARTER,
    TURN,
    UNIT,
    half_sine,
    heading_of,
    turn_between,
)
from fleet2d.kernels.mesh import Mesh
from fleet2d.kernels.random import random_bell, random_below, random_bits
from fleet2d.kernels.sight import walk_line_of_sight

I64 = NDArray[np.int64]
U64 = NDArray[np.uint64]

BITS = 31
ONE = 1 << BITS  # probability 1
POSTURES = 3  # stand, sit, lie
MINUTES = 1440
DOUBLINGS = 62
MOST_GHOSTS = 20  # in one look; more are too unlikely to have a probability
TRIES = 64  # points of a wedge that are tried before nothing is taken to be in view
NOBODY = -1  # the user behind a false positive; the identity of somebody not recognized

# Streams of the draws about one user, and of those about false positives.
DETECT, ATTEND, IDENTIFY, WHOM, RANGE, BEARING, TURNED, SEEMS = range(8)
PURPOSES = 8
HOW_MANY, WHICH, WHERE, LOOKS_LIKE, FACES = range(5)
GHOST_PURPOSES = 5


# The parts of a camera's table. All in one row of one array: compiled code hands a tuple of many
# arrays from function to function at a price.
BINS = 512  # of a table by distance
MOST_SHOWN = 34  # numbers of a body's points that may be in view, 0 included
AT_DISTANCE = 0  # factors of the probability to notice a user, by entry of the distance
AT_BEARING = AT_DISTANCE + BINS  # by 1/4096 turn left of the optical axis, + HALF_TURN
AT_FACING = AT_BEARING + TURN  # by how far the user is turned away from the camera
AT_POSTURE = AT_FACING + HALF_TURN + 1
AT_SHOWN = AT_POSTURE + POSTURES  # by the number of the body's points in view
AT_LIGHT = AT_SHOWN + MOST_SHOWN  # by the minute of the day
AT_STAY = AT_LIGHT + MINUTES  # that attention outlasts 2**i steps
AT_RIGHT = AT_STAY + DOUBLINGS  # that a user is recognized, by entry of the distance
AT_MISTAKEN = AT_RIGHT + BINS  # that a user is taken for another one
AT_SEEMS = AT_MISTAKEN + BINS  # perceived posture by true one, cumulative
SHIFT = AT_SEEMS + POSTURES * POSTURES  # a distance of d lattice units is entry d >> shift
KEEPS = SHIFT + 1  # 1 if an identity lasts as long as the user is tracked
RANGE_NOISE = SHIFT + 2  # 2**-16 lattice units per unit of random_bell
RANGE_SHARE = SHIFT + 3  # the same per lattice unit of distance, times 2**16
BEARING_NOISE = SHIFT + 4  # 2**-16 / 8192 of a turn per unit of random_bell
HEADING_NOISE = SHIFT + 5  # 2**-16 headings per unit of random_bell
TABLE = SHIFT + 6

# What is carried along about each user, by camera, from look to look.
DRAWN, DRAWN_AT, TAKEN_FOR, TRACKED, IN_VIEW, NOTICED = range(6)
ABOUT = 6


class ErrorTables(NamedTuple):
    """How the cameras of one robot err. The first axis of every array is the camera.

    "Cumulative" tables hold in entry i the probability of all outcomes up to i.
    """

    table: I64  # (cameras, TABLE)
    whom: I64  # (cameras, users, users): for whom one is mistaken, cumulative
    haunted: I64  # (cameras,): 1 if there are false positives
    ghosts: I64  # (cameras, MOST_GHOSTS): how many in one look, of all sources, cumulative
    source: I64  # (cameras, sources): which source one is of, cumulative
    spot: I64  # (cameras, sources, 3): x, y, noise as RANGE_NOISE; of source 0 all is in view
    looks_like: I64  # (cameras, users + 1): identity of a false positive, nobody last, cumulative
    keys: U64  # (cameras, users, PURPOSES): streams
    ghost_keys: U64  # (cameras, GHOST_PURPOSES)


@kernel
def random_share(key: np.uint64, counter: int) -> int:
    """Return an integer in [0, ONE)."""
    return int(random_bits(key, counter) >> np.uint64(64 - BITS))


@kernel
def random_shares(key: np.uint64, counters: I64) -> I64:
    """Return the integer in [0, ONE) of each counter."""
    shares = np.empty(counters.shape[0], np.int64)
    for i in range(counters.shape[0]):
        shares[i] = random_share(key, counters[i])
    return shares


@kernel
def pick(cumulative: I64, draw: int) -> int:
    """Return the first outcome whose cumulative probability is above `draw`; their number if none.

    >>> int(pick(np.array([ONE // 2, ONE]), ONE // 2))
    1
    """
    outcome = 0
    while outcome < cumulative.shape[0] and draw >= cumulative[outcome]:
        outcome += 1
    return outcome


@kernel
def lasting(table: I64, camera: int, steps: int) -> int:
    """Return the probability that attention outlasts so many steps, from that for 2**i steps."""
    share, i = ONE, AT_STAY
    while steps > 0:
        if steps & 1:
            share = (share * table[camera, i]) >> BITS
        steps >>= 1
        i += 1
    return share


@kernel
def length(dx: int, dy: int) -> int:
    """Return how long (dx, dy) is [lattice units], rounded down."""
    return int(np.sqrt(np.float64(dx * dx + dy * dy)))


@kernel
def distance_entry(table: I64, camera: int, dx: int, dy: int) -> int:
    """Return the entry of the tables by distance that (dx, dy) belongs to."""
    return int(min(length(dx, dy) >> table[camera, SHIFT], BINS - 1))


@kernel
def steady_chance(
    table: I64,
    camera: int,
    heading: int,
    dx: int,
    dy: int,
    faces: int,
    posture: int,
    shown: int,
) -> int:
    """Return the product of all factors but light [2**-31] for a user at (dx, dy) from the camera.

    Args:
        table: The cameras' tables.
        camera: Which camera.
        heading: Where it looks.
        dx: Where the user is, from the camera [lattice units].
        dy: The same.
        faces: Where the user faces.
        posture: 0 stands, 1 sits, 2 lies.
        shown: How many points of the body are in view.
    """
    bearing = turned = 0
    if dx != 0 or dy != 0:
        towards = heading_of(dx, dy)
        bearing = turn_between(heading, towards)
        turned = abs(turn_between(towards + HALF_TURN, faces))
    share = table[camera, AT_DISTANCE + distance_entry(table, camera, dx, dy)]
    share = (share * table[camera, AT_BEARING + HALF_TURN + bearing]) >> BITS
    share = (share * table[camera, AT_FACING + turned]) >> BITS
    share = (share * table[camera, AT_POSTURE + posture]) >> BITS
    return int((share * table[camera, AT_SHOWN + shown]) >> BITS)


@kernel
def notice_chance(steady: int, light: int, chance: int) -> int:
    """Return the probability to notice [2**-53], from [2**-31], [2**-31] and the camera's own."""
    return int(((chance >> (53 - BITS)) * ((steady * light) >> BITS)) >> (2 * BITS - 53))


@kernel
def attention(table: I64, keys: U64, about: I64, camera: int, user: int, now: int) -> int:
    """Return the draw [2**-53] that decides whether a user in view is noticed.

    It is the last look's with the probability that attention has lasted since then, else a new one.
    So misses come in runs, and at a steady chance they are a two-state Markov chain; how often
    they happen is just as configured, since each draw for itself is uniform.
    """
    before = about[camera, user, DRAWN_AT]
    about[camera, user, DRAWN_AT] = now
    fresh = before < 0 or table[camera, AT_STAY] == 0
    if not fresh:
        draw = random_share(keys[camera, user, ATTEND], now)
        fresh = draw >= lasting(table, camera, now - before)
    if fresh:
        bits = random_bits(keys[camera, user, DETECT], now) >> np.uint64(11)
        about[camera, user, DRAWN] = np.int64(bits)
    return int(about[camera, user, DRAWN])


@kernel
def identify(
    table: I64,
    whom: I64,
    keys: U64,
    about: I64,
    camera: int,
    user: int,
    now: int,
    distance: int,
    patience: int,
) -> int:
    """Return for whom a noticed user is taken; NOBODY for somebody not recognized."""
    before = about[camera, user, TRACKED]
    about[camera, user, TRACKED] = now
    if table[camera, KEEPS] == 1 and before >= 0 and now - before < patience:
        return int(about[camera, user, TAKEN_FOR])
    draw = random_share(keys[camera, user, IDENTIFY], now)
    found = NOBODY
    right = table[camera, AT_RIGHT + distance]
    if draw < right:
        found = user
    elif draw < right + table[camera, AT_MISTAKEN + distance]:
        found = pick(whom[camera, user], random_share(keys[camera, user, WHOM], now))
        if found == whom.shape[2]:
            found = NOBODY
    about[camera, user, TAKEN_FOR] = found
    return found


@kernel
def bell(key: np.uint64, counter: int, noise: int) -> int:
    """Return a bell-shaped integer; `noise` is 2**-16 per unit of random_bell."""
    return (random_bell(key, counter) * noise + 32768) >> 16


@kernel
def turn_and_stretch(dx: int, dy: int, turn: int, distance: int, wanted: int) -> tuple[int, int]:
    """Return (dx, dy), `distance` long, turned by `turn`/8192 of a turn and `wanted` long."""
    cosine, sine = half_sine(turn + 2 * QUARTER), half_sine(turn)
    turned_x = (dx * cosine - dy * sine) >> 20  # 2**-10 lattice units
    turned_y = (dx * sine + dy * cosine) >> 20
    whole = distance << 10
    return (
        (2 * turned_x * wanted + whole) // (2 * whole),
        (2 * turned_y * wanted + whole) // (2 * whole),
    )


@kernel
def blurred(
    table: I64, keys: U64, camera: int, user: int, now: int, dx: int, dy: int
) -> tuple[int, int]:
    """Return where a user at (dx, dy) from the camera is perceived, from there."""
    distance, turning = length(dx, dy), table[camera, BEARING_NOISE]
    noise = table[camera, RANGE_NOISE] + ((table[camera, RANGE_SHARE] * distance) >> 16)
    if distance == 0 or (noise == 0 and turning == 0):
        return dx, dy
    wanted = max(0, distance + bell(keys[camera, user, RANGE], now, noise))
    turn = bell(keys[camera, user, BEARING], now, turning)
    return turn_and_stretch(dx, dy, turn, distance, wanted)


@kernel
def seeming(table: I64, camera: int, posture: int, draw: int) -> int:
    """Return the posture that a posture is taken for."""
    first = AT_SEEMS + POSTURES * posture
    found = 0
    while found < POSTURES - 1 and draw >= table[camera, first + found]:
        found += 1
    return found


@kernel
def ghost_place(
    walls: Mesh,
    spot: I64,
    anywhere: bool,
    key: np.uint64,
    x: int,
    y: int,
    triangle: int,
    heading: int,
    half_angle: int,
    near_squared: int,
    far_squared: int,
) -> tuple[bool, int, int]:
    """Return whether a false positive appears, and where.

    That of `anywhere` is uniform over what is in view: points of the wedge are drawn until no wall
    hides one. Any other is near its spot, which the caller must find in range and in the wedge.
    """
    if not anywhere:
        px = spot[0] + bell(key, 0, spot[2])
        py = spot[1] + bell(key, 1, spot[2])
        seen = walk_line_of_sight(
            walls.vertices, walls.triangles, walls.neighbors, x, y, triangle, px, py
        )
        return seen, px, py
    half = min(half_angle, TURN)
    for attempt in range(TRIES):
        part = random_below(key, 2 * attempt, 1 << 20)
        squared = near_squared + (((far_squared - near_squared) * part) >> 20)
        distance = int(np.sqrt(np.float64(squared)))
        towards = 2 * heading + random_below(key, 2 * attempt + 1, 2 * half) - half
        px = x + ((distance * half_sine(towards + 2 * QUARTER) + UNIT // 2) >> 30)
        py = y + ((distance * half_sine(towards) + UNIT // 2) >> 30)
        if walk_line_of_sight(
            walls.vertices, walls.triangles, walls.neighbors, x, y, triangle, px, py
        ):
            return True, px, py
    return False, x, y
