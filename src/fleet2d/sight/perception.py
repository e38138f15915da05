"""Perception: the errors of a robot in reading the images of its cameras.

Probabilities may depend on a distance, an angle or the time of day: they are curves, which are
equal on every machine. Every part is perfect unless the scenario configures an error.
"""

from collections.abc import Mapping, Sequence
from datetime import timedelta
from decimal import Decimal, localcontext
from itertools import pairwise
from typing import Annotated, Any, Self

import numpy as np
from pydantic import Field, GetJsonSchemaHandler, model_serializer, model_validator
from pydantic_core import CoreSchema

from fleet2d.configuration.components import CheckNames, NameAsType, OneOf, Settings
from fleet2d.configuration.problems import problem, problem_at
from fleet2d.configuration.units import AngleDeg, Duration, Length, Share
from fleet2d.floorplan.placed_objects import Posture
from fleet2d.kernels import F64, I64, ONE, rounded
from fleet2d.runtime.determinism import sum_in_order
from fleet2d.sight.perception_error import PerceptionError

EXACT = 20  # digits: far more than a probability in units of 2**-31 needs
LIMIT = 200  # beyond exp(-200) or exp(200) a probability is 0 or 1
# The natural logarithm of 2, with few bits so that its multiples are exact; and the remainder.
LN_2 = int(Decimal(2).ln() * 2**32) / 2**32
LN_2_REST = float(Decimal(2).ln() - Decimal(LN_2))
TERMS = 15  # of the series of exp, up to half of LN_2: more than the precision of a double needs

# A sum of shares may deviate from 1 by this much, as decimals of 1/3 do.
SUM_ERROR = 1e-6
UNKNOWN = "unknown"


class Curve(Settings):
    """A probability as a function: a table with linear interpolation, or a logistic function.

    In a scenario: ``0.9`` (constant), ``[[0, 1], [3, 0.9], [5, 0.2]]`` (constant before the first
    row and after the last), or ``{midpoint: 4, width: 0.5}``:
    top / (1 + exp((x - midpoint) / width)).

    Attributes:
        points: Rows [x, probability], ascending.
        midpoint: Logistic: x at which it is half its top.
        width: Logistic: scale of its decrease, to 27 % in one width.
        top: Logistic: the probability far before the midpoint.

    Example:
        >>> curve = Curve.model_validate([[0, 1], [4, 0.5]])
        >>> [curve.at(x) for x in (-1, 0, 1, 9)]
        [1.0, 1.0, 0.875, 0.5]
        >>> Curve(midpoint=3, width=0.5, top=0.9).at(3)
        0.45
    """

    points: tuple[tuple[float, Share], ...] = Field(default=(), examples=[[[0, 1], [4, 0.6]]])
    midpoint: float | None = None
    width: float | None = Field(default=None, gt=0)
    top: Share = 1.0

    @model_validator(mode="before")
    @classmethod
    def _short_forms(cls, data: Any) -> Any:
        if isinstance(data, Sequence) and not isinstance(data, str):
            return {"points": data}
        if isinstance(data, str | int | float) and not isinstance(data, bool):
            return {"points": [[0.0, data]]}
        return data

    @model_validator(mode="after")
    def _is_one_of_both(self) -> Self:
        logistic = self.midpoint is not None and self.width is not None
        if logistic == bool(self.points) or (self.midpoint is None) != (self.width is None):
            raise problem(
                "a curve is a number, rows like [[0, 1], [4, 0.6]], or {midpoint: …, width: …}"
            )
        for (before, _), (after, _) in pairwise(self.points):
            if not before < after:
                raise problem_at(("points",), f"{after:g} follows {before:g}: rows must ascend")
        return self

    @model_serializer(mode="plain")
    def _shortest(self) -> Any:
        """Return the form of a scenario: rows, or a logistic function with all its keys."""
        if self.points:
            return [list(row) for row in self.points]
        return {"midpoint": self.midpoint, "width": self.width, "top": self.top}

    @classmethod
    def __get_pydantic_json_schema__(
        cls, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """Add the short forms to the schema."""
        row = {"type": "array", "minItems": 2, "maxItems": 2}
        short = [{"type": "number"}, {"type": "string"}, {"type": "array", "items": row}]
        return {"anyOf": [*short, super().__get_pydantic_json_schema__(schema, handler)]}

    def at(self, x: float) -> float:
        """Return the probability at x."""
        return float(self._shares(np.array([x], np.float64))[0])

    def chances(self, x: Sequence[float]) -> I64:
        """Return the probabilities at many x [2**-31]: int64 (n,)."""
        shares = self._shares(np.array(x, np.float64))
        return rounded(shares * ONE)

    def _shares(self, at: F64) -> F64:
        """Return the probabilities at many x, the same on every machine: float64 (n,)."""
        if self.midpoint is not None and self.width is not None:
            return self.top / (1 + exponential((at - self.midpoint) / self.width))
        x, y = np.array(self.points).T
        after = np.minimum(np.searchsorted(x, at, side="right"), len(x) - 1)
        before = np.maximum(after - 1, 0)
        width = np.where(after > before, x[after] - x[before], 1.0)
        fraction = np.clip(at - x[before], 0.0, width) / width
        return y[before] + (y[after] - y[before]) * fraction

    def around_the_clock(self) -> "Curve":
        """Return the curve repeated over hours -24 to 48, so that midnight is interpolated, too."""
        if len(self.points) < 2:
            return self
        days = tuple((hour + day, p) for day in (-24, 0, 24) for hour, p in self.points)
        # Unchecked: rows at 0 and at 24 may coincide; the curve jumps there.
        return Curve.model_construct(points=days, midpoint=None, width=None)


def chance(share: float) -> int:
    """Return a probability [2**-31].

    >>> chance(0.5) == 2**30
    True
    """
    return round(share * ONE)


def decay(steps: Decimal) -> float:
    """Return exp(-steps), the same on every machine.

    >>> decay(Decimal(1))
    0.36787944117144233
    """
    with localcontext(prec=EXACT):
        return float(min(max(-steps, Decimal(-LIMIT)), Decimal(LIMIT)).exp())


def exponential(x: F64) -> F64:
    """Return exp(x), with x clipped to -LIMIT … LIMIT, the same on every machine.

    np.exp differs between machines in the last bit; sums and products don't.

    >>> exponential(np.array([0.0, 1.0])).round(12).tolist()
    [1.0, 2.718281828459]
    """
    x = np.clip(x, -LIMIT, LIMIT)
    doublings = np.rint(x / LN_2)
    rest = x - doublings * LN_2 - doublings * LN_2_REST
    value = np.ones_like(x)
    for term in range(TERMS, 0, -1):
        value = 1 + rest * value / term
    return np.ldexp(value, doublings.astype(np.int32))


def cumulative(weights: Mapping[Any, float], order: Sequence[Any]) -> list[int]:
    """Return the cumulative probabilities [2**-31] of outcomes in an order; missing ones have 0.

    >>> [x / 2**31 for x in cumulative({"a": 0.25, "c": 0.5}, "abc")]
    [0.25, 0.25, 0.75]
    """
    total = 0.0
    sums = []
    for name in order:
        total += weights.get(name, 0.0)
        sums.append(chance(total))
    return sums


ALWAYS = Curve(points=((0.0, 1.0),))
NEVER = Curve(points=((0.0, 0.0),))


# Without a light, people are noticed by daylight as ever, at night a fifth as often. This isn't
# measured, since cameras differ widely here.
DARKEST = 0.2
DARK_NIGHT = Curve(points=((6.0, DARKEST), (8.0, 1.0), (17.0, 1.0), (19.0, DARKEST)))


def check_shares(
    location: tuple[str, ...], shares: Mapping[Any, float], own: object = None, *, whole: bool
) -> None:
    """Refuse shares of one of `own`, or whose sum exceeds 1 or, if `whole`, isn't 1."""
    if own in shares:
        raise problem_at(location, f"{own!r} can't be mistaken for itself: leave it out")
    total = sum_in_order(shares.values())
    if total > 1 + SUM_ERROR or (whole and total < 1 - SUM_ERROR):
        limit = "not to 1" if whole else "more than 1"
        raise problem_at(location, f"the shares add up to {total:g}, {limit}")


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
        unlit: Further factor, by the time of day, where the light of the user's room is off; left
            out: by the sun, if the scenario has `simulation.daylight`.
        memory: Time constant of misses, after which the last random draw still holds with
            probability 1/e; 0: each look has a new draw.
    """

    distance: Curve = ALWAYS
    bearing: Curve = ALWAYS
    orientation: Curve = ALWAYS
    posture: dict[Posture, Share] = Field(default={})
    visible_share: Curve = ALWAYS
    light: Curve = ALWAYS
    unlit: Curve = DARK_NIGHT
    memory: Duration = timedelta(0)

    def model_post_init(self, _: object, /) -> None:
        """Require hours of the day."""
        for key, curve in (("light", self.light), ("unlit", self.unlit)):
            for hour, _ in curve.points:
                if not 0 <= hour <= 24:
                    message = f"expected an hour of the day from 0 to 24, got {hour:g}"
                    raise problem_at((key,), message)


class MistakenSpot(Settings):
    """A place that is sometimes mistaken for a person: a coat rack, a screen, a mirror.

    Attributes:
        at: Its position [m].
        per_hour: False positives per hour in which it is in view.
        spread: Standard deviation of their positions, per axis [m].
    """

    at: tuple[Length, Length] = Field(examples=[[2.5, 1.0]])
    per_hour: float = Field(ge=0)
    spread: Length = Field(default=0.0, ge=0, le=10)


class FalsePositives(Settings):
    """People who are perceived but aren't there, at random, at a rate per unit of looking time.

    Attributes:
        per_hour: Rate per hour of looking, uniform over what is in view.
        spots: Places with rates of their own.
        looks_like: Probability of being recognized as each user; the rest is not recognized.
    """

    per_hour: float = Field(default=0.0, ge=0)
    spots: tuple[MistakenSpot, ...] = Field(default=(), max_length=64)
    looks_like: dict[str, Share] = Field(default={})

    def model_post_init(self, _: object, /) -> None:
        """Require shares of identities that add up to at most 1."""
        check_shares(("looks_like",), self.looks_like, whole=False)


class Identity(Settings):
    """Identity of a noticed user: recognized, mistaken for another user, or not recognized.

    Attributes:
        right: Probability of being recognized, by distance [m]; null: 1 minus that of mistakes.
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

    def model_post_init(self, _: object, /) -> None:
        """Require distributions over other users."""
        for user, others in self.confusion.items():
            check_shares(("confusion", user), others, user, whole=True)


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

    def model_post_init(self, _: object, /) -> None:
        """Require shares of mistakes that add up to at most 1."""
        confusions: dict[str, Mapping[Any, Mapping[Any, float]]] = {
            "posture": self.posture,
            "activity": self.activity or {},
        }
        for key, confusion in confusions.items():
            for true, others in confusion.items():
                check_shares((key, true), others, true, whole=False)


class Perception(Settings):
    """Errors of a robot's perception; perfect by default.

    Attributes:
        detection: Probability of noticing users.
        false_positives: Rates of people that are perceived but aren't there.
        identity: Recognition of users.
        attributes: Errors of position, heading, posture and activity.
        errors: Further errors by name, built in or your own, which act after the others, in the
            order of their names.
    """

    detection: Detection = Detection()
    false_positives: FalsePositives = FalsePositives()
    identity: Identity = Identity()
    attributes: Attributes = Attributes()
    errors: Annotated[
        dict[str, OneOf[PerceptionError]],
        CheckNames,
        NameAsType(),
    ] = Field(default={})
