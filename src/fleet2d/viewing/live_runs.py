"""The simulations that run while pages watch them: one of a scenario, and branches of runs."""

import threading
from collections.abc import Iterator
from itertools import count
from pathlib import Path
from typing import Any

from starlette.requests import Request
from starlette.responses import Response, StreamingResponse
from starlette.routing import Route

from fleet2d.artifacts.manifest import plain
from fleet2d.configuration.trust import running_code
from fleet2d.engine.access import directory_of, interventions_of, may_run_code
from fleet2d.engine.repeat import branch, repeat_until
from fleet2d.engine.simulation import Simulation
from fleet2d.errors import InputError
from fleet2d.runs.run import Run
from fleet2d.viewing.contract import BRANCH_ORDER, LIVE_ORDER, BranchOrder, LiveSession, read_body
from fleet2d.viewing.home_facts import walls_facts
from fleet2d.viewing.live import LiveRun
from fleet2d.viewing.page_data import PageData, compact_json
from fleet2d.viewing.run_facts import live_facts
from fleet2d.viewing.served_runs import ServedRuns, endpoint, json_answer, problem

MAX_BRANCHES = 4


class LiveRuns:
    """The running simulations of a server; when one is over, its run is served as a stored one."""

    def __init__(self, served: ServedRuns, first: LiveRun | None = None) -> None:
        """Begin with one simulation, or with none.

        Args:
            served: The runs that are served: branches begin from them, and ended runs join them.
            first: A simulation that the caller starts and ends.
        """
        self._served = served
        self._lives: list[tuple[LiveRun, LiveSession]] = []
        self._lock = threading.Lock()
        if first is not None:
            title = first.engine.simulation.scenario.name or "live run"
            self._add(first, title, "", 0)

    def _add(self, live: LiveRun, title: str, of: str, since: int) -> LiveSession:
        live.serve = lambda run: self._served.add(PageData(run))
        path = f"live/{len(self._lives)}"
        session = LiveSession(path=path, title=title, of=of, since=since)
        self._lives.append((live, session))
        return session

    def sessions(self) -> list[LiveSession]:
        """Return the simulations that are under way."""
        return [session for live, session in self._lives if live.run is None]

    @property
    def _branches(self) -> list[LiveRun]:
        return [live for live, session in self._lives if session["of"]]

    def branch(self, order: BranchOrder) -> LiveSession:
        """Continue a run from a step in a simulation of its own, which waits there.

        A run in a directory gets a branch in a new directory beside it, another one in memory.

        Raises:
            InputError: There is no such run or step, or too many branches are under way.
            Fleet2DError: The run can't be repeated.
        """
        with self._lock:
            if sum(live.run is None for live in self._branches) >= MAX_BRANCHES:
                raise InputError(f"{MAX_BRANCHES} branches are under way: run one to its end first")
            simulation = self._branch(order["of"], order["step"])
            live = LiveRun(simulation, paused=True)
            directory = directory_of(simulation)
            title = directory.name if directory else f"branch of {order['of']}"
            session = self._add(live, title, order["of"], order["step"])
        live.start()
        return session

    def _branch(self, of: str, step: int) -> Simulation:
        kind, _, text = of.partition("/")
        number = int(text) if text.isdecimal() else -1
        if kind == "run":
            run = self._served.data(number).run
            return branch(run, step, free_directory(run.directory))
        simulation = self._live(number).engine.simulation
        if step > simulation.step:
            raise InputError(f"step {step} is not simulated yet: the run is at {simulation.step}")
        scenario: dict[str, Any] = plain(simulation.scenario.resolved())
        scenario["simulation"]["seed"] = simulation.seed
        content = {"scenario": scenario, "interventions": interventions_of(simulation)}
        directory = free_directory(directory_of(simulation))
        with running_code(allowed=may_run_code(simulation)):
            return repeat_until({**content, "expectations": {}}, step, directory)

    def _live(self, number: int) -> LiveRun:
        if not 0 <= number < len(self._lives):
            raise InputError(f"there is no running simulation {number}")
        return self._lives[number][0]

    def end_streams(self) -> None:
        """End all open responses; lock-free for signal handlers."""
        for live, _ in self._lives:
            live.end_streams()

    def end_branches(self) -> list[Run]:
        """Stop all branches at their present steps, and return their runs."""
        for live in self._branches:
            live.end()
        return [live.run for live in self._branches if live.run is not None]

    def routes(self) -> list[Route]:
        """Return the routes of running simulations."""
        return [
            Route("/branch", endpoint(self._begin), methods=["POST"]),
            Route("/live/{number:int}/facts.json", endpoint(self._facts)),
            Route("/live/{number:int}/frames", endpoint(self._frames)),
            Route("/live/{number:int}/order", endpoint(self._order), methods=["POST"]),
            Route("/live/{number:int}/walls/{walls:int}.json", endpoint(self._walls)),
        ]

    def _begin(self, _: Request, body: bytes) -> Response:
        order = read_body(body, BRANCH_ORDER, "the request is not a valid wish for a branch")
        return json_answer(self.branch(order))

    def _requested(self, request: Request) -> LiveRun:
        return self._live(request.path_params["number"])

    def _facts(self, request: Request, _: bytes) -> Response:
        return json_answer(live_facts(self._requested(request).engine.simulation))

    def _walls(self, request: Request, _: bytes) -> Response:
        mesh = self._requested(request).engine.mesh(request.path_params["walls"])
        return json_answer(walls_facts(mesh))

    def _frames(self, request: Request, _: bytes) -> Response:
        live = self._requested(request)

        def lines() -> Iterator[bytes]:
            for frames in live.frames():
                yield b"data: " + compact_json(frames) + b"\n\n" if frames else b": wait\n\n"

        return StreamingResponse(lines(), media_type="text/event-stream")

    def _order(self, request: Request, body: bytes) -> Response:
        live = self._requested(request)
        refusal = live.submit(read_body(body, LIVE_ORDER, "the request is not a valid order"))
        return problem(refusal) if refusal else json_answer({})


def free_directory(beside: Path | None) -> Path | None:
    """Return a directory for a branch beside that of its run; None for a run in memory."""
    if beside is None:
        return None
    root = beside.resolve()
    paths = (root.with_name(f"{root.name}-branch-{number}") for number in count(1))
    return next(path for path in paths if not path.exists())
