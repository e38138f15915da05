"""Dock: drive to the charger before the battery is empty, and charge."""

from datetime import datetime, timedelta

from fleet2d.configuration.problems import problem
from fleet2d.configuration.units import Share
from fleet2d.entities.behavior import Actor, Behavior, Situation
from fleet2d.entities.place import avoided_rooms, lies_in
from fleet2d.entities.plan import Plan
from fleet2d.errors import ScenarioError
from fleet2d.floorplan.lattice import LatticePoint
from fleet2d.runtime.events import EventKind

# Time of rest at the charger before all behaviors are asked again.
REST = timedelta(hours=1)


class Dock(Behavior):
    """Go to the charger when the charge falls to a threshold, and stay until it is full enough.

    It interrupts the behaviors after it when the charge reaches the threshold. With `rest`, as the
    last behavior, it also sends a robot that has nothing else to do to the charger. On a command to
    dock, it goes to the charger at once, whatever the charge. Events: `docks` and `charged`, with
    the charge.

    Attributes:
        threshold: Charge at which it goes to the charger.
        until: Charge with which it leaves the charger.
        rest: Wait at the charger when there is nothing else to do.
        no_stops_in: Rooms, or kinds of rooms if the home has them, that it goes round on its way,
            as long as there is another way.
    """

    records = frozenset({EventKind.CHARGED, EventKind.DOCKS})
    answers = frozenset({"dock"})

    threshold: Share = 0.2
    until: Share = 1.0
    rest: bool = False
    no_stops_in: tuple[str, ...] = ()

    def model_post_init(self, _: object, /) -> None:
        """Refuse a robot that would leave the charger and return at once."""
        if self.threshold >= self.until:
            raise problem(
                f"it would leave the charger with {self.until:g}, but go there at"
                f" {self.threshold:g}: 'until' must be above 'threshold'"
            )

    def start(self, actor: Actor) -> None:
        """Check that there is a battery.

        Raises:
            ScenarioError: There is no battery, or the charger is in a room to avoid.
        """
        if actor.charge is None:
            raise ScenarioError(
                f"{actor.path}: dock needs a battery: give the robot one, like battery: {{driving:"
                " 2 h, standing: 10 h, charging: 3 h, charger: hallway}"
            )
        self.charging = False
        self.avoided = avoided_rooms(actor, "dock.no_stops_in", self.no_stops_in)
        if lies_in(actor, actor.charge.charger, self.avoided):
            raise ScenarioError(
                f"{actor.path}: dock.no_stops_in has the room of the charger: leave it out, or move"
                " the charger by battery.charger"
            )

    def busy(self) -> bool:
        """Return whether the robot is charging."""
        return self.charging

    def wakes_at(self, now: Situation, plan: Plan) -> datetime | None:
        """Return the time at which the plan brings the charge down to the threshold."""
        charge = now.actor.charge
        assert charge is not None
        falls = charge.falls_to(self.threshold, plan.finish())
        return None if falls is None else now.actor.clock.start + timedelta(microseconds=falls)

    def leaves_turns(self) -> bool:
        """Return whether later behaviors may be asked; not if the robot rests instead."""
        return not self.rest or bool(self.when or self.cooldown)

    def decide(self, now: Situation) -> Plan | None:
        """Charge, if the charge is low; rest at the charger, with `rest`."""
        charge = now.actor.charge
        assert charge is not None
        plan = now.plan()
        charger = charge.charger
        has_command = now.take_command("dock") is not None
        is_low = charge.level <= self.threshold
        if has_command or is_low or (self.charging and charge.level < self.until):
            if not self.charging or plan.position != charger:
                self._go(plan, now.actor, charger).note(EventKind.DOCKS, charge.percent)
            self.charging = True
            return plan.stay(timedelta(microseconds=charge.time_to_charge(self.until)))
        if self.charging:
            self.charging = False
            plan.note(EventKind.CHARGED, charge.percent)
            if not self.rest:
                # The note needs a plan: the shortest one, so that later behaviors are asked next.
                return plan.stay(timedelta(microseconds=1))
        if self.rest:
            if plan.position != charger:
                self._go(plan, now.actor, charger)
            return plan.stay(REST)
        return None

    def _go(self, plan: Plan, actor: Actor, charger: LatticePoint) -> Plan:
        """Add the way to the charger to a plan: round the rooms to avoid, else the shortest."""
        route = None
        if self.avoided:
            route = actor.space_without(self.avoided).route(plan.position, charger)
        return plan.go_to_point(*charger, route=route)
