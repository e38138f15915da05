"""Policy: a robot whose next room is chosen by a learned policy, from the robot's knowledge.

An observation is a table with a row for each room, padded to a fixed number of rooms; the last
columns are the same in all rows. So a policy that scores rows applies to any home, and one network
serves homes with different numbers of rooms. Nothing in it is the truth: it is computed from the
robot's own pose, clock and battery, the plan of the home, the beliefs of an algorithm, and the
robot's sightings (`SightingMemory`).
"""

from collections.abc import Sequence
from copy import copy
from datetime import datetime, timedelta
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np
from pydantic import Field

from fleet2d import kernels
from fleet2d.configuration.networks import compute, open_network
from fleet2d.configuration.problems import problem
from fleet2d.configuration.units import InputPath, PositiveDuration
from fleet2d.entities.behavior import Actor, Situation
from fleet2d.entities.plan import Plan
from fleet2d.entities.robots import approach
from fleet2d.entities.robots.approach import ANYONE, BeliefBehavior
from fleet2d.entities.robots.find import Sites
from fleet2d.errors import ComponentError, InputError, PlacementError
from fleet2d.floorplan.plan import FloorPlan, Room, read_only
from fleet2d.floorplan.space import PointDistances
from fleet2d.kernels import F32, F64, I32, I64, TURN, UNIT, Bool, RoomMemory, ShownMemory
from fleet2d.kernels import SightingColumn as Column
from fleet2d.runtime.clock import DAY_MINUTES, DAY_US, HOUR_S, Clock
from fleet2d.runtime.events import EventKind
from fleet2d.runtime.local_time import even_parts

# This many people have columns of their own, in the order of the scenario.
PEOPLE = 4
HOURS = 24
NEVER = -1

KINDS: dict[str, tuple[str, ...]] = {
    "living": ("living_room",),
    "dining": ("dining_room",),
    "kitchen": ("kitchen",),
    "bedroom": ("bedroom", "child_room", "guest_room"),
    "bathroom": ("bathroom", "toilet"),
    "office": ("office",),
    "hallway": ("hallway", "hall", "lobby", "entryway"),
    "other": (),
}
"""Kinds of rooms in observations, and the types of rooms of each."""
KIND_OF_TYPE = {room_type: kind for kind, types in KINDS.items() for room_type in types}

COLUMNS = (
    # These describe the home.
    *("room", "reachable", "area"),
    *(f"is_{kind}" for kind in KINDS),
    # These describe the robot.
    *("here", "way", "visited_20min", "visited_6h"),
    # These are about the person, or anyone.
    *("belief", "in_view", "seen_30min", "seen_6h", "habit", "habit_now"),
    # These are about each of the first people.
    *(f"{name}_{n}" for n in range(PEOPLE) for name in ("belief", "seen_30min", "habit_now")),
    # These are the same in all rooms.
    *("hour_sin", "hour_cos", "weekend", "away", "charge", "last_seen", "elapsed"),
)
"""The columns of an observation, in their order: see docs/how-to/gym.md."""
_AT = {name: number for number, name in enumerate(COLUMNS)}
HERE = _AT["here"]
WAY = _AT["way"]

INPUTS = ("observation", "action_mask")
"""The names of the inputs of a policy in a file."""

# The rows of `ShownMemory.fresh_rows` and its like: first the visits, then the person.
PERSON = 2

MINUTE = timedelta(minutes=1)
SATURDAY = 5

# Number of headings in which a robot may wait, and unit vectors of the first half of them, (n, 2).
DIRECTIONS = 16
_HALF_TURN = range(0, TURN // 2, TURN // DIRECTIONS)
HALF_DIRECTIONS = np.array([(kernels.cosine(h), kernels.sine(h)) for h in _HALF_TURN]) / UNIT

# A time t ago counts 1 / (1 + t / scale) [s].
SHORT_S = 20 * 60
SEEN_S = 30 * 60
LONG_S = 6 * HOUR_S
# A way that takes this long, or longer, counts 1 [s].
LONGEST_WAY_S = 60.0
# The ways from at most this many places are cached.
KEPT_WAYS = 256


class SightingMemory:
    """The memory of a robot's sightings: times and rooms, by person.

    Attributes:
        rooms: The sightings by person and room.
    """

    def __init__(self, plan: FloorPlan, people: int, clock: Clock) -> None:
        shape = people + 2, len(plan.rooms)
        self.rooms = _no_sightings(shape)
        self._room_of_place = plan.room_of_place
        self._step_us = clock.step_us
        self._start = clock.start

    def emptied(self) -> "SightingMemory":
        """Return the same memory without sightings."""
        empty = copy(self)
        shape = self.rooms[0].shape
        empty.rooms = _no_sightings(shape)
        return empty

    def take(self, step: I64, index: I32, distinct: I64) -> None:
        """Add sightings; see `fleet2d.algorithms.observations.SightingTable`."""
        x = distinct[:, Column.X]
        y = distinct[:, Column.Y]
        room = kernels.rooms_at(self._room_of_place, x, y)
        identity = distinct[:, Column.IDENTITY]
        if not len(step):
            return
        at_us = step * self._step_us
        end_us = int(at_us.max()) + 1
        for begin, end, start_us in even_parts(self._start, int(at_us.min()), end_us):
            part = (begin <= at_us) & (at_us < end)
            of_day_us = start_us % DAY_US
            kernels.remember(
                step[part], index[part], identity, room, of_day_us, self._step_us, self.rooms
            )


def _no_sightings(shape: tuple[int, int]) -> RoomMemory:
    """Return the memory of a number of people and rooms before any sighting."""
    return RoomMemory(
        np.full(shape, NEVER, np.int64),
        np.zeros((*shape, HOURS), np.int64),
        np.zeros(shape, np.int64),
    )


class WaitingPoses:
    """The poses with the largest view of each room, and the ways between them.

    Attributes:
        points: Lattice points (rooms, 2) in the rooms that the robot can enter.
        headings: The headings at these points, int64 (rooms,) [1/4096 turn].
        index: The index of each of these rooms, int64 (rooms,).
        number: Their numbers, by index.
    """

    def __init__(self, actor: Actor) -> None:
        home = actor.home
        self._actor = actor
        angles = [camera.angle_deg for camera in actor.entity.eyes.values()]
        self._half_angle = round(max(angles) / 720 * TURN)
        key = (home.walls, actor.space, actor.part, actor.entity.radius, repr(actor.entity.eyes))
        self.index, self.points, self.headings = home.cached(("standing", *key), self._choose)
        self._key = key
        self.number = {room: number for number, room in enumerate(self.index.tolist())}
        self._distances: PointDistances | None = None  # for the present space
        self._ways: dict[tuple[int, int, int], RoomWays] = {}  # by starting point

    def _choose(self) -> tuple[I64, I64, I64]:
        rooms = self._actor.reachable_rooms()
        poses = np.array([self._best(room) for room in rooms], np.int64).reshape(-1, 3)
        index = np.array([room.index for room in rooms], np.int64)
        points = np.ascontiguousarray(poses[:, :2])
        headings = poses[:, 2].copy()
        return read_only(index), read_only(points), read_only(headings)

    def _best(self, room: Room) -> tuple[int, int, int]:
        """Return the place (x, y) and the heading at which most of a room is in view."""
        actor = self._actor
        walls = actor.home.walls
        stands = approach.stands_in(actor, room)
        goals = approach.floor_of(actor, room)
        limit = kernels.cosine(self._half_angle) / UNIT
        reach = approach.sight_range(actor)
        best = kernels.best_view(walls, stands, goals, reach * reach, HALF_DIRECTIONS, limit)
        if best is None:
            return *actor.middle(room), 0
        place, facing = best
        at_x, at_y = stands[place].tolist()
        return at_x, at_y, facing * TURN // DIRECTIONS

    def ways(self, actions: int) -> "RoomWays":
        """Return the ways from the robot to each room, for a number of actions."""
        actor = self._actor
        space = actor.space
        if self._distances is None or self._distances.space is not space:
            key = ("distances of rooms", *self._key, space)
            distances = actor.home.cached(key, lambda: PointDistances(space, self.points))
            self._distances = distances
            self._ways = {}
        x, y, _, _ = actor.state
        ways = self._ways.get((x, y, actions))
        if ways is None:
            if len(self._ways) >= KEPT_WAYS:
                self._ways.clear()
            metres = self._distances.of((x, y))
            if not np.isfinite(metres).any():
                # Near a corner, the middle of the robot's cell may not be free.
                metres = self._distances.of(space.nearest(x, y, actor.part) or (x, y))
            ways = self._ways[x, y, actions] = self._measure(metres, actions)
        return ways

    def __getstate__(self) -> dict[str, Any]:
        """Leave out distances and ways, which follow from the home."""
        return {**self.__dict__, "_distances": None, "_ways": {}}

    def _measure(self, metres: F64, actions: int) -> "RoomWays":
        actor = self._actor
        seconds = actor.seconds(metres)
        mask = np.zeros(actions, np.bool_)
        mask[self.index] = np.isfinite(seconds)
        mask[-1] = True
        share = np.zeros(len(actor.home.rooms), np.float32)
        share[self.index] = np.minimum(seconds, LONGEST_WAY_S) / LONGEST_WAY_S
        return RoomWays(read_only(share), read_only(mask))


class RoomWays(NamedTuple):
    """The ways from a robot's position to the rooms.

    Attributes:
        share: The time of each way as a share of LONGEST_WAY_S, 1 at most, 0 for rooms in which the
            robot can't stand, float32 (rooms,).
        mask: Which actions are possible, bool (actions,): rooms with a way, and last to rest.
    """

    share: F32
    mask: Bool


def shown_memory(names: Sequence[str], user: str) -> ShownMemory:
    """Return the part of the memory that observations show, about a person, or ANYONE."""
    person = len(names) + 1 if user == ANYONE else names.index(user)
    people = range(min(len(names), PEOPLE))
    fresh = ["visited_20min", "visited_6h", "seen_30min", "seen_6h"]
    fresh += [f"seen_30min_{n}" for n in people]
    habits = ["habit", "habit_now", *(f"habit_now_{n}" for n in people)]
    return ShownMemory(
        np.array([-1, -1, person, person, *people]),
        np.array([_AT[name] for name in fresh]),
        np.array([SHORT_S, LONG_S, SEEN_S, LONG_S, *(SEEN_S for _ in people)], np.float64),
        np.array([person, person, *people]),
        np.array([_AT[name] for name in habits]),
    )


class LearnedBehavior(BeliefBehavior):
    """Base of behaviors whose decisions come from a file, a class, or an environment.

    An observation has a row for each option, padded to a fixed number of rows. Action r is to take
    row r; the last one is to take none.

    Attributes:
        file: The policy, an ONNX file; left out: a class of yours, or an environment, decides.
    """

    remembers = True
    # The names of the columns of an observation.
    columns: ClassVar[tuple[str, ...]]

    file: InputPath | None = None

    def model_post_init(self, _: object, /) -> None:
        """Require the format ONNX."""
        if self.file is not None and self.file.suffix != ".onnx":
            raise problem(f"expected a file with the suffix .onnx, got {self.file.name}")

    @property
    def rows(self) -> int:
        """Number of rows of an observation."""
        raise NotImplementedError

    def open_policy(self) -> None:
        """Begin without an action, and check the policy in a file.

        Raises:
            InputError: The file is no policy.
        """
        self.given: int | None = None  # next action from an environment
        if self.file is not None:
            open_network(self.file, INPUTS)

    def observe(self, now: Situation) -> F32:
        """Return the observation, float32 (rows, columns): see docs/how-to/gym.md."""
        raise NotImplementedError

    def mask(self, now: Situation) -> Bool:
        """Return which actions are possible, bool (rows + 1,); the last one always is."""
        raise NotImplementedError

    def asks(self, now: Situation) -> bool:
        """Return whether the decision at a step depends on the policy; nothing changes."""
        raise NotImplementedError

    def why_not(self, now: Situation, row: int) -> str:
        """Return why a masked action is impossible, as the end of a sentence."""
        raise NotImplementedError

    def act(self, observation: F32, mask: Bool) -> int:
        """Return the action for an observation; override it for a policy of your own.

        Args:
            observation: float32 (rows, columns), see docs/how-to/gym.md.
            mask: bool (rows + 1,), the possible actions.

        Raises:
            ComponentError: There is no policy; or it fails, or returns NaN.
        """
        if self.file is None:
            raise ComponentError(
                "the policy has no file: give one, as file: hangout.onnx, derive a class from"
                f" {type(self).__name__} that overrides act, or use fleet2d.learning.gym"
            )
        inputs = zip(INPUTS, (observation[None], mask[None]), strict=True)
        output = compute(self.file, dict(inputs))
        scores = output[0] if output.ndim else output
        if scores.shape != mask.shape:
            raise ComponentError(
                f"{self.file.name} returned scores of the shape {scores.shape}, expected"
                f" {mask.shape}: train it with as many rows, {self.rows}"
            )
        return int(np.argmax(np.where(mask, scores, -np.inf)))

    def choose(self, now: Situation) -> int:
        """Return the action at a step, from the environment or of the policy."""
        mask = self.mask(now)
        action = self.given
        self.given = None
        if action is None:
            action = self.act(self.observe(now), mask)
        self.check(now, action, mask)
        return int(action)

    def check(self, now: Situation, action: object, mask: Bool) -> None:
        """Refuse an impossible action.

        Raises:
            InputError: The action is out of range, or masked; the message says why.
        """
        if not (isinstance(action, int | np.integer) and 0 <= action <= self.rows):
            raise InputError(
                f"the policy chose {action!r}: actions are whole numbers from 0 to {self.rows}"
            )
        if not mask[action]:
            raise InputError(f"the policy chose {self.why_not(now, int(action))}")


class Policy(LearnedBehavior):
    """Let a learned policy choose the next room: to wait in, to search, or to visit.

    The policy is a file of ONNX with the inputs `observation`, float32 (1, rooms, columns), and
    optionally `action_mask`, bool (1, rooms + 1), whose first output has a score for each of the
    rooms + 1 actions; or a class of yours, derived from this one, that overrides `act`. Action r is
    to go to room r; the last action is to rest: at the charger, if the robot has one, until it is
    charged, else where it is; of a search (find) it is to give up. The columns are those of
    `COLUMNS`.

    Events: `relocates` (hangout) and `visits` (patrol) with the room, and those of the behavior
    `find`.

    Attributes:
        task: To wait where people are in view (hangout); to look for a person (find); or to visit
            rooms (patrol).
        rooms: Number of rooms in an observation; a home may have fewer.
        period: Time of waiting in a room (hangout), or of rest.
        dwell: Time in a visited room (patrol).
        every: Interval between the beginnings of two searches (find), from the start on.
        deadline: Duration of a search after which it gives up (find).
    """

    always_decides = True
    records = frozenset(
        {
            EventKind.DOCKS, EventKind.FIND_BEGINS, EventKind.FOUND, EventKind.GAVE_UP,
            EventKind.RELOCATES, EventKind.VISITS,
        }
    )  # fmt: skip

    columns = COLUMNS

    task: Literal["hangout", "find", "patrol"] = "hangout"
    rooms: int = Field(default=16, ge=1, le=256)
    period: PositiveDuration = timedelta(minutes=30)
    dwell: PositiveDuration = timedelta(minutes=5)
    every: PositiveDuration = timedelta(hours=2)
    deadline: PositiveDuration = timedelta(minutes=10)

    @property
    def rows(self) -> int:
        """Number of rooms in an observation."""
        return self.rooms

    def start(self, actor: Actor) -> None:
        """Choose the pose in each room.

        Raises:
            ScenarioError: The robot has no camera.
            PlacementError: The home has more rooms than an observation.
            InputError: The file is no policy.
        """
        self.open_policy()
        approach.check_has_camera(actor, "policy")
        count = len(actor.home.rooms)
        if count > self.rooms:
            raise PlacementError(
                f"{actor.path}: the home has {count} rooms, and observations have {self.rooms}:"
                f" set rooms: {count}, or more, here and when you train the policy"
            )
        self.poses = WaitingPoses(actor)
        self.sites = Sites(actor, 2) if self.task != "hangout" else None
        self.names = list(actor.people)
        self.visited = np.full(count, NEVER, np.int64)
        self.since: datetime | None = None  # beginning of the present search
        self.due = actor.clock.start
        self._fixed = self._describe_home(actor)
        self._shown = shown_memory(self.names, self.user)
        self._person = int(self._shown.fresh_rows[PERSON])

    def observe(self, now: Situation) -> F32:
        """Return the observation, float32 (rooms, columns): see docs/how-to/gym.md."""
        actor = now.actor
        room = now.room
        time = now.time
        memory = actor.recall().rooms
        table: F32 = self._fixed.copy()
        part = table[: len(self.visited)]
        if room is not None:
            part[room.index, HERE] = 1
        part[:, WAY] = self.poses.ways(self.rooms + 1).share
        for name, xy in now.in_view.items():
            seen = now.home.plan.room_at(*xy) if self.user in (ANYONE, name) else None
            if seen is not None:
                part[seen.index, _AT["in_view"]] = 1
        away = 0.0
        if self.source is not None:
            belief = self.belief(now, self.user)
            part[:, _AT["belief"]] = belief.joint
            away = belief.away
            for number, name in enumerate(self.names[:PEOPLE]):
                part[:, _AT[f"belief_{number}"]] = self.belief(now, name).joint
        step_s = actor.clock.step_us / 1e6
        newest = max(memory.last[self._person].tolist())
        age_s = (now.step - newest) * step_s
        minute = (time.hour * 60 + time.minute) * TURN // DAY_MINUTES
        charge = actor.charge
        since = self.since
        common = [
            kernels.sine(minute) / UNIT,
            kernels.cosine(minute) / UNIT,
            float(time.weekday() >= SATURDAY),
            away,
            1.0 if charge is None else charge.level,
            0.0 if newest < 0 else SEEN_S / (SEEN_S + age_s),
            0.0 if since is None else min((time - since) / self.deadline, 1.0),
        ]
        visits = self.visited
        shown = self._shown
        kernels.show_memory(memory, shown, visits, now.step, time.hour, step_s, common, table)
        return table

    def mask(self, now: Situation) -> Bool:
        """Return which actions are possible, bool (rooms + 1,): rooms with a way, and to rest."""
        return self.poses.ways(self.rooms + 1).mask

    def _describe_home(self, actor: Actor) -> F32:
        """Return the constant part of observations, float32 (rooms, columns)."""
        table = np.zeros((self.rooms, len(COLUMNS)), np.float32)
        cells = sum(room.cells for room in actor.home.rooms)
        for room in actor.home.rooms:
            row = table[room.index]
            row[_AT["room"]] = 1
            row[_AT["area"]] = room.cells / cells
            if self.source is None:
                row[_AT["belief"]] = row[_AT["area"]]
            row[_AT[f"is_{KIND_OF_TYPE.get(room.type, 'other')}"]] = 1
        table[self.poses.index, _AT["reachable"]] = 1
        return table

    def asks(self, now: Situation) -> bool:
        """Return whether the decision at a step depends on the policy."""
        if self.task != "find":
            return True
        return not self._is_idle(now) and self._search_end(now) is None

    def _is_idle(self, now: Situation) -> bool:
        """Return whether there is no search to do at a step."""
        return self.since is None and now.time < self.due

    def _search_end(self, now: Situation) -> EventKind | None:
        """Return the event that ends the search at a step; None: it goes on."""
        in_view = now.in_view
        if self.user in in_view or (self.user == ANYONE and in_view):
            return EventKind.FOUND
        if self.since is not None and now.time >= self.since + self.deadline:
            return EventKind.GAVE_UP
        return None

    def decide(self, now: Situation) -> Plan | None:
        """Carry out the action that the policy chooses."""
        plan = now.plan()
        if self.task == "find":
            if self._is_idle(now):
                return plan.stay(until=self.due)
            end = self._search_end(now)
            if self.since is None:
                self.since = now.time
                plan.note(EventKind.FIND_BEGINS, self.user)
            if end is not None:
                return self._end_search(now, plan, end)
        action = self.choose(now)
        if action < self.rooms:
            return self._go(now, plan, action)
        if self.task == "find":
            return self._end_search(now, plan, EventKind.GAVE_UP)
        return self._rest(now, plan)

    def _end_search(self, now: Situation, plan: Plan, end: EventKind) -> Plan:
        """Note the end of a search, and wait for the next one."""
        self.since = None
        while self.due <= now.time:
            self.due += self.every
        return plan.note(end, self.user).stay(until=self.due)

    def why_not(self, now: Situation, row: int) -> str:
        """Return why a room can't be chosen."""
        reason = "can't be reached" if row < len(now.home.rooms) else "doesn't exist"
        return f"room {row}, which {reason}"

    def _rest(self, now: Situation, plan: Plan) -> Plan:
        """Charge, if there is a battery; else stay."""
        charge = now.actor.charge
        lasts = self.period
        if charge is not None and plan.reaches(*charge.charger):
            if plan.position != charge.charger:
                plan.go_to_point(*charge.charger).note(EventKind.DOCKS, charge.percent)
            lasts = max(timedelta(microseconds=charge.time_to_charge(1.0)), MINUTE)
        return plan.stay(lasts)

    def _go(self, now: Situation, plan: Plan, room: int) -> Plan:
        """Go to a room, and wait or look round there."""
        name = now.home.rooms[room].name
        number = self.poses.number[room]
        self.visited[room] = now.step
        if self.sites is not None and self.task == "find":
            self.sites.look_round(plan, number)
            return plan.interrupt_on(EventKind.USER_SEEN)
        x, y = self.poses.points[number].tolist()
        if plan.position != (x, y):
            kind = EventKind.RELOCATES if self.task == "hangout" else EventKind.VISITS
            plan.note(kind, name).go_to_point(x, y)
            plan.turn_to(int(self.poses.headings[number]))
        if self.task == "hangout":
            return plan.stay(self.period)
        return plan.turn_by(1.0).stay(self.dwell)
