"""Where floor plans come from: the base of their components, and what every file reader needs."""

import json
import math
from abc import abstractmethod
from pathlib import Path
from typing import Any, ClassVar

from pydantic import Field

from fleet2d.component import Component
from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.units import Length

# No home is as large; what is beyond was not written in metres.
MAX_COORDINATE_M = 100_000.0

Point = tuple[float, float]


class FloorPlanSource(Component):
    """A source of a floor plan.

    Attributes:
        cell: Side of a grid cell, 0.01 m to 1 m.
    """

    kind: ClassVar[str] = "floorplan"

    cell: Length = Field(default=0.05, description="side of a grid cell, 0.01 m to 1 m")

    @abstractmethod
    def load(self) -> FloorPlan:
        """Read the floor plan.

        Raises:
            FloorPlanError: The file can't be read, or is no home.
        """

    def files(self) -> list[Path]:
        """Return the files that it reads: a run notes their content, to be reproducible."""
        path = getattr(self, "path", None)
        return [] if path is None else [Path(path)]


def read_json(path: Path) -> dict[str, Any]:
    """Return the JSON object in a file.

    Raises:
        FloorPlanError: There is no such file, or it doesn't hold a JSON object.
    """
    if path.is_dir():
        raise FloorPlanError(f"{path} is a folder: name the floor plan's JSON file in it")
    try:
        content = json.loads(path.read_text(encoding="utf-8-sig"))
    except FileNotFoundError:
        raise FloorPlanError(f"there is no file {path}: check floorplan.path") from None
    except OSError as error:
        raise FloorPlanError(f"{path} can't be read: {error.strerror}") from None
    except json.JSONDecodeError as error:
        raise FloorPlanError(
            f"{path} is not JSON: {error.msg} in line {error.lineno}, column {error.colno}"
        ) from None
    except (UnicodeDecodeError, RecursionError):
        raise FloorPlanError(f"{path} is not a JSON text file: check floorplan.path") from None
    if not isinstance(content, dict):
        found = {list: "a list", str: "a text", type(None): "nothing"}.get(
            type(content), "a number"
        )
        raise FloorPlanError(f"{path} holds {found}: a floor plan is a JSON object {{…}}")
    return content


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
            f"{where} is {_shown(value)}: a list of {count} numbers [m] is expected"
        )
    for number in value:
        if isinstance(number, bool) or not isinstance(number, int | float):
            raise FloorPlanError(f"{where} is {_shown(value)}: {_shown(number)} is not a number")
        if not math.isfinite(number):
            raise FloorPlanError(f"{where} is {_shown(value)}: coordinates must be finite numbers")
        if abs(number) > MAX_COORDINATE_M:
            raise FloorPlanError(
                f"{where} is {_shown(value)}: too far out for coordinates in metres"
            )
    return tuple(float(number) for number in value)


def read_ring(value: object, where: str) -> list[Point]:
    """Return the corners of a closed outline, none repeated, the first not again at the end.

    Raises:
        FloorPlanError: It is not a list of at least three different points.
    """
    if not isinstance(value, list):
        raise FloorPlanError(f"{where} is {_shown(value)}: a list of points [x, y] is expected")
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


def _shown(value: object) -> str:
    text = json.dumps(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
