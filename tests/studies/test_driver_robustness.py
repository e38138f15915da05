"""Kills at random moments, and what is left each time ends in the same results."""

import os
import random
import signal
import subprocess
import sys
import time
import traceback
from pathlib import Path

import pytest
import yaml
from tests.studies.scenes import SPEED, base, digests, run, small
from tests.thorough import THOROUGH, some

from fleet2d.studies.directory import StudyDirectory
from fleet2d.studies.driver import Observer
from fleet2d.studies.executors import cores
from fleet2d.studies.reader import open_study
from fleet2d.studies.results import VariantResult

KILLS = int(os.environ.get("FLEET2D_KILLS", "50" if THOROUGH else "8"))
ROOT = Path(__file__).parents[2]
MOST = 3  # variants until a study is killed: something is left for all kills
SEEDS = KILLS * MOST // 4 + 1
LARGE = small(axes={SPEED: [0.3, 0.4, 0.5, 0.6]}, replicates=SEEDS, keep={"tables": ["room_share"]})


class Dies(Observer):
    """Kills its own process after some variants."""

    def __init__(self, variants):
        self.remaining = variants

    def on_result(self, result: VariantResult):
        self.remaining -= 1
        if not self.remaining:
            os.kill(os.getpid(), signal.SIGKILL)


def run_in_a_child_and_kill(folder: Path, after_s, variants):
    """Run a study in a copy of this process, and kill it after a time or some variants."""
    child = os.fork()
    if not child:
        try:
            run(LARGE, folder, observer=Dies(variants))
            os._exit(0)
        except BaseException:  # noqa: BLE001 - the child must not go on as pytest
            traceback.print_exc()
        finally:
            os._exit(1)
    deadline = time.monotonic() + after_s
    while time.monotonic() < deadline:
        ended, status = os.waitpid(child, os.WNOHANG)
        if ended:
            assert os.WTERMSIG(status) == signal.SIGKILL
            return
        time.sleep(0.005)
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork on this system")
@pytest.mark.filterwarnings("ignore:.*fork.*")
def test_a_study_killed_many_times_ends_as_an_undisturbed_one(tmp_path):
    _, undisturbed = run(LARGE, tmp_path / "undisturbed")
    chance = random.Random(16)
    folder, complete_before = tmp_path / "killed", 0
    for _ in range(KILLS):  # while it begins, runs or writes
        run_in_a_child_and_kill(folder, chance.uniform(0.0, 0.12), chance.randint(1, MOST))
        if (folder / "study.json").exists():
            complete = StudyDirectory(folder).counts().complete
            assert complete >= complete_before
            complete_before = complete
    _, study = run(LARGE, folder)
    assert digests(undisturbed) == digests(study)
    tables = [each.arrow("room_share").to_table() for each in (undisturbed, study)]
    assert tables[0].sort_by("variant") == tables[1].sort_by("variant")
    columns = [SPEED, "seed", *undisturbed.metrics]
    assert undisturbed.variants.select(columns).equals(study.variants.select(columns))


def start(folder: Path, *arguments) -> "subprocess.Popen[bytes]":
    """Begin the command in a process group of its own."""
    (folder / "study.yaml").write_text(yaml.safe_dump(small(base=base("1 h"), replicates=40)))
    return subprocess.Popen(
        [sys.executable, "-m", "fleet2d.cli", "study", "run", "study.yaml", *arguments],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
        stderr=subprocess.PIPE,
        start_new_session=True,
    )


def workers_of(process: "subprocess.Popen[bytes]"):
    files = Path(f"/proc/{process.pid}/task").glob("*/children")  # a thread starts each
    pids = [pid for file in files for pid in file.read_text().split()]
    commands = {int(pid): Path(f"/proc/{pid}/cmdline").read_bytes() for pid in pids}
    return [pid for pid, command in commands.items() if b"spawn_main" in command]


def is_running(pid):
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0]
    except OSError:
        return False
    return state != "Z"


def wait_for_results(folder: Path, process: "subprocess.Popen[bytes]"):
    results = folder / "studies/study/results/000001.parquet"
    deadline = time.monotonic() + 120
    while not results.exists():
        assert process.poll() is None
        assert time.monotonic() < deadline
        time.sleep(0.02)


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc").exists(), reason="looks into /proc")
@pytest.mark.parametrize("sign", some([signal.SIGINT, signal.SIGTERM, signal.SIGKILL], 2))
def test_ended_by_a_signal_it_leaves_nothing_running_and_loses_nothing(tmp_path, sign):
    process = start(tmp_path, "--workers", "2")
    wait_for_results(tmp_path, process)
    workers = workers_of(process)
    assert 2 == len(workers)
    start_s = time.monotonic()
    os.kill(process.pid, sign)
    _, err = process.communicate(timeout=30)
    duration_s = time.monotonic() - start_s
    code = -9 if sign == signal.SIGKILL else 130
    patience_s = max(1.0, os.getloadavg()[0] / cores())  # a busy machine takes longer
    assert (code, True) == (process.returncode, duration_s < patience_s)
    deadline = time.monotonic() + patience_s
    while any(map(is_running, workers)) and time.monotonic() < deadline:
        time.sleep(0.01)
    assert not any(map(is_running, workers))
    if sign != signal.SIGKILL:
        assert b"the same command goes on" in err
    study = open_study(tmp_path / "studies/study")
    assert 0 < study.counts.complete < 80


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc").exists(), reason="looks into /proc")
def test_a_worker_that_dies_loses_only_what_it_ran_and_that_is_run_again(tmp_path):
    process = start(tmp_path, "--workers", "2")
    for _ in range(3 if THOROUGH else 1):
        wait_for_results(tmp_path, process)
        os.kill(workers_of(process)[0], signal.SIGKILL)
        time.sleep(0.5)
    process.communicate(timeout=300)
    study = open_study(tmp_path / "studies/study")
    assert (0, 80) == (process.returncode, study.counts.complete)
    assert study.variants["attempts"].max() in (2, 3)
