"""Reading YAML: values without traps, places, and what is wrong with a file."""

from datetime import date, datetime
from pathlib import Path

import pytest

from fleet2d.configuration import documents
from fleet2d.configuration.documents import Document, parse, parse_yaml, read_document
from fleet2d.configuration.units import Text
from fleet2d.errors import InputError, ScenarioError


@pytest.mark.parametrize(
    ("written", "value"),
    [
        ("12:30", "12:30"),
        ("1:30:00", "1:30:00"),
        ("on", "on"),
        ("off", "off"),
        ("No", "No"),
        ("true", True),
        ("1e-3", 1e-3),
        ("1.", 1.0),
        (".5", 0.5),
        ("-.inf", float("-inf")),
        ("010", 10),
        ("0x10", 16),
        ("0o10", 8),
        ("1_000", "1_000"),
        ("null", None),
        ("~", None),
        ("", None),
        ("=", "="),
        ("'3'", "3"),
        ("2026-01-05", date(2026, 1, 5)),
        ("2026-01-05 08:00:00", datetime(2026, 1, 5, 8)),
        ("2026-02-31", "2026-02-31"),
        ("[1, [a]]", [1, ["a"]]),
        ("{1: a, true: b}", {"1": "a", "true": "b"}),
    ],
)
def test_value_is_read_as_written(written, value):
    read = parse_yaml(written, Path(), "example")

    assert (type(value), value) == (type(read) if not isinstance(read, Text) else str, read)


def test_text_knows_the_folder_it_was_written_in():
    assert Path("/homes") == parse_yaml("plan.json", Path("/homes"), "example").folder


def test_places_are_lines(tmp_path):
    file = tmp_path / "home.yaml"
    file.write_text("# a home\nusers:\n  ana:\n    stops:\n    - hall\n    - to: bath\n")
    document = read_document(file, "home.yaml")

    assert "home.yaml:2" == document.place(("users",))
    assert "home.yaml:3" == document.place(("users", "ana", "speed"))
    assert "home.yaml:5" == document.place(("users", "ana", "stops", 0))
    assert "home.yaml:6" == document.place(("users", "ana", "stops", 1, "to"))
    assert "" == Document().place(("users",))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"a: 1\nb: 2\na: 3", "home.yaml:3: the key 'a' is already in line 1"),
        (b"a: 1\nb: [1,\n", "home.yaml:3: not valid YAML: a value is missing, or a bracket is not closed"),
        (b"a: 1\n\tb: 2", "home.yaml:2: not valid YAML: YAML indents with spaces, this line has a tab"),
        (b"a:\n  b: 1\n   c: 2", "home.yaml:3: not valid YAML: check the indentation of this line"),
        (b"a:\n  b: 1\n c: 2", "home.yaml:3: not valid YAML: check the indentation: this line"),
        (b"- 1\nb: 2", "home.yaml:2: not valid YAML: check the indentation: this line"),
        (b"a: 1\nb", "home.yaml:2: not valid YAML: check the line before: a key ends with ':'"),
        (b"a: [1, 2\nb: 3", "home.yaml:2: not valid YAML: a bracket is opened in line 1 and not"),
        (b"a: 1\nb: 'x\n\n", "a quote is opened in line 2 and not closed"),
        (b"a: @x", "home.yaml:1: not valid YAML: a text that begins with '@' needs quotes"),
        (b"a: &x [*x]", "home.yaml:1: a value can't contain itself"),
        (b"? [a]\n: 1", "home.yaml:1: a key must be plain text"),
        (b"a: *b", "home.yaml:1: not valid YAML: found undefined alias 'b'"),
        (b"a: !mine 3", "home.yaml:1: the tag '!mine' can't be used here"),
        (b"a: !!int x", "home.yaml:1: 'x' is not a valid int"),
        (b"a: 1\n---\nb: 2", "home.yaml:2: not valid YAML: a scenario is one document: remove the line '---'"),
        (b"a: \x01", "home.yaml: not valid YAML: unacceptable character"),
        (b"[" * 5000, "home.yaml: it has at least 65 lists in lists, and at most 64 are read"),
        (b"", "home.yaml is empty"),
        (b"# nothing yet\n", "home.yaml is empty"),
        (b"- 1", "home.yaml: a scenario is a mapping (simulation: …, floorplan: …); "
                 "this is a list"),
        (b"hello", "this is the value 'hello'"),
        (b"\x7fELF\x80\xff", "home.yaml is not a text file"),
    ],
)  # fmt: skip
def test_file_that_is_no_scenario_is_refused(tmp_path, content, message):
    file = tmp_path / "home.yaml"
    file.write_bytes(content)

    with pytest.raises(ScenarioError) as caught:
        read_document(file, "home.yaml")
    assert message in str(caught.value)


def test_missing_file_names_the_nearest(tmp_path):
    (tmp_path / "home.yaml").touch()

    with pytest.raises(
        ScenarioError, match=r"there is no file .*hom.yaml: did you mean .*home.yam"
    ):
        read_document(tmp_path / "hom.yaml")


def test_folder_is_refused(tmp_path):
    with pytest.raises(ScenarioError, match="is a folder"):
        read_document(tmp_path)


def test_values_of_an_anchor_count_for_each_alias(monkeypatch):
    monkeypatch.setenv("FLEET2D_MAX_VALUES", "50")
    assert {"a": [1] * 20, "b": 2} == parse(f"a: &a {[1] * 20}\nb: 2")
    with pytest.raises(InputError, match="more than 51 values, and at most 50"):
        parse(f"a: &a {[1] * 20}\nb: [*a, *a]")


@pytest.mark.parametrize(
    ("text", "bound"), [("[" * 3000, "DEPTH"), (f"[{'[],' * 3000}]", "VALUES")]
)
def test_a_long_text_is_counted_before_its_nodes_are_built(monkeypatch, text, bound):
    monkeypatch.setenv("FLEET2D_MAX_VALUES", "100")
    monkeypatch.setattr(documents, "_composed", lambda _: pytest.fail("nodes were built"))
    with pytest.raises(InputError, match=f"set FLEET2D_MAX_{bound}="):
        parse(text)
