"""The data of a run for the page, computed when it is first requested, and the page in one file."""

import base64
import io
import json
import math
import shutil
import tempfile
import threading
import weakref
from collections.abc import Callable
from datetime import timedelta
from functools import cached_property
from itertools import compress
from pathlib import Path
from typing import Any

import numpy as np

from fleet2d.artifacts.table import categories
from fleet2d.engine.repeat import decisions_of
from fleet2d.errors import ArtifactError, InputError, extra, os_errors_as
from fleet2d.kernels import TURN
from fleet2d.runs.moments import KEY_FRAMES, key_frame_rows, positions
from fleet2d.runs.run import Run
from fleet2d.storage.files import path_in, write_atomically
from fleet2d.viewing.contract import PostureFacts, RunFacts, SightingFacts, WallsFacts
from fleet2d.viewing.home_facts import WallsHistory, walls_facts
from fleet2d.viewing.postures import posture_facts
from fleet2d.viewing.run_facts import run_facts, run_title, sightings_of

POSES = "poses"
"""A table that replaces `key_frames` for the page in runs with random walks."""
DECISIONS = "decisions"
FILM_AROUND_US = 30_000_000
FILM_SPEED = 4.0
MAX_POSES = 200_000
MAX_ROWS = 1 << 17


class PageData:
    """The data of a run for the page.

    Attributes:
        run: The run.
        title: Its title.
    """

    def __init__(self, run: Run) -> None:
        """Wrap a run; nothing is computed yet."""
        self.run = run
        self.title = run_title(run)
        self._lock = threading.Lock()

    @cached_property
    def _walls(self) -> WallsHistory:
        return WallsHistory(self.run)

    @cached_property
    def facts(self) -> RunFacts:
        """Everything about the run except its tables.

        Raises:
            ArtifactError: The run has no floor plan, or is damaged.
        """
        facts = run_facts(self.run, self._walls)
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

    def all_walls(self) -> list[WallsFacts]:
        """Return the walls of each different arrangement of doors and furniture in the run."""
        return [walls_facts(mesh) for mesh in self._walls.meshes]

    @cached_property
    def sightings(self) -> list[SightingFacts]:
        """The stretches in which robots noticed users."""
        return sightings_of(self.run)

    @cached_property
    def postures(self) -> PostureFacts:
        """The stretches in which people sit or lie, and where."""
        return posture_facts(self.run, self.run.plan)

    def table_path(self, name: str) -> Path:
        """Return the Parquet file of a table.

        Decisions that the run didn't store are taken from its repetition.

        Raises:
            ArtifactError: The run has no such table, or can't be repeated for it.
            Fleet2DError: See `decisions_of`.
        """
        if name == POSES and self._walks_every_us:
            return self._temporary_file(POSES, self._poses)
        if name == DECISIONS and name not in self.run.tables:
            return self._temporary_file(name, lambda: decisions_of(self.run))
        if name not in self.run.tables:
            raise ArtifactError(f"the run has no table {name!r}")
        if self.run.directory is not None:
            path = path_in(self.run.directory, f"{name}.parquet")
            if path.is_file():
                return path
        # A run in memory has no file, and an unfinished one has its rows in a journal.
        return self._temporary_file(name, lambda: self.run.tables[name])

    def _temporary_file(self, name: str, table: Callable[[], Any]) -> Path:
        """Return a temporary file of a table that is not a file of a run directory."""
        with self._lock:
            path = self._temporary_folder / f"{name}.parquet"
            if not path.exists():
                write_table(table(), path)
        return path

    @cached_property
    def _temporary_folder(self) -> Path:
        folder = Path(tempfile.mkdtemp(prefix="fleet2d-view-"))
        weakref.finalize(self, shutil.rmtree, folder, ignore_errors=True)
        return folder

    def film_path(self, step: int) -> Path:
        """Return a film of the minute around a step, at four times real time.

        Raises:
            InputError: The run has no such step, or PyAV or matplotlib isn't installed.
            ArtifactError: The run stored no key frames.
        """
        with extra("viz", "a film needs matplotlib"):
            from fleet2d.viewing.film import write_film
        steps = self.run.manifest["steps"]
        step_us = self.run.manifest["step_us"]
        if not 0 <= step < steps:
            raise InputError(f"there is no step {step} to film: the last is {steps - 1}")
        around = max(1, FILM_AROUND_US // step_us)
        with self._lock:
            path = self._temporary_folder / f"{step}.mp4"
            if not path.exists():
                first = max(0, step - around)
                end = min(steps, step + around)
                write_film(self.run, path, first, end, speed=FILM_SPEED)
        return path

    @cached_property
    def _walks_every_us(self) -> int:
        """The interval of positions in `poses` [us]; 0 if the run has no random walks."""
        if "key_frames" not in self.run.tables:
            return 0
        kinds = self.run.tables["key_frames"]["kind"].cast("string")
        if "walk" not in kinds.unique().to_pylist():
            return 0
        step_us = self.run.manifest["step_us"]
        steps = self.run.manifest["steps"]
        return int(step_us * -(-steps // MAX_POSES))

    @cached_property
    def tracks(self) -> bytes:
        """The key frames of all bodies as plain arrays, little-endian, which a page reads at once.

        First the number of key frames of each body, float64, users before robots. Then for all of
        them, body by body: time [us since the start], float64; x and y [lattice], int32; step,
        int32; heading [1/4096 turn], int16; whether it is away, and whether it begins a piece that
        was planned, uint8.
        """
        from fleet2d.artifacts.arrow import values_of

        run = self.run
        table = self._poses() if self._walks_every_us else run.tables[KEY_FRAMES]
        entity, names = categories(table["entity"])
        kind, kinds = categories(table["kind"])
        bodies = self._bodies
        numbers = [bodies.index(name) if name in bodies else len(bodies) for name in names]
        body = np.array(numbers, np.int64)[entity]
        order = np.argsort(body, kind="stable")
        counts = np.bincount(body, minlength=len(bodies))[: len(bodies)]
        order = order[: counts.sum()]
        home = self.facts["home"]
        left, bottom = home["origin_units"]
        units = home["units_per_m"]
        heading = np.floor(values_of(table["heading"]) * (TURN / math.tau) + 0.5)
        planned = kinds.index("planned") if "planned" in kinds else len(kinds)
        parts: list[tuple[str, Any]] = [
            ("<f8", values_of(table["time"]) - run.clock.stamp(0).astype(np.int64)),
            ("<i4", np.floor(values_of(table["x"]) * units + 0.5) - left),
            ("<i4", np.floor(values_of(table["y"]) * units + 0.5) - bottom),
            ("<i4", values_of(table["step"])),
            ("<i2", heading.astype(np.int64) % TURN),
            ("u1", values_of(table["away"])),
            ("u1", kind == planned),
        ]
        content = [values[order].astype(dtype).tobytes() for dtype, values in parts]
        return counts.astype("<f8").tobytes() + b"".join(content)

    def _poses(self) -> Any:
        """Return positions of everybody at equal intervals, in the columns of key_frames."""
        import pyarrow as pa

        interval = timedelta(microseconds=self._walks_every_us)
        parts = [positions(self.run, name, interval) for name in self._bodies]
        return pa.concat_tables(parts)

    @property
    def _bodies(self) -> list[str]:
        """The names of users, then of robots."""
        entities = self.run.manifest["entities"]
        return [*entities["users"], *entities["robots"]]


def compact_json(content: Any) -> bytes:
    """Return content as JSON without spaces."""
    return json.dumps(content, separators=(",", ":"), allow_nan=False).encode()


def write_file(path: Path, content: bytes) -> None:
    """Write a file; readers see all of it, or none.

    Raises:
        InputError: It can't be written.
    """
    with os_errors_as(InputError, f"{path} can't be written"):
        write_atomically(path, content)


def write_table(table: Any, target: Path | io.BytesIO) -> None:
    """Write a table as Parquet, with the encodings of the tables of a run directory."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    delta_names = []
    texts = []
    for field in table.schema:
        if pa.types.is_int64(field.type) or pa.types.is_timestamp(field.type):
            delta_names.append(field.name)
        if pa.types.is_dictionary(field.type) or pa.types.is_string(field.type):
            texts.append(field.name)
    pq.write_table(
        table,
        target,
        compression="zstd",
        use_dictionary=texts,
        column_encoding=dict.fromkeys(delta_names, "DELTA_BINARY_PACKED"),
        row_group_size=MAX_ROWS,
    )


PAGE = Path(__file__).parent / "page"
POLICY = (
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:"
)


def export_html(run: Run, path: Path, first: int = 0, end: int | None = None) -> None:
    """Write a run, or a part of it, as one self-contained HTML file.

    Args:
        run: The run.
        path: The file; an existing file is replaced.
        first: The first step to show.
        end: The step after the last; None for the end of the run.

    Raises:
        InputError: The part is empty, or the file can't be written.
        ArtifactError: The run has no floor plan, or is damaged.
    """
    data = PageData(run)
    steps = run.manifest["steps"]
    end = steps if end is None else end
    if not 0 <= first < end <= steps:
        raise InputError(
            f"from step {first} to {end} there is nothing to show: the run has {steps}"
        )
    write_file(path, html_of([embedded_run(data, first, end)]).encode())


def embedded_run(data: PageData, first: int, end: int) -> dict[str, Any]:
    """Return all data of a run that the page needs, as its type ``EmbeddedRun``."""
    facts: RunFacts = {**data.facts, "first_step": first, "end_step": end}
    is_whole = first == 0 and end == facts["steps"]
    names = [table["name"] for table in facts["tables"]]
    if facts["walks_every_s"] > 0:
        names = [POSES if name == KEY_FRAMES else name for name in names]
    part = None if is_whole else (first, end)
    return {
        "facts": facts,
        "sightings": [_cut(lane, first, end) for lane in data.sightings],
        "postures": data.postures,
        "walls": data.all_walls(),
        "tables": {name: _base64_table(data, name, part) for name in names},
    }


def html_of(runs: list[dict[str, Any]]) -> str:
    """Return the page with its script, its style and its data in one document."""
    # Escaped, so that no text of a run can end the element around it.
    data = compact_json(runs).decode().replace("<", "\\u003c")
    script = (PAGE / "page.js").read_text(encoding="utf-8").replace("</script", "<\\/script")
    style = (PAGE / "page.css").read_text(encoding="utf-8")
    return f"""\
<!doctype html>
<html lang="en"><head><meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="{POLICY}">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<title>Fleet2D</title>
<style>{style}</style></head>
<body><div id="page"></div>
<script type="application/json" id="fleet2d-runs">{data}</script>
<script type="module">{script}</script></body></html>
"""


def _base64_table(data: PageData, name: str, part: tuple[int, int] | None) -> str:
    """Return a table as a Parquet file in base64."""
    path = data.table_path(name)
    if part is None:
        return base64.b64encode(path.read_bytes()).decode()
    import pyarrow.parquet as pq

    table = pq.read_table(path)
    rows = _rows(table, name, *part)
    content = io.BytesIO()
    write_table(table.take(rows), content)
    return base64.b64encode(content.getvalue()).decode()


def _rows(table: Any, name: str, first: int, end: int) -> Any:
    """Return the indices of the rows of a table that matter between two steps."""
    step = table["step"].to_numpy()
    if name in (KEY_FRAMES, POSES):
        return key_frame_rows(table, first, end)
    if name.startswith("layer."):
        return np.arange(len(step))
    if name == "observations":
        return np.flatnonzero((step >= first) & (step < end))
    return np.flatnonzero(step < end)  # earlier rows still hold: doors, beliefs, activities


def _cut(lane: SightingFacts, first: int, end: int) -> SightingFacts:
    """Return the stretches of a lane that lie between two steps."""
    is_inside = (np.array(lane["last"]) >= first) & (np.array(lane["first"]) < end)
    return SightingFacts(
        robot=lane["robot"],
        user=lane["user"],
        first=list(compress(lane["first"], is_inside)),
        last=list(compress(lane["last"], is_inside)),
        false=list(compress(lane["false"], is_inside)),
    )
