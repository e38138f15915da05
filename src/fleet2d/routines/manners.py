"""Manners: how somebody reacts to robots."""

from datetime import timedelta

from pydantic import Field

from fleet2d.component import Settings
from fleet2d.routines.activity import AnyTakes, Takes
from fleet2d.units import Duration, Length, Share


class Manners(Settings):
    """How somebody reacts to robots; distances are between the middles of the bodies.

    Who lies, is out of the home, or has no line of sight to the robot takes no notice of it.
    """

    notices: Length = Field(
        default=2.5, gt=0, description="how near a robot is when it is noticed [m]"
    )
    turns: Share = Field(default=0.5, description="how likely one turns to it then")
    looks: AnyTakes = Field(
        default=Takes(law="uniform", at_least=timedelta(seconds=4), at_most=timedelta(seconds=12)),
        description="how long one looks at it",
    )
    in_the_way: Length = Field(
        default=0.9, gt=0, description="how near a robot that drives up is in one's way [m]"
    )
    steps_aside: Share = Field(
        default=0.8, description="how likely one steps aside then, if one stands"
    )
    too_close: Length = Field(default=0.7, gt=0, description="how near is too close [m]")
    patience: Duration = Field(
        default=timedelta(seconds=30), description="how long a robot may stand too close"
    )
    leaves: Share = Field(
        default=0.3, description="how likely one leaves for another room when it did"
    )
    leaves_for: AnyTakes = Field(
        default=Takes(mean=timedelta(minutes=5)), description="how long one stays there"
    )
    hears: Length = Field(default=10.0, gt=0, description="how far off one hears its call [m]")
    comes: Share = Field(default=0.7, description="how likely one comes when it calls")
    comes_for: AnyTakes = Field(
        default=Takes(mean=timedelta(seconds=40)), description="how long one stays with it"
    )
    stops: Share = Field(
        default=0.1,
        description="how likely one who left or came doesn't take up again what one was doing",
    )
