"""A run that ended early, however it did, is gone on with to the digest of an undisturbed one."""

import json
import multiprocessing
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from functools import cache, partial
from pathlib import Path
from threading import Lock

import pytest
from tests.scenes import cut_off, digests, everything, fleet2d_process, scenario
from tests.thorough import THOROUGH, some

import fleet2d
from fleet2d import Algorithm
from fleet2d.artifacts import arrow
from fleet2d.artifacts.unfinished import CHECKPOINT_NAME, FOLDER, JOURNAL_NAME
from fleet2d.artifacts.verification import verify_run
from fleet2d.engine.repeat import reopen
from fleet2d.entities.plan import data_of
from fleet2d.errors import Fleet2DError, RunDirectoryError
from fleet2d.interventions import Decide, Put, Replan
from fleet2d.storage import files

KILLS = int(os.environ.get("FLEET2D_KILLS", "100" if THOROUGH else "4"))
"""Random moments at which a run is killed, and every other time its resumption; more before a release."""

CHECKPOINTED = {"checkpoint": "10 min"}


def content(duration="1 h", **artifacts):
    found = everything(duration)
    found["artifacts"] = {**found["artifacts"], **CHECKPOINTED, **artifacts}
    return found


@cache
def undisturbed(duration="1 h"):
    return digests(fleet2d.run(everything(duration)))


@pytest.mark.parametrize("minutes", some([0, 1, 9, 10, 11, 37, 59, 60], 3))
def test_a_run_that_was_cut_off_goes_on_from_its_checkpoint(tmp_path, minutes):
    simulation = fleet2d.Simulation(content(), out=tmp_path / "run")
    simulation.run_until(60 * minutes)
    directory = cut_off(simulation)
    done = fleet2d.resume(directory)
    assert undisturbed() == digests(done)
    assert ([600 * (minutes // 10)] if minutes >= 10 else []) == done.manifest["resumed"]
    assert verify_run(directory).same
    assert [] == verify_run(directory).foreign


def test_a_run_may_be_cut_off_many_times(tmp_path):
    simulation = fleet2d.Simulation(content(), out=tmp_path / "run")
    for minute in (12, 25, 31, 44, 58):
        simulation.run_until(60 * minute)
        simulation, remark = reopen(cut_off(simulation))
        assert f"step {600 * (minute // 10)}" in remark
    stored = simulation.run()
    assert undisturbed() == digests(stored)
    assert [600, 1200, 1800, 2400, 3000] == stored.manifest["resumed"]


def test_an_interrupted_run_goes_on_where_it_stopped(tmp_path):
    simulation = fleet2d.Simulation(content(checkpoint="auto"), out=tmp_path / "run")
    simulation.advance(1234)
    assert "interrupted" == simulation.finish().status
    assert verify_run(tmp_path / "run").same
    done = fleet2d.resume(tmp_path / "run")
    assert undisturbed() == digests(done)
    assert [1234] == done.manifest["resumed"]


def replace(old, new):
    """Return what replaces bytes of a checkpoint."""

    def damage(folder):
        path = folder / CHECKPOINT_NAME
        path.write_bytes(path.read_bytes().replace(old, new, 1))

    return damage


@pytest.mark.parametrize(
    ("checkpoint", "damage"),
    [
        ("off", lambda folder: None),
        ("10 min", lambda folder: os.truncate(folder / JOURNAL_NAME, 1000)),
        ("10 min", replace(b"0.1.0", b"0.0.1")),
        ("10 min", replace(b"\0", b"\1")),
    ],
    ids=["none", "journal cut off", "another version", "a bit flipped"],
)
def test_without_a_whole_checkpoint_a_run_begins_anew(tmp_path, checkpoint, damage):
    simulation = fleet2d.Simulation(content(checkpoint=checkpoint), out=tmp_path / "run")
    simulation.run_until(2000)
    damage(cut_off(simulation) / FOLDER)
    done = fleet2d.resume(tmp_path / "run")
    assert [] == done.manifest["resumed"]
    assert undisturbed() == digests(done)


def test_what_was_done_to_a_run_is_done_again(tmp_path):
    def steered(**more):
        simulation = fleet2d.Simulation(content(), **more)
        simulation.run_until(700)
        simulation.do(Put("ana", "kitchen"))
        simulation.run_until(1500)
        simulation.do(Replan("astro"))
        return simulation

    expected = digests(steered().run())
    assert expected != undisturbed()
    simulation = steered(out=tmp_path / "run")
    simulation.run_until(1600)
    assert simulation._keeper is not None
    simulation._keeper.commit(simulation._state)  # the checkpoint is of step 1200
    assert expected == digests(fleet2d.resume(cut_off(simulation)))


def test_what_was_only_scheduled_is_done_after_a_new_beginning(tmp_path):
    """The manifest of an interrupted run had lost what was to be done at its next step."""
    text = "simulation.duration=10 min"
    twin = fleet2d.Simulation(text, seed=4)
    simulation = fleet2d.Simulation(text, seed=4, out=tmp_path / "run")
    for each in (twin, simulation):
        each.advance(60)
        each.do(Put("astro", "kitchen"))
    simulation.finish()
    shutil.rmtree(tmp_path / "run" / FOLDER)
    assert twin.run().digest == fleet2d.resume(tmp_path / "run").digest


def test_what_can_not_be_gone_on_with_says_why(tmp_path):
    fleet2d.run(scenario("1 min"), out=tmp_path / "whole")
    with pytest.raises(RunDirectoryError, match="complete run: there is nothing"):
        fleet2d.resume(tmp_path / "whole")
    with pytest.raises(RunDirectoryError, match=r"no manifest\.json"):
        fleet2d.resume(tmp_path)
    simulation = fleet2d.Simulation(content(), out=tmp_path / "going")
    with pytest.raises(RunDirectoryError, match="is being written by process"):
        fleet2d.resume(tmp_path / "going")
    assert "interrupted" == simulation.finish().status


@pytest.mark.parametrize(
    "name", ["run.lock", "manifest.json.partial", "unfinished", "unfinished/checkpoint.partial"]
)
def test_a_run_with_a_link_in_it_is_not_gone_on_with(tmp_path, name):
    """A run directory from elsewhere led to another file, which the lock or the manifest replaced."""
    simulation = fleet2d.Simulation(scenario("1 min"), out=tmp_path / "run")
    simulation.advance(30)
    simulation.finish()
    precious = tmp_path / "precious"
    precious.mkdir()
    (precious / "journal").write_text("mine")
    link = tmp_path / "run" / name
    if link.is_dir():
        shutil.rmtree(link)
    link.symlink_to(precious if name == FOLDER else precious / "journal")
    with pytest.raises(RunDirectoryError, match=f"{name} is a link"):
        fleet2d.resume(tmp_path / "run")
    assert "mine" == (precious / "journal").read_text()
    link.unlink()
    assert "complete" == fleet2d.resume(tmp_path / "run").status


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        ("rows", [[0, 1, 2, 3]], r"plan: rows\.0"),
        ("rows", [], "can't be followed"),
        ("rows", [[0, -5, 0, 0, 0]], "should be in the home"),
        ("rows", [[0, 12257, 19200, 0, 0]], "should be in the home"),  # above it, but as wide
        ("rows", [[10**9, 12257, 7521, 0, 0]], "the first at 0 us or before"),
        ("rows", [[0, 12257, 7521, 0, 7]], "away must be 0 or 1"),
        ("walk", [1, 2], "plan: walk"),
        ("notes", [[0, "calls"]], r"plan: notes\.0"),
        ("postures", [[0, 99]], "no posture has the number 99"),
        ("interrupts", ["never"], "no event 'never' interrupts"),
        ("asks_us", "soon", "plan: asks_us"),
    ],
)
def test_an_edited_plan_of_a_driven_robot_is_refused(tmp_path, key, value, words):
    """A manifest holds the plans of controllers as numbers; edited ones ended in tracebacks."""
    simulation = fleet2d.Simulation(
        "bundled:paper", "simulation.duration=10 min", seed=4, out=tmp_path / "run"
    )
    simulation.drive("astro")
    simulation.do(Decide("astro", data_of(simulation.plan("astro").go_to("kitchen").stay())))
    simulation.advance(60)
    simulation.finish()
    shutil.rmtree(tmp_path / "run" / FOLDER)
    path = tmp_path / "run" / "manifest.json"
    manifest = json.loads(path.read_text())
    manifest["interventions"][1]["plan"][key] = value
    path.write_text(json.dumps(manifest))
    with pytest.raises(Fleet2DError, match=words):
        fleet2d.resume(tmp_path / "run")


def test_an_input_that_changed_is_not_gone_on_with(tmp_path):
    found = content()
    plan = Path(shutil.copy(found["floorplan"]["path"], tmp_path / "plan.json"))
    found["floorplan"]["path"] = str(plan)
    simulation = fleet2d.Simulation(found, out=tmp_path / "run")
    simulation.run_until(2000)
    directory = cut_off(simulation)
    plan.write_text(plan.read_text() + " ")
    with pytest.raises(RunDirectoryError, match=r"plan\.json has changed since"):
        fleet2d.resume(directory)


class KeepsALock(Algorithm):
    """Keeps what no file can hold."""

    def start(self, home):
        self.lock = Lock()

    def update(self, history, state):
        """Do nothing."""


def test_a_component_that_can_not_be_kept_is_named_and_the_run_begins_anew(tmp_path):
    own = {"algorithms": {"mine": {"type": f"{__name__}:KeepsALock"}}}
    found = scenario("1 h", users={"ana": {"type": "meander"}}, artifacts=CHECKPOINTED, **own)
    simulation = fleet2d.Simulation(found, out=tmp_path / "run")
    simulation.run_until(2000)
    directory = cut_off(simulation)
    done = fleet2d.resume(directory)
    assert fleet2d.run(found).digest == done.digest
    assert any("no checkpoint from step " in note for note in done.notes)


# Kills


@pytest.mark.slow
def test_killed_at_random_moments_and_resumed_it_is_the_same(tmp_path):
    found, rng = content("2 h"), random.Random(14)
    forks = multiprocessing.get_context("forkserver")
    forks.set_forkserver_preload(["fleet2d.engine.simulation", "fleet2d.artifacts.arrow"])

    def begin(function, *arguments, **keywords):
        run = forks.Process(target=function, args=arguments, kwargs=keywords)
        run.start()
        return run

    def kill(run):
        time.sleep(rng.uniform(0, took))
        run.kill()
        run.join()

    began = time.perf_counter()
    begin(fleet2d.run, found, out=tmp_path / "whole").join()
    took = time.perf_counter() - began
    expected = digests(fleet2d.open_run(tmp_path / "whole"))
    resumed = set()
    for number in range(KILLS):
        out = tmp_path / str(number)
        kill(begin(fleet2d.run, found, out=out))
        if not (out / "manifest.json").exists():
            continue  # it had not begun
        if number % 2 and fleet2d.open_run(out).status != "complete":
            kill(begin(fleet2d.resume, out, trust=True))
        if fleet2d.open_run(out).status != "complete":
            fleet2d.resume(out, trust=True)
        stored = fleet2d.open_run(out)
        assert expected == digests(stored), number
        assert verify_run(out).same, number
        if verify_run(out).foreign:  # killed when it was complete, but not yet cleaned up
            with pytest.raises(RunDirectoryError, match="a complete run: there is nothing to res"):
                fleet2d.resume(out, trust=True)
        assert [] == verify_run(out).foreign
        resumed.add(tuple(stored.manifest["resumed"]))
        shutil.rmtree(out)
    assert len(resumed) > 1 or KILLS < 10


@pytest.mark.slow
@pytest.mark.parametrize("number", some([signal.SIGTERM, signal.SIGINT], 2))
def test_a_signal_is_heard_and_the_run_goes_on_later(tmp_path, number):
    command = ["-m", "fleet2d.cli", "run", "simulation.duration=20000 d", "--seed", "4"]
    run = subprocess.Popen(
        [sys.executable, *command, "--out", str(tmp_path / "run")],
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
    )
    journal = tmp_path / "run" / FOLDER / JOURNAL_NAME
    while not journal.exists() or journal.stat().st_size < 1000:  # it has rows of the first steps
        time.sleep(0.05)
        assert run.poll() is None
    run.send_signal(number)
    _, heard = run.communicate(timeout=120)
    assert 130 == run.returncode
    first, last = heard.splitlines()
    assert "storing what was simulated" in first
    assert "interrupted at 2026" in last
    assert "fleet2d resume" in last
    stored = fleet2d.open_run(tmp_path / "run")
    assert "interrupted" == stored.status
    assert [] == stored.verify()


# Faults


class Crash(BaseException):
    """The process is gone: nothing that it would still do is done."""


class Disk:
    """Counts what is done to the disk, fails at one operation, and knows what is on the disk.

    Attributes:
        count: Operations so far.
        fails_at: The first that fails.
        dies: Whether the process ends with it, so that all later ones fail too.
    """

    def __init__(self, patch, fails_at, *, dies):
        self.count, self.fails_at, self.dies = 0, fails_at, dies
        self.synced = {}
        self.written = set()
        self.locks = []
        self.is_dead = False
        write_all, sync, replace = files.write_all, files.sync, files.replace
        parquet, take = arrow.ParquetTable.write, files.FolderLock.__init__

        def counted_write(handle, data):
            self.written.add(self.path(handle))
            if self.operation():
                write_all(handle, data[: len(data) // 2])
                self.fail()
            write_all(handle, data)

        def counted_sync(handle):
            if self.operation():
                self.fail()
            sync(handle)
            self.synced[self.path(handle)] = os.fstat(handle).st_size

        def counted_replace(path, by):
            if self.operation():
                self.fail()
            replace(path, by)
            self.written.add(path)
            self.synced[path] = self.synced.pop(by, 0)

        def counted_parquet(table, *rows):
            if self.operation():
                self.fail()
            parquet(table, *rows)

        def kept_lock(taken, *where):
            take(taken, *where)
            self.locks.append(taken)

        patch.setattr(files, "write_all", counted_write)
        patch.setattr(files, "sync", counted_sync)
        patch.setattr(files, "replace", counted_replace)
        patch.setattr(arrow.ParquetTable, "write", counted_parquet)
        patch.setattr(files.FolderLock, "__init__", kept_lock)

    @staticmethod
    def path(handle):
        return Path(f"/proc/self/fd/{handle}").readlink()

    def operation(self):
        self.count += 1
        return self.is_dead or self.count == self.fails_at

    def fail(self):
        if self.dies:
            self.is_dead = True
            raise Crash
        raise OSError(5, "Input/output error")

    def end(self, *, drop):
        """Let go of the locks as the system does; drop what was never synced."""
        for taken in self.locks:
            if taken._handle >= 0:
                os.close(taken._handle)
                taken._handle = -1
        for path in self.written if drop else ():
            if path.exists():
                os.truncate(path, min(self.synced.get(path, 0), path.stat().st_size))


def short(checkpoint="5 min"):
    """Somebody, a robot and what it learns: few objects to write, as many files as any run."""
    whole = everything("20 min")
    for kind, name in (("users", "ana"), ("robots", "bolt"), ("algorithms", "share")):
        whole[kind] = {name: whole[kind][name]}
    whole["artifacts"] = {**whole["artifacts"], "checkpoint": checkpoint}
    return whole


@cache
def undisturbed_short():
    return digests(fleet2d.run(short("off")))


def with_fault(act, fails_at, *, dies, drop=False):
    """Run, or go on with a run, with a fault; return the number of operations."""
    with pytest.MonkeyPatch.context() as patch:
        disk = Disk(patch, fails_at, dies=dies)
        try:
            act()
        except (Fleet2DError, Crash) as error:
            assert dies or "can't be" in str(error), str(error)
        else:
            assert disk.count < fails_at or not dies
        disk.end(drop=drop)
    return disk.count


@pytest.fixture(scope="module")
def half(tmp_path_factory):
    """A run that was cut off."""
    out = tmp_path_factory.mktemp("half") / "run"
    simulation = fleet2d.Simulation(short(), out=out)
    simulation.run_until(700)
    return cut_off(simulation)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("resumes", "first", "dies", "drop"),
    [
        (False, 1, False, False),
        (False, 3, True, False),
        (False, 5, True, True),
        (True, 1, False, False),
        (True, 4, True, False),
    ],
    ids=["fails", "dies", "drops", "fails while resuming", "dies while resuming"],
)
def test_after_a_fault_at_any_operation_a_run_is_gone_on_with(
    tmp_path, half, resumes, first, dies, drop
):
    expected = undisturbed_short()
    operations, fails_at, resumed, tried = 10**9, first, 0, 0
    while fails_at <= operations:
        out = tmp_path / str(fails_at)
        if resumes:
            shutil.copytree(half, out)
        act = partial(fleet2d.resume, out) if resumes else partial(fleet2d.run, short(), out=out)
        count = with_fault(act, fails_at, dies=dies, drop=drop)
        if count < fails_at:
            operations = count
        tried += 1
        fails_at += 1 if THOROUGH else 6
        if not (out / "manifest.json").exists():
            continue  # before the first step: nothing is lost
        stored = fleet2d.open_run(out)
        assert all(rows.num_rows >= 0 for rows in stored.tables.values()), "all can be read"
        if stored.status != "complete":
            fleet2d.resume(out)
            resumed += 1
        assert expected == digests(fleet2d.open_run(out)), fails_at
        assert verify_run(out).same, fails_at
        shutil.rmtree(out)
    assert operations > 20
    assert resumed > tried // 2


@pytest.mark.slow
def test_resume_on_the_command_line(tmp_path):
    changes = ("simulation.duration=2 d", "artifacts.checkpoint=6 h")
    simulation = fleet2d.Simulation("bundled:paper", *changes, seed=4, out=tmp_path / "run")
    simulation.run_until(100_000)
    cut_off(simulation)
    done = fleet2d_process("resume", "run", cwd=tmp_path)
    assert 0 == done.returncode, done.stderr
    assert "continuing from 2026-01-06 00:00:00, step 86400" in done.stderr
    expected = fleet2d.run("bundled:paper", *changes, seed=4).digest
    assert expected == fleet2d.open_run(tmp_path / "run").digest
    again = fleet2d_process("resume", "run", cwd=tmp_path)
    assert 2 == again.returncode
    assert "complete run" in again.stderr
