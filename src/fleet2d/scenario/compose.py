"""Compose a scenario: files that extend others, then the overrides, each merged onto the last."""

import os.path
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from fleet2d.bounds import one_line
from fleet2d.component import base_of, lookup
from fleet2d.document import Document, Keys, parse_yaml, read_document
from fleet2d.errors import ScenarioError
from fleet2d.problems import did_you_mean

BUNDLED = Path(__file__).parent / "bundled"
ENTRIES = ("users", "robots", "objects", "algorithms", "metrics", "expect")
"""The sections whose entries have names and can be deleted with null."""

_SLOTS = (
    (re.compile(r"floorplan"), "floorplan"),
    (re.compile(r"(users|robots)/[^/]+(/behaviors/\d+)?"), "behavior"),
    (re.compile(r"objects/[^/]+"), "object"),
    (re.compile(r"algorithms/[^/]+"), "algorithm"),
    (re.compile(r"metrics/[^/]+"), "metric"),
)


def compose(
    source: str | Path | Mapping[str, Any] | None,
    overrides: Iterable[str] = (),
    settings: Mapping[Keys, Any] | None = None,
) -> Document:
    """Compose a scenario from a file (None: the bundled base) or a mapping, and what changes it.

    Mappings merge, everything else is replaced. Where a ``type`` changes, the fields of the old
    type are dropped. All overrides and settings are one change, applied after the files.

    Args:
        source: a path, 'bundled:NAME', or the scenario itself as a mapping.
        overrides: texts like 'simulation.duration.days=30', the value in YAML.
        settings: values by key path, applied after the overrides.

    Raises:
        ScenarioError: a file or an override can't be read.
    """
    document = _load("bundled:base" if source is None else source, Path(), ())
    changes = [_read_override(text) for text in overrides]
    for keys, value in (settings or {}).items():
        changes.append(assignment(keys, value, f"argument {keys[-1]}={value!r}"))
    return changed(document, changes)


def changed(document: Document, changes: Sequence[Document]) -> Document:
    """Return a composed scenario with changes applied as one; the document is not modified.

    Args:
        document: A scenario as `compose` returns it.
        changes: Changes, each on the one before; `assignment` makes one.

    Raises:
        ScenarioError: A change deletes or reaches into an entry that isn't there.
    """
    change = Document()
    for single in changes:
        change = merge(change, single)
    _refuse_unknown_deletions(document, change)
    _refuse_unknown_entries(document, change, changes)
    document = merge(document, change)
    _delete_nulls(document.data)
    return document


def merge(below: Document, above: Document) -> Document:
    """Return ``below`` changed by ``above``; neither is modified."""
    merger = _Merger(dict(below.places), above.places)
    return Document(merger.merge(below.data, above.data, ()), merger.places)


def slot_kind(keys: Keys) -> str | None:
    """Return the kind of component that is configured at a key path, if one is.

    >>> slot_kind(("users", "ana")), slot_kind(("simulation",))
    ('behavior', None)
    """
    path = "/".join(keys)
    return next((kind for pattern, kind in _SLOTS if pattern.fullmatch(path)), None)


def bundled_path(name: str) -> Path:
    """Return the file of a bundled scenario.

    Raises:
        ScenarioError: there is none of that name; the message lists them.
    """
    path = BUNDLED / f"{name}.yaml"
    if not path.is_file():
        known = sorted(p.stem for p in BUNDLED.glob("*.yaml"))
        raise ScenarioError(
            f"no scenario {name!r} is bundled{did_you_mean(name, known)} There are: "
            f"{', '.join(known) or 'none'}"
        )
    return path


def _load(
    source: str | Path | Mapping[str, Any], folder: Path, chain: tuple[Path, ...]
) -> Document:
    """Read a source and everything that it extends."""
    if isinstance(source, Mapping):
        document = Document(dict(source))
    else:
        bundled = str(source).removeprefix("bundled:")
        path = folder / source if bundled == str(source) else bundled_path(bundled)
        shown = os.path.normpath(path) if bundled == str(source) else str(source)
        if path.resolve() in chain:
            raise ScenarioError(f"{shown} extends itself: {_chain(chain, path)}")
        document = read_document(path, shown)
        folder, chain = path.parent, (*chain, path.resolve())
    extended = document.data.pop("extends", None) or []
    parents = extended if isinstance(extended, list) else [extended]
    result = Document()
    try:
        for parent in parents:
            if not isinstance(parent, str):
                raise ScenarioError(f"found {parent}; the path of a YAML file is wanted")
            result = merge(result, _load(str(parent), folder, chain))
    except ScenarioError as error:
        where = document.place(("extends",))
        raise ScenarioError(f"{where}{': ' * bool(where)}extends: {error}") from error
    # Another scenario's name isn't this one's: runs are stored and titled by it.
    result.places.pop(("name",), None)
    result.data.pop("name", None)
    _refuse_unknown_deletions(result, document)
    return merge(result, document)


def _chain(chain: tuple[Path, ...], last: Path) -> str:
    start = chain.index(last.resolve())
    return " → ".join(path.name for path in (*chain[start:], last))


def _read_override(text: str) -> Document:
    key, equals, value = text.partition("=")
    keys = tuple(key.strip().split("."))
    shown = f"override {(text if len(text) <= 100 else one_line(text, 100))!r}"
    if not equals:
        raise ScenarioError(f"{shown}: there is no '=' in it; write key.path=value")
    if not all(keys):
        raise ScenarioError(f"{shown}: a part of its key is empty")
    # '#d62728' is a colour that a shell user has no reason to quote twice, not a comment.
    parsed = (
        value.strip() if value.lstrip().startswith("#") else parse_yaml(value, Path.cwd(), shown)
    )
    if not value.strip():
        raise ScenarioError(f"{shown}: no value; write {key}=null to delete an entry")
    return assignment(keys, parsed, shown)


def assignment(keys: Keys, value: Any, place: str) -> Document:
    """Return the change that sets one key; `place` is where messages say it is written.

    >>> assignment(("simulation", "seed"), 4, "home.yaml:3").data
    {'simulation': {'seed': 4}}
    """
    for key in reversed(keys):
        value = {key: value}
    return Document(value, {keys[:n]: place for n in range(1, len(keys) + 1)})


class _Merger:
    """Merges two trees of plain data, and the places of their values."""

    def __init__(self, places: dict[Keys, str], above: dict[Keys, str]) -> None:
        self.places = places
        self.above = above

    def merge(self, below: Any, above: Any, keys: Keys) -> Any:
        kind = slot_kind(keys)
        if kind:
            below, above = _unfold(below, above), _unfold(above, below)
        if not isinstance(above, Mapping):
            return self.replace(above, keys)
        if isinstance(below, list) and above and all(key.isdigit() for key in above):
            return self.merge_entries(below, above, keys)
        if not isinstance(below, Mapping):
            return self.replace(above, keys)
        if kind:
            below = self.without_old_type(kind, below, above, keys)
        result = dict(below)
        for key, value in above.items():
            inner = (*keys, str(key))
            known = key in result
            result[key] = (
                self.merge(result[key], value, inner) if known else self.replace(value, inner)
            )
        return result

    def merge_entries(self, below: list[Any], above: Mapping[str, Any], keys: Keys) -> list[Any]:
        """Change single entries of a list: `behaviors.0.dwell=5 min`."""
        result = list(below)
        for key, value in above.items():
            inner = (*keys, key)
            if int(key) >= len(result):
                raise ScenarioError(
                    f"{self.above.get(inner)}: there is no {'.'.join(inner)}: the list has "
                    f"{len(result)} entries, and the first is 0"
                )
            result[int(key)] = self.merge(result[int(key)], value, inner)
        return result

    def replace(self, value: Any, keys: Keys) -> Any:
        self.forget(keys)
        depth = len(keys)
        # Its own place or the nearest around it; none: a value from Python.
        around = (self.above.get(keys[:n]) for n in range(depth, -1, -1))
        self.places[keys] = next((place for place in around if place is not None), "")
        self.places.update({k: place for k, place in self.above.items() if k[:depth] == keys})
        return value

    def forget(self, keys: Keys) -> None:
        for inner in [k for k in self.places if k[: len(keys)] == keys]:
            del self.places[inner]

    def without_old_type(
        self, kind: str, below: Mapping[str, Any], above: Mapping[str, Any], keys: Keys
    ) -> dict[str, Any]:
        """Drop what only the type below understands, if the mapping above changes the type."""
        dropped: set[str] = set()
        if "behaviors" in above and "type" in below:  # from the short form to the long one
            dropped = {"type", *_own_fields(kind, below["type"])}
        elif "type" in above:
            # An algorithm or a metric without a type is called like its type.
            old = below.get("type", keys[-1])
            if not _same_type(kind, old, above["type"]):
                dropped = {"behaviors", *_own_fields(kind, old)}
        for key in dropped & below.keys():
            self.forget((*keys, key))
        return {key: value for key, value in below.items() if key not in dropped}


def _unfold(value: Any, other: Any) -> Any:
    """Write a bare type name as a mapping where it meets a mapping."""
    return {"type": value} if isinstance(value, str) and isinstance(other, Mapping) else value


def _same_type(kind: str, one: Any, other: Any) -> bool:
    try:
        return bool(one == other or lookup(kind, one) is lookup(kind, other))
    except (ScenarioError, TypeError):  # validation will say what is wrong with it
        return False


def _own_fields(kind: str, name: Any) -> set[str]:
    """Return the fields that a type has beyond those of every type of its kind."""
    try:
        cls = lookup(kind, name)
    except (ScenarioError, TypeError):
        return set()
    return set(cls.model_fields) - set(base_of(cls).model_fields)


def _refuse_unknown_deletions(below: Document, above: Document) -> None:
    for section in ENTRIES:
        entries, known = above.data.get(section), below.data.get(section) or {}
        for name, value in entries.items() if isinstance(entries, Mapping) else ():
            if value is None and name not in known:
                where = above.place((section, name))
                raise ScenarioError(
                    f"{where}{': ' * bool(where)}{section}.{name}: null deletes an entry, and "
                    f"there is none of this name{did_you_mean(name, known)} There are: "
                    f"{', '.join(known) or 'none'}"
                )


def _refuse_unknown_entries(below: Document, change: Document, changes: Sequence[Document]) -> None:
    """Refuse to reach inside an entry that isn't there, unless the change says what it is."""
    reached = {keys[:2]: single for single in changes for keys in single.places if len(keys) > 2}
    whole = {max(single.places, key=len) for single in changes if single.places}
    for (section, name), single in reached.items():
        if section not in ENTRIES or (section, name) in whole or (section,) in whole:
            continue
        known = [k for k, v in (below.data.get(section) or {}).items() if v is not None]
        entry = change.data[section][name]
        typed = isinstance(entry, Mapping) and entry.keys() & {"type", "behaviors"}
        if name not in known and not typed:
            raise ScenarioError(
                f"{single.place((section, name))}: there is no {section}.{name}"
                f"{did_you_mean(name, known)} There are: {', '.join(known) or 'none'}; to add one "
                f"give {section}.{name}.type, too"
            )


def _delete_nulls(data: dict[str, Any]) -> None:
    """Drop sections and named entries that are null."""
    for section in [key for key, value in data.items() if value is None]:
        del data[section]
    for section in ENTRIES:
        if isinstance(data.get(section), Mapping):
            data[section] = {k: v for k, v in data[section].items() if v is not None}
