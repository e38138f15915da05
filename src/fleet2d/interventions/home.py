"""Interventions on the home: open, shut, lock, unlock, move, room."""

from typing import ClassVar

from pydantic import Field

from fleet2d.configuration.components import register
from fleet2d.entities.place import Point
from fleet2d.floorplan.home import HomeChange
from fleet2d.interventions.intervention import Intervention
from fleet2d.interventions.world import World


class HomeIntervention(Intervention):
    """Base of interventions that change the home."""

    @property
    def home_change(self) -> HomeChange:
        """The change."""
        raise NotImplementedError

    def check(self, world: World) -> None:
        """Refuse a change of something unknown."""
        world.check_change(self.home_change)

    def begin(self, world: World) -> None:
        """Change the home at the present step."""
        world.change(self.home_change)


@register("intervention", "change")
class Change(HomeIntervention):
    """Change the home like an entry of `changes`.

    Attributes:
        change: The change, as in `changes` of a scenario.
    """

    subject: ClassVar[str] = "change"
    change: HomeChange

    @property
    def home_change(self) -> HomeChange:
        """The change."""
        return self.change


class DoorIntervention(HomeIntervention):
    """Base of interventions on a door.

    Attributes:
        door: The door.
    """

    subject: ClassVar[str] = "door"
    door: str

    @property
    def home_change(self) -> HomeChange:
        """The change."""
        return HomeChange.model_validate({self.type_name: self.door})


@register("intervention", "open")
class Open(DoorIntervention):
    """Open a door, even a locked one."""


@register("intervention", "shut")
class Shut(DoorIntervention):
    """Shut a door, as soon as nobody stands in the doorway."""


@register("intervention", "lock")
class Lock(DoorIntervention):
    """Lock a door: nobody opens it by hand once it is shut."""


@register("intervention", "unlock")
class Unlock(DoorIntervention):
    """Unlock a door."""


@register("intervention", "move")
class Move(HomeIntervention):
    """Move a piece of furniture.

    Attributes:
        object: The piece of furniture.
        to: Where its centre is then, [x, y] in metres.
        turn_deg: How far it is turned, counter-clockwise.
    """

    subject: ClassVar[str] = "object"
    object: str
    to: Point
    turn_deg: float = Field(default=0.0, ge=-3600, le=3600)

    @property
    def home_change(self) -> HomeChange:
        """The change."""
        return HomeChange(move=self.object, to=self.to, turn_deg=self.turn_deg)


@register("intervention", "room")
class SetRoomType(HomeIntervention):
    """Change the type of a room: behaviors that go to a bedroom go there from then on.

    Attributes:
        name: The room.
        type: Its new type.
    """

    subject: ClassVar[str] = "name"
    name: str
    type: str

    @property
    def home_change(self) -> HomeChange:
        """The change."""
        return HomeChange(room=self.name, type=self.type)
