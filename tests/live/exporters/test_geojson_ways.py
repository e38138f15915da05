"""GeoJSON: a way is one line, however the run is read."""

import json
from pathlib import Path

import pytest

import fleet2d
from fleet2d.live import exporters


def ways(path: Path) -> list[tuple[str, str, str, int]]:
    """Return entity, begin, end and number of points of each way."""
    return sorted(
        (p["entity"], p["from"], p["to"], len(feature["geometry"]["coordinates"]))
        for feature in json.loads(path.read_text())["features"]
        if (p := feature["properties"]).get("kind") == "way"
    )


@pytest.mark.parametrize("size", [14, 1000])
def test_ways_do_not_end_where_chunks_do(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, size: int
) -> None:
    run = fleet2d.run(
        "bundled:paper", "simulation.duration=10 min", "simulation.start=2026-01-05T07:00", seed=4
    )
    fleet2d.export(run, tmp_path / "whole.geojson")
    monkeypatch.setattr(exporters, "MAX_POSES", size)

    fleet2d.export(run, tmp_path / "parts.geojson")

    assert ways(tmp_path / "whole.geojson")
    assert ways(tmp_path / "parts.geojson") == ways(tmp_path / "whole.geojson")
