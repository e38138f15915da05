"""No code of a stored run is run unless it is named; what would run is listed first."""

import io
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.scenes import Cli, fleet2d_process

from fleet2d.artifacts.store import RunStore
from fleet2d.engine import snapshot
from fleet2d.engine.snapshot import read_state
from fleet2d.errors import ArtifactError

OWN = """
from pathlib import Path
import fleet2d

Path("{ran}").touch()

class Count(fleet2d.Algorithm):
    def update(self, history, state):
        return {{"n": 1.0}}
"""


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a complete and an interrupted run of a scenario with code of its own."""
    folder = tmp_path_factory.mktemp("own")
    (folder / "mine.py").write_text(OWN.format(ran=folder / "ran"))
    override = "algorithms.count.type=mine:Count"
    done = fleet2d_process(
        "run",
        "simulation.duration=2 h",
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
        "import fleet2d; s = fleet2d.Simulation('simulation.duration=2 h',"
        f" {override!r}, seed=4, out='half'); s.advance(4000); s.finish()"
    )
    from tests.scenes import process

    done = process("-c", code, cwd=folder)
    assert 0 == done.returncode, done.stderr
    (folder / "ran").unlink()
    return folder


@pytest.mark.slow
@pytest.mark.parametrize(("command", "run"), [("reproduce", "run"), ("resume", "half")])
def test_code_runs_only_when_it_is_named(
    fleet2d: Cli, monkeypatch: pytest.MonkeyPatch, home: Path, command: str, run: str
) -> None:
    monkeypatch.chdir(home)
    code, _, err = fleet2d(command, run)
    assert 2 == code
    assert f"{home}/mine.py (algorithms.count.type)" in err
    assert f"--trust {home}/mine.py" in err
    assert 2 == fleet2d(command, run, "--trust", __file__)[0]
    assert "name it by --trust-dir" in fleet2d(command, run, "--trust", home)[2]
    assert not (home / "ran").exists()
    named = fleet2d_process(
        command,
        run,
        *(("--trust", "mine.py") if command == "resume" else ("--trust-dir", ".")),
        cwd=home,
    )
    assert 0 == named.returncode, named.stderr
    (home / "ran").unlink()


def test_verify_runs_nothing(fleet2d: Cli, monkeypatch: pytest.MonkeyPatch, home: Path) -> None:
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


class Call:
    """Pickled, it calls something."""

    def __init__(self, what: Any, *arguments: Any) -> None:
        self.what, self.arguments = what, arguments

    def __reduce__(self) -> Any:
        return self.what, self.arguments


def hostile() -> dict[str, bytes]:
    import os
    import subprocess

    from fleet2d.engine.simulation import Simulation
    from fleet2d.storage.files import FolderLock
    from fleet2d.studies.records import Journal
    from fleet2d.viewer.page_server import PageServer

    dotted = b"\x80\x04\x8c\x13fleet2d.paper.speed\x8c\x10subprocess.Popen\x93\x8c\x04true\x85R."
    imported = b"\x80\x04\x8c\x17fleet2d.artifacts.store\x8c\x04Path\x93\x8c\x01x\x85R."
    return {
        "command": pickle.dumps(Call(os.system, "true")),
        "process": pickle.dumps(Call(subprocess.Popen, "true")),
        "imported by us": dotted,
        "another's class in our module": imported,
        "a simulation": pickle.dumps(Call(Simulation, {})),
        "a journal of a study": pickle.dumps(Call(Journal, Path("x"))),
        "a server": pickle.dumps(Call(PageServer, [])),
        "a lock": pickle.dumps(Call(FolderLock, Path("/tmp"), "x")),
        "eval": pickle.dumps(Call(eval, "1")),
        "objects from bytes": pickle.dumps(Call(np.ndarray, (1,), "O", bytes(8))),
        "a type": pickle.dumps(np.dtype("U5")),
        "an array": pickle.dumps(np.zeros(3)),
        "objects from bytes, our way": pickle.dumps(
            Call(snapshot.plain_array, "O", (1,), bytes(8), "C", True)
        ),
        "a forged shape": pickle.dumps(
            Call(snapshot.plain_array, "<f8", (10**9,), bytes(8), "C", True)
        ),
        "a function of ours": pickle.dumps(snapshot._reduce_type),
        "no pickle": b"hello",
    }


@pytest.mark.parametrize("name", hostile())
def test_a_checkpoint_made_up_on_purpose_is_refused(name: str) -> None:
    with pytest.raises(ArtifactError):
        read_state(io.BytesIO(hostile()[name]), {})


def test_a_checkpoint_can_not_bring_a_store_of_another_directory() -> None:
    """A run in a directory would have closed that one in the end, over its manifest."""
    forged = pickle.dumps(RunStore(None))
    assert "no state" in str(_refusal(forged, {}))
    assert "store.RunStore, which can't be part" in str(_refusal(forged, {"store": RunStore(None)}))


def _refusal(content: bytes, constants: dict[str, object]) -> ArtifactError:
    with pytest.raises(ArtifactError) as caught:
        read_state(io.BytesIO(content), constants)
    return caught.value


@pytest.mark.parametrize(
    "array",
    [
        np.arange(6).reshape(2, 3),
        np.asfortranarray(np.arange(6.0).reshape(2, 3)),
        np.array(["a", "bc"]),
        np.array(["2026-01-05"], "datetime64[us]"),
        np.zeros((0, 4), np.int8),
        np.array([1, None, "x"], object),
        np.arange(10)[::3],
    ],
)
def test_arrays_come_back(array: Any) -> None:
    buffer = io.BytesIO()
    pickler = pickle.Pickler(buffer, 5)
    pickler.dispatch_table = snapshot.REDUCERS
    pickler.dump([array, array.dtype, array.ravel()[0] if array.size else None])
    back, kind, _ = pickle.loads(buffer.getvalue())
    assert array.tolist() == back.tolist()
    assert (array.dtype, array.shape) == (back.dtype, back.shape) == (kind, back.shape)
    assert array.flags.f_contiguous == back.flags.f_contiguous or array.ndim == 1
