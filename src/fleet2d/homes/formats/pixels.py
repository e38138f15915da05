"""Floor plans made of pixels, whose side is the usual side of a cell."""

from abc import abstractmethod
from collections.abc import Mapping
from typing import Any

from pydantic import TypeAdapter, ValidationError, model_validator

from fleet2d.configuration.units import InputPath, Length
from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.lattice import MAX_CELL_M, MIN_CELL_M
from fleet2d.floorplan.source import FloorPlanSource


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
            settings: The settings in the scenario; only `path` and `scale` are validated already.

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
            scale = TypeAdapter(float).validate_python(data.get("scale") or 1.0)
            cell = cls.usual_cell({**data, "path": path, "scale": scale})
            return {**data, "cell": min(max(cell, MIN_CELL_M), MAX_CELL_M)}
        except (ValidationError, FloorPlanError):
            return data
