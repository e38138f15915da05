"""Whose code may run: none of a stored run or of a stranger's scenario, unless it is named."""

import shlex
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

from fleet2d.errors import InputError, RunDirectoryError, ScenarioError

# Files that a message lists.
_MOST_LISTED = 20


@dataclass(frozen=True)
class Trust:
    """The files and folders whose code may run, all absolute and without links.

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
            InputError: One isn't there.
        """
        files, folders = set(), []
        for path in map(Path, paths):
            if not path.exists():
                raise InputError(f"{path} can't be trusted, for it isn't there")
            if path.is_dir():
                folders.append(path.resolve())
            else:
                files.add(path.resolve())
        return cls(frozenset(files), tuple(folders))

    def allows(self, path: Path) -> bool:
        """Whether the code in a file may run."""
        real = path.resolve()
        return real in self.files or any(real.is_relative_to(folder) for folder in self.folders)


_TRUST: ContextVar[Trust | None] = ContextVar("trust", default=None)


@contextmanager
def restricted(trust: Trust) -> Iterator[None]:
    """Let no module be imported for a scenario that isn't trusted or loaded already."""
    token = _TRUST.set(trust)
    try:
        yield
    finally:
        _TRUST.reset(token)


@contextmanager
def of_others(trust: Trust | None = None) -> Iterator[None]:
    """Restrict what is read from a stored run: to what the command line or a caller trusts."""
    with restricted(_TRUST.get() or trust or Trust()):
        yield


def current_trust() -> Trust | None:
    """Return what is trusted now; None where all code is the user's own."""
    return _TRUST.get()


@contextmanager
def under(trust: Trust | None) -> Iterator[None]:
    """Restrict as another process did, of which `current_trust` was sent."""
    token = _TRUST.set(trust)
    try:
        yield
    finally:
        _TRUST.reset(token)


def check_trust(name: str, files: Sequence[Path]) -> None:
    """Refuse to import a component of a scenario's own whose files aren't trusted.

    Args:
        name: The component, as the scenario names it.
        files: The files that would run.

    Raises:
        ScenarioError: One is not trusted.
    """
    trust = _TRUST.get()
    if trust is None:
        return
    for file in files:
        if not trust.allows(file):
            raise ScenarioError(f"{name!r} would run {file}: name it by --trust if you trust it")


def check_code(what: str, content: object) -> None:
    """List the code that a scenario or a study would run, unless all of it may run now.

    Args:
        what: What is to be run, for the message.
        content: It as plain data.

    Raises:
        ScenarioError: Something would run that isn't trusted; nothing has run.
    """
    trust = _TRUST.get()
    if trust is not None and (refusal := _refusal(what, content, trust)):
        raise ScenarioError(refusal)


def refuse_untrusted(directory: Path, scenario: Mapping[str, Any], trust: Trust) -> None:
    """List the code that a stored scenario would run, unless all of it is trusted.

    Raises:
        RunDirectoryError: Something would run that isn't trusted; nothing has run.
    """
    if refusal := _refusal(str(directory), scenario, trust):
        raise RunDirectoryError(refusal)


def _refusal(what: str, content: object, trust: Trust) -> str:
    """Return what there is to say of code that isn't trusted; empty if all of it is."""
    foreign = {file: names for file, names in code_of(content).items() if not trust.allows(file)}
    if not foreign:
        return ""
    lines = [
        f"  {file} ({', '.join(names[:3])}{', …' * (len(names) > 3)})"
        for file, names in list(foreign.items())[:_MOST_LISTED]
    ]
    if len(foreign) > _MOST_LISTED:
        lines.append(f"  … {len(foreign) - _MOST_LISTED} more")
    named = " ".join(f"--trust {shlex.quote(str(file))}" for file in list(foreign)[:_MOST_LISTED])
    return "\n".join(
        [
            f"{what} has components of its own, which would run:",
            *lines,
            f"None of it has run. Read it; if you trust it, and what it imports, say so: {named}",
        ]
    )


def code_of(scenario: object) -> dict[Path, list[str]]:
    """Return the files that a scenario would run and that aren't loaded, and what names them.

    Example:
        >>> code_of({"algorithms": {"share": {"type": "/home/ana/mine:Share"}}})
        {PosixPath('/home/ana/mine.py'): ['algorithms.share.type']}
    """
    from fleet2d.outside import files_of
    from fleet2d.paths import folder_of

    code: dict[Path, list[str]] = {}
    for where, name in _types(scenario, ()):
        path = name.rpartition(":")[0].removesuffix(".py")
        written, slash, module = path.rpartition("/")
        try:
            files = files_of((folder_of(name) / (written + slash)).resolve(), module)
        except (OSError, ValueError):
            continue  # no path at all: it is refused where it is imported
        for file in files:
            code.setdefault(file, []).append(where)
    return code


def _types(value: object, where: tuple[str, ...]) -> Iterator[tuple[str, str]]:
    """Yield every text that may name a component of a scenario's own, with its place."""
    if isinstance(value, Mapping):
        for key, entry in value.items():
            if key != "extends":  # files of data, such as bundled:base, whose own types are listed
                yield from _types(entry, (*where, str(key)))
    elif isinstance(value, list | tuple):
        for index, entry in enumerate(value):
            yield from _types(entry, (*where, str(index)))
    elif isinstance(value, str) and _names_code(value):
        yield ".".join(where), value


def _names_code(text: str) -> bool:
    """Whether a text is written as a component of a scenario's own is: 'folder/module:Class'."""
    path, colon, qualname = text.rpartition(":")
    module = path.removesuffix(".py").rpartition("/")[2]
    parts = (*module.split("."), *qualname.split("."))
    return bool(colon) and all(part.isidentifier() for part in parts)
