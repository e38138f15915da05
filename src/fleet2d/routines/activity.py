"""Activities: what people do, where, for how long, and how much they move meanwhile."""

from collections.abc import Callable
from datetime import timedelta
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

from pydantic import model_validator

from fleet2d.configuration.components import Settings
from fleet2d.configuration.documents import read_document
from fleet2d.configuration.problems import problem, suggest
from fleet2d.configuration.schema_forms import SchemaForms
from fleet2d.configuration.units import Duration, PositiveDuration, format_duration
from fleet2d.floorplan.rooms.room import PASSED_THROUGH
from fleet2d.routines import distributions
from fleet2d.routines.distributions import Distribution
from fleet2d.runtime.clock import SECOND

SettingsType = TypeVar("SettingsType", bound=Settings)

FOLDER = Path(__file__).parent
# Standard deviation of a duration of which only the mean is given, relative to the mean.
DEFAULT_SPREAD = 0.3


def seconds(duration: timedelta) -> int:
    """Return a duration in whole seconds."""
    return duration // SECOND


class DurationDistribution(Settings):
    """A distribution of durations: how long something takes.

    Short forms: ``30 min`` is a lognormal distribution with that mean, ``[20 min, 40 min]`` a
    uniform one.

    Attributes:
        law: The family of the distribution.
        mean: Its mean, before it is cut.
        std: Its standard deviation; left out: 30 % of the mean.
        at_least: Nothing shorter is drawn.
        at_most: Nothing longer is drawn.
        quantiles: For the law `measured`: quantiles at evenly spaced probabilities from 0 to 1.
    """

    law: Literal["lognormal", "gamma", "normal", "uniform", "exponential", "fixed", "measured"] = (
        "lognormal"
    )
    mean: PositiveDuration = timedelta(minutes=30)
    std: Duration | None = None
    at_least: Duration | None = None
    at_most: Duration | None = None
    quantiles: tuple[Duration, ...] = ()

    @model_validator(mode="before")
    @classmethod
    def _read_short_forms(cls, data: Any) -> Any:
        if isinstance(data, str | int | float | timedelta):
            return {"mean": data}
        if isinstance(data, list | tuple):
            if len(data) != 2:
                raise problem(f"expected a range of durations like [20 min, 40 min], got {data}")
            return {"law": "uniform", "at_least": data[0], "at_most": data[1]}
        return data

    def model_post_init(self, _: object, /) -> None:
        """Require the parameters of the distribution, and durations that are possible."""
        if self.law == "uniform" and (self.at_least is None or self.at_most is None):
            raise problem("law uniform needs at_least and at_most")
        if self.law == "measured" and (
            len(self.quantiles) < 2 or list(self.quantiles) != sorted(self.quantiles)
        ):
            raise problem("law measured needs 'quantiles': two durations or more, rising")
        if self.at_least and self.at_most and self.at_least > self.at_most:
            raise problem(
                f"at_least {format_duration(self.at_least)} is longer than at_most"
                f" {format_duration(self.at_most)}"
            )
        if (self.at_most or self.mean) < SECOND:
            raise problem("the longest duration is below one second: make it longer")

    def table(self) -> Distribution:
        """Return the distribution as a table of quantiles [s]."""
        mean = seconds(self.mean)
        std = seconds(self.std) if self.std is not None else int(mean * DEFAULT_SPREAD)
        low = None if self.at_least is None else seconds(self.at_least)
        high = None if self.at_most is None else seconds(self.at_most)
        if self.law == "uniform":
            return distributions.uniform(low or 0, high or 0)
        if self.law == "measured":
            return distributions.empirical([seconds(d) for d in self.quantiles]).within(low, high)
        if self.law == "fixed" or std == 0:
            return distributions.uniform(mean, mean)
        if self.law == "exponential":
            return distributions.exponential(mean).within(low, high)
        make: Callable[[float, float], Distribution] = getattr(distributions, self.law)
        return make(mean, std).within(low, high)


AnyDurationDistribution = Annotated[DurationDistribution, SchemaForms("text", "number", "pair")]
"""A distribution of durations, in any form."""


# Kinds of rooms in which people do nothing unless an activity names them.
NOT_LIVED_IN = (
    *PASSED_THROUGH,
    "bathroom",
    "toilet",
    "laundry",
    "garage",
    "boiler_room",
    "wardrobe",
    "storage",
    "passenger_elevator",
    "freight_elevator",
    "aeration",
)


class Activity(Settings):
    """Something that people do: where, how, how long, and how much they move meanwhile.

    Attributes:
        rooms: Rooms or kinds of rooms to try, in turn.
        objects: Kinds of furniture to use, tried in turn; none: a spot in the room.
        posture: Posture if there is no such furniture.
        away: Whether it is done out of the home.
        exclusive: Whether only one member of a household does it at a time, as in a bathroom.
        first: What decides where it is done. furniture: the first kind of room in which its
            furniture stands; room: the first kind of room that exists.
        choose: The choice among several rooms: own: one of the first kind that exists, always the
            same; nearest: the nearest of all listed kinds; each_time: one of all listed kinds,
            drawn each time; here: the room that the person is in.
        interruptible: Whether needs interrupt it; else they wait for its end.
        takes: How long it takes.
        shifts: Mean time between turns on the spot; left out: no turns.
        moves: Mean time between walks to another spot of the room.
        fetches: Mean time between short trips to another room and back.
        fetches_from: Rooms to try for such trips, in turn.
        fetch_takes: How long such a trip stays there.
    """

    rooms: tuple[str, ...] = ("any",)
    objects: tuple[str, ...] = ()
    posture: Literal["stand", "sit", "lie"] = "stand"
    away: bool = False
    exclusive: bool = False
    first: Literal["furniture", "room"] = "furniture"
    choose: Literal["own", "nearest", "each_time", "here"] = "own"
    interruptible: bool = True
    takes: AnyDurationDistribution = DurationDistribution()
    shifts: PositiveDuration | None = None
    moves: PositiveDuration | None = None
    fetches: PositiveDuration | None = None
    fetches_from: tuple[str, ...] = ("kitchen", "any")
    fetch_takes: AnyDurationDistribution = DurationDistribution(mean=timedelta(minutes=2))


def bundled(
    model: type[SettingsType], file: str, section: str | None = None
) -> dict[str, SettingsType]:
    """Return the settings by name in a file of this package, or in a section of it."""
    data = read_document(FOLDER / file).data
    entries = data if section is None else data[section]
    return {name: model.model_validate(fields) for name, fields in entries.items()}


@cache
def catalogue() -> dict[str, Activity]:
    """Return the activities that come with Fleet2D, by name.

    >>> catalogue()["cook"].rooms, catalogue()["work"].away
    (('kitchen', 'any'), True)
    """
    return bundled(Activity, "activities.yaml")


def find_activity(name: str, own: dict[str, Activity]) -> Activity:
    """Return an activity by its name, `own` ones before those of the catalogue.

    Raises:
        PydanticCustomError: There is none of that name.
    """
    if name in own:
        return own[name]
    if name in catalogue():
        return catalogue()[name]
    known = sorted({*own, *catalogue()})
    raise problem(
        f"there is no activity {name!r}{suggest(name, known)};"
        " a new one is described under 'activities'"
    )
