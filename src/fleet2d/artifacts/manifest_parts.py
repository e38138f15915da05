"""What readers take from a manifest besides its own fields: it must have its form.

A scenario is checked whole only when it is run again, as its components may be anybody's code.
Pictures and pages read some of it before: names, bodies, cameras. No code is imported for them.
"""

from __future__ import annotations

from datetime import datetime, timedelta
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from fleet2d.configuration.units import parse_duration
from fleet2d.sight.camera import USUAL_ANGLE_DEG, USUAL_RANGE_M

# The farthest that a camera sees [m]: far beyond any home.
_FARTHEST_M = 1000.0


def _check_range(distances: list[float]) -> list[float]:
    near, far = distances
    if not 0 <= near < far <= _FARTHEST_M:
        raise ValueError("it should be two distances, the nearest first")
    return distances


def _check_duration(text: str) -> str:
    parse_duration(text)
    return text


Count = Annotated[int, Field(ge=0, lt=2**62)]
_Pair = Annotated[list[float], Field(min_length=2, max_length=2)]


class _StoredPart(BaseModel):
    """A part of which some keys are checked, and the others left as they are."""

    model_config = ConfigDict(strict=True, allow_inf_nan=False, defer_build=True)


class _StoredTyped(_StoredPart):
    type: str = ""


class _StoredPan(_StoredPart):
    headings_deg: list[float] = []
    dwell: Annotated[str, AfterValidator(_check_duration)] = ""


class _StoredCamera(_StoredPart):
    range: Annotated[_Pair, AfterValidator(_check_range)] = list(USUAL_RANGE_M)
    angle_deg: Annotated[float, Field(gt=0, le=360)] = USUAL_ANGLE_DEG
    offset: _Pair = [0.0, 0.0]
    heading_deg: float = 0.0
    pan: _StoredPan | None = None


class _StoredBody(_StoredPart):
    radius: Annotated[float, Field(gt=0, le=2)] = 0.2
    camera: _StoredCamera | None = None
    cameras: dict[str, _StoredCamera] | None = None
    behaviors: list[_StoredTyped] = []


class _StoredScenario(_StoredPart):
    name: str | None = None
    simulation: dict[str, Any] = {}
    floorplan: dict[str, Any] = {}
    users: dict[str, _StoredBody] = {}
    robots: dict[str, _StoredBody] = {}
    objects: dict[str, _StoredTyped] = {}
    algorithms: dict[str, _StoredTyped] = {}
    metrics: dict[str, _StoredTyped] = {}


class _StoredIntervention(_StoredPart):
    step: Count = 0
    by: str = ""


class _StoredVerdict(_StoredPart):
    expectation: str
    first: Count
    holds: bool = True
    decided: bool = True


class ManifestParts(_StoredPart):
    """The parts of a manifest that readers rely on.

    Example:
        >>> camera = {"range": [2, 1]}
        >>> ManifestParts.model_validate({"scenario": {"robots": {"astro": {"camera": camera}}}})
        Traceback (most recent call last):
        pydantic_core._pydantic_core.ValidationError: 1 validation error for ManifestParts
        scenario.robots.astro.camera.range
          Value error, it should be two distances, the nearest first ...
    """

    scenario: _StoredScenario = _StoredScenario()
    interventions: list[_StoredIntervention] = []
    expectations: dict[str, _StoredVerdict] = {}


def time_problem(start: str, step_us: int, steps: int) -> str:
    """Return why the steps of a run have no times; empty if they have.

    Example:
        >>> time_problem("9999-12-31T00:00:00", 1_000_000, 10**6)
        '1000000 steps from 9999-12-31T00:00:00 end after the year 9999'
    """
    if not step_us:
        return "step_us is 0"
    if not start:
        return "start is empty"
    try:
        _ = datetime.fromisoformat(start) + timedelta(microseconds=steps * step_us)
    except OverflowError:
        return f"{steps} steps from {start} end after the year 9999"
    return ""
