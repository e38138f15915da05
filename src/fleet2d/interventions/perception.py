"""Interventions on what a robot perceives: suppress, mistake, inject."""

from fleet2d.configuration.components import register
from fleet2d.configuration.units import AngleDeg
from fleet2d.errors import PlacementError
from fleet2d.interventions.bodies import heading_of
from fleet2d.interventions.intervention import Lasting, robot, user
from fleet2d.interventions.robots import check_camera, check_truth, disturb
from fleet2d.interventions.world import World
from fleet2d.sight.camera import Disturbance, FalseSighting

UNKNOWN = "unknown"


class PerceptionIntervention(Lasting):
    """Base of interventions on perception; they don't change the random draws of cameras.

    Attributes:
        entity: The robot.
        camera: The camera, by name where it has several; left out: all.
    """

    entity: str
    camera: str | None = None

    @property
    def disturbance(self) -> Disturbance:
        """The effect on cameras."""
        raise NotImplementedError

    def check(self, world: World) -> None:
        """Refuse an unknown robot or camera."""
        check_camera(robot(world, self.entity), self.camera)

    def begin(self, world: World) -> None:
        """Apply all active disturbances of its cameras."""
        disturb(world, self.entity)

    def end(self, world: World) -> None:
        """Apply the active disturbances of its cameras, without this one."""
        disturb(world, self.entity)


@register("intervention", "suppress")
class Suppress(PerceptionIntervention):
    """Let a robot miss a person who is in view.

    Attributes:
        user: The person.
    """

    user: str

    @property
    def disturbance(self) -> Disturbance:
        """The effect on cameras."""
        return Disturbance(self.camera, missed=self.user)

    def check(self, world: World) -> None:
        """Refuse an unknown person."""
        super().check(world)
        user(world, self.user)


@register("intervention", "mistake")
class Mistake(PerceptionIntervention):
    """Let a robot mistake a person whom it notices for another one.

    Attributes:
        user: The person.
        taken_for: The other person, or 'unknown'.
    """

    user: str
    taken_for: str

    @property
    def disturbance(self) -> Disturbance:
        """The effect on cameras."""
        other = "" if self.taken_for == UNKNOWN else self.taken_for
        return Disturbance(self.camera, mistaken=(self.user, other))

    def check(self, world: World) -> None:
        """Refuse unknown people."""
        super().check(world)
        user(world, self.user)
        if self.taken_for == UNKNOWN:
            check_truth(world, self.entity)
        else:
            user(world, self.taken_for)


@register("intervention", "inject")
class Inject(PerceptionIntervention):
    """Let a robot perceive a person who isn't there, in every look, wherever it looks.

    In the table of observations it is a false positive: it has no true user.

    Attributes:
        user: The person that it perceives, or 'unknown'.
        spot: The apparent place, [x, y] in metres.
        heading_deg: The apparent heading, counter-clockwise from +x.
    """

    user: str
    spot: tuple[float, float]
    heading_deg: AngleDeg = 0.0

    @property
    def disturbance(self) -> Disturbance:
        """The effect on cameras."""
        name = "" if self.user == UNKNOWN else self.user
        heading = heading_of(self.heading_deg) or 0
        return Disturbance(self.camera, injected=FalseSighting(name, *self.spot, heading))

    def check(self, world: World) -> None:
        """Refuse an unknown person, and a place outside the home."""
        super().check(world)
        if self.user == UNKNOWN:
            check_truth(world, self.entity)
        else:
            user(world, self.user)
        if world.home.plan.room_at(*self.spot) is None:
            x, y = self.spot
            raise PlacementError(f"({x:g}, {y:g}) m is outside the home")
