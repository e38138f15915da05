"""Entities as a scenario declares them: a body, its behaviors, and its cameras."""

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, ClassVar, Self

from pydantic import Field, model_validator

from fleet2d.configuration.components import OneOf
from fleet2d.configuration.problems import problem_at
from fleet2d.configuration.units import Length, Speed, TurnRateDeg
from fleet2d.entities.behavior import Behavior, LightHours
from fleet2d.entities.body import BodySettings
from fleet2d.entities.drive import Differential, Drive
from fleet2d.entities.equipment import Battery, Localization
from fleet2d.entities.evidence_source import EvidenceSource
from fleet2d.entities.giving_way import GivesWay
from fleet2d.interactions.answers import AnswersField
from fleet2d.interactions.interaction import REQUEST_EVENTS
from fleet2d.sight.camera import Camera
from fleet2d.sight.perception import Perception


class Entity(BodySettings):
    """A body in the home, and what decides where it goes.

    Short form in a scenario: ``ana: {type: schedule, radius: 0.2, days: […]}`` gives the body one
    behavior, of that type, with all keys that aren't the body's own.

    Attributes:
        behaviors: The behaviors that decide where it goes: the first that has a plan is followed;
            none: it stays still.
    """

    behaviors: tuple[Annotated[Behavior, OneOf("behavior")], ...] = ()


class User(Entity):
    """A person who lives in the home; with a camera, one who also sees robots.

    Attributes:
        opens_doors: Opens doors in the way; else a shut door is a wall to it.
        camera: The user's field of view; with it, robots that come into view are events.
        answers: How the person answers robots that want something; null: as most people do.
        lights: Hours in which the person has the light on where it is awake, and switches it off on
            leaving; `dark`: from sunset to sunrise; left out: it leaves lights alone.
    """

    opens_doors: bool = True
    camera: Camera | None = None
    answers: AnswersField | None = None
    lights: LightHours = ()
    sight_events: ClassVar[tuple[str, str]] = ("robot_lost", "robot_seen")
    uses_furniture: ClassVar[bool] = True
    uses_portals: ClassVar[bool] = True

    @model_validator(mode="after")
    def _sees_what_is_there(self) -> Self:
        if self.camera is not None and self.camera.perception is not None:
            raise problem_at(("camera", "perception"), "users see robots as they are: leave it out")
        return self

    @property
    def tall(self) -> float:
        """Its height, standing [m]: unless the scenario says it, by what it does."""
        usual = (behavior.usual_height for behavior in self.behaviors)
        return min(usual, default=self.usual_height) if self.height is None else self.height

    @property
    def eyes(self) -> dict[str, Camera]:
        """The user's field of view, if there is one."""
        return {} if self.camera is None else {"camera": self.camera}


class Robot(Entity):
    """A robot, which sees users with its camera, or with several.

    Attributes:
        radius: Radius of the body [m].
        speed: Driving speed [m/s].
        turn_rate_deg: How fast it turns on the spot [deg/s].
        drive: How it moves along its routes.
        camera: Its only camera; null: it is blind, or has `cameras`.
        cameras: Several cameras, by name, in place of `camera`; their order doesn't matter.
        perception: How its cameras err, unless they say so themselves; null: they don't.
        perceives: What it perceives in place of what its cameras would see, or besides it, such as
            a real robot's detections; null: what they see.
        battery: Its battery, for the behavior dock; null: its charge never ends.
        gives_way: How it keeps clear of people; null: it drives on, and people go round it.
        localization: The error of its estimate of its own pose; null: there is none.
    """

    radius: Length = Field(default=0.15, gt=0, le=2)
    speed: Speed = Field(default=0.6, ge=0.01, le=20)
    turn_rate_deg: TurnRateDeg = Field(default=90.0, ge=0.01, le=36000)
    drive: Annotated[Drive, OneOf("drive")] = Differential()
    camera: Camera | None = Camera()
    cameras: dict[str, Camera] = Field(default={})
    perception: Perception | None = None
    perceives: Annotated[EvidenceSource, OneOf("evidence_source")] | None = None

    usual_height: ClassVar[float] = 0.4
    minds_costs: ClassVar[bool] = True
    minds_floor: ClassVar[bool] = True
    battery: Battery | None = None
    gives_way: GivesWay | None = None
    localization: Localization | None = None
    sight_events: ClassVar[tuple[str, str]] = ("user_lost", "user_seen")
    request_events: ClassVar[frozenset[str]] = REQUEST_EVENTS

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

    @model_validator(mode="after")
    def _localizes_by_sight(self) -> Self:
        if self.localization is not None and self.localization.relocalizes and not self.eyes:
            raise problem_at(("localization", "relocalizes"), "it needs a camera")
        return self

    @model_validator(mode="after")
    def _perceives_in_one_way(self) -> Self:
        if self.perceives is None:
            return self
        if not self.eyes:
            raise problem_at(
                ("perceives",), "it needs a camera, from whose view follows what it watched"
            )
        errs = self.perception is not None or any(c.perception for c in self.eyes.values())
        if errs and not self.perceives.besides_cameras:
            raise problem_at(
                ("perceives",),
                "give 'perceives' or 'perception', not both, or perceives.besides_cameras: true",
            )
        return self

    @property
    def eyes(self) -> dict[str, Camera]:
        """Its cameras in the order of their names; the only one is named "camera"."""
        only = {} if self.camera is None else {"camera": self.camera}
        return dict(sorted(self.cameras.items())) or only
