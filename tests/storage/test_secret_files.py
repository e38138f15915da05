"""The key by whose signature Fleet2D recognizes its own files: made once, and this user's alone."""

import os
import stat
import sys
from pathlib import Path
from subprocess import PIPE, Popen

import pytest

from fleet2d.storage.secret_files import (
    KEY_NAME,
    UnusableSecretError,
    signature,
    state_folder,
    user_secret,
)


@pytest.fixture
def key(tmp_path, monkeypatch):
    """The path of a key that isn't made yet."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    return state_folder() / KEY_NAME


def test_the_secret_is_made_at_first_use_for_this_user_alone(key):
    secret = user_secret(KEY_NAME)
    assert secret == user_secret(KEY_NAME) == key.read_bytes()
    assert len(set(secret)) > 10
    assert [key] == list(key.parent.iterdir())
    assert (0o600, 0o700) == tuple(stat.S_IMODE(p.stat().st_mode) for p in (key, key.parent))


def test_processes_that_make_it_at_once_end_with_one(key, tmp_path):
    code = (
        "import sys, time; from fleet2d.storage.secret_files import user_secret\n"
        "print('ready', flush=True); sys.stdin.read(1); print(user_secret('signing-key').decode())"
    )
    starts = [
        Popen([sys.executable, "-c", code], stdin=PIPE, stdout=PIPE, text=True) for _ in range(4)
    ]
    for each in starts:
        assert "ready\n" == each.stdout.readline()
    for each in starts:
        each.stdin.write("x")
        each.stdin.flush()
    secrets = {each.communicate()[0].strip() for each in starts}
    assert secrets == {key.read_text()}
    assert [key] == list(key.parent.iterdir())


def test_a_secret_that_another_process_has_just_made_is_taken(key, monkeypatch):
    """Between the look and the making."""
    first = user_secret(KEY_NAME)
    monkeypatch.setattr(os.path, "lexists", lambda _: False)
    assert first == user_secret(KEY_NAME)
    assert [key] == list(key.parent.iterdir())


def as_link(key: Path):
    key.rename(key.with_name("other"))
    key.symlink_to("other")


def as_pipe(key: Path):
    key.unlink()
    os.mkfifo(key, 0o600)


DAMAGES = {
    "is a link": as_link,
    "is not a file": as_pipe,
    "may be read by others (mode 0644)": lambda key: key.chmod(0o644),
    "may be read by others (mode 0620)": lambda key: key.chmod(0o620),
    "has 0 bytes, expected 43": lambda key: key.write_bytes(b""),
    "has 44 bytes, expected 43": lambda key: key.write_bytes(bytes(44)),
}


@pytest.mark.parametrize("fault", DAMAGES)
def test_a_secret_that_others_may_know_is_refused(key, fault):
    user_secret(KEY_NAME)
    DAMAGES[fault](key)
    with pytest.raises(UnusableSecretError) as caught:
        signature("anything")
    assert f"{key} {fault}: delete it, and a new one is made" == str(caught.value)


def test_a_secret_of_another_user_is_refused(key, monkeypatch):
    user_secret(KEY_NAME)
    me = os.geteuid()
    monkeypatch.setattr(os, "geteuid", lambda: me + 1)
    with pytest.raises(UnusableSecretError, match="belongs to another user"):
        user_secret(KEY_NAME)


@pytest.mark.parametrize("obstacle", ["file", "dangling link", "no home"])
def test_where_nothing_can_be_kept_it_says_so(key, monkeypatch, obstacle):
    if obstacle == "file":
        key.parents[1].write_text("")
    elif obstacle == "dangling link":
        key.parents[1].symlink_to("nowhere")
    else:
        monkeypatch.setenv("XDG_STATE_HOME", "not/absolute")
        monkeypatch.delenv("HOME")
        monkeypatch.setattr("pwd.getpwuid", lambda _: (_ for _ in ()).throw(KeyError()))
    with pytest.raises(UnusableSecretError, match="no folder for the secrets of this user"):
        user_secret(KEY_NAME)


@pytest.mark.parametrize(
    ("system", "folder"),
    [
        ("linux", ".local/state"),
        ("darwin", "Library/Application Support"),
        ("win32", "AppData/Local"),
    ],
)
def test_the_folder_is_the_usual_one_of_the_system(tmp_path, monkeypatch, system, folder):
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.delenv("XDG_STATE_HOME")
    monkeypatch.setattr(sys, "platform", system)
    assert tmp_path / folder / "fleet2d" == state_folder()


def test_a_signature_is_for_one_purpose_and_one_content(key):
    one, other = signature("one"), signature("other")
    assert one.hexdigest() != other.hexdigest()
    assert one.hexdigest() == signature("one").hexdigest()
    one.update(b"content")
    assert one.hexdigest() != signature("one").hexdigest()
