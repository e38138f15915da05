from collections.abc import Mapping, Sequence
from datetime import timedelta
from pathlib import Path
from typing import Any, Literal

from fleet2d.entities.power import PowerState
from fleet2d.entities.sensor import SensorFault
from fleet2d.floorplan.placed_objects import Posture
from fleet2d.interventions import algorithms, bodies, home, robots, steering
from fleet2d.sight.perception import Perception

# What a script may have there: the fields hold what is read from it.
Angle = float | str
Place = str | Sequence[str] | tuple[float, float] | Mapping[str, str]
Time = str | timedelta

class Put(bodies.Put):
    def __init__(self, entity: str, to: Place, *, heading_deg: Angle | None = ...) -> None: ...

class Send(bodies.Send):
    def __init__(
        self,
        entity: str,
        to: Place,
        *,
        heading_deg: Angle | None = ...,
        duration: Time | None = ...,
    ) -> None: ...

class HoldStill(bodies.HoldStill):
    def __init__(
        self, entity: str, *, duration: Time | None = ..., posture: Posture | None = ...
    ) -> None: ...

class Release(bodies.Release):
    def __init__(self, entity: str) -> None: ...

class Replan(bodies.Replan):
    def __init__(self, entity: str) -> None: ...

class Configure(bodies.Configure):
    def __init__(self, entity: str, behavior: str, keys: Mapping[str, Any]) -> None: ...

class TakeControl(bodies.TakeControl):
    def __init__(self, entity: str) -> None: ...

class Decide(bodies.Decide):
    def __init__(self, entity: str, plan: Mapping[str, Any]) -> None: ...

class Away(bodies.Away):
    def __init__(self, entity: str, *, duration: Time | None = ...) -> None: ...

class CallHome(bodies.CallHome):
    def __init__(self, entity: str, *, to: Place = ..., duration: Time | None = ...) -> None: ...

class LetIn(bodies.LetIn):
    def __init__(self, entity: str, *, to: Place = ..., duration: Time = ...) -> None: ...

class StartActivity(bodies.StartActivity):
    def __init__(
        self, entity: str, what: str, *, to: Place | None = ..., duration: Time | None = ...
    ) -> None: ...

class Call(robots.Call):
    def __init__(
        self,
        entity: str,
        *,
        to: Place | None = ...,
        find: str | None = ...,
        dock: bool = ...,
        command: str | None = ...,
    ) -> None: ...

class Dismiss(robots.Dismiss):
    def __init__(self, entity: str) -> None: ...

class KeepOut(robots.KeepOut):
    def __init__(
        self, entity: str, of: str | tuple[str, ...], *, duration: Time | None = ...
    ) -> None: ...

class Steer(steering.Steer):
    def __init__(
        self,
        entity: str,
        *,
        forward: float | str = ...,
        left: float | str = ...,
        turn_deg: Angle = ...,
        duration: Time = ...,
    ) -> None: ...

class SetBattery(robots.SetBattery):
    def __init__(self, entity: str, charge: float | str) -> None: ...

class SetPower(robots.SetPower):
    def __init__(
        self,
        entity: str,
        *,
        duration: Time | None = ...,
        state: PowerState = ...,
        ends: PowerState | None = ...,
    ) -> None: ...

class SwitchOff(robots.SwitchOff):
    def __init__(
        self,
        entity: str,
        *,
        duration: Time | None = ...,
        camera: bool | str | None = ...,
        behavior: str | None = ...,
    ) -> None: ...

class SwitchOn(robots.SwitchOn):
    def __init__(
        self,
        entity: str,
        *,
        duration: None = ...,
        camera: bool | str | None = ...,
        behavior: str | None = ...,
    ) -> None: ...

class Fault(robots.Fault):
    def __init__(
        self,
        entity: str,
        *,
        duration: Time | None = ...,
        wheels: bool = ...,
        lost: bool = ...,
        charger: bool = ...,
        dark: bool | str = ...,
        detection: float | str = ...,
        errs: Perception | Mapping[str, Any] | None = ...,
    ) -> None: ...

class Perceive(robots.Perceive):
    def __init__(self, entity: str, detections: Sequence[Mapping[str, Any]]) -> None: ...

class Relocalize(robots.Relocalize):
    def __init__(self, entity: str, *, by_sight: bool = ...) -> None: ...

class Kidnap(robots.Kidnap):
    def __init__(self, entity: str, to: Place, *, duration: Time | None = ...) -> None: ...

class Suppress(robots.Suppress):
    def __init__(
        self, entity: str, user: str, *, duration: Time | None = ..., camera: str | None = ...
    ) -> None: ...

class Mistake(robots.Mistake):
    def __init__(
        self,
        entity: str,
        user: str,
        taken_for: str,
        *,
        duration: Time | None = ...,
        camera: str | None = ...,
    ) -> None: ...

class Inject(robots.Inject):
    def __init__(
        self,
        entity: str,
        user: str,
        spot: tuple[float, float],
        *,
        duration: Time | None = ...,
        camera: str | None = ...,
        heading_deg: Angle | None = ...,
    ) -> None: ...

class OpenDoor(home.OpenDoor):
    def __init__(self, door: str) -> None: ...

class ShutDoor(home.ShutDoor):
    def __init__(self, door: str) -> None: ...

class LockDoor(home.LockDoor):
    def __init__(self, door: str) -> None: ...

class UnlockDoor(home.UnlockDoor):
    def __init__(self, door: str) -> None: ...

class MoveFurniture(home.MoveFurniture):
    def __init__(
        self,
        object: str,  # noqa: A002
        to: tuple[float, float],
        *,
        turn_deg: float = ...,
    ) -> None: ...

class SetRoomType(home.SetRoomType):
    def __init__(self, name: str, type: str) -> None: ...  # noqa: A002

class SwitchLights(home.SwitchLights):
    def __init__(self, room: str, turn: Literal["on", "off"]) -> None: ...

class SlowFloor(home.SlowFloor):
    def __init__(
        self,
        area: Sequence[tuple[float, float]],
        *,
        duration: Time | None = ...,
        speed: float | str = ...,
        stop: Time = ...,
    ) -> None: ...

class ReportState(home.ReportState):
    def __init__(self, sensor: str, says: Literal["on", "off"]) -> None: ...

class StickSensor(home.StickSensor):
    def __init__(
        self, sensor: str, *, duration: Time | None = ..., says: SensorFault = ...
    ) -> None: ...

class Restore(home.Restore):
    def __init__(self, name: str) -> None: ...

class ResetAlgorithm(algorithms.ResetAlgorithm):
    def __init__(self, algorithm: str, *, learned: str | Path | None = ...) -> None: ...

class ReplaceOutput(algorithms.ReplaceOutput):
    def __init__(
        self,
        algorithm: str,
        *,
        duration: Time | None = ...,
        rooms: Mapping[str, float] = ...,
        values: Mapping[str, float | str] = ...,
        frozen: bool = ...,
        withheld: bool = ...,
    ) -> None: ...
