"""Scripts: the interventions of a scenario, and when they happen."""

from collections.abc import Mapping
from datetime import timedelta
from typing import Annotated, Any, Self

from pydantic import (
    SerializerFunctionWrapHandler,
    ValidationError,
    model_serializer,
    model_validator,
)
from pydantic_core import InitErrorDetails

from fleet2d.configuration.components import Settings
from fleet2d.configuration.problems import problem, refusal
from fleet2d.configuration.units import Duration
from fleet2d.interventions.intervention import Intervention, Verb
from fleet2d.interventions.when import ClockTime, On, When

# The keys that stand beside those of an intervention.
WHEN = frozenset({"at", "on", "each", "delay"})


class Entry(Settings):
    """An intervention at a time or on an event: ``{at: "19:00", put: ana, to: kitchen}``.

    It happens at the first step that isn't before its time; or at the step after its event, or
    later by a delay.

    Attributes:
        at: The time.
        on: The event instead of a time: [user_seen, astro, ana], or its kind alone.
        each: Whether it happens at every such time or event, not only at the first.
        delay: Time from the event to the intervention; at least a step.
        act: The intervention.

    Example:
        >>> entry = Entry(at="19:00", put="ana", to="kitchen")
        >>> entry.act.to
        ('kitchen',)
        >>> entry.model_dump(mode="json", exclude_defaults=True)
        {'at': '19:00', 'do': 'put', 'entity': 'ana', 'to': 'kitchen'}
    """

    at: When | None = None
    on: On | None = None
    each: bool = False
    delay: Duration = timedelta(0)
    act: Annotated[Intervention, Verb()]

    @model_validator(mode="before")
    @classmethod
    def _nest_act(cls, data: Any) -> Any:
        """Move the keys of the intervention, which are written beside its time, into `act`."""
        if not isinstance(data, dict) or "act" in data:
            return data
        times = {key: value for key, value in data.items() if key in WHEN}
        return {**times, "act": {key: value for key, value in data.items() if key not in WHEN}}

    @classmethod
    def _explain(cls, line: InitErrorDetails, data: Any) -> InitErrorDetails:
        """Return an error that names the keys as they are written."""
        line = super()._explain(line, data)
        if line["loc"][:1] == ("act",):
            line["loc"] = line["loc"][1:]
        return line

    @model_validator(mode="after")
    def _has_one_time(self) -> Self:
        if (self.at is None) == (self.on is None):
            raise problem("give exactly one of 'at' (a time) and 'on' (an event)")
        if self.on is None and self.delay:
            raise problem("'delay' is the time after an event: it goes with 'on'")
        if self.each and self.on is None and not isinstance(self.at, ClockTime):
            raise problem(
                "'each' goes with an event, or a time that comes again, like '19:00' or 'monday"
                " 07:30'"
            )
        return self

    @model_serializer(mode="wrap")
    def _flatten_act(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Return the keys of the intervention beside its time."""
        content: dict[str, Any] = handler(self)
        act: dict[str, Any] = content.pop("act", {})
        return {key: value for key, value in content.items() if value is not None} | act


def parse_entry(content: Mapping[str, Any]) -> Entry:
    """Return the entry of a script that a mapping describes.

    Raises:
        ScenarioError: It is not valid; the message says what is wrong.
    """
    try:
        return Entry.model_validate(dict(content))
    except ValidationError as error:
        raise refusal("", error) from None


def causes_errors(act: Intervention, robot: str) -> bool:
    """Whether an intervention lets a robot perceive something wrong."""
    disturbance = getattr(act, "disturbance", None)
    if disturbance is None or getattr(act, "entity", None) != robot:
        return False
    return bool(disturbance.errs or disturbance.mistaken or disturbance.injected)
