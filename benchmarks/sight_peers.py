"""What others make of the poses of benchmarks/sight.py; run by it, in an environment of their own.

    PEERS_PYTHON benchmarks/sight_peers.py TASK.json

pyvispoly is CGAL's triangular expansion with exact numbers, tcod is libtcod's symmetric shadow
casting: see peers_requirements.txt. Prints what each answers, and its time for a pose, as JSON.
"""

import json
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np


def answers(path: Path) -> dict[str, Any]:
    """Look from all poses with each peer that is installed."""
    task = json.loads(path.read_text())
    found: dict[str, Any] = {}
    for name, look in (("CGAL", look_with_cgal), ("libtcod", look_with_tcod)):
        try:
            found[name] = look(task)
        except Exception as error:  # noqa: BLE001, whatever a peer does, the others go on
            found[name] = {"failure": f"not compared: {type(error).__name__}: {error}"}
    return found


def look_with_cgal(task: dict[str, Any]) -> dict[str, Any]:
    """Return the areas of the regions, and the time for one."""
    import pyvispoly as cgal  # type: ignore[import-not-found]

    calculators = []
    for rings in task["rings"]:
        parts = [cgal.Polygon([cgal.Point(x, y) for x, y in ring]) for ring in rings]
        calculators.append(
            (parts[0], cgal.VisibilityPolygonCalculator(cgal.PolygonWithHoles(parts[0], parts[1:])))
        )
    jobs = []
    for x, y in task["eyes"]:
        eye = cgal.Point(x, y)
        jobs += [(calc, eye) for outer, calc in calculators if outer.contains(eye)][:1]
    began = time.perf_counter()
    regions = [calculator.compute_visibility_polygon(eye) for calculator, eye in jobs]
    elapsed = time.perf_counter() - began
    areas = [float(region.area()) for region in regions]
    return {"us": elapsed / len(jobs) * 1e6, "areas": areas}


def look_with_tcod(task: dict[str, Any]) -> dict[str, Any]:
    """Return the cells in range of the first poses, and the time for one."""
    import tcod  # type: ignore[import-not-found]
    import tcod.map  # type: ignore[import-not-found]

    free = np.array(task["free"], dtype=bool)
    eyes = [(y // 64, x // 64) for x, y in task["eyes"]]
    style = {"radius": task["radius"], "algorithm": tcod.constants.FOV_SYMMETRIC_SHADOWCAST}
    tcod.map.compute_fov(free, eyes[0], **style)
    began = time.perf_counter()
    seen = [tcod.map.compute_fov(free, eye, **style) for eye in eyes]
    elapsed = time.perf_counter() - began
    return {
        "us": elapsed / len(eyes) * 1e6,
        "cells": [np.flatnonzero(mask).tolist() for mask in seen[:50]],
    }


if __name__ == "__main__":
    print(json.dumps(answers(Path(sys.argv[1]))))
