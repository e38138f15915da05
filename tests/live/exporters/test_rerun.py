"""What Rerun reads from a recording is what the run stored."""

from pathlib import Path

import numpy as np
import pytest
from tests.live.exporters.worlds import day, part, poses, rows

rr = pytest.importorskip("rerun", reason="the extra rerun is not installed")


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    from fleet2d.live.exporters.rerun import export_rerun

    path = tmp_path_factory.mktemp("rerun") / "day.rrd"
    export_rerun(day(), path, part())
    return path


def table_of(recording: Path, place: str, component: str) -> list[tuple[int, object]]:
    """The steps and values of a component at a place."""
    with rr.server.Server(datasets={"day": [str(recording)]}) as server:
        view = server.client().get_dataset("day").filter_contents([place])
        frame = view.reader(index="step").to_pandas()
    column = next(name for name in frame.columns if name.endswith(component))
    present = frame[frame[column].notna()]
    return list(zip(present["step"].tolist(), present[column].tolist(), strict=True))


@pytest.mark.parametrize("name", ["ana", "ben", "astro"])
def test_poses_are_those_of_the_run_where_they_change(recording: Path, name: str) -> None:
    found = table_of(recording, f"/bodies/{name}", "Points3D:positions")

    at_home = {step: (x, y) for step, x, y, _ in poses(name)}
    shown = {step: places[0][:2] for step, places in found if len(places)}
    assert shown
    for step, place in shown.items():
        np.testing.assert_allclose(at_home[step], place, atol=1e-5)


def test_events_are_there_as_text(recording: Path) -> None:
    found = table_of(recording, "/events/ana", "TextLog:text")

    expected = [row for row in rows("events") if row["entity"] == "ana"]
    assert {row["step"] for row in expected} == {step for step, _ in found}
