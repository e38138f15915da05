"""Users' own code: which of it may run, and its import from the folder of a scenario.

No code of a stored run or of a foreign scenario runs unless the user trusts it.
"""

import ast
import hashlib
import importlib
import inspect
import os
import re
import shlex
import sys
import traceback
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass
from importlib.machinery import PathFinder
from pathlib import Path
from types import ModuleType
from typing import Any, Self
from weakref import WeakKeyDictionary

from fleet2d.bounds import FILE_BYTES, read_bytes
from fleet2d.configuration.problems import did_you_mean
from fleet2d.configuration.units import folder_of
from fleet2d.errors import InputError, RunDirectoryError, ScenarioError, may_be_ctrl_c, text_of


def with_imports(files: Iterable[Path], folder: Path) -> list[Path]:
    """Return files of modules, and the files in their folder that they import, each once.

    An import by a computed name is not found, and neither is one by other code than the modules.

    Args:
        files: The files of the modules.
        folder: The folder in which imports are searched first.

    Example:
        >>> import tempfile
        >>> folder = Path(tempfile.mkdtemp())
        >>> _ = (folder / "mine.py").write_text("import numpy, helpers")
        >>> _ = (folder / "helpers.py").write_text("SPEED = 1")
        >>> [path.name for path in with_imports([folder / "mine.py"], folder)]
        ['mine.py', 'helpers.py']
    """
    known = dict.fromkeys(files)
    queue = list(known)
    while queue:
        new = dict.fromkeys(_imports_of(queue.pop(), folder)).keys() - known.keys()
        known |= dict.fromkeys(sorted(new))
        queue += sorted(new)
    return list(known)


def _imports_of(file: Path, folder: Path) -> Iterator[Path]:
    """Yield the existing files of the modules that a module may import."""
    for node in _nodes_of(file):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield from _files_of(folder, alias.name.split("."))
        elif isinstance(node, ast.ImportFrom):
            start = file.parents[node.level - 1] if 0 < node.level <= len(file.parents) else folder
            module = node.module.split(".") if node.module else []
            for alias in node.names:
                yield from _files_of(start, [*module, alias.name])


def _nodes_of(file: Path) -> Iterator[ast.AST]:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # they are about the user's text
            tree = ast.parse(read_bytes(file, FILE_BYTES))
    except (SyntaxError, ValueError, RecursionError, MemoryError, OSError, InputError):
        return  # it can't be imported either
    yield from ast.walk(tree)


def _files_of(folder: Path, parts: list[str]) -> Iterator[Path]:
    """Yield the files of a module and of its packages, as far as they exist."""
    for part in parts:
        folder = folder / part
        yield from filter(Path.is_file, (folder / "__init__.py", folder.with_name(f"{part}.py")))


# Files that a message lists, at most.
_MOST_LISTED = 20


@dataclass(frozen=True)
class Trust:
    """The files and folders whose code may run: absolute paths, with links resolved.

    Example:
        >>> trust = Trust.of(["/etc"])
        >>> trust.allows(Path("/etc/passwd")), trust.allows(Path("/etc/../bin/sh"))
        (True, False)
    """

    files: frozenset[Path] = frozenset()
    folders: tuple[Path, ...] = ()

    @classmethod
    def of(cls, paths: Iterable[str | Path]) -> Self:
        """Return the trust in files and folders.

        Raises:
            InputError: One doesn't exist.
        """
        files, folders = set(), []
        for path in map(Path, paths):
            if not path.exists():
                raise InputError(f"{path} can't be trusted: there is no such file or folder")
            if path.is_dir():
                folders.append(path.resolve())
            else:
                files.add(path.resolve())
        return cls(frozenset(files), tuple(folders))

    def allows(self, path: Path) -> bool:
        """Whether the code in a file may run."""
        path = path.resolve()
        return path in self.files or any(path.is_relative_to(folder) for folder in self.folders)


_TRUST: ContextVar[Trust | None] = ContextVar("trust", default=None)


@contextmanager
def restrict(trust: Trust | None) -> Iterator[None]:
    """Within the context, import only trusted modules for scenarios; None: all modules.

    Modules that are loaded already can be used in any case.
    """
    token = _TRUST.set(trust)
    try:
        yield
    finally:
        _TRUST.reset(token)


@contextmanager
def restrict_stored(trust: Trust | None = None) -> Iterator[None]:
    """Restrict what is read from a stored run to what the command line, else the caller, trusts."""
    with restrict(_TRUST.get() or trust or Trust()):
        yield


def current_trust() -> Trust | None:
    """Return what is trusted now; None: all code."""
    return _TRUST.get()


def check_trust(name: str, files: Sequence[Path]) -> None:
    """Refuse to import a user's own component whose files aren't trusted.

    Args:
        name: The component, as the scenario names it.
        files: The files that would run.

    Raises:
        ScenarioError: A file is not trusted.
    """
    trust = _TRUST.get()
    if trust is None:
        return
    for file in files:
        if not trust.allows(file):
            raise ScenarioError(f"{name!r} would run {file}: name it by --trust if you trust it")


def check_code(title: str, content: object) -> None:
    """Refuse a scenario or a study that would run code that isn't trusted.

    Args:
        title: The scenario or study, for the message.
        content: Its plain data.

    Raises:
        ScenarioError: The message lists the code; none of it has run.
    """
    trust = _TRUST.get()
    if trust is not None and (refusal := _refusal(title, content, trust)):
        raise ScenarioError(refusal)


def refuse_untrusted(
    directory: Path,
    scenario: Mapping[str, Any],
    interventions: Sequence[Mapping[str, Any]],
    trust: Trust,
) -> None:
    """Refuse a stored run that would run code that isn't trusted.

    Args:
        directory: The run directory.
        scenario: Its scenario, plain data.
        interventions: Its interventions, whose plans may name interrupts of the user's own.
        trust: What is trusted.

    Raises:
        RunDirectoryError: The message lists the code; none of it has run.
    """
    if refusal := _refusal(str(directory), {**scenario, "interventions": interventions}, trust):
        raise RunDirectoryError(refusal)


def _refusal(title: str, content: object, trust: Trust) -> str:
    """Return the message about code that isn't trusted; empty if there is none."""
    code = {file: keys for file, keys in code_of(content).items() if not trust.allows(file)}
    if not code:
        return ""
    lines = [
        f"  {file} ({', '.join(keys[:3])}{', …' * (len(keys) > 3)})"
        for file, keys in list(code.items())[:_MOST_LISTED]
    ]
    if len(code) > _MOST_LISTED:
        lines.append(f"  … {len(code) - _MOST_LISTED} more")
    options = " ".join(f"--trust {shlex.quote(str(file))}" for file in list(code)[:_MOST_LISTED])
    return "\n".join(
        [
            f"{title} has components of its own, which would run:",
            *lines,
            f"None of it has run. Read it; if you trust it, say so: {options}",
        ]
    )


def code_of(scenario: object) -> dict[Path, list[str]]:
    """Return the files that a scenario would run and that aren't loaded, each with the keys of it.

    Example:
        >>> code_of({"algorithms": {"share": {"type": "/home/ana/mine:Share"}}})
        {PosixPath('/home/ana/mine.py'): ['algorithms.share.type']}
    """
    from fleet2d.configuration.units import folder_of

    code: dict[Path, list[str]] = {}
    for key, name in _class_paths(scenario, ()):
        path = name.rpartition(":")[0].removesuffix(".py")
        parent, slash, module = path.rpartition("/")
        try:
            files = files_of((folder_of(name) / (parent + slash)).resolve(), module)
        except (OSError, ValueError):
            continue  # it is not a path: the import will fail
        if name.startswith("bundled:") and not any(file.is_file() for file in files):
            continue  # a scenario that comes with Fleet2D
        for file in files:
            code.setdefault(file, []).append(key)
    return code


def _class_paths(value: object, keys: tuple[str, ...]) -> Iterator[tuple[str, str]]:
    """Yield every text that may be the path of a user's own component, after its key."""
    if isinstance(value, Mapping):
        for key, entry in value.items():
            if key != "extends":  # a file of data, such as bundled:base, which is merged already
                yield from _class_paths(entry, (*keys, str(key)))
    elif isinstance(value, list | tuple):
        for index, entry in enumerate(value):
            yield from _class_paths(entry, (*keys, str(index)))
    elif isinstance(value, str) and _is_class_path(value):
        yield ".".join(keys), value


def _is_class_path(text: str) -> bool:
    """Whether a text has the form of a path of a user's own component: 'folder/module:Class'."""
    path, colon, qualname = text.rpartition(":")
    module = path.removesuffix(".py").rpartition("/")[2]
    parts = (*module.split("."), *qualname.split("."))
    return bool(colon) and all(part.isidentifier() for part in parts)


_PREFIX = "fleet2d_scenario_"
# The folders of scenarios by the packages that their modules are imported into, and the reverse.
_FOLDERS: dict[str, Path] = {}
_PACKAGES: dict[Path, str] = {}
# The folders of the modules that are being imported now, innermost last.
_SEARCHED: list[Path] = []
# The folders of components in modules that a scenario's modules imported from beside them.
_BESIDE: WeakKeyDictionary[type, Path] = WeakKeyDictionary()


class BrokenModule(ScenarioError):
    """A module that fails while it is imported; ``cause`` says where and how."""

    def __init__(self, name: str, cause: str) -> None:
        super().__init__(f"can't import {name!r}: {cause}")
        self.cause = cause


@contextmanager
def importable(folder: Path) -> Iterator[None]:
    """Search imports in ``folder``, too, and remove its modules from `sys.modules` afterwards.

    If a module changes the current folder, this is undone: other paths are relative to it.

    Two scenarios may each have a ``helpers.py``: each imports its own.
    """
    old_modules, current_folder = set(sys.modules), Path.cwd()
    sys.path.insert(0, str(folder))
    _SEARCHED.append(folder)
    try:
        yield
    finally:
        os.chdir(current_folder)
        _SEARCHED.pop()
        sys.path.remove(str(folder))
        for name in set(sys.modules) - old_modules:
            file = getattr(sys.modules[name], "__file__", None)
            if file and not is_scenario_module(name) and Path(file).is_relative_to(folder):
                del sys.modules[name]


def import_class(name: str, *, is_plugin: bool = False) -> object:
    """Import a class by its path: 'folder/package.module:Class' or 'folder/module.py:Class'.

    Args:
        name: The path of the class.
        is_plugin: Whether an installed package declares it, which needs no trust.

    Raises:
        BrokenModule: the module fails while it is imported.
        ScenarioError: there is no such module, or no such class in it.
    """
    path, _, qualname = name.rpartition(":")
    parent, slash, module_name = path.removesuffix(".py").rpartition("/")
    folder = (folder_of(name) / (parent + slash)).resolve()
    if not all(part.isidentifier() for part in (*module_name.split("."), *qualname.split("."))):
        raise ScenarioError(f"can't import {name!r}: write module:Class or folder/module:Class")
    if not is_plugin:
        check_trust(name, files_of(folder, module_name))
    try:
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


def public_name(text: str) -> str:
    """Return a text with modules as users know them, without the package of their folder."""
    return re.sub(rf"\b{_PREFIX}[0-9a-f]+\.", "", text)


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
    """Return where in the user's files an import failed, and how."""
    message = f"{type(error).__name__}: {public_name(text_of(error))}"
    if isinstance(error, SyntaxError) and error.filename:
        file = _short_path(error.filename, folder)
        return f"{file}:{error.lineno}: {type(error).__name__}: {error.msg}"
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


def files_of(folder: Path, name: str) -> list[Path]:
    """Return the files that importing a module would run, unless it is loaded already.

    For a module that doesn't exist it is the file that the module would have.
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
    for full_name in (name, f"{_PACKAGES.get(folder)}.{name}"):
        if getattr(sys.modules.get(full_name), "__file__", None) in (str(file), str(package)):
            return []
    return _files_in(folder, name)


def _files_in(folder: Path, name: str) -> list[Path]:
    """Return the files of a module in a folder and of its packages, and what they import there."""
    return with_imports(_own_files(folder, name), folder)


def _own_files(folder: Path, name: str) -> list[Path]:
    """Return the files of a module in a folder and of its packages."""
    parts = name.split(".")
    packages = [folder.joinpath(*parts[:n], "__init__.py") for n in range(1, len(parts) + 1)]
    file = folder.joinpath(*parts).with_suffix(".py")
    return [path for path in (*packages, file) if path.is_file()]


def source_files(cls: type) -> list[Path]:
    """Return the file of a user's own class, and the files beside it that it imports."""
    package, _, name = cls.__module__.partition(".")
    if package in _FOLDERS:
        return _files_in(_FOLDERS[package], name)
    if cls in _BESIDE:
        return _files_in(_BESIDE[cls], cls.__module__)
    source = None
    with suppress(TypeError, OSError):  # a class of an interactive session
        source = inspect.getsourcefile(cls)
    return [Path(source)] if source and Path(source).is_file() else []


def _import_module(folder: Path, name: str) -> ModuleType:
    """Import a module from ``folder`` into the folder's package, else as an installed module."""
    file = folder.joinpath(*name.split(".")).with_suffix(".py")
    package = file.with_suffix("") / "__init__.py"
    if not (file.is_file() or package.is_file()):
        return importlib.import_module(name)
    module = sys.modules.get(name)
    if module is not None and getattr(module, "__file__", None) in (str(file), str(package)):
        return module
    with importable(folder):
        return importlib.import_module(f"{_folder_package(folder)}.{name}")


def _folder_package(folder: Path) -> str:
    """Return the name of a package whose modules are those in ``folder``."""
    name = f"{_PREFIX}{hashlib.sha256(str(folder).encode()).hexdigest()[:16]}"
    if name not in _FOLDERS:
        package = ModuleType(name)
        package.__path__ = [str(folder)]
        sys.modules[name] = package
        _FOLDERS[name], _PACKAGES[folder] = folder, name
    return name


def is_scenario_module(name: str) -> bool:
    """Return whether a module was imported from the folder of a scenario."""
    return name.partition(".")[0] in _FOLDERS


def class_path(cls: type) -> str:
    """Return the path of a class from which `import_class` imports it anywhere."""
    package, _, module = cls.__module__.partition(".")
    if package in _FOLDERS:
        return f"{_FOLDERS[package].as_posix()}/{module}:{cls.__qualname__}"
    # A module that imports another one beside it: that one will be known by its folder, too.
    file = getattr(sys.modules.get(cls.__module__), "__file__", None)
    if file and _SEARCHED and Path(file) in _own_files(_SEARCHED[-1], cls.__module__):
        _BESIDE[cls] = _SEARCHED[-1]
        return f"{_SEARCHED[-1].as_posix()}/{cls.__module__}:{cls.__qualname__}"
    return f"{cls.__module__}:{cls.__qualname__}"
