"""Interventions on people and robots as methods: put, send, hold, release, away, activity."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from datetime import timedelta
from typing import Any, cast

from pydantic import ValidationError

from fleet2d.configuration.components import lookup
from fleet2d.configuration.problems import refusal
from fleet2d.interventions.intervention import Intervention

Time = str | timedelta
"""A duration: '90 s', '1 h', or a timedelta."""


class BodyVerbs(ABC):
    """Interventions on a run, at the present step.

    Each method has the effect of the entry of the same name in a scenario's `script`. The manifest
    records it, and `fleet2d.reproduce` repeats it.
    """

    @abstractmethod
    def intervene(self, act: Intervention | Mapping[str, Any]) -> None:
        """Apply an intervention at the present step.

        Args:
            act: An intervention, or one as in a script: ``{"put": "ana", "to": "kitchen"}``.

        Raises:
            ScenarioError: It is not valid, or names something unknown.
            PlacementError: There is no such place, or it can't be reached.
            InputError: The run is finished.
        """

    # Bodies

    def put(self, name: str, to: Any, heading_deg: float | None = None) -> None:
        """Put a body at a place at the present step, as if it were carried; it decides anew there.

        Args:
            name: The person or robot.
            to: A room, furniture, a list of those to try in turn, or a point (x, y) [m].
            heading_deg: Its heading there, counter-clockwise from +x; None: as before.

        Raises:
            ScenarioError: There is no such person or robot.
            PlacementError: There is no such place, or its body doesn't fit there.

        Example:
            >>> import fleet2d
            >>> simulation = fleet2d.Simulation(None, "simulation.duration=1 d", seed=4)
            >>> simulation.put("ana", "kitchen")
            >>> simulation.advance()
            >>> simulation.state["ana"]["room"].startswith("kitchen")
            True
        """
        self._do("put", entity=name, to=to, heading_deg=heading_deg)

    def send(
        self, name: str, to: Any, heading_deg: float | None = None, *, duration: Time | None = None
    ) -> None:
        """Send a body to a place, where it stays.

        Args:
            name: The person or robot.
            to: A room, furniture, a list of those to try in turn, or a point (x, y) [m].
            heading_deg: Its heading there, counter-clockwise from +x; None: as it arrives.
            duration: For how long it stays there; None: until it is released.

        Raises:
            ScenarioError: There is no such person or robot.
            PlacementError: There is no such place, or it can't be reached.

        Example:
            >>> import fleet2d
            >>> simulation = fleet2d.Simulation(None, "simulation.duration=1 d", seed=4)
            >>> simulation.send("ana", to="kitchen", duration="1 h")
            >>> simulation.advance(600)
            >>> simulation.state["ana"]["room"]
            'kitchen_0'
        """
        self._do("send", entity=name, to=to, heading_deg=heading_deg, duration=duration)

    def hold(self, name: str, *, duration: Time | None = None) -> None:
        """Let a body stand still where it is, for a duration or until it is released.

        Raises:
            ScenarioError: There is no such person or robot.
        """
        self._do("hold", entity=name, duration=duration)

    def release(self, name: str) -> None:
        """Return a body to the control of its own behaviors.

        Raises:
            ScenarioError: There is no such person or robot.
        """
        self._do("release", entity=name)

    def replan(self, name: str) -> None:
        """Let a body's behaviors decide anew at the present step, whatever it is doing.

        Raises:
            ScenarioError: There is no such person or robot.
        """
        self._do("replan", entity=name)

    # People

    def away(self, name: str, *, duration: Time | None = None) -> None:
        """Send a person out of the home, for a duration or until called home or released.

        Raises:
            ScenarioError: There is no such person.
        """
        self._do("away", entity=name, duration=duration)

    def call_home(
        self, name: str, to: Any = ("living_room", "any"), *, duration: Time | None = None
    ) -> None:
        """Call a person home, who stays for a duration or until released.

        Raises:
            ScenarioError: There is no such person.
            PlacementError: There is no such place, or it can't be reached.
        """
        self._do("call_home", entity=name, to=to, duration=duration)

    def guest(self, name: str, to: Any = ("living_room", "any"), *, duration: Time = "2 h") -> None:
        """Let a guest, a user with the behavior `guest`, come, stay for a duration, and leave.

        Raises:
            ScenarioError: There is no such person, or the person is not a guest.
            PlacementError: There is no such place, or it can't be reached.
        """
        self._do("guest", entity=name, to=to, duration=duration)

    def activity(
        self, name: str, what: str, to: Any = None, *, duration: Time | None = None
    ) -> None:
        """Let a person do an activity, for a duration or until released.

        Args:
            name: The person.
            what: The name of the activity in the persona or agenda.
            to: The place; None: where the person's own behavior does it.
            duration: For how long; None: until released.

        Raises:
            ScenarioError: There is no such person, or no place for that activity.
            PlacementError: There is no such place, or it can't be reached.
        """
        self._do("activity", entity=name, what=what, to=to, duration=duration)

    def _do(self, verb: str, **fields: Any) -> None:
        """Apply an intervention; its module is imported when it is first used."""
        intervention = cast(type[Intervention], lookup("intervention", verb))
        try:
            act = intervention(**{key: value for key, value in fields.items() if value is not None})
        except ValidationError as error:
            raise refusal(f"{verb}()", error) from None
        self.intervene(act)
