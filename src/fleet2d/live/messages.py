"""Messages of a live run: what other programs may send to it, and their JSON Schema."""

import json
from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import Field, TypeAdapter, ValidationError

from fleet2d.configuration.components import Settings
from fleet2d.configuration.units import AngleDeg, SignedSpeed, SignedTurnRateDeg
from fleet2d.errors import InputError
from fleet2d.interventions.robots import MAX_PLACE_M, RealDetection

MAX_BYTES = 1 << 20
"""Size of a message."""
MAX_ID = 200
"""Length of the name of a goal."""
MAX_NUMBER = 1 << 53
"""The largest number of a message; all programs write numbers up to here in full."""
Coordinate = Annotated[float, Field(ge=-MAX_PLACE_M, le=MAX_PLACE_M)]


class LiveMessage(Settings):
    """Base of messages.

    Attributes:
        time: When it was sent [s since 1970 UTC]; with it, late messages are noticed.
        number: Its number among those of its sender; with it, lost messages are noticed.
    """

    time: float | None = None
    number: int | None = Field(default=None, ge=0, le=MAX_NUMBER)


class PoseMessage(LiveMessage):
    """Where a real person or robot is.

    Attributes:
        type: "pose".
        entity: The body, whose behavior is `live`.
        x: Its place along x [m].
        y: Its place along y [m].
        heading_deg: Its heading, counter-clockwise from +x; left out: as before.
    """

    type: Literal["pose"] = "pose"
    entity: str
    x: Coordinate
    y: Coordinate
    heading_deg: AngleDeg | None = None


class GoalMessage(LiveMessage):
    """Where a body is to go; it stays there until the next goal.

    What becomes of it is told by messages of the type "goal_state".

    Attributes:
        type: "goal".
        entity: The body.
        to: A room, furniture, or a point [x, y].
        heading_deg: Its heading there, counter-clockwise from +x; left out: as it arrives.
        id: A name of the goal, which its states repeat.
    """

    type: Literal["goal"] = "goal"
    entity: str
    to: str | tuple[Coordinate, Coordinate]
    heading_deg: AngleDeg | None = None
    id: str = Field(default="", max_length=MAX_ID)


class CancelMessage(LiveMessage):
    """Withdraws the goal of a body, which then does what its behaviors decide.

    Attributes:
        type: "cancel".
        entity: The body.
        id: The goal; left out: whichever it has.
    """

    type: Literal["cancel"] = "cancel"
    entity: str
    id: str = Field(default="", max_length=MAX_ID)


class VelocityMessage(LiveMessage):
    """How fast a robot is to move; it stops if no other one arrives for 0.5 s of simulated time.

    Attributes:
        type: "velocity".
        entity: The robot.
        forward: Its speed ahead, or back if negative.
        left: Its speed to the left; 0 unless its drive is holonomic.
        turn_deg: How fast it turns, counter-clockwise.
    """

    type: Literal["velocity"] = "velocity"
    entity: str
    forward: SignedSpeed = 0.0
    left: SignedSpeed = 0.0
    turn_deg: SignedTurnRateDeg = 0.0


class DetectionsMessage(LiveMessage):
    """Whom a real robot detects at present.

    Attributes:
        type: "detections".
        entity: The robot, whose `perceives` is `live`.
        detections: The people, as {user: ana, x: 1.5, y: 2}; a user may be 'unknown'.
    """

    type: Literal["detections"] = "detections"
    entity: str
    detections: tuple[RealDetection, ...] = Field(max_length=1000)


class ReadingMessage(LiveMessage):
    """The state of a real sensor.

    Attributes:
        type: "reading".
        sensor: The sensor, of the type `live_sensor`.
        on: Whether it is on.
    """

    type: Literal["reading"] = "reading"
    sensor: str
    on: bool


Message = Annotated[
    PoseMessage
    | GoalMessage
    | CancelMessage
    | VelocityMessage
    | DetectionsMessage
    | ReadingMessage,
    Field(discriminator="type"),
]
_MESSAGES: TypeAdapter[Any] = TypeAdapter(Message)


def message_schema() -> dict[str, Any]:
    """Return the JSON Schema of the messages that a live run receives."""
    return {"title": "Messages to a live run of Fleet2D", **_MESSAGES.json_schema()}


def first_fault(error: ValidationError) -> str:
    """Return the first fault of a message, with its place."""
    first = error.errors()[0]
    place = ".".join(str(part) for part in first["loc"])
    return f"{place}: {first['msg']}" if place else first["msg"]


def parse_message(content: str | bytes | Mapping[str, Any]) -> LiveMessage:
    """Read a message.

    Raises:
        InputError: The content is no JSON, too long, or no such message.

    Example:
        >>> parse_message('{"type": "goal", "entity": "astro", "to": "kitchen"}').to
        'kitchen'
    """
    try:
        if isinstance(content, str | bytes):
            if len(content) > MAX_BYTES:
                raise InputError(f"a message of {len(content)} bytes; {MAX_BYTES} are allowed")
            content = json.loads(content)
        message: LiveMessage = _MESSAGES.validate_python(content)
    except ValidationError as error:
        raise InputError(first_fault(error)) from None
    except (ValueError, RecursionError) as error:
        raise InputError(f"not JSON: {error}") from None
    return message
