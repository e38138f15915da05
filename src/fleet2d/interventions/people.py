"""What is done to people: away, call_home, guest, activity."""

from datetime import timedelta

from pydantic import Field

from fleet2d.component import register
from fleet2d.entities.orders import DoActivity, GoOut, GoTo
from fleet2d.entities.place import Place
from fleet2d.entities.users.guest import Guest
from fleet2d.errors import ScenarioError
from fleet2d.interventions.bodies import check_reach
from fleet2d.interventions.intervention import Intervention, user
from fleet2d.interventions.world import World
from fleet2d.problems import did_you_mean
from fleet2d.units import PositiveDuration


class OfPerson(Intervention):
    """Base of what is done to a person."""

    entity: str = Field(description="the person")

    def check(self, world: World) -> None:
        """Refuse a person that there isn't."""
        user(world, self.entity)


@register("intervention", "away")
class Away(OfPerson):
    """Send a person out of the home: to the way out on foot, and away until called home."""

    duration: PositiveDuration | None = Field(
        default=None, description="for how long; left out: until called home or released"
    )

    def begin(self, world: World) -> None:
        """Set out."""
        user(world, self.entity).obey(GoOut(self.duration), world.step)


@register("intervention", "call_home")
class CallHome(OfPerson):
    """Call a person home, who comes in by the way out and stays until released."""

    to: Place = Field(
        default=("living_room", "any"), description="where to: a room, furniture, or a point"
    )
    duration: PositiveDuration | None = Field(
        default=None, description="for how long it stays there; left out: until released"
    )

    def check(self, world: World) -> None:
        """Refuse a place that there isn't, or that nobody gets to."""
        check_reach(user(world, self.entity), self.to)

    def begin(self, world: World) -> None:
        """Set out."""
        user(world, self.entity).obey(GoTo(self.to, None, self.duration), world.step)


@register("intervention", "guest")
class LetIn(OfPerson):
    """Let a guest come, stay for a while, and leave: somebody with the behavior `guest`."""

    to: Place = Field(
        default=("living_room", "any"), description="where to: a room, furniture, or a point"
    )
    duration: PositiveDuration = Field(
        default=timedelta(hours=2), description="for how long the guest stays there"
    )

    def check(self, world: World) -> None:
        """Refuse somebody who lives here, and a place that there isn't."""
        actor = user(world, self.entity)
        if not any(isinstance(behavior, Guest) for behavior in actor.behaviors):
            raise ScenarioError(
                f"{self.entity} is no guest: a guest is a user with that behavior, like users:"
                " {gina: guest}; call_home is for who lives here"
            )
        check_reach(actor, self.to)

    def begin(self, world: World) -> None:
        """Come in."""
        user(world, self.entity).obey(GoTo(self.to, None, self.duration), world.step)


@register("intervention", "activity")
class Activity(OfPerson):
    """Let a person do something: where it is done, sitting or lying as one does."""

    what: str = Field(min_length=1, description="its name in the persona or agenda")
    to: Place | None = Field(
        default=None, description="where; left out: where the person does it by its own behavior"
    )
    duration: PositiveDuration | None = Field(
        default=None, description="for how long; left out: until released"
    )

    def check(self, world: World) -> None:
        """Refuse what the person has no place for."""
        actor = user(world, self.entity)
        if self.to is not None:
            check_reach(actor, self.to)
            return
        known = [name for behavior in actor.behaviors for name in behavior.activities()]
        if self.what not in known:
            raise ScenarioError(
                f"{self.entity} has no activity {self.what!r}"
                f"{did_you_mean(self.what, known)} There are: {', '.join(known) or 'none'};"
                " or say where it is done, as to: kitchen"
            )

    def begin(self, world: World) -> None:
        """Set out."""
        order = DoActivity(self.what, self.to, self.duration)
        user(world, self.entity).obey(order, world.step)
