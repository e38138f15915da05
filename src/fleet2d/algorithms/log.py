"""The log of a run: motions, observations and events, as far back as components may look."""

from collections.abc import Callable, Mapping, Sequence, Set
from typing import NamedTuple, Protocol

import numpy as np

from fleet2d.algorithms.activities import Activities
from fleet2d.algorithms.blocks import Blocks
from fleet2d.algorithms.evidence import Evidence, SightingRows, gather
from fleet2d.algorithms.observations import Looks, NearestRooms, Observations, Rows
from fleet2d.algorithms.patches import Patches
from fleet2d.algorithms.poses import BodyPoses, Path
from fleet2d.errors import ComponentError
from fleet2d.floorplan.home.home import Home
from fleet2d.kernels import I64
from fleet2d.kernels.motion import Window
from fleet2d.kernels.sight import SightingColumn as Column
from fleet2d.runtime.events import HOME, Event, EventKind


class SensorRow(NamedTuple):
    """A reading of a sensor, as the table of sensors has it."""

    step: int
    sensor: int
    on: bool
    activity: str


class Motions(Protocol):
    """Protocol of the motions of all bodies of a run."""

    def runs(self, row: int, first: int, end: int) -> Window:
        """Return the runs of equal pose of one body in the steps from `first` to `end` - 1."""


class Log:
    """The motions and observations of a run, as far back as components may look."""

    def __init__(
        self, home: Home, names: Sequence[str], motions: Motions, activities: Activities
    ) -> None:
        """Begin an empty log.

        Args:
            home: The home.
            names: Names of the bodies, users first.
            motions: The motions of the bodies.
            activities: What users do.
        """
        self.home = home
        self.index = {name: row for row, name in enumerate(names)}
        self.users = activities.users
        self.activities = activities
        self._motions = motions
        self._observations = Blocks()  # (n, OBSERVATION), by step
        self._events: list[Event] = []
        self.readings: list[SensorRow] = []
        self.cameras: list[tuple[int, str]] = []  # index of the robot, and name of the camera
        self._looks: dict[int, I64] = {}
        self._exposures: dict[int, I64] = {}
        self.bin_steps = 0  # steps of a bin of evidence; 0: no component needs evidence
        self._bins = Blocks()  # int64 (n, robots, 2, patches), by bin
        self._next_bin = 0
        self.patches: Patches | None = None  # the patches of evidence
        self._rooms = NearestRooms(home.plan)
        self._nearest_patches: NearestRooms | None = None
        # For robots with `localization`: the believed poses from the true ones.
        self.beliefs: dict[str, Callable[[Window], Path]] = {}
        self._poses: dict[tuple[str, int, int, bool], BodyPoses] = {}

    def forget(self, before: int) -> None:
        """Drop everything that belongs to steps earlier than `before`."""
        self._poses.clear()
        self._observations.forget(before)
        self.readings = [row for row in self.readings if row.step >= before]
        self._events = [event for event in self._events if event.step >= before]
        self._looks = {step: counts for step, counts in self._looks.items() if step >= before}
        self._exposures = {k: cells for k, cells in self._exposures.items() if k >= before}
        if self.bin_steps:
            self._bins.forget(before // self.bin_steps)

    def take_events(self, events: Sequence[Event]) -> None:
        """Store the events of bodies."""
        self._events += [event for event in events if event.entity in self.index]

    def next_event(self, step: int, kinds: Set[str]) -> int | None:
        """Return the step of the first known event of these kinds from `step` on."""
        steps = (e.step for e in self._events if e.event in kinds and e.step >= step)
        return min(steps, default=None)

    def events(self, first: int, end: int) -> list[Event]:
        """Return the events in the steps from `first` to `end` - 1, in order.

        These are the notes of plans, and users and robots that came into view or were lost.
        """
        order = self.index
        events = [event for event in self._events if first <= event.step < end]
        return sorted(events, key=lambda e: (e.step, order[e.entity], e.rank))

    def happened(self, step: int) -> list[Event]:
        """Return the events at one step, with one for readings of sensors."""
        events = self.events(step, step + 1)
        if any(row.step == step for row in self.readings):
            events.append(Event(step, HOME, EventKind.SENSOR, ""))
        return events

    def poses(self, name: str, first: int, end: int, *, true: bool = True) -> BodyPoses:
        """Return the poses of a body in the steps from `first` to `end` - 1.

        Args:
            name: Name of the body.
            first: First step.
            end: One past the last step.
            true: Whether to return the true poses, or those that a robot believes.
        """
        true = true or name not in self.beliefs
        key = (name, first, end, true)
        if key not in self._poses:  # components that are updated at the same step share them
            runs = self._motions.runs(self.index[name], first, end)
            path = runs if true else self.beliefs[name](runs)
            self._poses[key] = BodyPoses(self.home, path)
        return self._poses[key]

    def observe(self, rows: I64) -> None:
        """Store the observations of a span: int64 (n, OBSERVATION), in order of step."""
        if len(rows):
            self._observations.append(
                int(rows[0, Column.STEP]), int(rows[-1, Column.STEP]) + 1, rows
            )

    def seen(self, first: int, end: int) -> Rows:
        """Return the rows of the observations of the steps from `first` to `end` - 1."""
        blocks = self._observations.each_touching(first, end)
        return Rows(
            [
                rows[slice(*np.searchsorted(rows[:, Column.STEP], (first, end)).tolist())]
                for rows in blocks
            ]
        )

    def perceived(self, first: int, end: int) -> Observations:
        """Return the observations of the steps from `first` to `end` - 1."""
        return Observations(self.home.plan, self._rooms, self.seen(first, end), self.activities)

    def count_looks(self, step: int, counts: Sequence[I64]) -> None:
        """Store how often each robot's cameras have looked and noticed before `step`."""
        if counts:
            self._looks[step] = np.concatenate(counts)

    def looks(self, first: int, end: int, users: int) -> Looks:
        """Return the looks in the steps from `first` to `end` - 1.

        Raises:
            ComponentError: No counts were stored at `first` or `end`.
        """
        none = np.zeros((len(self.cameras), users, 2), np.int64)
        counts = _known_at(self._looks, end, none) - _known_at(self._looks, first, none)
        robots = np.array([robot for robot, _ in self.cameras], np.int32)
        names = tuple(name for _, name in self.cameras)
        return Looks(robots, names, counts[..., 0], counts[..., 1])

    def expose(self, step: int, exposure: I64) -> None:
        """Store how much of each room each robot has had in view before `step`."""
        self._exposures[step] = exposure

    def expose_bins(self, bins: I64) -> None:
        """Store what each robot has had in view in the next bins: int64 (n, robots, 2, patches).

        Entry 0 is the number of cells of each patch in view, summed over the steps of the bin;
        entry 1 the maximum over them.
        """
        begin, self._next_bin = self._next_bin, self._next_bin + len(bins)
        self._bins.append(begin, self._next_bin, bins)

    def evidence(self, first: int, end: int, users: int) -> Evidence:
        """Return the evidence of the steps from `first` to `end` - 1.

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
        patch = self._nearest_patches.of(rows.column(Column.X), rows.column(Column.Y))
        sightings = SightingRows(rows.column(Column.STEP), rows.column(Column.IDENTITY), patch)
        return gather(first, self.bin_steps, self.patches, bins, sightings, users)

    def exposure(self, first: int, end: int) -> I64:
        """Return how much of each room each robot had in view in the steps `first` to `end` - 1.

        It is only summed if a component declared before the run that it needs it.

        Raises:
            ComponentError: No sums were stored at `first` or `end`.
        """
        none = np.zeros_like(next(iter(self._exposures.values())))
        return _known_at(self._exposures, end, none) - _known_at(self._exposures, first, none)


def _known_at(sums: Mapping[int, I64], step: int, zero: I64) -> I64:
    """Return the sums up to before a step."""
    if step in sums or step == 0 or not sums:  # without cameras there are no sums
        return sums.get(step, zero)
    raise ComponentError(
        f"exposure and looks are summed from update to update, and none is at step {step}: request"
        f" them between the updates at {', '.join(map(str, sorted(sums)[-5:]))}, or use evidence"
    )
