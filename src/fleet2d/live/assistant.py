"""Assistants: Fleet2D by the Model Context Protocol, within one folder and nothing else.

The tools write and check scenarios and personas, run them, ask their tables, draw pictures and
intervene. Code of a scenario's own never runs, and no path leads out of the folder.
"""

import functools
import itertools
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import yaml
from pydantic_core import PydanticCustomError

from fleet2d.configuration.problems import check_known
from fleet2d.configuration.trust import running_code
from fleet2d.engine.simulation import Simulation
from fleet2d.errors import Fleet2DError, InputError, errors_as, extra
from fleet2d.runs.run import Run, open_run
from fleet2d.scenario.model import load_scenario

MAX_TEXT = 1 << 20
"""Size of a file that an assistant writes."""
MAX_ROWS = 200
"""The number of rows of a table that one question returns."""
MAX_DEPTH = 100
MAX_BODY_STEPS = 1_000_000_000
"""Steps of a run times its bodies: a few minutes."""
MAX_RUNNING = 8
"""The number of simulations that wait for interventions at the same time."""


class Workspace:
    """The folder of an assistant, and its simulations.

    Example:
        >>> import tempfile
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     place = Workspace(Path(folder))
        ...     _ = place.write("home.yaml", "{extends: bundled:base, simulation: {duration: 2 h}}")
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
        self._running: dict[str, Simulation] = {}
        self._numbers = itertools.count(1)

    def path(self, name: str) -> Path:
        """Return a path within the folder.

        Raises:
            InputError: It leads out of the folder.
        """
        if "\0" in name:
            raise InputError(f"{name!r} can't be the name of a file")
        path = (self.folder / name).resolve()
        if not path.is_relative_to(self.folder) or path == self.folder:
            raise InputError(f"{name!r} leads out of the folder: give a name like 'home.yaml'")
        return path

    # Files

    def files(self) -> list[str]:
        """Return the names of the files and runs in the folder."""
        return sorted(
            str(path.relative_to(self.folder)) + ("/" if path.is_dir() else "")
            for path in self.folder.iterdir()
        )

    def read(self, name: str) -> str:
        """Return the text of a file.

        Raises:
            InputError: There is none, it is too large, or no text.
        """
        path = self.path(name)
        if not path.is_file():
            raise InputError(f"there is no file {name!r}. There are: {', '.join(self.files())}")
        if path.stat().st_size > MAX_TEXT:
            raise InputError(f"{name} is larger than {MAX_TEXT} bytes")
        try:
            return path.read_text(encoding="utf-8")
        except UnicodeDecodeError:
            raise InputError(f"{name} is not a text") from None

    def write(self, name: str, text: str) -> str:
        """Write a YAML file, such as a scenario or a persona.

        Raises:
            InputError: It isn't a .yaml file of the folder itself, or too long.
        """
        path = self.path(name)
        if path.suffix not in (".yaml", ".yml", ".csv", ".json") or path.parent != self.folder:
            raise InputError(
                f"{name!r}: give the name of a .yaml, .csv or .json file in the folder itself"
            )
        if len(text.encode()) > MAX_TEXT:
            raise InputError(f"{name} would be larger than {MAX_TEXT} bytes")
        path.write_text(text, encoding="utf-8")
        return f"wrote {name}"

    # Runs

    def check(self, scenario: str) -> dict[str, Any]:
        """Check a scenario, with the places of all people and robots.

        Raises:
            InputError: It is wrong; the message says where and what to do.
        """
        simulation = self._simulation(scenario, [], None)
        plan, settings = simulation.home.plan, simulation.scenario.simulation
        return {
            "users": list(simulation.scenario.users),
            "robots": list(simulation.scenario.robots),
            "rooms": [room.name for room in plan.rooms],
            "steps": settings.steps,
            "notes": simulation.notes,
        }

    def run(
        self, scenario: str, out: str | None = None, overrides: list[str] | None = None
    ) -> dict[str, Any]:
        """Run a scenario, and store the run in a new folder `out` if it is given.

        Raises:
            InputError: The scenario is wrong, or `out` exists.
        """
        run = self._simulation(scenario, overrides or [], out).run()
        return {
            "run": out,
            "steps": run.manifest["steps"],
            "digest": run.digest,
            "metrics": run.metrics,
            "tables": {name: table.num_rows for name, table in run.tables.items()},
            "notes": run.manifest["notes"],
        }

    def _simulation(self, scenario: str, overrides: list[str], out: str | None) -> Simulation:
        source: str | Path = scenario
        if not scenario.startswith("bundled:"):
            source = self.path(scenario)
            self._check_file(source, set())
        for override in overrides:
            self._check_values(_yaml(override.partition("=")[2], override), Path.cwd(), set())
        with running_code(allowed=False):
            checked = load_scenario(source, *overrides)
            self._check_values(checked.resolved(), self.folder, set())
            bodies = len(checked.users) + len(checked.robots)
            if bodies * checked.simulation.steps > MAX_BODY_STEPS:
                raise InputError(
                    f"{bodies} bodies in {checked.simulation.steps:,} steps would take minutes or"
                    f" more: at most {MAX_BODY_STEPS:,} steps of bodies are run: shorten"
                    " simulation.duration"
                )
            return Simulation(checked, out=None if out is None else self.path(out))

    def _check_file(self, path: Path, known: set[Path]) -> None:
        """Refuse a file that refers to one outside of the folder, before anything reads that."""
        known.add(path)
        name = str(path.relative_to(self.folder))
        self._check_values(_yaml(self.read(name), name), path.parent, known)

    def _check_values(self, value: Any, base: Path, known: set[Path], depth: int = 0) -> None:
        """Refuse values that are paths of files outside of the folder, seen from a folder."""
        if depth > MAX_DEPTH:
            raise InputError(f"values are nested more than {MAX_DEPTH} deep, or in themselves")
        if isinstance(value, dict):
            value = [*value, *value.values()]
        if isinstance(value, list | tuple):
            for entry in value:
                self._check_values(entry, base, known, depth + 1)
        if not isinstance(value, str):
            return
        try:
            path = (base / Path(value).expanduser()).resolve()
            is_there = path.exists() and path != self.folder
        except (OSError, ValueError, RuntimeError):  # no path
            return
        if is_there and not path.is_relative_to(self.folder):
            raise InputError(f"{value!r} is a file outside of the folder: copy it into the folder")
        if is_there and path.suffix in (".yaml", ".yml") and path not in known:
            self._check_file(path, known)

    def _open(self, run: str) -> Run:
        return open_run(self.path(run))

    def ask(
        self,
        run: str,
        table: str,
        columns: list[str] | None = None,
        where: str = "",
        limit: int = 50,
    ) -> dict[str, Any]:
        """Return rows of a table of a run.

        Args:
            run: The folder of the run.
            table: The table.
            columns: Its columns; None: all.
            where: A condition, "COLUMN OP VALUE" with ==, !=, <, <=, > or >=, like "user == ana".
            limit: The number of rows, 200 at most.

        Raises:
            InputError: There is no such run, table or column.
        """
        import pyarrow as pa
        import pyarrow.compute as pc

        tables = self._open(run).tables
        check_known(table, "table", tables, InputError)
        rows = tables[table]
        if where:
            parts = where.split(None, 2)
            if len(parts) != 3 or parts[1] not in _OPERATORS or parts[0] not in rows.column_names:
                raise InputError(
                    f"{where!r}: expected 'COLUMN OP VALUE' with a column of"
                    f" {', '.join(rows.column_names)} and one of {', '.join(_OPERATORS)}"
                )
            column, text = rows[parts[0]], parts[2].strip("'\"")
            if pa.types.is_dictionary(column.type):
                column = pc.cast(column, pa.string())
            with errors_as(InputError, repr(where), pa.ArrowException):
                value = pa.scalar(text).cast(column.type)
            rows = rows.filter(getattr(pc, _OPERATORS[parts[1]])(column, value))
        for name in columns or ():
            check_known(name, "column", rows.column_names, InputError)
        chosen = rows.select(columns) if columns else rows
        part = chosen.slice(0, max(0, min(limit, MAX_ROWS))).to_pylist()
        return {
            "rows": rows.num_rows,
            "shown": [{k: _plain(v) for k, v in r.items()} for r in part],
        }

    def picture(self, run: str) -> bytes:
        """Return a PNG of the home and the ways of a run.

        Raises:
            InputError: There is no such run.
        """
        from fleet2d.pictures.run import draw_run

        with tempfile.TemporaryDirectory() as folder:
            target = Path(folder) / "run.png"
            draw_run(self._open(run), target)
            return target.read_bytes()

    # Interventions

    def begin(self, scenario: str, overrides: list[str] | None = None) -> str:
        """Set up a simulation that waits for interventions; return its name.

        Raises:
            InputError: The scenario is wrong, or too many simulations wait.
        """
        if len(self._running) >= MAX_RUNNING:
            raise InputError(f"{MAX_RUNNING} simulations wait already: finish one of them")
        name = f"simulation_{next(self._numbers)}"
        self._running[name] = self._simulation(scenario, overrides or [], None)
        return name

    def advance(self, simulation: str, until: str) -> dict[str, Any]:
        """Simulate until a time of day, "19:00", or for a duration, "30 min"; return the state.

        Raises:
            InputError: There is no such simulation or time.
        """
        from fleet2d.configuration.units import parse_duration

        run = self._get(simulation)
        since = run.step
        if ":" in until:
            run.run_until(until)
        else:
            with errors_as(InputError, of=PydanticCustomError):
                passed = parse_duration(until)
            run.advance(round(passed.total_seconds() * 1e6 / run.clock.step_us))
        return {
            "time": run.time.isoformat(),
            "done": run.done,
            "state": run.state,
            "events": [[e.step, e.entity, str(e.event), e.detail] for e in run.events(since)][-50:],
        }

    def intervene(self, simulation: str, act: dict[str, Any]) -> str:
        """Apply an intervention, as in a scenario's script: {"put": "ana", "to": "kitchen"}.

        Raises:
            InputError: There is no such simulation, or the intervention is wrong.
        """
        run = self._get(simulation)
        self._check_values(act, Path.cwd(), set())
        with running_code(allowed=False):
            run.intervene(act)
        return "done"

    def finish(self, simulation: str) -> dict[str, Any]:
        """End a simulation, and return its metrics.

        Raises:
            InputError: There is no such simulation.
        """
        run = self._get(simulation)
        del self._running[simulation]
        finished = run.finish()
        return {"status": finished.status, "metrics": finished.metrics}

    def _get(self, name: str) -> Simulation:
        check_known(name, "simulation", self._running, InputError)
        return self._running[name]


_OPERATORS = {
    "==": "equal",
    "!=": "not_equal",
    "<": "less",
    "<=": "less_equal",
    ">": "greater",
    ">=": "greater_equal",
}


def _yaml(text: str, name: str) -> Any:
    """Return the content of a YAML text."""
    try:
        return yaml.safe_load(text)
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise InputError(f"{name}: {str(error)[:500]}") from None


def _plain(value: Any) -> Any:
    """Return a value that JSON has."""
    return value if isinstance(value, str | int | float | bool | None) else str(value)


def server(folder: Path) -> Any:
    """Return a server of the official SDK with the tools of a folder.

    Raises:
        InputError: There is no such folder, or the SDK isn't installed.
    """
    with extra("mcp", "assistants need the SDK of the Model Context Protocol"):
        from mcp.server.mcpserver import Image, MCPServer
        from mcp.server.mcpserver.exceptions import ToolError
    place = Workspace(folder)
    app = MCPServer(
        "fleet2d",
        instructions="Simulate homes with people and robots. Write a scenario (a YAML file), check"
        " it, run it, and ask its tables. `components` lists what a scenario may contain.",
    )

    def components(kind: str = "") -> list[str]:
        """List what a scenario may contain: types by kind, such as behavior or metric."""
        from fleet2d.scenario.schema import describe_components

        return [
            f"{c.kind} {c.type}: {c.summary} Keys: {', '.join(f.name for f in c.fields)}"
            for c in describe_components()
            if kind in ("", c.kind)
        ]

    def picture(run: str) -> Image:
        """Draw the home and the ways of a run."""
        return Image(data=place.picture(run), format="png")

    tools = (
        place.files, place.read, place.write, place.check, place.run, place.ask, place.begin,
        place.advance, place.intervene, place.finish, components, picture,
    )  # fmt: skip

    def told(tool: Callable[..., Any]) -> Callable[..., Any]:
        """Let an assistant read what is wrong."""

        @functools.wraps(tool)
        def answer(*args: Any, **settings: Any) -> Any:
            try:
                return tool(*args, **settings)
            except Fleet2DError as error:
                raise ToolError(str(error)) from error

        return answer

    for tool in tools:
        app.tool()(told(tool))
    return app
