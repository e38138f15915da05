"""Interventions on people: away, call_home, guest, activity."""

from datetime import timedelta

from pydantic import Field

from fleet2d.configuration.components import register
from fleet2d.configuration.problems import suggest
from fleet2d.configuration.units import PositiveDuration
from fleet2d.entities.decisions import DoActivity, GoOut, GoTo
from fleet2d.entities.place import Place
from fleet2d.entities.users.guest import Guest
from fleet2d.errors import ScenarioError
from fleet2d.interventions.bodies import check_reach
from fleet2d.interventions.intervention import Intervention, user
from fleet2d.interventions.world import World


class PersonIntervention(Intervention):
    """Base of interventions on a person.

    Attributes:
        entity: The person.
    """

    entity: str

    def check(self, world: World) -> None:
        """Refuse an unknown person."""
        user(world, self.entity)


@register("intervention", "away")
class Away(PersonIntervention):
    """Send a person to the exit, and away until called home.

    Attributes:
        duration: How long the person is away; left out: until called home or released.
    """

    duration: PositiveDuration | None = None

    def begin(self, world: World) -> None:
        """Give the order."""
        user(world, self.entity).follow_order(GoOut(self.duration), world.step)


@register("intervention", "call_home")
class CallHome(PersonIntervention):
    """Call a person home, who comes in at the exit and stays until released.

    Attributes:
        to: The destination: a room, furniture, or a point.
        duration: How long the person stays there; left out: until released.
    """

    to: Place = ("living_room", "any")
    duration: PositiveDuration | None = None

    def check(self, world: World) -> None:
        """Refuse a place that doesn't exist or can't be reached."""
        check_reach(user(world, self.entity), self.to)

    def begin(self, world: World) -> None:
        """Give the order."""
        user(world, self.entity).follow_order(GoTo(self.to, None, self.duration), world.step)


@register("intervention", "guest")
class LetIn(PersonIntervention):
    """Let a guest, a user with the behavior `guest`, come, stay for a while, and leave.

    Attributes:
        to: The destination: a room, furniture, or a point.
        duration: How long the guest stays there.
    """

    to: Place = ("living_room", "any")
    duration: PositiveDuration = timedelta(hours=2)

    def check(self, world: World) -> None:
        """Refuse a user who is not a guest, and an unknown place."""
        actor = user(world, self.entity)
        if not any(isinstance(behavior, Guest) for behavior in actor.behaviors):
            raise ScenarioError(
                f"{self.entity} is not a guest: a guest is a user with that behavior, like users:"
                " {gina: guest}; use call_home for people who live here"
            )
        check_reach(actor, self.to)

    def begin(self, world: World) -> None:
        """Give the order."""
        user(world, self.entity).follow_order(GoTo(self.to, None, self.duration), world.step)


@register("intervention", "activity")
class StartActivity(PersonIntervention):
    """Let a person do an activity at its place, sitting or lying as is usual.

    Attributes:
        what: The name of the activity in the persona or agenda.
        to: The place; left out: where the person's own behavior does it.
        duration: How long the person does it; left out: until released.
    """

    what: str = Field(min_length=1)
    to: Place | None = None
    duration: PositiveDuration | None = None

    def check(self, world: World) -> None:
        """Refuse an activity for which the person has no place."""
        actor = user(world, self.entity)
        if self.to is not None:
            check_reach(actor, self.to)
            return
        names = [name for behavior in actor.behaviors for name in behavior.activities()]
        if self.what not in names:
            raise ScenarioError(
                f"{self.entity} has no activity {self.what!r}{suggest(self.what, names)};"
                " or say where it is done, as to: kitchen"
            )

    def begin(self, world: World) -> None:
        """Give the order."""
        order = DoActivity(self.what, self.to, self.duration)
        user(world, self.entity).follow_order(order, world.step)
