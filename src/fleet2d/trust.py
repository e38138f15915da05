"""Which code may run: none of a stored run or of a foreign scenario, unless the user trusts it."""

import shlex
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

from fleet2d.errors import InputError, RunDirectoryError, ScenarioError

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
    from fleet2d.paths import folder_of
    from fleet2d.user_modules import files_of

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
