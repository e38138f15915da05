"""Scenarios that are as long as a file may be: each is refused, or read, within seconds."""

import subprocess
import sys

import pytest
from tests.thorough import THOROUGH

import fleet2d
from fleet2d.artifacts import store
from fleet2d.bounds import Bound
from fleet2d.errors import RunDirectoryError, ScenarioError
from fleet2d.scenario.compose import compose
from fleet2d.scenario.load import load_scenario

SECONDS = 10
MEGABYTES = 1000
READ = """
import resource, sys
resource.setrlimit(resource.RLIMIT_CPU, (30, 30))
import fleet2d
try:
    fleet2d.Simulation(sys.argv[1], seed=1).advance(1)
    print("began")
except fleet2d.InputError as error:
    print(error)
usage = resource.getrusage(resource.RUSAGE_SELF)
# Not ru_maxrss, which has the memory of the process that this one was forked from.
status = open('/proc/self/status').read()
print(usage.ru_utime + usage.ru_stime, int(status.split('VmHWM:')[1].split()[0]) / 1024)
"""
BASE = "extends: bundled:paper\n"


def bombs(n):
    """Scenarios of `n` values or entries and more, and a part of the message each."""
    return {
        "extends": (f"extends: [{', '.join(['bundled:paper'] * n)}]", "at most 100 are read"),
        "extends itself in pairs": ("extends: [pairs0.yaml, pairs0.yaml]", "at most 100 are read"),
        "users": (
            f"{BASE}users:\n" + "".join(f"  u{i}: {{type: meander}}\n" for i in range(n)),
            "users: it has",
        ),
        "wrong users": (
            f"{BASE}users:\n" + "".join(f"  u{i}: {{type: meandr}}\n" for i in range(2400 if THOROUGH else 1500)),
            "no behavior 'meandr'",
        ),
        "unknown modules": (
            f"{BASE}users:\n" + "".join(f"  u{i}: 'nothing{i}:X'\n" for i in range(2400)),
            "no module named 'nothing0'",
        ),
        "behaviors": (
            f"{BASE}users: {{ana: {{behaviors: [{'meander, ' * n}meander]}}}}",
            "users.ana.behaviors: it has",
        ),
        "script": (
            f"{BASE}script:\n" + "- {put: ana, at: 19:00, place: kitchen}\n" * n,
            "script: it has",
        ),
        "script that runs": (
            f"{BASE}script:\n"
            + "".join(f"- {{at: {i} s, hold: ana}}\n" for i in range(18_000 if THOROUGH else 6_000)),
            "began",
        ),
        "anchors": ("a:\n" + "".join(f"- &a{i} x\n" for i in range(8 * n)), "at most 200000"),
        "fewer anchors": (
            "a:\n" + "".join(f"- &a{i} x{i}\n" for i in range(190_000)),
            "a: it has 190000 entries",
        ),
        "unknown keys": (
            BASE + "".join(f"u{i}: 1\n" for i in range(95_000)),
            "... and more: these are the first",
        ),
        "numbers": (f"a: [{'1.5, ' * 190_000}1]", "unknown key 'a'"),
    }  # fmt: skip


QUICK = ["extends", "users", "wrong users"]


@pytest.mark.slow
@pytest.mark.parametrize("name", list(bombs(1)) if THOROUGH else QUICK)
def test_scenario_is_refused_within_seconds(tmp_path, name):
    """`extends` of 20,000 names, 30,000 users or 200,000 anchors took 7 to 25 s and more."""
    text, message = bombs(25_000)[name]
    (tmp_path / "home.yaml").write_text(text)
    for i in range(20):
        (tmp_path / f"pairs{i}.yaml").write_text(f"extends: [pairs{i + 1}.yaml, pairs{i + 1}.yaml]")
    (tmp_path / "pairs20.yaml").write_text(BASE)

    done = subprocess.run(
        [sys.executable, "-c", READ, "home.yaml"], cwd=tmp_path, capture_output=True, text=True,
        timeout=300, check=False,
    )  # fmt: skip

    assert done.returncode == 0, done.stderr
    *lines, figures = done.stdout.splitlines()
    seconds, megabytes = map(float, figures.split())
    assert message in "\n".join(lines)
    assert seconds < SECONDS
    assert megabytes < MEGABYTES


def house(folder, members, more=""):
    """Write a scenario with a household whose members have one persona of their own."""
    names = [f"u{i}" for i in range(members)]
    (folder / "own.yaml").write_text("extends: retired\npace: 0.9\n")
    lines = "".join(f"  {name}: own.yaml\n" for name in names)
    (folder / "house.yaml").write_text(f"members:\n{lines}")
    text = "".join(f"  {name}: {{type: routine, household: house.yaml}}\n" for name in names)
    (folder / "home.yaml").write_text(f"{BASE}users:\n{text}{more}")
    return folder / "home.yaml"


def test_a_household_is_read_once_for_all_its_members(tmp_path):
    """It was read and validated for each of them, which took a minute for some hundreds."""
    path = house(tmp_path, 20, "  bob: {type: routine, persona: own.yaml}\n")

    users = load_scenario(path).users

    households = [users[f"u{i}"].behaviors[0].household for i in range(20)]
    assert all(household is households[0] for household in households)
    assert 1 == len({id(persona) for persona in households[0].members.values()})


def test_a_household_has_a_bound(tmp_path):
    """Each member is stored with all others in the manifest: 2,500 were too many to read again."""
    with pytest.raises(ScenarioError, match=r"household: the household has 101 members, and at mo"):
        load_scenario(house(tmp_path, 101))


def persona_files(folder, n):
    """Personas that each extend the next one twice: read in turn they are 2 ** n files."""
    for i in range(n):
        (folder / f"own{i}.yaml").write_text(f"extends: [own{i + 1}.yaml, own{i + 1}.yaml]")
    (folder / f"own{n}.yaml").write_text("extends: retired")


@pytest.mark.parametrize("persona", ["own0.yaml", f"{{extends: [{'retired, ' * 5000}retired]}}"])
def test_a_persona_extends_a_bounded_number_of_files(tmp_path, persona):
    """Files that extend the next one twice were read for hours, 2,000 names for 9 s."""
    persona_files(tmp_path, 40)
    text = f"{BASE}users: {{ana: {{type: routine, persona: {persona}}}}}\n"
    (tmp_path / "home.yaml").write_text(text)

    with pytest.raises(ScenarioError, match=r"ana\.persona: the persona has at least 101 files"):
        load_scenario(tmp_path / "home.yaml")


def test_personas_of_a_household_count_for_each_member(tmp_path):
    """A household of 100 had a manifest of 284 MB, which nothing could read; 24 of them, 20 GB."""
    assert 20 == len(load_scenario(house(tmp_path, 20)).users) - 1  # and ana
    with pytest.raises(ScenarioError, match=r"FLEET2D_MAX_PERSONA_VALUES=\d+ in the") as caught:
        load_scenario(house(tmp_path, 100))
    assert 2 >= len(str(caught.value).splitlines())


def test_long_texts_of_personas_count_for_each_user(tmp_path):
    """A text is stored for each user: 60 MB for 2,499 of them were 150 GB of a manifest."""
    (tmp_path / "own.yaml").write_text(f"extends: retired\nabout: {'x' * 10_000_000}\n")
    users = "".join(f"  u{i}: {{type: routine, persona: own.yaml}}\n" for i in range(20))
    (tmp_path / "home.yaml").write_text(f"{BASE}users:\n{users}")

    with pytest.raises(ScenarioError, match="FLEET2D_MAX_PERSONA_VALUES"):
        load_scenario(tmp_path / "home.yaml")


def test_no_run_begins_that_could_not_be_opened(tmp_path, monkeypatch):
    """It was simulated and stored whole, and then its manifest was too large to be read."""
    monkeypatch.setattr(store, "FILE_BYTES", Bound("FILE_BYTES", 1000, "bytes"))

    with pytest.raises(RunDirectoryError, match=r"month/manifest\.json has \d+ bytes, and at most"):
        fleet2d.run("bundled:paper", "simulation.duration=1h", seed=1, out=tmp_path / "month")
    assert not (tmp_path / "month").exists()


def test_places_of_replaced_values_are_forgotten(tmp_path):
    """Messages name where a value is written now, not where one that it replaced was."""
    (tmp_path / "a.yaml").write_text(
        "users:\n  ana:\n    type: meander\n    away:\n    - {from: 8:00}\n"
    )
    (tmp_path / "b.yaml").write_text("extends: a.yaml\nusers:\n  ana:\n    away: []\n")

    document = compose(tmp_path / "b.yaml")

    assert document.places[("users", "ana", "away")] == f"{tmp_path}/b.yaml:4"
    assert not [path for path in document.places if path[:3] == ("users", "ana", "away")][1:]
    assert document.places[("users", "ana", "type")] == f"{tmp_path}/a.yaml:3"
