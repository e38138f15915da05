"""A run as one HTML file that plays anywhere, without a server or the internet."""

import base64
import io
import json
from pathlib import Path
from typing import Any

import numpy as np

from fleet2d.errors import InputError
from fleet2d.runs.run import Run
from fleet2d.viewer.facts.contract import RunFacts, SightingFacts
from fleet2d.viewer.facts.page_data import POSES, PageData, write_table
from fleet2d.viewer.files import write_file
from fleet2d.viewer.part import KEY_FRAMES, key_frame_rows

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
    tables = {}
    for table in facts["tables"]:
        name = table["name"]
        if name == KEY_FRAMES and facts["walks_every_s"] > 0:
            name = POSES
        tables[name] = _base64_table(data, name, None if is_whole else (first, end))
    return {
        "facts": facts,
        "sightings": [_cut(lane, first, end) for lane in data.sightings],
        "walls": [data.walls(number) for number in range(data.arrangements)],
        "tables": tables,
    }


def html_of(runs: list[dict[str, Any]]) -> str:
    """Return the page with its script, its style and its data in one document."""
    # Escaped, so that no text of a run can end the element around it.
    data = json.dumps(runs, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    script = (PAGE / "page.js").read_text(encoding="utf-8").replace("</script", "<\\/script")
    style = (PAGE / "page.css").read_text(encoding="utf-8")
    return "\n".join(
        (
            "<!doctype html>",
            '<html lang="en"><head><meta charset="utf-8">',
            f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">',
            '<meta name="viewport" content="width=device-width, initial-scale=1">',
            '<meta name="color-scheme" content="light dark">',
            "<title>Fleet2D</title>",
            f"<style>{style}</style></head>",
            '<body><div id="page"></div>',
            f'<script type="application/json" id="fleet2d-runs">{data}</script>',
            f'<script type="module">{script}</script></body></html>',
            "",
        )
    )


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
    rows = [
        i
        for i, (low, high) in enumerate(zip(lane["first"], lane["last"], strict=True))
        if high >= first and low < end
    ]
    return SightingFacts(
        robot=lane["robot"],
        user=lane["user"],
        first=[lane["first"][i] for i in rows],
        last=[lane["last"][i] for i in rows],
        false=[lane["false"][i] for i in rows],
    )
