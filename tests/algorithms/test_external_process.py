"""Algorithms and behaviors in other processes: same results, checkpoints, and what goes wrong."""

import copy
import json
import pickle
import shutil
import subprocess
import time
from pathlib import Path

import pytest

import fleet2d
from fleet2d import Algorithm, RoomDistribution
from fleet2d.configuration.trust import running_code
from fleet2d.errors import ComponentError, InputError
from fleet2d.runtime.program import ExternalProgram

PROGRAMS = Path(__file__).parents[2] / "examples" / "programs"


class SightingsOfRooms(Algorithm):
    """The same as the program, within Fleet2D."""

    def start(self, home):
        self.counts = [0] * len(home.rooms)

    def update(self, history, state):
        for room in history.observations.room.tolist():
            self.counts[room] += room >= 0
        return RoomDistribution(self.counts)


def scenario(command, **settings):
    return {
        "extends": "bundled:paper",
        "simulation": {"duration": "12 h", "seed": 4},
        "algorithms": {
            "share": {"type": "process", "command": str(command), "period": "1 h"} | settings
        },
    }


@pytest.fixture(scope="module")
def compiled(tmp_path_factory):
    compiler = shutil.which("g++")
    if compiler is None:
        pytest.skip("there is no g++")
    program = tmp_path_factory.mktemp("programs") / "share"
    subprocess.run(
        [compiler, "-std=c++20", "-O1", "-o", program, PROGRAMS / "share.cpp"], check=True
    )
    return program


def expected():
    content = scenario(PROGRAMS)
    content["algorithms"]["share"] = {"type": f"{__file__}:SightingsOfRooms", "period": "1 h"}
    return fleet2d.run(content).tables["share"].to_pylist()


def test_a_python_program_learns_what_an_algorithm_does():
    run = fleet2d.run(scenario(PROGRAMS / "share.py"))

    assert run.tables["share"].to_pylist() == expected()
    assert run.manifest["inputs"][0]["path"].endswith("share.py")


def test_a_program_in_another_language_learns_the_same(compiled):
    run = fleet2d.run(scenario(compiled, tables="json"))
    assert run.tables["share"].to_pylist() == expected()


@pytest.mark.slow
def test_copies_and_checkpoints_continue_from_its_state():
    command = PROGRAMS / "share.py"
    simulation = fleet2d.Simulation(scenario(command))
    simulation.advance(9 * 3600)
    twins = [copy.deepcopy(simulation), pickle.loads(pickle.dumps(simulation))]

    digests = {twin.run().digest for twin in (simulation, *twins)}

    assert digests == {fleet2d.run(scenario(command)).digest}


@pytest.mark.slow
def test_every_span_length_gives_the_same_run():
    content = scenario(PROGRAMS / "share.py", sends=["observations", "evidence", "poses"])
    content["simulation"]["duration"] = "2 h"

    assert len({fleet2d.run(content, max_span=span).digest for span in (600, None)}) == 1


def program(folder, answers):
    """Write a program that answers all but the first message by Python code."""
    path = folder / "alg.py"
    path.write_text(
        "import json, sys, time\n"
        "def say(content): print(json.dumps(content), flush=True)\n"
        "for number, line in enumerate(sys.stdin.buffer):\n"
        "    message = json.loads(line)\n"
        "    [sys.stdin.buffer.read(size) for _, size in message.get('blocks', [])]\n"
        "    if number == 0: say({'type': 'ready'}); continue\n"
        f"    {answers}\n"
    )
    return path


def test_a_program_that_is_not_ready_is_quoted(tmp_path):
    path = tmp_path / "alg.py"
    path.write_text('input()\nprint(\'{"state": "ready"}\', flush=True)\ninput()\n')

    with pytest.raises(ComponentError) as caught:
        fleet2d.run(scenario(path))
    assert "answered {'state': 'ready'} to 'start', not 'ready'" in str(caught.value)


@pytest.mark.parametrize(
    ("answers", "message"),
    [
        (
            "sys.exit('no more memory')",
            "ended with code 1 instead of answering 'update'; on stderr it wrote: no more memory",
        ),
        pytest.param(
            "time.sleep(60)",
            "didn't answer 'update' within 2 s and was ended",
            marks=pytest.mark.slow,
        ),
        ("print('hello', flush=True)", "which is not a line of JSON with a type"),
        ("say({'type': 'error', 'text': 'no rooms'})", "reports: no rooms"),
        ("say({'type': 'output'})", "expected 'share' (one for each room)"),
        ("say({'type': 'output', 'share': ['x']})", "returned invalid values"),
        (
            "say({'type': 'output', 'share': [1, 2]})",
            "returned 2 shares, but the home has 14 rooms",
        ),
        ("say({'type': 'output', 'blocks': [['x', 10**12]]})", "a block is too large"),
        ("say({'type': 'output', 'blocks': [['x', -1]]})", "a block is too large"),
        (  # A block may be empty: what is wrong comes after it.
            "say({'type': 'output', 'share': [1, 2], 'blocks': [['x', 0]]})",
            "returned 2 shares, but the home has 14 rooms",
        ),
        (
            # Both lines at once: the second may come too late to be noticed before the next question.
            "print('{\"type\": \"none\"}\\n' * 2, end='', flush=True)",
            """wrote b'{"type": "none"}\\n' without being asked""",
        ),
    ],
)
def test_a_program_that_fails_is_blamed(tmp_path, answers, message):
    # On a busy machine it takes a program a second to begin; all but the sleeper answer at once.
    timeout = "2 s" if "sleep" in answers else "20 s"
    content = scenario(program(tmp_path, answers), timeout=timeout)

    with pytest.raises(ComponentError) as caught:
        fleet2d.run(content)

    assert "algorithms.share" in str(caught.value)
    assert message in str(caught.value)


def test_what_comes_between_two_answers_is_not_taken_for_the_next_one(tmp_path):
    """A line that came late, of a thread's own, was the answer to the next question."""
    late = "say({'type': 'none'}); time.sleep(0.05); say({'type': 'none'})"
    asked = ExternalProgram(program(tmp_path, late), [], 5.0, {})
    asked.ask({"type": "update"})
    time.sleep(0.5)
    with pytest.raises(ComponentError, match="without being asked"):
        asked.ask({"type": "update"})


@pytest.mark.slow
def test_a_program_that_stops_reading_is_blamed(tmp_path):
    """More than a pipe holds was written to it without a limit of time."""
    path = tmp_path / "alg.py"
    path.write_text('import time\nprint(\'{"type": "ready"}\', flush=True)\ntime.sleep(60)\n')
    content = scenario(path, timeout="2 s", period="6 h", sends=["poses"])

    with pytest.raises(ComponentError, match="didn't answer 'update' within"):
        fleet2d.run(content)


def test_a_program_that_answers_while_it_is_told_is_heard(tmp_path):
    """Both sides write more than a pipe holds, before either reads."""
    path = tmp_path / "alg.py"
    path.write_text(
        "import json, sys\n"
        "for line in sys.stdin.buffer:\n"
        "    message = json.loads(line)\n"
        "    answer = {'type': 'ready'}\n"
        "    if message['type'] == 'update':\n"
        "        answer = {'type': 'none', 'remark': 'x' * 300_000}\n"
        "    print(json.dumps(answer), flush=True)\n"
        "    [sys.stdin.buffer.read(size) for _, size in message.get('blocks', [])]\n"
    )

    run = fleet2d.run(scenario(path, period="6 h", sends=["poses"]))

    assert run.status == "complete"


def test_a_program_runs_in_its_own_folder(tmp_path):
    (tmp_path / "answer.json").write_text('{"type": "none"}')
    run = fleet2d.run(scenario(program(tmp_path, "print(open('answer.json').read(), flush=True)")))

    assert run.status == "complete"


def test_a_program_that_cannot_be_started_is_blamed(tmp_path):
    path = tmp_path / "alg"
    path.write_text("not a program")

    with pytest.raises(ComponentError, match="alg can't be started: Permission denied"):
        fleet2d.run(scenario(path))


def test_a_program_ends_with_its_simulation(tmp_path):
    simulation = fleet2d.Simulation(scenario(PROGRAMS / "share.py"))
    simulation.advance(2 * 3600)
    process = simulation.algorithms["share"].program._process
    assert process.poll() is None

    simulation._state.learners.all.clear()
    del simulation

    assert process.wait(5) == 0


def test_a_program_that_is_not_trusted_does_not_run():
    for content in (scenario(PROGRAMS / "share.py"), robots(PROGRAMS / "rounds.py")):
        with (
            running_code(allowed=False),
            pytest.raises(
                InputError, match=r"would run .*(share|rounds)\.py, which is not trusted"
            ),
        ):
            fleet2d.Simulation(content)


# Behaviors


def robots(command):
    return {
        "extends": "bundled:paper",
        "simulation": {"duration": "2 h", "seed": 4},
        "robots": {"astro": {"behaviors": [{"type": "process", "command": str(command)}]}},
    }


def test_a_program_decides_where_the_robot_goes():
    run = fleet2d.run(robots(PROGRAMS / "rounds.py"))

    path = run.path("astro")
    rooms = [run.plan.rooms[r].name for r in dict.fromkeys(path.room.tolist()) if r >= 0]
    assert len(rooms) > 4


ERRANDS = """
import json, sys

errands = iter({errands!r})
for line in sys.stdin:
    message = json.loads(line)
    answer = {{"type": "ready"}}
    if message["type"] == "decide":
        with open({heard!r}, "a") as file:
            file.write(json.dumps(message["goal"]) + "\\n")
        answer = {{"type": "plan", "plan": [{{"go_to": next(errands, "kitchen_1")}}, {{"stay_s": 60}}]}}
    print(json.dumps(answer), flush=True)
"""


def errands(folder, places):
    """A program that sends the robot to places, and the file with the goals it is told of."""
    heard = folder / "heard.jsonl"
    program = folder / "errands.py"
    program.write_text(ERRANDS.format(errands=places, heard=str(heard)))
    return program, heard


def behind_a_door(command):
    door = {"type": "door", "doorway": "office_1", "open": False}
    return robots(command) | {"objects": {"office_door": door}}


def test_a_program_is_told_what_became_of_its_goals(tmp_path):
    program, heard = errands(tmp_path, ["kitchen_1", "office_1", "hallway_1"])

    fleet2d.run(behind_a_door(program))

    goals = [json.loads(line) for line in heard.read_text().splitlines()]
    assert goals[0] is None
    assert {"go_to": "kitchen_1", "state": "reached", "detail": ""} == goals[1]
    assert ("office_1", "impossible") == (goals[2]["go_to"], goals[2]["state"])
    assert "'office_1' can't be reached" in goals[2]["detail"]
    assert ("hallway_1", "reached") == (goals[3]["go_to"], goals[3]["state"])


@pytest.mark.slow
@pytest.mark.parametrize("name", ["rounds.mjs", "rounds.rs"])
def test_programs_for_node_and_in_rust_do_the_same(name, tmp_path):
    command = PROGRAMS / name
    tool = {".mjs": "node", ".rs": "rustc"}[command.suffix]
    if shutil.which(tool) is None:
        pytest.skip(f"there is no {tool}")
    if tool == "rustc":
        command = tmp_path / "rounds"
        subprocess.run([tool, "-o", command, PROGRAMS / name], check=True, capture_output=True)

    run = fleet2d.run(robots(command))

    assert run.digest == fleet2d.run(robots(PROGRAMS / "rounds.py")).digest


def test_a_program_whose_interpreter_is_missing_is_told(tmp_path, monkeypatch):
    (tmp_path / "rounds.mjs").write_text("")
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(ComponentError, match="can't be started by node: No such file"):
        fleet2d.run(robots(tmp_path / "rounds.mjs"))


def test_a_copied_program_decides_as_the_first_one_would():
    simulation = fleet2d.Simulation(robots(PROGRAMS / "rounds.py"))
    simulation.advance(3600)

    assert copy.deepcopy(simulation).run().digest == simulation.run().digest


@pytest.mark.parametrize(
    ("answers", "message"),
    [
        ("say({'type': 'plan', 'plan': []})", "expected 'plan', a list of 1 to 1000 items"),
        ("say({'type': 'plan', 'plan': [{'fly_to': 'moon'}]})", "there is no 'fly_to'"),
        ("say({'type': 'plan', 'plan': [{'go_to': 'moon'}]})", "moon"),
        ("say({'type': 'plan', 'plan': [{'stay_s': 'x'}]})", "answered the item {'stay_s': 'x'}"),
    ],
)
def test_a_wrong_plan_is_blamed(tmp_path, answers, message):
    with pytest.raises((ComponentError, InputError)) as caught:
        fleet2d.run(robots(program(tmp_path, answers)))

    assert message in str(caught.value)
