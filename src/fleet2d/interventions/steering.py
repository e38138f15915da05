"""The intervention that steers a robot by velocities, as a program or a joystick does."""

from datetime import timedelta

from fleet2d.configuration.units import PositiveDuration, SignedSpeed, SignedTurnRateDeg
from fleet2d.entities.decisions import DecidingActor
from fleet2d.entities.steering import AT_REST, Disc, Steering, Velocity
from fleet2d.interventions.intervention import World
from fleet2d.interventions.robots import RobotIntervention

# A command holds for this time: unless it is repeated, the robot stops.
KEPT = timedelta(seconds=0.5)


class Steer(RobotIntervention):
    """Move a robot at a velocity, within the limits of its drive.

    The robot stops at walls, at shut doors, and in front of bodies; its behaviors decide again when
    the time is over. A later command takes over at the speed that the robot has by then.

    Attributes:
        entity: The robot.
        forward: The speed ahead; negative: back.
        left: The speed to the left; 0 unless the drive is holonomic.
        turn_deg: The turn rate, counter-clockwise.
        duration: Time for which the command holds.

    Example:
        >>> Steer("astro", forward=0.2, turn_deg="30 deg/s").duration
        datetime.timedelta(microseconds=500000)
    """

    forward: SignedSpeed = 0.0
    left: SignedSpeed = 0.0
    turn_deg: SignedTurnRateDeg = 0.0
    duration: PositiveDuration = KEPT

    def begin(self, world: World) -> None:
        """Give the order."""
        actor = self.actor(world)
        last = actor.order
        time_us = world.step * world.clock.step_us
        progress = last.progress_at(time_us) if isinstance(last, Steering) else AT_REST
        wanted = Velocity(self.forward, self.left, self.turn_deg)
        order = Steering(wanted, self.duration, _bodies_near(actor, world), progress)
        actor.follow_order(order, world.step)


def _bodies_near(actor: DecidingActor, world: World) -> list[Disc]:
    """Return discs round the other bodies at home, in which the robot would touch them."""
    units = actor.home.lattice.units_per_m
    discs = []
    for other in (*world.users.values(), *world.robots.values()):
        if other is not actor and not other.state.away:
            reach_m = other.entity.radius + actor.entity.radius
            discs.append(Disc(*other.state.position, round(reach_m * units)))
    return discs
