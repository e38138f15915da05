"""What is kept of a run: motions, observations and events, as far back as somebody may ask."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fleet2d.algorithms.activities import Activities
from fleet2d.algorithms.evidence import Evidence, Sightings, cells_of_rooms, count_seen
from fleet2d.algorithms.observations import (
    OBSERVATION,
    Looks,
    NearestRooms,
    Observations,
    perceived,
)
from fleet2d.algorithms.poses import BodyPoses
from fleet2d.entities.plan import Motion, State
from fleet2d.errors import ComponentError
from fleet2d.kernels.look import IDENTITY, STEP, X, Y
from fleet2d.kernels.motion import Poses, empty_poses, paste_poses

if TYPE_CHECKING:
    from fleet2d.entities.actor import Actor
    from fleet2d.floorplan.home import Home


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
        rows = self.seen(first, end)
        sightings = Sightings(
            rows[:, STEP], rows[:, IDENTITY], self._rooms.of(rows[:, X], rows[:, Y])
        )
        seen = count_seen(sightings, first, len(bins), self.bin_steps, users, most.shape[1])
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
