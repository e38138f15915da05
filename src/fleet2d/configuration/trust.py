"""Trust: only the code of the user's own scenarios and of trusted stored runs may run.

The user who opens a stored run, study or data set decides once for all code and programs in it.
"""

import shlex
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from importlib.machinery import PathFinder
from pathlib import Path
from typing import Any

from fleet2d.configuration.code_files import (
    files_of,
    is_class_path,
    package_of,
    parts_of,
    source_of,
    with_imports,
)
from fleet2d.configuration.units import folder_of
from fleet2d.errors import RunDirectoryError, ScenarioError, printable

NETWORK = ".onnx"
"""Suffix of the file of a network."""

_MAY_RUN: ContextVar[bool] = ContextVar("may_run", default=True)
_MAX_KEYS = 3


class UntrustedCodeError(RunDirectoryError):
    """A stored run, study or data set has code of its own; the message lists all of it."""

    def __init__(self, text: str) -> None:
        """Keep the whole text: a part left out could be the one that matters."""
        Exception.__init__(self, text)


def may_run_code() -> bool:
    """Return whether code and programs that a scenario names may run at present."""
    return _MAY_RUN.get()


@contextmanager
def running_code(*, allowed: bool) -> Iterator[None]:
    """Within the context, allow or refuse all code and programs that a scenario names.

    Modules that are loaded already can be used in any case.
    """
    token = _MAY_RUN.set(allowed)
    try:
        yield
    finally:
        _MAY_RUN.reset(token)


@contextmanager
def stored_code(title: object, content: object, *, trust: bool) -> Iterator[None]:
    """Decide whether the code of a stored run may run within the context.

    Args:
        title: The run or study, for the message.
        content: Its scenario and its interventions; see `code_of`.
        trust: Whether the user trusts it.

    Raises:
        UntrustedCodeError: The run names code, and isn't trusted; none has run.
    """
    code = [] if trust else code_lines(content)
    if code:
        raise UntrustedCodeError(
            "\n".join(
                [
                    f"{printable(str(title))} has code of its own, which would run:",
                    *code,
                    "None of it has run. It could do all that you can, and so could any file in its"
                    " folders, which it may import.",
                    "Read it; if you trust all of it, give --trust (in Python: trust=True)",
                ]
            )
        )
    with running_code(allowed=trust):
        yield


def check_may_run(name: str, code: Iterable[object]) -> None:
    """Refuse code while none may run.

    Args:
        name: What names it, for the message.
        code: The files or programs that would run; empty: all code is loaded already.

    Raises:
        ScenarioError: It may not run.
    """
    for each in () if may_run_code() else code:
        raise ScenarioError(f"{name!r} would run {each}, which is not trusted: it hasn't run")


def check_may_import(name: str, folder: Path, module: str) -> None:
    """Refuse to import a module while no code may run, unless it is loaded already.

    Args:
        name: What names it, for the message.
        folder: The folder in which it is searched first.
        module: Its dotted name.

    Raises:
        ScenarioError: It may not run.
    """
    if not may_run_code():
        check_may_run(name, files_to_run(folder, module))


def content_of_run(manifest: Mapping[str, Any]) -> dict[str, Any]:
    """Return the scenario of a manifest with the interventions of the run, for `code_of`."""
    return {**manifest["scenario"], "interventions": manifest.get("interventions", [])}


def code_lines(content: object) -> list[str]:
    """Return a line for each file and each program that a scenario would run; see `code_of`."""
    lines = []
    for code, keys in code_of(content).items():
        more = ", …" if len(keys) > _MAX_KEYS else ""
        lines.append(printable(f"  {code} ({', '.join(keys[:_MAX_KEYS])}{more})"))
    return lines


def code_of(content: object) -> dict[str, list[str]]:
    """Return the code that a scenario would run and that isn't loaded, with the keys that name it.

    This includes the files of its own components and those that they import from beside them;
    programs with all arguments; networks; and extended files, which may name more code.

    Args:
        content: Plain data, such as the scenario of a manifest.

    Example:
        >>> code_of({"algorithms": {"share": {"type": "/home/ana/mine:Share"}}})
        {'/home/ana/mine.py': ['algorithms.share.type']}
    """
    code: dict[str, list[str]] = {}
    for key, each in _code_in(content, ()):
        code.setdefault(each, []).append(key)
    return code


def _code_in(value: object, keys: tuple[str, ...]) -> Iterator[tuple[str, str]]:
    """Yield the key and the code of each value that names code."""
    if isinstance(value, Mapping):
        if program := _program_of(value):
            yield ".".join((*keys, "command")), program
        for key, entry in value.items():
            yield from _code_in(entry, (*keys, str(key)))
    elif isinstance(value, list | tuple):
        for index, entry in enumerate(value):
            yield from _code_in(entry, (*keys, str(index)))
    elif isinstance(value, str):
        for file in _files_named(value, is_extended="extends" in keys):
            yield ".".join(keys), shlex.quote(str(file))


def _program_of(settings: Mapping[object, object]) -> str:
    """Return the command line of a component that runs a program; empty for others."""
    command = settings.get("command")
    arguments = settings.get("arguments", ())
    if not isinstance(command, str) or not (path := _file(command)):
        return ""  # a program that can't be started is no code
    rest = arguments if isinstance(arguments, list | tuple) else [arguments]
    return shlex.join(map(str, [path, *rest]))


def _file(text: str) -> Path | None:
    """Return the file that a text names as a path; None if there is none."""
    try:
        path = (folder_of(text) / Path(text).expanduser()).resolve()
        return path if path.is_file() else None
    except (OSError, ValueError, RuntimeError):  # not a path
        return None


def _files_named(text: str, *, is_extended: bool) -> Sequence[Path]:
    """Return the files of code that a text would run."""
    if is_extended and (file := _file(text)):
        return [file]
    if text.endswith(NETWORK):  # a network may run for ever, or fill the memory
        return [(folder_of(text) / Path(text).expanduser()).resolve()]
    if not is_class_path(text):
        return []
    folder, module, _ = parts_of(text)
    try:
        files = files_to_run((folder_of(text) / folder).resolve(), module)
    except (OSError, ValueError):
        return []  # this isn't a path: the import will fail
    is_bundled = text.startswith("bundled:")  # scenarios of Fleet2D itself are trusted
    return [] if is_bundled and not any(file.is_file() for file in files) else files


def files_to_run(folder: Path, name: str) -> list[Path]:
    """Return the files that importing a module would run, unless it is loaded already.

    For a module that doesn't exist, return the file that it would have.

    Args:
        folder: The folder in which it is searched first.
        name: Its dotted name.
    """
    file = source_of(folder, name)
    if file is not None:
        modules = map(sys.modules.get, (name, f"{package_of(folder)}.{name}"))
        is_loaded = any(getattr(module, "__file__", None) == str(file) for module in modules)
        return [] if is_loaded else with_imports(files_of(folder, name.split(".")), folder)
    top = name.partition(".")[0]
    if top == "fleet2d" or name in sys.modules:
        return []
    installed = PathFinder.find_spec(top, sys.path)
    origin = installed.origin if installed else None
    return [Path(origin) if origin else folder.joinpath(*name.split(".")).with_suffix(".py")]
