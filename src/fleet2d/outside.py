"""Import a user's own components: from the folder of the scenario that names them."""

import hashlib
import importlib
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any

from fleet2d.errors import ScenarioError
from fleet2d.paths import folder_of

_FOLDERS: dict[str, Path] = {}  # the package that stands for a scenario's folder -> the folder


@contextmanager
def importable(folder: Path) -> Iterator[None]:
    """Let imports find modules in ``folder``, and forget them afterwards.

    Two scenarios may each have a ``helpers.py``: who imported one keeps it, the next gets its own.
    """
    before = set(sys.modules)
    sys.path.insert(0, str(folder))
    try:
        yield
    finally:
        sys.path.remove(str(folder))
        for name in set(sys.modules) - before:
            file = getattr(sys.modules[name], "__file__", None)
            own = name.partition(".")[0] in _FOLDERS
            if file and not own and Path(file).is_relative_to(folder):
                del sys.modules[name]


def import_class(name: str) -> object:
    """Import what 'folder/package.module:Class' names."""
    path, _, qualname = name.rpartition(":")
    written, slash, module_name = path.rpartition("/")
    folder = (folder_of(name) / (written + slash)).resolve()
    try:
        found: Any = _import_module(folder, module_name)
        for part in qualname.split("."):
            found = getattr(found, part)
    except ModuleNotFoundError as error:
        raise ScenarioError(
            f"can't import {name!r}: no module named {error.name!r} in {folder} or installed"
        ) from error
    except AttributeError as error:
        raise ScenarioError(f"can't import {name!r}: {error}") from error
    except Exception as error:  # whatever the user's module does while it is imported
        raise ScenarioError(
            f"can't import {name!r}: {type(error).__name__} in its module: {error}"
        ) from error
    return found


def _import_module(folder: Path, name: str) -> ModuleType:
    """Import a module from ``folder`` under a name of its own, else as an installed one."""
    file = folder.joinpath(*name.split(".")).with_suffix(".py")
    package = file.with_suffix("") / "__init__.py"
    if not (file.is_file() or package.is_file()):
        return importlib.import_module(name)
    loaded = sys.modules.get(name)
    if loaded is not None and getattr(loaded, "__file__", None) in (str(file), str(package)):
        return loaded
    with importable(folder):
        return importlib.import_module(f"{_folder_package(folder)}.{name}")


def _folder_package(folder: Path) -> str:
    """Return the name of a package whose modules are those in ``folder``."""
    name = f"fleet2d_scenario_{hashlib.sha256(str(folder).encode()).hexdigest()[:16]}"
    if name not in _FOLDERS:
        package = ModuleType(name)
        package.__path__ = [str(folder)]
        sys.modules[name] = package
        _FOLDERS[name] = folder
    return name


def written_path(cls: type) -> str:
    """Write where a class is so that :func:`lookup` finds it from anywhere."""
    package, _, module = cls.__module__.partition(".")
    if package in _FOLDERS:
        return f"{_FOLDERS[package].as_posix()}/{module}:{cls.__qualname__}"
    return f"{cls.__module__}:{cls.__qualname__}"
