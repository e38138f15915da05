"""Homes that come with Fleet2D, made by this project."""

from pathlib import Path
from typing import Literal

from fleet2d.component import register
from fleet2d.floorplan.formats.native import read_native
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.floorplan.source import FloorPlanSource

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
        return read_native(HOMES / f"{self.name}.json", self.cell)


def bundled_names() -> list[str]:
    """Return the names of the homes that come with Fleet2D."""
    return sorted(path.stem for path in HOMES.glob("*.json"))
