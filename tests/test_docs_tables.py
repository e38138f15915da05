"""Tables of keys and commands in the docs name what there is, with the defaults that it has."""

import re
from typing import Annotated, Any, cast

import typer
import yaml
from pydantic import BaseModel, TypeAdapter
from tests.hostile.defences import DEFENCES
from tests.pages import ROOT, text_of

from fleet2d.cli.__main__ import app
from fleet2d.configuration.components import components, lookup

# What a page says of a default that is no value of the key, or a value that depends on others.
IN_WORDS = re.compile(
    r"required|none|always|all|every step|until the next item|see .*|the .*|.* ± .*|.*, positions .*"
    r"|one is required|.*without end|path, .*|`works_outside`|"  # persona: what its lack means
)


def is_default(model: type[BaseModel], key, said):
    """Tell whether a key's default is what a page says, read as the key reads values."""
    field = model.model_fields[key]
    kind = cast("Any", Annotated[field.annotation, *field.metadata, field])
    adapter = TypeAdapter(kind) if field.metadata else TypeAdapter(cast("Any", field.annotation))
    value = adapter.validate_python(yaml.safe_load(said.strip("`")))
    default = field.get_default(call_default_factory=True)
    return bool(value == default or adapter.validate_python(default) == value)


def rows_below(heading) -> list[list[str]]:
    """Return the cells of each row of the table of the page on robots that has this heading."""
    rows = text_of("robots").split(heading)[1].split("\n\n", 1)[0].splitlines()[2:]
    return [[part.strip() for part in row.strip("|").split("|")] for row in rows]


def test_the_other_behaviors_of_robots_exist():
    names = [name for cells in rows_below("| type | does |") for name in cells[0].split("`")[1::2]]
    assert 10 <= len(names)
    assert set() == set(names) - components("behavior").keys()


def test_keys_of_drives_exist_with_their_defaults():
    wrong = []
    for name, _, cell in rows_below("| type | moves | keys (default) |"):
        model = lookup("drive", name.split("`")[1])
        for key, said in re.findall(r"(?:^|[,;] )`([a-z_]+)` \(([^):]*)", cell):
            said = said.removesuffix(" m/s²")
            if not IN_WORDS.fullmatch(said) and not is_default(model, key, said):
                wrong.append((name, key, said, model.model_fields[key].default))
    assert [] == wrong


def test_page_on_security_says_of_every_command_whether_it_runs_code():
    text = text_of("security")
    table = text.split("| command | runs code", 1)[1].split("\n\n", 1)[0]
    group = typer.main.get_command(app)
    stated = {name.split()[0] for name in re.findall(r"`([^`]+)`", table)}

    missing = set(group.list_commands(typer.Context(group))) - stated

    assert not missing, f"add to the table in docs/explanation/security.md: {sorted(missing)}"


def test_each_line_of_the_threat_model_names_its_tests():
    text = text_of("security")
    table = text.split("| defended | against | test |\n| --- | --- | --- |\n", 1)[1]
    tests = ROOT / "tests"

    lines = [line.split("|")[3] for line in table.split("\n\n", 1)[0].splitlines()]

    assert len(lines) >= 9
    paths = set()
    for line in lines:
        named = re.findall(r"`([^`]+)`", line)
        assert named, line
        for name in named:
            path = tests.parent / name if "/" in name else tests / "hostile" / name
            assert path.is_file() or any(path.glob("test_*.py")), name
            paths.add(path)
    assert {tests / defence.test.partition("::")[0] for defence in DEFENCES} <= paths
