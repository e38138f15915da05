"""Reading a run back: its manifest and tables, checked against their digests."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from datetime import timedelta
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fleet2d.artifacts.manifest import FILE_NAME, FLOORPLAN_NAME, Manifest, start_of
from fleet2d.artifacts.seal import digest_table, record_of_file, run_digest
from fleet2d.artifacts.unfinished import FOLDER, JOURNAL_NAME, last_commit, read_committed
from fleet2d.configuration.problems import suggest
from fleet2d.configuration.trust import content_of_run, stored_code
from fleet2d.errors import ArtifactError, RunDirectoryError, errors_as, extra, printable
from fleet2d.runtime.clock import Clock
from fleet2d.storage.files import PARTIAL, path_in

if TYPE_CHECKING:
    import pandas as pd
    import polars as pl
    import pyarrow as pa

    from fleet2d.artifacts.store import RunStore
    from fleet2d.floorplan.plan import FloorPlan
    from fleet2d.runs.trajectory import Trajectory


class Tables(Mapping[str, "pa.Table"]):
    """Tables by name, each read when it is first used."""

    def __init__(self, names: Sequence[str], read: Callable[[str], pa.Table]) -> None:
        """Read nothing yet."""
        self._names = tuple(names)
        self._read = read
        self._loaded: dict[str, pa.Table] = {}

    def __getitem__(self, name: str) -> pa.Table:
        """Return a table.

        Raises:
            KeyError: The run has no such table.
            ArtifactError: Its file can't be read.
        """
        if name not in self._names:
            raise KeyError(name)
        if name not in self._loaded:
            self._loaded[name] = self._read(name)
        return self._loaded[name]

    def __contains__(self, name: object) -> bool:
        """Whether the run has a table of that name."""
        return name in self._names

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names."""
        return iter(self._names)

    def __len__(self) -> int:
        """Return the number of tables."""
        return len(self._names)

    def __repr__(self) -> str:
        """List the names of the tables."""
        return f"Tables({', '.join(self._names)})"


class Run:
    """A run that has ended: its manifest and the tables that it stored.

    Attributes:
        directory: The run directory; None for a run in memory.
        manifest: The content of `manifest.json`.
        tables: The tables by name, each read when it is first used.
        notes: Remarks for the user, such as what is missing after a crash.
        trust: Whether code and programs that its scenario names may run.
    """

    def __init__(
        self,
        directory: Path | None,
        manifest: Manifest,
        names: Sequence[str],
        read: Callable[[str], pa.Table],
        notes: Sequence[str] = (),
        *,
        trust: bool = False,
    ) -> None:
        """Read nothing yet; `open_run` and `open_store` create runs."""
        self.directory = directory
        self.manifest: dict[str, Any] = manifest.content()
        self.tables = Tables(names, read)
        self.notes = [*manifest.notes, *notes]
        self.trust = trust
        self._plan: FloorPlan | None = None

    def __repr__(self) -> str:
        """Show the run's directory, status and tables."""
        place = "in memory" if self.directory is None else str(self.directory)
        return f"<Run {place}: {self.status}, tables {', '.join(self.tables)}>"

    @property
    def status(self) -> str:
        """The status: complete, interrupted, failed, or running (still, or until a crash)."""
        return str(self.manifest["status"])

    @property
    def digest(self) -> str | None:
        """Digest of all tables; None if the run was never closed."""
        return self.manifest["digest"]

    @property
    def clock(self) -> Clock:
        """The steps of the run and their local times."""
        manifest = self.manifest
        return Clock(start_of(manifest), manifest["step_us"], manifest["steps"])

    @property
    def metrics(self) -> dict[str, Any]:
        """Summary of the metrics."""
        return dict(self.manifest["metrics"])

    @property
    def plan(self) -> FloorPlan:
        """The floor plan that the run took place in.

        Raises:
            ArtifactError: The run directory holds none.
        """
        if self._plan is None:
            from fleet2d.floorplan.native import read_native

            path = path_in(self.directory or Path(), FLOORPLAN_NAME)
            if self.directory is None or not path.is_file():
                raise ArtifactError(f"{path} is missing: the run can't be shown in its home")
            source = self.manifest["scenario"].get("floorplan")
            cell = source.get("cell") if isinstance(source, dict) else None
            if not isinstance(cell, int | float) or isinstance(cell, bool) or not 0 < cell < 10:
                raise ArtifactError(
                    f"{self.directory}/{FILE_NAME}: scenario.floorplan.cell should be the size of"
                    f" a cell [m], but is {str(cell)[:60]}"
                )
            self._plan = read_native(path, cell)
        return self._plan

    @plan.setter
    def plan(self, plan: FloorPlan) -> None:
        self._plan = plan

    def running_code(self) -> AbstractContextManager[None]:
        """Return a context in which the code of a trusted run may run, for example to repeat it.

        Raises:
            UntrustedCodeError: The run has code of its own, and isn't trusted.
        """
        title = self.directory or "the run"
        return stored_code(title, content_of_run(self.manifest), trust=self.trust)

    def path(self, entity: str, every: timedelta | str = timedelta(minutes=1)) -> Trajectory:
        """Return the poses of a user or robot at regular times, rebuilt exactly from key frames.

        Args:
            entity: Its name.
            every: Time between two poses, such as "10 s", a multiple of the step.

        Raises:
            ArtifactError: The run stored no key frames, there is no such body, or `every` is no
                duration or no multiple of the step.
        """
        from pydantic_core import PydanticCustomError

        from fleet2d.configuration.units import parse_duration
        from fleet2d.runs.trajectory import rebuild_path

        with errors_as(ArtifactError, "every", of=PydanticCustomError):
            apart = parse_duration(every)
        return rebuild_path(self, self.plan, entity, apart)

    def arrow(self, name: str) -> pa.Table:
        """Return a table as an Arrow table.

        Raises:
            ArtifactError: The run has no such table, or its file can't be read.
        """
        if name not in self.tables:
            raise ArtifactError(
                f"the run has no table {name!r}{suggest(name, self.tables, 'It has')}"
            )
        return self.tables[name]

    def pandas(self, name: str) -> pd.DataFrame:
        """Return a table as a pandas data frame.

        Raises:
            ArtifactError: See `arrow`.
            InputError: pandas is not installed.
        """
        with extra("pandas", "`pandas` needs pandas; `arrow` has the same table"):
            import pandas as pd  # noqa: F401 - only to check that it is installed
        return self.arrow(name).to_pandas()

    def polars(self, name: str) -> pl.DataFrame:
        """Return a table as a polars data frame.

        Raises:
            ArtifactError: See `arrow`.
            InputError: polars is not installed.
        """
        with extra("study", "`polars` needs polars; `arrow` has the same table"):
            import polars as pl
        frame = pl.from_arrow(self.arrow(name))
        assert isinstance(frame, pl.DataFrame)
        return frame

    def verify(self) -> list[str]:
        """Compute all digests again; return the names of the tables that have changed.

        The list ends in `manifest.json` if the digest of the run doesn't fit those of its tables.

        Raises:
            ArtifactError: The run has no digest: it was never closed.
        """
        if self.digest is None:
            raise ArtifactError(
                f"{self.directory or 'the run'} has no digest, because its status is {self.status}:"
                " there is nothing to compare with"
            )
        digests = {name: table["digest"] for name, table in self.manifest["tables"].items()}
        changes = [name for name, digest in digests.items() if self._digest_of(name) != digest]
        return changes if run_digest(digests) == self.digest else [*changes, FILE_NAME]

    def _digest_of(self, name: str) -> str | None:
        """Return the present digest of a table, None if the table can't be read."""
        try:
            if self.directory is not None:
                return record_of_file(path_in(self.directory, f"{name}.parquet")).digest
            return digest_table(self.tables[name])
        except (ArtifactError, KeyError):
            return None


def open_run(directory: Path | str, *, trust: bool = False) -> Run:
    """Open a stored run for reading.

    A run that crashed or failed can be opened, too, with the tables that are complete; `Run.notes`
    lists the others.

    Args:
        directory: The run directory.
        trust: Whether its own code and programs may run when it is repeated, as by `judge`; reading
            runs no code.

    Raises:
        RunDirectoryError: There is no run in that directory, or its manifest is damaged.
    """
    from fleet2d.artifacts.arrow import count_rows

    root = Path(directory)
    if not root.is_dir():
        state = "is a file" if root.exists() else "does not exist"
        raise RunDirectoryError(
            f"{root} {state}: give the directory that `fleet2d run --out` wrote"
        )
    manifest = Manifest.read(root)
    if manifest.digest is None:
        journal = path_in(root, f"{FOLDER}/{JOURNAL_NAME}")
        commit = last_commit(journal)
        if commit is not None:
            read = partial(read_committed, journal, commit.end)
            notes = _end_at_commit(root, manifest, commit.step)
            return Run(root, manifest, sorted(commit.rows), read, notes, trust=trust)
    notes = _state_notes(root, manifest)
    on_disk = {path.name.removesuffix(".parquet") for path in root.glob("*.parquet")}
    if manifest.digest is not None:
        foreign = sorted(f"{name}.parquet" for name in on_disk - manifest.tables.keys())
        notes += [f"no part of the run: {printable(', '.join(foreign))}"] if foreign else []
        on_disk = set()
    names = []
    for name in sorted(on_disk | manifest.tables.keys()):
        try:
            rows = count_rows(path_in(root, f"{name}.parquet"))
        except ArtifactError as error:
            notes.append(str(error))
            if name not in manifest.tables:
                continue
        else:
            stored_rows = manifest.tables[name].rows if name in manifest.tables else rows
            if rows != stored_rows:
                notes.append(f"table {name!r} has {rows} rows, but {stored_rows} were stored")
        names.append(name)
    return Run(root, manifest, names, partial(_read_table, root, manifest), notes, trust=trust)


def _read_table(root: Path, manifest: Manifest, name: str) -> pa.Table:
    from fleet2d.artifacts.arrow import read_parquet

    record = manifest.tables.get(name)
    kinds = {column.name: column.kind for column in record.columns} if record else None
    return read_parquet(path_in(root, f"{name}.parquet"), kinds)


def open_store(store: RunStore) -> Run:
    """Open the run in a store for reading; its code has run already.

    Raises:
        ArtifactError: The store is not closed yet.
    """
    if not store.is_closed:
        raise ArtifactError("the run is not closed yet: close() it before reading it")
    if store.directory is None or store.root is None:
        return Run(None, store.manifest, store.names, store.arrow, trust=True)
    is_there = _is_at(store.directory, store.root)
    return open_run(store.directory if is_there else store.root, trust=True)


def _is_at(path: Path, root: Path) -> bool:
    """Whether a path still leads to a directory: components may have changed the current one."""
    try:
        return path.absolute() == root
    except OSError:  # the current directory no longer exists
        return False


def _end_at_commit(root: Path, manifest: Manifest, step: int) -> list[str]:
    """Let the manifest of an unfinished run end at its last commit; return a note about it."""
    manifest.steps = step
    manifest.simulated_s = step * manifest.step_us / 1e6
    states = {
        "running": "is unfinished: it crashed, or is still going on",
        "failed": "failed",
        "interrupted": "was interrupted",
    }
    state = states.get(manifest.status, "is unfinished")
    return [
        f"{root} {state}; everything before step {step} can be read, and `fleet2d resume {root}`"
        " continues the run"
    ]


def _state_notes(root: Path, manifest: Manifest) -> list[str]:
    """Return notes on what is missing in a run that isn't complete."""
    states = {
        "running": "was not closed: the run crashed, or is still going on; only tables that are"
        " whole can be read",
        "failed": "failed: it holds what was stored until then",
        "interrupted": "was interrupted: it holds what was stored until then",
    }
    notes = [f"{root} {states[manifest.status]}"] if manifest.status in states else []
    if names := sorted(path.name for path in root.glob(f"*.parquet{PARTIAL}")):
        notes.append(f"cut off and not readable: {printable(', '.join(names))}")
    return notes
