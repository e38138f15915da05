"""Entities as a scenario declares them: a body, its behaviors, and its cameras."""

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, ClassVar, Self

from pydantic import Field, model_validator

from fleet2d.component import OneOf, Settings
from fleet2d.entities.battery import Battery
from fleet2d.entities.behavior import Behavior
from fleet2d.entities.giving_way import GivesWay
from fleet2d.entities.localization import Localization
from fleet2d.entities.place import Place
from fleet2d.problems import problem_at
from fleet2d.sight.camera import Camera
from fleet2d.sight.perception import Perception
from fleet2d.units import AngleDeg, Length, Speed, TurnRateDeg


class Entity(Settings):
    """A body in the home, and what decides where it goes.

    Short form in a scenario: ``ana: {type: schedule, radius: 0.2, days: […]}`` gives the body one
    behavior, of that type, with all keys that aren't the body's own.
    """

    radius: Length = Field(default=0.2, gt=0, le=2, description="radius of the body [m]")
    speed: Speed = Field(default=1.0, ge=0.01, le=20, description="walking speed [m/s]")
    turn_rate_deg: TurnRateDeg = Field(
        default=180.0, ge=0.01, le=36000, description="how fast it turns on the spot [deg/s]"
    )
    start: Place | None = Field(
        default=None,
        description="where it is at first; left out: where its behavior would be, else drawn",
    )
    start_heading_deg: AngleDeg | None = Field(
        default=None, description="heading at first, counter-clockwise from +x; left out: drawn"
    )
    color: str | None = Field(default=None, min_length=1, description="color in pictures")
    opens_doors: bool = Field(
        default=False, description="opens doors in its way; else a shut door is a wall to it"
    )
    behaviors: tuple[Annotated[Behavior, OneOf("behavior")], ...] = Field(
        default=(),
        description="what decides where it goes: the first that has a plan; none: it stays still",
    )
    # Whether its ways are the cheapest by the costmap, if there is one, and not the shortest.
    minds_costs: ClassVar[bool] = False
    # Whether it sits or lies on furniture that a place names, instead of stopping before it.
    uses_furniture: ClassVar[bool] = False
    # What happens when its cameras lose somebody, and when they see somebody.
    sight_events: ClassVar[tuple[str, str]]

    @property
    def eyes(self) -> dict[str, Camera]:
        """Its cameras by name; a body of no kind has none."""
        return {}


class User(Entity):
    """A person who lives in the home, and may be asked which robots are in view."""

    opens_doors: bool = Field(
        default=True, description="opens doors in the way; else a shut door is a wall to it"
    )
    camera: Camera | None = Field(
        default=None,
        description="what the user could see: with it, robots that come into view are events",
    )
    sight_events: ClassVar[tuple[str, str]] = ("robot_lost", "robot_seen")
    uses_furniture: ClassVar[bool] = True

    @model_validator(mode="after")
    def _sees_what_is_there(self) -> Self:
        if self.camera is not None and self.camera.perception is not None:
            raise problem_at(("camera", "perception"), "users see robots as they are: leave it out")
        return self

    @property
    def eyes(self) -> dict[str, Camera]:
        """The user's field of view, if it is asked for."""
        return {} if self.camera is None else {"camera": self.camera}


class Robot(Entity):
    """A robot, which sees users with its camera, or with several."""

    radius: Length = Field(default=0.15, gt=0, le=2, description="radius of the body [m]")
    speed: Speed = Field(default=0.6, ge=0.01, le=20, description="driving speed [m/s]")
    turn_rate_deg: TurnRateDeg = Field(
        default=90.0, ge=0.01, le=36000, description="how fast it turns on the spot [deg/s]"
    )
    camera: Camera | None = Field(
        default=Camera(), description="what it sees with; null: it is blind, or has `cameras`"
    )
    cameras: dict[str, Camera] = Field(
        default={},
        description="several cameras, by name, in place of `camera`; their order doesn't matter",
    )
    perception: Perception | None = Field(
        default=None,
        description="how all its cameras err that don't say so themselves; null: they don't",
    )

    minds_costs: ClassVar[bool] = True
    battery: Battery | None = Field(
        default=None, description="what it drives on, for the behavior dock; null: it never tires"
    )
    gives_way: GivesWay | None = Field(
        default=None,
        description="how it keeps clear of people; null: it drives on, and people go round it",
    )
    localization: Localization | None = Field(
        default=None, description="how wrong it is about where it is; null: it knows"
    )
    sight_events: ClassVar[tuple[str, str]] = ("user_lost", "user_seen")

    @model_validator(mode="before")
    @classmethod
    def _one_or_several(cls, data: Any) -> Any:
        if not isinstance(data, Mapping) or not data.get("cameras"):
            return data
        if data.get("camera") is not None:
            raise problem_at(
                ("cameras",), "give 'camera' or 'cameras', not both (camera: null takes it away)"
            )
        cameras = data["cameras"]
        if isinstance(cameras, Sequence) and not isinstance(cameras, str):
            cameras = {f"camera_{i:02}": camera for i, camera in enumerate(cameras)}
        return {**data, "camera": None, "cameras": cameras}

    @property
    def eyes(self) -> dict[str, Camera]:
        """Its cameras in the order of their names; the only one is named "camera"."""
        only = {} if self.camera is None else {"camera": self.camera}
        return dict(sorted(self.cameras.items())) or only
