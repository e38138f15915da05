"""The files that a user's module imports, found in its text."""

from pathlib import Path

import pytest

from fleet2d.configuration.code_files import with_imports


def names(folder: Path, *files):
    paths = with_imports([folder / name for name in files], folder)
    return [path.relative_to(folder).as_posix() for path in paths]


@pytest.fixture
def folder(tmp_path):
    """A folder with `a.py`, `b.py` and the package `p` of `p.c` and `p.q.d`."""
    for name in ("a", "b", "p/__init__", "p/c", "p/q/__init__", "p/q/d"):
        path = tmp_path / f"{name}.py"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    return tmp_path


@pytest.mark.parametrize(
    ("text", "imported"),
    [
        ("import numpy, os.path, b", ["b.py"]),
        ("from b import speed as s", ["b.py"]),
        ("def late():\n    if True:\n        import b", ["b.py"]),
        ("import p.c", ["p/__init__.py", "p/c.py"]),
        ("from p import c", ["p/__init__.py", "p/c.py"]),
        ("from .p.q import d", ["p/__init__.py", "p/q/__init__.py", "p/q/d.py"]),
        ("from . import b", ["b.py"]),
        ("from p import *", ["p/__init__.py"]),
        ("import a", []),
        ("from ................................. import x", []),
        ("import b as", []),  # it can't be imported
        ("x = '\\d'", []),  # without a warning
        ("(" * 10_000, []),
        ("\0", []),
    ],
)
def test_each_file_beside_a_module_is_found(folder, text, imported):
    (folder / "a.py").write_text(text)
    assert ["a.py", *imported] == names(folder, "a.py")


def test_files_that_import_each_other_are_found_once(folder):
    (folder / "a.py").write_text("import b")
    (folder / "b.py").write_text("import a, p.q.d")
    (folder / "p/q/d.py").write_text("from .. import c")
    every = {"a.py", "b.py", "p/__init__.py", "p/c.py", "p/q/__init__.py", "p/q/d.py"}
    found = names(folder, "a.py", "b.py")
    assert (every, len(every)) == (set(found), len(found))
