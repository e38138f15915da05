"""The `artifacts` section of a scenario."""

from datetime import timedelta
from typing import Any

import pytest
from pydantic import ValidationError

from fleet2d.artifacts.settings import ArtifactSettings
from fleet2d.configuration.components import descriptions


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        ("off", "off"),
        (False, "off"),  # YAML 1.1 reads a bare `off` so
        ("every step", "every step"),
        ("10 min", timedelta(minutes=10)),
        (timedelta(hours=2), timedelta(hours=2)),
    ],
)
def test_trajectories_take_off_every_step_or_a_duration(value: Any, expected: Any) -> None:
    assert expected == ArtifactSettings(trajectories=value).trajectories


def test_default_is_every_simulated_hour_and_all_else() -> None:
    settings = ArtifactSettings()

    assert timedelta(hours=1) == settings.trajectories
    assert settings.key_frames
    assert settings.observations
    assert settings.events
    assert settings.outputs


@pytest.mark.parametrize("value", ["sometimes", "5 m", True, -1, "0 s"])
def test_trajectories_refuse_anything_else(value: Any) -> None:
    with pytest.raises(ValidationError):
        ArtifactSettings(trajectories=value)


def test_every_field_is_described() -> None:
    assert descriptions(ArtifactSettings).keys() == ArtifactSettings.model_fields.keys()
