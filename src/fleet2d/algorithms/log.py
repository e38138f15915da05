"""What is kept of a run: motions, observations and events, as far back as somebody may ask."""

from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass
from itertools import takewhile
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fleet2d.algorithms.activities import Activities
from fleet2d.algorithms.blocks import Blocks
from fleet2d.algorithms.evidence import Evidence, Sightings, gather
from fleet2d.algorithms.observations import (
    OBSERVATION,
    Looks,
    NearestRooms,
    Observations,
    perceived,
)
from fleet2d.algorithms.patches import Patches
from fleet2d.algorithms.poses import BodyPoses
from fleet2d.entities.plan import Motion, State
from fleet2d.errors import ComponentError
from fleet2d.kernels.look import IDENTITY, STEP, X, Y
from fleet2d.kernels.motion import Poses, empty_poses, paste_poses

if TYPE_CHECKING:
    from fleet2d.entities.actor import Actor
    from fleet2d.floorplan.home import Home


HOME = ""  # the entity of events of the home itself
SENSOR = "sensor"  # what is called when a sensor says something


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


class Sights(NamedTuple):
    """Who came into view of the cameras of a body, and who was lost, in a span.

    Attributes:
        entity: Name of the body.
        events: What is called when somebody is lost, and when somebody is seen.
        others: Names of those that it can see; behind them comes somebody unknown.
        step: int64 (n,), in order.
        user: int64 (n,), index of who.
        kind: int64 (n,), index of the event.
        end: One past the last step of the span.
    """

    entity: str
    events: tuple[str, str]
    others: Sequence[str]
    step: NDArray[np.int64]
    user: NDArray[np.int64]
    kind: NDArray[np.int64]
    end: int

    def between(self, first: int, end: int) -> list[Event]:
        """Return those of the steps from `first` to `end` - 1."""
        here = slice(*np.searchsorted(self.step, (first, end)).tolist())
        rows = zip(
            *(column[here].tolist() for column in (self.step, self.user, self.kind)), strict=True
        )
        names = (*self.others, "")
        return [Event(step, self.entity, self.events[kind], names[who]) for step, who, kind in rows]


class Log:
    """The motions and observations of a run, as far back as somebody may ask."""

    def __init__(self, home: "Home", actors: "Sequence[Actor]") -> None:
        self.home = home
        self.index = {actor.name: i for i, actor in enumerate(actors)}
        self.paths = [actor.path for actor in actors]
        self.pieces: list[list[Piece]] = [[] for _ in actors]
        self._observations = Blocks()  # (n, OBSERVATION), by step
        self._actors = actors
        # Of plans that were replaced, with the step at which they were: no later than the event.
        self._events: list[tuple[int, Event]] = []
        self.sights: list[Sights] = []
        self.readings: list[SensorRow] = []
        self.cameras: list[tuple[int, str]] = []  # index of the robot, and name
        self._looks: dict[int, NDArray[np.int64]] = {}
        self._exposures: dict[int, NDArray[np.int64]] = {}
        self.bin_steps = 0  # of the bins of evidence; 0: nobody asks for it
        self._bins = Blocks()  # (n, robots, 2, patches), by bin
        self._next_bin = 0
        self.patches: Patches | None = None  # that bins of evidence tell apart
        self._rooms = NearestRooms(home.plan)
        self._nearest_patches: NearestRooms | None = None
        self.activities = Activities(0, {})
        self._traced: dict[tuple[str, int, int], BodyPoses] = {}

    def forget(self, before: int) -> None:
        """Drop what is only needed for steps earlier than `before`."""
        self._traced.clear()
        for pieces in self.pieces:
            keep = max((i for i, piece in enumerate(pieces) if piece.first <= before), default=0)
            del pieces[:keep]
        self._observations.forget(before)
        self.readings = [row for row in self.readings if row.step >= before]
        self._events = [(at, event) for at, event in self._events if event.step >= before]
        self.sights = [sights for sights in self.sights if sights.end > before]
        self._looks = {step: counts for step, counts in self._looks.items() if step >= before}
        self._exposures = {k: seen for k, seen in self._exposures.items() if k >= before}
        if self.bin_steps:
            self._bins.forget(before // self.bin_steps)

    def tell(self, actor: "Actor", step: int) -> None:
        """Keep what the plan of a body said happens up to `step`, at which it is replaced."""
        if actor.plan.notes:
            self._events += [(step, event) for event in _events(actor) if event.step <= step]

    def next_note(self, step: int, names: Set[str]) -> int | None:
        """Return the next step from `step` on at which a plan says one of these happens."""
        notes = [event for actor in self._actors for event in _events(actor)]
        notes += [event for _, event in self._told_from(step)]
        steps = (event.step for event in notes if event.event in names and event.step >= step)
        return min(steps, default=None)

    def _told_from(self, step: int) -> list[tuple[int, Event]]:
        """Return what plans that were replaced at `step` or later said."""
        return list(takewhile(lambda item: item[0] >= step, reversed(self._events)))[::-1]

    def events(self, first: int, end: int) -> list[Event]:
        """Return what happened in the steps from `first` to `end` - 1, in order.

        What plans said happens, and who came into view or was lost.
        """
        going_on = [event for actor in self._actors for event in _events(actor)]
        found = [event for _, event in self._told_from(first)] + going_on
        found = [event for event in found if first <= event.step < end]
        for sights in takewhile(lambda sights: sights.end > first, reversed(self.sights)):
            found += sights.between(first, end)
        order = self.index
        return sorted(found, key=lambda event: (event.step, order[event.entity]))

    def happened(self, step: int) -> list[Event]:
        """Return what happened at one step, readings of sensors among it."""
        said = [Event(step, HOME, SENSOR, "") for row in self.readings if row.step == step]
        return self.events(step, step + 1) + said[:1]

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

    def observe(self, rows: NDArray[np.int64]) -> None:
        """Keep what was perceived in a span: its observations (n, OBSERVATION), in order."""
        if len(rows):
            self._observations.append(int(rows[0, STEP]), int(rows[-1, STEP]) + 1, rows)

    def seen(self, first: int, end: int) -> NDArray[np.int64]:
        """Return the rows of the observations of the steps from `first` to `end` - 1."""
        _, rows = self._observations.touching(first, end)
        if rows is None:
            return np.empty((0, OBSERVATION), np.int64)
        return rows[slice(*np.searchsorted(rows[:, STEP], (first, end)).tolist())]

    def perceived(self, first: int, end: int) -> Observations:
        """Return what was perceived in the steps from `first` to `end` - 1."""
        return perceived(self.home.plan, self._rooms, self.seen(first, end), self.activities)

    def count_looks(self, step: int, counts: Sequence[NDArray[np.int64]]) -> None:
        """Keep how often each robot's cameras have looked and noticed before `step`."""
        if counts:
            self._looks[step] = np.concatenate(counts)

    def looks(self, first: int, end: int, users: int) -> Looks:
        """Return the looks in the steps from `first` to `end` - 1.

        Raises:
            ComponentError: They weren't counted before one of these.
        """
        none = np.zeros((len(self.cameras), users, 2), np.int64)
        counts = _known_at(self._looks, end, none) - _known_at(self._looks, first, none)
        robots = np.array([robot for robot, _ in self.cameras], np.int32)
        names = tuple(name for _, name in self.cameras)
        return Looks(robots, names, counts[..., 0], counts[..., 1])

    def expose(self, step: int, exposure: NDArray[np.int64]) -> None:
        """Keep how much of each room each robot has had in view before `step`."""
        self._exposures[step] = exposure

    def expose_bins(self, bins: NDArray[np.int64]) -> None:
        """Keep how much each robot has had in view: the bins (n, robots, 2, patches).

        That is cells of each patch, summed over the steps of the bin, and at most at one.
        """
        begin, self._next_bin = self._next_bin, self._next_bin + len(bins)
        self._bins.append(begin, self._next_bin, bins)

    def evidence(self, first: int, end: int, users: int) -> Evidence:
        """Return what was watched and perceived in the steps from `first` to `end` - 1.

        Raises:
            ComponentError: The steps aren't whole bins.
        """
        assert self.patches is not None, "nobody needs evidence"
        if first % self.bin_steps or end % self.bin_steps:
            raise ComponentError(
                f"evidence comes in bins of {self.bin_steps} steps, but the period from step"
                f" {first} to {end} isn't made of whole ones: choose a period of whole minutes"
            )
        begin, last = first // self.bin_steps, end // self.bin_steps
        since, bins = self._bins.touching(begin, last)
        assert bins is not None, "a history is not empty"
        bins = bins[begin - since : last - since]
        if self._nearest_patches is None:
            self._nearest_patches = NearestRooms(self.home.plan, self.patches.of_cell)
        rows = self.seen(first, end)
        patch = self._nearest_patches.of(rows[:, X], rows[:, Y])
        sightings = Sightings(rows[:, STEP], rows[:, IDENTITY], patch)
        return gather(first, self.bin_steps, self.patches, bins, sightings, users)

    def exposure(self, first: int, end: int) -> NDArray[np.int64]:
        """Return how much of each room each robot had in view in the steps `first` to `end` - 1.

        Before the run somebody must have said that it would be asked for.

        Raises:
            ComponentError: It wasn't added up before one of these.
        """
        none = np.zeros_like(next(iter(self._exposures.values())))
        return _known_at(self._exposures, end, none) - _known_at(self._exposures, first, none)


def _known_at(
    sums: Mapping[int, NDArray[np.int64]], step: int, at_first: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Return what was added up before a step."""
    if step in sums or step == 0 or not sums:  # without cameras there are no sums
        return sums.get(step, at_first)
    raise ComponentError(
        f"what cameras looked at is added up from update to update, and step {step} is none: ask"
        f" for exposure and looks between those of {', '.join(map(str, sorted(sums)[-5:]))}, or for"
        " evidence"
    )


def _events(actor: "Actor") -> list[Event]:
    """Return what the plan of a body says happens."""
    at = actor.clock.step_at_or_after
    return [Event(at(n.time_us), actor.name, n.event, n.detail) for n in actor.plan.notes]
