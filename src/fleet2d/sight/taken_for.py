"""People and pets that a detector takes for somebody else, each at a rate of its own."""

from datetime import timedelta
from typing import Any, Literal

import numpy as np
from pydantic import Field, GetJsonSchemaHandler, model_validator
from pydantic_core import CoreSchema

from fleet2d.configuration.components import Settings, register
from fleet2d.configuration.problems import problem, problem_at
from fleet2d.configuration.units import Duration, Length, Share, micros
from fleet2d.errors import ComponentError
from fleet2d.kernels import NOBODY
from fleet2d.runtime.determinism import sum_in_order
from fleet2d.sight.perception import SUM_ERROR, Curve, cumulative
from fleet2d.sight.perception_error import CameraSightings, PerceptionError

UNKNOWN = "unknown"
# How tall a user of a kind is [m].
HEIGHTS = {"cat": 0.25, "dog": 0.5, "big_dog": 0.75}
# How often somebody of a height [m] is taken for a person. Not measured: detectors differ widely.
BY_HEIGHT = Curve(points=((0.2, 0.01), (0.5, 0.03), (0.8, 0.1), (1.1, 0.3)))


class Confusable(Settings):
    """How often a user is taken for others. Short form: a number is the rate.

    Attributes:
        rate: Share of sightings in which it is taken for somebody else; left out: by its height.
        kind: What it is: its height is that of its kind.
        height: How tall it is [m].
        others: The shares of those that it is taken for, `unknown` among them; left out: all
            users without an entry equally.
    """

    rate: Share | None = None
    kind: Literal["cat", "dog", "big_dog"] | None = None
    height: Length | None = Field(default=None, gt=0, le=3)
    others: dict[str, Share] = Field(default={})

    @model_validator(mode="before")
    @classmethod
    def _read_short_form(cls, data: Any) -> Any:
        return {"rate": data} if isinstance(data, str | int | float) else data

    @classmethod
    def __get_pydantic_json_schema__(
        cls, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """Add the short form to the schema."""
        short = [{"type": "number"}, {"type": "string"}]
        return {"anyOf": [*short, super().__get_pydantic_json_schema__(schema, handler)]}

    @model_validator(mode="after")
    def _has_a_rate(self) -> "Confusable":
        if sum(value is not None for value in (self.rate, self.kind, self.height)) != 1:
            raise problem("give one of rate, kind and height")
        total = sum_in_order(self.others.values())
        if self.others and abs(total - 1) > SUM_ERROR:
            raise problem_at(("others",), f"the shares add up to {total:g}, not to 1")
        return self

    @property
    def share(self) -> float:
        """The share of sightings in which it is taken for somebody else."""
        if self.rate is not None:
            return self.rate
        return BY_HEIGHT.at(HEIGHTS[self.kind] if self.kind is not None else self.height or 0.0)


@register("perception_error", "taken_for")
class TakenFor(PerceptionError):
    """Some users, such as pets, are taken for others at times, each at a rate of its own.

    Attributes:
        users: The users that are taken for others, by name: a rate, or how tall each is.
        lasts: How long somebody is taken for another, rounded to steps, in intervals from the start
            of the run; 0: each look by itself.
    """

    users: dict[str, Confusable] = Field(min_length=1)
    lasts: Duration = timedelta(seconds=5)

    @model_validator(mode="after")
    def _names_others(self) -> "TakenFor":
        for name, confusable in self.users.items():
            if name == UNKNOWN:
                raise problem_at(("users", name), "unknown is nobody: false_positives are for that")
            if name in confusable.others:
                raise problem_at(("users", name, "others"), f"{name!r} is itself: leave it out")
        return self

    def distort(self, sightings: CameraSightings) -> CameraSightings:
        """Give sightings of these users the names of others."""
        steps = max(1, round(micros(self.lasts) / 1e6 / sightings.step_s))
        at = sightings.step // steps
        draw, which = sightings.uniform("whether", at=at), sightings.uniform("for whom", at=at)
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
        """Return the numbers of those that somebody is taken for, and cumulative weights."""
        others = confusable.others or {u: 1.0 for u in sightings.users if u not in self.users}
        others = others or {UNKNOWN: 1.0}
        names = [name for name, share in others.items() if share > 0]
        numbers = [self._number(sightings, name) for name in names]
        weights = {name: others[name] / sum_in_order(others.values()) for name in names}
        return numbers, cumulative(weights, names)

    @staticmethod
    def _number(sightings: CameraSightings, name: str) -> int:
        if name == UNKNOWN:
            return NOBODY
        if name not in sightings.users:
            raise ComponentError(
                f"taken_for: there is no user {name!r}; there are: {', '.join(sightings.users)}"
            )
        return list(sightings.users).index(name)
