"""What a run stores: the `artifacts` section of a scenario."""

from __future__ import annotations

from datetime import timedelta
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator

from fleet2d.configuration.components import Settings
from fleet2d.configuration.units import PositiveDuration


def _off_as_text(value: Any) -> Any:
    """Undo YAML 1.1, where a bare `off` is the truth value false."""
    return "off" if value is False else value


class ArtifactSettings(Settings):
    """Which tables a run stores, and how finely.

    Attributes:
        trajectories: Store every entity's pose this often (a multiple of simulation.step), at
            `every step`, or not at all (`off`).
        key_frames: Store the key frames of every movement: few rows, from which the pose at any
            step can be rebuilt.
        observations: Store every observation that a robot makes.
        events: Store events: a user seen or lost, an arrival, a change of activity.
        outputs: Store the outputs of algorithms and metrics, one table each.
        learned: Store what each algorithm has learned at the end, learned/NAME.npz: another run can
            start from it.
        checkpoint: Write the state of the run this often in simulated time, so that `fleet2d
            resume` can continue from there, or at the first decision after that; `auto`: after
            every 10 s or more of computing; or not at all (`off`).

    Example:
        >>> ArtifactSettings(trajectories="off", events=False).observations
        True
    """

    trajectories: Annotated[
        PositiveDuration | Literal["off", "every step"], BeforeValidator(_off_as_text)
    ] = timedelta(hours=1)
    key_frames: bool = True
    observations: bool = True
    events: bool = True
    outputs: bool = True
    learned: bool = False
    checkpoint: Annotated[
        PositiveDuration | Literal["auto", "off"], BeforeValidator(_off_as_text)
    ] = "auto"
