"""The home as one person knows it: what the core asks about it when the person does activities."""

from collections.abc import Hashable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Generic, TypeVar

from fleet2d.entities.plan import Plan, new_note
from fleet2d.entities.users.setting import MOVE_KINDS, Setting
from fleet2d.entities.users.spots import Seat, Spot
from fleet2d.floorplan.objects import POSTURES
from fleet2d.kernels.motion import LastStint, Resident, Scene
from fleet2d.streams import Draws

if TYPE_CHECKING:
    from fleet2d.entities.actor import Actor
    from fleet2d.entities.users.inhabitant import Inhabitant
    from fleet2d.floorplan.plan import Room

T = TypeVar("T", bound=Hashable)

# What these numbers of the core stand for.
CHOICES = ("own", "nearest", "each_time", "here")
EVENTS = ("activity", "way_blocked", "uses", "left_home", "came_home")

PlanEnd = tuple[int, int, int, int, int]
"""Time [us], x, y [lattice], heading [1/4096 turn], and whether the body is away."""
Course = tuple[PlanEnd, int, list[tuple[int, int]], list[tuple[int, int, int]]]
"""The end of a plan, its posture, and the postures and notes that were added; see `Resident`."""
Stint = tuple[Scene, int, int, int, bool]
"""A time in which an activity is done; see `Resident.live`."""


class Numbering(Generic[T]):
    """Numbers of things, in the order of their first use."""

    def __init__(self) -> None:
        self.things: list[T] = []
        self._numbers: dict[T, int] = {}

    def of(self, thing: T) -> int:
        """Return the number of a thing."""
        number = self._numbers.setdefault(thing, len(self.things))
        if number == len(self.things):
            self.things.append(thing)
        return number


class KnownHome:
    """The home as one person knows it.

    The core asks for spots, places at furniture and ways when it needs them, and keeps the answers
    as long as doors and furniture stay as they are.
    """

    def __init__(self, person: "Inhabitant", actor: "Actor") -> None:
        self._person, self._actor = person, actor
        self._last = LastStint()
        self._seats: Numbering[Seat] = Numbering()  # which `_last` refers to
        self._names: Numbering[str] = Numbering()  # of activities
        self._scenes: dict[str, tuple[Setting, Scene]] = {}
        self._rooms: dict[int, Room] = {}
        self._resident: tuple[object, Resident | None] = None, None

    def __getstate__(self) -> dict[str, object]:
        """Leave out caches, which are made again."""
        return {**self.__dict__, "_scenes": {}, "_rooms": {}, "_resident": (None, None)}

    def live(self, plan: Plan, stints: Sequence[Stint], until_us: int, *, continues: bool) -> None:
        """Add activities to a plan, until the last one is over or shut doors block one.

        Args:
            plan: The plan.
            stints: The activities.
            until_us: None begins then, or later [us since the start].
            continues: Whether the first one may be a part of the last one of the plan before.
        """
        live, walk, now = self.update().live, partial(self._walk, plan), _end_of(plan)
        course = live(self, walk, plan.legs, *now, stints, until_us, continues, self._last)
        self._take(plan, course)

    def go(self, plan: Plan, activity: str, setting: Setting, draws: Draws) -> None:
        """Go to where an activity is done, and take its posture."""
        go, walk, now = self.update().go, partial(self._walk, plan), _end_of(plan)
        self._take(plan, go(self, walk, plan.legs, *now, self.scene(activity, setting), draws))

    def update(self) -> Resident:
        """Forget an earlier arrangement of doors and furniture; return the body for the core."""
        actor = self._actor
        space, rates = actor.space, (actor.speed, actor.turn_rate)
        present = actor.home.version, space, actor.part, rates
        of, resident = self._resident
        if resident is None or of != present:
            routes = space.shortest if actor.drive is None else None
            steps_off = [
                (*at, *off)
                for at in actor.home.approaches
                if (off := actor.step_off(*at)) is not None
            ]
            resident = Resident(self._person.key, *rates, routes, steps_off)
            self._resident = present, resident
            self._rooms = {room.index: room for room in actor.home.rooms}
            self._scenes.clear()
        return resident

    def scene(self, name: str, setting: Setting) -> Scene:
        """Return the setting of an activity as the core needs it, after an `update`."""
        known = self._scenes.get(name)
        if known is None or known[0] is not setting:
            known = self._scenes[name] = setting, self._make_scene(name, setting)
        return known[1]

    # What the core asks for.

    def spots(self, room: int) -> Sequence[Spot]:
        """Return the points of a room where the body stands."""
        return self._person.spots.in_room(self._rooms[room])

    def seats(self, setting: Setting, room: int) -> list[int]:
        """Return the numbers of the places for an activity at the furniture in a room."""
        spots, activity, rooms = self._person.spots, setting.activity, (self._rooms[room],)
        return self._numbers_of(spots.at_furniture(activity.objects, rooms, activity.posture))

    def seat(self, number: int) -> tuple[int, int, int, int, int, int]:
        """Return a place at furniture: x, y, heading, posture, and x, y from where one gets there.

        Raises:
            PlacementError: There is no such furniture now, or no place to use it from.
        """
        at = self._actor.place_at(*self._seats.things[number])
        return at.x, at.y, at.heading, POSTURES.index(at.posture), *at.approach

    def nearest(self, setting: Setting, x: int, y: int) -> int:
        """Return the room whose middle is nearest to a lattice point, in a straight line."""
        return self._person.spots.nearest(setting.rooms, x, y).index

    def room_at(self, x: int, y: int) -> int:
        """Return the room that holds a lattice point; -1 for none."""
        room = self._person.spots.room_at(x, y)
        return -1 if room is None else room.index

    def wait(self, room: int, now_us: int, takes_us: int) -> int | None:
        """Return how long to wait before the body may use a room [us]; None: not now."""
        return self._person.wait_for(room, self._actor.clock, now_us, takes_us)

    def way_out(self) -> tuple[int, int]:
        """Return the lattice point where the body leaves the home."""
        return self._actor.way_out

    # What is prepared for it, and taken from it.

    def _make_scene(self, name: str, setting: Setting) -> Scene:
        activity = setting.activity
        return Scene(
            setting,
            self._names.of(name),
            activity.away,
            CHOICES.index(activity.choose),
            POSTURES.index(activity.posture),
            [room.index for room in setting.rooms],
            self._numbers_of(setting.seats),
            [room.index for room in setting.stores],
            [(MOVE_KINDS.index(move.kind), move.waits()) for move in setting.small_moves],
            setting.fetch_takes,
        )

    def _numbers_of(self, seats: Sequence[Seat]) -> list[int]:
        return [self._seats.of(seat) for seat in seats]

    def _walk(self, plan: Plan, course: Course, place: tuple[int, int, int]) -> tuple[PlanEnd, int]:
        """Go where no shortest route leads, as plans do: wait, take another way, or raise."""
        self._take(plan, course)
        number, x, y = place
        if number < 0:
            plan.go_to_point(x, y)
        else:
            plan.use(*self._seats.things[number])
        return _end_of(plan)

    def _take(self, plan: Plan, course: Course) -> None:
        """Let a plan go on with what the core added to it."""
        end, posture, postures, notes = course
        plan.time_us, plan.x, plan.y, plan.heading, plan.away = end
        plan.posture = POSTURES[posture]
        plan.postures += postures
        names, things = self._names.things, [seat.thing for seat in self._seats.things]
        details = names, names, things, [""], [""]  # by event
        plan.notes += [
            new_note((time_us, EVENTS[what], details[what][number]))
            for time_us, what, number in notes
        ]


def _end_of(plan: Plan) -> tuple[PlanEnd, int]:
    now = plan.time_us, plan.x, plan.y, plan.heading, plan.away
    return now, POSTURES.index(plan.posture)
