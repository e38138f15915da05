"""Homes that come with Fleet2D, made by this project."""

from pathlib import Path
from typing import Literal

from fleet2d.configuration.components import register
from fleet2d.floorplan.formats.native import plan_of
from fleet2d.floorplan.formats.native_file import PlanFile, unchecked
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.floorplan.source import FloorPlanSource, read_json

HOMES = Path(__file__).with_name("homes")


@register("floorplan", "bundled")
class Bundled(FloorPlanSource):
    """A home that comes with Fleet2D.

    Attributes:
        name: The name of the home.
    """

    name: Literal["family_home"] = "family_home"

    def load(self) -> FloorPlan:
        """Read the plan."""
        return read_bundled(self.name, self.cell)


def read_bundled(name: str, cell: float = 0.05) -> FloorPlan:
    """Read a home that comes with Fleet2D, whose file the tests check.

    Args:
        name: The name of the home.
        cell: Side of a grid cell [m].

    Example:
        >>> len(read_bundled("family_home").rooms)
        14
    """
    path = HOMES / f"{name}.json"
    return plan_of(unchecked(PlanFile, read_json(path)), path, cell)


def bundled_names() -> list[str]:
    """Return the names of the homes that come with Fleet2D."""
    return sorted(path.stem for path in HOMES.glob("*.json"))
