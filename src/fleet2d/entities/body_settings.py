"""Bodies as a scenario declares them: size, speed, and where they are at first."""

from typing import ClassVar

from pydantic import Field

from fleet2d.component import Settings, components, lookup
from fleet2d.entities.place import Place
from fleet2d.errors import ComponentError, ScenarioError
from fleet2d.problems import suggest
from fleet2d.sight.camera import Camera
from fleet2d.units import AngleDeg, Length, Speed, TurnRateDeg


class BodySettings(Settings):
    """A body in the home: its size, how fast it moves, and where it is at first.

    Attributes:
        radius: Radius of the body [m].
        speed: Walking speed [m/s].
        turn_rate_deg: How fast it turns on the spot [deg/s].
        start: Where it is at first; left out: where its behavior would be, else drawn.
        start_heading_deg: Heading at first, counter-clockwise from +x; left out: drawn.
        color: Color in pictures.
        opens_doors: Opens doors in its way; else a shut door is a wall to it.
    """

    radius: Length = Field(default=0.2, gt=0, le=2)
    speed: Speed = Field(default=1.0, ge=0.01, le=20)
    turn_rate_deg: TurnRateDeg = Field(default=180.0, ge=0.01, le=36000)
    start: Place | None = None
    start_heading_deg: AngleDeg | None = None
    color: str | None = Field(default=None, min_length=1)
    opens_doors: bool = False
    # Whether its routes are the cheapest by the costmap, if there is one, and not the shortest.
    minds_costs: ClassVar[bool] = False
    # Whether it sits or lies on furniture that a place names, instead of stopping before it.
    uses_furniture: ClassVar[bool] = False
    # What happens when its cameras lose somebody, and when they see somebody.
    sight_events: ClassVar[tuple[str, str]]

    @property
    def eyes(self) -> dict[str, Camera]:
        """Its cameras by name; none, unless a subclass has some."""
        return {}

    def check_interrupt(self, name: str) -> None:
        """Check that an event may end its plans: one of its cameras, or a registered interrupt.

        Raises:
            ComponentError: There is none of that name, or it needs a camera.
        """
        own = self.sight_events if self.eyes else ()
        if name in own:
            return
        try:
            lookup("interrupt", name)
        except ScenarioError as error:
            if ":" in name:
                raise ComponentError(str(error)) from error
            known = suggest(name, sorted({*own, *components("interrupt")}), "These do")
            hint = "" if own else f" ({' and '.join(self.sight_events)} need a camera)"
            raise ComponentError(f"no event {name!r} interrupts its plans{known}{hint}") from error
