"""Attacks on `--trust`: files beside the code that is listed, and checkpoints that name other code.

Each planted file leaves the file `ran` if its code runs.
"""

import importlib
import io
import os
import pickle
import py_compile
import shutil
import sys
from collections.abc import Callable
from importlib.machinery import EXTENSION_SUFFIXES
from importlib.util import cache_from_source
from pathlib import Path
from typing import Any

import pytest
from tests.scenes import fleet2d_process

from fleet2d import _core
from fleet2d.configuration.trust import Trust, check_code, import_class, restrict
from fleet2d.engine.snapshot import read_state
from fleet2d.errors import ArtifactError, ScenarioError
from fleet2d.scenario.model import load_scenario

OWN = "import fleet2d\nclass Own(fleet2d.Algorithm):\n    def update(self, history, state):\n        return {'n': 1.0}\n"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder from elsewhere, which is the current one, with `mine.py`."""
    (tmp_path / "mine.py").write_text(OWN)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def evil(folder: Path) -> str:
    return f"from pathlib import Path\nPath({str(folder / 'ran')!r}).touch()\n{OWN}"


def compiled(folder: Path, target: Path, *, like: Path | None = None) -> None:
    """Write bytecode that leaves a file; with the size and time of a source, as Python checks."""
    source = folder / "evil.txt"
    text = evil(folder)
    if like is not None:
        size = like.stat().st_size
        if len(text) > size:
            like.write_text(like.read_text() + "#" * (len(text) - size))
        text += "#" * (like.stat().st_size - len(text))
    source.write_text(text)
    if like is not None:
        os.utime(source, ns=(like.stat().st_atime_ns, like.stat().st_mtime_ns))
    target.parent.mkdir(exist_ok=True, parents=True)
    py_compile.compile(str(source), str(target), doraise=True)
    source.unlink()


def plant_cached_bytecode(folder: Path) -> None:
    compiled(folder, Path(cache_from_source(str(folder / "mine.py"))), like=folder / "mine.py")


def plant_unchecked_bytecode(folder: Path) -> None:
    source = folder / "evil.txt"
    source.write_text(evil(folder))
    mode = py_compile.PycInvalidationMode.UNCHECKED_HASH
    target = cache_from_source(str(folder / "mine.py"))
    py_compile.compile(str(source), target, doraise=True, invalidation_mode=mode)


def plant_extension(folder: Path) -> None:
    shutil.copy(_core.__file__, folder / f"mine{EXTENSION_SUFFIXES[0]}")


@pytest.mark.parametrize(
    "plant", [plant_cached_bytecode, plant_unchecked_bytecode, plant_extension]
)
def test_listed_source_is_what_runs(folder: Path, plant: Callable[[Path], None]) -> None:
    """`--trust mine.py` ran bytecode or a library of the same name, which nobody was shown."""
    plant(folder)

    with restrict(Trust.of(["mine.py"])):
        cls = import_class(f"{folder}/mine:Own")

    assert cls.__name__ == "Own"  # type: ignore[attr-defined]
    assert not (folder / "ran").exists()


IMPORTS = [
    "import helpers",
    "from helpers import Own as Other",
    "import importlib; importlib.import_module('help' + 'ers')",
    "from . import helpers",
    "import parts.helpers",
    "from .parts import helpers",
]


@pytest.mark.parametrize("kind", ["bytecode", "packed bytecode", "extension", "computed"])
@pytest.mark.parametrize("text", IMPORTS)
def test_nothing_else_of_the_folder_is_importable(folder: Path, text: str, kind: str) -> None:
    """A sourceless `helpers.pyc` beside the trusted file was neither listed nor asked for."""
    for place in (folder, folder / "parts"):
        place.mkdir(exist_ok=True)
        if kind == "bytecode":
            compiled(folder, place / "helpers.pyc")
        elif kind == "packed bytecode":
            compiled(folder, place / "helpers" / "__init__.pyc")
        elif kind == "extension":
            shutil.copy(_core.__file__, place / f"helpers{EXTENSION_SUFFIXES[0]}")
        else:
            (place / "helpers.py").write_text(evil(folder))
    (folder / "mine.py").write_text(f"{text}\n{OWN}")

    with restrict(Trust.of(["mine.py"])), pytest.raises(ScenarioError) as caught:
        import_class(f"{folder}/mine:Own")
    with restrict(Trust.of(["mine.py"])), pytest.raises(ScenarioError):
        import_class(f"{folder}/helpers:Own")

    assert not (folder / "ran").exists()
    assert "helpers" in str(caught.value) or "cannot import" in str(caught.value)
    assert "fleet2d_scenario_" not in str(caught.value)


def test_import_at_run_time_is_refused_too(folder: Path) -> None:
    """A trusted module may import another when it is called, long after it was checked."""
    compiled(folder, folder / "helpers.pyc")
    (folder / "mine.py").write_text(f"{OWN}def late():\n    from . import helpers\n")

    with restrict(Trust.of(["mine.py"])):
        cls: Any = import_class(f"{folder}/mine:Own")
        with pytest.raises(ImportError):
            sys.modules[cls.__module__].late()

    assert not (folder / "ran").exists()


def test_source_that_has_changed_since_it_was_named_is_refused(folder: Path) -> None:
    trust = Trust.of(["mine.py"])
    (folder / "mine.py").write_text(evil(folder))

    with restrict(trust), pytest.raises(ScenarioError, match="changed since it was named"):
        import_class(f"{folder}/mine:Own")

    assert not (folder / "ran").exists()


def test_list_shows_the_hash_of_each_file(folder: Path) -> None:
    with restrict(Trust()), pytest.raises(ScenarioError) as caught:
        check_code("it", {"algorithms": {"own": {"type": f"{folder}/mine:Own"}}})

    (digest,) = Trust.of(["mine.py"]).files.values()
    assert f"{folder}/mine.py (algorithms.own.type) SHA-256 {digest}" in str(caught.value)


def test_named_files_of_a_package_without_init_are_importable(folder: Path) -> None:
    (folder / "parts").mkdir()
    (folder / "parts" / "helpers.py").write_text("SIZE = 3")
    (folder / "mine.py").write_text(f"import parts.helpers\nfrom .parts.helpers import SIZE\n{OWN}")

    with restrict(Trust.of(["mine.py", "parts/helpers.py"])):
        assert import_class(f"{folder}/mine:Own")


def test_own_code_keeps_its_extension_modules_and_leaves_no_bytecode(folder: Path) -> None:
    """What a user runs from an own scenario isn't restricted."""
    compiled(folder, folder / "helpers.pyc")
    (folder / "mine.py").write_text(f"import helpers\n{OWN}")

    assert import_class(f"{folder}/mine:Own")
    assert (folder / "ran").exists()
    assert not (folder / "__pycache__").exists()


class Named:
    """Pickled, it is the name of a class."""

    def __init__(self, module: str, name: str) -> None:
        self.module, self.name = module, name

    def content(self) -> bytes:
        return (
            b"\x80\x04"
            + b"".join(
                b"\x8c" + bytes([len(word)]) + word.encode() for word in (self.module, self.name)
            )
            + b"\x93."
        )


def test_checkpoint_imports_no_other_module_of_a_trusted_folder(folder: Path) -> None:
    """`--trust-dir` or a trusted package let a pickle import any module there, listed or not."""
    (folder / "other.py").write_text(evil(folder))
    package = folder / "installed"
    (package / "pack").mkdir(parents=True)
    (package / "pack" / "__init__.py").write_text(OWN)
    (package / "pack" / "other.py").write_text(evil(folder))
    sys.path.append(str(package))
    try:
        with restrict(Trust.of([folder])):
            types = {"one": f"{folder}/mine:Own", "two": "pack:Own"}
            scenario = load_scenario(
                None, *(f"algorithms.{name}.type={value!r}" for name, value in types.items())
            )
            top = type(scenario.algorithms["one"]).__module__.partition(".")[0]
            for module in (f"{top}.other", "other", "pack.other", "mine.other"):
                content = Named(module, "Own").content()
                with pytest.raises(ArtifactError, match="can't be part of a state"):
                    read_state(io.BytesIO(content), {"scenario": scenario})
                assert not (folder / "ran").exists()
            for module in (f"{top}.mine", "mine", "pack"):  # a name, which is no state
                with pytest.raises(ArtifactError, match="holds no state of a run"):
                    read_state(io.BytesIO(Named(module, "Own").content()), {"scenario": scenario})
    finally:
        sys.path.remove(str(package))
        sys.modules.pop("pack", None)


def test_checkpoint_names_only_classes_of_listed_files(folder: Path) -> None:
    """A loaded module of another scenario, or of an installed package, was nameable unlisted."""
    (folder / "other.py").write_text(OWN)
    (folder / "parts.py").write_text("class Part:\n    pass\n")
    (folder / "mine.py").write_text(f"from .parts import Part\n{OWN}")
    package = folder / "installed" / "pack"
    package.mkdir(parents=True)
    (package / "__init__.py").write_text(f"from pack.used import Used\n{OWN}")
    (package / "used.py").write_text("class Used:\n    pass\n")
    (package / "unused.py").write_text(OWN)
    sys.path.append(str(package.parent))
    try:
        importlib.import_module("pack.unused")
        other: Any = import_class(f"{folder}/other:Own")
        with restrict(Trust.of(["mine.py", "parts.py", package / "__init__.py"])):
            scenario = load_scenario(
                None, f"algorithms.a.type='{folder}/mine:Own'", "algorithms.b.type='pack:Own'"
            )
            top = other.__module__.partition(".")[0]
            for module, name, is_nameable in (
                (other.__module__, "Own", False),
                ("other", "Own", False),
                ("pack.unused", "Own", False),
                ("mine", "Own", True),
                (f"{top}.parts", "Part", True),
                ("pack", "Own", True),
                ("pack.used", "Used", True),
            ):
                expected = "holds no state" if is_nameable else "can't be part of a state"
                with pytest.raises(ArtifactError, match=expected):
                    read_state(io.BytesIO(Named(module, name).content()), {"scenario": scenario})
    finally:
        sys.path.remove(str(package.parent))
        for name in ("pack", "pack.used", "pack.unused"):
            sys.modules.pop(name, None)


@pytest.mark.slow
def test_command_line_runs_the_listed_source(tmp_path: Path) -> None:
    """The whole way: a run with planted files beside its code, resumed in another process."""
    (tmp_path / "mine.py").write_text(OWN)
    done = fleet2d_process(
        "run", "simulation.duration=1 h", "algorithms.own.type=mine:Own", "--seed", "4",
        "--out", "run", "--quiet", cwd=tmp_path,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    plant_unchecked_bytecode(tmp_path)

    done = fleet2d_process("reproduce", "run", "--trust", "mine.py", cwd=tmp_path)

    assert done.returncode == 0, done.stderr
    assert not (tmp_path / "ran").exists()


def test_pickle_of_the_names_is_what_python_reads() -> None:
    assert pickle.loads(Named("pathlib", "Path").content()) is Path
