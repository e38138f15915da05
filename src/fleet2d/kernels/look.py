"""What the cameras of one robot see of all users over a span of steps, and what it makes of it."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fleet2d.kernels._jit import kernel
from fleet2d.kernels.headings import TURN
from fleet2d.kernels.lens import Lenses, camera_pose, in_wedge, near_wedge, points_in_view
from fleet2d.kernels.mesh import Mesh, locate
from fleet2d.kernels.motion import Poses
from fleet2d.kernels.perception import (
    AT_LIGHT,
    DETECT,
    FACES,
    HEADING_NOISE,
    HOW_MANY,
    IN_VIEW,
    LOOKS_LIKE,
    MINUTES,
    NOBODY,
    NOTICED,
    SEEMS,
    TURNED,
    WHERE,
    WHICH,
    ErrorTables,
    attention,
    bell,
    blurred,
    distance_entry,
    ghost_place,
    identify,
    notice_chance,
    pick,
    random_share,
    seeming,
    steady_chance,
)
from fleet2d.kernels.random import random_below, random_bits
from fleet2d.kernels.sight import walk_line_of_sight

I64 = NDArray[np.int64]
U8 = NDArray[np.uint8]
U64 = NDArray[np.uint64]

USER_LOST = 0
USER_SEEN = 1

# The columns of a sighting. Where a camera was wrong about somebody, USER is NOBODY; where it
# didn't recognize somebody, IDENTITY is. X to POSTURE are as perceived.
STEP, CAMERA, USER, IDENTITY, X, Y, HEADING, POSTURE = range(8)
TRUE_X, TRUE_Y, TRUE_HEADING, TRUE_POSTURE = range(8, 12)
SIGHTING = 12
MINUTE_US = 60_000_000

# What is kept of the last look at a user: from where, at where, points in view; and if the camera
# errs, the way the user stood and how surely one is noticed then; -1: not yet told.
AT_X, AT_Y, AT_HEADING, TO_X, TO_Y, SHOWN, FACED, POSED, STEADY = range(9)
GLANCE = 9


NOT_GIVEN = np.zeros((0, 0, 0), np.uint8)


class Crowd(NamedTuple):
    """All users over the span: row u is user u, column j is step first + j."""

    x: I64
    y: I64
    heading: I64
    away: U8
    posture: NDArray[np.int8]
    shown: U8 = NOT_GIVEN  # (cameras, users, steps): points in view, where others than we tell


class Memory(NamedTuple):
    """What a robot carries from span to span.

    Identities are users, and last somebody not recognized.
    """

    noticed: I64  # (identities,): last step at which one was noticed; -1: never
    seen: I64  # (identities,): 1 while one counts as seen
    about: I64  # (cameras, users, ABOUT): last draw and its step, last identity and its step (a
    # step of -1: never), looks at which a user was in view, and at which one was noticed
    backlog: I64  # (cameras, rows, SIGHTING): a ring of what isn't known yet
    waiting: I64  # (cameras, 2): its first row, and its length


class SightEvents(NamedTuple):
    """Identities that come into view or are lost, in order of (step, identity)."""

    step: I64
    user: NDArray[np.int32]
    kind: NDArray[np.int32]  # USER_SEEN | USER_LOST


class Rule(NamedTuple):
    """What holds for all cameras of a robot."""

    patience: int  # steps without a sighting after which an identity counts as lost
    step_us: int
    start_us: int  # time of day at step 0
    burst: int  # most sightings that become known in one step
    stop_lost: bool  # whether an event ends the span
    stop_seen: bool


@kernel
def perceive(
    table: I64,
    whom: I64,
    keys: U64,
    about: I64,
    camera: int,
    user: int,
    now: int,
    dx: int,
    dy: int,
    patience: int,
    row: I64,
) -> None:
    """Write as what a noticed user at (dx, dy) from the camera is perceived: IDENTITY to POSTURE.

    `row` is a sighting that holds the truth.
    """
    entry = distance_entry(table, camera, dx, dy)
    row[IDENTITY] = identify(table, whom, keys, about, camera, user, now, entry, patience)
    x, y = blurred(table, keys, camera, user, now, dx, dy)
    row[X], row[Y] = row[TRUE_X] + x - dx, row[TRUE_Y] + y - dy
    turned = bell(keys[camera, user, TURNED], now, table[camera, HEADING_NOISE])
    row[HEADING] = (row[TRUE_HEADING] + turned) & (TURN - 1)
    draw = random_share(keys[camera, user, SEEMS], now)
    row[POSTURE] = seeming(table, camera, row[TRUE_POSTURE], draw)


@kernel
def imagine(
    walls: Mesh,
    lenses: Lenses,
    errors: ErrorTables,
    memory: Memory,
    camera: int,
    count: int,
    now: int,
    x: int,
    y: int,
    heading: int,
) -> None:
    """Put so many false positives into the backlog, each at its source if that is in view."""
    near, far = lenses.near_squared[camera], lenses.far_squared[camera]
    half_angle, keys = lenses.half_angle[camera], errors.ghost_keys[camera]
    triangle = locate(walls, x, y)
    for k in range(count):
        source = pick(errors.source[camera], random_share(random_bits(keys[WHICH], now), k))
        spot = errors.spot[camera, source]
        dx, dy = spot[0] - x, spot[1] - y
        in_range = near <= dx * dx + dy * dy <= far
        if source > 0 and not (in_range and in_wedge(heading, half_angle, dx, dy)):
            continue
        found, px, py = ghost_place(
            walls, spot, source == 0, random_bits(random_bits(keys[WHERE], now), k),
            x, y, triangle, heading, half_angle, near, far,
        )  # fmt: skip
        if not found:
            continue
        row = append(memory.backlog, memory.waiting, camera)
        like = random_share(random_bits(keys[LOOKS_LIKE], now), k)
        who = pick(errors.looks_like[camera], like)
        row[STEP], row[CAMERA] = now + lenses.latency[camera], camera
        row[USER] = NOBODY
        row[IDENTITY] = who if who < errors.whom.shape[2] else NOBODY
        row[X], row[Y], row[TRUE_X], row[TRUE_Y] = px, py, px, py
        row[HEADING] = random_below(random_bits(keys[FACES], now), k, TURN)
        row[TRUE_HEADING], row[POSTURE], row[TRUE_POSTURE] = row[HEADING], 0, 0


@kernel
def append(backlog: I64, waiting: I64, camera: int) -> I64:
    """Return a new row at the end of a camera's backlog."""
    end = waiting[camera, 0] + waiting[camera, 1]
    waiting[camera, 1] += 1
    row: I64 = backlog[camera, end % backlog.shape[1]]
    return row


@kernel
def deliver(memory: Memory, camera: int, now: int, sightings: I64, found: int) -> int:
    """Move what is known by now from the backlog to the sightings; return their new number."""
    waiting, rows = memory.waiting, memory.backlog.shape[1]
    while waiting[camera, 1] > 0:
        row = memory.backlog[camera, waiting[camera, 0]]
        if row[STEP] > now:
            break
        sightings[found] = row
        identity = row[IDENTITY] if row[IDENTITY] >= 0 else memory.noticed.shape[0] - 1
        memory.noticed[identity] = now
        found += 1
        waiting[camera, 0] = (waiting[camera, 0] + 1) % rows
        waiting[camera, 1] -= 1
    return found


@kernel
def look(
    walls: Mesh,
    lenses: Lenses,
    errors: ErrorTables,
    rule: Rule,
    robot: Poses,
    crowd: Crowd,
    first: int,
    memory: Memory,
    sightings: I64,
    events: SightEvents,
) -> tuple[int, int, int]:
    """Look at all users in each step of a span, up to the first step with an event that stops it.

    It also stops when another step's sightings might not fit. Returns the steps done (the stopping
    one included) and the numbers of sightings and events written.
    """
    # Taking an array out of a tuple costs a counted reference, so it is done once, not per step.
    robot_x, robot_y, robot_heading, robot_away = robot.x, robot.y, robot.heading, robot.away
    user_x, user_y, user_away = crowd.x, crowd.y, crowd.away
    near, far, half_angle = lenses.near_squared, lenses.widest, lenses.half_angle
    period, points, reach, moves = lenses.period, lenses.points, lenses.reach, lenses.moves
    haunted, ghosts, ghost_keys = errors.haunted, errors.ghosts, errors.ghost_keys
    chance, latency, errs = lenses.chance, lenses.latency, lenses.errs
    user_heading, posture, about = crowd.heading, crowd.posture, memory.about
    table, whom, keys = errors.table, errors.whom, errors.keys
    last, seen, waiting, backlog = memory.noticed, memory.seen, memory.waiting, memory.backlog
    vertices, triangles, neighbors = walls.vertices, walls.triangles, walls.neighbors
    cameras, users = far.shape
    # Most looks are from where the last one was at somebody who is still there.
    glances = np.full((cameras, users, GLANCE), -1, np.int64)
    given, is_given = crowd.shown, crowd.shown.shape[0] > 0
    found = happened = 0
    awake = int(seen.sum())
    # What is known at once needs no backlog, whose rows would come in the same order.
    prompt = int(latency.sum()) + int(errs.sum()) + int(waiting[:, 1].sum()) == 0
    for j in range(robot_x.shape[0]):
        now, before = first + j, found
        for c in range(cameras):
            if robot_away[j] or (period[c] > 1 and now % period[c] != 0):
                continue
            x, y, heading = robot_x[j], robot_y[j], robot_heading[j]
            if moves[c] != 0:
                x, y, heading = camera_pose(lenses, c, x, y, heading, now * rule.step_us)
            triangle = -1
            for u in range(users):
                dx, dy = user_x[u, j] - x, user_y[u, j] - y
                squared = dx * dx + dy * dy
                if user_away[u, j] or (squared > far[c, u] and not is_given):
                    continue
                same = (
                    glances[c, u, AT_X] == x and glances[c, u, AT_Y] == y
                    and glances[c, u, AT_HEADING] == heading
                    and glances[c, u, TO_X] == dx and glances[c, u, TO_Y] == dy
                )  # fmt: skip
                if is_given:
                    shown = int(given[c, u, j])
                elif same:
                    shown = glances[c, u, SHOWN]
                elif near_wedge(heading, half_angle[c], dx, dy, reach[c, u]):
                    if triangle < 0:
                        triangle = locate(walls, x, y)
                    if points[c] > 0:
                        shown = points_in_view(walls, lenses, c, u, x, y, heading, triangle, dx, dy)
                    elif squared >= near[c]:
                        shown = int(
                            walk_line_of_sight(
                                vertices, triangles, neighbors, x, y, triangle, x + dx, y + dy
                            )
                        )
                    else:
                        shown = 0
                else:
                    shown = 0
                if not same or shown != glances[c, u, SHOWN]:
                    glances[c, u, AT_X], glances[c, u, AT_Y] = x, y
                    glances[c, u, AT_HEADING], glances[c, u, SHOWN] = heading, shown
                    glances[c, u, TO_X], glances[c, u, TO_Y] = dx, dy
                    glances[c, u, STEADY] = -1
                if shown == 0:
                    continue
                about[c, u, IN_VIEW] += 1
                faces, poses = user_heading[u, j], int(posture[u, j])
                if errs[c] == 0:
                    bits = random_bits(keys[c, u, DETECT], now) >> np.uint64(11)
                    noticed = np.int64(bits) < chance[c]
                else:
                    if (
                        glances[c, u, STEADY] < 0
                        or glances[c, u, FACED] != faces or glances[c, u, POSED] != poses
                    ):  # fmt: skip
                        glances[c, u, FACED], glances[c, u, POSED] = faces, poses
                        glances[c, u, STEADY] = steady_chance(
                            table, c, heading, dx, dy, faces, poses, shown
                        )
                    minute = (rule.start_us + now * rule.step_us) // MINUTE_US % MINUTES
                    likely = notice_chance(
                        glances[c, u, STEADY], table[c, AT_LIGHT + minute], chance[c]
                    )
                    noticed = attention(table, keys, about, c, u, now) < likely
                if not noticed:
                    continue
                about[c, u, NOTICED] += 1
                if prompt:
                    sightings[found, STEP], sightings[found, CAMERA] = now, c
                    sightings[found, USER], sightings[found, IDENTITY] = u, u
                    for shift in (X, TRUE_X):
                        sightings[found, shift], sightings[found, shift + 1] = x + dx, y + dy
                        sightings[found, shift + 2], sightings[found, shift + 3] = faces, poses
                    last[u] = now
                    found += 1
                    continue
                row = append(backlog, waiting, c)
                row[STEP], row[CAMERA], row[USER] = now + latency[c], c, u
                row[TRUE_X], row[TRUE_Y] = x + dx, y + dy
                row[TRUE_HEADING], row[TRUE_POSTURE] = faces, poses
                if errs[c] == 0:
                    row[IDENTITY] = u
                    row[X:TRUE_X] = row[TRUE_X:]
                else:
                    perceive(table, whom, keys, about, c, u, now, dx, dy, rule.patience, row)
            if haunted[c] != 0:
                ghost = random_share(ghost_keys[c, HOW_MANY], now)
                if ghost >= ghosts[c, 0]:  # seldom: there are any
                    count = pick(ghosts[c], ghost)
                    imagine(walls, lenses, errors, memory, c, count, now, x, y, heading)
        for c in range(cameras):
            if waiting[c, 1] > 0:
                found = deliver(memory, c, now, sightings, found)
        stop = found + rule.burst > sightings.shape[0]
        if found > before or awake > 0:
            for i in range(last.shape[0]):
                is_seen = last[i] == now or (seen[i] == 1 and now - last[i] < rule.patience)
                if is_seen != (seen[i] == 1):
                    seen[i] = is_seen
                    awake += 1 if is_seen else -1
                    kind = USER_SEEN if is_seen else USER_LOST
                    events.step[happened], events.user[happened] = now, i
                    events.kind[happened] = kind
                    happened += 1
                    stop = stop or (rule.stop_seen if is_seen else rule.stop_lost)
        if stop:
            return j + 1, found, happened
    return robot_x.shape[0], found, happened
