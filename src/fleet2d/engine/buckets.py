"""The bodies of a run over one span: traced together, and looked at by every camera."""

from collections.abc import Sequence, Set

import numpy as np
from numpy.typing import NDArray

from fleet2d.algorithms.activities import ActivitySense
from fleet2d.algorithms.log import Sights
from fleet2d.blame import blame
from fleet2d.engine.verdicts import points_seen
from fleet2d.entities.actor import Actor
from fleet2d.entities.plan import Plan, State
from fleet2d.errors import ScenarioError
from fleet2d.kernels.look import (
    IDENTITY,
    SIGHTING,
    USER_LOST,
    USER_SEEN,
    Crowd,
    Memory,
    Rule,
    SightEvents,
    X,
    Y,
    look,
)
from fleet2d.kernels.motion import Poses
from fleet2d.kernels.perception import ABOUT, DRAWN_AT, IN_VIEW, MOST_GHOSTS, NOTICED, TRACKED
from fleet2d.sight.fov import FieldOfView
from fleet2d.sight.line_of_sight import LineOfSight
from fleet2d.sight.perception import Perception
from fleet2d.sight.tables import Scene, error_tables, is_perfect, stack_lenses
from fleet2d.streams import stream_key

# Poses of one block of steps: small enough to stay in a processor's cache.
BLOCK_VALUES = 1 << 17
# With many actors the work of a span outweighs the cache.
LEAST_STEPS = 4096
DAY_US = 86_400_000_000
# What draws are for, in the order of fleet2d.kernels.perception.
ABOUT_USERS = ("detect", "attend", "identify", "whom", "range", "bearing", "heading", "posture")
ABOUT_GHOSTS = ("how many", "which", "where", "looks like", "faces")

I64 = NDArray[np.int64]


class PoseBlock:
    """The poses of all actors for the steps of a span, and for the step after it."""

    def __init__(self, actors: Sequence[Actor]) -> None:
        self.capacity = max(LEAST_STEPS, BLOCK_VALUES // max(1, len(actors)))
        shape = (len(actors), self.capacity + 1)
        self.x, self.y, self.heading = (np.zeros(shape, np.int64) for _ in range(3))
        self.away = np.zeros(shape, np.uint8)
        self.posture = np.zeros(shape, np.int8)
        self._postured = [False] * len(actors)

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

    def take_postures(self, index: int, first: int, count: int, plan: Plan, step_us: int) -> None:
        """Write the postures of an actor for `count` steps from `first` on."""
        if plan.postures or plan.posture != "stand":
            steps = np.arange(first, first + count, dtype=np.int64)
            self.posture[index, :count] = plan.posture_at(steps * step_us)
            self._postured[index] = True
        elif self._postured[index]:
            self.posture[index] = 0
            self._postured[index] = False

    def crowd(self, rows: slice, count: int) -> Crowd:
        """Return the first `count` poses of some actors."""
        return Crowd(
            self.x[rows, :count],
            self.y[rows, :count],
            self.heading[rows, :count],
            self.away[rows, :count],
            self.posture[rows, :count],
        )


class Eye:
    """The cameras of a body in a run: what they carry from span to span, and their latest findings.

    Robots look at users. A user who has a camera looks at robots.

    Attributes:
        owner: Whose cameras.
        row: Its row in a PoseBlock.
        index: Its index among the robots, or among the users.
        others: Who can be seen.
        cameras: Names of the cameras.
        errs: Whether what is perceived can differ from the truth.
        activity_senses: How each camera tells activities.
        memory: All that is carried along.
        perceived: Where each identity was perceived last, somebody unknown last: (identities, 2).
        awaited: Events that somebody else waits for: they end the span, too.
    """

    def __init__(
        self,
        row: int,
        actors: Sequence[Actor],
        users: int,
        capacity: int,
        method: FieldOfView | None = None,
    ) -> None:
        """Open the cameras of one body.

        Args:
            row: Its row in a PoseBlock.
            actors: Everybody, users first.
            users: How many of them are users.
            capacity: Steps in a PoseBlock.
            method: What tells who is in view; None: lines of sight.

        Raises:
            ScenarioError: A period is no multiple of the step, or somebody unknown is named.
        """
        self.owner, self.row = actors[row], row
        # Lines of sight are compiled into the look.
        self._method = None if isinstance(method, LineOfSight) else method
        is_robot = row >= users
        self.index = row - users if is_robot else row
        self._rows = slice(0, users) if is_robot else slice(users, len(actors))
        self.others = actors[self._rows]
        self._set_up()
        count = len(self.others)
        self.perceived = np.zeros((count + 1, 2), np.int64)
        rows = capacity * len(self.cameras) * max(1, count) + self.rule.burst
        self.sightings = np.empty((rows, SIGHTING), np.int64)
        rows = capacity * (count + 1)
        self.events = SightEvents(
            np.empty(rows, np.int64), np.empty(rows, np.int32), np.empty(rows, np.int32)
        )
        self.found = self.happened = 0
        self.awaited: Set[str] = frozenset()

    def _set_up(self) -> None:
        owner, lattice, clock = self.owner, self.owner.home.plan.lattice, self.owner.clock
        named = owner.entity.eyes
        self.cameras = tuple(named)
        try:
            lenses = [camera.lens(lattice.units_per_m, clock.step_us) for camera in named.values()]
        except ValueError as error:
            raise ScenarioError(f"{owner.path}: {error}") from None
        common = getattr(owner.entity, "perception", None)  # users see what is there
        perceptions = [camera.perception or common for camera in named.values()]
        wrong = [not is_perfect(perception) for perception in perceptions]
        self.errs = any(wrong)
        scene = Scene(
            [other.name for other in self.others],
            [other.entity.radius * lattice.units_per_m for other in self.others],
            lattice,
            clock.step_us,
            owner.path,
        )
        self.lenses = stack_lenses(lenses, wrong, scene)
        self.errors = error_tables(
            lenses, [p if w else None for p, w in zip(perceptions, wrong, strict=True)], scene
        )
        self._draw_streams()
        self._sense_activities(perceptions)
        count = len(self.others)
        bursts = count + MOST_GHOSTS * self.errors.haunted
        midnight = clock.start.replace(hour=0, minute=0, second=0, microsecond=0)
        since_midnight = clock.start - midnight
        self.rule = Rule(
            patience=max(lens.patience for lens in lenses),
            step_us=clock.step_us,
            start_us=since_midnight.seconds * 10**6 + since_midnight.microseconds,
            burst=int(bursts.sum()),
            stop_lost=False,
            stop_seen=False,
        )
        looks = self.lenses.latency // self.lenses.period + 2
        self.memory = new_memory(len(lenses), count, int((looks * bursts).max()))

    def _draw_streams(self) -> None:
        """Give every draw a stream of its own, by name: a user more leaves the others' alone."""
        owner, errors = self.owner, self.errors
        for c, camera in enumerate(self.cameras):
            of = "" if len(self.cameras) == 1 and camera == "camera" else f"{camera}: "
            for u, other in enumerate(self.others):
                for i, purpose in enumerate(ABOUT_USERS if self.errs else ABOUT_USERS[:1]):
                    key = stream_key(owner.seed, owner.path, f"{of}{purpose} {other.name}")
                    errors.keys[c, u, i] = key
            for i, purpose in enumerate(ABOUT_GHOSTS):
                name = f"{of}{purpose}, false positives"
                errors.ghost_keys[c, i] = stream_key(owner.seed, owner.path, name)

    def _sense_activities(self, perceptions: Sequence[Perception | None]) -> None:
        """Note which cameras tell activities, and for what they take them."""
        self.activity_senses: list[ActivitySense] = []
        for c, (name, perception) in enumerate(zip(self.cameras, perceptions, strict=True)):
            keys = [
                stream_key(self.owner.seed, self.owner.path, f"{name}: activity {other.name}")
                for other in self.others
            ]
            confusion = perception.attributes.activity if perception else None
            latency = int(self.lenses.latency[c])
            sense = ActivitySense(latency, np.array(keys, np.uint64), confusion)
            self.activity_senses.append(sense)

    @property
    def event_names(self) -> tuple[str, str]:
        """What is called when somebody is lost, and when somebody is seen."""
        return self.owner.entity.sight_events

    @property
    def stops(self) -> tuple[bool, bool]:
        """Whether it ends its plan when somebody is lost, and when somebody is seen."""
        wanted, names = self.owner.plan.interrupts, self.event_names
        return names[USER_LOST] in wanted, names[USER_SEEN] in wanted

    @property
    def ends(self) -> tuple[bool, bool]:
        """Whether it ends the span when somebody is lost, and when somebody is seen."""
        lost, seen = self.stops
        names = self.event_names
        return lost or names[USER_LOST] in self.awaited, seen or names[USER_SEEN] in self.awaited

    @property
    def counts(self) -> I64:
        """How often each camera had each user in view and noticed: (cameras, users, 2)."""
        counts: I64 = self.memory.about[..., [IN_VIEW, NOTICED]]
        return counts

    def name_of(self, identity: int) -> str:
        """Return the name of an identity; that of somebody unknown is empty."""
        return self.others[identity].name if identity < len(self.others) else ""

    def look(self, block: PoseBlock, first: int, count: int) -> int:
        """Look at all others for `count` steps; return the steps done."""
        lost, seen = self.ends
        home, poses = self.owner.home, block.row(self.row, count)
        crowd = block.crowd(self._rows, count)
        if self._method is not None:
            step_us = self.owner.clock.step_us
            with blame("sight.method", first):
                shown = points_seen(self._method, home, self.lenses, poses, crowd, first, step_us)
            crowd = crowd._replace(shown=shown)
        done, self.found, self.happened = look(
            home.walls,
            self.lenses,
            self.errors,
            self.rule._replace(stop_lost=lost, stop_seen=seen),
            poses,
            crowd,
            first,
            self.memory,
            self.sightings,
            self.events,
        )
        return int(done)

    def sights(self, end: int) -> Sights:
        """Return who came into view and who was lost in the span that ended before step `end`."""
        events, count = self.events, self.happened
        columns = events.step[:count], events.user[:count], events.kind[:count]
        step, user, kind = (column.astype(np.int64) for column in columns)
        others = [other.name for other in self.others]
        return Sights(self.owner.name, self.event_names, others, step, user, kind, end)

    def remember(self) -> None:
        """Keep where each identity was perceived last."""
        identity = self.sightings[: self.found, IDENTITY]  # -1, somebody unknown, is the last row
        self.perceived[identity, 0] = self.sightings[: self.found, X]
        self.perceived[identity, 1] = self.sightings[: self.found, Y]


def open_eyes(
    users: Sequence[Actor], robots: Sequence[Actor], block: PoseBlock, method: FieldOfView
) -> tuple[list[Eye], list[Eye]]:
    """Return the cameras of users and those of robots, if there is anybody to be seen."""
    if not users or not robots:
        return [], []
    with blame("sight.method", None):
        method.start(users[0].home)
    actors, count = [*users, *robots], len(users)
    eyes = [
        Eye(row, actors, count, block.capacity, method)
        for row, actor in enumerate(actors)
        if actor.entity.eyes
    ]
    return [eye for eye in eyes if eye.row < count], [eye for eye in eyes if eye.row >= count]


def new_memory(cameras: int, users: int, backlog: int) -> Memory:
    """Return the memory of a robot that has seen nobody."""
    never = -1
    about = np.zeros((cameras, users, ABOUT), np.int64)
    about[..., [DRAWN_AT, TRACKED]] = never
    return Memory(
        noticed=np.full(users + 1, never, np.int64),
        seen=np.zeros(users + 1, np.int64),
        about=about,
        backlog=np.zeros((cameras, backlog, SIGHTING), np.int64),
        waiting=np.zeros((cameras, 2), np.int64),
    )


def look_together(eyes: Sequence[Eye], block: PoseBlock, first: int, count: int) -> int:
    """Let every camera look; return the steps up to the first event that interrupts a robot.

    A camera that had looked further before another one stopped the span looks again at less of it.
    """
    if len(eyes) == 1:
        return eyes[0].look(block, first, count)
    before = [[array.copy() for array in eye.memory] for eye in eyes]
    done = [0] * len(eyes)
    limit = count
    pending = list(range(len(eyes)))
    while pending:
        i = pending.pop(0)
        for array, saved in zip(eyes[i].memory, before[i], strict=True):
            array[:] = saved
        done[i] = eyes[i].look(block, first, limit)
        if done[i] < limit:
            limit = done[i]
            pending += [j for j in range(i) if done[j] > limit and j not in pending]
    return limit
