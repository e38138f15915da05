"""Folders from somebody else: what a command opens there is inside, and nothing else is touched.

Every kind of folder has links, pipes and folders in place of each of its files, and names that lead
elsewhere. A command may refuse such a folder by an error of Fleet2D, in one line; it may not wait,
nor read, change or remove anything outside.
"""

import hashlib
import json
import os
import shutil
import threading
from contextlib import contextmanager, suppress
from datetime import timedelta
from functools import cache

import pytest
from tests.engine.test_repeat_resume import cut_off
from tests.scenes import everything
from tests.thorough import some

import fleet2d
from fleet2d.artifacts.verification import verify_run
from fleet2d.engine.repeat import reproduce, resume
from fleet2d.errors import Fleet2DError, RunDirectoryError
from fleet2d.live.exporters import Selection, exporter
from fleet2d.runs.run import open_run
from fleet2d.viewing.page_data import export_html

SECRET = "precious, and nobody's business"


def read_all(run):
    opened = open_run(run)
    _ = opened.plan, opened.metrics, repr(opened), opened.notes
    for name in opened.tables:
        opened.arrow(name)
    if opened.status == "complete":
        opened.verify()


def rebuild(run):
    open_run(run).path("ana", timedelta(minutes=5))


def to_page(run):
    export_html(open_run(run), run.parent / "page.html")


def to_sensors(run):
    opened = open_run(run)
    exporter("casas")(opened, run.parent / "sensors.txt", Selection.of(opened))


def to_film(run):
    from fleet2d.viewing.film import write_film

    write_film(open_run(run), run / "film.gif", 0, 60, height=120)


def to_picture(run):
    from fleet2d.viewing.pictures.run import draw_run

    draw_run(open_run(run), run / "picture.png")


READERS = {
    "open": read_all,
    "verify": verify_run,
    "path": rebuild,
    "export page": to_page,
    "export": to_sensors,
    "resume": resume,
    "reproduce": reproduce,
}
# They make figures, which takes longer.
PAINTERS = {
    "show": to_picture,
    "film": to_film,
}
FILES = (
    "manifest.json", "manifest.json.partial", "floorplan.json", "floorplan.json.partial",
    "key_frames.parquet", "key_frames.parquet.partial", "sensors.parquet", "learned",
    "learned/share.npz", "run.lock", "unfinished", "unfinished/journal", "unfinished/checkpoint",
    "unfinished/checkpoint.partial", "picture.png", "picture.png.partial", "film.gif", "film.gif.partial", ".film.gif.unfinished.gif",
)  # fmt: skip


def link_to_file(path, elsewhere):
    path.symlink_to(elsewhere / "secret.txt")


def link_to_like(path, elsewhere):
    """Link to a file or folder that the command would understand."""
    path.symlink_to(elsewhere / "run" / path.name)


def link_to_folder(path, elsewhere):
    path.symlink_to(elsewhere)


def link_to_nowhere(path, elsewhere):
    path.symlink_to(elsewhere / "new")


def pipe(path, _):
    os.mkfifo(path)


def folder(path, _):
    path.mkdir()
    (path / "journal").write_text("?")


TRICKS = (link_to_file, link_to_like, link_to_folder, link_to_nowhere, pipe, folder)
ATTACKS = [(name, trick) for name in FILES for trick in TRICKS]


@cache
def complete(root):
    fleet2d.run(everything("10 min"), out=root / "complete")
    return root / "complete"


@cache
def unfinished(root):
    content = everything("10 min")
    content["artifacts"] = {**content["artifacts"], "checkpoint": "1 min"}
    simulation = fleet2d.Simulation(content, out=root / "unfinished")
    simulation.run_until(300)
    return cut_off(simulation)


@pytest.fixture(scope="module")
def root(tmp_path_factory):
    return tmp_path_factory.mktemp("folders")


@pytest.fixture
def elsewhere(tmp_path, root):
    """A folder of the user, with things that a hostile folder leads to."""
    folder = tmp_path / "elsewhere"
    shutil.copytree(unfinished(root), folder / "run")
    (folder / "run" / "learned").mkdir()
    (folder / "run" / "run.lock").write_text("mine")
    (folder / "secret.txt").write_text(SECRET)
    return folder


def state_of(folder):
    """All names below a folder, with a digest of each file's content."""
    return {
        path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        if path.is_file()
        else ""
        for path in sorted(folder.rglob("*"))
    }


@contextmanager
def no_waiting(run):
    """Fail if a pipe in a folder is waited for; whoever does is freed."""
    is_over = threading.Event()
    waited_for = []

    def watch():
        while not is_over.wait(0.2):
            for path in run.rglob("*"):
                with suppress(OSError):  # nobody reads it
                    if path.is_fifo():
                        os.close(os.open(path, os.O_WRONLY | os.O_NONBLOCK))
                        waited_for.append(path)

    thread = threading.Thread(target=watch)
    thread.start()
    try:
        yield
    finally:
        is_over.set()
        thread.join()
    assert [] == waited_for


def attack(run, elsewhere, use):
    """Use a folder; return the message that refuses it, or nothing."""
    before, message = state_of(elsewhere), ""
    with no_waiting(run):
        try:
            use(run)
        except Fleet2DError as error:
            message = str(error)
            assert SECRET not in message
            assert "\n" not in message
            assert len(message) < 1500
    assert before == state_of(elsewhere)
    written = run.parent / "page.html"
    if written.is_file() and not written.is_symlink():
        assert SECRET not in written.read_text()
    return message


@pytest.mark.parametrize("make", [complete, unfinished])
@pytest.mark.parametrize("command", READERS)
def test_a_run_that_leads_elsewhere_harms_nothing(
    tmp_path, root, elsewhere, record_property, command, make
):
    source, use = make(root), READERS[command]
    attacks = some(ATTACKS, 58 if command in ("reproduce", "resume") else 27)
    for name, trick in attacks:
        run = shutil.copytree(source, tmp_path / "run")
        target = run / name
        if not target.parent.exists():
            target.parent.mkdir()
        if target.is_dir():
            shutil.rmtree(target)
        target.unlink(missing_ok=True)
        trick(target, elsewhere)
        attack(run, elsewhere, use)
        shutil.rmtree(run)
    record_property("tried", len(attacks))


@pytest.mark.slow
@pytest.mark.parametrize("command", PAINTERS)
def test_a_figure_of_a_run_that_leads_elsewhere_harms_nothing(
    tmp_path, root, elsewhere, record_property, command
):
    pytest.importorskip("matplotlib")
    names = ("key_frames.parquet", "floorplan.json", *FILES[FILES.index("picture.png") :])
    attacks = some([(name, trick) for name in names for trick in TRICKS], 47)
    for name, trick in attacks:
        run = shutil.copytree(complete(root), tmp_path / "run")
        (run / name).unlink(missing_ok=True)
        trick(run / name, elsewhere)
        attack(run, elsewhere, PAINTERS[command])
        shutil.rmtree(run)
    record_property("tried", len(attacks))


@pytest.mark.parametrize("trick", [link_to_file, link_to_like, link_to_nowhere, pipe])
@pytest.mark.parametrize("name", ["manifest.json", "floorplan.json", "key_frames.parquet"])
def test_a_reader_says_what_is_in_place_of_a_file(tmp_path, root, elsewhere, name, trick):
    """A pipe as a table was waited for; links were followed."""
    run = shutil.copytree(complete(root), tmp_path / "run")
    (run / name).unlink()
    trick(run / name, elsewhere)
    message = attack(run, elsewhere, read_all)
    words = "is not a file, but a device or a pipe" if trick is pipe else "is a link"
    assert message.startswith(f"{run / name} {words}")


def test_a_link_to_a_run_is_a_run(tmp_path, root):
    (tmp_path / "latest").symlink_to(complete(root))
    read_all(tmp_path / "latest")
    assert verify_run(tmp_path / "latest").same


@pytest.mark.parametrize("name", ["../../x", "/tmp/x", "..", "a/b", "x\n", "\x1b[2J", "a\\b", ""])
@pytest.mark.parametrize("key", some(["tables", "files", "algorithms", "users"], 2))
def test_names_in_a_manifest_lead_nowhere(tmp_path, root, elsewhere, key, name):
    run = shutil.copytree(complete(root), tmp_path / "run")
    path = run / "manifest.json"
    content = json.loads(path.read_text())
    named = {
        "tables": content["tables"],
        "files": content["seal"]["files"],
        "algorithms": content["scenario"]["algorithms"],
        "users": content["scenario"]["users"],
    }[key]
    named[name] = named.pop(sorted(named)[0])
    path.write_text(json.dumps(content))
    names = set(state_of(tmp_path))
    for use in (read_all, verify_run, reproduce):
        message = attack(run, elsewhere, use)
        assert message.isprintable()
    assert names == set(state_of(tmp_path))


def test_leftovers_of_another_run_are_not_removed_through_a_link(tmp_path, root, elsewhere):
    """`resume` of a complete run removes its `unfinished`: a link there led to another run's."""
    run = shutil.copytree(complete(root), tmp_path / "run")
    (run / "unfinished").symlink_to(elsewhere / "run" / "unfinished")
    with pytest.raises(RunDirectoryError, match="is a link"):
        resume(run)
    assert (elsewhere / "run" / "unfinished" / "journal").exists()
