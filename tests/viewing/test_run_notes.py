"""Notes are stored beside a run, and change neither it nor its seal."""

import json
import os
import shutil
from pathlib import Path

import pytest
from starlette.testclient import TestClient

import fleet2d
from fleet2d.artifacts.verification import verify_run
from fleet2d.errors import InputError
from fleet2d.viewing.page_data import PageData
from fleet2d.viewing.page_server import page_app
from fleet2d.viewing.run_notes import checked_notes, read_notes, write_notes
from fleet2d.viewing.served_runs import ServedRuns

OWN = "http://127.0.0.1:8765"
HEADERS = {"Origin": OWN, "Content-Type": "application/json"}


@pytest.fixture
def root(run_dir, tmp_path):
    return Path(shutil.copytree(run_dir, tmp_path / "day"))


@pytest.fixture
def client(root):
    return TestClient(page_app(ServedRuns([root]), "token", 8765), base_url=f"{OWN}/token/")


def test_notes_are_kept_beside_the_run_and_not_in_it(root, client, tmp_path):
    notes = [{"step": 900, "text": "why here? ünïcode <b>"}, {"step": 60, "text": ""}]
    answer = client.post("run/0/notes", content=json.dumps(notes), headers=HEADERS)
    assert [60, 900] == [note["step"] for note in answer.json()]
    assert client.get("run/0/notes.json").json() == answer.json()
    assert (tmp_path / "day.notes.json").is_file()
    seal = verify_run(root)
    assert ({}, []) == (seal.differing, seal.foreign)
    assert client.post("run/0/notes", content="[]", headers={"Origin": OWN}).status_code == 415
    foreign = {**HEADERS, "Origin": "http://evil.example"}
    assert client.post("run/0/notes", content="[]", headers=foreign).status_code == 403
    assert read_notes(fleet2d.open_run(root)) == answer.json()


@pytest.mark.parametrize(
    "body",
    [
        b"",
        b"{}",
        b"[1]",
        b'[{"step": -1, "text": ""}]',
        b'[{"step": 1.5, "text": ""}]',
        b'[{"step": 1, "text": 3}]',
        json.dumps([{"step": 1, "text": "x" * 2001}]).encode(),
        json.dumps([{"step": 1, "text": ""}] * 1001).encode(),
        b"[" * 100_000,
    ],
)
def test_what_are_no_notes_is_refused(body):
    with pytest.raises(InputError, match="notes are"):
        checked_notes(body)


def test_run_in_memory_has_no_notes_and_says_why():
    run = fleet2d.run("bundled:paper", "simulation.duration=10 min", seed=4)
    assert [] == read_notes(PageData(run).run)
    with pytest.raises(InputError, match="in memory"):
        write_notes(run, b"[]")


def test_damaged_file_of_notes_is_named(root, tmp_path):
    (tmp_path / "day.notes.json").write_text("{")
    with pytest.raises(InputError, match=r"day\.notes\.json can't be read"):
        read_notes(fleet2d.open_run(root))


@pytest.mark.parametrize("kind", ["pipe", "link"])
def test_a_pipe_or_a_link_in_place_of_notes_is_refused_by_the_page(client, tmp_path, kind):
    """The request for notes waited for the pipe for ever."""
    (tmp_path / "secret.json").write_text('[{"step": 1, "text": "secret"}]')
    if kind == "pipe":
        os.mkfifo(tmp_path / "day.notes.json")
    else:
        (tmp_path / "day.notes.json").symlink_to("secret.json")

    for answer in (
        client.get("run/0/notes.json"),
        client.post("run/0/notes", content="[]", headers=HEADERS),
    ):
        assert answer.status_code == 422
        message = answer.json()["message"]
        assert f"day.notes.json is {'a link' if kind == 'link' else 'not a file'}" in message
        assert "\n" not in message
    assert "secret" in (tmp_path / "secret.json").read_text()
