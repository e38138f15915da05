"""YAML documents as plain data, with the place of each value: the one reader of all YAML.

Scalars are those of YAML 1.2: booleans are true and false only, 12:30 is text. An alias is the same
node as its anchor, so few nodes can stand for very many values, which are counted.
"""

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from fleet2d.bounds import DEPTH, FILE_BYTES, YAML_VALUES, one_line, read_bytes
from fleet2d.configuration.problems import Location, did_you_mean
from fleet2d.configuration.units import Text
from fleet2d.errors import InputError, ScenarioError

# All nodes of a shorter text fit into memory [characters].
_SHORT = 1 << 20
# libyaml recurses for each level of a text, and this many don't overflow the stack.
_SHALLOW = 2000
# PyYAML's own parser has better messages, but is too slow for a longer text [characters].
_SLOW_TO_EXPLAIN = 100_000


class Loader(yaml.SafeLoader):
    """PyYAML's safe loader with the scalars of YAML 1.2, dates included."""


class _FastLoader(getattr(yaml, "CSafeLoader", yaml.SafeLoader)):  # type: ignore[misc]
    """The same loader in C, if PyYAML was built with libyaml."""


Pair = tuple[yaml.ScalarNode, yaml.Node]

TAG = "tag:yaml.org,2002:"
MERGE = f"{TAG}merge"
_PLAIN = frozenset(
    TAG + name for name in ("null", "bool", "int", "float", "str", "timestamp", "seq", "map")
)

Loader.yaml_implicit_resolvers = {}
for _name, _pattern, _first in (
    ("null", r"~|null|Null|NULL|", ["~", "n", "N", ""]),
    ("bool", r"true|True|TRUE|false|False|FALSE", list("tTfF")),
    ("int", r"[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+", list("-+0123456789")),
    (
        "float",
        r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?"
        r"|[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)",
        list("-+.0123456789"),
    ),
    ("merge", r"<<", ["<"]),
):
    Loader.add_implicit_resolver(TAG + _name, re.compile(rf"(?:{_pattern})\Z"), _first)
_TIMESTAMP = [
    resolver
    for resolver in yaml.SafeLoader.yaml_implicit_resolvers["1"]
    if resolver[0] == f"{TAG}timestamp"
]
for _digit in "0123456789":
    Loader.yaml_implicit_resolvers[_digit] += _TIMESTAMP
_FastLoader.yaml_implicit_resolvers = Loader.yaml_implicit_resolvers


def _construct_int(_: yaml.SafeLoader, node: yaml.ScalarNode) -> int:
    text = node.value
    return int(text, 0) if text[:2] in ("0o", "0x") else int(text)


def _construct_timestamp(loader: yaml.SafeLoader, node: yaml.ScalarNode) -> Any:
    try:
        return loader.construct_yaml_timestamp(node)
    except (ValueError, AttributeError):
        return node.value  # 2026-02-31 stays text, which the model refuses


Loader.add_constructor(f"{TAG}int", _construct_int)
Loader.add_constructor(f"{TAG}timestamp", _construct_timestamp)


class NodeError(InputError):
    """An error in a node of a YAML text.

    Attributes:
        node: The node.
    """

    def __init__(self, node: yaml.Node, message: str) -> None:
        super().__init__(message)
        self.node = node


def compose(text: str) -> yaml.Node | None:
    """Return the tree of nodes of a YAML text, None if it is empty.

    Raises:
        yaml.YAMLError: It is not YAML.
        InputError: It is beyond a bound.
    """
    longest = max(map(len, text.splitlines()), default=0)
    try:
        depth = text.count("[") + text.count("{") + 2 * longest  # at most
        if len(text) > _SHORT or depth > _SHALLOW:
            _check_events(text, _FastLoader)
        return _composed(_FastLoader(text))
    except yaml.YAMLError as error:
        if "nesting depth" in str(error):  # libyaml 0.2.6 reads ahead of its events
            _check_events(text, Loader)
        if len(text) > _SLOW_TO_EXPLAIN:
            raise
    return _composed(Loader(text))


def _composed(loader: Any) -> yaml.Node | None:
    try:
        return loader.get_single_node()
    except RecursionError:
        raise yaml.YAMLError("it is nested too deeply") from None
    finally:
        loader.dispose()


def _check_events(text: str, loader: Any) -> None:
    """Refuse a text of too many levels or values before its nodes are built."""
    depth = values = 0
    most_depth = DEPTH.limit
    most_values = YAML_VALUES.limit
    for event in yaml.parse(text, Loader=loader):
        if isinstance(event, yaml.CollectionEndEvent):
            depth -= 1
        elif isinstance(event, yaml.NodeEvent):
            values += 1
            depth += isinstance(event, yaml.CollectionStartEvent)
            if depth > most_depth:
                DEPTH.check(depth, "it", prefix="at least ")
            if values > most_values:
                YAML_VALUES.check(values, "it", prefix="more than ")


def parse(text: str) -> Any:
    """Return a YAML text as plain data.

    Raises:
        yaml.YAMLError: It is not YAML.
        InputError: It is beyond a bound, or a value in it can't be read.

    Example:
        >>> parse("{a: &x [1, 2], b: {<<: {c: 12:30}, d: *x}}")
        {'a': [1, 2], 'b': {'c': '12:30', 'd': [1, 2]}}
    """
    node = compose(text)
    return None if node is None else _Builder(None, "").build(node)


Keys = tuple[str, ...]
"""The path of a value in a scenario; indices of lists are text, too."""


class _Builder:
    """Turns a tree of YAML nodes into plain data; counts its values, once for each alias."""

    def __init__(
        self, folder: Path | None, title: str, places: dict[Keys, str] | None = None
    ) -> None:
        """Start without values.

        Args:
            folder: The folder of the document, attached to all texts in it; None: to none.
            title: The name of the text in places.
            places: Where the place of each value is added; None: nowhere.
        """
        self._folder, self._title, self._places = folder, title, places
        self._values = 0
        self._most_values = YAML_VALUES.limit
        self._most_depth = DEPTH.limit
        self._scalars = Loader("")
        self._pairs: dict[int, dict[str, Pair] | None] = {}
        self._parents: list[yaml.Node] = []

    def build(self, node: yaml.Node, location: Keys = ()) -> Any:
        """Return the value of a node.

        Raises:
            NodeError: It contains itself, has an unknown tag, or can't be read as what its tag
                says; a key is not text or is there twice, or a merged value is not a mapping.
            InputError: There are too many values or levels.
        """
        self._enter(node)
        if self._places is not None:
            self._places.setdefault(location, f"{self._title}:{node.start_mark.line + 1}")
        if isinstance(node, yaml.ScalarNode):
            value = self._scalar(node)
            if isinstance(value, str) and self._folder is not None:
                return Text(value, self._folder)
            return value
        self._parents.append(node)
        if isinstance(node, yaml.MappingNode):
            content: Any = self._mapping(node, location)
        else:
            items = enumerate(node.value)
            content = [self.build(item, (*location, str(number))) for number, item in items]
        self._parents.pop()
        return content

    def _mapping(self, node: yaml.MappingNode, location: Keys) -> dict[str, Any]:
        result = {}
        for key, value in self._pairs_of(node).values():
            path = (*location, key.value)
            result[key.value] = self.build(value, path)
            if self._places is not None:
                self._places[path] = f"{self._title}:{key.start_mark.line + 1}"
        return result

    def _enter(self, node: yaml.Node) -> None:
        self._values += 1
        if self._values > self._most_values:
            YAML_VALUES.check(self._values, "it", prefix="more than ")
        if len(self._parents) >= self._most_depth:
            DEPTH.check(len(self._parents) + 1, "it", prefix="at least ")
        if node.tag not in _PLAIN:
            raise NodeError(node, f"the tag {one_line(node.tag)!r} can't be used here")
        if node in self._parents:  # nodes are equal only to themselves
            raise NodeError(node, "a value can't contain itself")

    def _scalar(self, node: yaml.ScalarNode) -> Any:
        if node.tag == f"{TAG}str":
            return node.value
        try:
            return self._scalars.construct_object(node)
        except (ValueError, LookupError, TypeError, AttributeError, OverflowError):
            kind = node.tag.removeprefix(TAG)
            text = one_line(node.value)
            size = f" of {len(node.value)} characters" if len(node.value) > len(text) else ""
            raise NodeError(node, f"{text!r}{size} is not a valid {kind}") from None

    def _pairs_of(self, node: yaml.MappingNode) -> dict[str, Pair]:
        """Return the keys and values of a mapping, first those that it merges ('<<')."""
        if id(node) in self._pairs:
            pairs = self._pairs[id(node)]
            if pairs is None:
                raise NodeError(node, "a value can't contain itself")
            return pairs
        self._pairs[id(node)] = None  # in progress
        keys: dict[str, Pair] = {}
        for key, value in node.value:
            if not isinstance(key, yaml.ScalarNode):
                raise NodeError(key, "a key must be plain text")
            if key.value in keys:
                line = keys[key.value][0].start_mark.line + 1
                raise NodeError(key, f"the key {one_line(key.value)!r} is already in line {line}")
            keys[key.value] = (key, value)
        pairs = {}
        for name, (key, value) in list(keys.items()):
            if key.tag == MERGE:
                del keys[name]
                sources = value.value if isinstance(value, yaml.SequenceNode) else [value]
                for source in reversed(sources):  # the first source takes precedence
                    if not isinstance(source, yaml.MappingNode):
                        raise NodeError(source, "'<<' merges a mapping, or a list of mappings")
                    pairs.update(self._pairs_of(source))
        pairs.update(keys)
        self._pairs[id(node)] = pairs
        return pairs


@dataclass
class Document:
    """Plain data, and for each of its key paths where it is written, like 'home.yaml:12'."""

    data: dict[str, Any] = field(default_factory=dict)
    places: dict[Keys, str] = field(default_factory=dict)

    def named(self, location: Location) -> str:
        """Return the path of a key after its place, if known: the beginning of an error.

        Example:
            >>> Document(places={("users",): "home.yaml:4"}).named(("users", "bo"))
            'home.yaml:4: users.bo'
        """
        path = ".".join(map(str, location))
        place = self.place(location)
        return f"{place}: {path}" if place else path

    def place(self, location: Location) -> str:
        """Return the place of a key, or of the nearest key around it.

        For a mapping it also names the files and overrides that change it: an error about the
        mapping may be due to these.

        Example:
            >>> document = Document()
            >>> document.places[("users", "bo")] = "home.yaml:4"
            >>> document.places[("users", "bo", "type")] = "override 'users.bo.type=schedule'"
            >>> document.place(("users", "bo", "days"))
            "home.yaml:4, changed by override 'users.bo.type=schedule'"
        """
        keys = tuple(map(str, location))
        parents = (keys[:n] for n in range(len(keys), -1, -1))
        nearest = next((parent for parent in parents if parent in self.places), None)
        if nearest is None:
            return ""
        place = self.places[nearest]
        depth = len(nearest)
        inner_places = [inner for key, inner in self.places.items() if key[:depth] == nearest]
        first = {_file(inner): inner for inner in reversed(inner_places)}
        known = ("", _file(place))
        changes = [inner for file, inner in first.items() if file not in known][::-1]
        if not depth or not changes:
            return place
        return f"{place}, changed by {' and '.join(changes)}" if place else changes[0]


def _file(place: str) -> str:
    """Return the file of a place like 'home.yaml:12', or the whole text of an override.

    >>> _file("home.yaml:12"), _file("override 'simulation.seed=4'")
    ('home.yaml', "override 'simulation.seed=4'")
    """
    return re.sub(r":\d+$", "", place)


def read_document(path: Path, title: str | None = None) -> Document:
    """Read a YAML file.

    Args:
        path: The file.
        title: Its name in messages; None: its path.

    Raises:
        ScenarioError: the file can't be read, or is not a YAML mapping; with file and line.
    """
    title = title or str(path)
    document = Document()
    document.data = parse_yaml(_read_text(path, title), path.parent, title, document.places)
    if document.data is None:
        raise ScenarioError(
            f"{title} is empty; a scenario that changes nothing reads: extends: bundled:paper"
        )
    if not isinstance(document.data, dict):
        value = f"the value {one_line(repr(document.data))}"
        kind = "a list" if isinstance(document.data, list) else value
        raise ScenarioError(
            f"{title}: a scenario is a mapping (simulation: …, floorplan: …); this is {kind}"
        )
    return document


def parse_yaml(text: str, folder: Path, title: str, places: dict[Keys, str] | None = None) -> Any:
    """Return YAML text as plain data, read by YAML 1.2.

    Booleans are true and false only, 12:30 is text, and a key twice is an error.

    >>> parse_yaml("{start: 12:30, light: on, tolerance: 1e-3}", Path(), "example")
    {'start': '12:30', 'light': 'on', 'tolerance': 0.001}

    Args:
        text: The text.
        folder: The folder that relative paths in the text start from.
        title: The name of the text in messages.
        places: Where the place of each value is added; None: nowhere.

    Raises:
        ScenarioError: the text is not YAML; with file and line.
    """
    try:
        node = compose(text)
        if node is None:
            return None
        return _Builder(folder, title, places).build(node)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark if places is not None else None
        line = f":{mark.line + 1}" if mark else ""
        raise ScenarioError(f"{title}{line}: not valid YAML: {_explain(error)}") from error
    except NodeError as error:
        line = f":{error.node.start_mark.line + 1}" if places is not None else ""
        raise ScenarioError(f"{title}{line}: {error}") from None
    except (yaml.YAMLError, RecursionError) as error:
        raise ScenarioError(f"{title}: not valid YAML: {one_line(error, 200)}") from error
    except InputError as error:
        raise ScenarioError(f"{title}: {error}") from None


_YAML_ERRORS = (
    (r"character '\\t'", "YAML indents with spaces, this line has a tab"),
    (r"character '(.)' that cannot start", "a text that begins with '{0}' needs quotes"),
    (r"mapping values", "check the indentation of this line and the one before it, and that each "
                        "key ends with ':'; a text with ': ' in it needs quotes"),
    (r"expected <block end>", "check the indentation: this line isn't aligned with the lines "
                              "around it"),
    (r"quoted scalar", "a quote is opened in line {line} and not closed"),
    (r"flow node", "a value is missing, or a bracket is not closed"),
    (r"flow (?:sequence|mapping)", "a bracket is opened in line {line} and not closed, or a ',' is "
                                   "missing"),
    (r"another document", "a scenario is one document: remove the line '---'"),
    (r"could not find expected ':'", "check the line before: a key ends with ':'"),
)  # fmt: skip
"""Patterns of PyYAML's messages, and clearer messages for them; the first match counts."""


def _explain(error: yaml.MarkedYAMLError) -> str:
    """Return a clear message about an error in a YAML text."""
    message = " ".join(part for part in (error.problem, error.context) if part)
    mark = error.context_mark or error.problem_mark
    for pattern, clear_message in _YAML_ERRORS:
        if match := re.search(pattern, message):
            return clear_message.format(*match.groups(), line=mark.line + 1 if mark else 1)
    return message


def _read_text(path: Path, title: str) -> str:
    try:
        return read_bytes(path, FILE_BYTES, ScenarioError).decode("utf-8-sig")
    except FileNotFoundError:
        near = sorted(path.parent.glob("*.y*ml")) if path.parent.is_dir() else []
        raise ScenarioError(f"there is no file {title}{did_you_mean(path, near)}") from None
    except IsADirectoryError:
        raise ScenarioError(f"{title} is a folder; name the YAML file in it") from None
    except UnicodeDecodeError as error:
        raise ScenarioError(f"{title} is not a text file (byte {error.start})") from None
    except OSError as error:
        raise ScenarioError(f"can't read {title}: {error.strerror}") from error
