"""Manners: how a person reacts to robots."""

from datetime import timedelta

from pydantic import Field

from fleet2d.component import Settings
from fleet2d.routines.activity import AnyDurationLaw, DurationLaw
from fleet2d.units import Duration, Length, Share


class Manners(Settings):
    """How a person reacts to robots; distances are between the middles of the bodies.

    A person who lies, is out of the home, or has no line of sight to a robot doesn't notice it.
    """

    notices: Length = Field(
        default=2.5, gt=0, description="how near a robot is when it is noticed [m]"
    )
    turns: Share = Field(default=0.5, description="probability of turning to it then")
    looks: AnyDurationLaw = Field(
        default=DurationLaw(
            law="uniform", at_least=timedelta(seconds=4), at_most=timedelta(seconds=12)
        ),
        description="how long the person looks at it",
    )
    in_the_way: Length = Field(
        default=0.9, gt=0, description="how near a robot that drives up is in the way [m]"
    )
    steps_aside: Share = Field(
        default=0.8, description="probability of stepping aside then, if the person stands"
    )
    too_close: Length = Field(default=0.7, gt=0, description="how near is too close [m]")
    patience: Duration = Field(
        default=timedelta(seconds=30), description="how long a robot may stand too close"
    )
    leaves: Share = Field(
        default=0.3, description="probability of leaving for another room after that"
    )
    leaves_for: AnyDurationLaw = Field(
        default=DurationLaw(mean=timedelta(minutes=5)),
        description="how long the person stays there",
    )
    hears: Length = Field(default=10.0, gt=0, description="from how far its call is heard [m]")
    comes: Share = Field(default=0.7, description="probability of coming when it calls")
    comes_for: AnyDurationLaw = Field(
        default=DurationLaw(mean=timedelta(seconds=40)),
        description="how long the person stays with it",
    )
    stops: Share = Field(
        default=0.1,
        description="probability that a person who left or came doesn't resume the activity",
    )
