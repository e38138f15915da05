"""The built-in errors of perception."""

from datetime import timedelta
from math import radians
from typing import Any, Literal

import numpy as np
from pydantic import Field, GetJsonSchemaHandler
from pydantic_core import CoreSchema

from fleet2d.configuration.components import Settings
from fleet2d.configuration.problems import check_known, problem, problem_at
from fleet2d.configuration.units import AngleDeg, Duration, Length, Share, micros
from fleet2d.errors import ComponentError
from fleet2d.kernels import NOBODY
from fleet2d.runtime.determinism import sum_in_order
from fleet2d.sight.perception import UNKNOWN, Curve, check_shares, cumulative
from fleet2d.sight.perception_error import CameraSightings, PerceptionError

# The heights of kinds of users [m].
HEIGHTS = {"cat": 0.25, "dog": 0.5, "big_dog": 0.75}
# The share of looks in which somebody of a height [m] is taken for a person. This isn't measured,
# since detectors differ widely.
BY_HEIGHT = Curve(points=((0.2, 0.01), (0.5, 0.03), (0.8, 0.1), (1.1, 0.3)))


class Miscalibration(PerceptionError):
    """A camera that isn't mounted or calibrated as the robot assumes: the same error in each look.

    Attributes:
        yaw_deg: Angle by which all perceived positions are turned round the camera,
            counter-clockwise, with the headings of people; rounded to 1/8192 of a turn.
        scale: Factor of all distances.
        offset: Length added to all distances [m].
    """

    yaw_deg: AngleDeg = Field(default=0.0, ge=-180, le=180)
    scale: float = Field(default=1.0, gt=0, le=10)
    offset: Length = Field(default=0.0, ge=-10, le=10)

    def distort(self, sightings: CameraSightings) -> CameraSightings:
        """Turn and stretch all sightings."""
        moved = sightings.moved(turn_deg=self.yaw_deg, scale=self.scale, offset=self.offset)
        return moved.replace(heading=moved.heading + radians(self.yaw_deg))


class Outliers(PerceptionError):
    """A share of sightings is far off along the ray, as when the depth is that of the background.

    Attributes:
        share: Share of sightings that are outliers.
        spread: Standard deviation of their error in distance, bell-shaped and independent in each
            look [m].
        lasts: Time for which a person stays an outlier, rounded to steps, in intervals from the
            start of the run; 0: each look by itself.
    """

    share: Share = 0.02
    spread: Length = Field(default=1.0, gt=0, le=100)
    lasts: Duration = timedelta(0)

    def distort(self, sightings: CameraSightings) -> CameraSightings:
        """Move the outliers along their rays."""
        steps = max(1, round(micros(self.lasts) / 1e6 / sightings.step_s))
        is_far_off = sightings.uniform("which", at=sightings.step // steps) < self.share
        error = np.where(is_far_off, self.spread * sightings.bell("how far"), 0.0)
        return sightings.moved(offset=error)


class Confusable(Settings):
    """The rate at which a user is taken for others. Short form: a number is the rate.

    Attributes:
        rate: Share of sightings in which the user is taken for somebody else; left out: by height.
        kind: The kind of user, which sets the height.
        height: The height of the user [m].
        others: The shares of users that it is taken for, `unknown` among them; left out: all users
            without an entry equally.
    """

    short_form = ("rate", (str, int, float))

    rate: Share | None = None
    kind: Literal["cat", "dog", "big_dog"] | None = None
    height: Length | None = Field(default=None, gt=0, le=3)
    others: dict[str, Share] = Field(default={})

    @classmethod
    def __get_pydantic_json_schema__(
        cls, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """Add the short form to the schema."""
        short = [{"type": "number"}, {"type": "string"}]
        return {"anyOf": [*short, super().__get_pydantic_json_schema__(schema, handler)]}

    def model_post_init(self, _: object, /) -> None:
        """Require one way to state the rate, and shares that add up to 1."""
        if sum(value is not None for value in (self.rate, self.kind, self.height)) != 1:
            raise problem("give one of rate, kind and height")
        if self.others:
            check_shares(("others",), self.others, whole=True)

    @property
    def share(self) -> float:
        """The share of sightings in which the user is taken for somebody else."""
        if self.rate is not None:
            return self.rate
        height = HEIGHTS[self.kind] if self.kind is not None else self.height
        return BY_HEIGHT.at(height or 0.0)


class TakenFor(PerceptionError):
    """Some users, such as pets, are taken for others at times, each at a rate of its own.

    Attributes:
        users: The users that are taken for others, by name: a rate, or a kind or height.
        lasts: Time of being taken for one user, rounded to steps, in intervals from the start
            of the run; 0: each look by itself.
    """

    users: dict[str, Confusable] = Field(min_length=1)
    lasts: Duration = timedelta(seconds=5)

    def model_post_init(self, _: object, /) -> None:
        """Refuse users who are taken for nobody or for themselves."""
        for name, confusable in self.users.items():
            if name == UNKNOWN:
                raise problem_at(("users", name), "unknown is nobody: false_positives are for that")
            if name in confusable.others:
                raise problem_at(("users", name, "others"), f"{name!r} is itself: leave it out")

    def distort(self, sightings: CameraSightings) -> CameraSightings:
        """Give sightings of these users the names of others."""
        steps = max(1, round(micros(self.lasts) / 1e6 / sightings.step_s))
        at = sightings.step // steps
        draw = sightings.uniform("whether", at=at)
        which = sightings.uniform("for whom", at=at)
        user = sightings.user.copy()
        for name, confusable in self.users.items():
            number = self._number(sightings, name)
            choices, limits = self._choices(sightings, confusable)
            is_taken = (sightings.true_user == number) & (draw < confusable.share)
            for_whom = np.searchsorted(limits, which[is_taken] * limits[-1], side="right")
            user[is_taken] = np.array(choices)[for_whom]
        return sightings.replace(user=user)

    def _choices(
        self, sightings: CameraSightings, confusable: Confusable
    ) -> tuple[list[int], list[int]]:
        """Return the numbers of users that somebody is taken for, and cumulative weights."""
        rest = [user for user in sightings.users if user not in self.users] or [UNKNOWN]
        others = confusable.others or dict.fromkeys(rest, 1.0)
        total = sum_in_order(others.values())
        names = [name for name, share in others.items() if share > 0]
        numbers = [self._number(sightings, name) for name in names]
        weights = {name: others[name] / total for name in names}
        return numbers, cumulative(weights, names)

    @staticmethod
    def _number(sightings: CameraSightings, name: str) -> int:
        if name == UNKNOWN:
            return NOBODY
        check_known(name, "user", sightings.users, ComponentError, "taken_for: ")
        return list(sightings.users).index(name)
