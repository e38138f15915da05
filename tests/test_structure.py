"""How the code is laid out: circles of imports, class names, and the map."""

import ast
import re
import subprocess
import sys
from collections import defaultdict
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components
from tools import package_map

ROOT = Path(package_map.ROOT)
MODULES = dict(package_map.modules())
LONGEST_CIRCLE = 2
# What the bundled scenario of the paper doesn't name, and so doesn't import.
SELDOM = (
    "engine.conversations", "engine.encounters", "engine.sighting_errors", "engine.snapshot",
    "engine.world", "floorplan.checkup", "floorplan.rooms.division",
    "sight.built_in_errors", "sight.cached_fov", "storage.apart",
)  # fmt: skip


def circles(graph):
    """Return the modules of each circle of imports; one that is in none is alone."""
    names = sorted(graph)
    edges = np.array([[other in graph[name] for other in names] for name in names])
    _, numbers = connected_components(csr_array(edges), connection="strong")
    found = defaultdict(list)
    for name, number in zip(names, numbers, strict=True):
        found[number].append(name)
    return list(found.values())


@pytest.mark.slow
def test_modules_form_no_circle_longer_than_two():
    graph = {name: set(imports(name, path)) for name, path in MODULES.items()}

    assert [] == [circle for circle in circles(graph) if len(circle) > LONGEST_CIRCLE]


def test_a_run_imports_what_its_scenario_names_alone():
    code = (
        "import sys, fleet2d\n"
        "fleet2d.run('bundled:paper', 'simulation.duration=1 min', seed=4)\n"
        "print(*sys.modules)"
    )
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    loaded = done.stdout.split()

    assert "fleet2d.engine.loop" in loaded
    assert [] == [name for name in SELDOM if f"fleet2d.{name}" in loaded]


def imports(name, path: Path) -> Iterator[str]:
    """Yield the modules that a module imports: at once, later, or for types only."""
    for node in definitions(path):
        if isinstance(node, ast.Import):
            targets = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = base_of(node, name, path)
            both = ((f"{base}.{alias.name}", base) for alias in node.names)
            targets = [inner if inner in MODULES else outer for inner, outer in both]
        else:
            continue
        yield from (target for target in targets if target in MODULES and target != name)


@cache
def definitions(path: Path) -> list[ast.Import | ast.ImportFrom | ast.ClassDef]:
    """Return all imports and classes of a module, at its top and within."""
    kinds = (ast.Import, ast.ImportFrom, ast.ClassDef)
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return [node for node in ast.walk(tree) if isinstance(node, kinds)]


def base_of(node: ast.ImportFrom, name, path: Path):
    """Return the absolute name of the module that an import takes names from."""
    if not node.level:
        return node.module or ""
    parts = name.split(".") if path.name == "__init__.py" else name.split(".")[:-1]
    return ".".join(
        [*parts[: len(parts) - node.level + 1], *([node.module] if node.module else [])]
    )


def test_map_of_packages_is_that_of_the_contract():
    page = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    drawn = page.split(package_map.BEGIN)[1].split(package_map.END)[0]

    assert names_in(drawn) == names_in(package_map.picture()), "run python tools/package_map.py"


def names_in(picture):
    """Return the first word of each line; what a package is may be said anew."""
    return [line.split()[0] for line in picture.splitlines()]


def test_files_that_contributing_names_are_there():
    page = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    page = page[
        page.index("## How a step is computed") : page.index("## Add a function to the core")
    ]
    names = [
        name
        for name in re.findall(r"`([\w/]+(?:/|\.(?:[chp]pp|md|py|tsx?|yaml)))`", page)
        if "NAME" not in name
    ]

    assert len(names) > 40
    places = [ROOT, ROOT / "src" / "fleet2d"]
    assert [] == [name for name in names if not any((place / name).exists() for place in places)]


@pytest.mark.slow
def test_no_two_classes_have_the_same_name():
    places = {}
    for module, path in MODULES.items():
        for node in definitions(path):
            if isinstance(node, ast.ClassDef):
                places.setdefault(node.name.lstrip("_"), []).append(module)

    assert {} == {name: modules for name, modules in places.items() if len(modules) > 1}
