"""Changes of a home during a run, as data: doors, furniture, lights, and the use of rooms."""

from collections.abc import Iterable
from dataclasses import dataclass
from datetime import date, datetime, timedelta
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import BeforeValidator, Field, PlainSerializer, WithJsonSchema, model_validator

from fleet2d.configuration.components import Settings
from fleet2d.configuration.problems import problem
from fleet2d.configuration.units import format_duration, parse_duration
from fleet2d.floorplan.placed_objects import Point

VERBS = ("open", "shut", "lock", "unlock", "move", "room", "lights")
ALL_ROOMS = "all"
"""What names the lights of all rooms."""


def parse_moment(value: Any) -> datetime | timedelta:
    """Parse a local time, or the time since the start."""
    moment = _local_time(value)
    if moment is None:
        return parse_duration(value)
    if moment.tzinfo is not None:
        raise problem("expected a local time of the home, without a time zone")
    return moment


def _local_time(value: Any) -> datetime | None:
    """Return the date and time that a value is, or None if it is something else."""
    if isinstance(value, datetime):
        return value
    if isinstance(value, date):
        return datetime(value.year, value.month, value.day)
    try:
        return datetime.fromisoformat(value) if isinstance(value, str) else None
    except ValueError:
        return None


def format_moment(moment: datetime | timedelta) -> str:
    """Format a moment as `parse_moment` reads it."""
    return moment.isoformat() if isinstance(moment, datetime) else format_duration(moment)


Moment = Annotated[
    datetime | timedelta,
    BeforeValidator(parse_moment),
    PlainSerializer(format_moment),
    WithJsonSchema(
        {
            "description": "a local time like 2026-01-07T14:00, or the time since the start like"
            " '2 d 14 h'",
            "type": ["string", "number", "object"],
            "examples": ["2026-01-07T14:00", "2 d"],
        }
    ),
]


class HomeChange(Settings):
    """One change of the home: exactly one of open, shut, lock, unlock, move, room, lights.

    Attributes:
        at: Time of the change; left out by an algorithm or a script: now.
        open: The door that is opened.
        shut: The door that is shut.
        lock: The door that is locked.
        unlock: The door that is unlocked.
        move: The piece of furniture that is moved.
        to: New place of its middle, [x, y] in metres.
        turn_deg: Angle by which it is turned, counter-clockwise.
        room: The room whose use changes.
        type: The type of the room from then on.
        lights: The room whose light is switched, a kind of rooms, or `all`.
        turn: How it is switched: `on` or `off`.

    Example:
        >>> HomeChange(shut="bath_door").verb
        'shut'
        >>> HomeChange(at="2 d", room="office_0", type="bedroom").at
        datetime.timedelta(days=2)
    """

    at: Moment | None = None
    open: str | None = None
    shut: str | None = None
    lock: str | None = None
    unlock: str | None = None
    move: str | None = None
    to: Point | None = None
    turn_deg: float = Field(default=0.0, ge=-3600, le=3600)
    room: str | None = None
    type: str | None = None
    lights: str | None = None
    turn: Literal["on", "off"] | None = None

    @model_validator(mode="after")
    def _is_one_change(self) -> Self:
        verbs = [verb for verb in VERBS if getattr(self, verb) is not None]
        if len(verbs) != 1:
            listed = " and ".join(verbs) or "nothing"
            raise problem(f"give exactly one of {', '.join(VERBS)}, got {listed}")
        for verb, further in (("move", "to"), ("room", "type"), ("lights", "turn")):
            if (verbs[0] == verb) != (getattr(self, further) is not None):
                raise problem(f"'{verb}' and '{further}' go together")
        return self

    @property
    def verb(self) -> str:
        """The verb of the change, such as `shut`."""
        return next(verb for verb in VERBS if getattr(self, verb) is not None)

    @property
    def target(self) -> str:
        """The name of the door, object or room that changes."""
        return str(getattr(self, self.verb))


@dataclass(frozen=True)
class HomeChanges:
    """Changes of the home that an algorithm requests from the next step on.

    Example:
        >>> output = HomeChanges([HomeChange(shut="bath_door")])
        >>> output.to_columns()["target"].tolist()
        ['bath_door']
    """

    changes: tuple[HomeChange, ...]

    def __init__(self, changes: Iterable[HomeChange]) -> None:
        object.__setattr__(self, "changes", tuple(changes))

    def to_columns(self) -> dict[str, np.ndarray[Any, Any]]:
        """Return the changes as columns of a table."""
        return {
            "change": np.array([change.verb for change in self.changes], object),
            "target": np.array([change.target for change in self.changes], object),
        }
