"""Where floor plans come from: the base of their components, and what every file reader needs."""

import hashlib
import json
import math
from abc import abstractmethod
from collections.abc import Hashable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, ClassVar

import yaml
from pydantic import AfterValidator, Field, TypeAdapter, ValidationError, model_validator

from fleet2d import yaml_tree
from fleet2d.bounds import FILE_BYTES, JSON_VALUES, one_line, read_bytes
from fleet2d.component import Component
from fleet2d.errors import FloorPlanError, InputError
from fleet2d.floorplan.corrections import RoomCorrection, corrected
from fleet2d.floorplan.furniture.furnishing import Furnishing, FurniturePiece, furnished
from fleet2d.floorplan.home.costmap import CostmapSettings
from fleet2d.floorplan.home.layers import LayerSettings, check_layers
from fleet2d.floorplan.kept import Kept
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.paths import InputPath
from fleet2d.units import Length
from fleet2d.yaml_tree import NodeError

# No home is as large; what is beyond was not written in metres.
MAX_COORDINATE_M = 100_000.0
TINY = 1e-12

YAML = (".yaml", ".yml")
# Homes that a process keeps, read and furnished.
PLANS_KEPT = 8

_PLANS = Kept(PLANS_KEPT)


def keep_plans(count: int) -> None:
    """Keep so many homes, read and furnished, for later runs."""
    _PLANS.keep(count)


Point = tuple[float, float]


class FloorPlanSource(Component):
    """A source of a floor plan.

    Attributes:
        cell: Side of a grid cell, 0.01 m to 1 m.
        rooms: What rooms are called and used for, where the source is silent or wrong.
        furniture: Pieces that the scenario places in the home.
        furnish: Whether rooms without furniture are furnished by rule, or how.
    """

    kind: ClassVar[str] = "floorplan"

    cell: Length = Field(default=0.05, description="side of a grid cell, 0.01 m to 1 m")
    rooms: tuple[RoomCorrection, ...] = Field(
        default=(),
        description="rooms to name, retype or draw, beyond what the source says",
        examples=[[{"at": [2.5, 1.0], "name": "den", "type": "office"}]],
    )
    furniture: tuple[FurniturePiece, ...] = Field(
        default=(),
        description="pieces to place in the home",
        examples=[[{"type": "bed", "at": [2.0, 3.5]}]],
    )
    furnish: bool | Furnishing = Field(
        default=False, description="furnish the rooms that hold nothing by rule, by their types"
    )
    layers: Annotated[dict[str, LayerSettings], AfterValidator(check_layers)] = Field(
        default={},
        description="named arrays with a value for each cell; explored, first_seen, last_seen and"
        " time_since_seen are kept by the run, for each robot with a camera",
        examples=[{"explored": {"every": "1 d"}, "dust": {"unit": "g"}}],
    )
    costmap: CostmapSettings | None = Field(
        default=None, description="what makes ways of robots dear; null: they take the shortest"
    )

    @abstractmethod
    def load(self) -> FloorPlan:
        """Read the floor plan.

        Raises:
            FloorPlanError: The file can't be read, or is no home.
        """

    def plan(self) -> FloorPlan:
        """Return the floor plan with all that the scenario adds to it.

        A process reads a home once, as long as its files and what is configured stay the same.

        Raises:
            FloorPlanError: The file can't be read, is no home, or something doesn't fit into it.
        """
        key = self._content()
        return self._read() if key is None else _PLANS.get(key, self._read)

    def _content(self) -> Hashable:
        """Return what the plan depends on; None if that isn't known, as of a user's own source."""
        cls = type(self)
        if cls.__module__.partition(".")[0] != "fleet2d":
            return None
        try:
            files = [(path, hashlib.sha256(path.read_bytes()).digest()) for path in self.files()]
        except (OSError, FloorPlanError):
            return None  # reading it says what is wrong
        return cls, self.model_dump_json(exclude={"layers", "costmap"}), tuple(files)

    def _read(self) -> FloorPlan:
        rules = Furnishing() if self.furnish is True else self.furnish or None
        plan = corrected(self.load(), self.rooms)
        return furnished(plan, self.furniture, rules)

    def files(self) -> list[Path]:
        """Return the files that it reads: a run notes their content, to be reproducible."""
        path = getattr(self, "path", None)
        return [] if path is None else [Path(path)]


class PixelSource(FloorPlanSource):
    """A source of a floor plan that is made of pixels: their side is the cell, unless one is given.

    Attributes:
        cell: Side of a grid cell, 0.01 m to 1 m; None for the side of the pixels.
    """

    cell: Length | None = Field(  # type: ignore[assignment]
        default=None,
        description="side of a grid cell, 0.01 m to 1 m; left out: the side of the map's pixels",
    )

    @classmethod
    @abstractmethod
    def usual_cell(cls, settings: Mapping[str, Any]) -> float:
        """Return the side of a cell [m] that suits the pixels.

        Args:
            settings: What the scenario says; `path` is checked, the rest is not.

        Raises:
            FloorPlanError: The file can't be read.
            ValidationError: A setting is wrong.
        """

    @model_validator(mode="before")
    @classmethod
    def _fill_cell(cls, data: Any) -> Any:
        """Fill in the cell, so that a stored scenario has it; `load` says what is wrong."""
        if not isinstance(data, Mapping) or data.get("cell") is not None or "path" not in data:
            return data
        try:
            path = TypeAdapter(InputPath).validate_python(data["path"])
            return {**data, "cell": cls.usual_cell({**data, "path": path})}
        except (ValidationError, FloorPlanError):
            return data


# --- Files -------------------------------------------------------------------------------------


def read_document(path: Path) -> dict[str, Any]:
    """Return the mapping in a YAML file (.yaml, .yml), else the object in a JSON file.

    Raises:
        FloorPlanError: There is no such file, or it doesn't hold that.
    """
    return read_yaml(path) if path.suffix.lower() in YAML else read_json(path)


def read_json(path: Path) -> dict[str, Any]:
    """Return the JSON object in a file.

    Raises:
        FloorPlanError: There is no such file, or it doesn't hold a JSON object.
    """
    text = _read_text(path, "JSON")
    values = text.count(",") + text.count("[") + text.count("{")
    JSON_VALUES.check(values, path, FloorPlanError, least="about ")
    try:
        content = json.loads(text)
    except json.JSONDecodeError as error:
        raise FloorPlanError(
            f"{path} is not JSON: {error.msg} in line {error.lineno}, column {error.colno}"
        ) from None
    except RecursionError:
        raise FloorPlanError(
            f"{path} is not a floor plan: it has lists in lists without end"
        ) from None
    except ValueError as error:  # a number of more digits than Python converts
        raise FloorPlanError(f"{path} is not a floor plan: {error}") from None
    return _mapping(content, path, "a JSON object {…}")


def read_yaml(path: Path) -> dict[str, Any]:
    """Return the mapping in a YAML file.

    Raises:
        FloorPlanError: There is no such file, or it doesn't hold a YAML mapping.
    """
    text = _read_text(path, "YAML")
    try:
        content = yaml_tree.parse(text)
    except (yaml.YAMLError, RecursionError) as error:
        raise FloorPlanError(f"{path} is not YAML: {one_line(error, 200)}") from None
    except NodeError as error:
        line = error.node.start_mark.line + 1
        raise FloorPlanError(f"{path}, line {line}: {error}") from None
    except InputError as error:
        raise FloorPlanError(f"{path}: {error}") from None
    return _mapping(content, path, "a YAML mapping of keys and values")


def _read_text(path: Path, what: str) -> str:
    if path.is_dir():
        raise FloorPlanError(f"{path} is a folder: name the floor plan's {what} file in it")
    try:
        return read_bytes(path, FILE_BYTES, FloorPlanError).decode("utf-8-sig")
    except FileNotFoundError:
        raise FloorPlanError(f"there is no file {path}: check floorplan.path") from None
    except OSError as error:
        raise FloorPlanError(f"{path} can't be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise FloorPlanError(f"{path} is not a {what} text file: check floorplan.path") from None


def _mapping(content: object, path: Path, wanted: str) -> dict[str, Any]:
    if isinstance(content, dict):
        return content
    kinds = {list: "a list", str: "a text", type(None): "nothing"}
    found = kinds.get(type(content), "a single value")
    raise FloorPlanError(f"{path} holds {found}: a floor plan is {wanted}")


# --- Values ------------------------------------------------------------------------------------


def read_numbers(value: object, count: int, where: str) -> tuple[float, ...]:
    """Return `count` coordinates [m] of a JSON list.

    Args:
        value: What the file has.
        count: How many there must be.
        where: How an error names the place in the file.

    Raises:
        FloorPlanError: It is not a list of so many finite numbers in a sensible range.
    """
    if not isinstance(value, list) or len(value) != count:
        raise FloorPlanError(
            f"{where} is {shown_value(value)}: a list of {count} numbers [m] is expected"
        )
    for number in value:
        if isinstance(number, bool) or not isinstance(number, int | float):
            found = shown_value(number)
            raise FloorPlanError(f"{where} is {shown_value(value)}: {found} is not a number")
        if isinstance(number, float) and not math.isfinite(number):
            raise FloorPlanError(
                f"{where} is {shown_value(value)}: coordinates must be finite numbers"
            )
        if abs(number) > MAX_COORDINATE_M:
            raise FloorPlanError(
                f"{where} is {shown_value(value)}: too far out for coordinates in metres"
            )
    return tuple(settled(number) for number in value)


def settled(number: float) -> float:
    """Return a coordinate as a float; what is next to nothing is 0, for GEOS divides by it."""
    return 0.0 if abs(number) < TINY else float(number)


def read_ring(value: object, where: str) -> list[Point]:
    """Return the corners of a closed outline, none repeated, the first not again at the end.

    Raises:
        FloorPlanError: It is not a list of at least three different points.
    """
    if not isinstance(value, list):
        raise FloorPlanError(
            f"{where} is {shown_value(value)}: a list of points [x, y] is expected"
        )
    points: list[Point] = []
    for number, item in enumerate(value):
        x, y = read_numbers(item, 2, f"{where}[{number}]")
        if not points or points[-1] != (x, y):
            points.append((x, y))
    while len(points) > 1 and points[0] == points[-1]:
        points.pop()
    if len(set(points)) < 3:
        raise FloorPlanError(
            f"{where} has {len(set(points))} different points: an outline has at least 3"
        )
    return points


def distinct_names(names: Sequence[str | None], what: str, notes: list[str]) -> list[str | None]:
    """Return names with a number after those that came before; what has none keeps none.

    >>> distinct_names(["Bath", "Bath", None, "Bath 2"], "rooms", [])
    ['Bath', 'Bath 3', None, 'Bath 2']
    """
    found: list[str | None] = []
    wanted, used = set(names), set[str]()
    number: dict[str, int] = {}
    for name in names:
        own = name
        while (
            name is not None
            and own is not None
            and (own in used or (own != name and own in wanted))
        ):
            number[name] = number.get(name, 1) + 1
            own = f"{name} {number[name]}"
        if own != name:
            notes.append(f"several {what} are called {name}: one of them is {own} here")
        if own is not None:
            used.add(own)
        found.append(own)
    return found


def shown_value(value: object) -> str:
    """Return what a file has, for a message: as in JSON, and cut where it is long.

    >>> shown_value([True, None, "x" * 100])
    '[true, null, "xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx...'
    """
    text = _json(value, 3)
    return text if len(text) <= 60 else f"{text[:57]}..."


def _json(value: object, depth: int) -> str:
    """Write the beginning of a value; however large and deep it is, that is quick."""
    if isinstance(value, list | dict) and value and depth == 0:
        return "[…]" if isinstance(value, list) else "{…}"
    if isinstance(value, list):
        return f"[{', '.join(_json(item, depth - 1) for item in value[:30])}]"
    if isinstance(value, dict):
        first = list(value.items())[:30]
        pairs = (f"{_json(key, 0)}: {_json(item, depth - 1)}" for key, item in first)
        return f"{{{', '.join(pairs)}}}"
    if isinstance(value, int) and abs(value) >= 10**60:
        return f"a whole number of {value.bit_length()} bits"
    if isinstance(value, str):
        value = value[:100]
    return json.dumps(value, default=str)
