"""What holds for every kernel: how it is compiled, that it is once, and where it is kept."""

import ast
import json
import subprocess
import sys
import warnings
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

import numba
import numpy as np
import pytest
from tests.homes import needs_jit

import fleet2d.kernels
from fleet2d.kernels import _jit

KERNELS = Path(fleet2d.kernels.__file__).parent
SOURCES = sorted(KERNELS.parent.rglob("*.py"))
MODULES = sorted(path.stem for path in KERNELS.glob("*.py") if not path.stem.startswith("_"))

# The kernels that Python calls once or more in every run: compiled for one set of types each.
CALLED_FROM_PYTHON = (
    "look.look",
    "mesh.rasterize_cells",
    "mesh.build_buckets",
    "motion.trace_track",
    "motion.time_route",
    "cells.label_triangles",
    "routes.build_route_graph",
    "routes.find_route",
)

COUNT_SIGNATURES = """
import json
from importlib import import_module
import fleet2d

fleet2d.run(None, "simulation.duration=2 h", seed=4)
counts = {}
for name in %r:
    module = import_module("fleet2d.kernels." + name)
    for kernel in vars(module).values():
        if hasattr(kernel, "signatures") and kernel.py_func.__module__ == module.__name__:
            counts[name + "." + kernel.__name__] = len(kernel.signatures)
print(json.dumps(counts))
"""


def module_of(name: str) -> ModuleType:
    """Return a module of kernels."""
    return import_module(f"fleet2d.kernels.{name}")


def kernel_names(name: str) -> list[str]:
    """Return the functions of a module that carry the decorator, by its source."""
    tree = ast.parse((KERNELS / f"{name}.py").read_text())
    functions = [node for node in tree.body if isinstance(node, ast.FunctionDef)]
    decorated = [f for f in functions if f.decorator_list]
    assert all([ast.unparse(d) for d in f.decorator_list] == ["kernel"] for f in decorated)
    return [f.name for f in decorated]


def every_kernel() -> list[tuple[str, str]]:
    """Return (module, function) of every kernel."""
    return [(module, name) for module in MODULES for name in kernel_names(module)]


def test_there_are_kernels_in_each_module() -> None:
    assert {"random", "headings", "motion", "routes", "look", "cells", "sight"} <= set(MODULES)
    assert all(kernel_names(module) for module in MODULES)


@needs_jit
@pytest.mark.parametrize(("module", "name"), every_kernel())
def test_kernel_is_compiled_with_the_flags_that_keep_runs_the_same(module: str, name: str) -> None:
    kernel = getattr(module_of(module), name)
    options = kernel.targetoptions

    assert not options["fastmath"]
    assert not options.get("parallel", False)
    assert options["nogil"]
    assert options["nopython"]
    assert options["error_model"] == "numpy"
    assert type(kernel._cache).__name__ != "NullCache"
    assert str(_jit.cache_directory()) in str(kernel._cache.cache_path)


def imports_of(path: Path) -> set[str]:
    """Return the top-level packages that a module imports anywhere in it."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name.partition(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names.add(node.module.partition(".")[0])
    return names


@pytest.mark.parametrize("path", SOURCES, ids=lambda p: str(p.relative_to(KERNELS.parent)))
def test_numba_is_imported_in_one_place(path: Path) -> None:
    assert ("numba" in imports_of(path)) == (path == KERNELS / "_jit.py")
    assert path == KERNELS / "_jit.py" or "njit" not in path.read_text()


@needs_jit
def test_a_run_compiles_each_kernel_once() -> None:
    """A second set of types doubles the time of the first run, and hides a type not meant."""
    command = [sys.executable, "-c", COUNT_SIGNATURES % (MODULES,)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr

    counts = json.loads(done.stdout)

    assert dict.fromkeys(CALLED_FROM_PYTHON, 1) == {n: counts[n] for n in CALLED_FROM_PYTHON}


def _with_cache_in(monkeypatch: pytest.MonkeyPatch, folder: Path) -> None:
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(folder))


def test_cache_directory_changes_when_any_source_does(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    for path in KERNELS.glob("*.py"):
        (tmp_path / path.name).write_bytes(path.read_bytes())
    find = _jit.cache_directory.__wrapped__
    _with_cache_in(monkeypatch, tmp_path / "cache")
    here = find()
    monkeypatch.setattr(_jit, "__file__", str(tmp_path / "_jit.py"))
    assert here == find()

    seen = {here}
    for path in sorted(tmp_path.glob("*.py")):
        with path.open("a") as source:
            source.write("# changed\n")
        seen.add(find())

    assert len(seen) == 1 + len(list(KERNELS.glob("*.py")))
    assert {tmp_path / "cache" / "fleet2d"} == {path.parent for path in seen}


@pytest.mark.parametrize(
    ("variables", "expected"),
    [
        ({"NUMBA_CACHE_DIR": "/a", "XDG_CACHE_HOME": "/b"}, Path("/a/fleet2d")),
        ({"XDG_CACHE_HOME": "/b"}, Path("/b/fleet2d")),
        ({}, Path.home() / ".cache" / "fleet2d"),
    ],
)
def test_cache_directory_is_where_the_environment_says(
    monkeypatch: pytest.MonkeyPatch, variables: dict[str, str], expected: Path
) -> None:
    for name in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    for name, value in variables.items():
        monkeypatch.setenv(name, value)

    assert expected == _jit.cache_directory.__wrapped__().parent


def _wrap_around(value: Any) -> Any:
    return value * np.uint64(2)


def test_kernel_leaves_the_cache_of_other_packages_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(numba.config, "CACHE_DIR", "elsewhere")

    _jit.kernel(_wrap_around)

    assert numba.config.CACHE_DIR == "elsewhere"


def test_kernel_without_the_compiler_is_plain_python_that_may_wrap_around(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(numba.config, "DISABLE_JIT", 1)

    plain = _jit.kernel(_wrap_around)

    assert not hasattr(plain, "signatures")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert plain(np.uint64(2**63 + 5)) == 10
