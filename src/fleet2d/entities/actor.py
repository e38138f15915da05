"""An entity in a run: its body, its place in the home, and the plan that it follows."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from datetime import timedelta

import numpy as np

from fleet2d.blame import blame
from fleet2d.clock import Clock
from fleet2d.entities.behavior import Behavior, Situation
from fleet2d.entities.entity import Entity
from fleet2d.entities.place import ANY, Point, RoomChoice, is_point, matching_rooms, parse_place
from fleet2d.entities.plan import Motion, Plan, State
from fleet2d.errors import ComponentError, NoWayError, PlacementError
from fleet2d.floorplan.home import Home
from fleet2d.floorplan.plan import Room
from fleet2d.floorplan.space import Space
from fleet2d.kernels.headings import TURN
from fleet2d.streams import Draws, stream_key

# Nobody has a plan: stand still this long, then ask again.
PAUSE = timedelta(minutes=1)
# A shut door is in the way: wait this long, then ask again.
AT_A_DOOR = timedelta(seconds=10)


@dataclass(eq=False)
class Actor:
    """An entity in a run.

    Attributes:
        name: Its name in the scenario.
        path: Its path there, "users.ana"; names its random streams and errors.
        entity: Its configuration.
        state: Where it is at the present step.
        plan: What it follows.
        motion: The motion of the plan.
        planned_at: The step at which it was last asked.
        ask_at: The step at which it is asked again; None: never.
    """

    name: str
    path: str
    entity: Entity
    home: Home
    clock: Clock
    seed: int
    behaviors: list[Behavior] = field(init=False)

    def __post_init__(self) -> None:
        lattice = self.home.plan.lattice
        self._space: tuple[int, Space] = self.home.version, self._present_space()
        self.speed = self.entity.speed * lattice.units_per_m  # units per second
        self.turn_rate = self.entity.turn_rate_deg / 360 * TURN  # headings per second
        self.part = 0
        self.behaviors = [behavior.model_copy(deep=True) for behavior in self.entity.behaviors]
        with blame(self.path, None):
            self.state = self._begin()
            for behavior in self.behaviors:
                behavior.start(self)
        self.plan: Plan = Plan(self, 0).stay()
        self.motion: Motion = self.plan.finish()
        self.planned_at = 0
        self.ask_at: int | None = 0

    @property
    def space(self) -> Space:
        """Where its body can be at present."""
        if self._space[0] != self.home.version:
            self._space = self.home.version, self._present_space()
            self.part = self._present_part()
        return self._space[1]

    def _present_space(self) -> Space:
        entity = self.entity
        return self.home.space(entity.radius, opens_doors=entity.opens_doors)

    def _present_part(self) -> int:
        """Return the part of a changed space that it is in, or nearest to."""
        space, x, y = self._space[1], self.state.x, self.state.y
        part = space.part_at(x, y)
        if part < 0:
            near = space.nearest(x, y)
            part = 0 if near is None else space.part_at(*near)
        return part

    @property
    def way_out(self) -> tuple[int, int]:
        """The lattice point where it leaves the home."""
        return self.home.way_out(self.space, self.part)

    def posture_code(self, time_us: int) -> int:
        """Return the posture at a moment, by its number in POSTURES."""
        plan: Plan | None = getattr(self, "plan", None)  # none yet when the first is made
        if plan is None or not (plan.postures or plan.posture != "stand"):
            return 0
        return int(plan.posture_at(np.array([time_us]))[0])

    def stream(self, purpose: str) -> np.uint64:
        """Return the key of its random stream for a purpose."""
        return stream_key(self.seed, self.path, purpose)

    def reachable_rooms(self) -> list[Room]:
        """Return the rooms in which it can stand, in index order."""
        return [room for room in self.home.rooms if len(self.space.cells(room.index, self.part))]

    def rooms(self, names: RoomChoice) -> list[Room]:
        """Return the rooms that a list of names stands for: those of the first name that fits.

        Raises:
            PlacementError: It names no room, or none that can be reached.
        """
        return self._match(names)[1]

    def _match(self, names: RoomChoice) -> tuple[str, list[Room]]:
        try:
            return matching_rooms(names, self.home.rooms, self.reachable_rooms())
        except PlacementError as error:
            raise PlacementError(f"{self.path}: {error}") from None

    def find(
        self, place: RoomChoice | Point | str | Iterable[object], time_us: int, purpose: str
    ) -> tuple[int, int]:
        """Return the lattice point of a place: the point itself, or a spot drawn in the room.

        Of several rooms of a kind, a body has its own for the whole run; of ``any`` room, it draws
        one.

        Raises:
            PlacementError: There is no such room, or it can't be reached.
        """
        where = parse_place(place)
        if is_point(where):
            return self.point(where)  # type: ignore[arg-type]
        draws = Draws(self.stream(purpose), time_us)
        name, rooms = self._match(where)  # type: ignore[arg-type]
        habit = Draws(self.stream(f"room of {name}"), 0)
        room = (draws if name == ANY else habit).choice(rooms)
        cells = self.space.cells(room.index, self.part)
        row, column = cells[draws.below(len(cells))].tolist()
        return self.home.plan.lattice.cell_centre(row, column)

    def middle(self, room: Room) -> tuple[int, int]:
        """Return the point of a room that it can reach, nearest to the room's deepest inside."""
        x, y = self.home.plan.lattice.to_lattice(room.anchor_xy).tolist()
        found = self.space.nearest(x, y, self.part, room.index)
        if found is None:
            raise PlacementError(f"{self.path}: {room.name} can't be reached from where it starts")
        return found

    def point(self, xy: Point) -> tuple[int, int]:
        """Return a point [m] on the lattice.

        Raises:
            PlacementError: Its body can't stand there, or can't get there; says what is near.
        """
        lattice = self.home.plan.lattice
        x, y = lattice.to_lattice(xy).tolist()
        part = self.space.part_at(x, y)
        if part == self.part:
            return x, y
        near = self.space.nearest(x, y, self.part)
        there = None if near is None else self._shown(near)
        why = (
            "can't be reached from where it starts"
            if part >= 0
            else f"is in a wall or nearer to one than its radius of {self.entity.radius:g} m"
        )
        raise PlacementError(
            f"{self.path}: the point {list(xy)} {why}; the nearest free point is {there}"
        )

    def _shown(self, point: tuple[int, int]) -> list[float]:
        """Return a free lattice point in metres, with as few decimals as leave it free."""
        lattice = self.home.plan.lattice
        short: list[float] = lattice.to_metres(point).round(2).tolist()
        if self.space.part_at(*lattice.to_lattice(short).tolist()) == self.part:
            return short
        exact: list[float] = lattice.to_metres(point).round(4).tolist()
        return exact

    def decide(self, step: int, events: tuple[object, ...], outputs: Mapping[str, object]) -> None:
        """Ask the behaviors, in order, for a plan that begins at `step`."""
        now = Situation(self, step, events, outputs)  # type: ignore[arg-type]
        plan = None
        with blame(self.path, step):
            for behavior in self.behaviors:
                plan = self._asked(behavior, now)
                if plan is not None:
                    break
        if plan is None:
            plan = now.plan()
            plan = plan.stay(PAUSE) if self.behaviors else plan.stay()
        if not isinstance(plan, Plan):
            raise ComponentError(
                f"{self.path}: decide() returned {plan!r}; a plan or None is wanted"
            )
        if plan.began != (step, self.state):
            raise ComponentError(
                f"{self.path}: decide() returned a plan that doesn't begin here and now: make one"
                " by now.plan()"
            )
        self.plan, self.motion, self.planned_at = plan, plan.finish(), step
        # A plan that takes no time would be asked for again and again at the same step.
        over = max(self.clock.step_at_or_after(plan.time_us), step + 1)
        self.ask_at = None if plan.endless else over

    def _asked(self, behavior: Behavior, now: Situation) -> Plan | None:
        """Return a behavior's plan; where a shut door is in its way, wait a little instead."""
        try:
            return behavior.decide(now)
        except (PlacementError, NoWayError) as error:
            if not self.home.shut:
                raise
            return now.plan().note("way_blocked", str(error)).stay(AT_A_DOOR)

    def _begin(self) -> State:
        """Return the state at step 0."""
        place = self.entity.start
        if place is None:
            begins = (behavior.begins_at(self.clock.start) for behavior in self.behaviors)
            place = next((begin for begin in begins if begin is not None), (ANY,))
        away = int(len(place) == 0)
        if away:
            x, y = self.way_out
        elif is_point(place):
            x, y = self.home.plan.lattice.to_lattice(place).tolist()
            self.part = max(self.space.part_at(x, y), 0)
            x, y = self.point(place)  # type: ignore[arg-type]
        else:
            self.part = self._first_part(place)  # type: ignore[arg-type]
            x, y = self.find(place, 0, "start")
        heading = self.entity.start_heading_deg
        if heading is None:
            return State(x, y, Draws(self.stream("start heading"), 0).below(TURN), away)
        return State(x, y, round(heading / 360 * TURN) % TURN, away)

    def _first_part(self, names: RoomChoice) -> int:
        """Return the largest part of its space with one of these rooms; else the largest."""
        for part in range(self.space.parts):
            reachable = [r for r in self.home.rooms if len(self.space.cells(r.index, part))]
            if {ANY, *(r.name for r in reachable), *(r.type for r in reachable)} & set(names):
                return part
        return 0
