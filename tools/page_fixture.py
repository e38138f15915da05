"""Write the fixture of the page's unit tests: a run, and its state at some steps as Python has it.

`python tools/page_fixture.py` writes ``page/test/run.json``. The run and the expectations belong
together, so the file only needs to be written again when the page reads something new.
"""

import json
from datetime import timedelta
from pathlib import Path
from typing import Any

import numpy as np

import fleet2d
from fleet2d.floorplan.home import Home
from fleet2d.sight.fov import VisibleRegion
from fleet2d.viewing.page_data import PageData, embedded_run
from fleet2d.viewing.pictures.life import SightWalls

TARGET = Path(__file__).parents[1] / "page" / "test" / "run.json"
SCENARIO: dict[str, Any] = {
    "extends": "bundled:paper",
    "simulation": {"duration": {"days": 1}, "seed": 11},
    "floorplan": {"layers": {"explored": {}}},
    "objects": {
        "bath_door": {"type": "door", "doorway": "bathroom_1", "closes_after": "10 s"},
        "office_door": {"type": "door", "doorway": "office_1", "open": False},
    },
}
STEPS = 200


def main() -> None:
    """Write the file."""
    data = PageData(fleet2d.run(SCENARIO))
    run = data.run
    draw = np.random.default_rng(0)
    steps = np.sort(draw.choice(run.manifest["steps"], STEPS, replace=False))
    interval = timedelta(microseconds=run.manifest["step_us"])
    poses = {}
    for name in (*run.manifest["entities"]["users"], *run.manifest["entities"]["robots"]):
        path = run.path(name, interval)
        poses[name] = {
            "x": path.x[steps].tolist(),
            "y": path.y[steps].tolist(),
            "heading": path.heading[steps].tolist(),
            "away": path.away[steps].tolist(),
            "room": path.room[steps].tolist(),
        }
    walls = SightWalls.of(Home(run.plan))
    path = run.path("astro", interval)
    regions = [
        {"x": x, "y": y, "area": VisibleRegion(walls, x, y).area_m2}
        for x, y in zip(path.x[steps[:40]].tolist(), path.y[steps[:40]].tolist(), strict=True)
    ]
    expected = {"steps": steps.tolist(), "poses": poses, "regions": regions}
    content = {"run": embedded_run(data, 0, run.manifest["steps"]), "expected": expected}
    TARGET.write_text(json.dumps(content, separators=(",", ":")) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
