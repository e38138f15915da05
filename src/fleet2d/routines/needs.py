"""Needs and errands: what comes up in a day again and again, as laws with their sources."""

from collections.abc import Mapping
from datetime import timedelta
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import Field, model_validator

from fleet2d.component import Settings
from fleet2d.document import read_document
from fleet2d.problems import problem
from fleet2d.routines.activity import AnyTakes, seconds
from fleet2d.routines.written import OrWritten
from fleet2d.units import Duration, Share, TimeOfDay

HERE = Path(__file__).parent
# Nothing comes up more often than that on average.
SHORTEST_INTERVAL = timedelta(minutes=5)


class Need(Settings):
    """Something that builds up: it interrupts what one does, and afterwards one goes on.

    Short form: ``2 h`` is a need with that mean time from one time to the next.
    """

    activity: str = Field(default="", description="what is done; left out: as the need is called")
    every: AnyTakes = Field(description="time awake from one time to the next")
    asleep: AnyTakes | None = Field(
        default=None, description="time asleep until it wakes one; left out: it never does"
    )
    on_waking: Share = Field(default=0.0, description="how likely it is the first thing on waking")
    before_bed: Share = Field(default=0.0, description="how likely it is done right before sleep")
    before_leaving: Share = Field(
        default=0.0, description="how likely it is done right before leaving home"
    )
    on_return: Share = Field(default=0.0, description="how likely it is done on coming home")
    between: tuple[TimeOfDay, TimeOfDay] | None = Field(
        default=None, description="the times of day at which it comes up; left out: at any"
    )
    met_by: tuple[str, ...] = Field(
        default=(), description="activities that meet it, too: it builds up anew after them"
    )
    takes: AnyTakes | None = Field(default=None, description="how long; left out: as the activity")
    then: dict[str, Share] = Field(
        default_factory=dict, description="activities that follow at once, and how likely each does"
    )
    patience: Duration = Field(
        default=timedelta(minutes=10),
        description="it waits for the end of what one does if that is no later than this",
    )
    source: str = Field(default="", description="where its numbers come from, for people to read")

    @model_validator(mode="before")
    @classmethod
    def _read_short_form(cls, data: Any) -> Any:
        return {"every": data} if isinstance(data, str | int | float | timedelta) else data

    @model_validator(mode="after")
    def _leaves_time(self) -> Self:
        for key, law in (("every", self.every), ("asleep", self.asleep)):
            if law is not None and law.table().mean() < seconds(SHORTEST_INTERVAL):
                raise problem(f"'{key}' is less than 5 min on average: that leaves no time to live")
        return self


class Errand(Settings):
    """A short way between two activities: something is fetched, put away, looked at.

    Short form: a number is its probability.
    """

    activity: str = Field(default="", description="what is done; left out: as the errand is called")
    probability: Share = Field(description="how likely it is done at each such change of activity")
    after: tuple[str, ...] = Field(
        default=(), description="activities after which it is done; left out: after any"
    )
    before: tuple[str, ...] = Field(
        default=(), description="activities before which it is done; left out: before any"
    )
    takes: AnyTakes | None = Field(default=None, description="how long; left out: as the activity")
    source: str = Field(default="", description="where its numbers come from, for people to read")

    @model_validator(mode="before")
    @classmethod
    def _read_short_form(cls, data: Any) -> Any:
        return {"probability": data} if isinstance(data, int | float) else data


AnyNeed = Annotated[Need, OrWritten("text", "number")]
AnyErrand = Annotated[Errand, OrWritten("number")]


@cache
def usual_needs() -> dict[str, Need]:
    """Return the needs of an adult, those of personas that state none.

    >>> sorted(usual_needs())
    ['call', 'drink', 'toilet']
    """
    data = read_document(HERE / "needs.yaml").data["needs"]
    return {name: Need.model_validate(fields) for name, fields in data.items()}


@cache
def usual_errands() -> dict[str, Errand]:
    """Return the errands of an adult, those of personas that state none."""
    data = read_document(HERE / "needs.yaml").data["errands"]
    return {name: Errand.model_validate(fields) for name, fields in data.items()}


def activities_of(needs: Mapping[str, Need], errands: Mapping[str, Errand]) -> set[str]:
    """Return the names of the activities that needs and errands consist of."""
    names = {need.activity or name for name, need in needs.items()}
    names |= {what for need in needs.values() for what in need.then}
    return names | {errand.activity or name for name, errand in errands.items()}


def named_activities(
    needs: Mapping[str, Need], errands: Mapping[str, Errand]
) -> list[tuple[tuple[str, ...], str]]:
    """Return every activity that needs and errands name, each with its keys in the persona."""
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
