"""Import of users' own components, from the folder of a scenario or installed packages."""

import importlib
import inspect
import os
import re
import sys
import traceback
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import ModuleType
from typing import Any
from weakref import WeakKeyDictionary

from fleet2d.configuration.code_files import (
    PREFIX,
    files_of,
    is_class_path,
    package_of,
    parts_of,
    source_of,
    with_imports,
)
from fleet2d.configuration.problems import did_you_mean
from fleet2d.configuration.trust import check_may_import
from fleet2d.configuration.units import folder_of
from fleet2d.errors import ScenarioError, may_be_ctrl_c, text_of

# The folders of scenarios by the packages that their modules are imported into.
_FOLDERS: dict[str, Path] = {}
# The folders of the modules that are being imported now, innermost last.
_SEARCHED: list[Path] = []
# The folders of components in modules that a scenario's modules imported from beside them.
_BESIDE: WeakKeyDictionary[type, Path] = WeakKeyDictionary()


class BrokenModule(ScenarioError):
    """A module whose import fails; ``cause`` describes the failure."""

    def __init__(self, name: str, cause: str) -> None:
        super().__init__(f"can't import {name!r}: {cause}")
        self.cause = cause


def import_class(name: str, *, is_plugin: bool = False) -> object:
    """Import a class by its path: 'folder/package.module:Class' or 'folder/module.py:Class'.

    Args:
        name: The path of the class.
        is_plugin: Whether an installed package declares it, which needs no trust.

    Raises:
        BrokenModule: the module fails while it is imported.
        ScenarioError: there is no such module, or no such class in it.
    """
    parent, module_name, qualname = parts_of(name)
    folder = (folder_of(name) / parent).resolve()
    if not is_class_path(name):
        raise ScenarioError(f"can't import {name!r}: write module:Class or folder/module:Class")
    if not is_plugin:
        check_may_import(name, folder, module_name)
    is_file = bool(parent) or name.rpartition(":")[0].endswith(".py")
    if is_file and source_of(folder, module_name) is None:
        raise ScenarioError(
            f"can't import {name!r}: there is no {module_name.replace('.', '/')}.py in {folder}"
            f"{did_you_mean(module_name, _modules(folder, module_name))}"
        )
    try:
        if is_plugin:  # a plugin isn't a module of that name beside the scenario
            module = importlib.import_module(module_name)
        else:
            module = _import_module(folder, module_name)
    except BaseException as error:  # the user's module may raise anything
        if may_be_ctrl_c(error):
            raise
        unknown = public_name(error.name or "") if isinstance(error, ModuleNotFoundError) else ""
        if unknown and f"{module_name}.".startswith(f"{unknown}."):
            raise ScenarioError(
                f"can't import {name!r}: no module named {unknown!r} in {folder} or installed"
                f"{did_you_mean(module_name, _modules(folder, module_name))}"
            ) from error
        raise BrokenModule(name, _failure(error, folder)) from error
    value: Any = module
    for part in qualname.split("."):
        if not hasattr(value, part):
            raise ScenarioError(_no_class(module, qualname, folder))
        value = getattr(value, part)
    return value


def _import_module(folder: Path, name: str) -> ModuleType:
    """Import a module from ``folder`` into the folder's package, else as an installed module."""
    file = source_of(folder, name)
    if file is None:
        return importlib.import_module(name)
    module = sys.modules.get(name)
    if module is not None and getattr(module, "__file__", None) == str(file):
        return module
    package = package_of(folder)
    if package not in _FOLDERS:
        sys.modules[package] = ModuleType(package)
        sys.modules[package].__path__ = [str(folder)]
        _FOLDERS[package] = folder
    with _importable(folder):
        return importlib.import_module(f"{package}.{name}")


@contextmanager
def _importable(folder: Path) -> Iterator[None]:
    """Search imports in ``folder``, too, and remove its modules from `sys.modules` afterwards.

    If a module changes the current folder, this is undone: other paths are relative to it. No
    bytecode is written into the folder.

    Two scenarios may each have a ``helpers.py``: each imports its own.
    """
    old_modules = set(sys.modules)
    current_folder = Path.cwd()
    writes_bytecode = sys.dont_write_bytecode
    sys.dont_write_bytecode = True
    importlib.invalidate_caches()  # a file may have been written just now
    sys.path.insert(0, str(folder))
    _SEARCHED.append(folder)
    try:
        yield
    finally:
        os.chdir(current_folder)
        sys.dont_write_bytecode = writes_bytecode
        _SEARCHED.pop()
        sys.path.remove(str(folder))
        for name in set(sys.modules) - old_modules:
            module = sys.modules[name]
            places = [getattr(module, "__file__", None), *getattr(module, "__path__", ())]
            is_beside = any(_is_beside(Path(place), folder) for place in places if place)
            if is_beside and not is_scenario_module(name):
                del sys.modules[name]


def _is_beside(file: Path, folder: Path) -> bool:
    """Whether a file is in a folder, but in no environment that is installed there."""
    return file.is_relative_to(folder) and "site-packages" not in file.relative_to(folder).parts


def public_name(text: str) -> str:
    """Return a text with modules named as users know them, without the package of their folder."""
    return re.sub(rf"\b{PREFIX}[0-9a-f]+(\.?)", lambda match: "" if match[1] else ".", text)


def _modules(folder: Path, name: str) -> list[str]:
    """Return the names of all modules in the folder of a module."""
    *packages, _ = name.split(".")
    files = sorted(folder.joinpath(*packages).glob("*.py"))
    packed = sorted(folder.joinpath(*packages).glob("*/__init__.py"))
    names = [*(file.stem for file in files), *(file.parent.name for file in packed)]
    return [".".join((*packages, module)) for module in names if module != "__init__"]


def _no_class(module: ModuleType, qualname: str, folder: Path) -> str:
    """Return the message that a class isn't in its module, with those that are."""
    file = getattr(module, "__file__", None)
    place = _short_path(file, folder) if file else f"the module {public_name(module.__name__)}"
    names = [
        name
        for name, value in vars(module).items()
        if isinstance(value, type) and value.__module__ == module.__name__ and name[0] != "_"
    ]
    classes = f"It has: {', '.join(names)}" if names else "It defines no class"
    return f"{place} has no class {qualname!r}{did_you_mean(qualname, names)} {classes}"


def _failure(error: BaseException, folder: Path) -> str:
    """Describe the failure of an import, with the line in the user's files."""
    if isinstance(error, SyntaxError) and error.filename:
        file = _short_path(error.filename, folder)
        return f"{file}:{error.lineno}: {type(error).__name__}: {error.msg}"
    is_ours = isinstance(error, ScenarioError)
    text = public_name(text_of(error)).partition("\n\nFor further information")[0]
    message = text if is_ours else f"{type(error).__name__}: {text}"
    frames = [
        frame
        for frame in traceback.extract_tb(error.__traceback__)
        if not frame.filename.startswith("<") and frame.filename != __file__
    ]
    frames = [frame for frame in frames if Path(frame.filename).is_relative_to(folder)] or frames
    if not frames:
        return message
    return f"{_short_path(frames[-1].filename, folder)}:{frames[-1].lineno}: {message}"


def _short_path(file: str, folder: Path) -> str:
    path = Path(file)
    return path.relative_to(folder).as_posix() if path.is_relative_to(folder) else file


def source_files(cls: type) -> list[Path]:
    """Return the file of a user's own class, and the files beside it that it imports."""
    package, _, name = cls.__module__.partition(".")
    folder = _FOLDERS.get(package) or _BESIDE.get(cls)
    if folder is not None:
        parts = (name if package in _FOLDERS else cls.__module__).split(".")
        return with_imports(files_of(folder, parts), folder)
    source = None
    with suppress(TypeError, OSError):  # a class of an interactive interpreter has no file
        source = inspect.getsourcefile(cls)
    return [Path(source)] if source and Path(source).is_file() else []


def is_scenario_module(name: str) -> bool:
    """Return whether a module was imported from the folder of a scenario."""
    return name.partition(".")[0] in _FOLDERS


def class_path(cls: type) -> str:
    """Return the path of a class from which `import_class` imports it anywhere."""
    package, _, module = cls.__module__.partition(".")
    if package in _FOLDERS:
        return f"{_FOLDERS[package].as_posix()}/{module}:{cls.__qualname__}"
    # A module may import another one beside it, which then is found by this folder, too.
    file = getattr(sys.modules.get(cls.__module__), "__file__", None)
    if file and _SEARCHED and Path(file) in files_of(_SEARCHED[-1], cls.__module__.split(".")):
        _BESIDE[cls] = _SEARCHED[-1]
        return f"{_SEARCHED[-1].as_posix()}/{cls.__module__}:{cls.__qualname__}"
    return f"{cls.__module__}:{cls.__qualname__}"
