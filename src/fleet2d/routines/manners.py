"""Manners: how a person reacts to robots."""

from datetime import timedelta

from pydantic import Field

from fleet2d.configuration.components import Settings
from fleet2d.configuration.units import Duration, Length, Share
from fleet2d.routines.activity import AnyDurationLaw, DurationLaw


class Manners(Settings):
    """How a person reacts to robots; distances are between the middles of the bodies.

    A person who lies, is out of the home, or has no line of sight to a robot doesn't notice it.

    Attributes:
        notices: Distance at which a robot is noticed [m].
        turns: Probability of turning to it then.
        looks: How long the person looks at it.
        in_the_way: Distance at which a robot that drives up is in the way [m].
        steps_aside: Probability of stepping aside then, if the person stands.
        too_close: Distance below which a robot is too close [m].
        patience: How long a robot may stand too close.
        leaves: Probability of leaving for another room after that.
        leaves_for: How long the person stays there.
        hears: Distance at which its call is heard [m].
        comes: Probability of coming when it calls.
        comes_for: How long the person stays with it.
        stops: Probability that a person who left or came doesn't resume the activity.
    """

    notices: Length = Field(default=2.5, gt=0)
    turns: Share = 0.5
    looks: AnyDurationLaw = DurationLaw(
        law="uniform", at_least=timedelta(seconds=4), at_most=timedelta(seconds=12)
    )
    in_the_way: Length = Field(default=0.9, gt=0)
    steps_aside: Share = 0.8
    too_close: Length = Field(default=0.7, gt=0)
    patience: Duration = timedelta(seconds=30)
    leaves: Share = 0.3
    leaves_for: AnyDurationLaw = DurationLaw(mean=timedelta(minutes=5))
    hears: Length = Field(default=10.0, gt=0)
    comes: Share = 0.7
    comes_for: AnyDurationLaw = DurationLaw(mean=timedelta(seconds=40))
    stops: Share = 0.1
