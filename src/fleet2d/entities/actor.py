"""Actors: bodies with behaviors, as behaviors and plans see them."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from fleet2d.blame import blame
from fleet2d.entities.battery import Charge
from fleet2d.entities.behavior import Attention, Behavior, Command
from fleet2d.entities.body import NEVER, Body
from fleet2d.entities.kinds import is_kind
from fleet2d.entities.motion import Motion, Pose
from fleet2d.entities.place import ANY, Point, is_point
from fleet2d.entities.plan import Plan
from fleet2d.floorplan.objects import PlacedObject
from fleet2d.kernels.numbers import TURN
from fleet2d.streams import Draws


@dataclass(eq=False)
class Actor(Body):
    """A body with behaviors, and the plan that it follows.

    Attributes:
        behaviors: Its own copies of the behaviors of its configuration, the first one first.
        charge: The charge of its battery; None without a battery.
        command: What it was called to do, until a behavior takes it up.
        in_view: Returns the people that its cameras have in view, and the last place of each [m].
        plan: The plan that it follows.
        motion: The motion of that plan.
        planned_at: The step at which it began the plan.
    """

    behaviors: list[Behavior] = field(init=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        self.in_view: Callable[[], Mapping[str, Point]] = dict  # set if it has cameras
        behaviors = getattr(self.entity, "behaviors", ())
        self.behaviors = [behavior.model_copy(deep=True) for behavior in behaviors]
        with blame(self.path, None):
            self._state = self._first_pose()
            battery = getattr(self.entity, "battery", None)
            self.charge = None if battery is None else Charge(battery, self)
            for behavior in self.behaviors:
                behavior.start(self)
            claims = ((behavior, behavior.attention(self)) for behavior in self.behaviors)
            self._attentive = next((pair for pair in claims if pair[1] is not None), None)
        self.command: Command | None = None
        self.plan: Plan = Plan(self, 0).stay()
        self.motion: Motion = self.plan.finish()
        self.planned_at = 0

    def ask(self, step: int | None) -> None:
        """Set the step at which it decides next; None: never."""
        if self._bodies is not None:
            self._bodies.ask_at[self.row] = NEVER if step is None else step

    @property
    def attention(self) -> Attention | None:
        """Which actions of robots interrupt its plans: those of the first attentive behavior."""
        return self._attentive[1] if self._attentive else None

    @property
    def event_kinds(self) -> frozenset[str]:
        """The kinds of events that its behaviors declare in `records`."""
        return frozenset().union(*(behavior.records for behavior in self.behaviors))

    def own_furniture(self, kind: str) -> PlacedObject | None:
        """Return the piece of furniture of a kind that is its own, if its behaviors say so."""
        names = (behavior.furniture(self, kind) for behavior in self.behaviors)
        return next((self.home.object(name) for name in names if name is not None), None)

    def posture_code(self, time_us: int) -> int:
        """Return the posture at a moment, by its number in POSTURES."""
        plan: Plan | None = getattr(self, "plan", None)  # none yet while the first one is made
        if plan is None or not (plan.postures or plan.posture != "stand"):
            return 0
        return plan.posture_at(time_us)

    def _first_pose(self) -> Pose:
        """Return the pose at step 0."""
        place = self.entity.start
        if place is None:
            begins = (behavior.begins_at(self.clock.start) for behavior in self.behaviors)
            place = next((begin for begin in begins if begin is not None), (ANY,))
            if place and is_kind(self, place) and not self._has_any(place):
                place = (ANY,)
        away = int(len(place) == 0)
        if away:
            x, y = self.way_out
        elif is_point(place):
            x, y = self.home.plan.lattice.point_at(place)  # type: ignore[arg-type]
            self.part = max(self.space.part_at(x, y), 0)
            x, y = self.point(place)  # type: ignore[arg-type]
        else:
            self.part = self._start_part(place)  # type: ignore[arg-type]
            x, y = self.find(place, 0, "start")
        heading = self.entity.start_heading_deg
        if heading is None:
            return Pose(x, y, Draws(self.stream("start heading"), 0).below(TURN), away)
        return Pose(x, y, round(heading / 360 * TURN) % TURN, away)
