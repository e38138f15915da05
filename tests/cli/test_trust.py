"""No code of a stored run is run unless it is trusted; what would run is listed first."""

import pytest
from tests.scenes import fleet2d_process, process

OWN = """
from pathlib import Path
import fleet2d

Path("{ran}").touch()

class Count(fleet2d.Algorithm):
    def update(self, history, state):
        return {{"n": 1.0}}
"""


@pytest.fixture(scope="module")
def home(tmp_path_factory):
    """A folder with a complete and an interrupted run of a scenario with code of its own."""
    folder = tmp_path_factory.mktemp("own")
    (folder / "mine.py").write_text(OWN.format(ran=folder / "ran"))
    override = "algorithms.count.type=mine:Count"
    done = fleet2d_process(
        "run",
        "simulation.duration=20 min",
        override,
        "--seed",
        "4",
        "--out",
        "run",
        "--quiet",
        cwd=folder,
    )
    assert 0 == done.returncode, done.stderr
    code = (
        "import fleet2d; s = fleet2d.Simulation('simulation.duration=20 min',"
        f" {override!r}, seed=4, out='half'); s.advance(600); s.finish()"
    )
    done = process("-c", code, cwd=folder)
    assert 0 == done.returncode, done.stderr
    (folder / "ran").unlink()
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("command", [("verify", "run", "--again"), ("resume", "half")])
def test_code_runs_only_when_it_is_trusted(fleet2d, monkeypatch, home, command):
    monkeypatch.chdir(home)
    code, _, err = fleet2d(*command)
    assert 2 == code
    assert f"{home}/mine.py (algorithms.count.type)" in err
    assert "if you trust all of it, give --trust" in err
    assert not (home / "ran").exists()
    trusted = fleet2d_process(*command, "--trust", cwd=home)
    assert 0 == trusted.returncode, trusted.stderr
    assert f"{home}/mine.py (algorithms.count.type)" in trusted.stderr
    assert ("continuing from" in trusted.stderr) == (command[0] == "resume")
    (home / "ran").unlink()


def test_verify_runs_nothing(fleet2d, monkeypatch, home):
    monkeypatch.chdir(home)
    code, out, err = fleet2d("verify", "run")
    assert 0 == code, err
    assert out.startswith("verified: seal ")
    assert not (home / "ran").exists()
    path = home / "run" / "events.parquet"
    content = path.read_bytes()
    path.write_bytes(content[:-1] + b"?")
    code, _, err = fleet2d("verify", "run")
    path.write_bytes(content)
    assert (1, "events.parquet was changed\n") == (code, err)
