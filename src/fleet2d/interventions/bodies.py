"""What is done to bodies, people and robots alike: put, send, hold, release, drive."""

from typing import Any

from pydantic import Field

from fleet2d.component import register
from fleet2d.entities import orders
from fleet2d.entities.actor import Actor
from fleet2d.entities.furniture import furniture_of
from fleet2d.entities.motion import Pose
from fleet2d.entities.place import Place, Point, RoomChoice, is_point, matching_rooms
from fleet2d.entities.plan import Plan
from fleet2d.errors import PlacementError
from fleet2d.interventions.intervention import Intervention, body
from fleet2d.interventions.world import World
from fleet2d.kernels.headings import TURN
from fleet2d.units import AngleDeg, PositiveDuration


class OfBody(Intervention):
    """Base of what is done to a body."""

    entity: str = Field(description="the person or robot")

    def check(self, world: World) -> None:
        """Refuse a body that there isn't."""
        body(world, self.entity)


@register("intervention", "put")
class Put(OfBody):
    """Put a body somewhere at once, as if it were carried; it decides anew there.

    A robot that is put elsewhere is kidnapped: nothing tells it so but where it finds itself. In a
    room the place is drawn; at furniture it is where one steps up to it.
    """

    to: Place = Field(description="where: a room, furniture, or a point")
    heading_deg: AngleDeg | None = Field(
        default=None, description="where it faces, counter-clockwise from +x; left out: as before"
    )

    def check(self, world: World) -> None:
        """Refuse a place where its body can't be."""
        self._place(body(world, self.entity), world)

    def begin(self, world: World) -> None:
        """Put it there.

        Raises:
            PlacementError: A shut door, or furniture that was moved, leaves no room for it there.
        """
        actor = body(world, self.entity)
        x, y = self._place(actor, world)
        part = actor.space.part_at(x, y)
        if part < 0:
            at = actor.home.plan.lattice.to_metres((x, y)).round(2).tolist()
            raise PlacementError(
                f"{actor.path}: there is no room for its body at ({at[0]:g}, {at[1]:g}) m"
            )
        heading = heading_of(self.heading_deg)
        world.move(actor, Pose(x, y, actor.state.heading if heading is None else heading, 0), part)

    def _place(self, actor: Actor, world: World) -> tuple[int, int]:
        thing = None if is_point(self.to) else furniture_of(actor, self.to)
        if thing is not None:
            return actor.place_at(thing, 0).approach
        return actor.find_anywhere(self.to, world.step * world.clock.step_us, "put")


@register("intervention", "send")
class Send(OfBody):
    """Send a body somewhere on foot: there it stays until it is released.

    A person sits or lies on furniture as one does; who was away comes home for it. Where shut doors
    are in the way, it waits and tries again.
    """

    to: Place = Field(description="where to: a room, furniture, or a point")
    heading_deg: AngleDeg | None = Field(
        default=None, description="where it faces then, counter-clockwise from +x; left out: ahead"
    )
    duration: PositiveDuration | None = Field(
        default=None, description="for how long it stays there; left out: until it is released"
    )

    def check(self, world: World) -> None:
        """Refuse a place that there isn't, or that it can't get to."""
        check_reach(body(world, self.entity), self.to)

    def begin(self, world: World) -> None:
        """Set out."""
        order = orders.GoTo(self.to, heading_of(self.heading_deg), self.duration)
        body(world, self.entity).obey(order, world.step)


@register("intervention", "hold")
class Hold(OfBody):
    """Let a body stand still where it is, until it is released."""

    duration: PositiveDuration | None = Field(
        default=None, description="for how long; left out: until it is released"
    )

    def begin(self, world: World) -> None:
        """Stop."""
        body(world, self.entity).obey(orders.Hold(self.duration), world.step)


@register("intervention", "release")
class Release(OfBody):
    """Hand a body back to its own behaviors."""

    def begin(self, world: World) -> None:
        """Let them decide anew."""
        body(world, self.entity).obey(None, world.step)


@register("intervention", "replan")
class Replan(OfBody):
    """Let a body decide anew, whatever it is doing."""

    def begin(self, world: World) -> None:
        """Ask its behaviors at the present step."""
        body(world, self.entity).decide_anew(world.step)


@register("intervention", "drive")
class Drive(OfBody):
    """Take the decisions of a body out of the hands of its behaviors, for good."""

    def begin(self, world: World) -> None:
        """From now on it follows plans from outside, and stays where it is without one."""
        world.drive(body(world, self.entity))


@register("intervention", "decide")
class Decide(OfBody):
    """Give a body that is driven from outside a plan."""

    plan: dict[str, Any] = Field(description="the plan, as Plan.data() writes it")

    def begin(self, world: World) -> None:
        """Let the body follow the plan from the present step on."""
        actor = body(world, self.entity)
        actor.choose(Plan.of(actor, world.step, self.plan))
        actor.decide_anew(world.step)


def heading_of(heading_deg: float | None) -> int | None:
    """Return a heading [1/4096 turn] of an angle; None for none."""
    return None if heading_deg is None else round(heading_deg / 360 * TURN) % TURN


def check_reach(actor: Actor, place: RoomChoice | Point) -> None:
    """Refuse a place that there isn't, or that a body never gets to.

    While doors are shut it is only asked for by name: they may be open by then.

    Raises:
        PlacementError: Says what there is.
    """
    home = actor.home
    if is_point(place):
        x, y = home.plan.lattice.to_lattice(place).tolist()
        if not home.hinders or actor.space.part_at(x, y) < 0:
            actor.point(place)  # type: ignore[arg-type]
    elif home.hinders:
        things = {name for thing in home.objects if thing.uses for name in (thing.name, thing.type)}
        if not things & set(place):
            matching_rooms(place, home.rooms, home.rooms, home.objects)  # type: ignore[arg-type]
    elif furniture_of(actor, place) is None:
        actor.rooms(place)  # type: ignore[arg-type]
