"""The table of parts that are simulated, from a log, or live: every cell runs, alone and together."""

import itertools
import re
import subprocess
import sys
from datetime import timedelta
from pathlib import Path

import pytest
from tests import thorough
from tests.thorough import some

import fleet2d
from fleet2d.live import Bridge, open_peers

PAGE = (Path(__file__).parent.parent / "docs/how-to/real-parts.md").read_text(encoding="utf-8")
ROWS = [
    [re.findall(r"`([a-z][^`]*=[^`]*)`", cell) for cell in line.split(" | ")[1:]]
    for line in PAGE.splitlines()
    if line.startswith("| ") and "=" in line
]
COLUMNS = ("simulated", "log", "live")
CELLS = [
    pytest.param(cell[0], id=f"{cell[0].partition('=')[0]}-{COLUMNS[number]}")
    for row in ROWS
    for number, cell in enumerate(row)
    if cell
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return a folder with the files of the page, and the logs that its commands write."""
    pytest.importorskip("rosbags", reason="the extra ros is not installed")
    folder = tmp_path_factory.mktemp("parts")
    for name, text in re.findall(r"```\w+ title=(\S+)\n(.*?)```", PAGE, re.DOTALL):
        (folder / name).write_text(text, encoding="utf-8")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        sensor = ROWS[4][0][0]
        run = fleet2d.run("parts.yaml", "algorithms.ltp.period=30 min", sensor, out="first")
        fleet2d.export(run, Path("drive.mcap"))
        fleet2d.export(run, Path("poses.csv"))
        fleet2d.export(run, Path("first.jsonl"))
        yield folder


def test_the_table_has_all_parts_in_all_columns():
    assert len(ROWS) == 6
    assert [sum(bool(cell) for cell in row) for row in ROWS] == [2, 3, 3, 3, 3, 3]


@pytest.mark.slow
@pytest.mark.parametrize("cell", some(CELLS, 2))
def test_a_cell_runs(folder, cell):
    run = fleet2d.run("parts.yaml", cell)

    assert run.status == "complete"
    assert run.tables["trajectories"].num_rows


@pytest.mark.slow
def test_what_was_replayed_is_as_it_was(folder):
    logged = [row[1][0] for row in ROWS[1:]]
    first = fleet2d.open_run("first")

    run = fleet2d.run("parts.yaml", *logged)

    old, new = first.path("astro"), run.path("astro")
    assert abs(old.x - new.x).max() < 0.1
    assert abs(old.y - new.y).max() < 0.1
    steps = first.tables["observations"]["step"].to_pylist()
    assert run.tables["observations"]["step"].to_pylist() == steps
    assert run.tables["observations"]["user"].to_pylist() == ["ana"] * len(steps)
    states = ("step", "state")
    assert run.tables["sensors"].select(states) == first.tables["sensors"].select(states) or (
        run.tables["sensors"].num_rows == first.tables["sensors"].num_rows
    )


@pytest.mark.slow
def test_live_cells_hear_a_log_that_is_played_to_them(folder):
    """A program without Fleet2D plays the log, twenty times as fast as it was."""
    cells = [row[2][0].replace(":9000", ":0") for row in ROWS[1:5]]
    scenario = fleet2d.load_scenario("parts.yaml", *cells, "simulation.duration=1 min")
    peers = open_peers(scenario)
    bridge = Bridge(fleet2d.Simulation(scenario), peers, speed=20)
    address = f"127.0.0.1:{next(iter(peers.values())).port}"
    program = Path(__file__).parents[1] / "examples" / "live" / "play.py"
    command = [sys.executable, "-I", "-S", str(program), "first.jsonl", address, "20"]
    with subprocess.Popen(command) as player:
        run = bridge.run()
        player.terminate()

    acts = run.manifest["interventions"]
    for name in ("ana", "astro"):
        path = fleet2d.open_run("first").path(name, every=timedelta(seconds=1))
        logged = set(zip(path.x.tolist(), path.y.tolist(), strict=True))
        heard = [tuple(a["to"]) for a in acts if a["do"] == "put" and a["entity"] == name]
        assert len(heard) > 30
        # At a wall some are moved to where the body fits on the lattice.
        assert sum(place not in logged for place in heard) <= bridge.counts["moved"]
    columns = ("user", "x", "y", "room")
    logged = fleet2d.open_run("first").tables["observations"].select(columns).to_pylist()
    seen = run.tables["observations"].select(columns).to_pylist()
    assert seen
    assert all(row in logged for row in seen)
    assert [(row["sensor"], row["state"]) for row in run.tables["sensors"].to_pylist()][:1] == [
        ("kitchen", "ON")
    ]


@pytest.mark.slow
def test_parts_are_combined(folder):
    choices = [[cell[0] for cell in row if cell] for row in ROWS[1:]]
    combinations = list(itertools.product(*choices))
    for cells in combinations if thorough.THOROUGH else combinations[:: len(combinations) // 4]:
        assert fleet2d.run("parts.yaml", *cells).status == "complete"


@pytest.mark.slow
def test_a_learner_is_as_good_on_a_real_log_as_the_page_says(shared_data, tmp_path):
    """One learner, a real log and its twin: both are runs of one scenario."""
    from fleet2d.learning.fit.command import fit_routine

    log = shared_data / "activity" / "uci_adl_a"
    content = {
        "extends": "bundled:paper",
        "simulation": {"start": "2011-11-28", "duration": {"days": 13}},
    }
    persona, errors = tmp_path / "persona.yaml", {}
    fit_routine(log, persona)
    users = {
        "real": {"type": "replay", "path": str(log), "day": "date"},
        "twin": {"type": "routine", "persona": str(persona)},
    }

    for name, ana in users.items():
        run = fleet2d.run(content | {"users": {"ana": ana}}, out=tmp_path / name)
        errors[name] = run.metrics["ltp_error"]["ana"]["tv"]

    said = re.search(r"of ([\d.]+) from the truth on the real log, and of ([\d.]+) on", PAGE)
    assert [round(errors[name], 3) for name in users] == [float(text) for text in said.groups()]
