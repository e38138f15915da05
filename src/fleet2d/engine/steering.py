"""Steering a simulation: looking at its state, stepping it, and doing things to it from outside."""

import operator
from abc import abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from datetime import datetime, timedelta
from typing import Any

from pydantic import ValidationError

from fleet2d.algorithms.algorithm import Algorithm
from fleet2d.clock import Clock, next_time
from fleet2d.engine.script import take_up
from fleet2d.engine.state import State
from fleet2d.engine.world import EngineWorld
from fleet2d.entities.decisions import DecidingActor
from fleet2d.entities.plan import Plan
from fleet2d.errors import InputError, ScenarioError
from fleet2d.events import Event, EventKind, Listener
from fleet2d.floorplan.home.change import HomeChange
from fleet2d.floorplan.home.home import Home
from fleet2d.interventions.bodies import Decide, Drive
from fleet2d.interventions.home import Change
from fleet2d.interventions.intervention import Intervention, parse_intervention
from fleet2d.interventions.script import WHEN, parse_entry
from fleet2d.interventions.verbs import Verbs
from fleet2d.kernels.headings import in_radians
from fleet2d.problems import did_you_mean
from fleet2d.runs.run import Run
from fleet2d.scenario.model import Scenario
from fleet2d.units import parse_duration


class Steering(Verbs):
    """What scripts, tests and outside minds may see of a simulation, and do to it.

    Attributes:
        scenario: What is simulated.
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
        """Simulate up to a step, or so many spans."""

    # State

    @property
    def step(self) -> int:
        """The next step to simulate; 0 at first."""
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
        """Where everybody is at the next step: x, y [m], heading [rad], room, away.

        And of doors whether they are open and locked, of sensors whether they are on.
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
        """Everybody in the run, by name: configuration, behaviors and plan."""
        return {actor.name: actor for actor in self._state.actors}

    @property
    def outputs(self) -> dict[str, Any]:
        """The newest output of each algorithm, by name, as behaviors read it."""
        return dict(self._state.learners.readable)

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
        """Simulate so many steps, or up to the end of the run; or take decisions from outside.

        Args:
            steps: How many; or a plan for each body that is `pending`, from `plan`: then the run
                goes on up to the next step at which a body that is driven has to decide.

        Raises:
            InputError: The number is negative, the run is finished, or a body that is driven has
                no plan.
            KeyboardInterrupt: Ctrl-C, after the present span; the simulation can go on.

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
            raise InputError(f"advance({steps}): time only goes forward; branch a copy instead")
        self._run_to(min(self.clock.steps, self.step + steps))

    def run_until(
        self,
        when: int | str | datetime | timedelta | None = None,
        *,
        event: str | None = None,
        entity: str | None = None,
        timeout: str | timedelta | None = None,
    ) -> Event | None:
        """Simulate up to a step, a local time or an event; the step after is next then.

        Args:
            when: A step, a local time, a time since the start, or a time of day ("19:00": the next
                time that it is).
            event: A kind of event, as the table of events has it, instead.
            entity: The body or object that it has to happen to; None: any.
            timeout: How long to wait for the event at most; None: up to the end of the run.

        Returns:
            The event, or None if there was none, or none was waited for.

        Raises:
            InputError: The time is past, the run is finished, or there is no such event or body.
            KeyboardInterrupt: Ctrl-C, after the present span; the simulation can go on.

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
            raise InputError("run_until(): say a time, or event=…")
        if isinstance(when, str):
            when = next_time(when, self.time)
        if isinstance(when, datetime):
            when = when - self.clock.start
        if isinstance(when, timedelta):
            return self.clock.step_at_or_after(when // timedelta(microseconds=1))
        return operator.index(when)

    def _run_until_event(
        self, event: str, entity: str | None, timeout: str | timedelta | None
    ) -> Event | None:
        state, end = self._state, self.clock.steps
        known = {*EventKind, *(n for a in state.actors for b in a.behaviors for n in b.records)}
        _check_name("event", event, known)
        if entity is not None:
            _check_name("entity", entity, [*self.actors, *self.scenario.objects])
        if timeout is not None:
            wait = parse_duration(timeout) if isinstance(timeout, str) else timeout
            end = min(
                end, self.step + self.clock.step_at_or_after(wait // timedelta(microseconds=1))
            )
        state.wait_for(frozenset({event}))
        try:
            while self.step < end:
                before = self.step
                self._run_to(end, spans=1)
                for found in state.events.since(before):
                    if found.event == event and entity in (None, found.entity):
                        return found
        finally:
            state.wait_for(frozenset())
        return None

    def events(self, since: int = 0) -> list[Event]:
        """Return what happened from a step on, up to the present one, in order.

        Raises:
            InputError: Events of that step are no longer kept: read the table `events`.
        """
        self._state.settle(self.step)
        return self._state.events.since(since)

    @property
    def interventions(self) -> list[dict[str, Any]]:
        """What was done to the run so far, by its script or from outside, as in a manifest."""
        return list(self._state.interventions.done)

    def listen(self, function: Callable[[Sequence[Event]], None]) -> None:
        """Call a function with what happens, as it becomes known: not always in order of step."""
        self._state.events.sinks.append(Listener(function))

    # Interventions: each is kept in the manifest, and done again by `reproduce`.

    def intervene(self, act: Intervention | Mapping[str, Any]) -> None:
        """Do something at the present step, or later: an intervention, or an entry of a script.

        Args:
            act: The intervention, or a mapping as a scenario's `script` has it; with `at` or `on`,
                it is done then.

        Raises:
            ScenarioError: It is none, there is nothing of that name, or it can never happen.
            PlacementError: There is no such place, or nobody gets there.
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
        if isinstance(act, Mapping) and not act.keys().isdisjoint(WHEN):
            take_up(self._state, parse_entry(act), self.step)
            return
        if isinstance(act, Mapping):
            act = parse_intervention(act)
        act.check(EngineWorld(self._state, self.step))
        self._state.interventions.add(act, self.step)

    def change(self, change: HomeChange | None = None, /, **what: Any) -> None:
        """Change the home at the present step: ``simulation.change(shut="bath_door")``.

        Args:
            change: The change; or
            what: its keys, as in the scenario's `changes`.

        Raises:
            ScenarioError: The keys are no change, or there is nothing of that name.
        """
        try:
            asked = HomeChange(**what) if change is None else change
        except ValidationError as error:
            raise ScenarioError(f"change(): {error.errors()[0]['msg']}") from None
        self.intervene(Change(change=asked))

    def drive(self, name: str) -> None:
        """Take the decisions of a body into one's own hands: see `pending` and `advance`.

        Raises:
            ScenarioError: There is nobody of that name.
        """
        row = list(self.actors).index(self._body(name).name)
        self.intervene(Drive(entity=name))
        self._state.driven.add(row)
        self._state.bodies.ask_at[row] = self.step

    def pending(self) -> list[str]:
        """Return the bodies that are driven, and have to decide at the present step."""
        state = self._state
        if self.done:
            return []
        due = set(state.bodies.due(self.step))
        return [state.actors[row].name for row in sorted(due & state.driven)]

    def plan(self, name: str) -> Plan:
        """Return a plan that begins here and now, to be filled and handed to `advance`.

        Raises:
            ScenarioError: There is nobody of that name.
        """
        return Plan(self._body(name), self.step)

    def decide(self, name: str, plan: Plan) -> None:
        """Let a driven body follow a plan from the present step on; time does not go on.

        Raises:
            ScenarioError: There is nobody of that name.
            InputError: The body isn't driven.
        """
        row = list(self.actors).index(self._body(name).name)
        if row not in self._state.driven:
            raise InputError(f"{name} isn't driven, it decides itself: call drive({name!r}) first")
        self.intervene(Decide(entity=name, plan=plan.data()))

    def _take_decisions(self, plans: Mapping[str, Plan]) -> None:
        """Follow plans from outside up to the next step at which a driven body has to decide."""
        missing = [name for name in self.pending() if name not in plans]
        if missing:
            raise InputError(
                f"advance(): {missing[0]} has to decide now, and there is no plan for it"
            )
        for name, plan in plans.items():
            self.decide(name, plan)
        while not self.done:
            self._run_to(self.clock.steps, spans=1)
            if self.pending():
                return

    def _body(self, name: str) -> DecidingActor:
        actors = self.actors
        if name not in actors:
            raise ScenarioError(
                f"there is nobody named {name!r}{did_you_mean(name, actors)}"
                f" There are: {', '.join(actors)}"
            )
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


def _check_name(what: str, name: str, known: Iterable[str]) -> None:
    """Refuse a name that there isn't."""
    names = list(known)
    if name not in names:
        raise InputError(
            f"there is no {what} {name!r}{did_you_mean(name, names)} There are:"
            f" {', '.join(map(str, names))}"
        )
