"""Control of a simulation from outside: its state, its steps, and interventions."""

import operator
from abc import abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from datetime import datetime, timedelta
from typing import Any

from pydantic import ValidationError

from fleet2d.algorithms.algorithm import Algorithm
from fleet2d.configuration.problems import refusal, suggest
from fleet2d.configuration.units import micros, parse_duration
from fleet2d.engine.script import request
from fleet2d.engine.state import State
from fleet2d.entities.decisions import DecidingActor
from fleet2d.entities.plan import Plan, data_of
from fleet2d.errors import InputError, ScenarioError
from fleet2d.floorplan.home.change import HomeChange
from fleet2d.floorplan.home.home import Home
from fleet2d.interventions.intervention import Intervention
from fleet2d.interventions.verbs import Verbs
from fleet2d.kernels.numbers import in_radians
from fleet2d.runs.run import Run
from fleet2d.runtime.clock import Clock, next_time
from fleet2d.runtime.events import Event, EventKind, Listener
from fleet2d.scenario.model import Scenario


class Steering(Verbs):
    """The part of a simulation that scripts, tests and external controllers read and control.

    Attributes:
        scenario: The scenario.
        clock: Its steps.
    """

    scenario: Scenario
    clock: Clock
    _state: State
    _run: Run | None

    @abstractmethod
    def _run_to(
        self, end: int, on_progress: Callable[[Any], None] | None = None, spans: int | None = None
    ) -> None:
        """Simulate up to a step, or a number of spans."""

    @abstractmethod
    def _keep_requests(self) -> None:
        """Write what was requested to the manifest of a run in a directory."""

    # State

    @property
    def step(self) -> int:
        """The next step to simulate; 0 at the start."""
        return self._state.bodies.step

    @property
    def home(self) -> Home:
        """The home, as it is at present."""
        return self._state.home

    @property
    def time(self) -> datetime:
        """The local time of the next step."""
        return self.clock.time(self.step)

    @property
    def done(self) -> bool:
        """Whether all steps are simulated."""
        return self.step >= self.clock.steps

    @property
    def state(self) -> dict[str, dict[str, Any]]:
        """The state at the next step by name, of bodies: x, y [m], heading [rad], room, away.

        Of doors it is whether they are open and locked, of sensors whether they are on.
        """
        bodies = {actor.name: self._state_of(actor) for actor in self._state.actors}
        doors = {
            name: {"open": i not in self.home.shut, "locked": i in self.home.locked}
            for i, name in enumerate(self._state.changes.names)
        }
        if self._state.sensors.names:
            self._state.settle(self.step)
        return bodies | doors | {name: {"on": on} for name, on in self._state.sensors.on.items()}

    @property
    def actors(self) -> dict[str, DecidingActor]:
        """All people and robots, by name: configuration, behaviors and plan."""
        return {actor.name: actor for actor in self._state.actors}

    @property
    def outputs(self) -> dict[str, Any]:
        """The latest output of each algorithm, by name, as behaviors read it."""
        return dict(self._state.learners.readable_outputs)

    @property
    def algorithms(self) -> dict[str, Algorithm]:
        """The algorithms in the run, by name: configuration, and what they have learned."""
        return {
            learner.name: learner.component
            for learner in self._state.learners.all
            if isinstance(learner.component, Algorithm)
        }

    # Running

    def advance(self, steps: int | Mapping[str, Plan] = 1) -> None:
        """Simulate a number of steps, up to the end of the run; or apply decisions from outside.

        Args:
            steps: The number; or a plan from `plan` for each body that is `pending`: then the run
                continues up to the next step at which a driven body has to decide.

        Raises:
            InputError: The number is negative, the run is finished, or a driven body has no plan.
            KeyboardInterrupt: Ctrl-C, after the present span; the simulation can be continued.

        Example:
            >>> import fleet2d
            >>> simulation = fleet2d.Simulation(None, "simulation.duration=1 h", seed=4)
            >>> simulation.drive("astro")
            >>> while simulation.pending():
            ...     plan = simulation.plan("astro").go_to("kitchen").stay(timedelta(minutes=20))
            ...     simulation.advance({"astro": plan})
            >>> simulation.done
            True
        """
        if isinstance(steps, Mapping):
            self._take_decisions(steps)
            return
        steps = operator.index(steps)
        if steps < 0:
            raise InputError(
                f"advance({steps}): the number of steps must be 0 or more; to go back, keep a copy"
                " of an earlier step"
            )
        self._run_to(min(self.clock.steps, self.step + steps))

    def run_until(
        self,
        when: int | str | datetime | timedelta | None = None,
        *,
        event: str | None = None,
        entity: str | None = None,
        timeout: str | timedelta | None = None,
    ) -> Event | None:
        """Simulate up to a step, a local time or an event.

        Args:
            when: A step, a local time, a time since the start, or the next time of day ("19:00").
            event: A kind of event instead, as in the table of events; the next step is the one
                after it.
            entity: The body or object that it has to happen to; None: any.
            timeout: The longest time to wait for the event; None: up to the end of the run.

        Returns:
            The event; None if it didn't happen, or `when` is given.

        Raises:
            InputError: The time is past, the run is finished, or there is no such event or body.
            KeyboardInterrupt: Ctrl-C, after the present span; the simulation can be continued.

        Example:
            >>> import fleet2d
            >>> simulation = fleet2d.Simulation(None, "simulation.duration=1 d", seed=4)
            >>> simulation.run_until("19:00")
            >>> simulation.time.hour
            19
            >>> simulation.run_until(event="user_seen", entity="astro", timeout="12 h").detail
            'ana'
        """
        if event is None:
            step = self._step_of(when)
            if step < self.step:
                raise InputError(
                    f"run_until(step {step}): it is step {self.step} already, {self.time}; branch a"
                    " copy before that"
                )
            self._run_to(min(self.clock.steps, step))
            return None
        return self._run_until_event(event, entity, timeout)

    def _step_of(self, when: int | str | datetime | timedelta | None) -> int:
        if when is None:
            raise InputError("run_until(): give a time, or event=…")
        if isinstance(when, str):
            when = next_time(when, self.time)
        if isinstance(when, datetime):
            when = when - self.clock.start
        if isinstance(when, timedelta):
            return self.clock.step_at_or_after(micros(when))
        return operator.index(when)

    def _run_until_event(
        self, event: str, entity: str | None, timeout: str | timedelta | None
    ) -> Event | None:
        state, end = self._state, self.clock.steps
        kinds = {*EventKind, *(n for a in state.actors for b in a.behaviors for n in b.records)}
        _check_name("event", event, kinds)
        if entity is not None:
            _check_name("entity", entity, [*self.actors, *self.scenario.objects])
        if timeout is not None:
            wait = parse_duration(timeout) if isinstance(timeout, str) else timeout
            end = min(end, self.step + self.clock.step_at_or_after(micros(wait)))
        state.wait_for(frozenset({event}))
        try:
            while self.step < end:
                start = self.step
                self._run_to(end, spans=1)
                for candidate in state.events.since(start):
                    if candidate.event == event and entity in (None, candidate.entity):
                        return candidate
        finally:
            state.wait_for(frozenset())
        return None

    def events(self, since: int = 0) -> list[Event]:
        """Return the events from a step on, up to the present one, in order.

        Raises:
            InputError: Too many events have happened since: read the table `events`.
        """
        self._state.settle(self.step)
        return self._state.events.since(since)

    @property
    def interventions(self) -> list[dict[str, Any]]:
        """The interventions so far, of the script and from outside, as in a manifest."""
        return list(self._state.interventions.done)

    def listen(self, function: Callable[[Sequence[Event]], None]) -> None:
        """Call a function with new events as they become known: not always in order of step."""
        self._state.events.sinks.append(Listener(function))

    # Interventions: each is recorded in the manifest, and repeated by `reproduce`.

    def intervene(self, act: Intervention | Mapping[str, Any]) -> None:
        """Apply an intervention at the present step, or later.

        Args:
            act: The intervention, or a mapping as in a scenario's `script`, which may say when by
                `at` or `on`.

        Raises:
            ScenarioError: It is not valid, names something unknown, or can never happen.
            PlacementError: There is no such place, or it can't be reached.
            InputError: The run is finished.

        Example:
            >>> import fleet2d
            >>> simulation = fleet2d.Simulation(None, "simulation.duration=1 d", seed=4)
            >>> simulation.intervene({"put": "ana", "to": "kitchen"})
            >>> simulation.run().manifest["interventions"]
            [{'do': 'put', 'step': 0, 'entity': 'ana', 'to': 'kitchen'}]

            >>> simulation = fleet2d.Simulation(None, "simulation.duration=1 d", seed=4)
            >>> simulation.intervene({"on": ["activity", "ana", "dinner"], "hold": "astro"})
            >>> [act["do"] for act in simulation.run().manifest["interventions"]]
            ['hold']
        """
        if self._run is not None:
            raise InputError("the run is finished: nothing can be done to it any more")
        if request(self._state, act, self.step):
            self._keep_requests()

    def change(self, change: HomeChange | None = None, /, **keys: Any) -> None:
        """Change the home at the present step: ``simulation.change(shut="bath_door")``.

        Args:
            change: The change; or
            keys: its keys, as in the scenario's `changes`.

        Raises:
            ScenarioError: The keys are no change, or name something unknown.
        """
        try:
            change = HomeChange(**keys) if change is None else change
        except ValidationError as error:
            raise refusal("change()", error) from None
        self._do("change", change=change)

    def drive(self, name: str) -> None:
        """Take over the decisions of a body: see `pending` and `advance`.

        Raises:
            ScenarioError: There is no such body.
        """
        row = list(self.actors).index(self._body(name).name)
        self._do("drive", entity=name)
        self._state.driven.add(row)
        self._state.bodies.ask_at[row] = self.step

    def pending(self) -> list[str]:
        """Return the driven bodies that have to decide at the present step."""
        state = self._state
        if self.done:
            return []
        due = set(state.bodies.due(self.step))
        return [state.actors[row].name for row in sorted(due & state.driven)]

    def plan(self, name: str) -> Plan:
        """Return an empty plan from the body's present pose, to be filled and passed to `advance`.

        Raises:
            ScenarioError: There is no such body.
        """
        return Plan(self._body(name), self.step)

    def decide(self, name: str, plan: Plan) -> None:
        """Let a driven body follow a plan from the present step on, without simulating a step.

        Raises:
            ScenarioError: There is no such body.
            InputError: The body isn't driven.
        """
        row = list(self.actors).index(self._body(name).name)
        if row not in self._state.driven:
            raise InputError(f"{name} isn't driven, it decides itself: call drive({name!r}) first")
        self._do("decide", entity=name, plan=data_of(plan))

    def _take_decisions(self, plans: Mapping[str, Plan]) -> None:
        """Follow plans from outside up to the next step at which a driven body has to decide."""
        for name in self.pending():
            if name not in plans:
                raise InputError(f"advance(): {name} has to decide now, and has no plan")
        for name, plan in plans.items():
            self.decide(name, plan)
        while not self.done:
            self._run_to(self.clock.steps, spans=1)
            if self.pending():
                return

    def _body(self, name: str) -> DecidingActor:
        actors = self.actors
        if name not in actors:
            raise ScenarioError(f"there is nobody named {name!r}{suggest(name, actors)}")
        return actors[name]

    def _state_of(self, actor: DecidingActor) -> dict[str, Any]:
        state = actor.state
        x, y = self.home.plan.lattice.to_metres([state.x, state.y]).tolist()
        room = None if state.away else self.home.plan.room_at(x, y)
        return {
            "x": x,
            "y": y,
            "heading": in_radians(state.heading),
            "room": room.name if room else None,
            "away": bool(state.away),
        }


def _check_name(noun: str, name: str, known: Iterable[str]) -> None:
    """Refuse an unknown name."""
    names = list(known)
    if name not in names:
        raise InputError(f"there is no {noun} {name!r}{suggest(name, names)}")
