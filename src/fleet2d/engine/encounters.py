"""Encounters: when robots come near to people who react to them.

What happens follows from the poses alone, step by step, so it is the same however a run is cut into
spans. A span ends with the first encounter in it, and who it is about is asked again right after.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fleet2d.engine.bodies import Bodies, PoseBlock
from fleet2d.entities.behavior import Attention, SightEvent
from fleet2d.entities.decisions import DecidingActor
from fleet2d.events import Event, EventKind
from fleet2d.floorplan.objects import POSTURES
from fleet2d.kernels.mesh import locate
from fleet2d.kernels.sight import line_of_sight

# Who is out of reach is farther away than any home is wide: squared lattice units.
FAR = 1 << 50
LYING = POSTURES.index("lie")
STANDING = POSTURES.index("stand")
# A robot is noticed anew when it has been farther away than these parts of the distance.
AGAIN_NEAR = (5, 4)
AGAIN_COMING = (3, 2)

I64 = NDArray[np.int64]
Bool = NDArray[np.bool_]


class Happening(NamedTuple):
    """Something that a robot does to somebody, in a column of a span."""

    column: int
    event: str
    robot: DecidingActor
    pair: "Pair"


@dataclass
class Pair:
    """Somebody and a robot, and what is carried from span to span.

    Attributes:
        user: The person.
        user_row: The person's row among the bodies.
        robot: The robot.
        robot_row: Its row among the bodies.
        attention: What is taken notice of.
        near: Whether it would be noticed when it is near, and not as still there.
        coming: Likewise, when it drives up.
        close_steps: For how many steps it has been too close.
        distance: Between them at the last step [lattice units, squared].
        at: Where the robot was at the last step.
    """

    user: DecidingActor
    user_row: int
    robot: DecidingActor
    robot_row: int
    attention: Attention
    near: bool = True
    coming: bool = True
    close_steps: int = 0
    distance: int = FAR
    at: tuple[int, int] = (-1, -1)

    def scan(self, block: PoseBlock, count: int) -> list[Happening]:
        """Return what happens first of each kind in `count` steps."""
        self.distances = self._measure(block, count)
        kinds = {
            "robot_near": self._first_near(block),
            "robot_coming": self._first_coming(block),
            "robot_close": self._first_close(),
        }
        return [
            Happening(column, event, self.robot, self)
            for event, column in kinds.items()
            if column is not None
        ]

    def hears(self, column: int) -> bool:
        """Tell whether a call of the robot is heard in a column of the scanned span."""
        return bool(self.distances[column] <= self.attention.hears * self.attention.hears)

    def pass_over(self, block: PoseBlock, count: int, happened: Sequence[str]) -> None:
        """Take over what `count` steps leave behind."""
        distances = self.distances[:count]
        self.near = "robot_near" not in happened and bool(self._armed_near()[count - 1])
        self.coming = "robot_coming" not in happened and bool(self._armed_coming()[count - 1])
        self.close_steps = int(self._close_run()[count - 1])
        self.distance = int(distances[-1])
        row = self.robot_row
        self.at = int(block.x[row, count - 1]), int(block.y[row, count - 1])

    def _measure(self, block: PoseBlock, count: int) -> I64:
        """Return the squared distances; who lies or is out of the home is far from everybody."""
        u, r = self.user_row, self.robot_row
        dx = block.x[u, :count] - block.x[r, :count]
        dy = block.y[u, :count] - block.y[r, :count]
        out = block.away[u, :count] | block.away[r, :count]
        gone = (out != 0) | (block.posture[u, :count] == LYING)
        return np.where(gone, FAR, dx * dx + dy * dy)

    def _beyond(self, limit: int, times: tuple[int, int]) -> Bool:
        far = limit * times[0] // times[1]
        return self.distances > far * far

    def _armed_near(self) -> Bool:
        again: Bool = np.logical_or.accumulate(self._beyond(self.attention.notices, AGAIN_NEAR))
        return again | self.near

    def _armed_coming(self) -> Bool:
        again: Bool = np.logical_or.accumulate(self._beyond(self.attention.in_way, AGAIN_COMING))
        return again | self.coming

    def _close_run(self) -> I64:
        """Return for how many steps the robot has been too close, at each of them."""
        limit = self.attention.too_close
        close = self.distances <= limit * limit
        index = np.arange(len(close))
        last = np.maximum.accumulate(np.where(close, -1, index))
        return index - last + np.where(last < 0, self.close_steps, 0)

    def _first_near(self, block: PoseBlock) -> int | None:
        """Return when the robot is first noticed: near, and with nothing between."""
        limit = self.attention.notices
        candidates = np.flatnonzero((self.distances <= limit * limit) & self._armed_near())
        u, r = self.user_row, self.robot_row
        walls, asked = self.user.home.walls, None
        rows = (block.x[u], block.y[u], block.x[r], block.y[r])
        for column, *places in zip(
            candidates.tolist(), *(row[candidates].tolist() for row in rows), strict=True
        ):
            if places == asked:
                continue
            asked = places
            x, y, robot_x, robot_y = places
            if line_of_sight(walls, x, y, locate(walls, x, y), robot_x, robot_y):
                return int(column)
        return None

    def _first_coming(self, block: PoseBlock) -> int | None:
        """Return when a robot first drives up to somebody who stands."""
        limit, count, row = self.attention.in_way, len(self.distances), self.robot_row
        inside = (self.distances <= limit * limit) & self._armed_coming()
        if not inside.any():
            return None
        x, y = block.x[row, :count], block.y[row, :count]
        before = self.at if self.at[0] >= 0 else (int(x[0]), int(y[0]))
        moves = (np.diff(x, prepend=before[0]) != 0) | (np.diff(y, prepend=before[1]) != 0)
        nearer = np.diff(self.distances, prepend=self.distance) < 0
        stands = block.posture[self.user_row, :count] == STANDING
        return _first(inside & moves & nearer & stands)

    def _first_close(self) -> int | None:
        return _first(self._close_run() == self.attention.patience)


class Encounters:
    """All pairs of somebody who reacts to robots and a robot.

    Attributes:
        pairs: The pairs.
        taken: The step before which everything is taken in.
    """

    def __init__(self, users: Sequence[DecidingActor], robots: Sequence[DecidingActor]) -> None:
        self._robots = [(len(users) + i, robot) for i, robot in enumerate(robots)]
        self.pairs = [
            Pair(user, row, robot, robot_row, user.attention)
            for row, user in enumerate(users)
            if user.attention is not None
            for robot_row, robot in self._robots
        ]
        self.taken = 0
        self._calls: list[tuple[int, int, str]] = []  # made as plans ended: step, row, user
        self._ahead: list[Happening] = []
        self._last: list[tuple[int, DecidingActor, SightEvent]] = []

    @property
    def waits(self) -> bool:
        """Whether anybody reacts to robots."""
        return bool(self.pairs)

    def before_plan(self, row: int, actor: DecidingActor, step: int) -> None:
        """Keep the calls at `step` of a robot's plan that is about to be replaced."""
        if self.pairs:
            self._calls += [call for call in _calls(row, actor) if call[0] == step]

    def limit(self, bodies: Bodies, end: int) -> int:
        """Return the step after the first at which somebody may react."""
        first, block = self.taken, bodies.block(self.taken, end)
        self._ahead = [event for pair in self.pairs for event in pair.scan(block, end - first)]
        calls = self._calls + [call for row, robot in self._robots for call in _calls(row, robot)]
        self._calls = []
        self._ahead += [
            Happening(step - first, "robot_calls", pair.robot, pair)
            for step, row, user in calls
            if first <= step < end
            for pair in self.pairs
            if pair.robot_row == row and user in ("", pair.user.name) and pair.hears(step - first)
        ]
        return min((event.column + first + 1 for event in self._ahead), default=end)

    def take(self, bodies: Bodies, end: int) -> Sequence[Event]:
        """Take over what the steps up to `end` - 1 leave behind."""
        first, self.taken, count = self.taken, end, end - self.taken
        self._last = []
        if not self.pairs or not count:
            return ()
        block = bodies.block(first, end)
        for pair in self.pairs:
            last = [e for e in self._ahead if e.pair is pair and e.column == count - 1]
            pair.pass_over(block, count, [e.event for e in last])
            x, y = pair.user.home.plan.lattice.to_metres(pair.at).tolist()
            self._last += [
                (pair.user_row, pair.user, SightEvent(e.event, e.robot.name, x, y)) for e in last
            ]
        return ()

    def interruptions(self, events: Sequence[Event]) -> Iterable[tuple[int, SightEvent]]:
        """Yield what happened in the last step to whom, if they react to it."""
        for row, user, event in self._last:
            if user.heeds(event, self.taken - 1):
                yield row, event


def _calls(row: int, robot: DecidingActor) -> list[tuple[int, int, str]]:
    """Return the calls of a robot's plan: step, the robot's row, and the user it calls."""
    return [
        (robot.clock.step_at_or_after(note.time_us), row, note.detail)
        for note in robot.plan.notes
        if note.event == EventKind.CALLS
    ]


def _first(found: Bool) -> int | None:
    column = int(found.argmax())
    return column if found[column] else None
