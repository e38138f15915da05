"""The bodies of a run over one span: traced together, and looked at by every camera."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fleet2d.engine.streams import stream_key
from fleet2d.entities.actor import Actor
from fleet2d.entities.entity import Robot
from fleet2d.entities.plan import State
from fleet2d.kernels.look import USER_LOST, USER_SEEN, Crowd, Detections, Memory, SightEvents, look
from fleet2d.kernels.motion import Poses

# Poses of one block of steps: small enough to stay in a processor's cache.
BLOCK_VALUES = 1 << 17
# With many actors the work of a span outweighs the cache.
LEAST_STEPS = 4096
EVENT_NAMES = ("user_lost", "user_seen")

I64 = NDArray[np.int64]


class PoseBlock:
    """The poses of all actors for the steps of a span, and for the step after it."""

    def __init__(self, actors: Sequence[Actor]) -> None:
        self.capacity = max(LEAST_STEPS, BLOCK_VALUES // max(1, len(actors)))
        shape = (len(actors), self.capacity + 1)
        self.x, self.y, self.heading = (np.zeros(shape, np.int64) for _ in range(3))
        self.away = np.zeros(shape, np.uint8)

    def row(self, index: int, count: int) -> Poses:
        """Return the first `count` poses of an actor, as a view."""
        return Poses(
            self.x[index, :count],
            self.y[index, :count],
            self.heading[index, :count],
            self.away[index, :count],
        )

    def state(self, index: int, column: int) -> State:
        """Return an actor's state at a column."""
        return State(
            int(self.x[index, column]),
            int(self.y[index, column]),
            int(self.heading[index, column]),
            int(self.away[index, column]),
        )

    def crowd(self, users: int, count: int) -> Crowd:
        """Return the first `count` poses of the users, which stand first."""
        return Crowd(self.x[:users, :count], self.y[:users, :count], self.away[:users, :count])


class Eye:
    """A robot's camera in a run: what it carries from span to span, and its latest findings."""

    def __init__(self, robot: Actor, row: int, users: Sequence[Actor], capacity: int) -> None:
        assert isinstance(robot.entity, Robot)
        assert robot.entity.camera is not None
        self.robot = robot
        self.row = row
        self.users = users
        units_per_m = robot.home.plan.lattice.units_per_m
        self.lens = robot.entity.camera.lens(units_per_m, robot.clock.step_us)
        # A stream per user, named: a user more leaves the draws for the others as they were.
        keys = [stream_key(robot.seed, robot.path, f"detect {user.name}") for user in users]
        count = len(users)
        self.memory = Memory(
            np.array(keys, np.uint64), np.zeros(count, np.int64), np.zeros(count, np.uint8)
        )
        self.perceived = np.zeros((count, 2), np.int64)
        rows = capacity * max(1, count)
        self.sightings = Detections(
            np.empty(rows, np.int64),
            np.empty(rows, np.int32),
            np.empty(rows, np.int64),
            np.empty(rows, np.int64),
        )
        self.events = SightEvents(
            np.empty(rows, np.int64), np.empty(rows, np.int32), np.empty(rows, np.int32)
        )
        self.found = self.happened = 0

    @property
    def stops(self) -> tuple[bool, bool]:
        """Whether (user_lost, user_seen) end the span."""
        wanted = self.robot.plan.interrupts
        return EVENT_NAMES[USER_LOST] in wanted, EVENT_NAMES[USER_SEEN] in wanted

    def look(self, block: PoseBlock, first: int, count: int) -> int:
        """Look at all users for `count` steps; return the steps done."""
        done, self.found, self.happened = look(
            self.robot.home.plan.mesh,
            self.lens,
            block.row(self.row, count),
            block.crowd(len(self.users), count),
            first,
            self.memory,
            self.stops,
            self.sightings,
            self.events,
        )
        return int(done)

    def remember(self) -> None:
        """Keep where each user was perceived last."""
        users = self.sightings.user[: self.found]
        self.perceived[users, 0] = self.sightings.x[: self.found]
        self.perceived[users, 1] = self.sightings.y[: self.found]


def look_together(eyes: Sequence[Eye], block: PoseBlock, first: int, count: int) -> int:
    """Let every camera look; return the steps up to the first event that interrupts a robot.

    A camera that had looked further before another one stopped the span looks again at less of it.
    """
    before = [(eye.memory.noticed.copy(), eye.memory.seen.copy()) for eye in eyes]
    done = [0] * len(eyes)
    limit = count
    pending = list(range(len(eyes)))
    while pending:
        i = pending.pop(0)
        eyes[i].memory.noticed[:], eyes[i].memory.seen[:] = before[i]
        done[i] = eyes[i].look(block, first, limit)
        if done[i] < limit:
            limit = done[i]
            pending += [j for j in range(i) if done[j] > limit and j not in pending]
    return limit
