"""The identity of a variant: a hash of its resolved scenario, its input files and the code."""

import hashlib
import json
import platform
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from fleet2d import version
from fleet2d.errors import InputError
from fleet2d.scenario.model import Scenario
from fleet2d.studies.simulator import files_of

DIGITS = 32  # hexadecimal digits of a hash
# Packages that run, show or evaluate simulations without changing their results.
_LEAVES = ("studies", "cli", "pictures", "viewer", "paper", "fit", "calibrate", "published")
_SUFFIXES = (".py", ".so", ".yaml", ".json")
_NO_EFFECT = ("max_span", "speedup")  # keys of `simulation` that change no result


@cache
def code_version() -> str:
    """Return the version of Fleet2D with a hash of the files that can change a run.

    It is constant for a release; in a checkout it changes with every edit of such a file.
    """
    root = Path(version.__file__).parent
    digest = hashlib.sha256()
    for path in sorted(root.rglob("*")):
        name = path.relative_to(root)
        if path.suffix in _SUFFIXES and name.parts[0] not in _LEAVES:
            digest.update(name.as_posix().encode() + b"\0")
            digest.update(hashlib.sha256(path.read_bytes()).digest())
    python = ".".join(platform.python_version_tuple()[:2])
    return f"fleet2d {version.__version__}, python {python}, files {digest.hexdigest()[:DIGITS]}"


class FileHashes:
    """Hashes of input files; a file is read again only after it changed."""

    def __init__(self) -> None:
        self._hashes: dict[tuple[str, int, int], str] = {}

    def __getitem__(self, path: Path) -> str:
        """Return the SHA-256 of a file.

        Raises:
            InputError: The file can't be read.
        """
        try:
            status = path.stat()
            key = (str(path), status.st_mtime_ns, status.st_size)
            if key not in self._hashes:
                self._hashes[key] = hashlib.sha256(path.read_bytes()).hexdigest()
        except OSError as error:
            raise InputError(
                f"{path} can't be read: {error.strerror}; a variant needs it"
            ) from error
        return self._hashes[key]


def scenario_content(scenario: Scenario) -> dict[str, Any]:
    """Return the keys of a resolved scenario that have an effect on its results."""
    content = scenario.resolved()
    content.pop("name", None)
    content["simulation"] = {k: v for k, v in content["simulation"].items() if k not in _NO_EFFECT}
    return content


def content_hash(content: Any) -> str:
    """Return a hash of plain data. The order of keys counts: users decide in theirs.

    >>> content_hash({"a": 1, "b": 2}) == content_hash({"b": 2, "a": 1})
    False
    """
    text = json.dumps(content, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()[:DIGITS]


def input_hash(scenario: Scenario, files: FileHashes) -> str:
    """Return a hash of the files that a scenario names: floor plans, logs, the user's modules.

    Raises:
        InputError: A file can't be read.
    """
    return content_hash({str(path): files[path] for path in files_of(scenario)})


def identity(content: Mapping[str, Any], inputs: str) -> tuple[str, str]:
    """Return the identity of a variant, and the hash of its scenario alone.

    Args:
        content: Its `scenario_content`, with its seed.
        inputs: The `input_hash` of its scenario.
    """
    scenario = content_hash(content)
    return content_hash([code_version(), scenario, inputs]), scenario


def home_key(content: Mapping[str, Any]) -> str:
    """Return a hash that is the same for variants that can share a home."""
    return content_hash([content["floorplan"], content["objects"]])[:8]
