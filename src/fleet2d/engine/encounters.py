"""Encounters of people with robots: robots that come near, drive up, stay too close, or call.

Encounters follow from the poses alone, step by step, so they don't depend on spans. A span ends
with the first one, and the person decides right afterwards.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fleet2d.engine.basis import PlannedNote, Watcher, notes_of
from fleet2d.entities.behavior import Attention, SightEvent
from fleet2d.entities.body import Bodies
from fleet2d.entities.decisions import DecidingActor
from fleet2d.floorplan.placed_objects import POSTURES
from fleet2d.kernels import I64, Bool, PoseBlock, line_of_sight
from fleet2d.runtime.events import Event, EventKind

# The squared distance of a person out of reach: larger than any home [lattice units²].
FAR = 1 << 50
LYING = POSTURES.index("lie")
STANDING = POSTURES.index("stand")
# A robot is noticed again once it was farther away than these multiples of the distance.
AGAIN_NEAR = (5, 4)
AGAIN_COMING = (3, 2)


class Encounter(NamedTuple):
    """An encounter of a person and a robot, in a column of a span."""

    column: int
    event: str
    robot: DecidingActor
    pair: "Pair"


@dataclass
class Pair:
    """A person and a robot, and their state from span to span.

    Attributes:
        user: The person.
        robot: The robot.
        attention: The distances at which the person notices robots.
        near: Whether the person would notice the robot nearby; not if it has stayed there.
        coming: Whether the person would notice the robot driving up; not if it has just done so.
        close_steps: Number of steps for which the robot has been too close.
        distance: Squared distance at the last step [lattice units²].
        at: Place of the robot at the last step [lattice units].
    """

    user: DecidingActor
    robot: DecidingActor
    attention: Attention
    near: bool = True
    coming: bool = True
    close_steps: int = 0
    distance: int = FAR
    at: tuple[int, int] = (-1, -1)

    def scan(self, block: PoseBlock, count: int) -> list[Encounter]:
        """Return the first encounter of each kind in `count` steps."""
        self.distances = self._measure(block, count)
        kinds = {
            "robot_near": self._first_near(block),
            "robot_coming": self._first_coming(block),
            "robot_close": _first(self._close_run() == self.attention.patience),
        }
        return [Encounter(c, kind, self.robot, self) for kind, c in kinds.items() if c is not None]

    def hears(self, call: PlannedNote, column: int) -> bool:
        """Return whether the person hears a call of the robot in a column of the scanned span."""
        limit = self.attention.hears
        if call.row != self.robot.row or call.text not in ("", self.user.name):
            return False
        return bool(self.distances[column] <= limit * limit)

    def advance(self, block: PoseBlock, count: int, events: Sequence[str]) -> None:
        """Update the state after `count` steps, with encounters in the last one."""
        distances = self.distances[:count]
        near = self._armed(self.attention.notices, AGAIN_NEAR, self.near)[count - 1]
        coming = self._armed(self.attention.in_way, AGAIN_COMING, self.coming)[count - 1]
        self.near = "robot_near" not in events and bool(near)
        self.coming = "robot_coming" not in events and bool(coming)
        self.close_steps = int(self._close_run()[count - 1])
        self.distance = int(distances[-1])
        row = self.robot.row
        self.at = int(block.x[row, count - 1]), int(block.y[row, count - 1])

    def _measure(self, block: PoseBlock, count: int) -> I64:
        """Return the squared distances; FAR if one is away or the person lies."""
        u = self.user.row
        r = self.robot.row
        dx = block.x[u, :count] - block.x[r, :count]
        dy = block.y[u, :count] - block.y[r, :count]
        away = block.away[u, :count] | block.away[r, :count]
        is_unreachable = (away != 0) | (block.posture[u, :count] == LYING)
        return np.where(is_unreachable, FAR, dx * dx + dy * dy)

    def _armed(self, limit: int, factor: tuple[int, int], before: bool) -> Bool:
        """Return the columns in which the person would notice the robot again."""
        far = limit * factor[0] // factor[1]
        return np.logical_or.accumulate(self.distances > far * far) | before

    def _close_run(self) -> I64:
        """Return the number of steps for which the robot has been too close, at each step."""
        limit = self.attention.too_close
        is_close = self.distances <= limit * limit
        index = np.arange(len(is_close))
        last = np.maximum.accumulate(np.where(is_close, -1, index))
        return index - last + np.where(last < 0, self.close_steps, 0)

    def _first_near(self, block: PoseBlock) -> int | None:
        """Return the first column in which the robot is noticed: near, and in line of sight."""
        limit = self.attention.notices
        is_armed = self._armed(limit, AGAIN_NEAR, self.near)
        candidates = np.flatnonzero((self.distances <= limit * limit) & is_armed)
        u = self.user.row
        r = self.robot.row
        walls = self.user.home.walls
        checked = None
        rows = (block.x[u], block.y[u], block.x[r], block.y[r])
        numbers = (row[candidates].tolist() for row in rows)
        for column, *places in zip(candidates.tolist(), *numbers, strict=True):
            if places == checked:
                continue
            checked = places
            x, y, robot_x, robot_y = places
            if line_of_sight(walls, x, y, robot_x, robot_y):
                return int(column)
        return None

    def _first_coming(self, block: PoseBlock) -> int | None:
        """Return the first column in which the robot drives up to the person, who stands."""
        limit = self.attention.in_way
        count = len(self.distances)
        row = self.robot.row
        is_armed = self._armed(limit, AGAIN_COMING, self.coming)
        is_inside = (self.distances <= limit * limit) & is_armed
        if not is_inside.any():
            return None
        x = block.x[row, :count]
        y = block.y[row, :count]
        last_x, last_y = self.at if self.at[0] >= 0 else (x[0], y[0])
        moves = (np.diff(x, prepend=last_x) != 0) | (np.diff(y, prepend=last_y) != 0)
        approaches = np.diff(self.distances, prepend=self.distance) < 0
        stands = block.posture[self.user.row, :count] == STANDING
        return _first(is_inside & moves & approaches & stands)


class Encounters(Watcher):
    """All pairs of a person who reacts to robots and a robot.

    Attributes:
        pairs: The pairs.
        next_step: The first step that is not processed.
    """

    def __init__(self, users: Sequence[DecidingActor], robots: Sequence[DecidingActor]) -> None:
        self._robots = robots
        pairs = ((user, robot) for user in users for robot in robots)
        self.pairs = [Pair(u, r, u.attention) for u, r in pairs if u.attention is not None]
        self._calls: list[PlannedNote] = []  # calls of users, at the ends of plans
        self._ahead: list[Encounter] = []
        self._last: list[tuple[int, DecidingActor, SightEvent]] = []

    @property
    def is_needed(self) -> bool:
        """Whether any person reacts to robots."""
        return bool(self.pairs)

    waits = is_needed

    def before_plan(self, row: int, actor: DecidingActor, step: int) -> None:
        """Record the calls at `step` of a robot's plan that is replaced."""
        self._calls += [call for call in notes_of(actor, EventKind.CALLS) if call.step == step]

    def limit(self, bodies: Bodies, end: int) -> int:
        """Return the step after the first encounter, or `end` if there is none."""
        first = self.next_step
        block = bodies.block(first, end)
        self._ahead = [event for pair in self.pairs for event in pair.scan(block, end - first)]
        for robot in self._robots:
            self._calls += notes_of(robot, EventKind.CALLS)
        for call in self._calls:
            column = call.step - first
            if first <= call.step < end:
                hearers = [pair for pair in self.pairs if pair.hears(call, column)]
                self._ahead += [Encounter(column, "robot_calls", p.robot, p) for p in hearers]
        self._calls = []
        return min((event.column + first + 1 for event in self._ahead), default=end)

    def take(self, bodies: Bodies, end: int) -> Sequence[Event]:
        """Process the steps up to `end` - 1."""
        first = self.next_step
        count = end - first
        self.next_step = end
        self._last = []
        if not self.pairs or not count:
            return ()
        block = bodies.block(first, end)
        happened = [encounter for encounter in self._ahead if encounter.column == count - 1]
        for pair in self.pairs:
            kinds = [encounter.event for encounter in happened if encounter.pair is pair]
            pair.advance(block, count, kinds)
            place = pair.user.home.lattice.xy_of(*pair.at)
            for kind in kinds:
                event = SightEvent(kind, pair.robot.name, *place)
                self._last.append((pair.user.row, pair.user, event))
        return ()

    def interruptions(self, events: Sequence[Event]) -> Iterable[tuple[int, SightEvent]]:
        """Yield the encounters of the last step to which the person reacts."""
        for row, user, event in self._last:
            if user.reacts_to(event, self.next_step - 1):
                yield row, event


def _first(flags: Bool) -> int | None:
    column = int(flags.argmax())
    return column if flags[column] else None
