"""The data that the page receives, as types that Python and TypeScript share.

`tools.contract_types` generates the TypeScript side, ``page/src/contract.ts``, from them; a
test compares both.
"""

from typing import Annotated, Any, Literal, TypeVar

from pydantic import Field, TypeAdapter
from typing_extensions import TypedDict  # pydantic reads that of typing only from Python 3.12 on

from fleet2d.errors import InputError
from fleet2d.runtime.events import EventKind

Point = tuple[float, float]
Shape = TypeVar("Shape")
# The largest size of a request with an order.
MAX_BODY_BYTES = 4_096


def read_body(
    body: bytes, shape: TypeAdapter[Shape], refusal: str, most: int = MAX_BODY_BYTES
) -> Shape:
    """Return the content of a request that is JSON of a type of the contract.

    Args:
        body: The body of the request.
        shape: The adapter of the type.
        refusal: The message if the body is of another type.
        most: The largest number of bytes.

    Raises:
        InputError: The body is of another type, or too long.

    Example:
        >>> read_body(b'{"of": "run/0", "step": 4}', BRANCH_ORDER, "no order")
        {'of': 'run/0', 'step': 4}
    """
    try:
        if len(body) > most:
            raise ValueError
        return shape.validate_json(body, strict=True)
    except ValueError:
        raise InputError(refusal) from None


class RoomFacts(TypedDict):
    """A room: its colours on the plan and in lanes, and the anchor of its name [m]."""

    name: str
    type: str
    color: str
    deep_color: str
    anchor: Point
    area_m2: float


class DoorFacts(TypedDict):
    """A door: its jambs [m], and whether it is open and locked when the run starts."""

    name: str
    start: Point
    end: Point
    open: bool
    locked: bool


class DoorwayFacts(TypedDict):
    """A passage between two rooms: its jambs [m], and whether a door can shut it."""

    start: Point
    end: Point
    leaf: bool


class UseFacts(TypedDict):
    """A place from which a piece of furniture is used [m], and how a person is there [rad]."""

    x: float
    y: float
    heading: float
    posture: str


class ShapeFacts(TypedDict):
    """A shape of a symbol [m]: left, bottom, right and top of a box or an ellipse, ends of a line.

    Boxes have corners of a `radius`. Colours are hexadecimal, with or without an opacity.
    """

    kind: Literal["box", "ellipse", "line"]
    at: tuple[float, float, float, float]
    fill: str | None
    edge: str | None
    radius: float


class ObjectFacts(TypedDict):
    """A piece of furniture: its outline and middle [m], the direction of its front [rad], its uses.

    `blocks` says whether it is in the way of nothing, paths or sight. `symbol` is the number of its
    symbol among those of its home, which is drawn at its middle; -1: it is drawn as its outline.
    """

    name: str
    type: str
    outline: list[Point]
    middle: Point
    symbol: int
    blocks: str
    front: float
    uses: list[UseFacts]


class HomeFacts(TypedDict):
    """A home: outlines in metres, cells as runs of equal rooms.

    `free` lists polygons, each an outline and its holes. `room_cells` are pairs (room, number of
    cells), row by row from the lowest; -1 is no room. `place_cells` are such pairs, too, in which
    cells that a wall cuts have the room of a cell beside them: somebody may be in their free part.
    """

    name: str
    cell: float
    origin_units: tuple[int, int]
    units_per_m: float
    columns: int
    rows: int
    bounds: tuple[float, float, float, float]
    area_m2: float
    free: list[list[list[Point]]]
    rooms: list[RoomFacts]
    room_cells: list[int]
    place_cells: list[int]
    doorways: list[DoorwayFacts]
    doors: list[DoorFacts]
    objects: list[ObjectFacts]
    symbols: list[list[ShapeFacts]]
    no_go: list[list[Point]]
    entrance: Point | None


class CameraFacts(TypedDict):
    """A camera: range [m], angles [rad], offset forward and to the left [m]."""

    name: str
    near: float
    far: float
    angle: float
    forward: float
    left: float
    heading: float
    pan: list[float]
    pan_us: int


class BodyFacts(TypedDict):
    """A user or a robot; `keys` are those of its behaviors while the run is under way."""

    name: str
    robot: bool
    color: str
    radius: float
    cameras: list[CameraFacts]
    behaviors: list[str]
    keys: dict[str, dict[str, Any]]


class ColumnFacts(TypedDict):
    """A column of a table."""

    name: str
    kind: str
    unit: str
    description: str


class TableFacts(TypedDict):
    """A table of the run, and the kind of component that wrote it."""

    name: str
    rows: int
    bytes: int
    role: Literal["log", "algorithm", "metric", "layer"]
    columns: list[ColumnFacts]


class WallsChange(TypedDict):
    """The number of the walls that block sight from this step on."""

    step: int
    walls: int


class WallsFacts(TypedDict):
    """Walls that block sight, as a mesh [lattice]: x and y of vertices, indices of triangles."""

    vertices: list[int]
    triangles: list[int]
    neighbors: list[int]


class MarkFacts(TypedDict):
    """A mark on the timeline: an intervention, or a stretch in which an expectation held or not.

    It lasts from `step` to before `end`. Marks of a `lane` don't overlap, except interventions.
    """

    lane: str
    step: int
    end: int
    kind: Literal["intervention", "held", "violated", "open"]
    label: str


class VerdictFacts(TypedDict):
    """What became of an expectation; `step` is the first at which it is violated."""

    name: str
    outcome: Literal["violated", "held", "not decided", "untested"]
    says: str
    step: int | None


class StoryFacts(TypedDict):
    """A moment that is worth a look, and the bodies that it is about, the most important first."""

    step: int
    title: str
    words: str
    who: list[str]


class SlowFacts(TypedDict):
    """A floor that slows robots down from `step` to before `end`: its outline [m], its effect."""

    outline: list[Point]
    words: str
    step: int
    end: int


class PostureFacts(TypedDict):
    """Stretches in which people sit or lie [us since the start], by user and time.

    `use` is the number of the place in `uses`.
    """

    uses: list[UseFacts]
    user: list[str]
    use: list[int]
    from_us: list[int]
    to_us: list[int]


class SightingFacts(TypedDict):
    """Stretches in which a robot noticed a user: steps `first` to `last`, both included.

    `false` marks stretches in which the robot took something else for that user.
    """

    robot: str
    user: str
    first: list[int]
    last: list[int]
    false: list[bool]


class RunFacts(TypedDict):
    """Everything about a run but its tables; steps `first_step` to `end_step` - 1 are shown.

    With `starts_unlit` all lights are off at first; its events switch them. `event_kinds` are all
    that Fleet2D records, also those that the run has none of. `verdict` sums up the
    `verdicts`, of which violated ones come first. `skies` has for each day the hours until which it
    is dark, from which and until which it is light, and from which it is dark again; the last holds
    for the days that follow, too. `start` is UTC if the home has a time zone; `offsets` has then
    from when on [us since the start] which offset [us] holds, else nothing.
    """

    title: str
    status: str
    notes: list[str]
    start: str
    offsets: list[tuple[int, int]]
    step_us: int
    steps: int
    first_step: int
    end_step: int
    seed: int | None
    digest: str | None
    version: str
    home: HomeFacts
    bodies: list[BodyFacts]
    tables: list[TableFacts]
    walls: list[WallsChange]
    marks: list[MarkFacts]
    verdict: str
    verdicts: list[VerdictFacts]
    story: list[StoryFacts]
    slows: list[SlowFacts]
    skies: list[tuple[float, float, float, float]]
    starts_unlit: bool
    event_kinds: list[EventKind]
    metrics: dict[str, Any]
    scenario: dict[str, Any]
    walks_every_s: float


class NoteFacts(TypedDict):
    """A note at a step of a run; without a text it is a bookmark."""

    step: Annotated[int, Field(ge=0, lt=1 << 53)]
    text: Annotated[str, Field(max_length=2_000)]


NOTES = TypeAdapter(Annotated[list[NoteFacts], Field(max_length=1_000)])


class Problem(TypedDict):
    """The reason why something can't be shown."""

    message: str


class SessionFacts(TypedDict):
    """The stored runs that the page shows, by title, and those that are under way."""

    runs: list[str]
    live: list["LiveSession"]
    version: str


class LiveSession(TypedDict):
    """A run that is under way, at a path of the server.

    A branch repeats the run at the path `of` until before the step `since`.
    """

    path: str
    title: str
    of: str
    since: int


class BranchOrder(TypedDict):
    """A wish of the page to continue the run at a path of the server from a step."""

    of: str
    step: int


BRANCH_ORDER = TypeAdapter(BranchOrder)


class LiveBody(TypedDict):
    """A body at a step of a running simulation [lattice], and its path ahead: time [us], x, y.

    It follows a plan of its `behavior`, whose last note is the `reason`. At the step `decides` its
    behaviors are asked next, if nothing interrupts it; -1: at none.
    """

    name: str
    x: int
    y: int
    heading: int
    away: bool
    ahead: list[tuple[int, int, int]]
    behavior: str
    reason: str
    decides: int


class LiveEvent(TypedDict):
    """An event of a running simulation."""

    step: int
    entity: str
    event: str
    user: str
    detail: str


class LiveFrame(TypedDict):
    """The state of a running simulation; `speed` 0 is as fast as it goes.

    `beliefs` are of algorithms about users: shares of rooms and last of away, which sum to 1.
    `served_as` is the number of the stored run that it has become; -1 while it is under way.
    """

    step: int
    paused: bool
    done: bool
    speed: float
    achieved: float
    bodies: list[LiveBody]
    seen: list[tuple[str, str]]
    doors: dict[str, bool]
    beliefs: dict[str, dict[str, list[float]]]
    events: list[LiveEvent]
    marks: list[MarkFacts]
    slows: list[SlowFacts]
    walls: int
    message: str
    served_as: int


OrderNumber = Annotated[float, Field(gt=-1e9, lt=1e9)]


class LiveOrder(TypedDict):
    """A command of the page to a running simulation; `x` and `y` in metres.

    `configure` changes the `key` of a behavior, such as `hangout.tau`, to the value that `text`
    is in YAML.
    """

    action: Literal[
        "pause", "resume", "step", "speed", "door", "place", "call", "replan", "configure", "end"
    ]
    target: str
    value: OrderNumber
    x: OrderNumber
    y: OrderNumber
    key: str
    text: str


LIVE_ORDER = TypeAdapter(LiveOrder)
