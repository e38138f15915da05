"""Scripts: what a scenario lets be done to its run, and when."""

from collections.abc import Mapping
from datetime import timedelta
from typing import Annotated, Any, Self

from pydantic import (
    Field,
    SerializerFunctionWrapHandler,
    ValidationError,
    model_serializer,
    model_validator,
)
from pydantic_core import InitErrorDetails

from fleet2d.component import Settings
from fleet2d.interventions.intervention import Intervention, Verb, refused
from fleet2d.interventions.when import ClockTime, On, When
from fleet2d.problems import problem
from fleet2d.units import Duration

# The keys that stand beside those of an intervention.
WHEN = ("at", "on", "each", "delay")


class Entry(Settings):
    """Something that is done at a time, or on an event: ``{at: "19:00", put: ana, to: kitchen}``.

    An intervention is done at the first step that isn't before its time; on an event, at the step
    after it, or so much later.

    Example:
        >>> entry = Entry(at="19:00", put="ana", to="kitchen")
        >>> entry.act.to
        ('kitchen',)
        >>> entry.model_dump(mode="json", exclude_defaults=True)
        {'at': '19:00', 'do': 'put', 'entity': 'ana', 'to': 'kitchen'}
    """

    at: When | None = Field(default=None, description="the time")
    on: On | None = Field(
        default=None, description="or the event: [user_seen, astro, ana], or its kind alone"
    )
    each: bool = Field(
        default=False, description="every time that it is that time or happens, and not only once"
    )
    delay: Duration = Field(
        default=timedelta(0), description="how long after the event; at least a step"
    )
    act: Annotated[Intervention, Verb()] = Field(description="what is done")

    @model_validator(mode="before")
    @classmethod
    def _part_from_when(cls, data: Any) -> Any:
        """Put what is done, which is written beside when, below `act`."""
        if not isinstance(data, dict) or "act" in data:
            return data
        when = {key: value for key, value in data.items() if key in WHEN}
        return {**when, "act": {key: value for key, value in data.items() if key not in WHEN}}

    @classmethod
    def _explain(cls, line: InitErrorDetails, data: Any) -> InitErrorDetails:
        """Name the keys as they are written."""
        line = super()._explain(line, data)
        if line["loc"][:1] == ("act",):
            line["loc"] = line["loc"][1:]
        return line

    @model_validator(mode="after")
    def _is_at_one_time(self) -> Self:
        if (self.at is None) == (self.on is None):
            raise problem("'at' a time or 'on' an event is wanted, one of them")
        if self.on is None and self.delay:
            raise problem("'delay' is the time after an event: it goes with 'on'")
        if self.each and self.on is None and not isinstance(self.at, ClockTime):
            raise problem(
                "'each' goes with an event, or a time that comes again, like '19:00' or 'monday"
                " 07:30'"
            )
        return self

    @model_serializer(mode="wrap")
    def _beside(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Write what is done beside when."""
        content: dict[str, Any] = handler(self)
        act: dict[str, Any] = content.pop("act", {})
        return {key: value for key, value in content.items() if value is not None} | act


def parse_entry(content: Mapping[str, Any]) -> Entry:
    """Return the entry of a script that a mapping describes.

    Raises:
        ScenarioError: It describes none; says what is wrong.
    """
    try:
        return Entry.model_validate(dict(content))
    except ValidationError as error:
        raise refused("", error) from None
