"""The server of the Model Context Protocol: AI assistants use Fleet2D within one folder.

The tools write and check scenarios and personas, run them, ask their tables, draw pictures and
intervene. Code of a scenario's own never runs, and no path leads out of the folder.
"""

import ctypes
import functools
import itertools
import json
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal, TypeVar, cast

from pydantic_core import PydanticCustomError

from fleet2d.bounds import one_line
from fleet2d.configuration.problems import check_known
from fleet2d.configuration.trust import running_code
from fleet2d.engine.access import stop
from fleet2d.engine.simulation import Simulation
from fleet2d.errors import Fleet2DError, InputError, errors_as, extra, os_errors_as
from fleet2d.inputs import open_input, within
from fleet2d.live import questions
from fleet2d.live.stays import summary
from fleet2d.runs.run import Run, open_run
from fleet2d.scenario.load import load_scenario
from fleet2d.storage.files import write_atomically

MAX_TEXT = 1 << 20
"""Size of a file that an assistant writes."""
MAX_NAME = 255
"""Size of the name of a file."""
MAX_BODY_STEPS = 1_000_000_000
"""Steps of a run times its bodies: a few minutes."""
MAX_S = 60.0
"""Time that one call simulates [s]."""
MAX_CALL_S = 120.0
"""Time that one call takes, with setting up and metrics [s]."""
MAX_RUNNING = 8
"""The number of simulations that wait for interventions at the same time."""


class _CallTooLong(KeyboardInterrupt):
    """Raised in a call that takes too long, as Ctrl-C raises KeyboardInterrupt."""


Method = TypeVar("Method", bound=Callable[..., Any])


def confined(method: Method) -> Method:
    """Run a method of a workspace within its folder, without a scenario's code, one at a time.

    A call that takes too long is interrupted, and the simulation that it names is lost.
    """

    @functools.wraps(method)
    def run(place: "Workspace", *args: Any, **settings: Any) -> Any:
        with place.lock, within(place.folder), running_code(allowed=False):
            try:
                with interrupted_after(MAX_CALL_S):
                    return method(place, *args, **settings)
            except _CallTooLong:
                for name in (*args, *settings.values()):
                    if isinstance(name, str):
                        place.running.pop(name, None)
                raise InputError(
                    f"one call takes {MAX_CALL_S:g} s at most: ask for a smaller home, fewer bodies"
                    " or less time"
                ) from None

    return cast("Method", run)


@contextmanager
def interrupted_after(seconds: float) -> Iterator[None]:
    """Raise `_CallTooLong` in this thread if the block takes longer."""
    thread = ctypes.c_ulong(threading.get_ident())
    interrupt = ctypes.pythonapi.PyThreadState_SetAsyncExc
    timer = threading.Timer(seconds, interrupt, [thread, ctypes.py_object(_CallTooLong)])
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
        timer.join()
        interrupt(thread, None)  # a pending one would be raised after the block


class Workspace:
    """The folder of an assistant, and its simulations.

    Example:
        >>> import tempfile
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     place = Workspace(Path(folder))
        ...     home = "{extends: bundled:paper, simulation: {duration: 2 h}}"
        ...     _ = place.write("home.yaml", home)
        ...     place.run("home.yaml", "first")["steps"]
        7200
    """

    def __init__(self, folder: Path) -> None:
        """Use an existing folder.

        Raises:
            InputError: There is no such folder.
        """
        if not folder.is_dir():
            raise InputError(f"{folder} is not a folder: create it, or name another")
        self.folder = folder.resolve()
        self.lock = threading.Lock()
        self.running: dict[str, Simulation] = {}
        self._numbers = itertools.count(1)

    def path(self, name: str) -> Path:
        """Return a path within the folder.

        Raises:
            InputError: The path leads out of the folder.
        """
        if not name.isprintable() or len(name.encode()) > MAX_NAME:
            raise InputError(f"{one_line(repr(name), 100)} can't be the name of a file")
        path = (self.folder / name).resolve()
        if not path.is_relative_to(self.folder) or path == self.folder:
            raise InputError(f"{name!r} leads out of the folder: give a name like 'home.yaml'")
        return path

    def files(self) -> list[str]:
        """Return the names of the files and runs in the folder."""
        return sorted(
            str(path.relative_to(self.folder)) + ("/" if path.is_dir() else "")
            for path in self.folder.iterdir()
        )

    @confined
    def read(self, name: str) -> str:
        """Return the text of a file.

        Raises:
            InputError: There is no such file, or it is too large or no text.
        """
        path = self.path(name)
        if not path.exists():
            raise InputError(f"there is no file {name!r}. There are: {', '.join(self.files())}")
        with os_errors_as(InputError, f"{name} can't be read"), open_input(path) as file:
            content = file.read(MAX_TEXT + 1)
        if len(content) > MAX_TEXT:
            raise InputError(f"{name} is larger than {MAX_TEXT} bytes")
        with errors_as(InputError, f"{name} is not a text", UnicodeError):
            return content.decode()

    @confined
    def write(self, name: str, text: str) -> str:
        """Write a YAML file, such as a scenario or a persona.

        Raises:
            InputError: The file isn't a .yaml file of the folder itself, or the text is too long.
        """
        path = self.path(name)
        if path.suffix not in (".yaml", ".yml", ".csv", ".json") or path.parent != self.folder:
            raise InputError(
                f"{name!r}: give the name of a .yaml, .csv or .json file in the folder itself"
            )
        with errors_as(InputError, f"{name} is not a text", UnicodeError):
            content = text.encode()
        if len(content) > MAX_TEXT:
            raise InputError(f"{name} would be larger than {MAX_TEXT} bytes")
        with os_errors_as(InputError, f"{name} can't be written"):
            write_atomically(path, content)
        return f"wrote {name}"

    @confined
    def check(self, scenario: str) -> dict[str, Any]:
        """Check a scenario, with the places of all people and robots.

        Raises:
            InputError: The scenario is wrong; the message says where and what to do.
        """
        simulation = self._simulation(scenario, [], None)
        plan = simulation.home.plan
        settings = simulation.scenario.simulation
        return {
            "users": list(simulation.scenario.users),
            "robots": list(simulation.scenario.robots),
            "rooms": [room.name for room in plan.rooms],
            "steps": settings.steps,
            "notes": simulation.notes,
        }

    @confined
    def run(
        self, scenario: str, out: str | None = None, overrides: list[str] | None = None
    ) -> dict[str, Any]:
        """Run a scenario, and store the run in a new folder `out` if it is given.

        Raises:
            InputError: The scenario is wrong, or `out` exists.
        """
        simulation = self._simulation(scenario, overrides or [], out)
        kept = f"; {out} holds the run up to there" if out else ""
        with limited(simulation, f"ask for a shorter simulation.duration or fewer bodies{kept}"):
            run = simulation.run()
        return {
            "run": out,
            "steps": run.manifest["steps"],
            "digest": run.digest,
            "metrics": run.metrics,
            "tables": {name: table.num_rows for name, table in run.tables.items()},
            "notes": run.manifest["notes"],
        }

    def _simulation(self, scenario: str, overrides: list[str], out: str | None) -> Simulation:
        source = scenario if scenario.startswith("bundled:") else self.path(scenario)
        checked = load_scenario(source, *overrides)
        bodies = len(checked.users) + len(checked.robots)
        if bodies * checked.simulation.steps > MAX_BODY_STEPS:
            raise InputError(
                f"{bodies} bodies in {checked.simulation.steps:,} steps would take minutes or"
                f" more: at most {MAX_BODY_STEPS:,} steps of bodies are run: shorten"
                " simulation.duration"
            )
        if checked.simulation.speedup is not None:
            raise InputError(
                "simulation.speedup makes a run wait for somebody who watches: leave it out, or"
                " override it by simulation.speedup=null"
            )
        return Simulation(checked, out=None if out is None else self.path(out))

    @confined
    def ask(
        self,
        run: str,
        table: str = "",
        where: str = "",
        columns: list[str] | None = None,
        query: str = "",
        limit: int = 50,
    ) -> dict[str, Any]:
        """Answer a question to the tables of a run, in SQL as DuckDB reads it.

        Give a table, with a condition and columns if you like; or any SELECT as the query, which
        may group, sum, join and nest. Times are in the column time, and numbers of steps in step.
        How long each activity of each person lasts in all [s]:

            SELECT entity, detail, sum(epoch(until - time)) AS seconds, min(time), max(until)
            FROM (SELECT *, lead(time) OVER (PARTITION BY entity ORDER BY step) AS until
                  FROM events WHERE event = 'activity')
            GROUP BY ALL

        Args:
            run: The folder of the run.
            table: The table, such as events; `run` lists all of them.
            where: A condition, like event = 'user_seen' AND entity IN ('astro', 'rover').
            columns: The columns, or other expressions; None: all columns.
            query: A SELECT in place of the table, the condition and the columns.
            limit: The number of rows that are shown, 200 at most; all are counted.

        Raises:
            InputError: There is no such run, table, column or value, or the query takes too long or
                too much memory.
        """
        tables = self._open(run).tables
        if query and (table or where or columns):
            raise InputError("give a query, or a table with a condition and columns, not both")
        if not query:
            check_known(table, "table", tables, InputError)
            condition = f" WHERE {where}" if where else ""
            what = ", ".join(columns or ["*"])
            query = f'SELECT {what} FROM "{table}"{condition}'  # noqa: S608 - `answer` checks it
        return questions.answer(tables, query, limit)

    @confined
    def stays(
        self,
        run: str,
        who: str,
        by: Literal["room", "activity", "hour", "day"] = "room",
        of: str = "",
    ) -> list[dict[str, Any]]:
        """Sum up how long a person or robot was where, or did what, in a run.

        Rows by room or activity have hours, number of stays, first and last time, and the longest
        stay; rows by hour of the day its share; rows by day hours, first and last time.

        Args:
            run: The folder of the run.
            who: The person or robot.
            by: The unit of a row.
            of: For hours and days: a room, a kind of room, an activity, or away.

        Raises:
            InputError: There is no such run, body, room or activity.
        """
        return summary(self._open(run), who, by, of)

    @confined
    def manifest(self, run: str) -> str:
        """Return the manifest of a run as JSON: scenario, metrics, notes, digest.

        Raises:
            InputError: There is no such run.
        """
        manifest = self._open(run).manifest
        kept = ("status", "steps", "scenario", "metrics", "notes", "digest")
        return json.dumps({key: manifest.get(key) for key in kept}, default=str)

    def _open(self, run: str) -> Run:
        return open_run(self.path(run))

    @confined
    def picture(self, run: str) -> bytes:
        """Return a PNG of the home and the paths of a run.

        Raises:
            InputError: There is no such run.
        """
        from fleet2d.viewing.pictures.run import draw_run

        with tempfile.TemporaryDirectory() as folder:
            target = Path(folder) / "run.png"
            draw_run(self._open(run), target)
            return target.read_bytes()

    @confined
    def begin(self, scenario: str, overrides: list[str] | None = None) -> str:
        """Set up a simulation that waits for interventions; return its name.

        Raises:
            InputError: The scenario is wrong, or too many simulations wait.
        """
        if len(self.running) >= MAX_RUNNING:
            raise InputError(f"{MAX_RUNNING} simulations wait already: finish one of them")
        name = f"simulation_{next(self._numbers)}"
        self.running[name] = self._simulation(scenario, overrides or [], None)
        return name

    @confined
    def advance(self, simulation: str, until: str) -> dict[str, Any]:
        """Simulate until a time of day, "19:00", or for a duration, "30 min"; return the state.

        Raises:
            InputError: There is no such simulation or time.
        """
        from fleet2d.configuration.units import parse_duration

        run = self._get(simulation)
        since = run.step
        with limited(run, "ask for a shorter time; the state is kept"):
            if ":" in until:
                run.run_until(until)
            else:
                with errors_as(InputError, of=PydanticCustomError):
                    passed = parse_duration(until)
                run.advance(round(passed.total_seconds() * 1e6 / run.clock.step_us))
        news = run.events(since)[-50:]
        return {
            "time": run.time.isoformat(),
            "done": run.done,
            "state": run.state,
            "events": [[e.step, e.entity, str(e.event), e.detail] for e in news],
        }

    @confined
    def intervene(self, simulation: str, act: dict[str, Any]) -> str:
        """Apply an intervention, as in a scenario's script: {"put": "ana", "to": "kitchen"}.

        Raises:
            InputError: There is no such simulation, or the intervention is wrong.
        """
        self._get(simulation).do(act)
        return "done"

    @confined
    def finish(self, simulation: str) -> dict[str, Any]:
        """End a simulation, and return its metrics.

        Raises:
            InputError: There is no such simulation.
        """
        run = self._get(simulation)
        del self.running[simulation]
        finished = run.finish()
        return {"status": finished.status, "metrics": finished.metrics}

    def _get(self, name: str) -> Simulation:
        check_known(name, "simulation", self.running, InputError)
        return self.running[name]


@contextmanager
def limited(simulation: Simulation, advice: str) -> Iterator[None]:
    """Stop a simulation that takes too long.

    Raises:
        InputError: The simulation was stopped.
    """
    timer = threading.Timer(MAX_S, stop, [simulation])
    timer.start()
    try:
        yield
    except _CallTooLong:
        raise
    except KeyboardInterrupt:
        raise InputError(
            f"one call simulates for {MAX_S:g} s at most, which ended at"
            f" {simulation.time.isoformat()}: {advice}"
        ) from None
    finally:
        timer.cancel()


def list_components(kind: str = "", type: str = "") -> str:  # noqa: A002 - as scenarios have it
    """List what a scenario may contain: all types; those of a kind; or the keys of one of them.

    Args:
        kind: Such as behavior, metric or intervention.
        type: A type of that kind, such as patrol: its keys with types, defaults and meanings.
    """
    from fleet2d.scenario.schema import describe_components

    described = describe_components()
    by_kind: dict[str, dict[str, Any]] = {}
    for component in described:
        by_kind.setdefault(component.kind, {})[component.type] = component
    if not kind:
        return "\n".join(f"{name}: {', '.join(types)}" for name, types in by_kind.items())
    check_known(kind, "kind", by_kind, InputError)
    types = by_kind[kind]
    if not type:
        return "\n".join(f"{name}: {component.summary}" for name, component in types.items())
    check_known(type, kind, types, InputError)
    chosen = types[type]
    keys = [f"{f.name} ({f.type}, {f.default}): {f.description}" for f in chosen.fields]
    shared = [f"and the keys of {name}, by kind shared" for name in chosen.shares]
    return "\n".join([chosen.summary, *keys, *shared])


def scenario_from_words(words: str) -> str:
    """Make a scenario of a sentence, check it, run it, and explain what happened."""
    return (
        f"Make a scenario of Fleet2D of this: {words}\n\n"
        "1. Call `components` without arguments, then with the kinds that you need (behavior, part,"
        " intervention, metric), then with a kind and a type for its keys. Use no other keys.\n"
        "2. Write a YAML file that begins with `extends: bundled:paper` or `bundled:family`, and"
        " has what the sentence says: users with personas, robots with behaviors in the order of"
        " their priority, `expect` for what must hold, such as `never(events(moving, astro))`.\n"
        "3. Call `check`, and mend what it says, until it passes. Read its notes.\n"
        "4. Call `run` with a folder. Call `stays` for how long somebody was where, and `ask` for"
        " all else; `picture` shows the ways.\n"
        "5. Say in a few sentences what happened, with numbers from the answers, what of the"
        " sentence the scenario doesn't show, and which keys one may change."
    )


def server(folder: Path) -> Any:
    """Return a server of the official SDK with the tools of a folder.

    Raises:
        InputError: There is no such folder, or the SDK isn't installed.
    """
    with extra("mcp", "assistants need the SDK of the Model Context Protocol"):
        from mcp.server.mcpserver import Image, MCPServer
        from mcp.server.mcpserver.exceptions import ToolError
        from mcp.server.mcpserver.tools import Tool
    place = Workspace(folder)

    def picture(run: str) -> Image:
        """Draw the home and the paths of a run."""
        return Image(data=place.picture(run), format="png")

    tools = (
        place.files, place.read, place.write, place.check, place.run, place.stays, place.ask,
        place.begin, place.advance, place.intervene, place.finish, list_components, picture,
    )  # fmt: skip

    def told(tool: Callable[..., Any]) -> Callable[..., Any]:
        """Return a tool whose errors an assistant can read."""

        @functools.wraps(tool)
        def answer(*args: Any, **settings: Any) -> Any:
            try:
                return tool(*args, **settings)
            except (Fleet2DError, OSError) as error:
                raise ToolError(str(error)) from error

        return answer

    def strict(tool: Callable[..., Any]) -> Tool:
        """Return a tool that refuses unknown arguments, which the SDK would ignore."""
        made = Tool.from_function(told(tool), name=tool.__name__.removeprefix("list_"))
        arguments = made.fn_metadata.arg_model
        arguments.model_config["extra"] = "forbid"
        arguments.model_rebuild(force=True)
        made.parameters["additionalProperties"] = False
        return made

    app = MCPServer(
        "fleet2d",
        instructions="Simulate homes with people and robots. Write a scenario (a YAML file), check"
        " it, run it, and ask its tables. `components` lists what a scenario may contain.",
        tools=[strict(tool) for tool in tools],
    )
    app.prompt(title="A scenario from a sentence")(scenario_from_words)
    app.resource("fleet2d://{run}/manifest", mime_type="application/json")(told(place.manifest))
    app.resource("fleet2d://{run}/picture", mime_type="image/png")(told(place.picture))
    return app
