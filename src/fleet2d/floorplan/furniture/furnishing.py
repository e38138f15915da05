"""Furniture in a scenario: pieces at places of its choice, and more by rule."""

from dataclasses import replace
from typing import Self

import shapely
from pydantic import Field, model_validator

from fleet2d.configuration.components import Settings
from fleet2d.configuration.problems import problem_at, suggest
from fleet2d.configuration.units import AngleDeg, Length, PositiveLength
from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.arrangement import number_objects
from fleet2d.floorplan.furniture.catalogue import FURNITURE, stand_furniture
from fleet2d.floorplan.home.standing import BODY_RADIUS, standing_cells, with_approaches
from fleet2d.floorplan.objects import Blocks, PlacedObject
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.kernels.numbers import TURN

# How far a piece may reach into a wall [m]: tape measures and traced walls differ by as much.
WALL_TOLERANCE_M = 0.02


class Furnishing(Settings):
    """How a home is furnished by rule, see `fleet2d.floorplan.furniture.furnish.furnish`.

    Attributes:
        seed: The seed of the choice and the places of pieces.
        density: Factor of the probability of optional pieces; 0: none of them.
    """

    seed: int = Field(default=0, ge=0)
    density: float = Field(default=1.0, ge=0, le=10)


class FurniturePiece(Settings):
    """A piece of furniture at a place in the home.

    Attributes:
        type: The type of furniture, such as 'bed'.
        at: Its middle [x, y] [m].
        heading_deg: The direction of its front, counter-clockwise from +x.
        size: Its width and depth [m]; left out: the middle of what is usual.
        name: Its name; left out: its type and a number.
        blocks: Whether it blocks nothing, bodies (`path`), or bodies and sight (`sight`); left out:
            what is usual for its type.
    """

    type: str = Field(examples=["sofa"])
    at: tuple[Length, Length] = Field(examples=[[2.5, 1.0]])
    heading_deg: AngleDeg = 90.0
    size: tuple[PositiveLength, PositiveLength] | None = Field(default=None, examples=[[1.6, 2.0]])
    name: str | None = Field(default=None, min_length=1)
    blocks: Blocks | None = None

    @model_validator(mode="after")
    def _check_type(self) -> Self:
        if self.type not in FURNITURE:
            raise problem_at(
                ("type",),
                f"there is no furniture of type {self.type!r}"
                f"{suggest(self.type, sorted(FURNITURE))}",
                self.type,
            )
        return self

    def stand(self) -> PlacedObject:
        """Return the piece as an object, with unchecked places to use it from."""
        heading = round(self.heading_deg / 360 * TURN) % TURN
        size, blocks = self.size, self.blocks
        return stand_furniture(
            self.type, self.at, heading, size, name=self.name or "", blocks=blocks
        )


def place_furniture(
    plan: FloorPlan, pieces: tuple[FurniturePiece, ...], rules: Furnishing | None
) -> FloorPlan:
    """Return a plan with the pieces of a scenario, and more by `rules`, if any.

    Raises:
        FloorPlanError: A piece stands outside the home or in a wall, or two have the same name.
    """
    if pieces:
        things = [piece.stand() for piece in pieces]
        for number, thing in enumerate(things):
            _check_stands(plan, thing, f"floorplan.furniture[{number}]")
        everything = [*plan.objects, *things]
        standing = standing_cells(plan, BODY_RADIUS, everything)
        reachable = [with_approaches(plan, thing, standing, everything) for thing in things]
        plan = replace(plan, objects=number_objects([*plan.objects, *reachable]))
    if rules is None:
        return plan
    from fleet2d.floorplan.furniture.furnish import furnish  # few homes need the rules

    return furnish(plan, rules.seed, rules.density)


def _check_stands(plan: FloorPlan, thing: PlacedObject, where: str) -> None:
    """Raise FloorPlanError unless an object stands in free space."""
    middle = thing.footprint.centroid
    at = f"the {thing.type} at ({middle.x:g}, {middle.y:g}) m"
    x0, y0, x1, y1 = plan.bounds
    if not plan.free_space.intersects(middle):
        raise FloorPlanError(
            f"{where}: {at} is not inside {plan.name}, whose free space lies from"
            f" ({x0:.2f}, {y0:.2f}) to ({x1:.2f}, {y1:.2f}) m"
        )
    lost = shapely.difference(thing.footprint.buffer(-WALL_TOLERANCE_M), plan.free_space).area
    if lost > 0:
        x0, y0, x1, y1 = thing.footprint.bounds
        raise FloorPlanError(
            f"{where}: {at} overlaps a wall of {plan.name}: its box is {x1 - x0:.2f} m x"
            f" {y1 - y0:.2f} m; move it, turn it (heading_deg), or give it another size"
        )
