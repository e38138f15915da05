"""Keeping out: zones that a robot avoids at all times, at hours, or by its belief."""

from collections.abc import Iterator
from datetime import datetime
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple, Self

import numpy as np
from pydantic import Field, GetJsonSchemaHandler, create_model, model_validator
from pydantic_core import CoreSchema
from shapely import Polygon

from fleet2d.configuration.components import Settings
from fleet2d.configuration.problems import problem, problem_at
from fleet2d.configuration.units import Length
from fleet2d.entities.behavior import Hours, holds
from fleet2d.entities.place import is_kind, matching_rooms
from fleet2d.errors import PlacementError, errors_as
from fleet2d.floorplan.placed_objects import POSTURES
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.kernels import I32, I64
from fleet2d.kernels import SightingColumn as Column

if TYPE_CHECKING:
    from fleet2d.entities.body import Body

LYING = POSTURES.index("lie")


class _Place(Settings):
    """The keys of `KeptOut` whose names Python's grammar allows."""

    short_form = "room", (str,)

    room: str | None = Field(default=None, min_length=1, examples=["bedroom"])
    area: tuple[tuple[Length, Length], ...] | None = Field(
        default=None,
        min_length=3,
        max_length=1000,
        examples=[[[1.0, 0.5], [2.5, 0.5], [2.5, 2.0]]],
    )
    during: Hours = ()
    passing: bool = False

    @model_validator(mode="after")
    def _is_somewhere(self) -> Self:
        asleep = getattr(self, "while") is not None
        if self.room is not None and self.area is not None:
            raise problem("give 'room' or 'area', not both: write two entries")
        if self.room is None and self.area is None and not asleep:
            raise problem("it says nowhere: give 'room', 'area', or while: asleep")
        if self.area is not None and not Polygon(self.area).is_valid:
            raise problem_at(("area",), "the sides cross: give the corners in their order")
        if self.passing and (self.area is not None or asleep or self.during):
            raise problem_at(("passing",), "only a room without hours may have it")
        return self


_WHILE: Any = Literal["asleep"] | None
_KEYWORDS: Any = {"while": (_WHILE, None)}  # `while` is no name for a field of a class
KeptOut: Any = create_model(
    "KeptOut",
    __base__=_Place,
    __doc__="""Where a robot keeps out, in a list `keep_out`; a text is a room.

    Attributes:
        room: A room, or a kind of rooms if the home has it; with `while` it may be left out.
        area: In place of a room, the corners of an area [m].
        during: The hours in which it does; left out: at all times.
        while: asleep: as long as it believes that somebody sleeps there, whom it last saw lying.
        passing: Whether ways may lead through; it only starts and stops nowhere there.
    """,
    **_KEYWORDS,
)


class _OrRoom:
    """Adds to the schema of `KeptOut` that a text is a room."""

    @classmethod
    def __get_pydantic_json_schema__(
        cls, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        return {"anyOf": [{"type": "string", "minLength": 1}, handler(schema)]}


KeptOutField = Annotated[KeptOut, _OrRoom]


class TimedZones(NamedTuple):
    """Zones that a robot keeps out of at some hours or by its belief.

    Attributes:
        zones: The numbers of the zones: see `Home.area`.
        during: The hours; none: at all times.
        asleep: Whether only zones count in which the robot believes that somebody sleeps.
    """

    zones: frozenset[int]
    during: Hours
    asleep: bool

    @property
    def about(self) -> str:
        """The times of keeping out, for notes."""
        hours = ", ".join(span.text for span in self.during)
        about = f" {hours}" if hours else ""
        return f"{about} while somebody sleeps" if self.asleep else about


class KeepOutRules:
    """The zones of a robot's `keep_out` in its home.

    Attributes:
        always: The zones that the robot never enters.
        no_stops: The rooms through which it may pass.
        timed: The other zones, with their times.
    """

    def __init__(self, body: "Body", entries: tuple[Any, ...]) -> None:
        """Find the rooms and areas.

        Raises:
            PlacementError: There is no such room.
        """
        always: set[int] = set()
        no_stops: set[int] = set()
        self.timed: list[TimedZones] = []
        for entry in entries:
            zones = _zones(body, entry)
            asleep = getattr(entry, "while") is not None
            if entry.passing:
                no_stops |= zones
            elif asleep or entry.during:
                self.timed.append(TimedZones(zones, entry.during, asleep))
            else:
                always |= zones
        self.always = frozenset(always)
        self.no_stops = frozenset(no_stops)

    @property
    def minds_sleep(self) -> bool:
        """Whether it depends on where somebody sleeps."""
        return any(timed.asleep for timed in self.timed)

    def active(self, time: datetime, sleepers: frozenset[int]) -> frozenset[int]:
        """Return the zones of `timed` that it keeps out of at a local time.

        Args:
            time: The time.
            sleepers: The rooms in which the robot believes that somebody sleeps.
        """
        zones = frozenset[int]()
        for timed in self.timed:
            if not timed.during or holds(timed.during, time) is not None:
                zones |= timed.zones & sleepers if timed.asleep else timed.zones
        return zones

    def changes_at(self, time: datetime) -> Iterator[datetime]:
        """Yield when hours begin or end after a local time."""
        for timed in self.timed:
            for span in timed.during:
                yield span.end_at(time) or span.next_begin(time)


def _zones(body: "Body", entry: Any) -> frozenset[int]:
    rooms = body.home.rooms
    if entry.area is not None:
        with errors_as(PlacementError, f"{body.path}.keep_out", of=PlacementError):
            body.home.plan.check_area(entry.area)
        return frozenset({body.home.area(entry.area)})
    if entry.room is None:
        return frozenset(room.index for room in rooms)
    try:
        _, matches = matching_rooms((entry.room,), rooms, rooms)
    except PlacementError as error:
        if not is_kind(body, (entry.room,)):
            raise PlacementError(f"{body.path}.keep_out: {error}") from None
        body.notes.append(f"keep_out: this home has no {entry.room}")
        return frozenset()
    return frozenset(room.index for room in matches)


class SleepMemory:
    """The room in which a robot last saw each person, and whether the person was lying."""

    def __init__(self, plan: FloorPlan) -> None:
        self._plan = plan
        self._last: dict[int, tuple[int | None, bool]] = {}

    @property
    def rooms(self) -> frozenset[int]:
        """The rooms in which the robot believes that somebody sleeps."""
        lying_in = (room for room, lies in self._last.values() if lies)
        return frozenset(room for room in lying_in if room is not None)

    def take(self, step: I64, index: I32, distinct: I64) -> None:
        """Add sightings; see `fleet2d.algorithms.observations.SightingTable`."""
        last = np.full(len(distinct), -1, np.int64)
        last[index] = np.arange(len(index))
        for row in distinct[np.argsort(last, kind="stable")].tolist():
            room = self._plan.room_of_point(row[Column.X], row[Column.Y])
            number = None if room is None else room.index
            self._last[row[Column.IDENTITY]] = number, row[Column.POSTURE] == LYING
