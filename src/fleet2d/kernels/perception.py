"""How a camera errs: misses, mistaken identities, noise, and people that aren't there.

Probabilities are integers in units of 2**-31, read from tables that set-up has filled, so that
every draw is a comparison of integers: the same on every machine.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fleet2d.kernels._jit import kernel
from fleet2d.kernels.headings import HALF_TURN, QUARTER, TURN, UNIT, half_sine
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
MOST_GHOSTS = 20  # of one source in one look; more are too unlikely to have a probability
TRIES = 64  # points of a wedge that are tried before nothing is taken to be in view
NOBODY = -1  # the user behind a false positive; the identity of somebody not recognized

# Streams of the draws about one user, and of those about one source of false positives.
DETECT, ATTEND, IDENTIFY, WHOM, RANGE, BEARING, TURNED, SEEMS = range(8)
PURPOSES = 8
HOW_MANY, WHERE, LOOKS_LIKE, FACES = range(4)
GHOST_PURPOSES = 4


class ErrorTables(NamedTuple):
    """How the cameras of one robot err. The first axis of every array is the camera.

    "Cumulative" tables hold in entry i the probability of all outcomes up to i.
    """

    shift: I64  # (cameras,): a distance of d lattice units is entry d >> shift of a table
    distance: I64  # (cameras, bins): factors of the probability to notice a user
    bearing: I64  # (cameras, TURN): by 1/4096 turn left of the optical axis, + HALF_TURN
    facing: I64  # (cameras, HALF_TURN + 1): by how far the user is turned away from the camera
    posture: I64  # (cameras, POSTURES)
    shown: I64  # (cameras, points + 2): by the number of the body's points in view
    light: I64  # (cameras, MINUTES): by the minute of the day
    stay: I64  # (cameras, DOUBLINGS): that attention outlasts 2**i steps
    right: I64  # (cameras, bins): that a user is recognized
    mistaken: I64  # (cameras, bins): that a user is taken for another one
    whom: I64  # (cameras, users, users): for whom, cumulative
    keeps: I64  # (cameras,): 1 if an identity lasts as long as the user is tracked
    range_noise: I64  # (cameras,): 2**-16 lattice units per unit of random_bell
    range_share: I64  # (cameras,): the same per lattice unit of distance, times 2**16
    bearing_noise: I64  # (cameras,): 2**-16 / 8192 of a turn per unit of random_bell
    heading_noise: I64  # (cameras,): 2**-16 headings per unit of random_bell
    seems: I64  # (cameras, POSTURES, POSTURES): perceived posture by true one, cumulative
    sources: I64  # (cameras,): number of sources of false positives; 0: there are none
    ghosts: I64  # (cameras, sources, MOST_GHOSTS): how many in one look, cumulative
    spot: I64  # (cameras, sources, 3): x, y, noise as range_noise; of source 0 all is in view
    looks_like: I64  # (cameras, users + 1): identity of a false positive, nobody last, cumulative
    keys: U64  # (cameras, users, PURPOSES): streams
    ghost_keys: U64  # (cameras, sources, GHOST_PURPOSES)


@kernel
def random_share(key: np.uint64, counter: int) -> int:
    """Return an integer in [0, ONE)."""
    return int(random_bits(key, counter) >> np.uint64(64 - BITS))


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
def lasting(stay: I64, steps: int) -> int:
    """Return the probability that attention outlasts so many steps, from that for 2**i steps."""
    share, i = ONE, 0
    while steps > 0:
        if steps & 1:
            share = (share * stay[i]) >> BITS
        steps >>= 1
        i += 1
    return share


@kernel
def notice_chance(
    errors: ErrorTables,
    camera: int,
    chance: int,
    distance: int,
    bearing: int,
    facing: int,
    posture: int,
    shown: int,
    minute: int,
) -> int:
    """Return the probability [2**-53] that a camera notices a user in view.

    `chance` [2**-53] is the camera's own, `distance` the entry of the tables by distance, `bearing`
    the signed turn from the optical axis to the user, `facing` the turn between where the user
    faces and the camera.
    """
    share = errors.distance[camera, distance]
    share = (share * errors.bearing[camera, bearing + HALF_TURN]) >> BITS
    share = (share * errors.facing[camera, facing]) >> BITS
    share = (share * errors.posture[camera, posture]) >> BITS
    share = (share * errors.shown[camera, shown]) >> BITS
    share = (share * errors.light[camera, minute]) >> BITS
    return int(((chance >> (53 - BITS)) * share) >> (2 * BITS - 53))


@kernel
def attention(
    errors: ErrorTables, camera: int, user: int, now: int, drawn: I64, drawn_at: I64
) -> int:
    """Return the draw [2**-53] that decides whether a user in view is noticed.

    It is the last look's with the probability that attention has lasted since then, else a new one.
    So misses come in runs, and at a steady chance they are a two-state Markov chain; how often
    they happen is just as configured, since each draw for itself is uniform.
    """
    before = drawn_at[camera, user]
    drawn_at[camera, user] = now
    stay = errors.stay[camera]
    keys = errors.keys[camera, user]
    if before < 0 or stay[0] == 0 or random_share(keys[ATTEND], now) >= lasting(stay, now - before):
        drawn[camera, user] = np.int64(random_bits(keys[DETECT], now) >> np.uint64(11))
    return int(drawn[camera, user])


@kernel
def identify(
    errors: ErrorTables,
    camera: int,
    user: int,
    now: int,
    distance: int,
    patience: int,
    taken_for: I64,
    tracked: I64,
) -> int:
    """Return for whom a noticed user is taken; NOBODY for somebody not recognized."""
    before = tracked[camera, user]
    tracked[camera, user] = now
    if errors.keeps[camera] == 1 and before >= 0 and now - before < patience:
        return int(taken_for[camera, user])
    keys = errors.keys[camera, user]
    draw = random_share(keys[IDENTIFY], now)
    found = NOBODY
    right = errors.right[camera, distance]
    if draw < right:
        found = user
    elif draw < right + errors.mistaken[camera, distance]:
        found = pick(errors.whom[camera, user], random_share(keys[WHOM], now))
        if found == errors.whom.shape[2]:
            found = NOBODY
    taken_for[camera, user] = found
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
    errors: ErrorTables, camera: int, user: int, now: int, dx: int, dy: int, distance: int
) -> tuple[int, int]:
    """Return where a user at (dx, dy) from the camera, `distance` away, is perceived from there."""
    noise = errors.range_noise[camera] + ((errors.range_share[camera] * distance) >> 16)
    turning = errors.bearing_noise[camera]
    if distance == 0 or (noise == 0 and turning == 0):
        return dx, dy
    keys = errors.keys[camera, user]
    wanted = max(0, distance + bell(keys[RANGE], now, noise))
    return turn_and_stretch(dx, dy, bell(keys[BEARING], now, turning), distance, wanted)


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
