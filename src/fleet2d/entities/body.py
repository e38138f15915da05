"""Bodies: their settings in a scenario, their motion, and their places in a home."""

import copy
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from functools import partial
from typing import Any, ClassVar, NamedTuple, Protocol

import numpy as np
from pydantic import Field

from fleet2d import kernels
from fleet2d.configuration.components import Settings, components, lookup
from fleet2d.configuration.problems import suggest
from fleet2d.configuration.units import AngleDeg, Length, Speed, TurnRateDeg
from fleet2d.entities.drive import Differential, Drive, breakpoints, estimate
from fleet2d.entities.place import (
    ANY,
    Place,
    Point,
    RoomChoice,
    furniture_of,
    is_point,
    lies_in,
    matching_rooms,
    parse_place,
)
from fleet2d.errors import ComponentError, FloorPlanError, PlacementError, ScenarioError, blame
from fleet2d.floorplan.home import Home
from fleet2d.floorplan.lattice import LatticePoint
from fleet2d.floorplan.placed_objects import PlacedObject, Posture
from fleet2d.floorplan.plan import Room
from fleet2d.floorplan.slow_area import SlowRegion
from fleet2d.floorplan.space import Space
from fleet2d.kernels import (
    F64,
    I8,
    I64,
    TURN,
    Breakpoints,
    PoseBlock,
    Poses,
    Timelines,
    Window,
)
from fleet2d.runtime.clock import Clock
from fleet2d.runtime.determinism import Draws, stream_key
from fleet2d.sight.camera import Camera


class Pose(NamedTuple):
    """The pose of a body at one step.

    Attributes:
        x: Position [lattice].
        y: Position [lattice].
        heading: Counter-clockwise from +x [1/4096 turn].
        away: 1 if the body is out of the home, else 0.
    """

    x: int
    y: int
    heading: int
    away: int

    @property
    def position(self) -> LatticePoint:
        """The position of the body [lattice]."""
        return self.x, self.y


# A run has many poses: this makes one from a tuple of its fields without calling Python code.
new_pose: Callable[[tuple[int, int, int, int]], Pose] = partial(tuple.__new__, Pose)


@dataclass(frozen=True)
class Track:
    """A motion along known breakpoints."""

    breakpoints: Breakpoints
    step_us: int


@dataclass(frozen=True)
class RandomWalk:
    """A random walk, drawn step by step."""

    walls: kernels.Mesh
    space: kernels.Mesh
    rule: kernels.WalkRule


Motion = Track | RandomWalk


class KeepsOut(Protocol):
    """The zones that a body keeps out of: see `fleet2d.entities.keep_out.KeepOutRules`."""

    always: frozenset[int]
    no_stops: frozenset[int]

    @property
    def timed(self) -> Sequence[Any]:
        """The zones that are forbidden at some times."""

    @property
    def minds_sleep(self) -> bool:
        """Whether zones depend on where somebody sleeps."""

    def active(self, time: datetime, sleepers: frozenset[int]) -> frozenset[int]:
        """Return the zones of `timed` that are forbidden at a local time."""

    def changes_at(self, time: datetime) -> Iterator[datetime]:
        """Yield the times after a local time at which hours begin or end."""


class BodySettings(Settings):
    """A body in the home: its size, its speed, and its first pose.

    Attributes:
        radius: Radius of the body [m].
        height: Its height, standing [m], for `sight.heights`; left out: 1.7 m for a person, 0.3 m
            for a pet, 0.4 m for a robot.
        speed: Walking speed [m/s].
        turn_rate_deg: Rate of turning on the spot [deg/s].
        start: Its first place; left out: that of its behavior, else drawn.
        start_heading_deg: Heading at first, counter-clockwise from +x; left out: drawn.
        color: Color in pictures.
        opens_doors: Opens doors in its way; else a shut door is a wall to it.
    """

    radius: Length = Field(default=0.2, gt=0, le=2)
    height: Length | None = Field(default=None, gt=0, le=4)
    speed: Speed = Field(default=1.0, ge=0.01, le=20)
    turn_rate_deg: TurnRateDeg = Field(default=180.0, ge=0.01, le=36000)
    start: Place | None = None
    start_heading_deg: AngleDeg | None = None
    color: str | None = Field(default=None, min_length=1)
    opens_doors: bool = False
    # Whether all bodies of the class climb stairs and take lifts.
    uses_portals: ClassVar[bool] = False
    # Whether its routes are the cheapest by the costmap, if there is one, instead of the shortest.
    minds_costs: ClassVar[bool] = False
    # Whether wet floors, carpets and edges slow it down.
    minds_floor: ClassVar[bool] = False
    # Whether it sits or lies on furniture that a place names, instead of stopping before it.
    uses_furniture: ClassVar[bool] = False
    # The default height [m].
    usual_height: ClassVar[float] = 1.7
    # The events of its cameras: somebody is lost, somebody is seen.
    sight_events: ClassVar[tuple[str, str]]
    # The events about its requests to people.
    request_events: ClassVar[frozenset[str]] = frozenset()

    @property
    def climbs_stairs(self) -> bool:
        """Whether the body climbs stairs and takes lifts."""
        return self.uses_portals

    def keep_out_rules(self, body: "Body") -> KeepsOut | None:
        """Return the rules by which the body keeps out of zones; None if it may go everywhere."""
        return None

    @property
    def eyes(self) -> dict[str, Camera]:
        """The cameras by name; empty unless a subclass has some."""
        return {}

    @property
    def tall(self) -> float:
        """The standing height [m]."""
        return self.usual_height if self.height is None else self.height

    def check_interrupt(self, name: str) -> None:
        """Check that an event may end plans: an event of cameras, or a registered interrupt.

        Raises:
            ComponentError: There is no such event, or it needs a camera.
        """
        own = self.sight_events if self.eyes else ()
        if name in own or name in self.request_events:
            return
        try:
            lookup("interrupt", name)
        except ScenarioError as error:
            if ":" in name:
                raise ComponentError(str(error)) from error
            known = suggest(name, sorted({*own, *components("interrupt")}), "These do")
            hint = "" if own else f" ({' and '.join(self.sight_events)} need a camera)"
            raise ComponentError(f"no event {name!r} interrupts its plans{known}{hint}") from error


NEVER = 1 << 62
"""The step of what never happens."""


# The `Plan.posture_times` of a body that only stands.
STANDING = np.zeros(0, np.int64), np.zeros(1, np.int8)


def poses_of(block: PoseBlock, row: int) -> Poses:
    """Return the poses of one body, as views."""
    return Poses(block.x[row], block.y[row], block.heading[row], block.away[row])


class Bodies:
    """All bodies of a run, users first, then robots.

    Attributes:
        step: The present step: decisions are made at it, poses beyond it may still change.
        ask_at: int64 (bodies,), the step at which each body decides next; NEVER for never.
        users: Number of users among the bodies.
        timelines: The motion of all bodies.
    """

    def __init__(self, users: int, robots: int, step_us: int) -> None:
        self.step = 0
        self.users = users
        self.ask_at = np.zeros(users + robots, np.int64)
        self._step_us = step_us
        self.timelines = Timelines(users + robots, step_us)
        self._window: Window | None = None
        self._block: tuple[int, int, PoseBlock] | None = None

    def __len__(self) -> int:
        """Return the number of bodies."""
        return len(self.ask_at)

    def __getstate__(self) -> dict[str, object]:
        """Leave out caches, which follow from the timelines."""
        return {**self.__dict__, "_window": None, "_block": None}

    def pose_at(self, row: int, step: int) -> Pose:
        """Return the pose of a body at a step that isn't forgotten."""
        return new_pose(self.timelines.pose(row, step))

    def poses(self, steps: I64) -> I64:
        """Return x, y, heading and away of all bodies at some steps: int64 (steps, bodies, 4)."""
        return self.timelines.poses(steps)

    def follow(self, row: int, motion: Motion, begin: Pose, postures: tuple[I64, I8]) -> None:
        """Let a body move from the present step on.

        Args:
            row: The body.
            motion: The motion.
            begin: The pose at the present step.
            postures: Times at which the posture changes [us], int64 (n,), and the postures, int8 (n
                + 1,).
        """
        if isinstance(motion, RandomWalk):
            self.timelines.walk(row, self.step, motion.walls, motion.space, motion.rule, begin[:3])
        else:
            self.timelines.follow(row, self.step, motion.breakpoints, *postures)
        self._window = self._block = None

    def hold(self, row: int, pose: Pose) -> None:
        """Let a body rest at a pose from the present step on."""
        moment = np.array([self.step * self._step_us], np.int64)
        x, y, heading = np.array(pose[:3], np.int64)[:, None]
        track = Breakpoints(moment, x, y, heading, np.array([pose.away], np.uint8))
        self.timelines.follow(row, self.step, track, *STANDING)
        self._window = self._block = None

    def window(self, first: int, end: int) -> Window:
        """Return the runs of equal pose of all bodies in the steps from `first` to `end` - 1."""
        window = self._window
        if window is None or (window.first, window.end) != (first, end):
            window = self._window = self.timelines.window(first, end)
        return window

    def runs(self, row: int, first: int, end: int) -> Window:
        """Return the runs of equal pose of one body in the steps from `first` to `end` - 1."""
        return self.timelines.runs(row, first, end)

    def block(self, first: int, end: int) -> PoseBlock:
        """Return the poses of all bodies at each of the steps from `first` to `end` - 1."""
        if self._block is None or self._block[:2] != (first, end):
            window = self.window(first, end)
            rows = [window.dense(row, first, end) for row in range(len(self))]
            columns = (np.array(column) for column in zip(*rows, strict=True))
            if not rows:
                types = np.int64, np.int64, np.int64, np.uint8, np.int8
                columns = (np.zeros((0, end - first), t) for t in types)
            self._block = first, end, PoseBlock(*columns)
        return self._block[2]

    def next_decision(self) -> int:
        """Return the step at which the next body decides, NEVER for none."""
        steps = self.ask_at
        return int(steps[steps.argmin()]) if len(steps) else NEVER

    def due(self, step: int) -> Sequence[int]:
        """Return the rows of the bodies that decide at a step."""
        return kernels.due_rows(self.ask_at, step)

    def forget(self, before: int) -> None:
        """Drop the poses at steps earlier than `before`."""
        self.timelines.forget(before)


class PlaceAt(NamedTuple):
    """A place to use an object from.

    Attributes:
        thing: The object.
        x: Position of the body while it uses the object [lattice].
        y: Likewise.
        heading: Heading of the body [1/4096 turn].
        posture: Posture of the body.
        approach: The free point from which the body steps there [lattice].
    """

    thing: PlacedObject
    x: int
    y: int
    heading: int
    posture: Posture
    approach: LatticePoint


Arrangement = tuple[int, int, frozenset[int]]


@dataclass(eq=False)
class Body:
    """A body in a run.

    Attributes:
        name: Its name in the scenario.
        path: Its path in the scenario, "users.ana"; names its random streams and errors.
        entity: Its configuration.
        home: The home that it is in.
        clock: The clock of the run.
        seed: The seed of the run.
        people: All users of the scenario by name; None for one that isn't built yet.
        notes: Remarks on kinds of rooms and furniture that the home lacks.
        part: The connected part of its space that it is in.
        rules: The configured rules of keeping out; None: none.
        forbidden: The rooms, by index, and areas that it never enters: see `Home.area`.
        kept_out: The zones that its ways avoid now: `forbidden`, and those of its rules and bans.
        row: Its row among the bodies of the run.
        interrupts: The events in its plans so far, which have been checked.
        drive: Its drive along routes; None: `Differential`, which the core computes.
    """

    name: str
    path: str
    entity: BodySettings
    home: Home
    clock: Clock
    seed: int
    people: Mapping[str, "Body | None"] = field(default_factory=dict, kw_only=True, repr=False)
    notes: list[str] = field(init=False, default_factory=list)

    def __post_init__(self) -> None:
        lattice = self.home.lattice
        self.rules = self.entity.keep_out_rules(self)
        self.forbidden = frozenset[int]() if self.rules is None else self.rules.always
        self.kept_out = self.forbidden
        if self.rules is not None:
            self.kept_out |= self.rules.active(self.clock.start, frozenset())
        try:
            space = self.space_without()
        except FloorPlanError as error:
            if not self.forbidden:
                raise
            raise PlacementError(f"{self.path}.keep_out leaves its body no place") from error
        self._space: tuple[Arrangement, Space] = self.arrangement, space
        self.speed = self.entity.speed * lattice.units_per_m  # units per second
        self.turn_rate = self.entity.turn_rate_deg / 360 * TURN  # headings per second
        drive: Drive | None = getattr(self.entity, "drive", None)
        is_usual = drive is None or type(drive) is Differential
        self.drive: Drive | None = None if is_usual else copy.deepcopy(drive)
        self.part = 0
        self._places: tuple[Space | None, tuple[PlacedObject, ...], dict[tuple[str, int], PlaceAt]]
        self._places = None, (), {}
        self._bodies: Bodies | None = None
        self._state: Pose
        self._state_step = 0
        self.row = 0
        self.interrupts: frozenset[str] = frozenset()

    def join(self, bodies: Bodies, row: int) -> None:
        """Join the bodies of a run, whose clock and poses are used from then on."""
        self._bodies = bodies
        self.row = row

    @property
    def state(self) -> Pose:
        """The pose at the present step."""
        bodies = self._bodies
        if bodies is not None and self._state_step != bodies.step:
            self._state = bodies.pose_at(self.row, bodies.step)
            self._state_step = bodies.step
        return self._state

    @state.setter
    def state(self, pose: Pose) -> None:
        self._state = pose
        if self._bodies is not None:
            self._state_step = self._bodies.step
            self._bodies.hold(self.row, pose)

    @property
    def space(self) -> Space:
        """The space in which the body can be at present."""
        (version, costs_version, kept_out), space = self._space  # mostly up to date
        if version == self.home.version and kept_out is self.kept_out:
            costs = self.home.costs_version if self.entity.minds_costs else 0
            if costs_version == costs:
                return space
        if self._space[0] != self.arrangement:
            self._space = self.arrangement, self.space_without()
            self.part = self._present_part()
        return self._space[1]

    @property
    def arrangement(self) -> Arrangement:
        """The key of its space: the versions of home and costs, and rooms to keep out of."""
        costs = self.home.costs_version if self.entity.minds_costs else 0
        return self.home.version, costs, self.kept_out

    @property
    def may_block_routes(self) -> bool:
        """Whether routes may be open to it at some times only."""
        has_hours = self.rules is not None and bool(self.rules.timed)
        return self.home.may_block_routes or has_hours or self.kept_out != self.forbidden

    @property
    def whole_space(self) -> Space:
        """The space in which the body fits at present, including rooms to keep out of."""
        return self._space_outside(frozenset())

    def space_without(self, rooms: frozenset[int] = frozenset()) -> Space:
        """Return the space in which the body can be outside of some rooms, by their indices."""
        return self._space_outside(self.kept_out | rooms)

    def _space_outside(self, rooms: frozenset[int]) -> Space:
        entity = self.entity
        space = self.home.space(
            entity.radius,
            opens_doors=entity.opens_doors,
            uses_portals=entity.climbs_stairs,
            without=rooms,
        )
        return self.home.costed(space) if entity.minds_costs else space

    def _present_part(self) -> int:
        """Return the part of a changed space that holds the body, or is nearest."""
        space = self._space[1]
        position = self.state.position
        x, y = self.home.approach_of(position) or position
        part = space.part_at(x, y)
        return part if part >= 0 else space.part_near(x, y)

    def own_furniture(self, kind: str) -> PlacedObject | None:
        """Return the piece of furniture of a kind that is its own, if its behaviors say so."""
        return None

    def posture_code(self, time_us: int) -> int:
        """Return the posture at a moment, by its number in POSTURES; a plain body stands."""
        return 0

    def may_record(self, event: str) -> bool:
        """Return whether plans may record a kind of events besides those of Fleet2D."""
        return False

    @property
    def slows(self) -> tuple[SlowRegion, ...]:
        """The regions that slow the body down at present, for robots only."""
        return self.home.slows if self.entity.minds_floor else ()

    @property
    def way_out(self) -> LatticePoint:
        """The lattice point at which the body leaves the home."""
        return self.home.way_out(self.space, self.part)

    def place_at(self, thing: PlacedObject | str, place: int) -> PlaceAt:
        """Return a place to use an object from; kept until doors or objects of the home change.

        Raises:
            PlacementError: There is no such object, or no place to use it from.
        """
        space = self.space
        objects = self.home.objects
        if self._places[0] is not space or self._places[1] is not objects:
            self._places = space, objects, {}
        name = thing if isinstance(thing, str) else thing.name
        known = self._places[2].get((name, place))
        if known is not None and (isinstance(thing, str) or known.thing is thing):
            return known
        home = self.home
        lattice = home.lattice
        thing = home.object(thing) if isinstance(thing, str) else thing
        if not thing.uses:
            raise PlacementError(f"{self.path}: {thing.name} has no place to use it from")
        use = thing.uses[place % len(thing.uses)]
        x, y = lattice.point_at(use.at)
        heading = round(use.heading / (2 * np.pi) * TURN) % TURN
        approach = home.approach(use, self.space, self.part)
        at = PlaceAt(thing, x, y, heading, use.posture, approach)
        self._places[2][name, place] = at
        return at

    def step_off(self, x: int, y: int) -> LatticePoint | None:
        """Return the point where the body steps off the object at a point; None: it needn't."""
        approach = self.home.approach_of((x, y))
        # Chairs round a table may leave a gap in which a body fits without a way out.
        if approach is None:
            return None
        space = self.space
        if space.part_of(x, y) == self.part:
            return None
        if space.part_of(*approach) == self.part:
            return approach
        return space.nearest(*approach, self.part) or approach

    @property
    def xy(self) -> tuple[float, float]:
        """The position [m]."""
        return self.home.lattice.xy_of(*self.state.position)

    def stream(self, purpose: str) -> np.uint64:
        """Return the key of the random stream for a purpose."""
        return stream_key(self.seed, self.path, purpose)

    def breakpoints(self, route: I64, begin_us: int, heading: int) -> I64:
        """Return the breakpoints of the drive on a route (n, 2), without the first.

        Returns:
            Time [us], x, y [lattice], heading [1/4096 turn], away; int64 (m, 5).

        Raises:
            ComponentError: The drive fails, or doesn't lead to the end of the route.
        """
        assert self.drive is not None
        rates = (self.speed, self.turn_rate)
        units_per_m = self.home.lattice.units_per_m
        with self._blame_drive():
            rows = breakpoints(self.drive, route, heading, rates, units_per_m)
        rows[:, 0] += begin_us
        return rows

    def seconds(self, metres: F64) -> F64:
        """Return estimates of the time for ways of some lengths, without turns [s]."""
        lattice = self.home.lattice
        if self.drive is None:
            return metres * lattice.units_per_m / self.speed
        with self._blame_drive():
            return estimate(self.drive, metres, self.speed / lattice.units_per_m)

    def _blame_drive(self) -> blame:
        return blame(f"{self.path}.drive", None if self._bodies is None else self._bodies.step)

    def reachable_rooms(self) -> list[Room]:
        """Return the rooms in which the body can stand, in index order."""
        space = self.space
        reached = space.rooms_of(self.part)
        return [room for room in self.home.rooms if room.index in reached]

    def rooms(self, names: RoomChoice) -> list[Room]:
        """Return the rooms that a list of names stands for: those of the first name that fits.

        Raises:
            PlacementError: No name is that of a room that can be reached.
        """
        thing = furniture_of(self, names)
        at = None if thing is None else self.place_at(thing, 0).approach  # where one uses it
        room = None if at is None else self.home.plan.room_of_point(*at)
        return self._match(names)[1] if room is None else [self.home.rooms[room.index]]

    def _match(self, names: RoomChoice) -> tuple[str, list[Room]]:
        try:
            home = self.home
            return matching_rooms(names, home.rooms, self.reachable_rooms(), home.objects)
        except PlacementError as error:
            raise PlacementError(f"{self.path}: {error}") from None

    def find(
        self, place: RoomChoice | Point | str | Iterable[object], time_us: int, purpose: str
    ) -> LatticePoint:
        """Return the lattice point of a place: the point itself, or a spot drawn in the room.

        Of several rooms of a kind, a body uses one for the whole run; of ``any`` room, it draws one
        each time.

        Raises:
            PlacementError: There is no such room, or it can't be reached.
        """
        target = parse_place(place)
        if is_point(target):
            return self.point(target)  # type: ignore[arg-type]
        thing = furniture_of(self, target)
        if thing is not None:
            return self.place_at(thing, 0).approach
        draws = Draws(self.stream(purpose), time_us)
        name, rooms = self._match(target)  # type: ignore[arg-type]
        habit = Draws(self.stream(f"room of {name}"), 0)
        room = (draws if name == ANY else habit).choice(rooms)
        return self._spot_of(self.space.cells(room.index, self.part), draws)

    def _spot_of(self, cells: I64, draws: Draws) -> LatticePoint:
        """Return the centre of one of some cells (row, column), drawn at random."""
        row, column = cells[draws.below(len(cells))].tolist()
        return self.home.lattice.cell_centre(row, column)

    def find_anywhere(self, place: Any, time_us: int) -> LatticePoint:
        """Return the lattice point of a place to put the body at, even one without a way.

        Raises:
            PlacementError: There is no such room, or the body fits nowhere in it.
        """
        target = parse_place(place)
        space = self.whole_space
        if not is_point(target):
            rooms = matching_rooms(target, self.home.rooms, self.home.rooms)[1]  # type: ignore[arg-type]
            for part in range(space.parts):
                cells = space.cells(rooms[0].index, part)
                if len(cells):
                    return self._spot_of(cells, Draws(self.stream("put"), time_us))
            raise PlacementError(f"{self.path}: its body fits nowhere in {rooms[0].name}")
        x, y = self.home.lattice.point_at(target)  # type: ignore[arg-type]
        if space.part_at(x, y) < 0:
            raise self._is_not_free(target, space.nearest(x, y))  # type: ignore[arg-type]
        return x, y

    def middle(self, room: Room) -> LatticePoint:
        """Return the reachable lattice point nearest to the room's anchor.

        The anchor is the point of the room that is farthest from its walls.

        Raises:
            PlacementError: The room can't be reached.
        """
        x, y = self.home.lattice.point_at(room.anchor_xy)
        point = self.space.nearest(x, y, self.part, room.index)
        if point is None:
            raise PlacementError(f"{self.path}: {room.name} can't be reached from where it starts")
        return point

    def point(self, xy: Point) -> LatticePoint:
        """Return a point [m] on the lattice.

        Raises:
            PlacementError: The body can't stand there, or can't get there; the message has the
                nearest free point.
        """
        lattice = self.home.lattice
        x, y = lattice.point_at(xy)
        part = self.space.part_at(x, y)
        if part == self.part:
            return x, y
        why = ""
        if lies_in(self, (x, y), self.kept_out):
            why = "is where it keeps out (keep_out)"
        elif part >= 0:
            why = "can't be reached from where it starts"
        elif self.home.space(self.entity.radius).part_at(x, y) >= 0:
            why = "is where the costmap lets no route pass"
        raise self._is_not_free(xy, self.space.nearest(x, y, self.part), why)

    def _is_not_free(self, xy: Point, near: LatticePoint | None, why: str = "") -> PlacementError:
        """Return the error about a point, which names the nearest free one, in few decimals."""
        why = why or f"is in a wall or nearer to one than its radius of {self.entity.radius:g} m"
        lattice = self.home.lattice
        free = None
        if near is not None:
            free = lattice.to_metres(near).round(2).tolist()
            if self.space.part_at(*lattice.point_at(free)) != self.part:
                free = lattice.to_metres(near).round(4).tolist()
        return PlacementError(
            f"{self.path}: the point {list(xy)} {why}; the nearest free point is {free}"
        )

    def _has_any(self, names: RoomChoice | Point) -> bool:
        """Return whether the home has such furniture, or a reachable room of that name or kind."""
        if furniture_of(self, names) is not None:
            return True
        return _has_named(self.reachable_rooms(), names)

    def _start_part(self, names: RoomChoice) -> int:
        """Return the largest connected part with one of these rooms, else the largest part."""
        for part in range(self.space.parts):
            rooms = self.home.rooms
            reachable = [room for room in rooms if len(self.space.cells(room.index, part))]
            if ANY in names or _has_named(reachable, names):
                return part
        return 0


def _has_named(rooms: Iterable[Room], names: RoomChoice | Point) -> bool:
    """Return whether one of some rooms has one of these names, or is of such a kind."""
    return any({room.name, room.type, ANY} & set(names) for room in rooms)
