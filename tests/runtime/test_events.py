"""Event kinds: one enumeration, in which each can be renamed."""

import ast
import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

import fleet2d
from fleet2d.runtime import events
from fleet2d.runtime.events import EventKind

SOURCES = Path(fleet2d.__file__).parent
# Words that are also names of something else: a column, a metric, a key of a scenario.
OTHER_WORDS = {
    EventKind.ACCEPTED, EventKind.ACTIVITY, EventKind.ASKS, EventKind.BATTERY, EventKind.CALLS,
    EventKind.DUE, EventKind.EXPLORED, EventKind.GIVES_WAY, EventKind.IGNORED, EventKind.KNOWN,
    EventKind.LOCKED, EventKind.LOST, EventKind.MISTAKEN, EventKind.MOVED, EventKind.OPENED,
    EventKind.QUESTION, EventKind.REPLAY, EventKind.SENSOR, EventKind.SHUT, EventKind.UNKNOWN,
    EventKind.USES, EventKind.VISITS,
}  # fmt: skip
QUOTED = re.compile("|".join(f'"{kind}"' for kind in events.KINDS))
# Functions that take a kind, and attributes that hold some.
TAKES_KIND = {
    "Event", "Note", "SightEvent", "emit", "events", "interrupt_on", "new_event", "new_note",
    "note", "notes_of",
}  # fmt: skip
HOLDS_KINDS = {"listens", "records"}
RENAME = """
import json, sys
from pathlib import Path
from types import ModuleType
from fleet2d import runtime
path, out = sys.argv[1:]
source = Path(path).read_text()
head, tail = source.split("KINDS = ", 1)
module = ModuleType("fleet2d.runtime.events")
sys.modules[module.__name__] = runtime.events = module
exec(head.replace(' = "', ' = "new_').replace('HOME = "new_"', 'HOME = ""') + "KINDS = " + tail, module.__dict__)
import fleet2d
run = fleet2d.run("simulation.duration=2 d", "expect=null", seed=3, out=out)
print(json.dumps([run.tables["events"]["event"].to_pylist(), run.metrics]))
"""


@pytest.mark.slow
def test_sources_have_no_bare_string_of_an_event_kind():
    paths = set(SOURCES.rglob("*.py")) - {Path(events.__file__)}

    bare = [(path.name, *place) for path in paths for place in bare_kinds(path.read_text())]

    assert [] == bare


@pytest.mark.parametrize(
    "source",
    [
        'wait("user_seen")',
        'plan.note("lost")',
        'plan.note("activity", name)',
        'ends = event.event == "due"',
        'ends = event in ("opened", x)',
        'records = frozenset({"visits"})',
        'records: ClassVar[frozenset[str]] = frozenset({"visits"})',
    ],
)
def test_a_bare_kind_is_noticed(source):
    assert 1 == len(list(bare_kinds(source)))


@pytest.mark.parametrize(
    "source", ['table["activity"]', 'plan.note(EventKind.FOUND, "lost")', "shut = 1"]
)
def test_other_words_are_no_kinds(source):
    assert [] == list(bare_kinds(source))


def bare_kinds(source):
    """Yield the line and the text of each string that is a kind of event."""
    if not QUOTED.search(source):
        return
    tree = ast.parse(source)
    in_place = {id(node) for place in ast.walk(tree) for node in kinds_in(place)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and node.value in events.KINDS:
            is_other_word = node.value in OTHER_WORDS and id(node) not in in_place
            yield from () if is_other_word else [(node.lineno, node.value)]


def kinds_in(node):
    """Yield all nodes of a place that holds kinds: a comparison, arguments, or a declaration."""
    if isinstance(node, ast.Compare) and name_of(node.left) == "event":
        yield from (each for side in node.comparators for each in ast.walk(side))
    if isinstance(node, ast.Call) and name_of(node.func) in TAKES_KIND:
        yield from node.args[: 1 if name_of(node.func) == "note" else None]
    if isinstance(node, ast.Assign | ast.AnnAssign) and node.value is not None:
        target = node.targets[0] if isinstance(node, ast.Assign) else node.target
        if name_of(target) in HOLDS_KINDS:
            yield from ast.walk(node.value)


def name_of(node):
    """Return the name of a variable, or the last one of an attribute."""
    return getattr(node, "attr", getattr(node, "id", ""))


@pytest.mark.slow
def test_a_run_with_renamed_kinds_differs_in_their_names_only(tmp_path):
    run = fleet2d.run("simulation.duration=2 d", "expect=null", seed=3, out=tmp_path / "named")
    kinds = run.tables["events"]["event"].to_pylist()

    renamed_kinds, metrics = renamed_run(tmp_path / "renamed")

    assert [f"new_{kind}" for kind in kinds] == renamed_kinds
    # Numbers of what happened are named by its kind.
    assert json.loads(json.dumps(run.metrics)) == json.loads(
        json.dumps(metrics).replace('"new_', '"')
    )


def renamed_run(out):
    """Return the kinds and metrics of a run of a process in which each kind has another name."""
    command = [sys.executable, "-c", RENAME, events.__file__, str(out)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert not done.returncode, done.stderr
    return json.loads(done.stdout)
