"""Dock: drive to the charger before the battery is empty, and charge."""

from datetime import datetime, timedelta
from typing import TYPE_CHECKING, ClassVar, Self

from pydantic import Field, model_validator

from fleet2d.component import register
from fleet2d.entities.behavior import Behavior, Situation
from fleet2d.entities.plan import Plan
from fleet2d.errors import ScenarioError
from fleet2d.units import Share, problem

if TYPE_CHECKING:
    from fleet2d.entities.actor import Actor

# With nothing else to do, it stays at the charger so long before all are asked again.
REST = timedelta(hours=1)


@register("behavior", "dock")
class Dock(Behavior):
    """Go to the charger when the charge is down to a threshold, and stay until it is full enough.

    It breaks in on the behaviors behind it at the moment at which the charge reaches the threshold.
    Behind all others, with `rest`, it also takes a robot that has nothing else to do to the
    charger. Called to dock, it goes to the charger at once, whatever the charge is. Events: `docks`
    and `charged`, with the charge.
    """

    records: ClassVar[frozenset[str]] = frozenset({"charged", "docks"})
    answers: ClassVar[frozenset[str]] = frozenset({"dock"})

    threshold: Share = Field(default=0.2, description="charge at which it goes to the charger")
    until: Share = Field(default=1.0, description="charge with which it leaves the charger")
    rest: bool = Field(
        default=False, description="wait at the charger when there is nothing else to do"
    )

    @model_validator(mode="after")
    def _charges(self) -> Self:
        if self.threshold >= self.until:
            raise problem(
                f"it would leave the charger with {self.until:g}, but go there at"
                f" {self.threshold:g}: 'until' must be above 'threshold'"
            )
        return self

    def start(self, actor: "Actor") -> None:
        """Check that there is a battery.

        Raises:
            ScenarioError: There is none.
        """
        if actor.charge is None:
            raise ScenarioError(
                f"{actor.path}: dock needs a battery: give the robot one, like battery: {{driving:"
                " 2 h, standing: 10 h, charging: 3 h, charger: hallway}"
            )
        self.charging = False

    def busy(self) -> bool:
        """Tell whether it is charging."""
        return self.charging

    def wakes_at(self, now: Situation, plan: Plan) -> datetime | None:
        """Return when the plan brings the charge down to the threshold."""
        charge = now.actor.charge
        assert charge is not None
        falls = charge.falls_to(self.threshold, plan.finish())
        return None if falls is None else now.actor.clock.start + timedelta(microseconds=falls)

    def decide(self, now: Situation) -> Plan | None:
        """Charge, if it is time; rest at the charger, if that is wanted."""
        charge = now.actor.charge
        assert charge is not None
        plan, there = now.plan(), charge.charger
        called = now.take_command("dock") is not None
        low = charge.level <= self.threshold
        if called or low or (self.charging and charge.level < self.until):
            if not self.charging or (plan.x, plan.y) != there:
                plan.go_to_point(*there).note("docks", charge.percent)
            self.charging = True
            return plan.stay(timedelta(microseconds=charge.full_in_us(self.until)))
        if self.charging:
            self.charging = False
            plan.note("charged", charge.percent)
            if not self.rest:
                # The row belongs to a plan, and the behaviors behind have one of their own.
                return plan.stay(timedelta(microseconds=1))
        if self.rest:
            if (plan.x, plan.y) != there:
                plan.go_to_point(*there)
            return plan.stay(REST)
        return None
