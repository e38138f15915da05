"""What happened: motions and observations of a stretch of steps, as arrays."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from fleet2d.algorithms.activities import Activities
from fleet2d.algorithms.evidence import Evidence, cells_of_rooms, count_seen
from fleet2d.algorithms.observations import (
    NOWHERE,
    OBSERVATION,
    Looks,
    NearestRooms,
    Observations,
    Truth,
    perceived,
    truth,
)
from fleet2d.entities.plan import Motion, State
from fleet2d.errors import ComponentError
from fleet2d.kernels.headings import in_radians
from fleet2d.kernels.look import STEP
from fleet2d.kernels.measure import count_rooms, sum_moves
from fleet2d.kernels.mesh import SUB
from fleet2d.kernels.motion import Poses, empty_poses, paste_poses

if TYPE_CHECKING:
    from fleet2d.entities.actor import Actor
    from fleet2d.floorplan.home import Home

Array = TypeVar("Array", bound=NDArray[Any])


class BodyPoses:
    """Poses of one body, one entry per step; columns are worked out when they are asked for."""

    def __init__(self, home: "Home", poses: Poses) -> None:
        self._home, self._poses = home, poses

    def __len__(self) -> int:
        """Return the number of steps."""
        return len(self._poses.x)

    @cached_property
    def xy(self) -> NDArray[np.float64]:
        """Positions (n, 2) [m]; where it left while it is away."""
        lattice = self._home.plan.lattice
        return _shared(lattice.to_metres(np.stack([self._poses.x, self._poses.y], axis=-1)))

    def at(self, index: int) -> tuple[float, float]:
        """Return the position (x, y) [m] at one step; -1 is the last."""
        point = self._poses.x[index], self._poses.y[index]
        x, y = self._home.plan.lattice.to_metres(point).tolist()
        return x, y

    @property
    def x(self) -> NDArray[np.float64]:
        """Positions along x [m]."""
        return self.xy[:, 0]

    @property
    def y(self) -> NDArray[np.float64]:
        """Positions along y [m]."""
        return self.xy[:, 1]

    @cached_property
    def heading(self) -> NDArray[np.float64]:
        """Headings, counter-clockwise from +x, 0 to 2 pi [rad]."""
        radians: NDArray[np.float64] = in_radians(self._poses.heading)
        return _shared(radians)

    @cached_property
    def away(self) -> NDArray[np.bool_]:
        """Whether it is out of the home."""
        return _shared(self._poses.away.astype(bool))

    @cached_property
    def room(self) -> NDArray[np.int16]:
        """Index of the room, NOWHERE while it is away."""
        room = self._home.plan.room_of_place[self._poses.y // SUB, self._poses.x // SUB]
        return _shared(np.where(self.away, np.int16(NOWHERE), room))

    @cached_property
    def time_in_rooms(self) -> NDArray[np.int64]:
        """Number of steps in each room, and last away: int64 (rooms + 1,)."""
        counts = np.zeros(len(self._home.rooms) + 1, np.int64)
        count_rooms(self._poses, self._home.plan.room_of_place, counts)
        return _shared(counts)

    @cached_property
    def distance(self) -> float:
        """Length of the way from the first to the last step [m]."""
        return float(sum_moves(self._poses)) / self._home.plan.lattice.units_per_m


def _shared(array: Array) -> Array:
    """Refuse changes: whoever is updated at the same step gets the same array."""
    array.setflags(write=False)
    return array


@dataclass(frozen=True)
class Piece:
    """A motion followed from step `first` on, by a body that was at `start` then."""

    first: int
    start: State
    motion: Motion


class Event(NamedTuple):
    """Something that a plan said happens: a row of the table of events."""

    step: int
    entity: str  # the name of the body
    event: str
    detail: str


class SensorRow(NamedTuple):
    """A reading of a sensor, as the table of sensors has it."""

    step: int
    sensor: int
    on: bool
    activity: str


class Log:
    """The motions and observations of a run, as far back as somebody may ask."""

    def __init__(self, home: "Home", actors: "Sequence[Actor]") -> None:
        self.home = home
        self.index = {actor.name: i for i, actor in enumerate(actors)}
        self.paths = [actor.path for actor in actors]
        self.pieces: list[list[Piece]] = [[] for _ in actors]
        self.observations: list[NDArray[np.int64]] = []  # (n, OBSERVATION) each
        self._actors = actors
        self._events: list[Event] = []  # of plans that were replaced
        self.readings: list[SensorRow] = []
        self.cameras: list[tuple[int, str]] = []  # index of the robot, and name
        self._looks: dict[int, NDArray[np.int64]] = {}
        self._exposures: dict[int, NDArray[np.int64]] = {}
        self.bin_steps = 0  # of the bins of evidence; 0: nobody asks for it
        self._bins: NDArray[np.int64] | None = None  # (bins, robots, rooms), from _first_bin on
        self._first_bin = 0
        self._cells: NDArray[np.int64] | None = None  # of each room
        self._rooms = NearestRooms(home.plan)
        self.activities = Activities(0, {})
        self._traced: dict[tuple[str, int, int], BodyPoses] = {}

    def forget(self, before: int) -> None:
        """Drop what is only needed for steps earlier than `before`."""
        self._traced.clear()
        for pieces in self.pieces:
            keep = max((i for i, piece in enumerate(pieces) if piece.first <= before), default=0)
            del pieces[:keep]
        self.observations = [o for o in self.observations if o[-1, STEP] >= before]
        self.readings = [row for row in self.readings if row.step >= before]
        self._events = [event for event in self._events if event.step >= before]
        self._looks = {step: counts for step, counts in self._looks.items() if step >= before}
        self._exposures = {k: seen for k, seen in self._exposures.items() if k >= before}
        if self._bins is not None:
            past = max(0, before // self.bin_steps - self._first_bin)
            self._bins, self._first_bin = self._bins[past:], self._first_bin + past

    def tell(self, actor: "Actor", step: int) -> None:
        """Keep what the plan of a body said happens up to `step`, at which it is replaced."""
        if actor.plan.notes:
            self._events += [event for event in _events(actor) if event.step <= step]

    def events(self, first: int, end: int) -> list[Event]:
        """Return what plans said happens in the steps from `first` to `end` - 1, in order."""
        going_on = [event for actor in self._actors for event in _events(actor)]
        found = [event for event in self._events + going_on if first <= event.step < end]
        order = self.index
        return sorted(found, key=lambda event: (event.step, order[event.entity]))

    def poses(self, name: str, first: int, end: int) -> BodyPoses:
        """Return the poses of a body in the steps from `first` to `end` - 1."""
        key = (name, first, end)
        if key not in self._traced:  # whoever is updated at the same time asks for the same
            self._traced[key] = BodyPoses(self.home, self._trace(name, first, end))
        return self._traced[key]

    def _trace(self, name: str, first: int, end: int) -> Poses:
        count = end - first
        out = empty_poses(count)
        pieces = self.pieces[self.index[name]]
        for i, piece in enumerate(pieces):
            stop = pieces[i + 1].first if i + 1 < len(pieces) else end
            begin, stop = max(first, piece.first), min(end, stop)
            if begin < stop:
                here = slice(begin - first, stop - first)
                if begin == piece.first:
                    part = Poses(out.x[here], out.y[here], out.heading[here], out.away[here])
                    piece.motion.trace(piece.first, piece.start, part)
                    continue
                part = empty_poses(stop - piece.first)
                piece.motion.trace(piece.first, piece.start, part)
                paste_poses(out, here.start, part, slice(begin - piece.first, None))
        return out

    def seen(self, first: int, end: int) -> NDArray[np.int64]:
        """Return the rows of the observations of the steps from `first` to `end` - 1."""
        blocks = [o for o in self.observations if o[-1, STEP] >= first and o[0, STEP] < end]
        if not blocks:
            return np.empty((0, OBSERVATION), np.int64)
        rows = np.concatenate(blocks)
        return rows[slice(*np.searchsorted(rows[:, STEP], (first, end)).tolist())]

    def perceived(self, first: int, end: int) -> Observations:
        """Return what was perceived in the steps from `first` to `end` - 1."""
        return perceived(self.home.plan, self._rooms, self.seen(first, end), self.activities)

    def count_looks(self, step: int, counts: Sequence[NDArray[np.int64]]) -> None:
        """Keep how often each robot's cameras have looked and noticed before `step`."""
        if counts:
            self._looks[step] = np.concatenate(counts)

    def looks(self, first: int, end: int, users: int) -> Looks:
        """Return the looks in the steps from `first` to `end` - 1, both counted before."""
        none = np.zeros((len(self.cameras), users, 2), np.int64)
        counts = self._looks.get(end, none) - self._looks.get(first, none)
        robots = np.array([robot for robot, _ in self.cameras], np.int32)
        names = tuple(name for _, name in self.cameras)
        return Looks(robots, names, counts[..., 0], counts[..., 1])

    def expose(self, step: int, exposure: NDArray[np.int64]) -> None:
        """Keep how much of each room each robot has had in view before `step`."""
        self._exposures[step] = exposure

    def expose_bins(self, bins: NDArray[np.int64]) -> None:
        """Keep how much of each room each robot has had in view: the bins (n, robots, rooms)."""
        self._bins = bins if self._bins is None else np.concatenate([self._bins, bins])

    def evidence(self, first: int, end: int, users: int) -> Evidence:
        """Return what was watched and perceived in the steps from `first` to `end` - 1.

        Raises:
            ComponentError: Nobody said before the run that it would be asked for, or the steps
                aren't whole bins.
        """
        if self._bins is None:
            raise ComponentError(
                "evidence was asked for, but isn't worked out unless somebody says so before: write"
                " needs = {'evidence'} in the class of the component"
            )
        if first % self.bin_steps or end % self.bin_steps:
            raise ComponentError(
                f"evidence comes in bins of {self.bin_steps} steps, but the period from step"
                f" {first} to {end} isn't made of whole ones: choose a period of whole minutes"
            )
        begin = first // self.bin_steps - self._first_bin
        bins = self._bins[begin : end // self.bin_steps - self._first_bin]
        if self._cells is None:
            self._cells = np.maximum(cells_of_rooms(self.home.plan), 1)
        most = bins.max(axis=1, initial=0)
        seen = count_seen(
            self.perceived(first, end), first, len(bins), self.bin_steps, users, most.shape[1]
        )
        return Evidence(first, self.bin_steps, most / (self._cells * self.bin_steps), seen)

    def exposure(self, first: int, end: int) -> NDArray[np.int64]:
        """Return how much of each room each robot had in view in the steps `first` to `end` - 1.

        Raises:
            ComponentError: Nobody said before the run that it would be asked for.
        """
        if end not in self._exposures:
            raise ComponentError(
                "exposure was asked for, but isn't worked out unless somebody says so before: write"
                " needs = {'exposure'} in the class of the component"
            )
        before = self._exposures.get(first)
        return self._exposures[end] - (0 if before is None else before)


def _events(actor: "Actor") -> list[Event]:
    """Return what the plan of a body says happens."""
    at = actor.clock.step_at_or_after
    return [Event(at(n.time_us), actor.name, n.event, n.detail) for n in actor.plan.notes]


@dataclass(frozen=True)
class Readings:
    """What sensors said, in order of step; all arrays of one length.

    Attributes:
        step: int64.
        sensor: Index of the sensor, in the order of the scenario, int32.
        on: Whether it went on (or open), bool.
    """

    step: NDArray[np.int64]
    sensor: NDArray[np.int32]
    on: NDArray[np.bool_]


@dataclass(frozen=True)
class History:
    """The steps since a component was asked last, `first` to `end` - 1.

    Attributes:
        first: First step.
        end: One past the last step.
        step_s: Length of a step [s].
        observations: What the robots perceived.
    """

    log: Log
    first: int
    end: int
    step_s: float
    visible: frozenset[str]  # the bodies whose poses may be asked for
    oldest: int = 0  # the first step that is kept for who looks back

    def between(self, first: int, end: int) -> "History":
        """Return the history of the steps from `first` to `end` - 1.

        How far back that may be, the component's class says by `looks_back`.

        Raises:
            ComponentError: These steps are not kept, or are yet to come.

        Example:
            >>> from datetime import timedelta
            >>> from fleet2d import Algorithm
            >>> class Sightings(Algorithm):
            ...     '''How often somebody was seen in the last day.'''
            ...     looks_back = timedelta(days=1)
            ...     def update(self, history, state):
            ...         day = history.between(max(0, history.end - 86400), history.end)
            ...         return {"sightings": len(day.observations.step)}
        """
        if not self.oldest <= first <= end <= self.end:
            raise ComponentError(
                f"the steps from {first} to {end} were asked for, but those from {self.oldest} to"
                f" {self.end} are kept: say by looks_back in the class how far back you look"
            )
        return History(self.log, first, end, self.step_s, self.visible, self.oldest)

    def __len__(self) -> int:
        """Return the number of steps."""
        return self.end - self.first

    @cached_property
    def observations(self) -> Observations:
        """What the robots perceived."""
        return self.log.perceived(self.first, self.end)

    @cached_property
    def readings(self) -> Readings:
        """What the sensors said."""
        rows = [row for row in self.log.readings if self.first <= row.step < self.end]
        return Readings(
            np.array([row.step for row in rows], np.int64),
            np.array([row.sensor for row in rows], np.int32),
            np.array([row.on for row in rows], np.bool_),
        )

    @cached_property
    def events(self) -> list[Event]:
        """What the plans of bodies said happens, in order of step; algorithms hear of robots'."""
        found = self.log.events(self.first, self.end)
        return [event for event in found if event.entity in self.visible]

    @cached_property
    def truth(self) -> Truth:
        """What was really there, row by row of the observations; for metrics.

        Raises:
            ComponentError: The asker is an algorithm.
        """
        self._check_metric("truth")
        log = self.log
        return truth(log.home.plan, log.seen(self.first, self.end), log.activities)

    @cached_property
    def looks(self) -> Looks:
        """How often each camera had a user in view, and how often it noticed; for metrics.

        Raises:
            ComponentError: The asker is an algorithm.
        """
        self._check_metric("looks")
        users = sum(path.startswith("users.") for path in self.log.paths)
        return self.log.looks(self.first, self.end, users)

    @cached_property
    def exposure(self) -> NDArray[np.int64]:
        """Cells of each room in view of each robot, summed over the steps: (robots, rooms).

        Divided by the room's cells and by the number of steps, it is the mean share of the room
        that was in view.

        Raises:
            ComponentError: The asker has no needs = {"exposure"}.
        """
        return self.log.exposure(self.first, self.end)

    @cached_property
    def evidence(self) -> Evidence:
        """What robots watched and whom they perceived there, minute by minute.

        Raises:
            ComponentError: The asker has no needs = {"evidence"}, or no period of whole minutes.
        """
        users = sum(path.startswith("users.") for path in self.log.paths)
        return self.log.evidence(self.first, self.end, users)

    def _check_metric(self, what: str) -> None:
        if self.visible != frozenset(self.log.index):
            raise ComponentError(f"{what} was asked for, but only metrics know what is true")

    def poses(self, name: str) -> BodyPoses:
        """Return the poses of a body. Algorithms may ask for robots, metrics for users, too.

        Raises:
            ComponentError: There is no such body, or it is a user and the asker an algorithm.
        """
        if name not in self.visible:
            known = ", ".join(sorted(self.visible))
            why = (
                "only metrics know where users are"
                if name in self.log.index
                else "there is no such body"
            )
            raise ComponentError(f"poses of {name!r} were asked for, but {why}; available: {known}")
        return self.log.poses(name, self.first, self.end)
