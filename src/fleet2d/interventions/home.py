"""What is done to the home: open, shut, lock, unlock, move, room."""

from typing import ClassVar

from pydantic import Field

from fleet2d.component import register
from fleet2d.entities.place import Point
from fleet2d.floorplan.home.change import HomeChange
from fleet2d.interventions.intervention import Intervention
from fleet2d.interventions.world import World


class OfHome(Intervention):
    """Base of what changes the home."""

    @property
    def what(self) -> HomeChange:
        """The change."""
        raise NotImplementedError

    def check(self, world: World) -> None:
        """Refuse what names nothing that is there."""
        world.check_change(self.what)

    def begin(self, world: World) -> None:
        """Let the floor plan take it up at the present step."""
        world.change(self.what)


@register("intervention", "change")
class Change(OfHome):
    """Change the home, as an entry of `changes` says."""

    subject: ClassVar[str] = "change"
    change: HomeChange = Field(description="what changes, as in `changes` of a scenario")

    @property
    def what(self) -> HomeChange:
        """The change."""
        return self.change


class OfDoor(OfHome):
    """Base of what is done to a door."""

    subject: ClassVar[str] = "door"
    door: str = Field(description="the door")

    @property
    def what(self) -> HomeChange:
        """The change."""
        return HomeChange.model_validate({self.type_name: self.door})


@register("intervention", "open")
class Open(OfDoor):
    """Open a door, even a locked one."""


@register("intervention", "shut")
class Shut(OfDoor):
    """Shut a door, as soon as nobody stands in the doorway."""


@register("intervention", "lock")
class Lock(OfDoor):
    """Lock a door: nobody opens it by hand once it is shut."""


@register("intervention", "unlock")
class Unlock(OfDoor):
    """Unlock a door."""


@register("intervention", "move")
class Move(OfHome):
    """Move a piece of furniture."""

    subject: ClassVar[str] = "object"
    object: str = Field(description="the piece of furniture")
    to: Point = Field(description="where its middle comes to stand, [x, y] in metres")
    turn_deg: float = Field(
        default=0.0, ge=-3600, le=3600, description="how far it is turned, counter-clockwise"
    )

    @property
    def what(self) -> HomeChange:
        """The change."""
        return HomeChange(move=self.object, to=self.to, turn_deg=self.turn_deg)


@register("intervention", "room")
class Room(OfHome):
    """Use a room for something else: behaviors that go to a bedroom find it there from then on."""

    subject: ClassVar[str] = "name"
    name: str = Field(description="the room")
    type: str = Field(description="what it is used for")

    @property
    def what(self) -> HomeChange:
        """The change."""
        return HomeChange(room=self.name, type=self.type)
