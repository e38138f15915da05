"""The cameras of a body in a run: their memory from span to span, and their sightings.

The look is compiled. This module has its tables, the effect of interventions on them, and methods
of sight in Python.
"""

import math
from collections.abc import Iterable, Iterator, Sequence, Set
from dataclasses import replace
from fractions import Fraction
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fleet2d.algorithms.observations import OBSERVATION, ActivitySense, SightingTable
from fleet2d.engine.basis import Watcher
from fleet2d.entities.behavior import Actor, SightEvent
from fleet2d.entities.body import Bodies, poses_of
from fleet2d.entities.equipment import Drift, Localization
from fleet2d.errors import ComponentError, PlacementError, ScenarioError, blame, errors_as
from fleet2d.floorplan.home import Home
from fleet2d.kernels import (
    FORCED_IDENTITY,
    FORCED_MISS,
    I64,
    MAX_GHOSTS,
    NOBODY,
    SUB,
    U64,
    About,
    DetectionRule,
    GhostDraw,
    Lenses,
    PoseBlock,
    Poses,
    Reach,
    SightingColumn,
    SightMemory,
    UserDraw,
    detect,
    new_memory,
    view_queries,
)
from fleet2d.kernels import ViewQueryColumn as Query
from fleet2d.runtime.clock import DAY_US
from fleet2d.runtime.events import Event, new_event
from fleet2d.runtime.local_time import even_parts, stamp_us
from fleet2d.sight.camera import (
    Camera,
    Disturbance,
    TableContext,
    error_tables,
    is_perfect,
    stack_lenses,
)
from fleet2d.sight.fov import FieldOfView
from fleet2d.sight.perception import Perception

if TYPE_CHECKING:
    from fleet2d.engine.heights import BodyHeights
    from fleet2d.entities.keep_out import SleepMemory
    from fleet2d.entities.robots.policy import SightingMemory

# The squared range of a dark camera, below all distances.
NO_RANGE = -1
# The chance of a lens that notices all bodies in view.
CERTAIN = 2**53
# Methods may round points to cells, so points this far outside the field of view are checked, too.
SLACK = 2 * SUB
# The name of the random stream of each draw.
USER_STREAMS = {
    UserDraw.DETECT: "detect",
    UserDraw.ATTEND: "attend",
    UserDraw.IDENTIFY: "identify",
    UserDraw.MISTAKE: "whom",
    UserDraw.RANGE: "range",
    UserDraw.BEARING: "bearing",
    UserDraw.HEADING: "heading",
    UserDraw.POSTURE: "posture",
}
GHOST_STREAMS = {
    GhostDraw.COUNT: "how many",
    GhostDraw.SOURCE: "which",
    GhostDraw.PLACE: "where",
    GhostDraw.IDENTITY: "looks like",
    GhostDraw.HEADING: "faces",
}

NOTHING = SightingTable.of_rows(np.zeros((0, OBSERVATION), np.int64))
UNSEEN = SightingTable.of_rows(np.zeros((0, len(SightingColumn)), np.int64))


class SightSetup(NamedTuple):
    """The settings that the cameras of all bodies of a run share.

    Attributes:
        actors: All bodies, users first.
        users: Number of users among them.
        method: The method of sight; None: lines of sight, which the core follows.
        radii: Radii of all bodies, if they hide each other [lattice units]; None: they don't.
        heights: Heights of bodies and furniture, if they matter; None: they don't.
    """

    actors: Sequence[Actor]
    users: int
    method: FieldOfView | None
    radii: I64 | None
    heights: "BodyHeights | None"


class Cameras(Watcher):
    """The cameras of one body. Robots look at users; a user who has a camera looks at robots.

    Attributes:
        owner: The body with the cameras.
        row: The owner's row among the bodies.
        index: The owner's index among the robots, or among the users.
        event_names: The event kinds (lost, seen) of these cameras.
        others: The bodies that can be seen.
        names: Names of the cameras.
        errs: Whether observations can differ from the truth.
        activity_senses: The perception of activities by each camera.
        shared: The settings shared with the cameras of other bodies.
        method, radii, heights: See `SightSetup`.
        memory: The memory from span to span.
        drift: The error of the owner's belief about its own pose; None: no error.
        sighting_errors: The errors that change sightings after the look; None: no errors.
        perceived: The last perceived place of each identity, (identities, 2); the last row is for
            somebody unknown.
        awaited: Events that algorithms wait for, which end a span, too.
        remembered: The owner's memory of its sightings.
        next_step: The first step at which the cameras have not looked.
        knows_truth: Whether the truth behind its sightings is known.
        notes: Remarks on the source of sightings.
    """

    hears_plans = False
    knows_truth = True
    notes: tuple[str, ...] = ()
    _levels: tuple[I64, I64, I64]  # heights of cameras and bodies, if heights matter

    def __init__(self, row: int, shared: SightSetup) -> None:
        """Set up the cameras of the body in a row.

        Raises:
            ScenarioError: A period is not a multiple of the step, or an unknown body is named.
        """
        actors, users, self.method, self.radii, self.heights = self.shared = shared
        self.owner = actors[row]
        self.row = row
        self.event_names = self.owner.entity.sight_events
        is_robot = row >= users
        self.index = row - users if is_robot else row
        self._first = 0 if is_robot else users
        self.disturbances: list[Disturbance] = []
        self.activity_senses: list[ActivitySense] = []
        self.may_err = False  # interventions may cause errors
        self.others = actors[:users] if is_robot else actors[users:]
        self.memory = self._set_up()
        self.perceived = np.zeros((len(self.others) + 1, 2), np.int64)
        self.awaited: Set[str] = frozenset()
        self.remembered: list[SightingMemory | SleepMemory] = []
        self._sightings: list[SightingTable] = []  # not collected yet
        self._ahead: Look | None = None

    def expect_disturbances(self) -> None:
        """Let observations be stored beside the truth, because interventions will disturb them."""
        self.may_err = self.errs = True

    def disturb(self, disturbances: Sequence[Disturbance]) -> None:
        """Set all disturbances, from the next look on."""
        lasting = [each for each in self.disturbances if each.injected is None]
        self.disturbances = list(disturbances)
        is_same = lasting == [each for each in disturbances if each.injected is None]
        memory = self._inject() if is_same else self._set_up()
        self.memory = carry_over(memory, self.memory, self._forced())

    def forget(self) -> list[str]:
        """Forget the people in view, and sightings not known yet; return the people."""
        in_view = np.flatnonzero(self.memory.seen).tolist()
        names = [self.name_of(identity) for identity in in_view]
        self.memory.seen[:] = 0
        self.memory.noticed[:] = -1
        self.memory.waiting[:] = 0
        return names

    def _disturbed(self) -> Iterator[tuple[int, Disturbance]]:
        """Yield the number of each camera with each of its disturbances, in order."""
        for c, name in enumerate(self.names):
            for disturbance in self.disturbances:
                if disturbance.is_of(name):
                    yield c, disturbance

    def _forced(self) -> I64:
        """Return the forced identity of each body in view, (cameras, bodies); see About.FORCED."""
        index = self.identities
        forced = np.zeros((len(self.names), len(self.others)), np.int64)
        for c, disturbance in self._disturbed():
            if disturbance.missed is not None:
                forced[c, index[disturbance.missed]] = FORCED_MISS
            if disturbance.mistaken is not None:
                user, other = disturbance.mistaken
                forced[c, index[user]] = FORCED_IDENTITY + index[other]
        return forced

    def _set_up(self) -> SightMemory:
        owner = self.owner
        lattice = owner.home.lattice
        clock = owner.clock
        cameras = owner.entity.eyes
        self.names = tuple(cameras)
        units = lattice.units_per_m
        with errors_as(ScenarioError, owner.path, of=ValueError):
            lenses = [camera.lens(units, clock.step_us) for camera in cameras.values()]
        perceptions = self._perceptions_of(cameras.values())
        has_errors = [not is_perfect(perception) for perception in perceptions]
        self.drift = _drift_of(owner)
        radii = [other.entity.radius * units for other in self.others]
        context = TableContext(self.other_names, radii, lattice, clock.step_us, owner.path)
        self.lenses = stack_lenses(lenses, has_errors, context)
        if self.heights is not None:
            points = self.lenses.bodies.shape[2]
            self._levels = self.heights.levels(self.row, cameras.values(), self._rows, points)
        self._perceptions = perceptions
        self._patience = max(lens.patience for lens in lenses)
        errors = [p if errs else None for p, errs in zip(perceptions, has_errors, strict=True)]
        self.errors = error_tables(lenses, errors, context)
        self._dim()
        self.sighting_errors = None
        if self.drift is not None or any(p and p.errors for p in perceptions):
            from fleet2d.engine.sighting_errors import SightingErrors  # few runs need them

            self.sighting_errors = SightingErrors(self, perceptions)
        self.errs = self.may_err or any(has_errors) or self.sighting_errors is not None
        self._draw_streams()
        if not self.activity_senses:  # later ones would not fit the tables of the run
            self._sense_activities(perceptions)
        return self._inject()

    def _perceptions_of(self, cameras: Iterable[Camera]) -> list[Perception | None]:
        """Return the errors of each camera; errors of disturbances replace its own."""
        common = getattr(self.owner.entity, "perception", None)  # users have no errors
        perceptions = [camera.perception or common for camera in cameras]
        _check_spots(self.owner, perceptions)
        for c, disturbance in self._disturbed():
            perceptions[c] = disturbance.errs or perceptions[c]
        return perceptions

    def _dim(self) -> None:
        """Let disturbances darken cameras, or lower their chance of noticing somebody."""
        self._dark = [c for c, disturbance in self._disturbed() if disturbance.dark]
        self.lenses.widest[self._dark] = NO_RANGE
        self.errors.has_ghosts[self._dark] = 0
        chances = self.lenses.chance
        for c, disturbance in self._disturbed():
            chance = Fraction(int(chances[c])) * Fraction(disturbance.detection)
            chances[c] = round(chance)

    def _inject(self) -> SightMemory:
        """Set the false sightings of interventions; return an empty memory with room for them."""
        index = self.identities
        lattice = self.owner.home.lattice
        rows = []
        for c, disturbance in self._disturbed():
            sighting = disturbance.injected
            if sighting is not None and c not in self._dark:
                x, y = lattice.point_at((sighting.x, sighting.y))
                rows.append((c, index[sighting.user], x, y, sighting.heading))
        injected = np.array(rows, np.int64).reshape(-1, 5)
        self.errors = self.errors._replace(injected=injected)
        clock = self.owner.clock
        count = len(self.others)
        bursts = count + MAX_GHOSTS * self.errors.has_ghosts + len(injected)
        self.rule = DetectionRule(
            patience=self._patience,
            step_us=clock.step_us,
            start_us=stamp_us(clock.start) % DAY_US,
            burst=int(bursts.sum()),
            stop_lost=False,
            stop_seen=False,
        )
        looks = self.lenses.latency // self.lenses.period + 2
        backlog = int((looks * bursts).max())
        return new_memory(len(self.names), count, backlog)

    def _draw_streams(self) -> None:
        """Set the random stream of each draw by name, so that further users don't change it."""
        stream = self.owner.stream
        errors = self.errors
        draws = list(UserDraw) if self.errs else [UserDraw.DETECT]
        for c, camera in enumerate(self.names):
            prefix = "" if self.names == ("camera",) else f"{camera}: "
            for u, other in enumerate(self.others):
                for draw in draws:
                    purpose = f"{prefix}{USER_STREAMS[draw]} {other.name}"
                    errors.keys[c, u, draw.value] = stream(purpose)
            for ghost_draw, what in GHOST_STREAMS.items():
                purpose = f"{prefix}{what}, false positives"
                errors.ghost_keys[c, ghost_draw.value] = stream(purpose)

    def _sense_activities(self, perceptions: Sequence[Perception | None]) -> None:
        """Set the perception of activities of each camera."""
        latencies = self.lenses.latency.tolist()
        for name, perception, latency in zip(self.names, perceptions, latencies, strict=True):
            keys = [self.owner.stream(f"{name}: activity {other}") for other in self.other_names]
            confusion = perception.attributes.activity if perception else None
            sense = ActivitySense(latency, np.array(keys, np.uint64), confusion)
            self.activity_senses.append(sense)

    @property
    def _rows(self) -> slice:
        """The rows of the bodies that can be seen."""
        return slice(self._first, self._first + len(self.others))

    @property
    def other_names(self) -> list[str]:
        """The names of the bodies that can be seen."""
        return [other.name for other in self.others]

    @property
    def identities(self) -> dict[str, int]:
        """The identity of each name; the empty name is somebody unknown."""
        return {name: u for u, name in enumerate(self.other_names)} | {"": NOBODY}

    @property
    def ends(self) -> tuple[bool, bool]:
        """Whether a span ends at USER_LOST, when a body is lost, and at USER_SEEN."""
        heard = self.awaited | self.owner.plan.interrupts
        lost, seen = self.event_names
        return lost in heard, seen in heard

    @property
    def waits(self) -> bool:
        """Whether an event of these cameras may end the present span."""
        names = self.event_names
        is_awaited = not self.awaited.isdisjoint(names)
        return is_awaited or not self.owner.plan.interrupts.isdisjoint(names)

    @property
    def counts(self) -> I64:
        """Numbers of looks with a user in view, and noticed: (cameras, users, 2)."""
        return self.memory.about[..., [About.IN_VIEW.value, About.NOTICED.value]]

    @property
    def in_view(self) -> dict[str, tuple[float, float]]:
        """The last perceived place [m] of each body in view, by name, when it last looked."""
        seen = self.memory.seen.tolist()
        if 1 not in seen:  # policies ask often, so this case is quick
            return {}
        xy_of = self.owner.home.lattice.xy_of
        places = self.perceived.tolist()
        identities = [identity for identity, is_seen in enumerate(seen) if is_seen]
        return {self.name_of(identity): xy_of(*places[identity]) for identity in identities}

    def name_of(self, identity: int) -> str:
        """Return the name of an identity; empty for somebody unknown."""
        return self.others[identity].name if identity < len(self.others) else ""

    def perfect(self, first: int) -> "PerfectCameras":
        """Return cameras that notice all bodies in view at each step, from `first` on."""
        perfect = PerfectCameras(self.row, self.shared)
        perfect.next_step = first
        return perfect

    def limit(self, bodies: Bodies, end: int) -> int:
        """Return the step after the first event that ends the span, or `end` if there is none."""
        if end <= self.next_step:
            return end
        self._ahead = self._look(bodies, end)
        return self._ahead.end

    def take(self, bodies: Bodies, end: int) -> Sequence[Event]:
        """Look in the steps from `next_step` to `end` - 1; return the events of seeing and losing.

        Cameras that looked beyond `end` before another watcher ended the span look again.
        """
        result = self._ahead
        self._ahead = None
        if result is not None and result.looked != end:
            for array, old in zip(self.memory, result.old_memory, strict=True):
                array[:] = old
            result = None
        if result is None:
            result = self._look(bodies, end, stop=False)
        seen = result.sightings
        self.next_step = end
        if len(seen):
            self._sightings.append(seen)
            for memory in self.remembered:
                memory.take(seen.step, seen.index, seen.distinct)
            places = seen.distinct[:, SightingColumn.X : SightingColumn.Y + 1]
            for identity, number in enumerate(result.newest):
                if number >= 0:
                    self.perceived[identity] = places[number]
        names = self.event_names
        entity = self.owner.name
        return [
            new_event((step, entity, names[kind], self.name_of(identity)))
            for step, identity, kind in result.events
        ]

    def interruptions(self, events: Sequence[Event]) -> Iterator[tuple[int, SightEvent]]:
        """Yield the events of the last step that end the owner's plan."""
        if not events:
            return
        stops = self.owner.plan.interrupts
        xy_of = self.owner.home.lattice.xy_of
        identities = self.identities
        for event in events:
            if event.step == self.next_step - 1 and event.event in stops:
                identity = identities.get(event.detail, NOBODY)
                x, y = xy_of(*self.perceived[identity].tolist())
                yield self.row, SightEvent(event.event, event.detail, x, y)

    def collect(self) -> SightingTable:
        """Return the sightings since the last call, with the columns of observations."""
        blocks = self._sightings
        self._sightings = []
        if not blocks:
            return NOTHING
        seen = SightingTable.joined(blocks)
        robot = np.full((1, len(seen.distinct)), self.index)
        columns = np.concatenate([seen.distinct.T, robot])
        return replace(seen, distinct=columns.T)

    def _look(self, bodies: Bodies, end: int, *, stop: bool = True) -> "Look":
        first = self.next_step
        home = self.owner.home
        if home.unlit and self.sighting_errors is None and self._first == 0:
            from fleet2d.engine.sighting_errors import SightingErrors  # few runs need them

            self.sighting_errors = SightingErrors(self, self._perceptions)
        may_redo = stop or self.sighting_errors is not None
        old_memory = [array.copy() for array in self.memory] if may_redo else []
        stops = self.ends if stop else (False, False)
        window = bodies.window(first, end)
        clock = self.owner.clock
        if clock.zone is not None:
            now_us = first * clock.step_us
            _, _, start_us = next(even_parts(clock.start, now_us, now_us + 1))
            self.rule = self.rule._replace(start_us=start_us % DAY_US)
        points = None if self.method is None else self._points_seen(self.method, bodies, end)
        heights = None
        if self.heights is not None:
            heights = self.heights.with_furniture(self._levels, home)
        count, seen_at, index, distinct, newest, events = detect(
            home.walls,
            self.lenses,
            self.errors,
            DetectionRule(*self.rule[:-2], *stops),
            window,
            self.row,
            self._first,
            self.memory,
            points,
            self.radii,
            heights,
        )
        sightings = SightingTable(seen_at, index, distinct.T) if len(seen_at) else UNSEEN
        end = looked = first + count
        if self.sighting_errors is not None:
            before = SightMemory(*old_memory)
            seen = sightings.rows()
            rows, differs = self.sighting_errors.change(seen, self.memory, before, window, looked)
            sightings = SightingTable.of_rows(rows)
            newest = newest_of(rows, len(newest))
            if differs:
                patience = self.rule.patience
                events = self.sighting_errors.events(rows, self.memory, patience, first, looked)
                end = end_of_span(events, stops, looked)
        return Look(looked, end, sightings, newest, events, old_memory)

    def _points_seen(self, method: FieldOfView, bodies: Bodies, end: int) -> U64:
        """Return the points that a method of sight sees until a step; see `points_seen`.

        Raises:
            ComponentError: The method returned a wrong type or shape.
        """
        first = self.next_step
        block = bodies.block(first, end)
        crowd = PoseBlock._make(column[self._rows] for column in block)
        poses = poses_of(block, self.row)
        owner = self.owner
        lenses = self.lenses._replace(widest=np.maximum(self.lenses.widest, 0))
        with blame("sight.method", first):
            points = points_seen(
                method, owner.home, lenses, poses, crowd, first, owner.clock.step_us
            )
        points[self._dark] = 0
        return points


def _check_spots(owner: Actor, perceptions: Sequence[Perception | None]) -> None:
    """Refuse spots, which are mistaken for people, outside of the home.

    Raises:
        PlacementError: There is such a spot.
    """
    for perception in filter(None, perceptions):
        for number, spot in enumerate(perception.false_positives.spots):
            place = f"{owner.path}: perception.false_positives.spots.{number}"
            with errors_as(PlacementError, place, of=PlacementError):
                owner.home.plan.check_inside(*spot.at)


def _drift_of(owner: Actor) -> Drift | None:
    """Return the error of a body's belief about its own pose; None: no error."""
    settings: Localization | None = getattr(owner.entity, "localization", None)
    if settings is None:
        return None
    units_per_m = owner.home.lattice.units_per_m
    step_us = owner.clock.step_us
    return Drift(settings, units_per_m, step_us, owner.seed, owner.path, owner.displacements)


class PerfectCameras(Cameras):
    """Cameras that look at every step, and notice all bodies in view at once."""

    def _set_up(self) -> SightMemory:
        memory = super()._set_up()
        lenses = self.lenses
        self.lenses = lenses._replace(
            chance=np.full_like(lenses.chance, CERTAIN),
            period=np.ones_like(lenses.period),
            latency=np.zeros_like(lenses.latency),
            errs=np.zeros_like(lenses.errs),
        )
        self.rule = self.rule._replace(patience=1)
        self.sighting_errors = None
        return memory

    def look(self, bodies: Bodies, end: int) -> Sequence[Event]:
        """Look in the steps up to `end` - 1; return the events of seeing and losing."""
        events = self.take(bodies, end)
        self.collect()
        return events


class Look(NamedTuple):
    """The result of a look up to step `looked` - 1, and the memory before the look.

    The span ends at `end`, which is earlier if an error changed who was seen when. `newest` has,
    for each identity, the number of its last sighting among the distinct ones, or -1 for none.
    """

    looked: int
    end: int
    sightings: SightingTable
    newest: list[int]
    events: list[tuple[int, int, int]]
    old_memory: list[I64]


def end_of_span(
    events: Sequence[tuple[int, int, int]], stops: tuple[bool, bool], looked: int
) -> int:
    """Return the step after the first event of a kind that ends the span; `looked`: none does."""
    return next((step + 1 for step, _, kind in events if stops[kind]), looked)


def newest_of(rows: I64, identities: int) -> list[int]:
    """Return the number of the last row of each identity, -1 for none."""
    newest = np.full(identities, -1)
    newest[rows[:, SightingColumn.IDENTITY]] = np.arange(len(rows))  # -1, unknown, is the last
    return newest.tolist()


def carry_over(memory: SightMemory, old: SightMemory, forced: I64) -> SightMemory:
    """Return the memory of cameras for other errors, with the content of the old memory.

    Args:
        memory: The new memory, of a robot that has seen nobody.
        old: The memory of the same cameras so far.
        forced: The identity as which each user in view is perceived from now on, (cameras, users).
    """
    about = old.about.copy()
    about[..., About.FORCED.value] = forced
    longest = int(old.waiting[:, 1].max(initial=0))
    rows = max(memory.backlog.shape[1], longest)
    backlog = np.zeros((len(about), rows, len(SightingColumn)), np.int64)
    waiting = np.zeros_like(old.waiting)
    for c in range(len(about)):
        rows_of_old = old.waiting_rows(c)
        backlog[c, : len(rows_of_old)] = old.backlog[c, rows_of_old]
        waiting[c, 1] = len(rows_of_old)
    return SightMemory(old.noticed, old.seen, about, backlog, waiting)


def points_seen(
    method: FieldOfView,
    home: Home,
    lenses: Lenses,
    robot: Poses,
    crowd: PoseBlock,
    first: int,
    step_us: int,
) -> U64:
    """Return which points of each body are in view of each camera at each step.

    Args:
        method: The method of sight.
        home: The home.
        lenses: The cameras.
        robot: The n poses of the owner of the cameras.
        crowd: The other bodies.
        first: The step of the first pose.
        step_us: Length of a step [us].

    Returns:
        uint64 (cameras, bodies, n), bit i for point i.

    Raises:
        ComponentError: The method doesn't return a bool for each point.
    """
    squares = [(math.isqrt(square) + SLACK) ** 2 for square in lenses.widest.ravel().tolist()]
    widest = np.array(squares, np.int64).reshape(lenses.widest.shape)
    queries, number = view_queries(
        lenses, widest, SLACK, robot, crowd.x, crowd.y, crowd.away, first, step_us
    )
    eyes = queries[:, : Query.EYE_HEADING + 1]
    has_moved = eyes[1:] != eyes[:-1]
    has_moved[:, Query.BODY] = False
    begins = np.flatnonzero(has_moved.any(axis=1)) + 1
    groups = np.split(queries, begins) if len(queries) else []
    answers = [_answers(method, home, lenses, group) for group in groups]
    return np.concatenate([np.zeros(1, np.uint64), *answers])[number]


def _answers(method: FieldOfView, home: Home, lenses: Lenses, queries: I64) -> U64:
    """Return which points of each body are in view, for one pose of one camera."""
    camera, _, x, y, heading = queries[0, : Query.EYE_HEADING + 1].tolist()
    ends = lenses.near_squared[camera], lenses.far_squared[camera], lenses.half_angle[camera]
    reach = Reach(*map(int, ends))
    count = int(lenses.points[camera]) + 1
    bodies = lenses.bodies[camera, queries[:, Query.BODY], :count]
    places = queries[:, None, [Query.BODY_X, Query.BODY_Y]]
    points = (bodies + places).reshape(-1, 2)
    flags: object = method.sees(home, x, y, heading, reach, points)  # a user's own may be wrong
    if not isinstance(flags, np.ndarray) or flags.dtype != bool or flags.shape != (len(points),):
        raise ComponentError(
            f"{type(method).__name__} returned {flags!r}, expected a bool array of shape"
            f" ({len(points)},), a value for each point"
        )
    in_view = flags.reshape(len(queries), -1)
    bits: U64 = np.uint64(1) << np.arange(in_view.shape[1], dtype=np.uint64)
    return in_view @ bits
