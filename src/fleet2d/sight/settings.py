"""The `sight` section of a scenario."""

from typing import Annotated

from fleet2d.configuration.components import OneOf, Settings
from fleet2d.configuration.units import PositiveDuration
from fleet2d.sight.fov import FieldOfView
from fleet2d.sight.line_of_sight import LineOfSight


class SightSettings(Settings):
    """How a run computes what is in view.

    Attributes:
        method: Method that decides whether somebody is in view: line_of_sight, visibility_polygon,
            flashlight, or your own.
        people_occlude: Whether bodies hide people from cameras: a line of sight ends at any body
            that it passes nearer than that body's radius.
        seen_every: How often the area in view is computed, for the layers of what robots have seen
            and the exposure of rooms; null: in every step.
    """

    method: Annotated[FieldOfView, OneOf("sight")] = LineOfSight()
    people_occlude: bool = False
    seen_every: PositiveDuration | None = None
