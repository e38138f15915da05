"""Import a user's own components: from the folder of the scenario that names them."""

import hashlib
import importlib
import re
import sys
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.machinery import PathFinder
from pathlib import Path
from types import ModuleType
from typing import Any

from fleet2d.errors import ScenarioError
from fleet2d.paths import folder_of
from fleet2d.problems import did_you_mean
from fleet2d.trust import check_trust

_PREFIX = "fleet2d_scenario_"
_FOLDERS: dict[str, Path] = {}  # the package that stands for a scenario's folder -> the folder


_FOLDERS_BY_PATH: dict[Path, str] = {}


class BrokenModule(ScenarioError):
    """A module that fails while it is imported; ``why`` says where, for all that it defines."""

    def __init__(self, name: str, why: str) -> None:
        super().__init__(f"can't import {name!r}: {why}")
        self.why = why


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


def import_class(name: str, *, is_plugin: bool = False) -> object:
    """Import what 'folder/package.module:Class' names, or 'folder/module.py:Class'.

    Args:
        name: The class.
        is_plugin: Whether an installed package declares it, so that its user wants it.

    Raises:
        BrokenModule: the module fails while it is imported.
        ScenarioError: there is no such module, or no such class in it.
    """
    path, _, qualname = name.rpartition(":")
    written, slash, module_name = path.removesuffix(".py").rpartition("/")
    folder = (folder_of(name) / (written + slash)).resolve()
    if not all(part.isidentifier() for part in (*module_name.split("."), *qualname.split("."))):
        raise ScenarioError(f"can't import {name!r}: write module:Class or folder/module:Class")
    if not is_plugin:
        check_trust(name, files_of(folder, module_name))
    try:
        module = _import_module(folder, module_name)
    except (Exception, SystemExit) as error:  # whatever the user's module does at its import
        missing = public_name(error.name or "") if isinstance(error, ModuleNotFoundError) else ""
        if missing and f"{module_name}.".startswith(f"{missing}."):
            raise ScenarioError(
                f"can't import {name!r}: no module named {missing!r} in {folder} or installed"
                f"{did_you_mean(module_name, _modules(folder, module_name))}"
            ) from error
        raise BrokenModule(name, _failure(error, folder)) from error
    found: Any = module
    for part in qualname.split("."):
        if not hasattr(found, part):
            raise ScenarioError(_no_class(module, qualname, folder))
        found = getattr(found, part)
    return found


def public_name(text: str) -> str:
    """Write the modules in a text as users know them, without the package for their folder."""
    return re.sub(rf"\b{_PREFIX}[0-9a-f]+\.", "", text)


def _modules(folder: Path, name: str) -> list[str]:
    """Return the names of the modules beside the one that is named."""
    *packages, _ = name.split(".")
    files = sorted(folder.joinpath(*packages).glob("*.py"))
    packed = sorted(folder.joinpath(*packages).glob("*/__init__.py"))
    names = [*(file.stem for file in files), *(file.parent.name for file in packed)]
    return [".".join((*packages, found)) for found in names if found != "__init__"]


def _no_class(module: ModuleType, qualname: str, folder: Path) -> str:
    """Say that a class isn't in its module, and which are."""
    file = getattr(module, "__file__", None)
    shown = _shown(file, folder) if file else f"the module {public_name(module.__name__)}"
    names = [
        name
        for name, value in vars(module).items()
        if isinstance(value, type) and value.__module__ == module.__name__ and name[0] != "_"
    ]
    has = f"It has: {', '.join(names)}" if names else "It defines no class"
    return f"{shown} has no class {qualname!r}{did_you_mean(qualname, names)} {has}"


def _failure(error: BaseException, folder: Path) -> str:
    """Say where in the user's files an import failed, and how."""
    what = f"{type(error).__name__}: {public_name(str(error))}"
    if isinstance(error, SyntaxError) and error.filename:
        return (
            f"{_shown(error.filename, folder)}:{error.lineno}: {type(error).__name__}: {error.msg}"
        )
    frames = [
        frame
        for frame in traceback.extract_tb(error.__traceback__)
        if not frame.filename.startswith("<") and frame.filename != __file__
    ]
    own = [frame for frame in frames if Path(frame.filename).is_relative_to(folder)] or frames
    return f"{_shown(own[-1].filename, folder)}:{own[-1].lineno}: {what}" if own else what


def _shown(file: str, folder: Path) -> str:
    path = Path(file)
    return path.relative_to(folder).as_posix() if path.is_relative_to(folder) else file


def files_of(folder: Path, name: str) -> list[Path]:
    """Return the files that importing a module would run and that aren't loaded yet.

    A module that is in no folder and isn't installed is given by the file that it would be.
    """
    parts = name.split(".")
    file = folder.joinpath(*parts).with_suffix(".py")
    package = file.with_suffix("") / "__init__.py"
    if not (file.is_file() or package.is_file()):
        if parts[0] == "fleet2d" or name in sys.modules:
            return []
        installed = PathFinder.find_spec(parts[0], sys.path)
        origin = installed.origin if installed else None
        return [Path(origin) if origin else file]
    for loaded in (name, f"{_FOLDERS_BY_PATH.get(folder)}.{name}"):
        if getattr(sys.modules.get(loaded), "__file__", None) in (str(file), str(package)):
            return []
    around = [folder.joinpath(*parts[:n], "__init__.py") for n in range(1, len(parts))]
    return [*(path for path in around if path.is_file()), file if file.is_file() else package]


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
    name = f"{_PREFIX}{hashlib.sha256(str(folder).encode()).hexdigest()[:16]}"
    if name not in _FOLDERS:
        package = ModuleType(name)
        package.__path__ = [str(folder)]
        sys.modules[name] = package
        _FOLDERS[name], _FOLDERS_BY_PATH[folder] = folder, name
    return name


def is_scenario_module(name: str) -> bool:
    """Return whether a module was imported from the folder of a scenario."""
    return name.partition(".")[0] in _FOLDERS


def written_path(cls: type) -> str:
    """Write where a class is so that :func:`lookup` finds it from anywhere."""
    package, _, module = cls.__module__.partition(".")
    if package in _FOLDERS:
        return f"{_FOLDERS[package].as_posix()}/{module}:{cls.__qualname__}"
    return f"{cls.__module__}:{cls.__qualname__}"
