"""What a run stored, in the order of time and in bounded memory: for exporters."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import timedelta
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic_core import PydanticCustomError

from fleet2d.configuration.units import parse_duration, whole_steps
from fleet2d.errors import InputError
from fleet2d.runs.trajectory import PathReader, Trajectory

if TYPE_CHECKING:
    import pyarrow as pa

    from fleet2d.runs.run import Run

# Poses of all bodies in one chunk. As Python objects they take up to 2 kB each.
MAX_POSES = 20_000
# Tables that hold poses: exporters have the poses themselves.
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
            InputError: `every` is no duration, or no multiple of the step.
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
        first: The first step.
        end: The step after the last one.
        poses: The poses of each user and robot, by name.
        tables: The rows of each table, by name, by step.
    """

    first: int
    end: int
    poses: dict[str, Trajectory]
    tables: "dict[str, pa.Table]"

    @cached_property
    def rows(self) -> dict[str, list[dict[str, Any]]]:
        """The rows of each table, by name, as mappings from columns to values."""
        return {name: table.to_pylist() for name, table in self.tables.items()}


@dataclass(frozen=True)
class Records:
    """The records of a part of a run.

    Attributes:
        run: The run.
        part: The part of it.

    Example:
        >>> import fleet2d
        >>> run = fleet2d.run("simulation.duration=2 h", seed=4)
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
        rows = {name: _Rows(self.run, name) for name in (self.tables if tables is None else tables)}
        step_us = self.run.manifest["step_us"]
        stride = whole_steps(self.part.every, step_us, "every", InputError)
        steps = stride * max(MAX_POSES // max(len(names), 1), 1)
        for first in range(self.part.first, self.part.end, steps):
            end = min(first + steps, self.part.end)
            yield Chunk(
                first,
                end,
                {
                    name: reader.read(first, end, self.part.every)
                    for name, reader in readers.items()
                },
                {name: table.between(first, end) for name, table in rows.items()},
            )


class _Rows:
    """The rows of a table, read batch by batch where they are stored by step."""

    def __init__(self, run: "Run", name: str) -> None:
        self._batches = _batches(run, name)
        self._schema = run.tables[name].schema
        self._waiting: list[pa.RecordBatch] = []

    def between(self, first: int, end: int) -> "pa.Table":
        """Return the rows of steps from `first` to before `end`, which follow those before."""
        import pyarrow as pa

        parts: list[pa.RecordBatch] = []
        while True:
            if not self._waiting:
                batch = next(self._batches, None)
                if batch is None:
                    break
                self._waiting.append(batch)
            batch = self._waiting.pop()
            step = batch.column("step").to_numpy(zero_copy_only=False)
            low, high = np.searchsorted(step, (first, end))
            parts.append(batch.slice(low, high - low))
            if high < len(step):
                self._waiting.append(batch.slice(high))
                break
        return pa.Table.from_batches(parts, self._schema)


def _batches(run: "Run", name: str) -> "Iterator[pa.RecordBatch]":
    """Yield the rows of a table in order of step."""
    table = run.tables[name]
    step = table["step"].to_numpy()
    if np.any(step[1:] < step[:-1]):  # such as violations, which are listed when they end
        table = table.take(np.argsort(step, kind="stable"))
    yield from table.to_batches(max_chunksize=50_000)
