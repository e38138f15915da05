"""Users' own code: which of it may run, and its import from the folder of a scenario.

No code of a stored run or of a foreign scenario runs unless the user trusts it. What runs is
compiled from the source that was listed, whose hash was shown: bytecode, extension modules and
other files beside it are not importable while trust is restricted.
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
from contextlib import AbstractContextManager, contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass, field
from functools import lru_cache
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any, Self
from weakref import WeakKeyDictionary

from fleet2d.bounds import FILE_BYTES, read_bytes
from fleet2d.configuration.problems import did_you_mean
from fleet2d.configuration.units import folder_of
from fleet2d.errors import InputError, RunDirectoryError, ScenarioError, may_be_ctrl_c, text_of

NETWORK = ".onnx"
"""Suffix of the file of a network."""
# Files that a message lists, at most.
_MAX_LISTED = 20

_PREFIX = "fleet2d_scenario_"
# The folders of scenarios by the packages that their modules are imported into.
_FOLDERS: dict[str, Path] = {}
# The folders of the modules that are being imported now, innermost last.
_SEARCHED: list[Path] = []
# The folders of components in modules that a scenario's modules imported from beside them.
_BESIDE: WeakKeyDictionary[type, Path] = WeakKeyDictionary()


@dataclass(frozen=True)
class Trust:
    """The files and folders whose code may run.

    Attributes:
        files: The SHA-256 of each file when it was named, by its absolute path without links.
        folders: Folders all of whose files may run, as absolute paths without links.

    Example:
        >>> trust = Trust.of(["/etc"])
        >>> trust.allows(Path("/etc/passwd")), trust.allows(Path("/etc/../bin/sh"))
        (True, False)
    """

    files: Mapping[Path, str] = field(default_factory=dict)
    folders: tuple[Path, ...] = ()

    @classmethod
    def of(cls, paths: Iterable[str | Path]) -> Self:
        """Return the trust in files, as they are now, and folders.

        Raises:
            InputError: One doesn't exist, or can't be read.
        """
        files, folders = {}, []
        for path in map(Path, paths):
            if not path.exists():
                raise InputError(f"{path} can't be trusted: there is no such file or folder")
            if path.is_dir():
                folders.append(path.resolve())
                continue
            try:
                files[path.resolve()] = _sha256(read_bytes(path, FILE_BYTES))
            except OSError as error:
                raise InputError(f"{path} can't be trusted: {error.strerror}") from None
        return cls(files, tuple(folders))

    def allows(self, path: Path) -> bool:
        """Whether the code in a file may run."""
        path = path.resolve()
        return path in self.files or self._is_in_folder(path)

    def has_changed(self, path: Path, content: bytes) -> bool:
        """Whether a named file has changed since it was named."""
        path = path.resolve()
        return not self._is_in_folder(path) and self.files.get(path) != _sha256(content)

    def _is_in_folder(self, path: Path) -> bool:
        return any(path.is_relative_to(folder) for folder in self.folders)


def _sha256(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


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


def restrict_stored(trust: Trust | None = None) -> AbstractContextManager[None]:
    """Restrict what is read from a stored run to what the command line, else the caller, trusts."""
    return restrict(_TRUST.get() or trust or Trust())


def current_trust() -> Trust | None:
    """Return what is trusted now; None: all code."""
    return _TRUST.get()


def check_trust(name: str, files: Iterable[Path]) -> None:
    """Refuse to import a module whose files aren't trusted.

    Args:
        name: The module or component, for the message.
        files: The files that would run.

    Raises:
        ScenarioError: A file is not trusted.
    """
    trust = _TRUST.get()
    for file in files:
        if trust is not None and not trust.allows(file):
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
        f"  {file} ({', '.join(keys[:3])}{', …' * (len(keys) > 3)}){_shown_hash(file)}"
        for file, keys in list(code.items())[:_MAX_LISTED]
    ]
    if len(code) > _MAX_LISTED:
        lines.append(f"  … {len(code) - _MAX_LISTED} more")
    options = " ".join(f"--trust {shlex.quote(str(file))}" for file in list(code)[:_MAX_LISTED])
    return "\n".join(
        [
            f"{title} has components of its own, which would run:",
            *lines,
            f"None of it has run. Read it; if you trust it, say so: {options}",
        ]
    )


def _shown_hash(file: Path) -> str:
    with suppress(OSError, InputError):
        return f" SHA-256 {_sha256(read_bytes(file, FILE_BYTES))}"
    return ""


def code_of(scenario: object) -> dict[Path, list[str]]:
    """Return the files that a scenario would run and aren't loaded, with the keys that name them.

    Example:
        >>> code_of({"algorithms": {"share": {"type": "/home/ana/mine:Share"}}})
        {PosixPath('/home/ana/mine.py'): ['algorithms.share.type']}
    """
    code: dict[Path, list[str]] = {}
    for key, name in _class_paths(scenario, ()):
        if _is_network(name):
            code.setdefault((folder_of(name) / Path(name).expanduser()).resolve(), []).append(key)
            continue
        folder, module, _ = _parts_of(name)
        try:
            files = _files_to_run((folder_of(name) / folder).resolve(), module)
        except (OSError, ValueError):
            continue  # it is not a path: the import will fail
        if name.startswith("bundled:") and not any(file.is_file() for file in files):
            continue  # a scenario that comes with Fleet2D
        for file in files:
            code.setdefault(file, []).append(key)
    return code


def _class_paths(value: object, keys: tuple[str, ...]) -> Iterator[tuple[str, str]]:
    """Yield every text that may be the path of an own component or a network, after its key."""
    if isinstance(value, Mapping):
        for key, entry in value.items():
            if key != "extends":  # a file of data, such as bundled:base, which is merged already
                yield from _class_paths(entry, (*keys, str(key)))
    elif isinstance(value, list | tuple):
        for index, entry in enumerate(value):
            yield from _class_paths(entry, (*keys, str(index)))
    elif isinstance(value, str) and (_is_network(value) or _is_class_path(value)):
        yield ".".join(keys), value


def _is_network(text: str) -> bool:
    """Whether a text is the path of a network, which may compute for ever."""
    return text.endswith(NETWORK)


def _is_class_path(text: str) -> bool:
    """Whether a text has the form of a path of a user's own component: 'folder/module:Class'."""
    _, module, qualname = _parts_of(text)
    return all(part.isidentifier() for part in (*module.split("."), *qualname.split(".")))


def _parts_of(path: str) -> tuple[str, str, str]:
    """Return the folder, the module and the class of a path of a component."""
    file, _, qualname = path.rpartition(":")
    folder, slash, module = file.removesuffix(".py").rpartition("/")
    return folder + slash, module, qualname


def _files_to_run(folder: Path, name: str) -> list[Path]:
    """Return the files that importing a module would run, unless it is loaded already.

    For a module that doesn't exist it is the file that the module would have.
    """
    file = _source_of(folder, name)
    if file is None:
        top = name.partition(".")[0]
        if top == "fleet2d" or name in sys.modules:
            return []
        installed = PathFinder.find_spec(top, sys.path)
        origin = installed.origin if installed else None
        return [Path(origin) if origin else folder.joinpath(*name.split(".")).with_suffix(".py")]
    for full_name in (name, f"{_package_name(folder)}.{name}"):
        if getattr(sys.modules.get(full_name), "__file__", None) == str(file):
            return []
    return with_imports(_files_of(folder, name.split(".")), folder)


def _source_of(folder: Path, name: str) -> Path | None:
    """Return the file with the source of a module in a folder, None if there is none."""
    path = folder.joinpath(*name.split("."))
    candidates = (path / "__init__.py", path.with_suffix(".py"))
    return next(filter(Path.is_file, candidates), None)


def with_imports(files: Iterable[Path], folder: Path, within: Path | None = None) -> list[Path]:
    """Return files of modules, and the files in their folder that they import, each once.

    Imports are read from the text: nothing is run. An import by a computed name is not found.

    Args:
        files: The files of the modules.
        folder: The folder in which imports are searched first.
        within: The folder that holds the imported files that count; None: anywhere.

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
        imported = _imports_of(queue.pop(), folder)
        inside = (file for file in imported if within is None or file.is_relative_to(within))
        new = dict.fromkeys(inside).keys() - known.keys()
        known |= dict.fromkeys(sorted(new))
        queue += sorted(new)
    return list(known)


def _imports_of(file: Path, folder: Path) -> Iterator[Path]:
    """Yield the existing files of the modules that a module may import."""
    try:
        imports = _imports_in(read_bytes(file, FILE_BYTES))
    except (OSError, InputError):
        return  # it can't be imported either
    for level, parts in imports:
        start = file.parents[level - 1] if 0 < level <= len(file.parents) else folder
        yield from _files_of(start, parts)


@lru_cache(maxsize=64)  # a study's runs read the same files
def _imports_in(text: bytes) -> list[tuple[int, list[str]]]:
    """Return the level and the dotted name of each import in a module's text."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # they are about the user's text
            tree = ast.parse(text)
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return []
    imports = list[tuple[int, list[str]]]()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            imports += [(0, alias.name.split(".")) for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            module = node.module.split(".") if node.module else []
            imports += [(node.level, [*module, alias.name]) for alias in node.names]
    return imports


def _files_of(folder: Path, parts: Sequence[str]) -> Iterator[Path]:
    """Yield the files of a module and of its packages, as far as they exist."""
    for part in parts:
        folder = folder / part
        yield from filter(Path.is_file, (folder / "__init__.py", folder.with_name(f"{part}.py")))


class BrokenModule(ScenarioError):
    """A module whose import fails; ``cause`` says where and how."""

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
    parent, module_name, qualname = _parts_of(name)
    folder = (folder_of(name) / parent).resolve()
    if not _is_class_path(name):
        raise ScenarioError(f"can't import {name!r}: write module:Class or folder/module:Class")
    if not is_plugin:
        check_trust(name, _files_to_run(folder, module_name))
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


def _import_module(folder: Path, name: str) -> ModuleType:
    """Import a module from ``folder`` into the folder's package, else as an installed module."""
    file = _source_of(folder, name)
    if file is None:
        return importlib.import_module(name)
    module = sys.modules.get(name)
    if module is not None and getattr(module, "__file__", None) == str(file):
        return module
    package = _package_name(folder)
    if package not in _FOLDERS:
        sys.modules[package] = ModuleType(package)
        sys.modules[package].__path__ = [str(folder)]
        _FOLDERS[package] = folder
    with _importable(folder):
        return importlib.import_module(f"{package}.{name}")


def _package_name(folder: Path) -> str:
    """Return the name of the package whose modules are those in a folder."""
    return f"{_PREFIX}{hashlib.sha256(str(folder).encode()).hexdigest()[:16]}"


@contextmanager
def _importable(folder: Path) -> Iterator[None]:
    """Search imports in ``folder``, too, and remove its modules from `sys.modules` afterwards.

    If a module changes the current folder, this is undone: other paths are relative to it.

    Two scenarios may each have a ``helpers.py``: each imports its own.
    """
    old_modules, current_folder = set(sys.modules), Path.cwd()
    if _FINDER not in sys.meta_path:
        sys.meta_path.insert(sys.meta_path.index(PathFinder), _FINDER)
    sys.path.insert(0, str(folder))
    _SEARCHED.append(folder)
    try:
        yield
    finally:
        os.chdir(current_folder)
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


class _SourceFinder(MetaPathFinder):
    """Finds modules of scenarios' folders by their source.

    While trust is restricted nothing else is found there: no bytecode and no extension module.
    """

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Return how to import a module; None: it is not in the folder of a scenario.

        Raises:
            ModuleNotFoundError: It is there, and has no source.
        """
        parent, _, name = fullname.rpartition(".")
        if path is None:
            folders = _SEARCHED[-1:]
        else:
            folders = [Path(entry) for entry in path] if _is_own_package(parent) else []
        for folder in folders:
            if (file := _source_of(folder, name)) is not None:
                loader = _SourceLoader(fullname, str(file))
                is_package = file.name == "__init__.py"
                own = ModuleSpec(fullname, loader, origin=str(file), is_package=is_package)
                own.has_location = True
                return _own(own, [str(file.parent)] if is_package else None)
        if not folders or _TRUST.get() is None:
            return None
        spec = None
        if not path:  # else it is in a package, and the rest of sys.path doesn't matter
            elsewhere = [entry for entry in sys.path if Path(entry).resolve() != folders[0]]
            spec = PathFinder.find_spec(fullname, elsewhere)
        packages = [str(folder / name) for folder in folders if _is_bare_package(folder / name)]
        if spec is None and packages:
            return _own(ModuleSpec(fullname, None, is_package=True), packages)
        if spec is None and PathFinder.find_spec(fullname, path) is not None:
            raise ModuleNotFoundError(f"No source of module {fullname!r}", name=fullname)
        return spec


def _own(spec: ModuleSpec, places: list[str] | None) -> ModuleSpec:
    """Return a specification of a module in the folder of a scenario, marked as such."""
    spec.submodule_search_locations, spec.loader_state = places, _FOLDERS
    return spec


def _is_own_package(name: str) -> bool:
    spec = getattr(sys.modules.get(name), "__spec__", None)
    return name in _FOLDERS or (spec is not None and spec.loader_state is _FOLDERS)


def _is_bare_package(folder: Path) -> bool:
    """Whether a folder is a package without `__init__.py`, or any file in its place."""
    return folder.is_dir() and not any(folder.glob("__init__.*"))


class _SourceLoader(SourceFileLoader):
    """Compiles the very source that is trusted; bytecode is neither read nor written."""

    def get_code(self, fullname: str) -> CodeType:
        """Return the code of the module.

        Raises:
            ScenarioError: Its source isn't trusted, or has changed since it was named.
        """
        file, trust = Path(self.path), _TRUST.get()
        check_trust(public_name(fullname), [file])
        content = read_bytes(file, FILE_BYTES)
        if trust is not None and trust.has_changed(file, content):
            raise ScenarioError(f"{file} has changed since it was named by --trust: read it again")
        return self.source_to_code(content, self.path)


_FINDER = _SourceFinder()


def public_name(text: str) -> str:
    """Return a text with modules as users know them, without the package of their folder."""
    return re.sub(rf"\b{_PREFIX}[0-9a-f]+(\.?)", lambda match: "" if match[1] else ".", text)


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
        return with_imports(_files_of(folder, parts), folder)
    source = None
    with suppress(TypeError, OSError):  # a class of an interactive session
        source = inspect.getsourcefile(cls)
    return [Path(source)] if source and Path(source).is_file() else []


def is_listed(module: str, classes: Iterable[type]) -> bool:
    """Return whether a module is in a file that is shown to the user before it may run.

    Those are the files that were named, and those of a scenario's own classes with the files beside
    them, or in their installed package, that they import.

    Args:
        module: The name of a module; one that isn't loaded isn't listed.
        classes: The classes of the scenario's components.
    """
    place = getattr(sys.modules.get(module), "__file__", None)
    if place is None:
        return False
    file, trust = Path(place).resolve(), _TRUST.get()
    if trust is not None and file in trust.files:
        return True
    return any(file in map(Path.resolve, _files_with_package(cls)) for cls in classes)


@lru_cache
def _files_with_package(cls: type) -> tuple[Path, ...]:
    """Return the files of a class, and of the modules of its package that it imports."""
    files = source_files(cls)
    if is_scenario_module(cls.__module__) or cls in _BESIDE or not files:
        return tuple(files)
    parts = cls.__module__.split(".")
    depth = len(parts) - (files[0].stem != "__init__")
    package = files[0].parents[min(depth, len(files[0].parents) - 1)] / parts[0]
    return tuple(with_imports(files, package.parent, package))


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
    if file and _SEARCHED and Path(file) in _files_of(_SEARCHED[-1], cls.__module__.split(".")):
        _BESIDE[cls] = _SEARCHED[-1]
        return f"{_SEARCHED[-1].as_posix()}/{cls.__module__}:{cls.__qualname__}"
    return f"{cls.__module__}:{cls.__qualname__}"
