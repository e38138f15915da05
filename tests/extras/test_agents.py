"""The examples of learning agents: a minute of training, a table, and bounds that hold."""

import runpy
import sys
from pathlib import Path

import numpy as np
import pytest

from fleet2d.entities.robots.policy import Policy

for name in ("gymnasium", "onnxruntime"):
    pytest.importorskip(name, reason=f"needs {name}")
from fleet2d.learning.gym import RobotEnv, load_task  # noqa: E402

AGENTS = Path(__file__).parents[2] / "examples" / "agents"
SHORT = "simulation.duration=2 d"
HOME = {"values": {"floorplan.seed": 1002, "users.ana.persona": "retired"}, "seed": 7}
TASKS = ("hangout", "find", "patrol", "interact")


@pytest.fixture
def script(monkeypatch):
    """Return the names of a script, which may import those beside it."""
    monkeypatch.syspath_prepend(str(AGENTS))
    return lambda name: runpy.run_path(str(AGENTS / f"{name}.py"), run_name="script")


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_model_of_stable_baselines_becomes_the_policy_of_a_robot(tmp_path, script):
    pytest.importorskip("sb3_contrib", reason="needs sb3-contrib")
    train, path = script("train"), tmp_path / "hangout.onnx"
    for function in ("train", "export"):
        train[function].__globals__["LIVES"] = 1
    model = train["train"]("hangout", 8, n_steps=8, batch_size=8, n_epochs=1, verbose=0)
    train["export"](model, path)
    behavior = Policy(file=path)
    observation = model.observation_space.sample()
    mask = np.ones(17, np.bool_)
    expected, _ = model.predict(observation, deterministic=True)

    assert int(expected) == behavior.act(observation, mask)


@pytest.mark.slow
@pytest.mark.parametrize("task", TASKS)
def test_table_of_a_task_has_everybody_and_no_one_above_the_bound(
    task, tmp_path, script, monkeypatch, capsys
):
    table = script("table")
    content = load_task(task).model_dump(exclude_unset=True)
    content["scenario"]["simulation"]["duration"] = "2 d"
    short = load_task(content)
    # `main` and the bounds load the short task in place of ours.
    monkeypatch.setitem(table["main"].__globals__, "load_task", lambda _: short)
    monkeypatch.setitem(
        table["main"].__globals__, "RobotEnv", lambda _, **settings: RobotEnv(short, **settings)
    )
    argv = ["table.py", f"{task}-v1", "--homes", "1", "--seeds", "0", "--models", str(tmp_path)]
    monkeypatch.setattr(sys, "argv", argv)
    table["main"]()
    lines = [line for line in capsys.readouterr().out.splitlines() if line.startswith("|")][2:]
    rewards = {line.split("|")[1].strip(): float(line.split("|")[2]) for line in lines}

    expected = [*table["BUNDLED"][task], *table["CHOICES"][task]]
    expected += ["knows the life"] if task == "hangout" else []
    assert [*expected, "bound"] == list(rewards)
    # Of asking, the bound is of the mean over how answers are drawn.
    slack = 12 if task == "interact" else 0.06
    assert all(reward <= rewards["bound"] + slack for reward in rewards.values())


def slow_bound(people, stations, weights):
    """Return the bound of hangout second by second, by recursion over what is best next."""
    near = [
        [
            sum(bool(p.has_time[k]) and p.room[k] == room for p in people) / 60
            for k in range(len(people[0].room))
        ]
        for room in stations.room
    ]
    steps, count = len(near[0]), len(stations.room)
    best = [[0.0] * count for _ in range(steps + 1)]
    for k in range(steps - 1, -1, -1):
        for here in range(count):
            stay = best[k + 1][here]
            for to in range(1, count):
                if to == here:
                    continue
                arrives = k + int(stations.least_s[here, to])
                until = arrives + stations.period_s
                gain = sum(near[to][arrives + 60 : until])
                move = gain + best[min(until, steps)][to]
                move += weights["relocations"] * bool(stations.apart[here, to]) * (here != 0)
                # What is gained on the way before it leaves counts where it is, at this step only.
                stay = max(stay, move)
            best[k][here] = near[here][k] + stay
    return best[0][0]


def test_bound_of_waiting_is_that_of_the_slow_recursion(script):
    bounds = script("bounds")
    random = np.random.default_rng(1)
    room = np.repeat(random.integers(-1, 3, 60), 5)
    flags = np.repeat(random.random(100) < 0.8, 3)
    person = bounds["Person"](room, [0], [""], flags, ~flags, flags, room < 0)
    gaps = np.array([[0, 2, 9, 4], [2, 0, 7, 3], [9, 7, 0, 5], [4, 3, 5, 0]])
    apart = gaps > 2
    stations = bounds["Stations"](np.array([0, 0, 1, 2]), gaps, gaps, apart, 80)
    weights = {"near_min": 1.0, "relocations": -0.05}

    assert pytest.approx(slow_bound([person], stations, weights)) == bounds["hangout_bound"](
        [person], stations, weights
    )


def test_who_knows_the_life_comes_near_the_bound_of_waiting(script):
    bounds = script("bounds")
    weights = load_task("hangout").reward
    env = RobotEnv("hangout", SHORT, split="test")
    env.reset(options=HOME)
    stations = bounds["stations_of"](env)
    ana = bounds["person_of"](bounds["rested_life"](env, **HOME), "ana")
    bound = bounds["hangout_bound"]([ana], stations, weights)
    choose = bounds["hangout_plan"]([ana], stations, weights)
    observation, info = env.reset(options=HOME)
    total, is_over = 0.0, False
    while not is_over:
        action = choose(observation, info["action_mask"], env)
        observation, reward, _, is_over, info = env.step(action)
        total += reward

    assert 0.9 * bound < total <= bound


def test_bound_of_a_request_is_that_of_its_best_moment(script):
    """One try: the largest expected value; more tries: at least as much."""
    from fleet2d.interactions.interaction import Interaction

    bounds = script("bounds")
    weights = load_task("interact").reward
    pieces = [
        bounds["Piece"](0, 600, "sleep"),
        bounds["Piece"](600, 1200, "phone_call"),
        bounds["Piece"](1200, 1800, "breakfast"),
    ]

    def worth(tries, pieces=pieces):
        pill = Interaction(do="remind", to="ana", at=["08:00"], worth=5, tries=tries)
        return float(bounds["_worth_of_request"](pieces, 0, pill, 2.0, weights))

    notices = 1 / (1 + np.exp(-3))
    available = 1 / (1 + np.exp(-1.7))
    accepts = 1 / (1 + np.exp(-2))
    expected = notices * (available * accepts * 5 - (1 - available))
    assert pytest.approx(expected) == worth(1)
    assert worth(1) < worth(2) < worth(3) < 5
    assert 0 == worth(3, pieces[:1])  # it wakes nobody for that


def test_bounds_of_searches_and_visits(script):
    bounds = script("bounds")
    may = np.zeros(7200 * 3, np.bool_)
    may[7200 + 599] = may[2 * 7200 + 600] = True
    person = bounds["Person"](may, [0], [""], may, ~may, may, ~may)

    assert 2 == bounds["find_bound"]([person], {"finds": 2.0}, 7200, 600)
    weights = {"unvisited_h": -1.0, "relocations": -0.1}
    rewards = [-0.64 * 24 * 4 / 2 / (m + 2) - 0.1 * m for m in range(100)]
    assert pytest.approx(max(rewards)) == bounds["patrol_bound"](5, 2 * 86400, weights)


def test_written_policy_is_the_behavior_of_a_robot(tmp_path, script, monkeypatch, capsys):
    pytest.importorskip("onnx", reason="needs onnx")
    path = tmp_path / "small.onnx"
    monkeypatch.setattr(sys, "argv", ["last_seen.py", str(path)])
    script("last_seen")["main"]()
    lines = capsys.readouterr().out.splitlines()

    assert ["hangout", "small.onnx"] == [line.split()[0] for line in lines]
    assert int(lines[1].split()[-2]) > 1
