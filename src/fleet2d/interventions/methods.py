"""Interventions as methods of a simulation, and of a trial of one."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from datetime import timedelta
from typing import Any, Literal, cast

from fleet2d.configuration.components import lookup
from fleet2d.configuration.problems import validating
from fleet2d.entities.sensor import SensorFault
from fleet2d.floorplan.home import HomeChange
from fleet2d.floorplan.placed_objects import Posture
from fleet2d.interventions.intervention import Intervention

Time = str | timedelta
"""A duration: '90 s', '1 h', or a timedelta."""


class InterventionMethods(ABC):
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

    # People and robots

    def put(self, name: str, to: Any, heading_deg: float | None = None) -> None:
        """Put a body at a place at the present step, as if it were carried; it replans there.

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

    def hold(
        self, name: str, *, duration: Time | None = None, posture: Posture | None = None
    ) -> None:
        """Let a body stay still where it is, for a duration or until it is released.

        Args:
            name: The person or robot.
            duration: For how long; None: until released.
            posture: How a person is there, such as "lie" after a fall; None: as before.

        Raises:
            ScenarioError: There is no such person or robot.
        """
        self._do("hold", entity=name, duration=duration, posture=posture)

    def release(self, name: str) -> None:
        """Return a body to the control of its own behaviors.

        Raises:
            ScenarioError: There is no such person or robot.
        """
        self._do("release", entity=name)

    def replan(self, name: str) -> None:
        """Make a body's behaviors replan at the present step, whatever it is doing.

        Raises:
            ScenarioError: There is no such person or robot.
        """
        self._do("replan", entity=name)

    def configure(self, name: str, behavior: str, **keys: Any) -> None:
        """Change keys of a behavior, which starts anew with them; the body replans.

        Args:
            name: The person or robot.
            behavior: The behavior, by its type.
            keys: The keys that change, with values as in a scenario.

        Raises:
            ScenarioError: There is no such body, behavior or key, or the value is wrong.

        Example:
            >>> import fleet2d
            >>> simulation = fleet2d.Simulation("bundled:paper", "simulation.duration=1 d", seed=4)
            >>> simulation.configure("astro", "hangout", tau="10 min")
            >>> simulation.advance()
            >>> simulation.actors["astro"].behaviors[-1].tau
            datetime.timedelta(seconds=600)
        """
        self._do("configure", entity=name, behavior=behavior, keys=keys)

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

    # Robots

    def call(
        self,
        name: str,
        *,
        to: Any = None,
        find: str | None = None,
        dock: bool = False,
        command: str | None = None,
    ) -> None:
        """Call a robot, as a user or an app does; its behaviors receive it as a command.

        Args:
            name: The robot.
            to: Come there: a room, furniture, or a point (x, y) [m]; needs a behavior `come`.
            find: Find that person; needs a behavior `find`.
            dock: Go to the charger; needs a behavior `dock`.
            command: A word that a behavior of your own responds to.

        Raises:
            ScenarioError: There is no such robot, or none of its behaviors responds.
            PlacementError: There is no such place, or it can't be reached.
        """
        self._do("call", entity=name, to=to, find=find, dock=dock, command=command)

    def dismiss(self, name: str) -> None:
        """Send a robot away: it drops what it was called to do, whom it follows, and its search.

        Raises:
            ScenarioError: There is no such robot.
        """
        self._do("dismiss", entity=name)

    def keep_out(
        self, name: str, of: str | tuple[str, ...], *, duration: Time | None = None
    ) -> None:
        """Tell a robot to keep out of rooms, for a duration or until restored.

        Args:
            name: The robot.
            of: The rooms, or kinds of rooms.
            duration: For how long.

        Raises:
            ScenarioError: There is no such robot.
            PlacementError: There is no such room.
        """
        self._do("keep_out", entity=name, of=of, duration=duration)

    def kidnap(self, name: str, to: Any, *, duration: Time | None = "1 min") -> None:
        """Carry a robot elsewhere without its knowledge: it stands there, lost, for a duration.

        Raises:
            ScenarioError: There is no such robot.
            PlacementError: There is no such place, or its body doesn't fit there.
        """
        self._do("kidnap", entity=name, to=to, duration=duration)

    def relocalize(self, name: str) -> None:
        """Let a robot that was kidnapped or lost know where it is.

        Raises:
            ScenarioError: There is no such robot.
        """
        self._do("relocalize", entity=name)

    def battery(self, name: str, charge: float | str) -> None:
        """Set the charge of a robot's battery: 0.2, or "20 %".

        Raises:
            ScenarioError: There is no such robot, or it has no battery.
        """
        self._do("battery", entity=name, charge=charge)

    def switch_off(
        self,
        name: str,
        *,
        camera: bool | str | None = None,
        behavior: str | None = None,
        duration: Time | None = None,
    ) -> None:
        """Switch a camera or a behavior off, for a duration or until it is switched on.

        Args:
            name: The robot; for a behavior also a person.
            camera: Its camera: True for all, or the name of one.
            behavior: The type of the behavior instead.
            duration: For how long; None: until it is switched on.

        Raises:
            ScenarioError: There is nothing of that name.
        """
        self._do("switch_off", entity=name, camera=camera, behavior=behavior, duration=duration)

    def switch_on(
        self, name: str, *, camera: bool | str | None = None, behavior: str | None = None
    ) -> None:
        """Switch a camera or a behavior on again; see `switch_off`.

        Raises:
            ScenarioError: There is nothing of that name.
        """
        self._do("switch_on", entity=name, camera=camera, behavior=behavior)

    def fault(
        self,
        name: str,
        *,
        wheels: bool = False,
        lost: bool = False,
        charger: bool = False,
        dark: bool | str = False,
        detection: float | str = 1.0,
        errs: Any = None,
        duration: Time | None = None,
    ) -> None:
        """Let a part of a robot fail, for a duration or until it is restored.

        Args:
            name: The robot.
            wheels: Whether its wheels are stuck.
            lost: Whether its localization is lost, so that it stands still.
            charger: Whether its charger is broken.
            dark: Whether its cameras see nothing, or the name of the one that doesn't.
            detection: Factor of the probability that a user in view is noticed.
            errs: The errors of its cameras instead, like `perception` of a robot in a scenario.
            duration: For how long; None: until it is restored.

        Raises:
            ScenarioError: There is no such robot or camera, or nothing fails.
        """
        body = {"wheels": wheels, "lost": lost, "charger": charger}
        sight = {"dark": dark, "detection": detection, "errs": errs}
        self._do("fault", entity=name, duration=duration, **body, **sight)

    def restore(self, name: str) -> None:
        """End all that lasts on a robot, a sensor or an algorithm: faults, switches and the like.

        Raises:
            ScenarioError: There is nothing of that name.
        """
        self._do("restore", name=name)

    # What robots perceive

    def suppress(
        self, name: str, user: str, *, camera: str | None = None, duration: Time | None = None
    ) -> None:
        """Let a robot miss a person in view, for a duration or until it is restored.

        Raises:
            ScenarioError: There is no such robot, camera or person.
        """
        self._do("suppress", entity=name, user=user, camera=camera, duration=duration)

    def mistake(
        self,
        name: str,
        user: str,
        taken_for: str,
        *,
        camera: str | None = None,
        duration: Time | None = None,
    ) -> None:
        """Let a robot mistake a person whom it notices for another one, or for "unknown".

        Raises:
            ScenarioError: There is no such robot, camera or person.
        """
        fields = {"camera": camera, "duration": duration}
        self._do("mistake", entity=name, user=user, taken_for=taken_for, **fields)

    def inject(
        self,
        name: str,
        user: str,
        spot: tuple[float, float],
        *,
        heading_deg: float = 0.0,
        camera: str | None = None,
        duration: Time | None = None,
    ) -> None:
        """Let a robot perceive a person who isn't there, in every look, wherever it looks.

        Args:
            name: The robot.
            user: The person that it perceives, or "unknown".
            spot: The apparent place, (x, y) [m].
            heading_deg: The apparent heading, counter-clockwise from +x.
            camera: The camera; None: all.
            duration: For how long; None: until it is restored.

        Raises:
            ScenarioError: There is no such robot, camera or person.
            PlacementError: The spot is outside the home.
        """
        fields = {"heading_deg": heading_deg, "camera": camera, "duration": duration}
        self._do("inject", entity=name, user=user, spot=spot, **fields)

    # Algorithms

    def reset(self, algorithm: str, learned: Any = None) -> None:
        """Let an algorithm forget what it has learned, or load what another run has learned.

        Raises:
            ScenarioError: There is no such algorithm.
        """
        self._do("reset", algorithm=algorithm, learned=learned)

    def replace(
        self,
        algorithm: str,
        *,
        rooms: Mapping[str, float] | None = None,
        values: Mapping[str, float | str] | None = None,
        frozen: bool = False,
        withheld: bool = False,
        duration: Time | None = None,
    ) -> None:
        """Let behaviors and other algorithms read another output of an algorithm.

        Args:
            algorithm: The algorithm.
            rooms: Weights of rooms; 0 for those left out.
            values: Or numbers and texts by name, for an output that is a mapping.
            frozen: Or its present output.
            withheld: Or no output, as before the first one.
            duration: For how long; None: until it is restored.

        Raises:
            ScenarioError: There is no such algorithm or room, or not exactly one output is given.
        """
        fields = {"rooms": rooms, "values": values, "frozen": frozen, "withheld": withheld}
        self._do("replace", algorithm=algorithm, duration=duration, **fields)

    # The home and its sensors

    def stick(
        self, sensor: str, says: SensorFault = "silent", *, duration: Time | None = None
    ) -> None:
        """Let a sensor be "on", "off" or "silent", for a duration or until it is restored.

        Raises:
            ScenarioError: There is no such sensor.
        """
        self._do("stick", sensor=sensor, says=says, duration=duration)

    def open(self, door: str) -> None:
        """Open a door, even a locked one.

        Raises:
            ScenarioError: There is no such door.
        """
        self._do("open", door=door)

    def shut(self, door: str) -> None:
        """Shut a door, as soon as nobody stands in the doorway.

        Raises:
            ScenarioError: There is no such door.
        """
        self._do("shut", door=door)

    def lock(self, door: str) -> None:
        """Lock a door: nobody opens it by hand once it is shut.

        Raises:
            ScenarioError: There is no such door.
        """
        self._do("lock", door=door)

    def unlock(self, door: str) -> None:
        """Unlock a door.

        Raises:
            ScenarioError: There is no such door.
        """
        self._do("unlock", door=door)

    def move(self, furniture: str, to: tuple[float, float], turn_deg: float = 0.0) -> None:
        """Move a piece of furniture, so that its centre is at (x, y) [m], and turn it.

        Raises:
            ScenarioError: There is no such piece, or it can't stand there.
        """
        self._do("move", object=furniture, to=to, turn_deg=turn_deg)

    def room(self, name: str, type: str) -> None:  # noqa: A002
        """Change the type of a room from now on.

        Raises:
            ScenarioError: There is no such room, or no such room type.
        """
        self._do("room", name=name, type=type)

    def slow(
        self,
        area: Sequence[tuple[float, float]],
        *,
        speed: float = 1.0,
        stop: Time = timedelta(0),
        duration: Time | None = None,
    ) -> None:
        """Let a wet floor or a carpet slow robots down, or its edge stop them.

        Args:
            area: Its corners [m].
            speed: Their speed in it, as a share of the usual one.
            stop: How long they stop when they enter it.
            duration: For how long; None: to the end of the run.

        Raises:
            ScenarioError: The sides of the area cross, or it slows nobody down.
        """
        self._do("slow", area=area, speed=speed, stop=stop, duration=duration)

    def lights(self, room: str, turn: Literal["on", "off"]) -> None:
        """Switch the light of a room, of all rooms of a kind, or of "all", on or off.

        Raises:
            ScenarioError: There is no such room.
        """
        self._do("lights", room=room, turn=turn)

    def change(self, change: HomeChange | None = None, /, **keys: Any) -> None:
        """Change the home at the present step: ``simulation.change(shut="bath_door")``.

        Args:
            change: The change; or
            keys: its keys, as in the scenario's `changes`.

        Raises:
            ScenarioError: The keys are no change, or name something unknown.
        """
        with validating("change()"):
            change = HomeChange(**keys) if change is None else change
        self._do("change", change=change)

    def _do(self, verb: str, **fields: Any) -> None:
        """Apply an intervention; its module is imported when it is first used."""
        intervention = cast(type[Intervention], lookup("intervention", verb))
        with validating(f"{verb}()"):
            act = intervention(**{key: value for key, value in fields.items() if value is not None})
        self.intervene(act)
