"""Needs and errands: what interrupts a day again and again, as laws with their sources."""

from collections.abc import Mapping
from datetime import timedelta
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import Field, model_validator

from fleet2d.configuration.components import Settings
from fleet2d.configuration.documents import read_document
from fleet2d.configuration.problems import problem
from fleet2d.configuration.units import Duration, Share, TimeOfDay
from fleet2d.routines.activity import AnyDurationLaw, seconds
from fleet2d.routines.schema_forms import SchemaForms

FOLDER = Path(__file__).parent
# The least mean time between two occurrences of a need.
SHORTEST_INTERVAL = timedelta(minutes=5)


class Need(Settings):
    """Something that builds up, and then interrupts an activity, which is resumed afterwards.

    Short form: ``2 h`` is a need with that mean time between two occurrences.

    Attributes:
        activity: The activity; left out: the name of the need.
        every: Time awake between two occurrences.
        asleep: Time asleep until it wakes the person; left out: it never does.
        on_waking: Probability that it is met first on waking.
        before_bed: Probability that it is met last before sleep.
        before_leaving: Probability that it is met last before leaving home.
        on_return: Probability that it is met first on coming home.
        between: The times of day at which it occurs; left out: at any.
        met_by: Activities that meet it, too: it builds up again after them.
        takes: Its duration; left out: that of the activity.
        then: Activities that follow at once, with their probability.
        patience: It waits for the end of an activity that ends within this time.
        source: The source of its numbers, for readers.
    """

    activity: str = ""
    every: AnyDurationLaw
    asleep: AnyDurationLaw | None = None
    on_waking: Share = 0.0
    before_bed: Share = 0.0
    before_leaving: Share = 0.0
    on_return: Share = 0.0
    between: tuple[TimeOfDay, TimeOfDay] | None = None
    met_by: tuple[str, ...] = ()
    takes: AnyDurationLaw | None = None
    then: dict[str, Share] = Field(default_factory=dict)
    patience: Duration = timedelta(minutes=10)
    source: str = ""

    @model_validator(mode="before")
    @classmethod
    def _read_short_form(cls, data: Any) -> Any:
        return {"every": data} if isinstance(data, str | int | float | timedelta) else data

    @model_validator(mode="after")
    def _leaves_time(self) -> Self:
        for key, law in (("every", self.every), ("asleep", self.asleep)):
            if law is not None and law.table().mean() < seconds(SHORTEST_INTERVAL):
                raise problem(f"'{key}' is less than 5 min on average: make it 5 min or longer")
        return self


class Errand(Settings):
    """A short task between two activities: to fetch, put away or look at something.

    Short form: a number is its probability.

    Attributes:
        activity: The activity; left out: the name of the errand.
        probability: Its probability at each such change of activity.
        after: Activities after which it is done; left out: after any.
        before: Activities before which it is done; left out: before any.
        takes: Its duration; left out: that of the activity.
        source: The source of its numbers, for readers.
    """

    activity: str = ""
    probability: Share
    after: tuple[str, ...] = ()
    before: tuple[str, ...] = ()
    takes: AnyDurationLaw | None = None
    source: str = ""

    @model_validator(mode="before")
    @classmethod
    def _read_short_form(cls, data: Any) -> Any:
        return {"probability": data} if isinstance(data, int | float) else data


AnyNeed = Annotated[Need, SchemaForms("text", "number")]
AnyErrand = Annotated[Errand, SchemaForms("number")]


@cache
def usual_needs() -> dict[str, Need]:
    """Return the needs of an adult, which personas without needs of their own have.

    >>> sorted(usual_needs())
    ['call', 'drink', 'toilet']
    """
    data = read_document(FOLDER / "needs.yaml").data["needs"]
    return {name: Need.model_validate(fields) for name, fields in data.items()}


@cache
def usual_errands() -> dict[str, Errand]:
    """Return the errands of an adult, which personas without errands of their own have."""
    data = read_document(FOLDER / "needs.yaml").data["errands"]
    return {name: Errand.model_validate(fields) for name, fields in data.items()}


def activities_of(needs: Mapping[str, Need], errands: Mapping[str, Errand]) -> set[str]:
    """Return the names of the activities of needs and errands."""
    names = {need.activity or name for name, need in needs.items()}
    names |= {what for need in needs.values() for what in need.then}
    return names | {errand.activity or name for name, errand in errands.items()}


def named_activities(
    needs: Mapping[str, Need], errands: Mapping[str, Errand]
) -> list[tuple[tuple[str, ...], str]]:
    """Return pairs of keys in the persona and the activity that needs and errands name there."""
    named: list[tuple[tuple[str, ...], str]] = []
    for name, need in needs.items():
        named.append((("needs", name), need.activity or name))
        named += [(("needs", name, "then", what), what) for what in need.then]
        named += [(("needs", name, "met_by"), what) for what in need.met_by]
    for name, errand in errands.items():
        named.append((("errands", name), errand.activity or name))
        named += [(("errands", name, "after"), what) for what in errand.after]
        named += [(("errands", name, "before"), what) for what in errand.before]
    return named
