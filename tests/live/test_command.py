"""The command `fleet2d live`: addresses, schema, the stored run."""

import json
import signal
import subprocess
import sys
import time

import pytest
import typer
from tests.live.scenes import LIVE, place
from tests.scenes import fleet2d_process
from typer.testing import CliRunner

import fleet2d
from fleet2d.errors import InputError
from fleet2d.live import Bridge, from_iterator
from fleet2d.live.command import live

APP = typer.Typer()
APP.command()(live)
SCENARIO = "extends: bundled:paper\nsimulation: {duration: 3 s}\nusers: {ana: {type: live}}\n"


def test_a_run_among_datagrams_is_stored_and_reproduced(tmp_path):
    (tmp_path / "lab.yaml").write_text(SCENARIO)
    arguments = [str(tmp_path / "lab.yaml"), "--with", "udp://127.0.0.1:0", "--speed", "0"]

    result = CliRunner().invoke(APP, [*arguments, "--out", str(tmp_path / "run")])

    assert result.exit_code == 0, result.output
    assert "udp://127.0.0.1:0: listens at " in result.output
    digest = fleet2d.open_run(tmp_path / "run").digest
    assert f"complete, digest {str(digest)[:8]}, stored in " in result.output
    assert fleet2d.reproduce(tmp_path / "run").digest == digest


def test_a_run_that_heard_messages_is_reproduced(tmp_path):
    """The note about what had arrived was missing when it was repeated."""
    x, y = place()
    messages = [{"type": "pose", "entity": "ana", "x": x, "y": y}, {"type": "?"}]
    content = LIVE | {"simulation": {"duration": "3 s", "seed": 4}}
    simulation = fleet2d.Simulation(content, out=tmp_path / "run")
    run = Bridge(simulation, [from_iterator(messages)], speed=20).run()

    assert any(note.startswith("live: 2 messages") for note in run.manifest["notes"])
    assert fleet2d.reproduce(tmp_path / "run").same


def test_sources_of_the_scenario_are_opened(tmp_path):
    text = SCENARIO.replace("{type: live}", "{type: live, source: 'udp://127.0.0.1:0'}")
    (tmp_path / "lab.yaml").write_text(text)

    result = CliRunner().invoke(APP, [str(tmp_path / "lab.yaml"), "--speed", "0"])

    assert result.exit_code == 0, result.output
    assert "udp://127.0.0.1:0: listens at " in result.output


def test_the_schema_of_messages_is_printed():
    schema = json.loads(CliRunner().invoke(APP, ["--schema"]).output)

    assert schema["discriminator"]["propertyName"] == "type"
    assert {"PoseMessage", "GoalMessage", "DetectionsMessage", "ReadingMessage"} <= schema[
        "$defs"
    ].keys()


def test_a_program_has_to_be_named():
    with pytest.raises(InputError, match="name at least one other program by --with"):
        CliRunner().invoke(APP, [], catch_exceptions=False)


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT])
def test_a_run_that_was_ended_is_continued_by_resume(tmp_path, number):
    """Nothing said so: the same command only asked for another folder."""
    (tmp_path / "lab.yaml").write_text("extends: bundled:paper\nsimulation: {duration: 2 h}\n")
    arguments = ["live", str(tmp_path / "lab.yaml"), "--with", "udp://127.0.0.1:0"]
    arguments += ["--speed", "60", "--out", str(tmp_path / "run")]
    command = [sys.executable, "-m", "fleet2d.cli", *arguments]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert "listens at" in process.stderr.readline()
    time.sleep(1)
    process.send_signal(number)
    _, errors = process.communicate(timeout=20)
    hint = f"continue it by `fleet2d resume {tmp_path / 'run'}`"
    assert (hint in errors) == (number == signal.SIGINT)

    again = fleet2d_process(*arguments)

    assert 2 == again.returncode
    assert f"{tmp_path / 'run'} exists and has an unfinished run: {hint}, choose" in again.stderr
    assert "complete" == fleet2d.resume(tmp_path / "run").status
