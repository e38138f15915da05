"""People moved from outside: guests of a script, people without a known place, programs."""

from collections.abc import Mapping
from datetime import datetime, timedelta
from typing import Any, NamedTuple

from pydantic import Field

from fleet2d.configuration.trust import check_may_run
from fleet2d.configuration.units import InputPath, PeerAddress, PositiveDuration
from fleet2d.entities.behavior import Actor, Behavior, Situation
from fleet2d.entities.body import Pose
from fleet2d.entities.plan import Plan
from fleet2d.errors import ComponentError, Fleet2DError, NoWayError, PlacementError
from fleet2d.floorplan.lattice import LatticePoint
from fleet2d.runtime.events import EventKind
from fleet2d.runtime.program import ExternalProgram

MAX_ITEMS = 1000
"""The number of items of a plan."""


class Guest(Behavior):
    """Stay out of the home; leave it through the exit if inside.

    An intervention `guest` lets the person come.
    """

    def begins_at(self, time: datetime) -> tuple[()]:
        """Return (): the person is away at first."""
        return ()

    def decide(self, now: Situation) -> Plan:
        """Leave, and stay away."""
        return now.plan().leave_home().stay()


class Unknown(Behavior):
    """Be somewhere that nobody recorded, while a real robot's detections are replayed.

    In the simulation the person is away all the time and never seen; metrics leave out results that
    need the person's place. Event: `unknown`.
    """

    records = frozenset({EventKind.UNKNOWN})

    def decide(self, now: Situation) -> Plan:
        """Be away, without having walked out."""
        return (
            now.plan()
            .jump(now.step * now.actor.clock.step_us, away=1)
            .note(EventKind.UNKNOWN)
            .stay()
        )


class Live(Behavior):
    """Take the poses of a real person or robot, or goals from a program: see `fleet2d live`.

    Messages become interventions: `put` for a pose, `send` for a goal. Without any, the body
    stands.

    Attributes:
        source: The other program whose messages it takes, such as ws://127.0.0.1:8765, which
            `fleet2d live` opens; left out: any of `--with`.
    """

    is_recorded = True

    source: PeerAddress | None = None

    def decide(self, now: Situation) -> Plan:
        """Stand."""
        return now.plan().stay()


class _SentGoal(NamedTuple):
    """The goal to which a program sent a body: its text, the point, or the reason for no way."""

    to: Any
    point: LatticePoint | None
    reason: str

    def outcome(self, body: Pose) -> dict[str, Any]:
        """Return the outcome, once the body has to decide again."""
        if self.point == (body.x, body.y):
            return {"go_to": self.to, "state": "reached", "detail": ""}
        if self.point is None:
            return {"go_to": self.to, "state": "impossible", "detail": self.reason}
        detail = "another behavior, an order or an obstacle ended the way"
        return {"go_to": self.to, "state": "cancelled", "detail": detail}


class ProcessBehavior(Behavior):
    """A behavior in another process, of any language.

    Whenever the body has to decide, the program is told its pose and the outcome of its last goal,
    and answers with a plan, a list of `{go_to: PLACE}`, `{turn_deg: 90}` and `{stay_s: 60}`; or
    with the type `none`: then the next behavior decides. Where no way leads, as a door is shut, the
    body waits before the program is asked again. See `fleet2d.runtime.program` for the messages.

    Attributes:
        command: The program; a file .py is run by Python, .js and .mjs by Node.
        arguments: The arguments of the program.
        settings: The program's own settings, sent in the first message.
        timeout: The longest time to wait for an answer; then the run fails.
    """

    command: InputPath
    arguments: tuple[str, ...] = ()
    settings: dict[str, Any] = Field(default={})
    timeout: PositiveDuration = timedelta(seconds=10)

    def start(self, actor: Actor) -> None:
        """Check that the program may run; it starts at the first decision."""
        check_may_run("process", [self.command])
        about = {
            "name": actor.name,
            "start": actor.clock.start.isoformat(),
            "step_s": actor.clock.step_us / 1e6,
            "rooms": [{"name": room.name, "type": room.type} for room in actor.home.rooms],
            "settings": self.settings,
        }
        self.program = ExternalProgram(
            self.command, self.arguments, self.timeout.total_seconds(), about
        )
        self._goal: _SentGoal | None = None

    def decide(self, now: Situation) -> Plan | None:
        """Ask the program."""
        goal = None if self._goal is None else self._goal.outcome(now.actor.state)
        x, y = now.xy
        room = now.home.plan.room_at(x, y)
        shares = {
            name: output.share.tolist()
            for name, output in now.outputs.items()
            if hasattr(getattr(output, "share", None), "tolist")
        }
        message = {
            "type": "decide",
            "step": now.step,
            "time": now.time.isoformat(),
            "x": x,
            "y": y,
            "room": room.name if room else None,
            "away": bool(now.actor.state.away),
            "outputs": shares,
            "goal": goal,
        }
        content = self.program.ask(message).content
        if content.get("type") == "none":
            return None
        items = content.get("plan")
        if not isinstance(items, list) or not 0 < len(items) <= MAX_ITEMS:
            raise ComponentError(
                f"{self.command} answered {content!r:.200}: expected 'plan', a list of 1 to"
                f" {MAX_ITEMS} items, or the type 'none'"
            )
        plan = now.plan()
        self._goal = None
        for item in items:
            self._add(plan, item)
        return plan

    def _send(self, plan: Plan, place: Any) -> None:
        """Let a plan go to a place, and keep the goal for the next message."""
        try:
            plan.go_to(place)
        except (PlacementError, NoWayError) as error:
            self._goal = _SentGoal(place, None, str(error))
            raise
        self._goal = _SentGoal(place, plan.position, "")

    def _add(self, plan: Plan, item: Mapping[str, Any]) -> None:
        """Add an item of an answer to a plan."""
        try:
            ((verb, value),) = item.items()
            if verb == "go_to":
                self._send(plan, value)
            elif verb == "turn_deg":
                plan.turn_by(float(value) / 360)
            elif verb == "stay_s":
                plan.stay(timedelta(seconds=float(value)))
            else:
                raise ValueError(f"there is no {verb!r}")
        except Fleet2DError:
            raise
        except (ValueError, TypeError, AttributeError, OverflowError) as error:
            raise ComponentError(
                f"{self.command} answered the item {item!r:.100}: expected {{go_to: PLACE}},"
                f" {{turn_deg: 90}} or {{stay_s: 60}} ({error})"
            ) from None
