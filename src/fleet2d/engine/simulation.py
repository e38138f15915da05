"""The simulation: a run in progress, which can be stepped, changed, read and copied.

A simulation has the state of the run, and a loop that takes the state from span to span.
"""

import copy
import io
import json
import operator
import secrets
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import nullcontext, suppress
from datetime import datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, Self

from pydantic_core import PydanticCustomError

from fleet2d.algorithms.algorithm import Algorithm
from fleet2d.artifacts.manifest import (
    FLOORPLAN_NAME,
    LEARNED_NAME,
    SLOW,
    Entities,
    Status,
    input_record,
    versions,
)
from fleet2d.artifacts.store import RunStore, cannot_write
from fleet2d.configuration.problems import check_known, suggest
from fleet2d.configuration.units import micros, parse_duration
from fleet2d.engine.basis import input_files
from fleet2d.engine.idle import (
    idle_behaviors,
    split_households,
    unasked_interactions,
    unused_settings,
)
from fleet2d.engine.intervention_queue import is_from_outside
from fleet2d.engine.loop import Loop
from fleet2d.engine.sensors import Sensors
from fleet2d.engine.setup import set_up
from fleet2d.engine.state import Listener, State
from fleet2d.entities.decisions import DecidingActor
from fleet2d.entities.plan import Plan, data_of
from fleet2d.errors import ArtifactError, InputError, ScenarioError, errors_as
from fleet2d.floorplan.home import Home
from fleet2d.interventions.intervention import ClockTime, Intervention, parse_when
from fleet2d.kernels import in_radians
from fleet2d.runs.run import Run, open_store
from fleet2d.runtime.clock import midnight_of
from fleet2d.runtime.events import Event, EventKind
from fleet2d.runtime.memory import free_bodies, rare_collections
from fleet2d.scenario.load import load_scenario
from fleet2d.scenario.model import Scenario

if TYPE_CHECKING:
    from fleet2d.engine.checkpoint import CheckpointWriter
    from fleet2d.engine.snapshot import Constants
    from fleet2d.expectations.expectation import Expectation
    from fleet2d.expectations.verdict import Verdict

# The purpose of the signature of a file.
PURPOSE = "saved simulation"


class Simulation:
    """A run in progress: step it, run it until a time or event, read its state, copy it.

    Attributes:
        scenario: The scenario.
        seed: The seed of the scenario, or the one that was drawn.
        clock: The steps of the run.

    Example:
        >>> import copy
        >>> from datetime import timedelta
        >>> simulation = Simulation("bundled:paper", "simulation.duration=1 d", seed=4)
        >>> simulation.run_until(timedelta(hours=12))
        >>> futures = [copy.deepcopy(simulation).run() for _ in range(2)]
        >>> futures[0].digest == futures[1].digest
        True
    """

    def __init__(
        self,
        scenario: str | Path | Mapping[str, Any] | Scenario | None = None,
        *overrides: str,
        out: str | Path | None = None,
        interventions: Sequence[Mapping[str, Any]] = (),
        **settings: Any,
    ) -> None:
        """Set up the run; with `out` it is stored in that directory, else in memory.

        Args:
            scenario: A YAML file, 'bundled:NAME', a mapping or a Scenario; None: the bundled family
                scenario.
            overrides: Texts like 'simulation.duration.days=60'.
            out: Directory to store the run in; None keeps it in memory.
            interventions: Interventions from outside, as in a manifest.
            settings: Keys of `simulation` or of the scenario, such as seed=4.

        Raises:
            InputError: The scenario, its floor plan, a place in it or the directory is wrong.
                Nothing is written then.
        """
        began = time.perf_counter()
        with rare_collections():
            checked_scenario = load_scenario(scenario, *overrides, **settings)
            store = RunStore(out)
            store.check()
            self._prepare(checked_scenario, store, interventions)
        self._open_store()
        self._setup_s = time.perf_counter() - began

    def _prepare(
        self, scenario: Scenario, store: RunStore, interventions: Sequence[Mapping[str, Any]] = ()
    ) -> None:
        """Set up everything but the directory."""
        self.scenario = scenario
        simulation = scenario.simulation
        self.seed = secrets.randbelow(2**53) if simulation.seed is None else simulation.seed
        self.clock = simulation.clock
        self._store = store
        self._state = set_up(self.scenario, self.clock, self.seed, self._store)
        # The scenario's own script repeats its interventions itself.
        outside = [dict(record) for record in interventions if is_from_outside(record)]
        self._repeat(outside)
        self._run: Run | None = None  # set at the end
        self._keeper = self._open_keeper()
        self._loop = Loop(self.clock, simulation.speedup, self._keeper)
        self._setup_s = 0.0
        self._describe_start(outside)

    def _open_keeper(self) -> "CheckpointWriter | None":
        """Return the writer of commits and checkpoints; None: the run is in memory."""
        if self._store.directory is None:
            return None
        from fleet2d.engine.checkpoint import CheckpointWriter

        settings = self.scenario.artifacts
        return CheckpointWriter(self._store, settings, self.clock, self._checkpoint_header)

    def _repeat(self, records: Sequence[Mapping[str, Any]]) -> None:
        """Apply recorded interventions from outside."""
        if records:
            from fleet2d.engine.world import repeat  # few runs need it

            repeat(self._state, records)

    def _open_store(self) -> None:
        """Create the run directory, and store the floor plan in it.

        Raises:
            RunDirectoryError: The directory can't be used; no new file remains.
            ArtifactError: The disk is full; no new file remains.
        """
        store = self._store
        store.open()
        if store.directory is None:
            return
        try:
            self._store_plan()
        except ArtifactError as error:
            store.discard()
            reason = error.__cause__
            if isinstance(reason, OSError):
                raise cannot_write(store.directory, reason) from reason
            raise

    def _store_plan(self) -> None:
        from fleet2d.floorplan.native import native_document  # runs in memory don't need it

        plan = self.home.plan
        document = self.home.cached("document", lambda: json.dumps(native_document(plan)))
        self._store.keep(FLOORPLAN_NAME, document)

    @property
    def step(self) -> int:
        """The next step to simulate; 0 at the start."""
        return self._state.bodies.step

    @property
    def home(self) -> Home:
        """The home, as it is at present."""
        return self._state.home

    @property
    def notes(self) -> list[str]:
        """Oddities and flaws of the floor plan, and remarks on parts of the scenario."""
        sources = (f"{c.owner.path}: {note}" for c in self._state.cameras for note in c.notes)
        bodies = (f"{body.path}.{note}" for body in self._state.actors for note in body.notes)
        wrong = (f"wrong: {text}" for text in flaws_of(self))
        of_sensors = self._state.find(Sensors)
        sensors = [] if of_sensors is None else of_sensors.notes
        heights = self.scenario.sight.heights
        return [
            *wrong,
            *self._odd_moments(),
            *self.home.plan.notes,
            *sources,
            *sensors,
            *unused_settings(self._state.actors, self.home, heights=heights),
            *bodies,
            *idle_behaviors(self._state.actors, self.scenario),
            *unasked_interactions(self._state.actors),
            *split_households(self._state.actors),
            *self._of_expectations,
        ]

    @property
    def _of_expectations(self) -> Iterator[str]:
        """Remarks on expectations, such as that the home lacks a kind of rooms."""
        expectations = self._state.expectations
        entries = {} if expectations is None else expectations.entries
        for name, entry in entries.items():
            yield from (f"expect.{name}: {note}" for note in entry.notes)

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
        """The state at the next step by name, of bodies: x, y [m], heading [rad], room, away, off.

        `off` is the reason for which a robot is off. Doors have `open` and `locked`, sensors `on`.
        """
        bodies = {actor.name: self._state_of(actor) for actor in self._state.actors}
        doors = {
            name: {"open": i not in self.home.shut, "locked": i in self.home.locked}
            for i, name in enumerate(self._state.changes.names)
        }
        sensors = self._state.find(Sensors)
        if sensors is None:
            return bodies | doors
        self._state.settle(self.step)
        return bodies | doors | {name: {"on": on} for name, on in sensors.on.items()}

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
        """The algorithms in the run, by name: configuration and learned state."""
        return {
            learner.name: learner.component
            for learner in self._state.learners.all
            if isinstance(learner.component, Algorithm)
        }

    def events(self, since: int = 0) -> list[Event]:
        """Return the events from a step on, up to the present one, in order.

        Raises:
            InputError: Too many events have happened since: read the table `events`.
        """
        self._state.settle(self.step)
        return self._state.events.since(since)

    def listen(
        self, function: Callable[[Sequence[Event]], None], kinds: Iterable[str] | None = None
    ) -> None:
        """Call a function with events at once and in order, before the next step is simulated.

        The function may intervene. It gets all that is stored in `events`, in the order of that
        table, and readings of sensors, with the event `sensor` and the state as detail.

        Args:
            function: Called with the events of one or a few steps.
            kinds: The kinds of events that the function gets; None: all.

        Raises:
            InputError: A kind of event doesn't exist.

        Example:
            >>> import fleet2d
            >>> simulation = fleet2d.Simulation(None, "simulation.duration=8 h", seed=4)
            >>> steps = []
            >>> simulation.listen(lambda events: steps.extend(e.step for e in events))
            >>> run = simulation.run()
            >>> steps == run.tables["events"]["step"].to_pylist()
            True
        """
        state = self._state
        known = self._event_kinds()
        names = known if kinds is None else frozenset(kinds)
        for name in names:
            check_known(name, "event", sorted(known), InputError)
        state.settle(self.step)  # earlier events are not for this function
        state.events.listeners.append(Listener(function, names))
        state.wait_for(state.requested)

    def listen_rows(self, function: Callable[[str, Mapping[str, Any]], None]) -> None:
        """Call a function with each row of a table as soon as it is known.

        For events, see `listen`. From this call on, rows are stored after every span, which takes
        longer.

        Args:
            function: Called with the name of the table, and the row as a mapping of its columns.

        Example:
            >>> import fleet2d
            >>> simulation = fleet2d.Simulation("bundled:paper", "simulation.duration=2 h", seed=4)
            >>> tables = []
            >>> simulation.listen_rows(lambda table, row: tables.append(table))
            >>> _ = simulation.run()
            >>> tables.count("trajectories")
            4
        """
        self._store.row_listeners.append(function)
        self._state.recorder.flushes_every_span = True

    def _event_kinds(self) -> frozenset[str]:
        """Return the kinds of events that may happen in this run."""
        behaviors = (behavior for actor in self._state.actors for behavior in actor.behaviors)
        own = (behavior.records for behavior in behaviors)
        return frozenset[str](EventKind).union(*own)

    def _state_of(self, actor: DecidingActor) -> dict[str, Any]:
        state = actor.state
        x, y = actor.xy
        room = None if state.away else self.home.plan.room_at(x, y)
        return {
            "x": x,
            "y": y,
            "heading": in_radians(state.heading),
            "room": room.name if room else None,
            "away": bool(state.away),
            **({"off": actor.off_for} if actor.is_off else {}),
        }

    def run(self, on_progress: Callable[[Self], None] | None = None) -> Run:
        """Simulate to the end, store, and return the run.

        Args:
            on_progress: Called about every 0.1 s with the simulation.

        Raises:
            KeyboardInterrupt: Ctrl-C; the run up to that step is stored and can be read.
        """
        try:
            self._run_to(self.clock.steps, on_progress)
        except BaseException as error:
            if isinstance(error, KeyboardInterrupt) and not self._loop.has_failed:
                self.finish("interrupted")
            else:
                self._fail(error)
            raise
        return self.finish()

    def advance(self, steps: int | Mapping[str, Plan] = 1) -> None:
        """Simulate a number of steps, up to the end of the run; or apply decisions from outside.

        Args:
            steps: The number; or a plan from `plan` for each body that is `pending`: then the run
                continues up to the next step at which a driven body has to decide.

        Raises:
            InputError: The number is negative, the run is finished, a driven body has no plan, or
                another one has.
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
        when: "int | str | datetime | timedelta | Callable[[Self], bool] | Expectation" = "",
        *,
        event: str | None = None,
        entity: str | None = None,
        timeout: str | timedelta | None = None,
    ) -> "Event | Verdict | bool | None":
        """Simulate up to a step, a time, an event, or until something holds.

        Args:
            when: A step, or a time as in a script: the next time of day ("19:00", "monday 07:30"),
                a local time, or a time since the start ("2 h"). Or a function of the simulation,
                called before each step, until it returns True. Or a condition, also as text: until
                it holds; or another expectation: until it is decided.
            event: A kind of event instead, as in the table of events; the next step is the one
                after it.
            entity: The body or object that it has to happen to; None: any.
            timeout: The longest time to wait, except for a time; None: up to the end of the run.

        Returns:
            The event, None if it didn't happen; None for a time; for a function, whether it
            returned True; for an expectation the verdict, not `decided` if there was no time.

        Raises:
            InputError: The time is past or after the run, the run is finished, or there is no such
                event or body.
            KeyboardInterrupt: Ctrl-C, after the present span; the simulation can be continued.

        Example:
            >>> import fleet2d
            >>> simulation = fleet2d.Simulation("bundled:paper", "simulation.duration=1 d", seed=4)
            >>> simulation.run_until("19:00")
            >>> simulation.time.hour
            19
            >>> simulation.run_until(event="user_seen", entity="astro", timeout="12 h").detail
            'ana'
            >>> simulation.run_until("distance(astro, ana) > 2 m").holds
            True
        """
        if event is not None:
            return self._run_until_event(event, entity, timeout)
        if isinstance(when, str) and "(" in when:
            when = _parsed(when)
        if isinstance(when, int | str | datetime | timedelta):
            step = self._step_of(when)
            if not self.step <= step <= self.clock.steps:
                how = "after the run"
                if step < self.step:
                    how = "past: keep a copy of an earlier step to go back"
                raise InputError(
                    f"run_until({when!r}) is {how}; now it is step {self.step},"
                    f" {self.time}, and the run ends at {self.clock.time(self.clock.steps)}"
                )
            self._run_to(step)
            return None
        end = self._end_of_wait(timeout)
        if not callable(when):
            return self._run_until_expectation(when, end)
        while not (holds := when(self)) and self.step < end:
            self._run_to(self.step + 1)
        return holds

    def _end_of_wait(self, timeout: str | timedelta | None) -> int:
        if timeout is None:
            return self.clock.steps
        wait = parse_duration(timeout) if isinstance(timeout, str) else timeout
        return min(self.clock.steps, self.step + self.clock.step_at_or_after(micros(wait)))

    def _run_until_expectation(self, expectation: "Expectation", end: int) -> "Verdict":
        """Simulate until a condition holds, or an expectation is decided.

        A copy goes ahead to find the step, so that the run itself stops there without knowing of
        it.
        """
        from fleet2d.expectations.temporal import eventually

        after = copy.deepcopy(self)
        steps = 60
        name = after.expect(expectation if expectation.is_judged else eventually(expectation))
        before = after
        while after.step < end and (before is after or not after.verdicts()[name].decided):
            before = copy.deepcopy(after)
            after._run_to(min(end, after.step + steps))
            steps *= 2
        while after.step - before.step > 1 and after.verdicts()[name].decided:
            middle = copy.deepcopy(before)
            middle._run_to((before.step + after.step) // 2)
            if middle.verdicts()[name].decided:
                after = middle
            else:
                before = middle
        self._run_to(after.step)
        return after.verdicts()[name]

    def _step_of(self, when: int | str | datetime | timedelta) -> int:
        if when == "":
            raise InputError("run_until(): give a time, a condition, or event=…")
        if isinstance(when, str):
            when = self._moment(when)
        if isinstance(when, datetime):
            when = timedelta(microseconds=self.clock.elapsed(when))
        if isinstance(when, timedelta):
            return self.clock.step_at_or_after(micros(when))
        return operator.index(when)

    def _moment(self, text: str) -> datetime | timedelta:
        """Return a time as scripts write it; a time of day is the next one."""
        with errors_as(InputError, f"run_until({text!r})", of=PydanticCustomError):
            when = parse_when(text)
        if not isinstance(when, ClockTime):
            return when
        day = midnight_of(self.time)
        while day.weekday() not in when.days or day + when.time < self.time:
            day += timedelta(days=1)
        return day + when.time

    def _run_until_event(
        self, event: str, entity: str | None, timeout: str | timedelta | None
    ) -> Event | None:
        state = self._state
        end = self._end_of_wait(timeout)
        check_known(event, "event", sorted(self._event_kinds()), InputError)
        if entity is not None:
            check_known(entity, "entity", [*self.actors, *self.scenario.objects], InputError)
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

    def _run_to(
        self, end: int, on_progress: Callable[[Self], None] | None = None, spans: int | None = None
    ) -> None:
        """Simulate up to a step, or a number of spans."""
        self._check_not_over()
        report = None if on_progress is None else lambda: on_progress(self)
        self._loop.run(self._state, end, report, spans)

    def _check_not_over(self) -> None:
        if self._run is not None:
            raise InputError("the run is finished: set up a new Simulation")
        if self._loop.has_failed:
            raise InputError("the run failed in the middle of a span and can't be continued")

    # Interventions: each is recorded in the manifest, and repeated by `reproduce`.

    def do(self, act: Intervention | Mapping[str, Any]) -> None:
        """Apply an intervention at the present step, or later.

        Args:
            act: The intervention, from `fleet2d.interventions`, or a mapping as in a scenario's
                `script`, which may say when by `at` or `on`.

        Raises:
            ScenarioError: The intervention is not valid, names something unknown, or can never
                happen.
            PlacementError: There is no such place, or it can't be reached.
            InputError: The run is finished.

        Example:
            >>> import fleet2d
            >>> simulation = fleet2d.Simulation(None, "simulation.duration=1 d", seed=4)
            >>> from fleet2d.interventions import Put
            >>> simulation.do(Put("ana", "kitchen"))  # or {"put": "ana", "to": "kitchen"}
            >>> simulation.run().manifest["interventions"]
            [{'do': 'put', 'step': 0, 'entity': 'ana', 'to': 'kitchen'}]

            >>> simulation = fleet2d.Simulation(None, "simulation.duration=1 d", seed=4)
            >>> simulation.do({"on": ["activity", "ana", "dinner"], "hold": "astro"})
            >>> [act["do"] for act in simulation.run().manifest["interventions"]]
            ['hold']
        """
        if self._run is not None:
            raise InputError("the run is finished: nothing can be done to it any more")
        from fleet2d.engine.world import request  # few runs need it

        if request(self._state, act, self.step) and self._keeper is not None:
            self._keeper.update_manifest(self._state)

    def drive(self, name: str) -> None:
        """Take over the decisions of a body: see `pending` and `advance`.

        Raises:
            ScenarioError: There is no such body.
        """
        row = self._body(name).row
        self.do({"drive": name})
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

    def _take_decisions(self, plans: Mapping[str, Plan]) -> None:
        """Follow plans from outside up to the next step at which a driven body has to decide."""
        for name in self.pending():
            if name not in plans:
                raise InputError(f"advance(): {name} has to decide now, and has no plan")
        for name, plan in plans.items():
            if self._body(name).row not in self._state.driven:
                raise InputError(
                    f"{name} isn't driven, it decides itself: call drive({name!r}) first"
                )
            self.do({"decide": name, "plan": data_of(plan)})
        while not self.done:
            self._run_to(self.clock.steps, spans=1)
            if self.pending():
                return

    def _body(self, name: str) -> DecidingActor:
        actors = self.actors
        if name not in actors:
            raise ScenarioError(f"there is nobody named {name!r}{suggest(name, actors)}")
        return actors[name]

    def expect(self, expectation: "Expectation | str", name: str = "") -> str:
        """Expect something from the next step on; the verdict is in the run's manifest.

        Args:
            expectation: The expectation, or its text as in a scenario.
            name: Its name; empty: its text.

        Returns:
            The name.

        Raises:
            InputError: The expectation names something unknown or an impossible event, or its time
                is beyond the run.

        Example:
            >>> import fleet2d
            >>> simulation = fleet2d.Simulation(None, "simulation.duration=4 h", seed=4)
            >>> simulation.expect("eventually(room(ana) == kitchen, within=2 h)", name="eats")
            'eats'
            >>> simulation.run_until("02:01")
            >>> simulation.verdicts()["eats"].decided
            True
        """
        if self._run is not None or self.done:
            raise InputError(
                "the run is finished: add expectations before its end, or call judge(…) on the run"
            )
        expectation = _parsed(expectation)
        self._state.settle(self.step)
        name = name or str(expectation)
        self._state.expect(self.scenario, name, expectation, self.step)
        return name

    def verdicts(self) -> "dict[str, Verdict]":
        """Return the present verdicts on all expectations, by name.

        A verdict that can't change any more is `decided`; a test may end then.
        """
        if self._state.expectations is None:
            return {}
        if self._run is None:
            self._state.settle(self.step)
        return self._state.expectations.verdicts(ended=self.done)

    def judge(self, expectation: "Expectation | str", name: str = "") -> "Verdict":
        """Return the verdict on an expectation from the step on at which it was first requested.

        Raises:
            InputError: See `expect`; or no step has been simulated since.
        """
        expectation = _parsed(expectation)
        name = name or str(expectation)
        expectations = self._state.expectations
        if expectations is None or name not in expectations.entries:
            self.expect(expectation, name)
        verdict = self.verdicts().get(name)
        if verdict is None:
            raise InputError(
                f"{name} was added after the last step, so there is nothing to judge: simulate at"
                " least one step, and call judge() again"
            )
        return verdict

    def _expect_again(self, expectations: Mapping[str, Mapping[str, Any]]) -> None:
        """Add the expectations of a stored run that are not in its scenario."""
        for name, content in expectations.items():
            if name not in self.scenario.expect:
                expectation = _parsed(content["expectation"])
                self._state.expect(self.scenario, name, expectation, content["first"])

    def __deepcopy__(self, memo: dict[int, object]) -> Self:
        """Return an independent copy of the simulation.

        Raises:
            ArtifactError: The run is stored in a directory, which can't be in two states.
        """
        if self._store.directory is not None:
            raise ArtifactError(
                f"a simulation that stores in {self._store.directory} can't be copied, because both"
                " would write there: copy a simulation that stores in memory"
            )
        from fleet2d.engine.snapshot import copy_state  # few runs are copied

        twin = self.__class__.__new__(self.__class__)
        twin.__dict__.update(self.__dict__)
        memo[id(self)] = twin
        twin._loop = copy.copy(self._loop)
        twin._take(copy_state(self._state, self._constants))
        return twin

    def __getstate__(self) -> dict[str, Any]:
        """Return the simulation for `pickle`, as another process of this user reads it."""
        from fleet2d.engine.snapshot import write_state  # few runs are copied

        self._check_savable()
        file = io.BytesIO()
        write_state(file, self._state, self._constants)
        return {"header": self._header(), "state": file.getvalue()}

    def __setstate__(self, content: dict[str, Any]) -> None:
        """Restore the simulation of another process."""
        restored = self._restored(content["header"], io.BytesIO(content["state"]))
        self.__dict__.update(restored.__dict__)

    def save(self, path: str | Path | BinaryIO) -> None:
        """Write the simulation to a file that `load` reads.

        The file is signed: only this user can load it, since it can run any code.

        Raises:
            ArtifactError: The run is stored in a directory, a component holds something that can't
                be written, such as an open file, or this user has no key.
            InputError: The run is finished or has failed.

        Example:
            >>> import io
            >>> simulation = Simulation(None, "simulation.duration=2 h", seed=4)
            >>> simulation.advance(3600)
            >>> file = io.BytesIO()
            >>> simulation.save(file)
            >>> _ = file.seek(0)
            >>> Simulation.load(file).run().digest == simulation.run().digest
            True
        """
        from fleet2d.engine.snapshot import save_snapshot  # few runs are saved

        self._check_savable()
        save_snapshot(path, self._state, self._constants, self._header(), PURPOSE)

    def _check_savable(self) -> None:
        if self._store.directory is not None:
            raise ArtifactError(
                f"a simulation that stores in {self._store.directory} can't be saved as a file:"
                " it keeps checkpoints there if artifacts.checkpoint is set; continue it by"
                " `fleet2d resume`"
            )
        self._check_not_over()

    @classmethod
    def load(cls, path: str | Path | BinaryIO) -> Self:
        """Return the simulation that `save` wrote, at its step.

        Raises:
            ArtifactError: Another user saved the file, it is damaged, or of another version of
                Fleet2D.
        """
        from fleet2d.engine.snapshot import open_snapshot  # few runs are saved

        return cls._restored(*open_snapshot(path, PURPOSE))

    @classmethod
    def _restored(cls, header: Mapping[str, Any], body: BinaryIO) -> Self:
        from fleet2d.engine.snapshot import read_state  # few runs are saved

        simulation = cls(header["scenario"], seed=header["seed"])
        simulation._take(read_state(body, simulation._constants))
        loop = simulation._loop
        simulation._setup_s, loop.simulate_s, loop.save_s = header["wall_s"]
        return simulation

    def _take(self, state: State) -> None:
        self._state = state
        self._store = state.store
        state.wait_for(state.requested)  # listeners of another run await other events

    def _header(self) -> dict[str, Any]:
        wall_s = self._wall_s
        return {
            "scenario": self.scenario.resolved(),
            "seed": self.seed,
            "wall_s": [wall_s["setup"], wall_s["simulate"] + self._loop.running_s, wall_s["save"]],
        }

    @property
    def _wall_s(self) -> dict[str, float]:
        """The wall time by phase so far [s]."""
        loop = self._loop
        return {"setup": self._setup_s, "simulate": loop.simulate_s, "save": loop.save_s}

    def _checkpoint_header(self) -> "tuple[Constants, dict[str, Any]]":
        return self._constants, {**self._header(), "manifest": self._store.manifest.content()}

    @property
    def _constants(self) -> dict[str, object]:
        """Objects that never change during the run, by name."""
        entities = {**self.scenario.users, **self.scenario.robots}
        constants: dict[str, object] = {f"entity {name}": e for name, e in entities.items()}
        constants |= {"clock": self.clock, "scenario": self.scenario, **self.home.constants}
        constants |= {f"sight of {c.owner.name}": c.method for c in self._state.cameras if c.method}
        if self._store.directory is not None:
            constants["store"] = self._store
        return constants

    def finish(self, status: Status = "complete") -> Run:
        """Close the run at the present step and return it for reading."""
        if self._run is not None:
            return self._run
        if status == "complete" and (self._loop.has_failed or not self.done):
            status = "failed" if self._loop.has_failed else "interrupted"
        began = time.perf_counter()
        if status == "interrupted" and self._keeper is not None:
            self._keeper.checkpoint(self._state)
        state = self._state
        with suppress(Exception) if status == "failed" else nullcontext():
            state.settle(self.step)
            state.events.deliver(self.step)
        # After a failure, metrics are not computed: they could fail, too, and lose the tables.
        results = {} if status == "failed" else self._measure(ended=status == "complete")
        self._loop.simulate_s += time.perf_counter() - began
        began = time.perf_counter()
        state.recorder.end(self.step, len(state.actors))
        if status != "failed":
            self._state.layers.finish(self.step)
            if self._store.root is not None and self.scenario.artifacts.learned:
                notes = self._state.learners.remember(self._store.root / LEARNED_NAME)
                self._store.manifest.notes += notes
        self._store.close_tables()
        self._loop.save_s += time.perf_counter() - began
        self._describe_end(results)
        self._store.close(status)
        self._run = open_store(self._store)
        self._run.plan = self.home.plan
        return self._run

    def _describe_start(self, interventions: list[dict[str, Any]]) -> None:
        """Set the fields of the manifest that are known before the first step."""
        manifest = self._store.manifest
        scenario = self.scenario.resolved()
        scenario["simulation"]["seed"] = self.seed
        if self.clock.zone is not None:
            scenario["simulation"]["time_zone"] = self.clock.zone.record
        manifest.scenario = scenario
        manifest.seed = self.seed
        manifest.step_us = self.clock.step_us
        manifest.start = self.clock.start.isoformat()
        users = list(self.scenario.users)
        robots = list(self.scenario.robots)
        manifest.entities = Entities(users=users, robots=robots)
        manifest.versions = versions()
        manifest.inputs = [input_record(path) for path in input_files(self.scenario)]
        manifest.interventions = interventions
        idle = [actor.path for actor in self._state.actors if not actor.behaviors]
        still = [f"{path} has no behavior: it stays where it is" for path in idle]
        manifest.notes = [*self.notes, *still]

    def _odd_moments(self) -> list[str]:
        """Return a note for each dated moment that the clock of the home reads twice, or never."""
        zone = self.clock.zone
        if zone is None:
            return []
        moments = [("simulation.start", self.scenario.simulation.start)]
        for (section, number), moment in self.scenario.moments():
            moments.append((f"{section}.{number}.at", moment))
        odd = ((where, zone.oddity(moment)) for where, moment in moments)
        return [f"{where}: {text}" for where, text in odd if text]

    def _describe_end(self, results: Mapping[str, Any]) -> None:
        """Set the fields known after the last step; tables and digest are already set."""
        manifest = self._store.manifest
        queue = self._state.interventions
        pace = self._loop.pace
        simulated_s = self.step * self.clock.step_us / 1e6
        manifest.steps = self.step
        manifest.simulated_s = simulated_s
        if self.done:
            manifest.notes += queue.unmet
        manifest.metrics = dict(results)
        manifest.wall_s = self._wall_s
        manifest.add_inputs([file for each in self._state.watchers for file in each.files])
        manifest.interventions = queue.done if self.done else queue.records
        speedup = pace.speedup_until(simulated_s) if pace else 0.0
        if pace and speedup < 0.98 * pace.speedup:
            manifest.notes.append(
                f"{SLOW} {pace.speedup:g}, but only {speedup:.0f} times real time was reached,"
                " because computing took longer"
            )

    def _measure(self, *, ended: bool) -> dict[str, Any]:
        """Return the results of the metrics, and store the verdicts on all expectations."""
        results: dict[str, Any] = {}
        state = self._state
        manifest = self._store.manifest
        if state.yielding is not None:
            manifest.notes += state.yielding.notes
        if state.log:
            state.count_looks()
            try:
                results = state.learners.finish(self.step, state.log)
            except BaseException as error:
                self._fail(error)
                raise
            manifest.notes += state.learners.idle_notes()
        if state.expectations is not None:
            manifest.expectations = state.expectations.finish(results, self._store, ended=ended)
        return results

    def _fail(self, error: BaseException) -> None:
        """Close the run as failed, so that it can be read up to the failure."""
        reason = str(error) or type(error).__name__
        self._store.manifest.notes.append(f"failed at step {self.step}: {reason}")
        with suppress(Exception):
            self.finish("failed")
        if self._store.directory is not None and self._run is not None:
            error.add_note(f"the run until then, {self.time}, is in {self._store.directory}")


def run(
    scenario: str | Path | Mapping[str, Any] | Scenario | None = None,
    *overrides: str,
    out: str | Path | None = None,
    **settings: Any,
) -> Run:
    """Run a scenario to its end.

    Args:
        scenario: A YAML file, 'bundled:NAME', a mapping or a Scenario; None: the bundled family
            scenario.
        overrides: Texts like 'simulation.duration.days=60'.
        out: Directory to store the run in; None keeps it in memory.
        settings: Keys of `simulation` or of the scenario, such as seed=4.

    Raises:
        InputError: An argument or the scenario is wrong; nothing is written then.
        ComponentError: A component failed; the run up to that step can be read.

    Example:
        >>> import fleet2d
        >>> run = fleet2d.run("bundled:paper", "simulation.duration=2 h", seed=4)
        >>> run.manifest["steps"], run.tables["trajectories"].num_rows
        (7200, 4)
    """
    simulation = Simulation(scenario, *overrides, out=out, **settings)
    finished = simulation.run()
    free_bodies(simulation._state.actors)
    return finished


def _parsed(expectation: "Expectation | str") -> "Expectation":
    from fleet2d.expectations.parse import parse_expectation

    return parse_expectation(expectation) if isinstance(expectation, str) else expectation


def flaws_of(simulation: Simulation) -> Sequence[str]:
    """Return the flaws of a home from a file; other homes have been checked."""
    if not simulation.scenario.floorplan.files():
        return ()
    from fleet2d.floorplan.checkup import errors_in  # runs don't need it

    home = simulation.home
    radii = tuple(robot.radius for robot in simulation.scenario.robots.values())
    return home.cached(("errors", radii), lambda: errors_in(home, radii))
