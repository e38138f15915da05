"""Interventions on people and robots: their positions, destinations and activities."""

from datetime import timedelta
from typing import Annotated, Any

from pydantic import AfterValidator, Field, TypeAdapter

from fleet2d.configuration.components import OneOf
from fleet2d.configuration.problems import check_known, suggest, validating
from fleet2d.configuration.units import AngleDeg, PositiveDuration
from fleet2d.entities.behavior import Actor, Behavior
from fleet2d.entities.body import Pose
from fleet2d.entities.decisions import DecidingActor, DoActivity, GoOut, GoTo, StandStill
from fleet2d.entities.place import Place, Point, RoomChoice, furniture_of, is_point, matching_rooms
from fleet2d.entities.plan import check_data, plan_of
from fleet2d.entities.users.scripted import Guest
from fleet2d.errors import PlacementError, ScenarioError
from fleet2d.floorplan.placed_objects import Posture
from fleet2d.interventions.intervention import Intervention, World, body, user
from fleet2d.kernels import TURN

_BEHAVIOR: TypeAdapter[Behavior] = TypeAdapter(OneOf[Behavior])


class BodyIntervention(Intervention):
    """Base of interventions on a body.

    Attributes:
        entity: The person or robot.
    """

    entity: str

    def actor(self, world: World) -> DecidingActor:
        """Return the body in the run.

        Raises:
            ScenarioError: There is no such body.
        """
        return body(world, self.entity)

    def check(self, world: World) -> None:
        """Refuse an unknown body."""
        self.actor(world)

    def check_reach(self, world: World, place: RoomChoice | Point) -> None:
        """Refuse a place that doesn't exist, or that the body can never reach.

        While doors are shut only the name of the place is checked: they may open later.

        Raises:
            PlacementError: There is no such place, and the message lists the others, or no way to
                it.
        """
        actor = self.actor(world)
        home = actor.home
        if is_point(place):
            x, y = home.lattice.to_lattice(place).tolist()
            if not home.may_block_routes or actor.space.part_at(x, y) < 0:
                actor.point(place)  # type: ignore[arg-type]
        elif home.may_block_routes:
            names = {name for item in home.objects if item.uses for name in (item.name, item.type)}
            if not names & set(place):
                matching_rooms(place, home.rooms, home.rooms, home.objects)  # type: ignore[arg-type]
        elif furniture_of(actor, place) is None:
            actor.rooms(place)  # type: ignore[arg-type]


class Put(BodyIntervention):
    """Put a body at a place at once, as if it were carried, where it replans.

    A robot is not told that it was moved; it can notice only by its position. In a room the point
    is drawn at random; at furniture it is the point from which the furniture is used.

    Attributes:
        to: The place: a room, furniture, or a point.
        heading_deg: Its heading, counter-clockwise from +x; left out: as before.

    Example:
        >>> Put("ana", "kitchen", heading_deg=90).to
        ('kitchen',)
    """

    to: Place
    heading_deg: AngleDeg | None = None

    def check(self, world: World) -> None:
        """Refuse a place where the body doesn't fit."""
        self._place(self.actor(world), world)

    def begin(self, world: World) -> None:
        """Put it there.

        Raises:
            PlacementError: A shut door or moved furniture leaves no room for the body there.
        """
        actor = self.actor(world)
        x, y = self._place(actor, world)
        if actor.whole_space.part_at(x, y) < 0:
            x_m, y_m = actor.home.lattice.to_metres((x, y)).round(2).tolist()
            raise PlacementError(
                f"{actor.path}: there is no room for its body at ({x_m:g}, {y_m:g}) m"
            )
        heading = heading_of(self.heading_deg)
        world.move(actor, Pose(x, y, actor.state.heading if heading is None else heading, 0))

    def _place(self, actor: Actor, world: World) -> tuple[int, int]:
        item = None if is_point(self.to) else furniture_of(actor, self.to)
        if item is not None:
            return actor.place_at(item, 0).approach
        return actor.find_anywhere(self.to, world.step * world.clock.step_us)


class Send(BodyIntervention):
    """Send a body to a place, where it stays until it is released.

    A person sits or lies on furniture as is usual there, and comes home if away. While shut doors
    block the way, the body waits and tries again.

    Attributes:
        to: The destination: a room, furniture, or a point.
        heading_deg: Its heading there, counter-clockwise from +x; left out: ahead.
        duration: Time for which it stays there; left out: until it is released.

    Example:
        >>> Send("astro", "sofa", duration="20 min").duration
        datetime.timedelta(seconds=1200)
    """

    to: Place
    heading_deg: AngleDeg | None = None
    duration: PositiveDuration | None = None

    def check(self, world: World) -> None:
        """Refuse a place that doesn't exist or can't be reached."""
        self.check_reach(world, self.to)

    def begin(self, world: World) -> None:
        """Give the order."""
        order = GoTo(self.to, heading_of(self.heading_deg), duration=self.duration)
        self.actor(world).follow_order(order, world.step)


class HoldStill(BodyIntervention):
    """Let a body stay still where it is, until it is released.

    Attributes:
        duration: Time for which it stays still; left out: until it is released.
        posture: The posture of a person, such as lie after a fall; left out: as before.

    Example:
        >>> HoldStill("ana", posture="lie").posture
        'lie'
    """

    duration: PositiveDuration | None = None
    posture: Posture | None = None

    def check(self, world: World) -> None:
        """Refuse an unknown body, and a robot that sits or lies."""
        self.actor(world)
        if self.posture is not None:
            user(world, self.entity)

    def begin(self, world: World) -> None:
        """Give the order."""
        self.actor(world).follow_order(StandStill(self.duration, self.posture), world.step)


class Release(BodyIntervention):
    """Return a body to the control of its own behaviors.

    Example:
        >>> Release("ana").entity
        'ana'
    """

    def begin(self, world: World) -> None:
        """Cancel the order of the body."""
        self.actor(world).follow_order(None, world.step)


class Replan(BodyIntervention):
    """Make a body replan, whatever it is doing.

    Example:
        >>> Replan("astro").entity
        'astro'
    """

    def begin(self, world: World) -> None:
        """Let the behaviors of the body decide at the present step."""
        self.actor(world).decide_again(world.step)


class Configure(BodyIntervention):
    """Change keys of a body's behavior, which starts anew with them; the body replans.

    All other state of the behavior is lost.

    Attributes:
        behavior: The behavior, by its type.
        keys: The keys that change, with their values, as in the scenario. With `type` another
            behavior takes its place, with these keys alone.

    Example:
        >>> Configure("astro", "hangout", {"tau": "10 min"}).keys
        {'tau': '10 min'}
    """

    behavior: str
    keys: dict[str, Any] = Field(min_length=1)

    def check(self, world: World) -> None:
        """Refuse an unknown behavior or key, and a value with which the behavior can't start."""
        actor = self.actor(world)
        behavior = self._behavior(actor)
        behavior.start(actor)
        for name in behavior.reads():
            check_known(name, "algorithm", world.algorithms)

    def begin(self, world: World) -> None:
        """Replace the behavior."""
        actor = self.actor(world)
        actor.replace(behavior_number(actor, self.behavior), self._behavior(actor))
        actor.decide_again(world.step)

    def _behavior(self, actor: Actor) -> Behavior:
        """Return the behavior with the changed keys, not started."""
        behavior = actor.behaviors[behavior_number(actor, self.behavior)]
        present = behavior.model_dump(mode="json", exclude_defaults=True)
        with validating(f"behavior {self.behavior} of {self.entity}"):
            if "type" in self.keys:
                return _BEHAVIOR.validate_python(self.keys)
            return type(behavior).model_validate({**present, **self.keys})


class TakeControl(BodyIntervention):
    """Control a body externally for the rest of the run, by plans instead of its behaviors.

    Example:
        >>> TakeControl("astro").entity
        'astro'
    """

    def begin(self, world: World) -> None:
        """Let the body follow given plans; without a plan it stays where it is."""
        world.drive(self.actor(world))


class Decide(BodyIntervention):
    """Give a plan to an externally controlled body.

    Attributes:
        plan: The plan, as `data_of` returns it.

    Example:
        >>> import fleet2d
        >>> from fleet2d.entities.plan import data_of
        >>> simulation = fleet2d.Simulation("bundled:paper", "simulation.duration=1 h", seed=4)
        >>> plan = simulation.plan("astro").go_to("kitchen")
        >>> Decide("astro", data_of(plan)).entity
        'astro'
    """

    plan: Annotated[dict[str, Any], AfterValidator(check_data)]

    def check(self, world: World) -> None:
        """Refuse a plan that the body can't follow."""
        plan_of(self.actor(world), world.step, self.plan)

    def begin(self, world: World) -> None:
        """Let the body follow the plan from the present step on, and from where it begins.

        The body may have been put elsewhere at the same step, after the plan was made.

        Raises:
            ScenarioError: The body isn't driven, so its behaviors would decide at once.
        """
        actor = self.actor(world)
        if actor.behaviors:
            raise ScenarioError(
                f"{self.entity} isn't driven, it decides itself: drive it before its first plan"
            )
        rows = self.plan["rows"]
        plan = plan_of(actor, world.step, self.plan)
        if rows and rows[0][0] == world.step * world.clock.step_us:
            _, x, y, heading, away = rows[0]
            begin = Pose(x, y, heading % TURN, away)
            if begin != actor.state:
                world.move(actor, begin)
                plan = plan_of(actor, world.step, self.plan)
        actor.choose(plan)
        actor.decide_again(world.step)


def behavior_number(actor: Actor, name: str) -> int:
    """Return the number of a behavior of a body by its type.

    Raises:
        ScenarioError: The body has no such behavior.
    """
    names = [behavior.type_name for behavior in actor.behaviors]
    if name not in names:
        raise ScenarioError(
            f"{actor.name} has no behavior {name!r}{suggest(name, names, 'It has')}"
        )
    return names.index(name)


def heading_of(heading_deg: float | None) -> int | None:
    """Return an angle [degrees] as a heading of the kernels; None for None."""
    return None if heading_deg is None else round(heading_deg / 360 * TURN) % TURN


class PersonIntervention(BodyIntervention):
    """Base of interventions on a person.

    Attributes:
        entity: The person.
    """

    def actor(self, world: World) -> DecidingActor:
        """Return the person in the run."""
        return user(world, self.entity)


class Away(PersonIntervention):
    """Send a person to the exit, and away until called home.

    Attributes:
        duration: Time for which the person is away; left out: until called home or released.

    Example:
        >>> Away("ana", duration="2 h").duration
        datetime.timedelta(seconds=7200)
    """

    duration: PositiveDuration | None = None

    def begin(self, world: World) -> None:
        """Give the order."""
        self.actor(world).follow_order(GoOut(duration=self.duration), world.step)


class CallHome(PersonIntervention):
    """Call a person home, who comes in at the exit and stays until released.

    Attributes:
        to: The destination: a room, furniture, or a point.
        duration: Time for which the person stays there; left out: until released.

    Example:
        >>> CallHome("ana", to="kitchen").to
        ('kitchen',)
    """

    to: Place = ("living_room", "any")
    duration: PositiveDuration | None = None

    def check(self, world: World) -> None:
        """Refuse a place that doesn't exist or can't be reached."""
        self.check_reach(world, self.to)

    def begin(self, world: World) -> None:
        """Give the order."""
        self.actor(world).follow_order(GoTo(self.to, duration=self.duration), world.step)


class LetIn(CallHome):
    """Let a guest, a user with the behavior `guest`, come, stay for a while, and leave.

    Attributes:
        to: The destination: a room, furniture, or a point.
        duration: Time for which the guest stays there.

    Example:
        >>> LetIn("gina").duration
        datetime.timedelta(seconds=7200)
    """

    duration: PositiveDuration = timedelta(hours=2)

    def check(self, world: World) -> None:
        """Refuse a user who is not a guest, and an unknown place."""
        actor = self.actor(world)
        if not any(isinstance(behavior, Guest) for behavior in actor.behaviors):
            raise ScenarioError(
                f"{self.entity} is not a guest: a guest is a user with that behavior, like users:"
                " {gina: guest}; use call_home for people who live here"
            )
        super().check(world)


class StartActivity(PersonIntervention):
    """Let a person do an activity at its place, sitting or lying as is usual.

    Attributes:
        what: The name of the activity in the persona or agenda.
        to: The place; left out: where the person's own behavior does it.
        duration: Time for which the person does it; left out: until released.

    Example:
        >>> StartActivity("ana", "dinner").what
        'dinner'
    """

    what: str = Field(min_length=1)
    to: Place | None = None
    duration: PositiveDuration | None = None

    def check(self, world: World) -> None:
        """Refuse an activity for which the person has no place."""
        actor = self.actor(world)
        if self.to is not None:
            self.check_reach(world, self.to)
            return
        names = [name for behavior in actor.behaviors for name in behavior.activities()]
        if self.what not in names:
            raise ScenarioError(
                f"{self.entity} has no activity {self.what!r}{suggest(self.what, names)};"
                " or say where it is done, as to: kitchen"
            )

    def begin(self, world: World) -> None:
        """Give the order."""
        self.actor(world).follow_order(
            DoActivity(self.what, self.to, duration=self.duration), world.step
        )
