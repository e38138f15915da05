"""The `synthetic` floor plan: a home drawn by a seed, and its settings."""

from typing import Literal, Self

from pydantic import Field, model_validator

from fleet2d.configuration.components import register
from fleet2d.configuration.problems import problem
from fleet2d.configuration.units import Length
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.floorplan.source import FloorPlanSource
from fleet2d.floorplan.synthetic.convert import floor_plan
from fleet2d.floorplan.synthetic.generator import Style, generate
from fleet2d.floorplan.synthetic.geometry import PER_M
from fleet2d.floorplan.synthetic.program import LARGEST_M2, MAX_ROOMS_OF_A_KIND, SMALLEST_M2, Wishes


@register("floorplan", "synthetic")
class Synthetic(FloorPlanSource):
    """A generated home; the same configuration is the same home on every machine.

    Attributes:
        seed: The seed of the home.
        area_m2: Free space, 30 to 450 m2.
        bedrooms: Number of bedrooms, 1 to 8.
        bathrooms: Number of bathrooms, 1 to 6.
        garage: Whether it has one.
        outline: The shape of the home.
        open_plan: Whether living, dining and kitchen are open to each other.
        corridor_width: Clear width of hallways, 0.9 m to 2 m, rounded to 5 cm.
        door_width: Width of doors between rooms, 0.7 m to 1.2 m, rounded to 5 cm.

    Example:
        >>> plan = Synthetic(seed=7, area_m2=120, bedrooms=3).load()
        >>> len(plan.rooms_of_type("bedroom")), plan.room("kitchen_0").type
        (3, 'kitchen')
    """

    seed: int = Field(default=0, ge=0)
    area_m2: float | None = Field(default=None, ge=SMALLEST_M2, le=LARGEST_M2)
    bedrooms: int | None = Field(default=None, ge=1, le=MAX_ROOMS_OF_A_KIND)
    bathrooms: int | None = Field(default=None, ge=1, le=6)
    garage: bool | None = None
    outline: Literal["rectangle", "L", "T", "U"] | None = None
    open_plan: bool | None = None
    corridor_width: Length | None = None
    door_width: Length | None = None

    @model_validator(mode="after")
    def _check(self) -> Self:
        for name, low, high in (("corridor_width", 0.9, 2.0), ("door_width", 0.7, 1.2)):
            value = getattr(self, name)
            if value is not None and not low <= value <= high:
                raise problem(f"{name} is {value:g} m; {low:g} m to {high:g} m is possible")
        return self

    def load(self) -> FloorPlan:
        """Generate the home.

        Raises:
            FloorPlanError: The settings contradict each other.
        """
        wishes = Wishes(self.area_m2, self.bedrooms, self.bathrooms, self.garage)
        style = Style(
            self.outline, self.open_plan, _units(self.corridor_width), _units(self.door_width)
        )
        house = generate(self.seed, wishes, style)
        name = f"synthetic_{self.seed}"
        return floor_plan(house, name, self.cell, f"synthetic home, seed {self.seed}")


def _units(length: float | None) -> int | None:
    return None if length is None else int(length * PER_M + 0.5)
