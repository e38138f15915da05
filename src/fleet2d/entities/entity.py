"""Users and robots in a scenario, and sources of perceptions without simulated sight."""

from collections.abc import Mapping, Sequence
from datetime import timedelta
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import Field, model_validator

from fleet2d.configuration.components import Component, OneOf, Settings
from fleet2d.configuration.problems import problem_at
from fleet2d.configuration.units import Length, PeerAddress, PositiveDuration, Speed, TurnRateDeg
from fleet2d.entities.behavior import Actor, Behavior, LightHours
from fleet2d.entities.body import Body, BodySettings, KeepsOut
from fleet2d.entities.drive import Differential, Drive
from fleet2d.entities.equipment import Battery, Localization
from fleet2d.entities.keep_out import KeepOutRules, KeptOutField
from fleet2d.entities.power import Power
from fleet2d.interactions.answers import AnswersField
from fleet2d.interactions.interaction import REQUEST_EVENTS
from fleet2d.kernels import I64
from fleet2d.kernels import SightingColumn as Column
from fleet2d.runtime.events import EventKind
from fleet2d.sight.camera import Camera
from fleet2d.sight.perception import Perception

SIGHTING = len(Column)


class EvidenceSource(Component):
    """Base of sources of perceptions in place of simulated sightings.

    A source returns sightings as the sight kernel does, int64 (n, len(SightingColumn)) by step,
    with UNKNOWN_TRUTH for the true user. What the robot watched still follows from its poses and
    cameras.

    Attributes:
        besides_cameras: Whether the sightings come in addition to those of the cameras, like known
            false positives; else in their place.

    After `start` it has `notes`, lines about its log: omissions and misfits.
    """

    kind = "evidence_source"

    besides_cameras: bool = False

    @property
    def relative(self) -> bool:
        """Whether positions are in the robot's frame (`relative_to`): x ahead, y to the left."""
        return getattr(self, "relative_to", "map") == "robot"

    def files(self) -> Sequence[Path]:
        """Return the files to read."""
        return ()

    def start(self, actor: Actor, users: Sequence[str]) -> None:
        """Prepare for a run of a robot among users."""
        self.notes: tuple[str, ...] = ()

    def sightings(self, first: int, end: int) -> I64:
        """Return the sightings that become known in the steps from `first` to `end` - 1."""
        raise NotImplementedError


class LiveDetections(EvidenceSource):
    """Perceive detections that arrive during the run, from a real robot or another program.

    Each arrival is an intervention `perceive`, which `fleet2d live` or a script of your own makes,
    so that the run is repeated by its manifest.

    Attributes:
        relative_to: Whether positions are in the floor plan, or in the frame of the robot: x ahead,
            y to the left.
        source: The other program whose messages it takes, such as ws://127.0.0.1:8765, which
            `fleet2d live` opens; left out: any of `--with`.
    """

    relative_to: Literal["map", "robot"] = "map"
    source: PeerAddress | None = None

    def start(self, actor: Actor, users: Sequence[str]) -> None:
        """Begin without detections."""
        super().start(actor, users)
        self._rows: list[I64] = []

    def receive(self, rows: I64) -> None:
        """Add sightings of one step, in the order of steps."""
        self._rows.append(rows)

    def sightings(self, first: int, end: int) -> I64:
        """Return the detections of the steps from `first` to `end` - 1, and drop earlier ones."""
        self._rows = [rows for rows in self._rows if rows[0, Column.STEP] >= first]
        rows = [rows for rows in self._rows if rows[0, Column.STEP] < end]
        return np.concatenate(rows) if rows else np.empty((0, SIGHTING), np.int64)


class Entity(BodySettings):
    """A body in the home, and the behaviors that decide where it goes.

    Short form in a scenario: ``ana: {type: schedule, radius: 0.2, days: […]}`` gives the body one
    behavior, of that type, with all keys that aren't the body's own.

    Attributes:
        behaviors: The behaviors that decide where it goes: the first that has a plan is followed;
            none: it stays still.
    """

    behaviors: tuple[OneOf[Behavior], ...] = ()


class User(Entity):
    """A person who lives in the home; with a camera, one who also sees robots.

    Attributes:
        opens_doors: Opens doors in the way; else a shut door is a wall to it.
        camera: The user's field of view; with it, robots that come into view are events.
        answers: The person's answers to requests of robots; null: those of most people.
        lights: Hours in which the person has the light on where it is awake, and switches it off on
            leaving; `dark`: from sunset to sunrise; left out: it leaves lights alone.
    """

    opens_doors: bool = True
    camera: Camera | None = None
    answers: AnswersField | None = None
    lights: LightHours = ()
    sight_events = (EventKind.ROBOT_LOST, EventKind.ROBOT_SEEN)
    uses_furniture = True
    uses_portals = True

    def model_post_init(self, _: object, /) -> None:
        """Refuse errors of perception, and failures."""
        for key in ("perception", "fails"):
            if getattr(self.camera, key, None) is not None:
                raise problem_at(("camera", key), "users see robots as they are: leave it out")

    @property
    def tall(self) -> float:
        """The standing height [m]; by default, that of its behaviors."""
        usual = (behavior.usual_height for behavior in self.behaviors)
        return min(usual, default=self.usual_height) if self.height is None else self.height

    @property
    def eyes(self) -> dict[str, Camera]:
        """The user's field of view, if there is one."""
        return {} if self.camera is None else {"camera": self.camera}


class GivesWay(Settings):
    """Keep clear of people: wait before them, in doorways as elsewhere; go round, or give up.

    Attributes:
        distance: Gap between the bodies below which it doesn't drive nearer [m].
        patience: Time of waiting before going round, by 0.1 m where there is no more room.
        gives_up: Time of waiting without a way round before skipping the stop.
    """

    distance: Length = Field(default=0.4, ge=0, le=3)
    patience: PositiveDuration = timedelta(seconds=10)
    gives_up: PositiveDuration = timedelta(minutes=2)


class Robot(Entity):
    """A robot, which sees users with its camera, or with several.

    Attributes:
        radius: Radius of the body [m].
        speed: Driving speed [m/s].
        turn_rate_deg: Rate of turning on the spot [deg/s].
        drive: Its motion along routes.
        camera: Its only camera; null: it is blind, or has `cameras`.
        cameras: Several cameras, by name, in place of `camera`; their order doesn't matter.
        perception: The errors of cameras without errors of their own; null: none.
        perceives: A source of sightings in place of its cameras, or besides them, such as a real
            robot's detections; null: its cameras.
        battery: Its battery, for the behavior dock; null: its charge never ends.
        gives_way: The way in which it keeps clear of people; null: it drives on, and people go
            round it.
        localization: The error of its estimate of its own pose; null: there is none.
        power: Its crashes and updates, and the memory that outlasts them; null: no crashes, and all
            that it has learned.
        keep_out: Rooms, kinds of rooms if the home has them, and areas to keep out of, at all
            times, at hours or while somebody sleeps: it starts, stops, passes and follows nowhere
            there. If a person puts it there, it leaves.
        climbs: Whether it climbs stairs and takes lifts, as people do.
    """

    radius: Length = Field(default=0.15, gt=0, le=2)
    speed: Speed = Field(default=0.6, ge=0.01, le=20)
    turn_rate_deg: TurnRateDeg = Field(default=90.0, ge=0.01, le=36000)
    drive: OneOf[Drive] = Differential()
    camera: Camera | None = Camera()
    cameras: dict[str, Camera] = Field(default={})
    perception: Perception | None = None
    perceives: OneOf[EvidenceSource] | None = None

    usual_height = 0.4
    minds_costs = True
    minds_floor = True
    battery: Battery | None = None
    gives_way: GivesWay | None = None
    localization: Localization | None = None
    power: Power | None = None
    keep_out: tuple[KeptOutField, ...] = ()
    climbs: bool = False
    sight_events = (EventKind.USER_LOST, EventKind.USER_SEEN)
    request_events = REQUEST_EVENTS

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
    def climbs_stairs(self) -> bool:
        """Whether it climbs stairs and takes lifts."""
        return self.climbs

    def keep_out_rules(self, body: Body) -> KeepsOut | None:
        """Return the rules by which the robot keeps out; None if it may go everywhere."""
        return KeepOutRules(body, self.keep_out) if self.keep_out else None

    def model_post_init(self, _: object, /) -> None:
        """Require cameras for what needs them, and one way to perceive."""
        if self.localization is not None and self.localization.relocalizes and not self.eyes:
            raise problem_at(("localization", "relocalizes"), "it needs a camera")
        if self.perceives is None:
            return
        if not self.eyes:
            raise problem_at(
                ("perceives",), "it needs a camera, from whose view follows what it watched"
            )
        if self.perceives.besides_cameras:
            return
        for key in ("perception", "fails"):
            owners = (self, *self.eyes.values())
            if any(getattr(owner, key, None) is not None for owner in owners):
                raise problem_at(
                    ("perceives",),
                    f"give 'perceives' or '{key}', not both, or perceives.besides_cameras: true",
                )

    @property
    def eyes(self) -> dict[str, Camera]:
        """Its cameras in the order of their names; the only one is named "camera"."""
        only = {} if self.camera is None else {"camera": self.camera}
        return dict(sorted(self.cameras.items())) or only
