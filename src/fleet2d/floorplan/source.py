"""Sources of floor plans: the base of their components, and helpers that readers of files share."""

import hashlib
import json
from abc import abstractmethod
from collections.abc import Hashable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any, ClassVar

from pydantic import AfterValidator, Field, TypeAdapter, ValidationError, model_validator

from fleet2d.bounds import FILE_BYTES, JSON_VALUES, one_line, read_bytes
from fleet2d.configuration.components import Component
from fleet2d.configuration.units import InputPath, Length
from fleet2d.errors import FloorPlanError, InputError
from fleet2d.floorplan.cache import Cache
from fleet2d.floorplan.corrections import RoomCorrection, correct_rooms
from fleet2d.floorplan.furniture.furnishing import Furnishing, FurniturePiece, place_furniture
from fleet2d.floorplan.home.costmap import CostmapSettings
from fleet2d.floorplan.home.layers import LayerSettings, check_layers
from fleet2d.floorplan.plan import FloorPlan

YAML = (".yaml", ".yml")
# Homes that a process caches, read and furnished.
CACHED_PLANS = 8

_PLANS = Cache(CACHED_PLANS)


def keep_plans(count: int) -> None:
    """Cache at least `count` homes, read and furnished, for later runs."""
    _PLANS.grow(count)


class FloorPlanSource(Component):
    """A source of a floor plan.

    Attributes:
        cell: Side of a grid cell, 0.01 m to 1 m.
        rooms: Rooms to name, retype or draw, beyond what the source says.
        furniture: Pieces to place in the home.
        furnish: Furnish rooms without furniture by rule, by their types.
        layers: Named arrays with a value for each cell; explored, first_seen, last_seen and
            time_since_seen are maintained by the run, for each robot with a camera.
        costmap: Costs that routes of robots pay; null: they take the shortest.
    """

    kind: ClassVar[str] = "floorplan"

    # The key, and the value unless that is None, by which the content of a file is recognized.
    mark: ClassVar[tuple[str, str | None] | None] = None

    # The endings, such as ".dxf", of the files that it reads, if they aren't JSON or YAML.
    suffixes: ClassVar[tuple[str, ...]] = ()

    cell: Length = 0.05
    rooms: tuple[RoomCorrection, ...] = Field(
        default=(), examples=[[{"at": [2.5, 1.0], "name": "den", "type": "office"}]]
    )
    furniture: tuple[FurniturePiece, ...] = Field(
        default=(), examples=[[{"type": "bed", "at": [2.0, 3.5]}]]
    )
    furnish: bool | Furnishing = False
    layers: Annotated[dict[str, LayerSettings], AfterValidator(check_layers)] = Field(
        default={}, examples=[{"explored": {"every": "1 d"}, "dust": {"unit": "g"}}]
    )
    costmap: CostmapSettings | None = None

    @abstractmethod
    def load(self) -> FloorPlan:
        """Read the floor plan.

        Raises:
            FloorPlanError: The file can't be read, or is not a home.
        """

    def plan(self) -> FloorPlan:
        """Return the floor plan with the rooms and furniture that the scenario adds.

        A process reads a home only once, as long as its files and settings stay the same.

        Raises:
            FloorPlanError: The file can't be read, is not a home, or a piece doesn't fit into it.
        """
        key = self._cache_key()
        return self._read() if key is None else _PLANS.get(key, self._read)

    def _cache_key(self) -> Hashable:
        """Return all that the plan depends on, or None if that is unknown, as for a plugin."""
        cls = type(self)
        if cls.__module__.partition(".")[0] != "fleet2d":
            return None
        try:
            files = [(path, hashlib.sha256(path.read_bytes()).digest()) for path in self.files()]
        except (OSError, FloorPlanError):
            return None  # the reader raises it with its reason
        return cls, self.model_dump_json(exclude={"layers", "costmap"}), tuple(files)

    def _read(self) -> FloorPlan:
        rules = Furnishing() if self.furnish is True else self.furnish or None
        plan = correct_rooms(self.load(), self.rooms)
        return place_furniture(plan, self.furniture, rules)

    def files(self) -> list[Path]:
        """Return the files that it reads; a run records their content, to be reproducible."""
        path = getattr(self, "path", None)
        return [] if path is None else [Path(path)]


class PixelSource(FloorPlanSource):
    """A source of a floor plan made of pixels; their side is the default of `cell`.

    Attributes:
        cell: Side of a grid cell, 0.01 m to 1 m; left out: the side of the map's pixels.
    """

    cell: Length | None = None  # type: ignore[assignment]

    @classmethod
    @abstractmethod
    def usual_cell(cls, settings: Mapping[str, Any]) -> float:
        """Return the side of a cell [m] that suits the pixels.

        Args:
            settings: The settings in the scenario; only `path` is validated already.

        Raises:
            FloorPlanError: The file can't be read.
            ValidationError: A setting is wrong.
        """

    @model_validator(mode="before")
    @classmethod
    def _fill_cell(cls, data: Any) -> Any:
        """Fill in the cell, so that a stored scenario has it; errors are left to `load`."""
        if not isinstance(data, Mapping) or data.get("cell") is not None or "path" not in data:
            return data
        try:
            path = TypeAdapter(InputPath).validate_python(data["path"])
            return {**data, "cell": cls.usual_cell({**data, "path": path})}
        except (ValidationError, FloorPlanError):
            return data


# --- Files -------------------------------------------------------------------------------------


@contextmanager
def in_file(path: Path) -> Iterator[None]:
    """Put the path of a file before the errors that are raised in the block."""
    try:
        yield
    except FloorPlanError as error:
        raise FloorPlanError(f"{path}: {error}") from error


def read_document(path: Path) -> dict[str, Any]:
    """Return the mapping in a YAML file (.yaml, .yml), else the object in a JSON file.

    Raises:
        FloorPlanError: There is no such file, or it holds neither.
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
    # A home in a JSON file is set up without them.
    import yaml

    from fleet2d.configuration.documents import NodeError, parse

    text = _read_text(path, "YAML")
    try:
        content = parse(text)
    except (yaml.YAMLError, RecursionError) as error:
        raise FloorPlanError(f"{path} is not YAML: {one_line(error, 200)}") from None
    except NodeError as error:
        line = error.node.start_mark.line + 1
        raise FloorPlanError(f"{path}, line {line}: {error}") from None
    except InputError as error:
        raise FloorPlanError(f"{path}: {error}") from None
    return _mapping(content, path, "a YAML mapping of keys and values")


def _read_text(path: Path, language: str) -> str:
    if path.is_dir():
        raise FloorPlanError(f"{path} is a folder: name the floor plan's {language} file in it")
    try:
        return read_bytes(path, FILE_BYTES, FloorPlanError).decode("utf-8-sig")
    except FileNotFoundError:
        raise FloorPlanError(f"there is no file {path}: check floorplan.path") from None
    except OSError as error:
        raise FloorPlanError(f"{path} can't be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise FloorPlanError(
            f"{path} is not a {language} text file: check floorplan.path"
        ) from None


def _mapping(content: object, path: Path, expected: str) -> dict[str, Any]:
    if isinstance(content, dict):
        return content
    kinds = {list: "a list", str: "a text", type(None): "nothing"}
    kind = kinds.get(type(content), "a single value")
    raise FloorPlanError(f"{path} holds {kind}: a floor plan is {expected}")
