"""Perception: the errors of what a robot perceives in the images of its cameras.

Probabilities may depend on a distance, an angle or the time of day: they are curves. Every part is
perfect unless the scenario configures an error.
"""

from collections.abc import Mapping
from datetime import timedelta
from typing import Annotated, Any, Self

from pydantic import Field, model_validator

from fleet2d.configuration.components import CheckNames, NameAsType, OneOf, Settings
from fleet2d.configuration.problems import problem_at
from fleet2d.configuration.units import AngleDeg, Duration, Length, Share
from fleet2d.floorplan.placed_objects import Posture
from fleet2d.runtime.determinism import sum_in_order
from fleet2d.sight.curve import ALWAYS, NEVER, Curve
from fleet2d.sight.perception_error import PerceptionError

# Largest deviation from 1 of a sum of shares, such as of 1/3 written in decimals.
SUM_ERROR = 1e-6

# How well people are noticed without a light: by daylight as ever, at night a fifth as often. Not
# measured: cameras differ widely here.
DARK_NIGHT = Curve(points=((6.0, 0.2), (8.0, 1.0), (17.0, 1.0), (19.0, 0.2)))


def _check_sum(location: tuple[str, ...], total: float) -> None:
    if total > 1 + SUM_ERROR:
        raise problem_at(location, f"the shares add up to {total:g}, more than 1")


class Detection(Settings):
    """Probability that a user in view is noticed: the camera's `detection` times all these factors.

    A curve of `bearing` without negative angles holds for both sides.

    Attributes:
        distance: Factor by the distance of the user's centre [m].
        bearing: Factor by the angle off the optical axis, left is positive [deg].
        orientation: Factor by the angle between the user's heading and the direction to the camera:
            0 shows the face, 90 a side, 180 the back [deg].
        posture: Factor by posture: stand, sit, lie; 1 for those left out.
        visible_share: Factor by the share of the body's points in view; needs the camera's
            `body_points`.
        light: Factor by the time of day [hours], the same every day.
        unlit: Further factor, by the time of day, where the light of the user's room is off.
        memory: Time constant of misses: after it, the last random draw still holds with probability
            1/e; 0: each look has a new draw.
    """

    distance: Curve = ALWAYS
    bearing: Curve = ALWAYS
    orientation: Curve = ALWAYS
    posture: dict[Posture, Share] = Field(default={})
    visible_share: Curve = ALWAYS
    light: Curve = ALWAYS
    unlit: Curve = DARK_NIGHT
    memory: Duration = timedelta(0)

    @model_validator(mode="after")
    def _is_within_a_day(self) -> Self:
        for key, curve in (("light", self.light), ("unlit", self.unlit)):
            for hour, _ in curve.points:
                if not 0 <= hour <= 24:
                    raise problem_at(
                        (key,), f"expected an hour of the day from 0 to 24, got {hour:g}"
                    )
        return self


class MistakenSpot(Settings):
    """A place that is sometimes mistaken for a person: a coat rack, a screen, a mirror.

    Attributes:
        at: Where it is [m].
        per_hour: False positives per hour in which it is in view.
        spread: Standard deviation of their positions, per axis [m].
    """

    at: tuple[Length, Length] = Field(examples=[[2.5, 1.0]])
    per_hour: float = Field(ge=0)
    spread: Length = Field(default=0.0, ge=0, le=10)


class FalsePositives(Settings):
    """People that are perceived but aren't there, at random with a rate per time of looking.

    Attributes:
        per_hour: Rate per hour of looking, uniform over what is in view.
        spots: Places with rates of their own.
        looks_like: Probability of being recognized as each user; the rest is not recognized.
    """

    per_hour: float = Field(default=0.0, ge=0)
    spots: tuple[MistakenSpot, ...] = Field(default=(), max_length=64)
    looks_like: dict[str, Share] = Field(default={})

    @model_validator(mode="after")
    def _is_a_share(self) -> Self:
        _check_sum(("looks_like",), sum_in_order(self.looks_like.values()))
        return self


class Identity(Settings):
    """Identity of a noticed user: recognized, mistaken for another user, or not recognized.

    Attributes:
        right: Probability of being recognized, by distance [m]; null: whenever not mistaken.
        mistaken: Probability of being mistaken for another user, by distance [m]; the rest is
            unknown.
        confusion: For each user, the shares of users that it is mistaken for; left out: all others
            equally.
        per_track: An identity stays until the user isn't noticed for `lost_after`; otherwise it is
            drawn again in each look.
    """

    right: Curve | None = None
    mistaken: Curve = NEVER
    confusion: dict[str, dict[str, Share]] = Field(default={})
    per_track: bool = False

    @model_validator(mode="after")
    def _are_distributions(self) -> Self:
        for user, others in self.confusion.items():
            if user in others:
                raise problem_at(
                    ("confusion", user), f"{user!r} can't be mistaken for itself: leave it out"
                )
            total = sum_in_order(others.values())
            if abs(total - 1) > SUM_ERROR:
                raise problem_at(("confusion", user), f"the shares add up to {total:g}, not to 1")
        return self


class Attributes(Settings):
    """Errors of position, heading, posture and activity; noise is bell-shaped, by its deviation.

    Attributes:
        range_noise: Deviation of the distance, the same at all distances [m].
        range_noise_share: Deviation of the distance, as a share of it; both are added.
        bearing_noise_deg: Deviation of the bearing.
        heading_noise_deg: Deviation of the perceived heading of the user.
        posture: Probabilities of mistaking a posture for others; the rest is right.
        activity: Probabilities of mistaking an activity for others; the rest is right; null:
            activities aren't perceived.
    """

    range_noise: Length = Field(default=0.0, ge=0, le=100)
    range_noise_share: Share = 0.0
    bearing_noise_deg: AngleDeg = Field(default=0.0, ge=0, le=90)
    heading_noise_deg: AngleDeg = Field(default=0.0, ge=0, le=180)
    posture: dict[Posture, dict[Posture, Share]] = Field(default={})
    activity: dict[str, dict[str, Share]] | None = Field(
        default=None, examples=[{"cook": {"breakfast": 0.2}}]
    )

    @model_validator(mode="after")
    def _are_distributions(self) -> Self:
        confusions: dict[str, Mapping[Any, Mapping[Any, float]]] = {
            "posture": self.posture,
            "activity": self.activity or {},
        }
        for key, confusion in confusions.items():
            for true, others in confusion.items():
                if true in others:
                    raise problem_at(
                        (key, true), f"{true!r} can't be mistaken for itself: leave it out"
                    )
                _check_sum((key, true), sum_in_order(others.values()))
        return self


class Perception(Settings):
    """Errors of a robot's perception; perfect by default.

    Attributes:
        detection: Probability of noticing users.
        false_positives: Rates of people that are perceived but aren't there.
        identity: Recognition of users.
        attributes: Errors of position, heading, posture and activity.
        errors: Further errors by name, built in or your own; they act after the others, in the
            order of their names.
    """

    detection: Detection = Detection()
    false_positives: FalsePositives = FalsePositives()
    identity: Identity = Identity()
    attributes: Attributes = Attributes()
    errors: Annotated[
        dict[str, Annotated[PerceptionError, OneOf("perception_error", by_name=True)]],
        CheckNames,
        NameAsType,
    ] = Field(default={})
