"""Interventions on bodies as methods: put, send, hold, release, away, activity."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from datetime import timedelta
from typing import Any

from pydantic import ValidationError

from fleet2d.interventions import bodies, people
from fleet2d.interventions.intervention import Intervention, refused

Time = str | timedelta
"""A duration: '90 s', '1 h', or a timedelta."""


class BodyVerbs(ABC):
    """What may be done to a run from outside, at the present step.

    Each method does what the entry of the same name in a scenario's `script` does. What is done is
    kept in the manifest, and done again by `fleet2d.reproduce`.
    """

    @abstractmethod
    def intervene(self, act: Intervention | Mapping[str, Any]) -> None:
        """Do something at the present step.

        Args:
            act: An intervention, or one as a script has it: ``{"put": "ana", "to": "kitchen"}``.

        Raises:
            ScenarioError: It is none, or there is nothing of that name.
            PlacementError: There is no such place, or nobody gets there.
            InputError: The run is finished.
        """

    # Bodies

    def put(self, name: str, to: Any, heading_deg: float | None = None) -> None:
        """Put a body somewhere at the present step, as if it were carried; it decides anew there.

        Args:
            name: The person or robot.
            to: A room, furniture, a list of those to try in turn, or a point (x, y) [m].
            heading_deg: Where it faces, counter-clockwise from +x; None: as before.

        Raises:
            ScenarioError: There is nobody of that name.
            PlacementError: There is no such place, or its body doesn't fit there.

        Example:
            >>> import fleet2d
            >>> simulation = fleet2d.Simulation(None, "simulation.duration=1 d", seed=4)
            >>> simulation.put("ana", "kitchen")
            >>> simulation.advance()
            >>> simulation.state["ana"]["room"].startswith("kitchen")
            True
        """
        self._do(bodies.Put, entity=name, to=to, heading_deg=heading_deg)

    def send(
        self,
        name: str,
        to: Any,
        heading_deg: float | None = None,
        *,
        duration: Time | None = None,
    ) -> None:
        """Send a body somewhere on foot; there it stays.

        Args:
            name: The person or robot.
            to: A room, furniture, a list of those to try in turn, or a point (x, y) [m].
            heading_deg: Where it faces then, counter-clockwise from +x; None: as it came.
            duration: For how long it stays there; None: until it is released.

        Raises:
            ScenarioError: There is nobody of that name.
            PlacementError: There is no such place, or it can't get there.

        Example:
            >>> import fleet2d
            >>> simulation = fleet2d.Simulation(None, "simulation.duration=1 d", seed=4)
            >>> simulation.send("ana", to="kitchen", duration="1 h")
            >>> simulation.advance(600)
            >>> simulation.state["ana"]["room"]
            'kitchen_0'
        """
        self._do(bodies.Send, entity=name, to=to, heading_deg=heading_deg, duration=duration)

    def hold(self, name: str, *, duration: Time | None = None) -> None:
        """Let a body stand still where it is, for so long, or until it is released.

        Raises:
            ScenarioError: There is nobody of that name.
        """
        self._do(bodies.Hold, entity=name, duration=duration)

    def release(self, name: str) -> None:
        """Hand a body back to its own behaviors.

        Raises:
            ScenarioError: There is nobody of that name.
        """
        self._do(bodies.Release, entity=name)

    def replan(self, name: str) -> None:
        """Let a body's behaviors decide anew at the present step, whatever it is doing.

        Raises:
            ScenarioError: There is nobody of that name.
        """
        self._do(bodies.Replan, entity=name)

    # People

    def away(self, name: str, *, duration: Time | None = None) -> None:
        """Send a person out of the home, for so long, or until called home or released.

        Raises:
            ScenarioError: There is no such person.
        """
        self._do(people.Away, entity=name, duration=duration)

    def call_home(
        self, name: str, to: Any = ("living_room", "any"), *, duration: Time | None = None
    ) -> None:
        """Call a person home, who stays for so long, or until released.

        Raises:
            ScenarioError: There is no such person.
            PlacementError: There is no such place, or nobody gets there.
        """
        self._do(people.CallHome, entity=name, to=to, duration=duration)

    def guest(self, name: str, to: Any = ("living_room", "any"), *, duration: Time = "2 h") -> None:
        """Let a guest come, who stays for so long, and leaves: a user with the behavior `guest`.

        Raises:
            ScenarioError: There is no such person, or it is no guest.
            PlacementError: There is no such place, or nobody gets there.
        """
        self._do(people.LetIn, entity=name, to=to, duration=duration)

    def activity(
        self, name: str, what: str, to: Any = None, *, duration: Time | None = None
    ) -> None:
        """Let a person do something, for so long, or until released.

        Args:
            name: The person.
            what: Its name in the persona or agenda.
            to: Where; None: where the person does it by its own behavior.
            duration: For how long; None: until released.

        Raises:
            ScenarioError: There is no such person, or it has no place for that activity.
            PlacementError: There is no such place, or nobody gets there.
        """
        self._do(people.Activity, entity=name, what=what, to=to, duration=duration)

    def _do(self, verb: type[Intervention], **fields: Any) -> None:
        try:
            act = verb(**{key: value for key, value in fields.items() if value is not None})
        except ValidationError as error:
            raise refused(f"{verb.type_name}()", error) from None
        self.intervene(act)
