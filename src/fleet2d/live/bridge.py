"""A run in real time among other programs: messages are applied, and events passed on.

A message becomes an intervention at the next step, so that the manifest repeats the run. Messages
that are late, lost, wrong or too many are counted and reported, and never stop the run.
"""

import gc
import json
import math
import queue
import re
import sys
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from datetime import datetime
from functools import cached_property
from typing import Any, NamedTuple, Protocol

import shapely

from fleet2d.bounds import one_line
from fleet2d.configuration.problems import suggest
from fleet2d.engine.access import add_note, check_intervention
from fleet2d.engine.loop import deferred_interrupt
from fleet2d.engine.simulation import Simulation
from fleet2d.errors import InputError
from fleet2d.live.goals import Goals, GoalState, Sender
from fleet2d.live.library_errors import libraries_told
from fleet2d.live.messages import (
    CancelMessage,
    DetectionsMessage,
    GoalMessage,
    LiveMessage,
    PoseMessage,
    ReadingMessage,
    VelocityMessage,
    parse_message,
)
from fleet2d.runs.run import Run
from fleet2d.runtime.events import Event
from fleet2d.scenario.model import Scenario

# The last time before a step that is spent awake, as a busy machine wakes late [s], and its largest
# share of a step.
LEAD_S = 0.003
LEAD_SHARE = 0.01
# The longest time that another thread may block this one [s]: Python's 5 ms would delay steps.
SWITCH_S = 0.0005
# The silence after which a body that gets poses stands [s].
SILENCE_S = 5.0
# The age from which a message is late, and left out [s].
MAX_AGE_S = 2.0
# The largest distance of a pose or detection from a possible place; farther ones are left out [m].
REACH_M = 1.0
# The largest number of messages in a step; further ones are left out.
MAX_PER_STEP = 1000
# The number of steps whose bound of messages may wait; further ones aren't kept.
MAX_WAITING_STEPS = 10
# How many earlier messages of a step a body may get, one by one, when it refuses the last.
MAX_TRIED = 100
# The number of steps whose lateness is kept, as a run may last for months.
MAX_LATENESS = 100_000
# The largest number of reported reasons of one kind.
MAX_TOLD = 20
MAX_TEXT = 300
# The largest distance from pose to pose that feet or wheels can cover [m, m/s].
JUMP_M = 1.0
JUMP_M_PER_S = 5.0
_NUMBER = re.compile(r"[-+]?\d[\d.]*(e[-+]?\d+)?")


@dataclass(frozen=True)
class LiveStep:
    """A step of a run, with its events.

    Attributes:
        step: The step.
        time: Its local time.
        bodies: x, y [m], heading [rad], room and away of each body after the step, by name.
        events: Its events, in order, readings of sensors among them.
        rows: Its rows of other tables: pairs of the name of the table and the row.
        goals: The goals that are under way, and those that have just begun or ended.
    """

    step: int
    time: datetime
    bodies: Mapping[str, Mapping[str, Any]]
    events: Sequence[Event]
    rows: Sequence[tuple[str, Mapping[str, Any]]] = ()
    goals: Sequence[GoalState] = ()

    @cached_property
    def messages(self) -> list[dict[str, Any]]:
        """The frame as JSON objects: one of poses, one for each event and row."""
        stamp = {"step": self.step, "time": self.time.isoformat()}
        poses = {"type": "poses", **stamp, "bodies": self.bodies}
        events = [{"type": "event", **e._asdict(), "event": str(e.event)} for e in self.events]
        rows = [{"type": "row", "table": table, "row": row} for table, row in self.rows]
        goals = [stamp | goal.message() for goal in self.goals]
        return [poses, *events, *rows, *goals]

    @cached_property
    def texts(self) -> list[str]:
        """The messages as JSON."""
        return [json.dumps(message, default=str) for message in self.messages]


class PeerFault(NamedTuple):
    """A fault that a peer noticed, in a message or of a client.

    Attributes:
        kind: The name under which it is counted, such as "wrong" or "slow clients".
        text: A line that says what is wrong.
        is_message: Whether it stands for a message.
    """

    kind: str
    text: str
    is_message: bool = False


Content = str | bytes | Mapping[str, Any] | PeerFault | None


class Post(Protocol):
    """Receives messages to a run, from any thread."""

    def __call__(self, content: Content, client: int = 0) -> None:
        """Receive a message.

        Args:
            content: The message; None: the client is gone, and its goals end; a fault is counted
                and reported.
            client: The number of the client of a peer that sent it; each counts its own messages.
        """


def lose(post: Post, address: str) -> None:
    """Tell a run that a server is gone, which ends all its goals."""
    post(None)
    post(PeerFault("lost connections", f"{address}: the connection is tried again"))


def missing(address: str, server: str) -> PeerFault:
    """Return the fault of a server that isn't there yet when a run begins."""
    return PeerFault("lost connections", f"{address}: there is no {server} yet; it is tried again")


class Peer:
    """Another program, or a function: it may send messages to a run, and hear of it.

    Methods that a peer leaves out do nothing.

    Attributes:
        fastest: The largest speed [times real time] that it follows; a faster run is reported.
    """

    fastest: float = math.inf

    def open(self, simulation: Simulation, post: Post) -> None:
        """Connect, before the first step."""

    def send(self, frame: LiveStep) -> None:
        """Pass on a step, without waiting."""

    def tell(self, text: str) -> None:
        """Pass on a note about messages."""

    def close(self, run: Run) -> None:
        """Disconnect, after the last step."""


def sources_of(scenario: Scenario) -> dict[tuple[str, str], str]:
    """Return the addresses from which parts of a scenario take messages.

    The keys are the kind of part and its name: ("body", "ana"), ("perceives", "astro"), ("sensor",
    "front_door").

    Example:
        >>> from fleet2d.scenario.load import load_scenario
        >>> changes = "users.ana={type: live, source: 'udp://127.0.0.1:9000'}"
        >>> sources_of(load_scenario(None, changes))
        {('body', 'ana'): 'udp://127.0.0.1:9000'}
    """
    sources = {
        ("body", name): source
        for name, entity in {**scenario.users, **scenario.robots}.items()
        for behavior in entity.behaviors
        if (source := getattr(behavior, "source", None)) and behavior.type_name == "live"
    }
    for name, robot in scenario.robots.items():
        if robot.perceives is not None and robot.perceives.type_name == "live":
            sources["perceives", name] = getattr(robot.perceives, "source", None)
    for name, item in scenario.objects.items():
        if item.type_name == "live_sensor":
            sources["sensor", name] = getattr(item, "source", None)
    return {key: source for key, source in sources.items() if source is not None}


@dataclass
class Bridge:
    """A simulation in real time, among other programs.

    Attributes:
        simulation: The simulation; it runs as fast as `speed` says, whatever its own speedup.
        peers: The other programs; by their addresses, if the scenario names some as sources.
        speed: Times real time; 0: as fast as it can, for tests.
        silence_s: The silence after which a body that gets poses stands, with a note [s].
        max_age_s: The age from which a message is left out [s].
        max_per_step: The largest number of messages in a step; further ones are left out.
        keeps_goals: Whether goals of a client that is gone stay; else they are withdrawn, and the
            body does what its behaviors decide: one of the type `live` stands.
        rows: Whether rows of tables are passed on, besides poses and events.
        tell: Called with notes about messages.
        counts: The numbers of messages that were received, applied, late, lost, wrong, replaced or
            too many, and of other faults.
        lateness_s: The lateness of each of the last steps [s], at most MAX_LATENESS of them.

    Example:
        >>> from fleet2d.live import to_function
        >>> simulation = Simulation(None, "simulation.duration=3 s", seed=4)
        >>> steps = []
        >>> run = Bridge(simulation, [to_function(lambda frame: steps.append(frame.step))], 0).run()
        >>> steps
        [0, 1, 2]
    """

    simulation: Simulation
    peers: Sequence[Peer] | Mapping[str, Peer]
    speed: float = 1.0
    silence_s: float = SILENCE_S
    max_age_s: float = MAX_AGE_S
    max_per_step: int = MAX_PER_STEP
    keeps_goals: bool = False
    rows: bool = True
    tell: Callable[[str], object] = str
    counts: Counter[str] = field(default_factory=Counter)
    lateness_s: deque[float] = field(default_factory=lambda: deque(maxlen=MAX_LATENESS))

    def __post_init__(self) -> None:
        """Check the sources; no message has arrived.

        Raises:
            InputError: The scenario names a source that isn't among the peers.
        """
        named = self.peers if isinstance(self.peers, Mapping) else {}
        self._peers = list(self.peers.values() if isinstance(self.peers, Mapping) else self.peers)
        numbers = {address: number for number, address in enumerate(named)}
        self._sources: dict[tuple[str, str], int] = {}
        for (kind, name), address in sources_of(self.simulation.scenario).items():
            if address not in numbers:
                raise InputError(
                    f"{name} takes messages of {address}, which isn't among the peers: open them by"
                    " fleet2d.live.open_peers(scenario)"
                )
            self._sources[kind, name] = numbers[address]
        self._lock = threading.Lock()
        self._dropped = 0
        self._goals = Goals(self.simulation)
        self._inbox: queue.SimpleQueue[tuple[float, Sender, Any]] = queue.SimpleQueue()
        self._events: list[Event] = []
        self._rows: list[tuple[str, Mapping[str, Any]]] = []
        self._heard: dict[str, float] = {}  # when the last pose of each body arrived [s]
        self._standing: set[str] = set()  # the bodies without a recent pose
        self._numbers: dict[Sender, int] = {}
        self._told: Counter[str] = Counter()
        self._first: dict[tuple[str, str], str] = {}  # the first text of each kind and reason
        self._reasons: Counter[tuple[str, str]] = Counter()  # counts by kind and first text
        self._times: dict[tuple[Sender, tuple[str, str]], float] = {}  # the last time of each part
        self._poses: dict[str, tuple[Sender, int, float, float]] = {}  # last step, x, y
        self._names = {*self.simulation.actors, *self.simulation.scenario.objects}
        self._later: dict[str, tuple[LiveMessage, Sender]] = {}  # readings for the next step
        self._is_stopping = False

    def run(self) -> Run:
        """Simulate to the end, or to the step of Ctrl-C, and return the run."""
        with libraries_told(lambda text: self._post_of(-1)(PeerFault("errors", text))):
            return self._run()

    def _run(self) -> Run:
        simulation = self.simulation
        simulation.listen(self._events.extend)
        if self.rows:
            simulation.listen_rows(self._hear)
        for number, peer in enumerate(self._peers):
            peer.open(simulation, self._post_of(number))
        fastest = min((getattr(peer, "fastest", math.inf) for peer in self._peers), default=1.0)
        if (self.speed or math.inf) > fastest:
            self._say("fast", f"at more than {fastest:g} times real time, timers of ROS skip")
        try:
            with suppress(KeyboardInterrupt), _prompt_threads():
                self._simulate()
        finally:
            if self._later:
                self._count("lost", "readings that were left for a next step", len(self._later))
            for note in self.notes():
                add_note(simulation, note)
            run = simulation.finish()
            for peer in self._peers:
                peer.close(run)
        return run

    def _hear(self, table: str, row: Mapping[str, Any]) -> None:
        if table != "events":  # events are heard in order
            self._rows.append((table, row))

    def notes(self) -> list[str]:
        """Return lines about the messages of the run."""
        words = [f"{self.counts[key]} {key}" for key in sorted(self.counts) if key != "received"]
        if not words:
            return []
        received = self.counts["received"]
        return [
            f"live: {received} messages were received: {', '.join(words)}",
            *(f"live: {count} {kind}: {text}" for (kind, text), count in self._reasons.items()),
        ]

    def _post_of(self, number: int) -> Post:
        def post(content: Content, client: int = 0) -> None:
            waiting = self._inbox.qsize()
            if content is not None and waiting >= MAX_WAITING_STEPS * self.max_per_step:
                with self._lock:
                    self._dropped += 1
                return
            self._inbox.put((time.time(), (number, client), content))

        return post

    def _simulate(self) -> None:
        simulation = self.simulation
        step_s = simulation.clock.step_us / 1e6
        began = time.monotonic()
        first = simulation.step
        while not simulation.done:
            if self.speed:
                due = began + (simulation.step - first) * step_s / self.speed
                _wait(due, min(LEAD_S, LEAD_SHARE * step_s / self.speed))
                self.lateness_s.append(time.monotonic() - due)
            self._apply(self._one_reading_each(self._received()))
            self._stop_silent_bodies()
            with deferred_interrupt(self._stop):  # half a step could not be stored
                simulation.advance()
            self._send()
            if self._is_stopping:
                return
            if self.speed:
                gc.collect()  # so that it isn't due within a step

    def _stop(self) -> None:
        self._is_stopping = True

    def _received(self) -> list[tuple[LiveMessage | None, Sender]]:
        """Return the messages for the present step with their senders; None: the sender is gone."""
        received: list[tuple[LiveMessage | None, Sender]] = []
        orders: set[tuple[str, str]] = set()
        others = 0
        with self._lock:
            dropped = self._dropped
            self._dropped = 0
        if dropped:
            self.counts["received"] += dropped
            self.counts["too many"] += dropped
        for _ in range(self._inbox.qsize()):
            arrived, sender, content = self._inbox.get()
            if content is None:
                received.append((None, sender))
                continue
            message = self._read(content, others + len(orders) >= self.max_per_step)
            if message is None or not self._is_timely(message, arrived, sender):
                continue
            try:
                self._check(message, sender)
            except InputError as error:
                self._refuse(message, sender, str(error))
                continue
            received.append((message, sender))
            key = _order_of(message)
            if key is None:
                others += 1
            else:
                orders.add(key)
        return received

    def _one_reading_each(
        self, received: Sequence[tuple[LiveMessage | None, Sender]]
    ) -> list[tuple[LiveMessage | None, Sender]]:
        """Return messages without readings that turn a sensor back within the step.

        The last of these waits for the next step, so that a pulse shorter than a step is seen.
        """
        now: list[tuple[LiveMessage | None, Sender]] = []
        shown: dict[str, bool] = {}
        waiting = [*self._later.values(), *received]
        self._later.clear()
        for message, sender in waiting:
            if not isinstance(message, ReadingMessage):
                now.append((message, sender))
            elif message.sensor in self._later:
                self.counts["replaced"] += 1
                self._later[message.sensor] = message, sender
            elif message.on == shown.setdefault(message.sensor, message.on):
                now.append((message, sender))
            else:
                self._later[message.sensor] = message, sender
        return now

    def _read(self, content: Any, is_full: bool) -> LiveMessage | None:
        """Return a message; None if there is none in the content, or no room for it."""
        is_fault = isinstance(content, PeerFault)
        if not is_fault or content.is_message:
            self.counts["received"] += 1
        if is_fault:
            self._count(content.kind, content.text)
        elif is_full:
            self._count("too many", f"more than {self.max_per_step} messages in a step")
        else:
            try:
                return parse_message(content)
            except InputError as error:
                self._count("wrong", str(error))
        return None

    def _is_timely(self, message: LiveMessage, arrived: float, sender: Sender) -> bool:
        """Return whether a message is neither late nor out of order, and count lost ones."""
        if message.time is not None:
            age = arrived - message.time
            if age > self.max_age_s:
                self._count("late", f"a message was sent {age:.1f} s ago by its clock")
                return False
            if age < -self.max_age_s:
                self._count("late", f"a message is dated {-age:.1f} s ahead of this clock")
                return False
            key = sender, _part_of(message)
            if message.time < self._times.get(key, message.time):
                self._count("late", f"{key[1][1]}: a message was sent before the last one")
                return False
            if key[1][1] in self._names:
                self._times[key] = message.time
        if message.number is not None:
            expected = self._numbers.get(sender, -1) + 1
            if message.number < expected:
                self._count("late", f"message {message.number} after {expected - 1}")
                return False
            if expected and message.number > expected:
                lost = message.number - expected
                self._count("lost", f"{lost} messages before number {message.number}", lost)
            self._numbers[sender] = message.number
        return True

    def _apply(self, received: Sequence[tuple[LiveMessage | None, Sender]]) -> None:
        """Apply messages in the order in which they arrived."""
        for message, sender in self._last_of(received):
            if message is None:
                self._withdraw(sender)
                continue
            try:
                self._check_goal(message)
                for act in _acts_of(message):
                    self.simulation.do(act)
            except InputError as error:
                self._refuse(message, sender, str(error))
                continue
            self.counts["applied"] += 1
            self._take_note(message, sender)

    def _last_of(
        self, received: Sequence[tuple[LiveMessage | None, Sender]]
    ) -> list[tuple[LiveMessage | None, Sender]]:
        """Return the messages of a step that count: the last pose, goal and velocity of each body.

        A message that can't be applied replaces none.
        """
        counting: list[tuple[LiveMessage | None, Sender]] = []
        last: dict[tuple[str, str] | None, Sender] = {}
        refused: Counter[tuple[str, str]] = Counter()
        for message, sender in reversed(received):
            if message is None:
                counting.append((None, sender))
                continue
            key = _order_of(message)
            later = last.get(
                ("goal", message.entity) if isinstance(message, CancelMessage) else key
            )
            if later is not None:
                self._replace(message, sender, later)
                continue
            try:
                mended = self._corrected(message)
                if key is not None:
                    for act in _acts_of(mended):
                        check_intervention(self.simulation, act)
            except InputError as error:
                self._refuse(message, sender, str(error))
                if key is not None:
                    refused[key] += 1
                    if refused[key] == MAX_TRIED:
                        last[key] = sender
                continue
            counting.append((mended, sender))
            if key is not None:
                last[key] = sender
        return counting[::-1]

    def _replace(self, message: LiveMessage, sender: Sender, later: Sender) -> None:
        """Count a message that a later one replaces, and report two programs that send poses."""
        self.counts["replaced"] += 1
        if isinstance(message, GoalMessage):
            self._goals.refuse(message, sender, "another goal came at once")
        elif isinstance(message, PoseMessage) and sender != later:
            self._report_two_senders(message.entity)

    def _refuse(self, message: LiveMessage, sender: Sender, reason: str) -> None:
        self._count("wrong", reason)
        if isinstance(message, GoalMessage):
            self._goals.refuse(message, sender, reason)

    def _take_note(self, message: LiveMessage, sender: Sender) -> None:
        """Keep track of goals and of poses that are expected, after a message was applied."""
        if isinstance(message, GoalMessage):
            self._goals.accept(message, sender)
        elif isinstance(message, CancelMessage):
            self._goals.cancel(message.entity, "its sender withdrew it")
        elif isinstance(message, VelocityMessage):
            self._goals.cancel(message.entity, "the robot is steered")
        elif isinstance(message, PoseMessage):
            self._goals.cancel(message.entity, "a pose arrived")
            self._compare(message, sender)
            self._heard[message.entity] = time.monotonic()
            if message.entity in self._standing:
                self._standing.remove(message.entity)
                self._say("back", f"{message.entity}: poses arrive again")
        if isinstance(message, GoalMessage | VelocityMessage):
            self._heard.pop(message.entity, None)  # no more poses are expected

    def _compare(self, pose: PoseMessage, sender: Sender) -> None:
        """Report a pose that can't follow from the previous one."""
        name = pose.entity
        step = self.simulation.step
        before, last, x, y = self._poses.get(name, (sender, step, pose.x, pose.y))
        self._poses[name] = sender, step, pose.x, pose.y
        passed_s = (step - last) * self.simulation.clock.step_us / 1e6
        off = math.hypot(pose.x - x, pose.y - y)
        is_recent = time.monotonic() - self._heard.get(name, -math.inf) < self.silence_s
        if before != sender and is_recent:
            self._report_two_senders(name)
        if off > JUMP_M + JUMP_M_PER_S * passed_s:
            jump = f"a pose is {off:.1f} m from the one {passed_s:g} s before"
            self._count("jumps", f"{name}: {jump}")

    def _report_two_senders(self, name: str) -> None:
        self._count("of two senders", f"{name}: poses of two programs arrive: name its source")

    def _check(self, message: LiveMessage, sender: Sender) -> None:
        """Refuse messages from other senders than the source, and poses of bodies not `live`."""
        kind, name = _part_of(message)
        if self._sources.get((kind, name), sender[0]) != sender[0]:
            raise InputError(f"{name} takes messages of its source only, not of others")
        if not isinstance(message, PoseMessage):
            return
        actors = self.simulation.actors
        if message.entity not in actors:
            raise InputError(
                f"there is nobody named {message.entity!r}{suggest(message.entity, actors)}"
            )
        if all(behavior.type_name != "live" for behavior in actors[message.entity].behaviors):
            raise InputError(
                f"{message.entity} decides itself where it goes: only a body with the behavior live"
                " gets poses"
            )

    def _check_goal(self, message: LiveMessage) -> None:
        """Refuse to cancel a goal that a body doesn't have."""
        if isinstance(message, CancelMessage) and not self._goals.has(message.entity, message.id):
            name = f" {message.id!r}" if message.id else ""
            raise InputError(f"{message.entity} has no goal{name}")

    def _corrected(self, message: LiveMessage) -> LiveMessage:
        """Return a message with its pose or detections moved to possible places nearby.

        Raises:
            InputError: The pose is farther than REACH_M from any possible place.
        """
        if isinstance(message, PoseMessage):
            actor = self.simulation.actors[message.entity]
            lattice = actor.home.plan.lattice
            place = lattice.point_at((message.x, message.y))
            near = None if actor.space.part_at(*place) >= 0 else actor.space.nearest(*place)
            if near is None:
                return message
            x, y = lattice.to_metres(near).tolist()
            off = math.hypot(x - message.x, y - message.y)
            if off > REACH_M:
                in_mm = lattice.point_at((message.x / 1000, message.y / 1000))
                fits = actor.space.part_at(*in_mm) >= 0
                advice = "in millimetres they would" if fits else "do they fit the floor plan?"
                raise InputError(
                    f"{message.entity} would be {off:.1f} m from any place where its body fits by"
                    f" its coordinates: {advice}"
                )
            self._count("moved", f"{message.entity}: a pose in or at a wall, by {off:.2f} m")
            return message.model_copy(update={"x": x, "y": y})
        if isinstance(message, DetectionsMessage):
            robot = self.simulation.scenario.robots.get(message.entity)
            if robot is None or robot.perceives is None or robot.perceives.relative:
                return message
            free = self.simulation.home.plan.free_space
            inside = []
            far = []
            for each in message.detections:
                far.append(float(free.distance(shapely.Point(each.x, each.y))))
                if far[-1] <= REACH_M:
                    inside.append(each)
            if outside := len(far) - len(inside):
                text = f"detections are outside of the home, by up to {max(far):.1f} m: left out"
                self._count("outside", f"{message.entity}: {text}", outside)
            return message.model_copy(update={"detections": tuple(inside)})
        return message

    def _stop_silent_bodies(self) -> None:
        """Let bodies stand whose poses have stopped."""
        now = time.monotonic()
        for name, heard in self._heard.items():
            if name not in self._standing and now - heard > self.silence_s:
                self._standing.add(name)
                self.counts["silences"] += 1
                self._say("silent", f"{name}: no pose arrived for {self.silence_s:g} s: it stands")
                self.simulation.do({"hold": name})

    def _withdraw(self, sender: Sender) -> None:
        """Let bodies decide again whose goals came from a client that is gone."""
        for goal in () if self.keeps_goals else self._goals.of(sender):
            name = goal.entity
            self._goals.cancel(name, "its sender is gone")
            self.counts["withdrawn"] += 1
            self._say("gone", f"{name}: who sent it to {goal.to} is gone: the goal is withdrawn")
            self.simulation.do({"release": name})

    def _count(self, kind: str, text: str, count: int = 1) -> None:
        """Count a fault, and report it once for each reason, whatever the numbers in it."""
        self.counts[kind] += count
        text = one_line(text, MAX_TEXT)
        reason = kind, _NUMBER.sub("0", text)
        if reason not in self._first:
            if self._told[kind] >= MAX_TOLD:
                return
            self._first[reason] = text
            self._say(kind, f"{kind}: {text}")
        self._reasons[kind, self._first[reason]] += count

    def _say(self, kind: str, text: str) -> None:
        """Report a note; of many of one kind, only the first."""
        self._told[kind] += 1
        if self._told[kind] > MAX_TOLD:
            return
        for tell in (self.tell, *(peer.tell for peer in self._peers)):
            tell(text)

    def _send(self) -> None:
        simulation = self.simulation
        bodies = {n: s for n, s in simulation.state.items() if "heading" in s}
        step = simulation.step - 1
        news = self._events[:], self._rows[:], self._goals.take_news(self._events)
        frame = LiveStep(step, simulation.clock.time(step), bodies, *news)
        self._events.clear()
        self._rows.clear()
        for peer in self._peers:
            peer.send(frame)


def _wait(until: float, lead_s: float) -> None:
    """Wait until a time of the machine's clock, the last `lead_s` of it awake."""
    while (ahead := until - time.monotonic()) > 0:
        if ahead > lead_s:
            time.sleep(min(ahead - lead_s, 0.1))


@contextmanager
def _prompt_threads() -> Iterator[None]:
    """Let neither other threads nor garbage collection hold this one up for long."""
    interval = sys.getswitchinterval()
    was_enabled = gc.isenabled()
    sys.setswitchinterval(SWITCH_S)
    gc.collect()
    gc.freeze()  # a collection of existing objects would take 0.1 s
    gc.disable()
    try:
        yield
    finally:
        sys.setswitchinterval(interval)
        gc.unfreeze()
        if was_enabled:
            gc.enable()


def _part_of(message: LiveMessage) -> tuple[str, str]:
    """Return the kind and name of the part of a scenario that a message is for."""
    if isinstance(message, ReadingMessage):
        return "sensor", message.sensor
    kind = "perceives" if isinstance(message, DetectionsMessage) else "body"
    name: str = message.entity  # type: ignore[attr-defined]
    return kind, name


def _order_of(message: LiveMessage) -> tuple[str, str] | None:
    """Return the type and body of a message if only the last such message of a step counts."""
    if isinstance(message, PoseMessage | GoalMessage | VelocityMessage):
        return message.type, message.entity
    return None


def _heading_of(message: PoseMessage | GoalMessage) -> dict[str, float]:
    return {} if message.heading_deg is None else {"heading_deg": message.heading_deg}


def _acts_of(message: LiveMessage) -> Iterator[dict[str, Any]]:
    """Yield the interventions of a message."""
    if isinstance(message, PoseMessage):
        yield {"put": message.entity, "to": [message.x, message.y], **_heading_of(message)}
    elif isinstance(message, GoalMessage):
        to = message.to if isinstance(message.to, str) else list(message.to)
        yield {"send": message.entity, "to": to, **_heading_of(message)}
    elif isinstance(message, CancelMessage):
        yield {"release": message.entity}
    elif isinstance(message, VelocityMessage):
        velocity = message.model_dump(include={"forward", "left", "turn_deg"})
        yield {"steer": message.entity, **velocity}
    elif isinstance(message, DetectionsMessage):
        if message.detections:
            detections = [d.model_dump() for d in message.detections]
            yield {"perceive": message.entity, "detections": detections}
    elif isinstance(message, ReadingMessage):
        yield {"report": message.sensor, "says": "on" if message.on else "off"}
