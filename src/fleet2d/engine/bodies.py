"""The bodies of a run, what follows them from span to span, and the basis that all parts share."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fleet2d.artifacts.store import RunStore
from fleet2d.entities.behavior import SightEvent
from fleet2d.entities.body import NEVER, Pose, RandomWalk
from fleet2d.entities.decisions import DecidingActor
from fleet2d.entities.plan import Plan
from fleet2d.floorplan.home import Home
from fleet2d.kernels import I8, I64, U8, Breakpoints, Poses, Timelines, Window
from fleet2d.runtime.clock import Clock
from fleet2d.runtime.events import Event
from fleet2d.scenario.model import Scenario

STANDING = np.zeros(1, np.int8), np.zeros(0, np.int64)


class PoseBlock(NamedTuple):
    """The poses of all bodies at consecutive steps: row b is body b, column j is step first + j.

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


def poses_of(block: PoseBlock, row: int) -> Poses:
    """Return the poses of one body, as views."""
    return Poses(block.x[row], block.y[row], block.heading[row], block.away[row])


class Bodies:
    """All bodies of a run, users first, then robots.

    Attributes:
        step: The present step: decisions are made at it, poses beyond it may still change.
        ask_at: int64 (bodies,), the step at which each body decides next; NEVER for never.
        users: Number of users among the bodies.
    """

    def __init__(self, users: int, robots: int, step_us: int) -> None:
        self.step = 0
        self.users = users
        self.ask_at = np.zeros(users + robots, np.int64)
        self._step_us = step_us
        self._timelines = Timelines(users + robots, step_us)
        self._window: Window | None = None
        self._block: tuple[int, int, PoseBlock] | None = None

    def __len__(self) -> int:
        """Return the number of bodies."""
        return len(self.ask_at)

    def __getstate__(self) -> dict[str, object]:
        """Leave out caches, which follow from the timelines."""
        return {**self.__dict__, "_window": None, "_block": None}

    def pose(self, row: int) -> Pose:
        """Return the pose of a body at the present step."""
        return Pose(*self._timelines.pose(row, self.step))

    def pose_at(self, row: int, step: int) -> Pose:
        """Return the pose of a body at a step that isn't forgotten."""
        return Pose(*self._timelines.pose(row, step))

    def poses(self, step: int) -> tuple[I64, I64, I64, U8]:
        """Return x, y, heading and away of all bodies at a step, (bodies,) each."""
        return self._timelines.poses(step)

    def follow(self, row: int, plan: Plan) -> None:
        """Let a body follow a plan from the present step on."""
        motion = plan.finish()
        if isinstance(motion, RandomWalk):
            x, y, heading, _ = plan.began[1]
            self._timelines.walk(
                row, self.step, motion.walls, motion.space, motion.rule, (x, y, heading)
            )
        else:
            self._timelines.follow(row, self.step, motion.breakpoints, *plan.posture_times())
        self._window = self._block = None

    def hold(self, row: int, pose: Pose) -> None:
        """Let a body rest at a pose from the present step on."""
        moment = np.array([self.step * self._step_us], np.int64)
        x, y, heading = (np.array([value], np.int64) for value in pose[:3])
        track = Breakpoints(moment, x, y, heading, np.array([pose.away], np.uint8))
        self._timelines.follow(row, self.step, track, *STANDING[::-1])
        self._window = self._block = None

    def window(self, first: int, end: int) -> Window:
        """Return the runs of equal pose of all bodies in the steps from `first` to `end` - 1."""
        window = self._window
        if window is None or (window.first, window.end) != (first, end):
            window = self._window = self._timelines.window(first, end)
        return window

    def runs(self, row: int, first: int, end: int) -> Window:
        """Return the runs of equal pose of one body in the steps from `first` to `end` - 1."""
        return self._timelines.runs(row, first, end)

    def block(self, first: int, end: int) -> PoseBlock:
        """Return the poses of all bodies at each of the steps from `first` to `end` - 1."""
        if self._block is None or self._block[:2] != (first, end):
            window = self.window(first, end)
            rows = [window.dense(row, first, end) for row in range(len(self))]
            columns = (np.array(column) for column in zip(*rows, strict=True))
            block = PoseBlock(*columns) if rows else PoseBlock(*_none(end - first))
            self._block = first, end, block
        return self._block[2]

    def next_decision(self) -> int:
        """Return the step at which the next body decides, NEVER for none."""
        return int(self.ask_at.min(initial=NEVER))

    def due(self, step: int) -> Sequence[int]:
        """Return the rows of the bodies that decide at a step."""
        return np.flatnonzero(self.ask_at <= step).tolist()

    def forget(self, before: int) -> None:
        """Drop the poses at steps earlier than `before`."""
        self._timelines.forget(before)


def _none(steps: int) -> list[NDArray[Any]]:
    """Return the columns of a block without bodies."""
    return [np.zeros((0, steps), t) for t in (np.int64, np.int64, np.int64, np.uint8, np.int8)]


class Watcher:
    """Base of followers of the bodies from span to span.

    A span is a block of steps without decisions. A watcher that may have to end one looks ahead in
    `limit`; all others process many spans at once.

    Attributes:
        next_step: The first step that it has not processed.
    """

    next_step: int = 0

    @property
    def waits(self) -> bool:
        """Whether an event of it may end the present span."""
        return False

    def limit(self, bodies: Bodies, end: int) -> int:
        """Return the step before which the present span ends at the latest, `end` or earlier."""
        return end

    def take(self, bodies: Bodies, end: int) -> Sequence[Event]:
        """Take in the steps from `next_step` to `end` - 1; return their events."""
        self.next_step = end
        return ()

    def interruptions(self, events: Sequence[Event]) -> Iterable[tuple[int, SightEvent]]:
        """Return the bodies, by row, whose plans an event of the last step ends, and the event.

        Args:
            events: The result of `take`.
        """
        return ()


@dataclass(frozen=True)
class Basis:
    """What the parts of a run are made from.

    Attributes:
        scenario: The scenario.
        clock: The steps of the run.
        seed: The seed of all random draws.
        store: The store of its tables.
        home: The home before the first step.
        actors: Users, then robots.
        bodies: Their poses, in the same order.
    """

    scenario: Scenario
    clock: Clock
    seed: int
    store: RunStore
    home: Home
    actors: list[DecidingActor]
    bodies: Bodies

    @property
    def users(self) -> list[DecidingActor]:
        """The users."""
        return self.actors[: self.bodies.users]

    @property
    def robots(self) -> list[DecidingActor]:
        """The robots."""
        return self.actors[self.bodies.users :]

    @property
    def may_change(self) -> bool:
        """Whether the home may change during the run."""
        scenario = self.scenario
        changes = bool(scenario.objects or scenario.changes)
        changes |= any(user.lights for user in scenario.users.values())
        if changes or not scenario.script:
            return changes
        from fleet2d.interventions.home import HomeIntervention  # only scripts need it

        return any(isinstance(entry.act, HomeIntervention) for entry in scenario.script)
