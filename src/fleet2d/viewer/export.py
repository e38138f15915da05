"""A run as one HTML file that plays anywhere, without a server or the internet."""

import base64
import io
import json
from pathlib import Path
from typing import Any

import numpy as np

from fleet2d.errors import InputError
from fleet2d.runs.run import Run
from fleet2d.viewer.contract import RunFacts, SightingFacts
from fleet2d.viewer.files import write_whole
from fleet2d.viewer.part import KEY_FRAMES, key_frame_rows
from fleet2d.viewer.shown_run import POSES, ShownRun, write_table

PAGE = Path(__file__).parent / "page"
POLICY = (
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:"
)


def export_html(run: Run, path: Path, first: int = 0, end: int | None = None) -> None:
    """Write a run, or a part of it, as one self-contained HTML file.

    Args:
        run: The run.
        path: The file; one that is there is replaced.
        first: The first step to show.
        end: The step before which to end; None for the end of the run.

    Raises:
        InputError: The part is empty, or the file can't be written.
        ArtifactError: The run has no floor plan, or is damaged.
    """
    shown = ShownRun(run)
    steps = run.manifest["steps"]
    end = steps if end is None else end
    if not 0 <= first < end <= steps:
        raise InputError(
            f"from step {first} to {end} there is nothing to show: the run has {steps}"
        )
    write_whole(path, html_of([embedded_run(shown, first, end)]).encode())


def embedded_run(shown: ShownRun, first: int, end: int) -> dict[str, Any]:
    """Return all that the page needs of a run; ``EmbeddedRun`` of the page."""
    facts: RunFacts = {**shown.facts, "first_step": first, "end_step": end}
    whole = first == 0 and end == facts["steps"]
    tables = {}
    for table in facts["tables"]:
        name = table["name"]
        if name == KEY_FRAMES and facts["walks_every_s"] > 0:
            name = POSES
        tables[name] = _packed(shown, name, None if whole else (first, end))
    return {
        "facts": facts,
        "sightings": [_cut(lane, first, end) for lane in shown.sightings],
        "walls": [shown.walls(number) for number in range(shown.arrangements)],
        "tables": tables,
    }


def html_of(runs: list[dict[str, Any]]) -> str:
    """Return the page with its script, its style and its data inside."""
    # No text of a run may end the element that it stands in.
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


def _packed(shown: ShownRun, name: str, part: tuple[int, int] | None) -> str:
    """Return a table as a Parquet file in base64."""
    path = shown.table_path(name)
    if part is None:
        return base64.b64encode(path.read_bytes()).decode()
    import pyarrow.parquet as pq

    table = pq.read_table(path)
    rows = _rows(table, name, *part)
    packed = io.BytesIO()
    write_table(table.take(rows), packed)
    return base64.b64encode(packed.getvalue()).decode()


def _rows(table: Any, name: str, first: int, end: int) -> Any:
    """Return which rows of a table matter between two steps."""
    step = table["step"].to_numpy()
    if name in (KEY_FRAMES, POSES):
        return key_frame_rows(table, first, end)
    if name.startswith("layer."):
        return np.arange(len(step))
    if name == "observations":
        return np.flatnonzero((step >= first) & (step < end))
    return np.flatnonzero(step < end)  # what was so before still holds: doors, beliefs, activities


def _cut(lane: SightingFacts, first: int, end: int) -> SightingFacts:
    """Return the stretches of a lane that lie between two steps."""
    kept = [
        i
        for i, (low, high) in enumerate(zip(lane["first"], lane["last"], strict=True))
        if high >= first and low < end
    ]
    return SightingFacts(
        robot=lane["robot"],
        user=lane["user"],
        first=[lane["first"][i] for i in kept],
        last=[lane["last"][i] for i in kept],
        false=[lane["false"][i] for i in kept],
    )
