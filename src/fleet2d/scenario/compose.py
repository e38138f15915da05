"""Compose a scenario: files that extend others, then the overrides, each merged onto the last."""

import os.path
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import reduce
from pathlib import Path
from typing import Any

from fleet2d.bounds import EXTENDED_FILES, YAML_VALUES, one_line
from fleet2d.configuration.components import Component, base_of, kind_at, lookup
from fleet2d.configuration.documents import Document, Keys, parse_yaml, read_document
from fleet2d.configuration.problems import suggest
from fleet2d.errors import ScenarioError
from fleet2d.inputs import resolved
from fleet2d.scenario.model import Scenario

BUNDLED = Path(__file__).parent / "bundled"
ENTRIES = ("users", "robots", "objects", "interactions", "algorithms", "metrics", "expect")
"""The sections whose entries have names and can be deleted with null."""


def compose(
    source: str | Path | Mapping[str, Any] | None,
    overrides: Iterable[str] = (),
    settings: Mapping[Keys, Any] | None = None,
) -> Document:
    """Compose a scenario from a file (None: the bundled family) or a mapping, and its overrides.

    Mappings are merged, all other values replaced. Where a ``type`` changes, the fields of the old
    type are dropped. All overrides and settings are one change, applied after the files.

    Args:
        source: a path, 'bundled:NAME', or the scenario itself as a mapping.
        overrides: texts like 'simulation.duration.days=30', the value in YAML.
        settings: values by key path, applied after the overrides.

    Raises:
        ScenarioError: a file or an override can't be read.
    """
    document = _load("bundled:family" if source is None else source, Path(), (), [])
    changes = [_read_override(text) for text in overrides]
    for keys, value in (settings or {}).items():
        changes.append(assignment(keys, value, f"argument {keys[-1]}={value!r}"))
    return apply_changes(document, changes)


def apply_changes(document: Document, changes: Sequence[Document]) -> Document:
    """Return a composed scenario with all changes applied, or none; the document is not modified.

    Args:
        document: A scenario as `compose` returns it.
        changes: Changes, each applied to the one before; see `assignment`.

    Raises:
        ScenarioError: A change deletes an entry, or sets a key of an entry, that doesn't exist.
    """
    change = reduce(merge, changes, Document())
    _refuse_unknown_deletions(document, change)
    _refuse_unknown_entries(document, change, changes)
    document = merge(document, change)
    _delete_nulls(document.data)
    return document


def merge(base: Document, change: Document) -> Document:
    """Return ``base`` with ``change`` applied; neither is modified."""
    merger = _Merger(dict(base.places), change.places)
    return Document(merger.merge(base.data, change.data, ()), merger.places)


def bundled_path(name: str) -> Path:
    """Return the file of a bundled scenario.

    Raises:
        ScenarioError: there is no such file; the message lists all names.
    """
    names = sorted(path.stem for path in BUNDLED.glob("*.yaml"))
    if name not in names:
        hint = ": write bundled:paper" if name == "base" else suggest(name, names)
        raise ScenarioError(f"no scenario {name!r} is bundled{hint}")
    return BUNDLED / f"{name}.yaml"


def _load(
    source: str | Path | Mapping[str, Any], folder: Path, chain: tuple[Path, ...], sizes: list[int]
) -> Document:
    """Read a source and everything that it extends; `sizes` collects the number of values of each.

    Raises:
        ScenarioError: A file can't be read, or there are too many, or too many values in all.
    """
    if isinstance(source, Mapping):
        document = Document(dict(source))
    else:
        bundled = str(source).removeprefix("bundled:")
        path = folder / source if bundled == str(source) else bundled_path(bundled)
        title = os.path.normpath(path) if bundled == str(source) else str(source)
        real = resolved(path, ScenarioError)
        if real in chain:
            circle = (*chain[chain.index(real) :], path)
            names = " → ".join(file.name for file in circle)
            raise ScenarioError(f"{title} extends itself: {names}")
        EXTENDED_FILES.check(len(sizes) + 1, "the scenario", ScenarioError, prefix="at least ")
        document = read_document(path, title)
        sizes.append(len(document.places))
        YAML_VALUES.check(sum(sizes), "the scenario", ScenarioError, prefix="more than ")
        folder = path.parent
        chain = (*chain, real)
    extended = document.data.pop("extends", None) or []
    parents = extended if isinstance(extended, list) else [extended]
    result = Document()
    try:
        for parent in parents:
            if not isinstance(parent, str):
                raise ScenarioError(f"expected the path of a YAML file, got {parent}")
            result = merge(result, _load(str(parent), folder, chain, sizes))
    except ScenarioError as error:
        raise ScenarioError(f"{document.named(('extends',))}: {error}") from error
    # Runs are stored under the name of their scenario, so an extending scenario doesn't inherit it.
    result.places.pop(("name",), None)
    result.data.pop("name", None)
    _refuse_unknown_deletions(result, document)
    return merge(result, document)


def _read_override(text: str) -> Document:
    key, equals, value = text.partition("=")
    keys = tuple(key.strip().split("."))
    written = text if len(text) <= 100 else one_line(text, 100)
    place = f"override {written!r}"
    if not equals:
        raise ScenarioError(f"{place}: expected key.path=value, but there is no '='")
    right = re.sub(r"\[['\"]?(.*?)['\"]?\]", r".\1", key)
    if "." not in key:
        right = right.replace("/", ".")
    if right != key:
        raise ScenarioError(f"{place}: write {right}={value}")
    if not all(keys):
        raise ScenarioError(f"{place}: a part of its key is empty")
    # '#d62728' is a colour, not a comment, although it is not quoted within the value.
    is_color = value.lstrip().startswith("#")
    content = value.strip() if is_color else parse_yaml(value, Path.cwd(), place)
    if not value.strip():
        raise ScenarioError(f"{place}: no value; write {key}=null to delete an entry")
    return assignment(keys, content, place)


def assignment(keys: Keys, value: Any, place: str) -> Document:
    """Return the change that sets one key; messages say that it is written at `place`.

    >>> assignment(("simulation", "seed"), 4, "home.yaml:3").data
    {'simulation': {'seed': 4}}
    """
    for key in reversed(keys):
        value = {key: value}
    return Document(value, {keys[:n]: place for n in range(1, len(keys) + 1)})


class _Merger:
    """Merges two trees of plain data, and the places of their values."""

    def __init__(self, places: dict[Keys, str], new_places: dict[Keys, str]) -> None:
        self.places = places
        self.new_places = new_places

    def merge(self, base: Any, change: Any, keys: Keys) -> Any:
        kind = kind_at(Scenario, keys)
        if kind:
            base, change = _unfold(base, change), _unfold(change, base)
        if not isinstance(change, Mapping):
            return self.replace(change, keys, base)
        if isinstance(base, list) and change and all(key.isdigit() for key in change):
            return self.merge_entries(base, change, keys)
        if not isinstance(base, Mapping):
            return self.replace(change, keys, base)
        if kind:
            base = self.without_old_fields(kind, base, change, keys)
        result = dict(base)
        for key, value in change.items():
            inner = (*keys, str(key))
            if key in result:
                result[key] = self.merge(result[key], value, inner)
            else:
                result[key] = self.replace(value, inner)
        return result

    def merge_entries(self, base: list[Any], change: Mapping[str, Any], keys: Keys) -> list[Any]:
        """Return a list with some entries changed, as by `behaviors.0.dwell=5 min`."""
        result = list(base)
        for key, value in change.items():
            inner = (*keys, key)
            if int(key) >= len(result):
                raise ScenarioError(
                    f"{self.new_places.get(inner)}: there is no {'.'.join(inner)}: the list has "
                    f"{len(result)} entries, and the first is 0"
                )
            result[int(key)] = self.merge(result[int(key)], value, inner)
        return result

    def replace(self, value: Any, keys: Keys, old: Any = None) -> Any:
        self.forget(old, keys)
        depth = len(keys)
        # The place is that of the nearest key around this one; values from Python have none.
        nearest = (self.new_places.get(keys[:n]) for n in range(depth, -1, -1))
        self.places[keys] = next((place for place in nearest if place is not None), "")
        for inner in _paths_in(value, keys):
            if inner in self.new_places:
                self.places[inner] = self.new_places[inner]
        return value

    def forget(self, value: Any, keys: Keys) -> None:
        for path in _paths_in(value, keys):
            self.places.pop(path, None)

    def without_old_fields(
        self, kind: str, base: Mapping[str, Any], change: Mapping[str, Any], keys: Keys
    ) -> dict[str, Any]:
        """Return ``base`` without the fields of its type, if the change selects another type."""
        old_fields: set[str] = set()
        if "behaviors" in change and "type" in base:  # the short form becomes the long one
            old_fields = {"type", *_type_fields(kind, base["type"])}
        elif "type" in change:
            # The type of an algorithm or a metric may be given by its name.
            old = base.get("type", keys[-1])
            new = change["type"]
            if not _is_same_class(kind, old, new):
                old_fields = {"behaviors", *_type_fields(kind, old)}
        for key in old_fields & base.keys():
            self.forget(base[key], (*keys, key))
        return {key: value for key, value in base.items() if key not in old_fields}


def _paths_in(value: Any, keys: Keys) -> Iterator[Keys]:
    """Yield the paths of a value, which has the path `keys`, and of all values within it."""
    yield keys
    if isinstance(value, Mapping):
        for key, inner in value.items():
            yield from _paths_in(inner, (*keys, str(key)))
    elif isinstance(value, list):
        for index, inner in enumerate(value):
            yield from _paths_in(inner, (*keys, str(index)))


def _unfold(value: Any, other: Any) -> Any:
    """Turn a bare type name into a mapping if the other value is a mapping."""
    return {"type": value} if isinstance(value, str) and isinstance(other, Mapping) else value


def _class_of(kind: str, name: Any) -> type[Component] | None:
    """Return a class by its name; None if there is none, which validation will report."""
    with suppress(ScenarioError, TypeError):
        return lookup(kind, name)
    return None


def _is_same_class(kind: str, one: Any, other: Any) -> bool:
    """Return whether two names of types stand for one class."""
    if one == other:  # loading the class may run the user's code
        return True
    cls = _class_of(kind, one)
    return cls is not None and cls is _class_of(kind, other)


def _type_fields(kind: str, name: Any) -> set[str]:
    """Return the fields of a type that its kind's base class doesn't have."""
    cls = _class_of(kind, name)
    return set() if cls is None else set(cls.model_fields) - set(base_of(cls).model_fields)


def _refuse_unknown_deletions(base: Document, change: Document) -> None:
    for section in ENTRIES:
        entries = change.data.get(section)
        names = base.data.get(section) or {}
        for name, value in entries.items() if isinstance(entries, Mapping) else ():
            if value is None and name not in names:
                key = change.named((section, name))
                raise ScenarioError(
                    f"{key}: null deletes an entry, and "
                    f"there is none of this name{suggest(name, names)}"
                )


def _refuse_unknown_entries(base: Document, change: Document, changes: Sequence[Document]) -> None:
    """Refuse to set a key of an unknown entry, unless the change gives its type, too."""
    parts = {keys[:2]: part for part in changes for keys in part.places if len(keys) > 2}
    set_keys = {max(part.places, key=len) for part in changes if part.places}
    for (section, name), part in parts.items():
        if section not in ENTRIES or (section, name) in set_keys or (section,) in set_keys:
            continue
        entries = base.data.get(section) or {}
        names = [key for key, value in entries.items() if value is not None]
        entry = change.data[section][name]
        has_type = isinstance(entry, Mapping) and entry.keys() & {"type", "behaviors"}
        if name not in names and not has_type:
            raise ScenarioError(
                f"{part.place((section, name))}: there is no {section}.{name}"
                f"{suggest(name, names)}; to add one give {section}.{name}.type, too"
            )


def _delete_nulls(data: dict[str, Any]) -> None:
    """Drop sections and named entries that are null."""
    for section in [key for key, value in data.items() if value is None]:
        del data[section]
    for section in ENTRIES:
        entries = data.get(section)
        if isinstance(entries, Mapping):
            data[section] = {key: value for key, value in entries.items() if value is not None}
