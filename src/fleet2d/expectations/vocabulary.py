"""The terms for signals of a run: one class each, named as in expectations.

To add a word, derive a class from `NumberSignal`, `WordSignal` (a name) or `Condition`: its
fields are its arguments, `check` refuses names that a run doesn't have, and `measure` returns its
values. It can be written in texts and imported from `fleet2d.expectations` at once.
"""

import math
from collections.abc import Collection, Iterator
from dataclasses import field
from typing import Any, get_args

import numpy as np
import shapely
from pydantic_core import PydanticCustomError

from fleet2d.algorithms.observations import ROBOT
from fleet2d.configuration.problems import did_you_mean
from fleet2d.configuration.units import parse_time_of_day, weekdays_of
from fleet2d.entities.behavior import Actor, HoursSpan
from fleet2d.entities.power import PowerState
from fleet2d.errors import InputError, ScenarioError, errors_as
from fleet2d.expectations.expectation import (
    INFINITE,
    RunSignals,
    Trace,
    combine,
    constant,
    pulses,
    shortest,
    stepwise,
)
from fleet2d.expectations.signals import (
    ANY_KIND,
    Condition,
    Gauge,
    MeasuredRun,
    Measurement,
    NumberSignal,
    Scene,
    SignalBlock,
    WordSignal,
)
from fleet2d.expectations.storeys import apart, only_on, storey_of
from fleet2d.floorplan.home import Home, lattice_footprint
from fleet2d.floorplan.lattice import UNITS_PER_CELL
from fleet2d.floorplan.placed_objects import PlacedObject
from fleet2d.kernels import (
    F64,
    I64,
    Bool,
    SightingColumn,
    distances_to_shape,
    rooms_at,
    speeds,
)
from fleet2d.runtime.clock import DAY
from fleet2d.runtime.events import SIGHTS, EventKind

Target = str | tuple[float, float] | WordSignal
"""A body, also as `nearest(…)`, a room, an object, or a point (x, y) [m]."""

BODY = ("user or robot", "bodies")
"""A noun for messages, and what it names in `Scene.names`."""

# The charge of a battery is rounded down to thousandths, with a tolerance for errors of floats.
PARTS = 1000
ROUNDING = 1e-9


class distance(NumberSignal):
    """The distance of a body from another, a room, an object or a point [m].

    The distance is measured from the centre of a body to the nearest point of a room or object; it
    is 0 inside, and infinite while a body is away from home or on another storey.
    """

    body: str
    other: Target

    of = BODY
    unit = "m"
    between = (0.0, INFINITE)

    def __post_init__(self) -> None:
        if isinstance(self.other, tuple | list):
            x, y = self.other
            self._set(other=(float(x), float(y)))

    def check(self, scene: Scene) -> None:
        """Refuse unknown bodies and places."""
        bodies, places = (scene.names[known] for known in ("bodies", "places"))
        if self.body in places and self.body not in bodies and self.other in bodies:
            raise ScenarioError(
                f"{self}: name the body first: distance({self.other!r}, {self.body!r})"
            )
        super().check(scene)
        if isinstance(self.other, tuple):
            x, y = self.other
            x0, y0, x1, y1 = scene.bounds
            if not (x0 <= x <= x1 and y0 <= y <= y1):
                raise ScenarioError(
                    f"{self}: ({x:g}, {y:g}) m is outside the home, which reaches from"
                    f" ({x0:g}, {y0:g}) to ({x1:g}, {y1:g}) m"
                )
        else:
            scene.check_room(str(self.other), self, [*bodies, *places])
        if self.other == self.body:
            raise ScenarioError(f"{self}: give two different bodies")

    def start(self, run: MeasuredRun, gauge: Gauge) -> Any:
        """Return the rows of both bodies, the second None for a place, and the place."""
        names = [actor.name for actor in run.actors]
        other = names.index(str(self.other)) if self.other in names else None
        return run.row(self.body), other, None, None

    def measure(self, block: SignalBlock, gauge: Gauge) -> Trace:
        """Return the distances over a block of steps."""
        row, other, shape, sides = gauge.memory
        home = block.home
        if other is not None:
            trace = apart(block, row, other)
        else:
            if (now := self._shape(home)) != shape:
                sides = self._sides(home, now)
                gauge.memory = row, other, now, sides
            trace = self._from_place(block, row, sides)
        return Trace(trace.start, trace.value / home.plan.lattice.units_per_m, block.end)

    @staticmethod
    def _from_place(block: SignalBlock, row: int, sides: list[tuple[int | None, I64]]) -> Trace:
        """Return the distance from the nearest part of a place on the storey of a body."""
        window = block.bodies.window(block.first, block.end)
        traces = []
        for storey, edges in sides:
            trace = Trace(*distances_to_shape(window, row, edges), block.end)
            traces.append(trace if storey is None else only_on(storey, trace, block, row))
        return combine(lambda *metres: np.min(metres, axis=0), *traces)

    def _shape(self, home: Home) -> PlacedObject | list[int] | tuple[float, float]:
        """Return the present place: an object, the numbers of rooms, or a point."""
        if isinstance(self.other, tuple):
            return self.other
        kind = str(self.other).removeprefix(ANY_KIND)
        rooms = [room.index for room in home.rooms if room.is_called(kind)]
        is_object = any(item.name == self.other for item in home.objects)
        return home.object(kind) if is_object and not rooms else rooms

    @classmethod
    def _sides(
        cls, home: Home, shape: PlacedObject | list[int] | tuple[float, float]
    ) -> list[tuple[int | None, I64]]:
        """Return the edges of a place on each storey, with its number, or None for only one."""
        plan = home.plan
        if not plan.portals or shape == []:
            return [(None, cls._edges(home, shape))]
        to_lattice = plan.lattice.to_lattice
        if isinstance(shape, tuple):
            place = shapely.Point(to_lattice(shape))
            return [(storey_of(plan, place), cls._edges(home, shape))]
        if isinstance(shape, list):
            rooms: dict[int, list[int]] = {}
            for number in shape:
                anchor = shapely.Point(to_lattice(home.rooms[number].anchor_xy))
                rooms.setdefault(storey_of(plan, anchor), []).append(number)
            return [(storey, cls._edges(home, of_it)) for storey, of_it in rooms.items()]
        return [(storey_of(plan, lattice_footprint(plan, shape)), cls._edges(home, shape))]

    @staticmethod
    def _edges(home: Home, shape: PlacedObject | list[int] | tuple[float, float]) -> I64:
        """Return the edges of a place from (x, y) to (x, y), int64 (n, 4) [lattice]."""
        plan = home.plan
        if isinstance(shape, tuple):
            return np.tile(plan.lattice.to_lattice(shape), 2).reshape(1, 4)
        if isinstance(shape, list):
            return outline(np.isin(plan.room_of_place, shape), UNITS_PER_CELL)
        ring = np.array(lattice_footprint(plan, shape).exterior.coords).round()
        return np.concatenate([ring[:-1], ring[1:]], axis=1).astype(np.int64)


def outline(mask: Bool, side: int) -> I64:
    """Return the edges around some cells: int64 (n, 4), from (x, y) to (x, y) [lattice].

    Args:
        mask: bool (rows, columns), the cells.
        side: The side of a cell [lattice].
    """
    padded = np.pad(mask, 1)
    horizontal = [(x0, y, x1, y) for y, x0, x1 in _borders(padded)]
    vertical = [(x, y0, x, y1) for x, y0, y1 in _borders(padded.T)]
    edges = np.array(horizontal + vertical, np.int64).reshape(-1, 4)
    return edges * side


def _borders(cells: Bool) -> list[list[int]]:
    """Return the borders after rows of padded cells: row, first column, one past the last."""
    differ = np.pad(cells[1:] != cells[:-1], ((0, 0), (1, 1)))
    row, column = np.nonzero(differ[:, 1:] != differ[:, :-1])
    # Columns are shifted by 1, as the cells were padded.
    ends = column.reshape(-1, 2) - 1
    return np.column_stack([row[::2], ends]).tolist()


class _Motion(Measurement):
    """Base of signals of the motion of a body from step to step."""

    body: str

    of = BODY

    def start(self, run: MeasuredRun, gauge: Gauge) -> Any:
        """Return the row of the body, its pose at the step before, and the steps in a second."""
        row = run.row(self.body)
        before = np.zeros(0, np.int64)
        # The present pose stands for the one before, which may be forgotten.
        pose = _pose(run.bodies.pose_at(row, run.first)) if run.first > 0 else before
        return row, pose, 1e6 / run.clock.step_us

    def measure(self, block: SignalBlock, gauge: Gauge) -> Trace:
        """Return the speed over a block of steps [m/s]."""
        row, last_pose, steps_per_s = gauge.memory
        window = block.bodies.window(block.first, block.end)
        plan = block.home.plan
        start, way = speeds(window, row, last_pose, plan.portal_ends)
        gauge.memory = row, _pose(block.bodies.pose_at(row, block.end - 1)), steps_per_s
        metres = way / plan.lattice.units_per_m
        return Trace(start, metres * steps_per_s, block.end)


def _pose(pose: Any) -> I64:
    return np.array([pose.x, pose.y, pose.away], np.int64)


class speed(_Motion, NumberSignal):
    """The speed of a body: the distance from its position at the step before, per step [m/s].

    It is 0 on the way from one end of stairs or a lift to the other.

    Positions are whole lattice units, so that a step may be a little longer than the body's own
    speed, or its speed in a slow area, allows; such a step counts as made at that speed.
    """

    unit = "m/s"
    between = (0.0, INFINITE)

    def start(self, run: MeasuredRun, gauge: Gauge) -> Any:
        """Return the body's own speed, and the state of its motion."""
        usual = run.actors[run.row(self.body)].entity.speed
        return usual, super().start(run, gauge)

    def measure(self, block: SignalBlock, gauge: Gauge) -> Trace:
        """Return the speed over a block of steps [m/s]."""
        usual, gauge.memory = gauge.memory
        measured = super().measure(block, gauge)
        _, _, steps_per_s = gauge.memory
        gauge.memory = usual, gauge.memory
        # Both ends of a step are rounded by up to half a unit in x and in y.
        rounding = math.sqrt(2) / block.home.plan.lattice.units_per_m * steps_per_s
        speeds_driven = [usual, *(usual * float(area.speed) for area in block.home.slows)]

        def without_rounding(value: F64) -> F64:
            for driven in speeds_driven:
                is_rounded = (value > driven) & (value <= driven + rounding)
                value = np.where(is_rounded, driven, value)
            return value

        return measured.map(without_rounding)


class battery(NumberSignal):
    """The charge of a robot, 0 to 1, rounded down to a tenth of a percent.

    Compare it with a share, such as "10 %".
    """

    robot: str

    of = ("robot with a battery", "batteries")
    unit = "share"
    between = (0.0, 1.0)

    def start(self, run: MeasuredRun, gauge: Gauge) -> Any:
        """Return the course of the charge along each plan, at first along the present one."""
        actor = run.actors[run.row(self.robot)]
        assert actor.charge is not None
        return [actor.charge.course(actor.motion)], run.clock.step_us

    def begin_plan(self, actor: Actor, gauge: Gauge) -> None:
        """Add the course of the charge along a new plan."""
        if actor.name == self.robot and actor.charge is not None:
            course = actor.charge.course(actor.motion)
            courses, step_us = gauge.memory
            earlier = [c for c in courses if c.begins[0] < course.begins[0]]
            gauge.memory = [*earlier, course], step_us

    def measure(self, block: SignalBlock, gauge: Gauge) -> Trace:
        """Return the charge over a block of steps."""
        courses, step_us = gauge.memory
        moments = np.arange(block.first, block.end, dtype=np.int64) * step_us
        begins = np.array([course.begins[0] for course in courses], np.int64)
        edges = [0, *np.searchsorted(moments, begins[1:]).tolist(), len(moments)]
        pieces = [
            course.levels(np.maximum(moments[a:b], course.begins[0]))
            for course, a, b in zip(courses, edges, edges[1:], strict=False)
        ]
        charge = np.floor(np.concatenate(pieces) * PARTS + ROUNDING) / PARTS
        gauge.memory = courses[-1:], step_us
        return shortest(np.arange(block.first, block.end), charge, block.end)


class room(WordSignal):
    """The room of a body, for `room("ana") == "kitchen"`, by name or type.

    There is no word between two rooms or away from home.
    """

    body: str

    of = BODY
    noun = "room"

    def check_word(self, word: str, scene: Scene) -> None:
        """Refuse an unknown room."""
        scene.check_room(word, self)

    def start(self, run: MeasuredRun, gauge: Gauge) -> Any:
        """Return the row of the body; the words are the names and types of rooms."""
        gauge.words = {room.index: room.words for room in run.home.rooms}
        return run.row(self.body)

    def measure(self, block: SignalBlock, gauge: Gauge) -> Trace:
        """Return the index of the room at each step; -1 in no room or away."""
        runs = block.bodies.runs(gauge.memory, block.first, block.end)
        index = rooms_at(block.home.plan.room_of_place, runs.x, runs.y)
        return shortest(runs.step, np.where(runs.away != 0, -1.0, index), block.end)


class activity(WordSignal):
    """A user's activity, for `activity("ana") == "sleep"`; none before the first such event."""

    user: str

    of = ("user", "users")
    noun = "activity"

    def check_word(self, word: str, scene: Scene) -> None:
        """Refuse an activity that the user never does."""
        known = scene.details.get(f"{EventKind.ACTIVITY} {self.user}")
        if known is not None:
            scene.check_name(f"activity of {self.user}", word, known, self)

    def start(self, run: MeasuredRun, gauge: Gauge) -> Any:
        """Begin with the code of the present activity; -1 if none is known."""
        now = run.activities.now(run.row(self.user))
        gauge.now = -1.0 if now is None else _code(now, gauge)

    def measure(self, block: SignalBlock, gauge: Gauge) -> Trace:
        """Return the code of the activity at each step."""
        changes = [
            (event.step, _code(event.detail, gauge))
            for event in block.events
            if event.event == EventKind.ACTIVITY and event.entity == self.user
        ]
        return gauge.switched(block, changes)


class power(WordSignal):
    """The state of a robot's power, for `power("astro") == "on"`, or else why it is off."""

    robot: str

    of = ("robot", "robots")
    noun = "state of power"

    def check_word(self, word: str, scene: Scene) -> None:
        """Refuse states other than those of the intervention `power`."""
        scene.check_name("state of power", word, get_args(PowerState), self)

    def start(self, run: MeasuredRun, gauge: Gauge) -> Any:
        """Begin with the code of the present state."""
        gauge.now = _code(run.actors[run.row(self.robot)].off_for or "on", gauge)

    def measure(self, block: SignalBlock, gauge: Gauge) -> Trace:
        """Return the code of the state at each step."""
        changes = [
            (event.step, _code("on" if event.event == EventKind.POWER_ON else event.detail, gauge))
            for event in block.events
            if event.event in (EventKind.POWER_OFF, EventKind.POWER_ON)
            and event.entity == self.robot
        ]
        return gauge.switched(block, changes)


def _code(word: str, gauge: Gauge) -> float:
    """Return the number of a word, a new number at its first use."""
    code = next((code for code, words in gauge.words.items() if word in words), len(gauge.words))
    gauge.words.setdefault(code, (word,))
    return float(code)


class nearest(WordSignal):
    """The robot that is nearest to a user, or the user who is nearest to a robot.

    It can also stand for a body: `room(nearest(ana)) == room(ana)`. It has no word while all are
    away.
    """

    body: str

    of = BODY
    noun = "body"

    def choices(self, scene: Scene) -> Collection[str]:
        """Return the robots for a user, the users for a robot.

        Raises:
            ScenarioError: There are none.
        """
        names = scene.names["robots" if self.body in scene.names["users"] else "users"]
        if not names:
            raise ScenarioError(f"{self}: there is nobody whom it could name")
        return names

    def check_word(self, word: str, scene: Scene) -> None:
        """Refuse a body that it can't name."""
        scene.check_name("body", word, self.choices(scene), self)

    def start(self, run: MeasuredRun, gauge: Gauge) -> Any:
        """Return the rows of the body and of the candidates."""
        row = run.row(self.body)
        is_user = type(run.actors[row].entity)
        rows = [i for i, actor in enumerate(run.actors) if not isinstance(actor.entity, is_user)]
        gauge.words = {i: (run.actors[i].name,) for i in rows}
        return row, rows

    def measure(self, block: SignalBlock, gauge: Gauge) -> Trace:
        """Return the row of the nearest body, the first if tied; -1 if there is none."""
        row, rows = gauge.memory
        traces = [apart(block, row, other) for other in rows]

        def first_of(*distances: F64) -> F64:
            table = np.stack(distances)
            at = np.array(rows, np.float64)[table.argmin(axis=0)]
            return np.where(np.isfinite(table.min(axis=0)), at, -1.0)

        return combine(first_of, *traces)


class moving(_Motion, Condition):
    """Whether the position of a body differs from its position at the step before."""


class away(Condition):
    """Whether a body is away from home."""

    body: str

    of = BODY

    def start(self, run: MeasuredRun, gauge: Gauge) -> Any:
        """Return the row of the body."""
        return run.row(self.body)

    def measure(self, block: SignalBlock, gauge: Gauge) -> Trace:
        """Return 1 while the body is away."""
        runs = block.bodies.runs(gauge.memory, block.first, block.end)
        return shortest(runs.step, (runs.away != 0).astype(np.float64), block.end)


class _CameraCondition(Condition):
    """Base of conditions about a camera.

    Attributes:
        body: Name of the body that the camera may see.
        by: Name of the robot or user that the camera belongs to.
    """

    body: str
    by: str = field(metadata={"named": True})

    def check(self, scene: Scene) -> None:
        """Refuse an owner without a camera, and a body that the camera never looks at."""
        scene.check_name("robot or user with a camera", self.by, scene.cameras, self)
        if self.body not in scene.cameras[self.by]:
            near = did_you_mean(self.body, scene.cameras[self.by])
            raise ScenarioError(
                f"{self}: {self.by} doesn't look at {self.body!r}{near} It looks at:"
                f" {', '.join(scene.cameras[self.by])}"
            )


SEEN_EVENTS = (EventKind.USER_SEEN, EventKind.ROBOT_SEEN)


class seen(_CameraCondition):
    """Whether a camera's owner counts a body as seen: from `user_seen` until `user_lost`."""

    def start(self, run: MeasuredRun, gauge: Gauge) -> Any:
        """Begin with 1 if the body counts as seen at present."""
        gauge.now = float(self.body in run.cameras[self.by].in_view)

    def measure(self, block: SignalBlock, gauge: Gauge) -> Trace:
        """Return 1 while the body counts as seen."""
        changes = (
            (event.step, float(event.event in SEEN_EVENTS))
            for event in block.events
            if event.entity == self.by and event.detail == self.body and event.event in SIGHTS
        )
        return gauge.switched(block, changes)


class in_view(_CameraCondition):
    """Whether a body truly is in view of a camera, noticed or not."""

    def start(self, run: MeasuredRun, gauge: Gauge) -> Any:
        """Return cameras without errors, which have seen nobody yet."""
        gauge.now = 0.0
        return run.cameras[self.by].perfect(run.first)

    def measure(self, block: SignalBlock, gauge: Gauge) -> Trace:
        """Return 1 while the body is in view."""
        looks = gauge.memory.look(block.bodies, block.end)
        changes = ((e.step, float(e.event in SEEN_EVENTS)) for e in looks if e.detail == self.body)
        return gauge.switched(block, changes)


class perceived(_CameraCondition):
    """Whether a robot has an observation of a user at a step, correct or not."""

    def check(self, scene: Scene) -> None:
        """Refuse users as owners: their perception isn't recorded."""
        scene.check_name("robot", self.by, scene.names["robots"], self)
        super().check(scene)

    def start(self, run: MeasuredRun, gauge: Gauge) -> Any:
        """Return the numbers of the robot and the user in observations."""
        cameras = run.cameras[self.by]
        return cameras.index, cameras.other_names.index(self.body)

    def measure(self, block: SignalBlock, gauge: Gauge) -> Trace:
        """Return the number of observations at each step."""
        seen = block.observations
        robot, user = gauge.memory
        columns = seen.distinct
        is_it = (columns[:, ROBOT] == robot) & (columns[:, SightingColumn.IDENTITY] == user)
        return pulses(np.unique(seen.step[is_it[seen.index]]), block.first, block.end)


class door(Condition):
    """Whether a door is open."""

    name: str

    of = ("door", "doors")

    def start(self, run: MeasuredRun, gauge: Gauge) -> Any:
        """Return the number of the door."""
        return list(run.doors).index(self.name)

    def measure(self, block: SignalBlock, gauge: Gauge) -> Trace:
        """Return 1 while the door is open."""
        return constant(float(gauge.memory not in block.home.shut), block.first, block.end)


class light(Condition):
    """Whether the light of a room is on, or of any room of a kind."""

    name: str

    def check(self, scene: Scene) -> None:
        """Refuse an unknown room."""
        scene.check_room(self.name, self)

    def start(self, run: MeasuredRun, gauge: Gauge) -> Any:
        """Return the indices of the rooms."""
        name = self.name.removeprefix(ANY_KIND)
        return {room.index for room in run.home.rooms if room.is_called(name)}

    def measure(self, block: SignalBlock, gauge: Gauge) -> Trace:
        """Return 1 while the light is on."""
        return constant(float(not gauge.memory <= block.home.unlit), block.first, block.end)


class sensor(Condition):
    """Whether a sensor is on; for the contact sensor of a door, whether the door is open."""

    name: str

    of = ("sensor", "sensors")

    def start(self, run: MeasuredRun, gauge: Gauge) -> Any:
        """Begin with 1 if the sensor is on at present."""
        gauge.now = float(run.sensors_on[self.name])

    def measure(self, block: SignalBlock, gauge: Gauge) -> Trace:
        """Return 1 while the sensor is on."""
        changes = ((step, float(on)) for step, name, on in block.readings if name == self.name)
        return gauge.switched(block, changes)


class events(Condition):
    """Whether an event happens at a step, optionally only to an entity or with a detail.

    Attributes:
        kind: Kind of the event, as in the table of events.
        entity: Name of the entity to which the event happens; None: any.
        detail: Detail of the event; None: any.
    """

    kind: str
    entity: str | None = None
    detail: str | None = field(default=None, kw_only=True)

    is_instant = True

    def check(self, scene: Scene) -> None:
        """Refuse an event that can never happen."""
        scene.check_event(self.kind, self.entity, self.detail, self)

    def measure(self, block: SignalBlock, gauge: Gauge) -> Trace:
        """Return the number of events at each step."""
        steps = [
            event.step
            for event in block.events
            if event.event == self.kind
            and self.entity in (None, event.entity)
            and self.detail in (None, event.detail)
        ]
        return pulses(np.array(steps, np.int64), block.first, block.end)

    def occasions(self, run: RunSignals) -> I64:
        """Return the steps of the events, repeated for several events at one step."""
        trace = self.trace(run)
        end = np.append(trace.start[1:], trace.end)
        lengths = np.where(trace.value > 0, end - trace.start, 0)
        offset = np.arange(lengths.sum()) - np.repeat(np.cumsum(lengths) - lengths, lengths)
        steps = np.repeat(trace.start, lengths) + offset
        return np.repeat(steps, np.repeat(trace.value.clip(0).astype(np.int64), lengths))


class during(Condition):
    """Whether the time is within some hours, such as "22:00-07:00", on some days.

    Attributes:
        hours: Begin and end, across midnight if the end is earlier than the begin.
        days: Names of days, "weekdays" or "weekends", separated by commas; None: every day.
    """

    hours: str
    days: str | None = field(default=None, kw_only=True)

    def __post_init__(self) -> None:
        begin, separator, end = self.hours.partition("-")
        if not separator:
            raise InputError(f"during({self.hours!r}): write from when to when, like '22:00-07:00'")
        with errors_as(InputError, "during", of=PydanticCustomError):
            first = parse_time_of_day(begin.strip())
            last = parse_time_of_day(end.strip())
            names = [name.strip() for name in self.days.split(",")] if self.days else "daily"
            if first == last:
                raise InputError(
                    f"during: {self.hours} has no length: write 00:00-24:00 for the whole day"
                )
            length = last - first if last > first else last + DAY - first
            days = tuple(sorted(weekdays_of(names)))
            self._set(_span=HoursSpan(days, first, first + length, self.hours))

    def measures(self) -> Iterator[Measurement]:
        """Yield nothing, as the clock is known."""
        yield from ()

    def trace(self, run: RunSignals) -> Trace:
        """Return 1 where the time is within these hours, 0 elsewhere."""
        clock = run.clock
        span: HoursSpan = vars(self)["_span"]
        moment = clock.time(run.first)
        end = clock.time(run.end)
        changes = []
        while moment < end:
            over = span.end_at(moment)
            changes.append((clock.step_at_or_after(clock.elapsed(moment)), float(over is not None)))
            moment = over or span.next_begin(moment)
        changes = [change for change in changes if change[0] < run.end]
        return stepwise(run.first, 0.0, changes, run.end)
