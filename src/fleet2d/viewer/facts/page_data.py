"""The data of a run for the page, computed when it is first requested."""

import io
import json
import shutil
import tempfile
import weakref
from datetime import timedelta
from functools import cached_property
from pathlib import Path
from typing import Any

from fleet2d.errors import ArtifactError
from fleet2d.runs.run import Run
from fleet2d.storage.files import path_in
from fleet2d.viewer.facts.contract import RunFacts, SightingFacts, WallsFacts
from fleet2d.viewer.facts.home_facts import walls_facts
from fleet2d.viewer.facts.run_facts import run_facts, run_title
from fleet2d.viewer.facts.sightings import sightings_of
from fleet2d.viewer.facts.walls import WallsHistory, doors_of
from fleet2d.viewer.part import positions

POSES = "poses"
"""A table that replaces `key_frames` for the page in runs with random walks."""
MOST_POSES = 200_000
MOST_ROWS = 1 << 17


class PageData:
    """The data of a run for the page.

    Attributes:
        run: The run.
        title: Its title.
    """

    def __init__(self, run: Run) -> None:
        """Take a run; nothing is computed."""
        self.run = run
        self.title = run_title(run)
        self._folder: Path | None = None

    @cached_property
    def _walls(self) -> WallsHistory:
        return WallsHistory(self.run, self._doors)

    @cached_property
    def _doors(self) -> Any:
        return doors_of(self.run)

    @cached_property
    def facts(self) -> RunFacts:
        """Everything about the run except its tables.

        Raises:
            ArtifactError: The run has no floor plan, or is damaged.
        """
        facts = run_facts(self.run, self._doors, self._walls)
        facts["walks_every_s"] = self._walks_every_us / 1e6
        return facts

    @cached_property
    def facts_json(self) -> bytes:
        """The facts as JSON."""
        return compact_json(self.facts)

    def walls(self, number: int) -> WallsFacts:
        """Return the walls that block sight in one of the run's arrangements.

        Raises:
            ArtifactError: There is no such arrangement.
        """
        return walls_facts(self._walls.mesh(number))

    @property
    def arrangements(self) -> int:
        """The number of different arrangements of doors and furniture in the run."""
        return self._walls.count

    @cached_property
    def sightings(self) -> list[SightingFacts]:
        """The stretches in which robots noticed users."""
        return sightings_of(self.run)

    def table_path(self, name: str) -> Path:
        """Return the Parquet file of a table.

        Raises:
            ArtifactError: The run has no such table.
        """
        if name == POSES and self._walks_every_us:
            return self._temporary_file(POSES, self._poses)
        if name not in self.run.tables:
            raise ArtifactError(f"the run has no table {name!r}")
        if self.run.directory is not None:
            path = path_in(self.run.directory, f"{name}.parquet")
            if path.is_file():
                return path
        # A run in memory, or an unfinished one, whose rows are in its journal.
        return self._temporary_file(name, lambda: self.run.tables[name])

    def _temporary_file(self, name: str, table: Any) -> Path:
        """Return a temporary file of a table that is not a file of a run directory."""
        if self._folder is None:
            self._folder = Path(tempfile.mkdtemp(prefix="fleet2d-view-"))
            weakref.finalize(self, shutil.rmtree, self._folder, ignore_errors=True)
        path = self._folder / f"{name}.parquet"
        if not path.exists():
            write_table(table(), path)
        return path

    @cached_property
    def _walks_every_us(self) -> int:
        """The interval of positions in `poses` [us]; 0 if the run has no random walks."""
        if "key_frames" not in self.run.tables:
            return 0
        kinds = self.run.tables["key_frames"]["kind"].cast("string")
        if "walk" not in kinds.unique().to_pylist():
            return 0
        step_us, steps = self.run.manifest["step_us"], self.run.manifest["steps"]
        return int(step_us * -(-steps // MOST_POSES))

    def _poses(self) -> Any:
        """Return positions of everybody at equal intervals, in the columns of key_frames."""
        import pyarrow as pa

        entities = self.run.manifest["entities"]
        interval = timedelta(microseconds=self._walks_every_us)
        names = (*entities["users"], *entities["robots"])
        parts = [positions(self.run, name, interval) for name in names]
        return pa.concat_tables(parts)


def compact_json(content: Any) -> bytes:
    """Return content as JSON without spaces."""
    return json.dumps(content, separators=(",", ":"), allow_nan=False).encode()


def write_table(table: Any, target: Path | io.BytesIO) -> None:
    """Write a table as Parquet, with the encodings of the tables of a run directory."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    names = {field.name: field.type for field in table.schema}
    delta_names = [n for n, t in names.items() if pa.types.is_int64(t) or pa.types.is_timestamp(t)]
    texts = [n for n, t in names.items() if pa.types.is_dictionary(t) or pa.types.is_string(t)]
    pq.write_table(
        table,
        target,
        compression="zstd",
        use_dictionary=texts,
        column_encoding=dict.fromkeys(delta_names, "DELTA_BINARY_PACKED"),
        row_group_size=MOST_ROWS,
    )
