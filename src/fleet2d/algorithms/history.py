"""Histories: stretches of steps of a run, as algorithms and metrics may know them.

They read the log of the run: poses, observations and events, as far back as components may look.
"""

from bisect import bisect_left, bisect_right
from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass, replace
from functools import cached_property
from math import dist
from operator import itemgetter
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from fleet2d.algorithms.observations import (
    NOWHERE,
    Activities,
    Looks,
    NearestRooms,
    Observations,
    SightingTable,
    Truth,
    frozen,
)
from fleet2d.errors import ComponentError
from fleet2d.floorplan.home import Home
from fleet2d.floorplan.plan import read_only
from fleet2d.kernels import (
    F64,
    I16,
    I32,
    I64,
    Bool,
    Poses,
    Window,
    count_together,
    in_radians,
    rooms_at,
    sum_moves,
)
from fleet2d.runtime.clock import DAY_S, Clock
from fleet2d.runtime.events import HOME, Event, EventKind

if TYPE_CHECKING:
    from fleet2d.algorithms.evidence import Evidence, Patches
    from fleet2d.interactions.answers import AnswerRecord, Answers, Wanted


class Blocks:
    """Consecutive arrays, or `SightingTable`, each for an interval of steps.

    Arrays only differ in their first dimension.

    Example:
        >>> blocks = Blocks()
        >>> blocks.append(0, 2, np.array([1, 2]))
        >>> blocks.append(2, 5, np.array([3, 4, 5]))
        >>> blocks.touching(1, 3)
        (0, [array([1, 2]), array([3, 4, 5])])
        >>> blocks.forget(2)
        >>> blocks.touching(0, 9)
        (2, [array([3, 4, 5])])
    """

    def __init__(self) -> None:
        """Begin without blocks."""
        self._blocks: list[tuple[int, int, Any]] = []  # begin, end, rows

    def append(self, begin: int, end: int, rows: NDArray[Any] | SightingTable) -> None:
        """Append the rows of the stretch from `begin` up to before `end`, the latest so far."""
        self._blocks.append((begin, end, rows))

    def touching(self, begin: int, end: int) -> tuple[int, list[Any]]:
        """Return the blocks that overlap a stretch of time, and where the first one begins."""
        first = bisect_right(self._blocks, begin, key=itemgetter(1))
        blocks = self._blocks[first : bisect_left(self._blocks, end, key=itemgetter(0))]
        return blocks[0][0] if blocks else begin, [rows for _, _, rows in blocks]

    def forget(self, before: int) -> None:
        """Drop the blocks that end by `before`."""
        del self._blocks[: bisect_right(self._blocks, before, key=itemgetter(1))]


class BodyPoses:
    """Poses of one body, one entry per step; columns are computed on demand."""

    def __init__(self, home: Home, runs: Window) -> None:
        self._home = home
        self._runs = runs

    def __len__(self) -> int:
        """Return the number of steps."""
        return self._runs.end - self._runs.first

    @cached_property
    def _lengths(self) -> I64:
        """Number of steps of each run of equal pose."""
        return np.diff(self._runs.step, append=self._runs.end)

    @cached_property
    def xy(self) -> F64:
        """Positions: float64 (n, 2) [m]; while away, the place at which the body left."""
        lattice = self._home.plan.lattice
        xy = lattice.to_metres(np.stack([self._runs.x, self._runs.y], axis=-1))
        return read_only(np.repeat(xy, self._lengths, axis=0))

    def at(self, index: int) -> tuple[float, float]:
        """Return the position (x, y) [m] at one step; -1 is the last."""
        runs = self._runs
        step = runs.first + range(len(self))[index]
        run = int(np.searchsorted(runs.step, step, side="right")) - 1
        x, y = self._home.plan.lattice.to_metres((runs.x[run], runs.y[run])).tolist()
        return x, y

    @property
    def x(self) -> F64:
        """Positions along x [m]."""
        return self.xy[:, 0]

    @property
    def y(self) -> F64:
        """Positions along y [m]."""
        return self.xy[:, 1]

    @cached_property
    def heading(self) -> F64:
        """Headings, counter-clockwise from +x, 0 to 2 pi [rad]."""
        radians: F64 = in_radians(self._runs.heading)
        return read_only(np.repeat(radians, self._lengths))

    @cached_property
    def away(self) -> Bool:
        """Whether the body is away from home: bool (n,)."""
        return read_only(np.repeat(self._runs.away.astype(bool), self._lengths))

    @cached_property
    def room(self) -> I16:
        """Index of the room, NOWHERE while the body is away: int16 (n,)."""
        return read_only(np.repeat(self._rooms, self._lengths))

    @cached_property
    def _rooms(self) -> I16:
        """Index of the room of each run."""
        runs = self._runs
        room = rooms_at(self._home.plan.room_of_place, runs.x, runs.y)
        return np.where(runs.away != 0, np.int16(NOWHERE), room)

    @cached_property
    def visits(self) -> tuple[I64, I64, I16]:
        """Stretches of steps in one room: begin, end and room of each, each (stretches,).

        Steps are counted from `first`; the room is NOWHERE while the body is away.
        """
        rooms = self._rooms
        first = np.flatnonzero(np.append(True, rooms[1:] != rooms[:-1])[: len(rooms)])
        begin = self._runs.step[first] - self._runs.first
        return frozen((begin, np.append(begin, len(self))[1:], rooms[first]))

    @cached_property
    def time_in_rooms(self) -> I64:
        """Number of steps in each room, and last away: int64 (rooms + 1,)."""
        begin, end, room = self.visits
        counts = np.zeros(len(self._home.rooms) + 1, np.int64)
        np.add.at(counts, room, end - begin)  # NOWHERE is the last
        return read_only(counts)

    @cached_property
    def steps_at_home(self) -> int:
        """Number of steps at which the body isn't away."""
        return int(self._lengths[self._runs.away == 0].sum())

    def steps_together(self, other: "BodyPoses") -> int:
        """Return the number of steps at which two bodies are in the same room."""
        begin, _, room = self.visits
        other_begin, _, other_room = other.visits
        return count_together(begin, room, other_begin, other_room, len(self))

    @cached_property
    def distance(self) -> float:
        """Distance travelled from the first to the last step, but through portals [m]."""
        runs = self._runs
        plan = self._home.plan
        poses = Poses(runs.x, runs.y, runs.heading, runs.away)
        return sum_moves(poses, plan.portal_ends) / plan.lattice.units_per_m

    def distance_from(self, place: tuple[float, float]) -> float:
        """Return the distance of the first step from a place before it, but through portals [m]."""
        plan = self._home.plan
        if not plan.portals:
            return dist(place, self.at(0))
        x, y = plan.lattice.to_lattice([place, self.at(0)]).T.copy()
        poses = Poses(x, y, np.zeros_like(x), np.zeros(2, np.uint8))
        return sum_moves(poses, plan.portal_ends) / plan.lattice.units_per_m


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


class PoseBelief(Protocol):
    """Protocol of a robot's beliefs about its own poses."""

    def believed(self, runs: Window) -> Window:
        """Return the poses that it believes it has, given the true ones."""


class Log:
    """The motions and observations of a run, as far back as components may look."""

    def __init__(
        self,
        home: Home,
        clock: Clock,
        names: Sequence[str],
        motions: Motions,
        activities: Activities,
    ) -> None:
        """Begin an empty log.

        Args:
            home: The home.
            clock: The steps of the run.
            names: Names of the bodies, users first.
            motions: The motions of the bodies.
            activities: What users do.
        """
        self.home = home
        self.clock = clock
        self.index = {name: row for row, name in enumerate(names)}
        self.activities = activities
        self.answers: Sequence[AnswerRecord] = ()  # how people answered: truth
        self.wanted: Sequence[Wanted] = ()  # the requests that came up
        self.answer_models: Mapping[str, Answers] = {}  # of each user: truth
        self._motions = motions
        self._observations = Blocks()  # SightingTable, by step
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
        self.untracked: frozenset[str] = frozenset()  # users whose place may be unknown
        self.beliefs: dict[str, PoseBelief] = {}  # of robots with `localization`
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
            path = runs if true else self.beliefs[name].believed(runs)
            self._poses[key] = BodyPoses(self.home, path)
        return self._poses[key]

    def observe(self, seen: SightingTable) -> None:
        """Store the observations of a span."""
        if len(seen):
            self._observations.append(int(seen.step[0]), int(seen.step[-1]) + 1, seen)

    def observations(self, first: int, end: int) -> Observations:
        """Return the observations of the steps from `first` to `end` - 1."""
        _, blocks = self._observations.touching(first, end)
        blocks = [block.between(first, end) for block in blocks]
        return Observations(self.home.plan, self._rooms, blocks, self.activities)

    def count_looks(self, step: int, counts: Sequence[I64]) -> None:
        """Store how often each robot's cameras have looked and noticed before `step`."""
        if counts:
            self._looks[step] = np.concatenate(counts)

    def looks(self, first: int, end: int) -> Looks:
        """Return the looks in the steps from `first` to `end` - 1.

        Raises:
            ComponentError: No counts were stored at `first` or `end`.
        """
        none = np.zeros((len(self.cameras), self.activities.users, 2), np.int64)
        counts = _known_at(self._looks, end, none) - _known_at(self._looks, first, none)
        robots = np.array([robot for robot, _ in self.cameras], np.int32)
        names = tuple(name for _, name in self.cameras)
        return Looks(robots, names, counts[..., 0], counts[..., 1])

    def expose(self, step: int, exposure: I64) -> None:
        """Store how much of each room each robot has had in view before `step`."""
        self._exposures[step] = exposure

    def expose_bins(self, bins: I64) -> None:
        """Store the cells in view of each robot in the next bins: int64 (n, robots, 2, patches).

        Entry 0 is the number of cells of each patch in view, summed over the steps of the bin;
        entry 1 the maximum over them.
        """
        begin = self._next_bin
        self._next_bin = begin + len(bins)
        self._bins.append(begin, self._next_bin, bins)

    def evidence(self, first: int, end: int, known_from: int = 0) -> "Evidence":
        """Return the evidence of the steps from `first` to `end` - 1.

        Bins that begin before `known_from` are as if nobody had looked.

        Raises:
            ComponentError: The steps aren't whole bins.
        """
        assert self.patches is not None, "nobody needs evidence"
        if first % self.bin_steps or end % self.bin_steps:
            raise ComponentError(
                f"evidence comes in bins of {self.bin_steps} steps, but the period from step"
                f" {first} to {end} isn't made of whole ones: choose a period of whole minutes"
            )
        begin = first // self.bin_steps
        last = end // self.bin_steps
        since, blocks = self._bins.touching(begin, last)
        bins = blocks[0] if len(blocks) == 1 else np.concatenate(blocks)  # often no copy
        bins = bins[begin - since : last - since]
        if self._nearest_patches is None:
            self._nearest_patches = NearestRooms(self.home.plan, self.patches.of_cell)
        blank = (
            min(-(-known_from // self.bin_steps), last) - begin
        )  # bins of which it knows nothing
        if blank > 0:
            bins = bins.copy()
            bins[:blank] = 0
        seen = self.observations(first + max(blank, 0) * self.bin_steps, end)
        observed = seen.placed_in(self._nearest_patches)
        users = self.activities.users
        from fleet2d.algorithms.evidence import gather  # few algorithms need it

        return gather(self.clock, first, self.bin_steps, self.patches, bins, observed, users)

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


@dataclass(frozen=True)
class Readings:
    """Readings of sensors, in order of step; all arrays of one length.

    Attributes:
        step: int64 (n,), the step of each reading.
        sensor: int32 (n,), index of the sensor, in the order of the scenario.
        on: bool (n,), True where the sensor went on (or open), False where off (or shut).
    """

    step: I64
    sensor: I32
    on: Bool


@dataclass(frozen=True)
class History:
    """The steps since the last update of a component, `first` to `end` - 1.

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
    visible: frozenset[str]  # names of the bodies whose poses the component may read
    oldest: int = 0  # the first step that is stored for components that look back
    needs: frozenset[str] = frozenset()  # `needs` of the component's class
    known_from: int = 0  # the first step of which it knows anything; see `Learner`

    def between(self, first: int, end: int) -> "History":
        """Return the history of the steps from `first` to `end` - 1.

        The component's class declares by `looks_back` how far back that may be.

        Raises:
            ComponentError: These steps are no longer stored, or are yet to come.

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
                f"the steps from {first} to {end} were requested, but only those from"
                f" {self.oldest} to {self.end} are stored: set looks_back in the class to how far"
                " back it looks"
            )
        return replace(self, first=first, end=end)

    def __len__(self) -> int:
        """Return the number of steps."""
        return self.end - self.first

    @property
    def days(self) -> float:
        """How long its steps last [days]."""
        return len(self) * self.step_s / DAY_S

    @cached_property
    def observations(self) -> Observations:
        """The sightings of the robots."""
        return self.log.observations(max(self.first, min(self.known_from, self.end)), self.end)

    @cached_property
    def readings(self) -> Readings:
        """The readings of sensors."""
        first = max(self.first, self.known_from)
        rows = [row for row in self.log.readings if first <= row.step < self.end]
        return Readings(
            frozen(np.array([row.step for row in rows], np.int64)),
            frozen(np.array([row.sensor for row in rows], np.int32)),
            frozen(np.array([row.on for row in rows], np.bool_)),
        )

    @cached_property
    def events(self) -> list[Event]:
        """The events of the visible bodies, in order of step; for algorithms those of robots."""
        events = self.log.events(max(self.first, self.known_from), self.end)
        return [event for event in events if event.entity in self.visible]

    @cached_property
    def truth(self) -> Truth:
        """The truth, row by row of the observations; for metrics only.

        Raises:
            ComponentError: The component is an algorithm.
        """
        self._check_metric("truth")
        return frozen(Truth.behind(self.observations))

    @cached_property
    def answers(self) -> "list[AnswerRecord]":
        """The answers of people to robots, and the attitudes after them; for metrics only.

        Raises:
            ComponentError: The component is an algorithm.
        """
        self._check_metric("answers")
        return [record for record in self.log.answers if self.first <= record.step < self.end]

    @cached_property
    def answer_models(self) -> "Mapping[str, Answers]":
        """How each user answers, if any robot wants something of people; for metrics only.

        Raises:
            ComponentError: The component is an algorithm.
        """
        self._check_metric("answer_models")
        return self.log.answer_models

    @cached_property
    def wanted(self) -> "list[Wanted]":
        """The requests of robots to people."""
        return [record for record in self.log.wanted if self.first <= record.step < self.end]

    @cached_property
    def looks(self) -> Looks:
        """How often each camera had a user in view, and how often it noticed; for metrics only.

        Raises:
            ComponentError: The component is an algorithm.
        """
        self._check_metric("looks")
        return frozen(self.log.looks(self.first, self.end))

    @cached_property
    def exposure(self) -> I64:
        """Cells of each room in view of each robot, summed over the steps: (robots, rooms).

        Divided by the room's number of cells and by the number of steps, it is the mean share of
        the room that was in view.

        Raises:
            ComponentError: The component's class has no needs = {"exposure"}.
        """
        self._check_needs("exposure")
        return frozen(self.log.exposure(self.first, self.end))

    @cached_property
    def evidence(self) -> "Evidence":
        """The views of robots, and the users they perceived there, minute by minute.

        Raises:
            ComponentError: The component's class has no needs = {"evidence"}, or its period is no
                whole number of minutes.
        """
        self._check_needs("evidence")
        return self.log.evidence(self.first, self.end, self.known_from)

    def _check_needs(self, need: str) -> None:
        if need not in self.needs:
            raise ComponentError(
                f"{need} was requested, but is only computed for components that declare it: write"
                f" needs = {{{need!r}}} in the class of the component"
            )

    def _check_metric(self, need: str) -> None:
        if not self._sees_all:
            raise ComponentError(
                f"'{need}' is ground truth: algorithms can't read it, only metrics can"
            )

    def poses(self, name: str) -> BodyPoses:
        """Return the poses of a body. Algorithms may read those of robots, metrics also of users.

        For a robot with `localization`, algorithms get its believed poses, metrics the true ones.

        Raises:
            ComponentError: There is no such body, or it is a user and the component an algorithm.
        """
        if name not in self.visible:
            available = ", ".join(sorted(self.visible))
            is_user = name in self.log.index
            reason = "only metrics know where users are" if is_user else "there is no such body"
            raise ComponentError(
                f"poses of {name!r} were requested, but {reason}; available: {available}"
            )
        return self.log.poses(name, self.first, self.end, true=self._sees_all)

    @cached_property
    def _sees_all(self) -> bool:
        """Whether it is the history of a metric, to which all bodies are visible."""
        return self.visible == frozenset(self.log.index)
