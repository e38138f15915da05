"""Whose code may run: none of a stored run or of a stranger's scenario, unless it is named."""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

from fleet2d.errors import InputError, RunDirectoryError, ScenarioError

# 'folder/package.module:Class', as a scenario names a component of its own.
_OWN = re.compile(r"[^:]+:[A-Za-z_]\w*(\.[A-Za-z_]\w*)*")


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


def refuse_untrusted(directory: Path, scenario: Mapping[str, Any], trust: Trust) -> None:
    """List the code that a stored scenario would run, unless all of it is trusted.

    Raises:
        RunDirectoryError: Something would run that isn't trusted; nothing has run.
    """
    code = code_of(scenario)
    foreign = {file: names for file, names in code.items() if not trust.allows(file)}
    if not foreign:
        return
    lines = [f"  {file} ({', '.join(names)})" for file, names in foreign.items()]
    named = " ".join(f"--trust {file}" for file in foreign)
    raise RunDirectoryError(
        "\n".join(
            [
                f"{directory} is of a scenario with components of its own, which would run:",
                *lines,
                "None of it has run. Read it; if you trust it, and what it imports, say so:"
                f" {named}",
            ]
        )
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
            yield from _types(entry, (*where, str(key)))
    elif isinstance(value, list | tuple):
        for index, entry in enumerate(value):
            yield from _types(entry, (*where, str(index)))
    elif isinstance(value, str) and _OWN.fullmatch(value):
        yield ".".join(where), value
