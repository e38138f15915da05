"""One HTML file with everything in it."""

import base64
import io
import json
import re
import subprocess
import sys

import numpy as np
import pyarrow.parquet as pq
import pytest

import fleet2d
from fleet2d.errors import InputError
from fleet2d.viewing.page_data import PageData, embedded_run, export_html, html_of

DATA = re.compile(r'<script type="application/json" id="fleet2d-runs">(.*?)</script>', re.DOTALL)


def runs_in(path):
    match = DATA.search(path.read_text(encoding="utf-8"))
    assert match
    return json.loads(match[1])


def test_file_holds_the_run_and_loads_nothing(run_dir, tmp_path):
    target = tmp_path / "run.html"
    export_html(fleet2d.open_run(run_dir), target)
    (embedded,) = runs_in(target)
    assert fleet2d.open_run(run_dir).digest == embedded["facts"]["digest"]
    assert b"PAR1" == base64.b64decode(embedded["tables"]["events"])[:4]
    outside = re.sub(
        r"<script.*?</script>|<style>.*?</style>", "", target.read_text(), flags=re.DOTALL
    )
    assert not re.search(r'(src|href)="(?!data:)', outside)
    assert "default-src 'none'" in outside


def test_first_picture_waits_for_no_pandas(run_dir):
    # Importing it takes longer than all else that a month's first picture needs of the server.
    work = f"""
import sys
from pathlib import Path
from fleet2d.viewing.served_runs import ServedRuns
runs = ServedRuns([Path({str(run_dir)!r})])
runs.preload()
assert runs.data(0).postures["use"] is not None
print("pandas" in sys.modules)
"""
    ended = subprocess.run([sys.executable, "-c", work], capture_output=True, text=True, check=True)
    assert "False" == ended.stdout.strip()


def test_decisions_that_were_not_stored_are_those_of_the_run(run_dir):
    run = fleet2d.open_run(run_dir)
    data = PageData(run)
    table = pq.read_table(data.table_path("decisions")).to_pylist()
    rows = [row for row in table if row["entity"] == "astro"]
    assert {"patrol", "hangout"} == {row["behavior"] for row in rows}
    explores = [row for row in run.tables["events"].to_pylist() if row["event"] == "explores"]
    decided = {row["step"]: row["reason"] for row in rows}
    assert explores
    assert all(f"explores {row['detail']}" == decided[row["step"]] for row in explores)


def test_part_of_a_run_keeps_poses_within_it_and_drops_the_rest(run_dir):
    data = PageData(fleet2d.open_run(run_dir))
    complete, part = embedded_run(data, 0, 9 * 3600), embedded_run(data, 3600, 7200)
    assert (3600, 7200) == (part["facts"]["first_step"], part["facts"]["end_step"])
    assert len(part["tables"]["key_frames"]) < len(complete["tables"]["key_frames"]) / 2
    rows = pq.read_table(io.BytesIO(base64.b64decode(part["tables"]["key_frames"])))
    for name in ("ana", "astro"):
        steps = rows.filter(rows["entity"].cast("string").to_numpy(False) == name)[
            "step"
        ].to_pylist()
        assert min(steps) <= 3600


def test_text_of_a_run_can_not_end_its_element(run_dir):
    embedded = embedded_run(PageData(fleet2d.open_run(run_dir)), 0, 3600)
    embedded["facts"]["title"] = "</script><script>alert(1)</script>"
    assert "<script>alert" not in html_of([embedded])


@pytest.mark.parametrize(("first", "end"), [(5, 5), (-1, 9), (0, 10**9)])
def test_empty_part_is_refused(run_dir, tmp_path, first, end):
    with pytest.raises(InputError, match="nothing to show"):
        export_html(fleet2d.open_run(run_dir), tmp_path / "x.html", first, end)


def test_file_that_can_not_be_written_is_an_input_error(run_dir, tmp_path):
    with pytest.raises(InputError, match="can't be written"):
        export_html(fleet2d.open_run(run_dir), tmp_path / "no" / "x.html")


def test_tracks_are_the_key_frames_body_by_body(run_dir):
    run = fleet2d.open_run(run_dir)
    data, frames = PageData(run), run.tables["key_frames"].to_pylist()
    bodies = [*run.manifest["entities"]["users"], *run.manifest["entities"]["robots"]]
    counts = np.frombuffer(data.tracks, "<f8", len(bodies))
    assert [sum(row["entity"] == name for row in frames) for name in bodies] == counts.tolist()
    total, offset = len(frames), 8 * len(bodies)
    assert offset + total * 24 == len(data.tracks)
    x = np.frombuffer(data.tracks, "<i4", total, offset + 8 * total)
    first = [row for row in frames if row["entity"] == bodies[0]]
    home = data.facts["home"]
    assert [row["x"] for row in first] == pytest.approx(
        ((x[: len(first)] + home["origin_units"][0]) / home["units_per_m"]).tolist(), abs=1e-9
    )
