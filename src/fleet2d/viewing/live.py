"""A running simulation as the page watches and controls it.

This is the only module of the viewer that reads and changes the state of a simulation.
"""

import queue
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from fleet2d.algorithms.algorithm import RoomDistribution
from fleet2d.algorithms.presence.belief import Presence
from fleet2d.configuration.documents import parse_yaml
from fleet2d.configuration.trust import running_code
from fleet2d.engine.access import interventions_of, may_run_code
from fleet2d.engine.simulation import Simulation
from fleet2d.entities.body import Track
from fleet2d.entities.decisions import DecidingActor
from fleet2d.errors import Fleet2DError, InputError, PlacementError
from fleet2d.interventions import Configure, HoldStill, OpenDoor, Put, Replan, Send, ShutDoor
from fleet2d.kernels import TURN, Mesh
from fleet2d.runs.run import Run
from fleet2d.runtime.clock import DAY_S
from fleet2d.runtime.events import EventKind
from fleet2d.viewing.contract import LiveBody, LiveEvent, LiveFrame, LiveOrder
from fleet2d.viewing.run_facts import intervention_marks, slow_floors_of

AHEAD_US = 120_000_000
MAX_CORNERS = 60


class LiveEngine:
    """A running simulation.

    A body that a page has called stays where it was last called or placed, until the next call.
    Watching has no effect on the run: its artifacts are the same, watched or not.
    """

    def __init__(self, simulation: Simulation) -> None:
        """Take over a simulation: nothing else may advance it."""
        self.simulation = simulation
        self._events_until = simulation.step
        self._walls: dict[Mesh, int] = {}
        self._called: set[str] = set()
        self._recorded = len(interventions_of(simulation))

    def bodies(self) -> list[LiveBody]:
        """Return the poses of all users and robots, and their paths ahead."""
        return [self._body(name, actor) for name, actor in self.simulation.actors.items()]

    def _body(self, name: str, actor: DecidingActor) -> LiveBody:
        behavior, reason = actor.reason()
        return LiveBody(
            name=name,
            x=int(actor.state.x),
            y=int(actor.state.y),
            heading=int(actor.state.heading) % TURN,
            away=bool(actor.state.away),
            ahead=self._path_ahead(actor),
            behavior=behavior,
            reason=reason,
            decides=-1 if actor.asked_at is None else actor.asked_at,
        )

    def _path_ahead(self, actor: Any) -> list[tuple[int, int, int]]:
        """Return the corners of the path ahead: time [us], x and y [lattice]."""
        if not isinstance(actor.motion, Track):
            return []
        now_us = self.simulation.step * self.simulation.clock.step_us
        track = actor.motion.breakpoints
        ends_us = [now_us, now_us + AHEAD_US]
        first, end = np.searchsorted(track.time, ends_us, side="right").tolist()
        part = slice(first, min(end, first + MAX_CORNERS))
        columns = (track.time[part].tolist(), track.x[part].tolist(), track.y[part].tolist())
        return list(zip(*columns, strict=True))

    def in_view(self) -> list[tuple[str, str]]:
        """Return (robot, user) pairs: the users that each robot has in view."""
        robots = self.simulation.scenario.robots
        return [
            (name, user)
            for name, actor in self.simulation.actors.items()
            if name in robots
            for user in actor.in_view()
        ]

    def doors(self) -> dict[str, bool]:
        """Return whether each door is open, by name."""
        state = self.simulation.state
        return {name: bool(entry["open"]) for name, entry in state.items() if "open" in entry}

    def beliefs(self) -> dict[str, dict[str, list[float]]]:
        """Return the newest shares of rooms, and last of away, of algorithms by name and user."""
        beliefs = {}
        for name, output in self.simulation.outputs.items():
            if isinstance(output, Presence):
                beliefs[name] = {user: output.with_away(user).tolist() for user in output.names}
            elif isinstance(output, RoomDistribution):
                shares = np.append(output.share, 0.0).tolist()
                beliefs[name] = dict.fromkeys(self.simulation.scenario.users, shares)
        return beliefs

    def events(self) -> list[LiveEvent]:
        """Return the events since the last call."""
        users = self.simulation.scenario.users
        recorded = self.simulation.events(self._events_until)
        self._events_until = self.simulation.step
        return [
            LiveEvent(
                step=event.step,
                entity=event.entity,
                event=str(event.event),
                user=event.detail if event.detail in users else "",
                detail="" if event.detail in users else event.detail,
            )
            for event in recorded
            if event.step < self._events_until and event.event != EventKind.SENSOR
        ]

    def interventions(self) -> list[dict[str, Any]]:
        """Return the records of the interventions since the last call."""
        records = interventions_of(self.simulation)[self._recorded :]
        self._recorded += len(records)
        return records

    def walls(self) -> int:
        """Return the id of the present set of walls, for `mesh`."""
        return self._walls.setdefault(self.simulation.home.walls, len(self._walls))

    def mesh(self, number: int) -> Mesh:
        """Return a set of walls by its id.

        Raises:
            InputError: There is no such set of walls.
        """
        if not 0 <= number < len(self._walls):
            raise InputError(f"there is no set of walls with id {number}")
        return list(self._walls)[number]

    def apply(self, order: LiveOrder) -> None:
        """Apply an intervention; the manifest records it, and `reproduce` repeats it.

        Raises:
            InputError: There is nothing of that name, or the place isn't free.
            ComponentError: There is no door of that name, or it can't be moved.
        """
        name = order["target"]
        place = (order["x"], order["y"])
        if order["action"] == "door":
            self.simulation.do(OpenDoor(name) if order["value"] else ShutDoor(name))
        elif order["action"] == "place":
            self.simulation.do(Put(name, self._free_place(name, place)))
            if name in self._called:
                self.simulation.do(HoldStill(name))
        elif order["action"] == "call":
            self.simulation.do(Send(name, self._free_place(name, place)))
            self._called.add(name)
        elif order["action"] == "replan":
            self.simulation.do(Replan(name))
        elif order["action"] == "configure":
            behavior, _, key = order["key"].partition(".")
            value = parse_yaml(order["text"], Path(), "the value")
            self.simulation.do(Configure(name, behavior, {key: value}))
        else:
            raise InputError(f"there is no intervention {order['action']!r}")

    def _free_place(self, name: str, place: tuple[float, float]) -> tuple[float, float]:
        """Return the free place for a body that is nearest to a point [m].

        Raises:
            InputError: There is nobody of that name.
            PlacementError: There is no free place nearby.
        """
        actors = self.simulation.actors
        if name not in actors:
            raise InputError(f"there is nobody named {name!r}")
        space = actors[name].space
        lattice = self.simulation.home.plan.lattice
        at = lattice.point_at(place)
        part = space.part_at(*at)
        if part < 0:
            part = space.part_near(*at)
        near = space.nearest(*at, part) if part >= 0 else None
        if near is None:
            raise PlacementError(
                f"{name} can't be at ({place[0]:g}, {place[1]:g}) m, nor is there free floor near:"
                " choose a point in a room"
            )
        x, y = lattice.to_metres(near).tolist()
        return x, y


FRAME_US = 60_000_000  # maximum simulated time between two frames
FRAMES_PER_S = 30  # if a speed is chosen
BATCHES_PER_S = 30
MAX_QUEUED = 4_000  # frames in the queue of a page
ORDER_WAIT_S = 10.0
IDLE_S = 0.1
FRAME_WAIT_S = 0.5  # less than the server waits for open responses when it ends
OVER = "the run is over: it can't be changed any more"


class LiveRun:
    """A simulation that runs in a thread of its own while pages watch and control it.

    Attributes:
        engine: The simulation.
        run: The run once it is finished.
        failure: The exception that ended the simulation; None if there is none.
        serve: Serves the run when it is over, and returns its number.
    """

    def __init__(self, simulation: Simulation, *, paused: bool = False) -> None:
        """Prepare the thread; `start` starts it.

        Args:
            simulation: The simulation.
            paused: Whether it waits for the page to resume it.
        """
        self.engine = LiveEngine(simulation)
        self.run: Run | None = None
        self.failure: BaseException | None = None
        self.serve: Callable[[Run], int] = lambda _: -1
        self._clock = simulation.clock
        self._paused = paused
        self._speed = 0.0  # simulated time over wall time; 0: as fast as it goes
        self._achieved = 0.0
        self._orders: queue.Queue[tuple[LiveOrder, queue.Queue[str]]] = queue.Queue()
        self._watchers: list[queue.Queue[LiveFrame]] = []
        self._lock = threading.Lock()
        self._is_ending = self._streams_end = False
        self._frame = self._state()
        self._thread = threading.Thread(target=self._run_loop, daemon=True, name="fleet2d-live")

    def start(self) -> None:
        """Start the simulation."""
        self._thread.start()

    def end(self) -> None:
        """Stop the simulation at its current step, and close the run."""
        self._is_ending = True
        self._thread.join(timeout=60)

    def wait(self) -> None:
        """Wait until the simulation is over."""
        self._thread.join()

    def submit(self, order: LiveOrder) -> str:
        """Apply an order in the thread of the simulation; return why it is refused, or nothing."""
        answer: queue.Queue[str] = queue.Queue()
        if self.run is not None:
            return OVER
        self._orders.put((order, answer))
        try:
            return answer.get(timeout=ORDER_WAIT_S)
        except queue.Empty:
            return "the simulation does not answer" if self._thread.is_alive() else OVER

    def _run_loop(self) -> None:
        """Advance the simulation and apply orders until the end; this is the thread."""
        try:
            while not self._is_ending and not self.engine.simulation.done:
                self._apply_orders(IDLE_S if self._paused else 0.0)
                if not self._paused:
                    self._advance()
        except BaseException as error:  # noqa: BLE001 - shown on the page and raised by the command
            self.failure = error
            self._frame = {**self._frame, "message": f"the simulation failed: {error}"}
        finally:
            self.run = self.engine.simulation.finish()
            self._frame = {**self._frame_without_events(), "served_as": self.serve(self.run)}
            self._send(self._frame)

    def _advance(self) -> None:
        """Advance the simulation by a frame, send the frame, and wait as the speed requires."""
        start_s = time.perf_counter()
        step = self.engine.simulation.step
        self.engine.simulation.advance(self._steps_per_frame())
        self._send(self._state())
        simulated_s = (self.engine.simulation.step - step) * self._clock.step_us / 1e6
        if self._speed:
            wait_s = simulated_s / self._speed - (time.perf_counter() - start_s)
            if wait_s > 0:
                self._apply_orders(wait_s)
        wall_s = max(time.perf_counter() - start_s, 1e-9)
        self._achieved = 0.9 * self._achieved + 0.1 * simulated_s / wall_s

    def _steps_per_frame(self) -> int:
        us = FRAME_US
        if self._speed:
            us = min(us, round(self._speed * 1e6 / FRAMES_PER_S))
        return max(1, us // self._clock.step_us)

    def _apply_orders(self, seconds: float) -> None:
        """Apply the orders of pages; wait for more for some wall time [s]."""
        deadline = time.perf_counter() + seconds
        while not self._is_ending:
            wait_s = deadline - time.perf_counter()
            try:
                order, answer = self._orders.get(timeout=max(0.0, wait_s))
            except queue.Empty:
                return
            try:
                self._apply(order)
                answer.put("")
            except (Fleet2DError, ValueError) as error:
                answer.put(str(error))
            self._send(self._state())

    def _apply(self, order: LiveOrder) -> None:
        action = order["action"]
        if action in ("pause", "resume"):
            self._paused = action == "pause"
        elif action == "end":
            self._is_ending = True
        elif action == "speed":
            if not 0 <= order["value"] <= 1e6:
                raise InputError("a speed is 0 (as fast as it goes) to 1,000,000 times real time")
            self._speed = order["value"]
        elif self.engine.simulation.done:
            raise InputError(OVER)
        elif action == "step":
            self._paused = True
            self.engine.simulation.advance(max(1, min(DAY_S, round(order["value"]))))
        else:
            with running_code(allowed=may_run_code(self.engine.simulation)):
                self.engine.apply(order)

    def _state(self) -> LiveFrame:
        """Return the frame of the current step, with events and marks since the last frame."""
        engine = self.engine
        records = engine.interventions()
        self._frame = LiveFrame(
            step=engine.simulation.step,
            paused=self._paused,
            done=engine.simulation.done,
            speed=self._speed,
            achieved=self._achieved,
            bodies=engine.bodies(),
            seen=engine.in_view(),
            doors=engine.doors(),
            beliefs=engine.beliefs(),
            events=engine.events(),
            marks=intervention_marks(records),
            slows=slow_floors_of(records, self._clock),
            walls=engine.walls(),
            message="",
            served_as=-1,
        )
        return self._frame

    def _frame_without_events(self) -> LiveFrame:
        return {**self._frame, "events": [], "marks": [], "slows": []}

    def _send(self, frame: LiveFrame) -> None:
        with self._lock:
            for watcher in self._watchers:
                if watcher.qsize() < MAX_QUEUED:
                    watcher.put(frame)

    def frames(self) -> Iterator[list[LiveFrame]]:
        """Yield the frames of the run from now on, in batches, which are empty without news."""
        watcher: queue.Queue[LiveFrame] = queue.Queue()
        with self._lock:
            self._watchers.append(watcher)
            watcher.put(self._frame_without_events())
        try:
            while not (self._is_ending or self._streams_end):
                frames = []
                with suppress(queue.Empty):
                    frames.append(watcher.get(timeout=FRAME_WAIT_S))
                while frames and not watcher.empty() and len(frames) < MAX_QUEUED:
                    frames.append(watcher.get_nowait())
                yield frames
                time.sleep(1 / BATCHES_PER_S)
        finally:
            with self._lock:
                self._watchers.remove(watcher)

    def end_streams(self) -> None:
        """End all `frames`, though the simulation goes on; lock-free for signal handlers."""
        self._streams_end = True
