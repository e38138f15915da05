"""Read a YAML file into plain data, and the place where each value is written."""

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from fleet2d.bounds import FILE_BYTES, one_line, read_bytes
from fleet2d.errors import InputError, ScenarioError
from fleet2d.paths import Text
from fleet2d.problems import Location, did_you_mean
from fleet2d.yaml_tree import NodeError, TreeWalk, compose

Keys = tuple[str, ...]
"""The path of a value in a scenario; indices of lists are text, too."""


@dataclass
class Document:
    """Plain data, and for each of its key paths where it is written, like 'home.yaml:12'."""

    data: dict[str, Any] = field(default_factory=dict)
    places: dict[Keys, str] = field(default_factory=dict)

    def place(self, location: Location) -> str:
        """Return where a key is written, or the nearest key around it.

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
        place, depth = self.places[nearest], len(nearest)
        inner_places = [inner for key, inner in self.places.items() if key[:depth] == nearest]
        first = {_file(inner): inner for inner in reversed(inner_places)}
        changes = [inner for file, inner in first.items() if file not in ("", _file(place))][::-1]
        if not depth or not changes:
            return place
        return f"{place}, changed by {' and '.join(changes)}" if place else changes[0]


def _file(place: str) -> str:
    """Return the file of a place like 'home.yaml:12', or the override that it is.

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
            f"{title} is empty; a scenario that changes nothing reads: extends: bundled:base"
        )
    if not isinstance(document.data, dict):
        raise ScenarioError(
            f"{title}: a scenario is a mapping (simulation: …, floorplan: …); this is "
            + (
                "a list"
                if isinstance(document.data, list)
                else f"the value {one_line(repr(document.data))}"
            )
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
        return _Builder(folder, title, {} if places is None else places).build(node, ())
    except yaml.MarkedYAMLError as error:
        line = (
            f":{error.problem_mark.line + 1}" if error.problem_mark and places is not None else ""
        )
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
        near = [str(p) for p in sorted(path.parent.glob("*.y*ml"))] if path.parent.is_dir() else []
        raise ScenarioError(f"there is no file {title}{did_you_mean(path, near)}") from None
    except IsADirectoryError:
        raise ScenarioError(f"{title} is a folder; name the YAML file in it") from None
    except UnicodeDecodeError as error:
        raise ScenarioError(f"{title} is not a text file (byte {error.start})") from None
    except OSError as error:
        raise ScenarioError(f"can't read {title}: {error.strerror}") from error


@dataclass
class _Builder:
    """Turns a tree of YAML nodes into plain data."""

    folder: Path
    title: str
    places: dict[Keys, str]
    open_nodes: list[yaml.Node] = field(default_factory=list)
    walk: TreeWalk = field(default_factory=TreeWalk)

    def build(self, node: yaml.Node, location: Keys) -> Any:
        """Return the value of a node, and add its place to `places`."""
        self.places.setdefault(location, f"{self.title}:{node.start_mark.line + 1}")
        self.walk.enter(node, self.open_nodes)
        if isinstance(node, yaml.ScalarNode):
            value = self.walk.scalar(node)
            return Text(value, self.folder) if isinstance(value, str) else value
        self.open_nodes.append(node)
        try:
            if isinstance(node, yaml.MappingNode):
                return self._mapping(node, location)
            return [self.build(item, (*location, str(i))) for i, item in enumerate(node.value)]
        finally:
            self.open_nodes.pop()

    def _mapping(self, node: yaml.MappingNode, location: Keys) -> dict[str, Any]:
        result = {}
        for key, value in self.walk.pairs(node):
            path = (*location, key.value)
            self.places.pop(path, None)
            result[key.value] = self.build(value, path)
            self.places[path] = f"{self.title}:{key.start_mark.line + 1}"
        return result
