"""Exporters by format, and the parts of runs that they export in bounded memory.

`export_NAME` in the module of a format writes a stored run to a file for other programs. A format
of an installed package is an entry point of the group `fleet2d.exporter`: a function with the same
arguments.
"""

import importlib
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import timedelta
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, cast

import numpy as np
from pydantic_core import PydanticCustomError

from fleet2d.configuration.units import parse_duration, whole_steps
from fleet2d.errors import InputError, RunDirectoryError, os_errors_as
from fleet2d.kernels import I64
from fleet2d.runs.trajectory import PathReader, Trajectory
from fleet2d.storage.files import replacing

if TYPE_CHECKING:
    import pyarrow as pa

    from fleet2d.runs.run import Run


# The poses of all bodies in one chunk, each of which takes up to 2 kB as Python objects.
MAX_POSES = 20_000
# Tables that hold poses, which exporters get from `Chunk.poses`.
POSES = ("key_frames", "trajectories")


@dataclass(frozen=True)
class Selection:
    """The part of a run that is exported.

    Attributes:
        first: The first step.
        end: The step after the last one.
        every: Time between two poses of a body, a multiple of the step.
    """

    first: int
    end: int
    every: timedelta

    @classmethod
    def of(
        cls,
        run: "Run",
        first: int = 0,
        end: int | None = None,
        every: str | timedelta | None = None,
    ) -> "Selection":
        """Return a part of a run: by default all of it, with the pose at each step.

        Args:
            run: The run.
            first: The first step.
            end: The step after the last one; None for the end of the run.
            every: Time between two poses, such as "10 s".

        Raises:
            InputError: `every` isn't a duration, or not a multiple of the step.
        """
        step_us = run.manifest["step_us"]
        try:
            apart = timedelta(microseconds=step_us) if every is None else parse_duration(every)
        except PydanticCustomError as error:
            raise InputError(f"--every: {error.message()}") from None
        whole_steps(apart, step_us, "--every", InputError)
        return cls(first, run.manifest["steps"] if end is None else end, apart)


@dataclass(frozen=True)
class Chunk:
    """A stretch of a run.

    Attributes:
        poses: The poses of each user and robot, by name.
        tables: The rows of each table, by name, by step.
        steps: Its first step, and the step after its last one.
    """

    poses: dict[str, Trajectory]
    tables: "dict[str, pa.Table]"
    steps: tuple[int, int]

    @cached_property
    def rows(self) -> dict[str, list[dict[str, Any]]]:
        """The rows of each table, by name, as mappings from columns to values."""
        return {name: table.to_pylist() for name, table in self.tables.items()}


@dataclass(frozen=True)
class Records:
    """The records of a part of a run.

    Attributes:
        run: The run.
        part: The part of the run.

    Example:
        >>> import fleet2d
        >>> run = fleet2d.run("bundled:paper", "simulation.duration=2 h", seed=4)
        >>> chunks = list(Records(run, Selection.of(run)).chunks())
        >>> len(chunks), len(chunks[0].poses["ana"].x), chunks[0].rows["events"][0]["event"]
        (1, 7200, 'uses')
    """

    run: "Run"
    part: Selection

    @cached_property
    def users(self) -> list[str]:
        """The names of the users."""
        return list(self.run.manifest["entities"]["users"])

    @cached_property
    def robots(self) -> list[str]:
        """The names of the robots."""
        return list(self.run.manifest["entities"]["robots"])

    @cached_property
    def tables(self) -> list[str]:
        """The names of the tables with records other than poses."""
        return [name for name in self.run.tables if name not in POSES]

    def chunks(self, *, poses: bool = True, tables: Sequence[str] | None = None) -> Iterator[Chunk]:
        """Yield the records in stretches of bounded size.

        Args:
            poses: Whether poses are wanted.
            tables: The names of the tables that are wanted; None: all of `tables`.

        Raises:
            ArtifactError: The run stored no key frames, or a table can't be read.
        """
        names = [*self.users, *self.robots] if poses else []
        readers = {name: PathReader(self.run, self.run.plan, name) for name in names}
        wanted = self.tables if tables is None else tables
        rows = {name: _by_step(self.run.tables[name]) for name in wanted}
        step_us = self.run.manifest["step_us"]
        stride = whole_steps(self.part.every, step_us, "every", InputError)
        steps = stride * max(MAX_POSES // max(len(names), 1), 1)
        for first in range(self.part.first, self.part.end, steps):
            end = min(first + steps, self.part.end)
            paths = {n: reader.read(first, end, self.part.every) for n, reader in readers.items()}
            cut = {name: _between(*table, first, end) for name, table in rows.items()}
            yield Chunk(paths, cut, (first, end))


def _by_step(table: "pa.Table") -> "tuple[pa.Table, I64]":
    """Return a table in order of step, and the step of each row."""
    step = table["step"].to_numpy()
    if np.any(step[1:] < step[:-1]):  # violations are listed when they end
        order = np.argsort(step, kind="stable")
        table = table.take(order)
        step = step[order]
    return table, step


def _between(table: "pa.Table", step: I64, first: int, end: int) -> "pa.Table":
    """Return the rows of the steps `first` to `end` - 1."""
    low, high = np.searchsorted(step, (first, end)).tolist()
    return table.slice(low, high - low)


Exporter = Callable[["Run", Path, "Selection"], str]
"""Writes a part of a run to a file, and returns a line about it."""

_FORMATS = {
    "casas": (
        "texts",
        "The readings of a run's sensors as a text file in the layout of the CASAS smart homes.",
    ),
    "csv": ("texts", "Poses of all users and robots as CSV: a row for each body and time."),
    "home_assistant": (
        "home_assistant",
        "The database of a Home Assistant's recorder: rooms of people and robots, sensors.",
    ),
    "jsonl": (
        "texts",
        "JSON Lines: an object for each pose, event, observation and row of a table, in order of"
        " time.",
    ),
    "mcap": (
        "bags",
        "ROS 2 messages in an MCAP file, for Foxglove, PlotJuggler and ROS: needs the extra `ros`.",
    ),
    "perfetto": (
        "perfetto",
        "Trace events as JSON for Perfetto (ui.perfetto.dev): plans, moves, interactions, power and"
        " battery of each body.",
    ),
    "rosbag2": (
        "bags",
        "ROS 2 messages as a bag in MCAP, which `ros2 bag play` plays: needs the extra `ros`.",
    ),
}
"""The module and the description of each format."""

# Formats whose files have another suffix than the name of the format.
_SUFFIXES = {".txt": "casas", ".db": "home_assistant", "": "rosbag2"}


def export(
    run: "Run",
    path: Path | str,
    layout: str | None = None,
    *,
    first: int = 0,
    end: int | None = None,
    every: str | None = None,
) -> str:
    """Write a run, or a part of it, to a file for other programs.

    Args:
        run: The run.
        path: The file, or the folder of a bag.
        layout: The name of its format, such as "mcap"; None: by the suffix of the file.
        first: The first step.
        end: The step after the last one; None for the end of the run.
        every: Time between two poses, such as "10 s"; None for the step.

    Returns:
        A line about the file.

    Raises:
        InputError: There is no such format, it needs a library that isn't installed, or `every` is
            no multiple of the step.
        ArtifactError: The run stored no key frames, or the file can't be written.
    """
    write = exporter(layout or format_of(Path(path)))
    return write(run, Path(path), Selection.of(run, first, end, every))


def formats() -> dict[str, str]:
    """Return a description of each format by its name; empty for formats of installed packages."""
    own = {name: text for name, (_, text) in _FORMATS.items()}
    known = dict.fromkeys(_plugins().names, "") | own
    return dict(sorted(known.items()))


def format_of(path: Path) -> str:
    """Return the name of the format of a file by its suffix.

    Raises:
        InputError: No format has this suffix.

    Example:
        >>> format_of(Path("week.mcap")), format_of(Path("bags/week"))
        ('mcap', 'rosbag2')
    """
    name = _SUFFIXES.get(path.suffix.lower(), path.suffix.lower()[1:])
    if name not in formats():
        suffixes = ", ".join(f".{own}" for own in formats() if own not in _SUFFIXES.values())
        raise InputError(
            f"{path}: no format has the suffix {path.suffix!r}: name the format by --format, or"
            f" write a file with one of {suffixes}, .txt, .db, or a folder"
        )
    return name


def words_of(row: Mapping[str, Any]) -> str:
    """Return the user and the details of an event, if it has them."""
    return " ".join(str(row[key]) for key in ("user", "detail") if row.get(key))


@contextmanager
def new_file(path: Path) -> Iterator[BinaryIO]:
    """Yield a file that appears, complete, after the block, replacing one of the same name.

    Raises:
        RunDirectoryError: The file can't be written.
    """
    with (
        os_errors_as(RunDirectoryError, f"{path} can't be written"),
        replacing(path) as handle,
        os.fdopen(handle, "wb", closefd=False) as file,
    ):
        yield file


def exporter(name: str) -> Exporter:
    """Return the function that exports runs to a format.

    Raises:
        InputError: There is no such format.

    Example:
        >>> exporter("casas").__module__
        'fleet2d.live.exporters.texts'
    """
    if name in _FORMATS:
        module = importlib.import_module(f"{__name__}.{_FORMATS[name][0]}")
        return cast("Exporter", getattr(module, f"export_{name}"))
    if name not in _plugins().names:
        # This imports pydantic, which the help doesn't need.
        from fleet2d.configuration.problems import suggest

        raise InputError(f"there is no exporter {name!r}{suggest(name, formats())}")
    return cast("Exporter", _plugins()[name].load())


def _plugins() -> Any:
    from importlib.metadata import entry_points  # slow to import, and rarely needed

    return entry_points(group="fleet2d.exporter")
