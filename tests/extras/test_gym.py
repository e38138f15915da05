"""Environments: the checkers of three libraries, the odd cases, many lives, branches, pickles."""

import copy
import pickle
from collections.abc import Iterator
from typing import Any, get_args

import numpy as np
import pytest

gymnasium = pytest.importorskip("gymnasium", reason="needs the extra gym")
pytest.importorskip("pettingzoo", reason="needs the extra gym")

from tests.entities.robots.robots import OUT, home_with  # noqa: E402

import fleet2d  # noqa: E402
from fleet2d.errors import InputError  # noqa: E402
from fleet2d.learning.gym import DiscountByTime, RobotEnv, RobotsEnv, VectorRobotEnv, load_task  # noqa: E402
from fleet2d.learning.gym.task import Split  # noqa: E402

SHORT = "simulation.duration=1 d"
TASKS = ["hangout", "find", "patrol", "interact"]
SHAPES = {"interact": (8, 33)}


def policy(task="hangout", **fields):
    return {"type": "policy", "task": task, "period": "10 min", **fields}


def flat(task="hangout", duration="4 h", **sections):
    return home_with([policy(task, rooms=7, every="1 h")], duration, **sections)


def short(task):
    """A task of ours whose lives last a day."""
    content = load_task(task).model_dump(exclude_unset=True)
    content["scenario"]["simulation"]["duration"] = "1 d"
    return content


def play(env, seed: int | None = None, steps=10**6) -> Iterator[tuple[Any, ...]]:
    """Let a policy that is drawn at random act; yield what `step` returns."""
    observation, info = env.reset(seed=seed)
    random = np.random.default_rng(0)
    for _ in range(steps):
        action = random.choice(np.flatnonzero(info["action_mask"]))
        observation, reward, terminated, truncated, info = env.step(action)
        yield observation, reward, terminated, truncated, info
        if terminated or truncated:
            return


@pytest.mark.parametrize("task", TASKS)
def test_gymnasium_has_no_complaint(task):
    from gymnasium.utils.env_checker import check_env

    env = gymnasium.make(f"fleet2d/{task.title()}-v1", task=short(task))

    check_env(env, skip_render_check=True)


@pytest.mark.parametrize("task", TASKS)
def test_actions_are_sampled_by_the_mask(task):
    env = RobotEnv(short(task), masked="error")
    _, info = env.reset(seed=1)

    assert np.int8 == info["action_mask"].dtype
    for _ in range(20):
        _, _, _, is_over, info = env.step(env.action_space.sample(info["action_mask"]))
        if is_over:
            break


@pytest.mark.filterwarnings("ignore:Your observation")  # a table, for which it has no network
def test_stable_baselines_has_no_complaint():
    checker = pytest.importorskip("stable_baselines3.common.env_checker", reason="not installed")

    checker.check_env(RobotEnv("hangout", SHORT), skip_render_check=True)


def two_robots():
    robots = {
        name: {"start": [1.0 + n, 3.0], "behaviors": [policy(rooms=7)]}
        for n, name in enumerate(("astro", "rosie"))
    }
    return {**flat(), "robots": robots}


def test_pettingzoo_has_no_complaint():
    from pettingzoo.test import parallel_api_test, parallel_seed_test

    parallel_api_test(RobotsEnv({"scenario": two_robots()}), num_cycles=60)
    parallel_seed_test(lambda: RobotsEnv({"scenario": two_robots()}), num_cycles=20)


def test_robots_sample_their_actions_by_their_masks():
    env = RobotsEnv({"scenario": two_robots()}, masked="error")
    _, infos = env.reset(seed=1)
    for _ in range(10):
        masks = {robot: infos[robot]["action_mask"] for robot in env.agents}
        actions = {robot: env.action_space(robot).sample(mask) for robot, mask in masks.items()}
        *_, infos = env.step(actions)

    assert {np.dtype(np.int8)} == {info["action_mask"].dtype for info in infos.values()}


@pytest.mark.parametrize("task", TASKS)
def test_environments_are_made_by_name(task):
    env = gymnasium.make(f"fleet2d/{task.title()}-v1")

    many = gymnasium.make_vec(
        f"fleet2d/{task.title()}-v1", 3, vectorization_mode="vector_entry_point"
    )

    rows, columns = SHAPES.get(task, (16, 40))

    assert (rows, columns) == env.observation_space.shape
    assert rows + 1 == env.action_space.n
    assert (3, rows, columns) == many.observation_space.shape


def test_environment_of_a_scenario_file(tmp_path):
    import yaml

    path = tmp_path / "home.yaml"
    path.write_text(yaml.safe_dump(flat()))
    env = RobotEnv(path, robot="astro", reward={"relocations": -1.0})

    assert {0.0, -1.0} == {reward for _, reward, *_ in play(env)}


def test_life_is_truncated_at_its_end_and_intervals_add_up():
    steps = list(play(RobotEnv(flat()), seed=1))

    assert [False] * len(steps) == [terminated for _, _, terminated, *_ in steps]
    assert [False] * (len(steps) - 1) + [True] == [truncated for *_, truncated, _ in steps]
    assert 4 * 3600 == sum(info["elapsed_s"] for *_, info in steps)


def test_rewards_add_up_to_the_terms_of_the_whole_run():
    weights = {"near_min": 1.0, "disturbing_min": -1.0, "relocations": -0.5}
    env = RobotEnv({"scenario": flat(), "reward": weights})
    total = sum(reward for _, reward, *_ in play(env, seed=1))
    terms = env.run().metrics["household"]["astro"]

    assert pytest.approx(sum(weight * terms[name] for name, weight in weights.items())) == total
    assert terms["relocations"] > 0


def test_reward_may_be_a_function():
    env = RobotEnv(flat(), reward=lambda env: env.present.simulation.step)

    assert all(reward == info["elapsed_s"] for _, reward, *_, info in play(env, 1, steps=1))


@pytest.mark.parametrize(
    ("vary", "message"),
    [
        ({"floorplan.seed": {"train": {"range": [0, 1.5]}}}, "whole numbers, first < end"),
        ({"floorplan.seed": {"train": {"range": [0, 10**12]}}}, "more than 1,000,000 values"),
        ({"floorplan.seed": {"train": {"range": [0, 10**8]}}}, "FLEET2D_MAX_VARIANTS"),
        ({"floorplan.seed": {"train": {"range": 5}}}, "expected a list of values, or {range"),
        ({"floorplan.seed": {"train": {"range": [5, 5]}}}, "whole numbers, first < end"),
        ({"floorplan.seed": {"train": []}}, "vary.floorplan.seed.train: expected a list of length"),
        ({"floorplan.sed": {"train": [1]}}, "unknown key 'sed': did you mean 'seed'"),
    ],
)
def test_wrong_values_of_what_varies_are_an_error_that_says_which(vary, message):
    with pytest.raises(InputError, match=message):
        RobotEnv({"scenario": load_task("hangout").scenario, "vary": vary})


def test_values_may_be_whole_sections_of_the_scenario():
    users = [{"ana": {"type": "routine", "persona": name}} for name in ("student", "retired")]
    env = RobotEnv({"scenario": flat(), "vary": {"users": {"train": users}}})

    env.reset(seed=1)

    assert set(env.present.simulation.scenario.users) == {"ana"}


def test_unknown_option_of_a_reset_is_an_error_and_keeps_the_life():
    env = RobotEnv(flat())
    env.reset(seed=1)
    life = env.life

    with pytest.raises(InputError, match="no option 'value': did you mean 'values'"):
        env.reset(options={"value": {"floorplan.seed": 3}})

    assert env.life is life


@pytest.mark.parametrize("action", ["a", 1.5, float("nan"), np.array([0])])
def test_action_that_is_no_whole_number_is_an_error(action):
    env = RobotEnv(flat())
    env.reset(seed=1)

    with pytest.raises(InputError, match="an action is a whole number"):
        env.step(action)


@pytest.mark.parametrize("action", [4, 6, 8, -1])
def test_impossible_action_is_an_error_and_changes_nothing(action):
    env = RobotEnv(flat(), masked="error")
    _, info = env.reset(seed=1)
    storage = env.present.simulation.home.plan.room("storage_1").index
    action = storage if action == 4 else action
    with pytest.raises(InputError, match="the policy chose"):
        env.step(action)

    assert info["action_mask"].tolist() == env.action_masks().tolist()
    assert env.step(7)[4]["elapsed_s"] == 600


def test_masked_action_means_to_rest():
    env = RobotEnv(flat())
    env.reset(seed=1)
    storage = env.present.simulation.home.plan.room("storage_1").index

    assert 600 == env.step(storage)[4]["elapsed_s"]


def test_step_without_a_life_and_after_its_end_is_an_error():
    env = RobotEnv(flat(duration="30 min"))
    with pytest.raises(InputError, match="call reset"):
        env.step(0)
    list(play(env))
    with pytest.raises(InputError, match="call reset"):
        env.step(7)


def test_empty_battery_terminates_the_life():
    battery = {"driving": "10 min", "standing": "1 h", "charging": "30 min", "charger": "kitchen"}
    *_, (_, _, terminated, truncated, info) = play(RobotEnv(flat(astro={"battery": battery})), 1)

    assert (terminated, truncated) == (True, False)
    assert info["elapsed_s"] > 0


def test_nobody_at_home_is_never_found():
    env = RobotEnv(
        {"scenario": flat("find", ana=OUT), "reward": {"finds": 1.0, "searching_min": -1.0}}
    )

    steps = [reward for _, reward, *_ in play(env)]

    assert 0 == env.present.terms("astro")["finds"]
    assert sum(steps) == pytest.approx(-env.present.terms("astro")["searching_min"]) != 0


def test_truth_is_told_only_if_asked_for():
    assert "truth" not in RobotEnv(flat()).reset()[1]
    assert {"ana", "astro"} == set(RobotEnv(flat(), truth=True).reset()[1]["truth"])


def test_same_seed_is_the_same_episode_in_any_number_of_environments():
    settings = {"task": load_task("hangout")}
    few, many = VectorRobotEnv(2, SHORT, **settings), VectorRobotEnv(3, SHORT, **settings)
    first, second = few.reset(seed=5)[0], many.reset(seed=5)[0]
    for step in range(60):
        assert np.array_equal(first, second[:2])
        actions = np.array([step % 7, step % 5, step % 3])
        first, *rewards = few.step(actions[:2])
        second, *other = many.step(actions)
        assert np.array_equal(rewards[0], other[0][:2])


def test_lives_are_those_of_single_environments():
    lives, env = VectorRobotEnv(2, task=flat()), RobotEnv(flat())
    observations, info = lives.reset(seed=3)
    single, own = env.reset(seed=4)

    for _ in range(30):
        assert np.array_equal(observations[1], single)
        assert np.array_equal(info["action_mask"][1], own["action_mask"])
        observations, rewards, terminated, truncated, info = lives.step(np.array([0, 1]))
        if truncated[1]:
            break
        single, reward, _, _, own = env.step(1)
        assert reward == rewards[1]
    observations, rewards, terminated, truncated, info = lives.step(np.array([0, 1]))
    assert [0, 0] == info["elapsed_s"].tolist() == rewards.tolist()  # new lives
    assert not (terminated | truncated).any()


def test_pickled_environment_goes_on_as_the_original():
    env = RobotEnv(flat())
    list(play(env, seed=1, steps=5))
    twin = pickle.loads(pickle.dumps(env))
    one, other = env.step(1), twin.step(1)

    assert np.array_equal(one[0], other[0])
    assert one[1:4] == other[1:4]
    assert np.array_equal(env.reset()[0], twin.reset()[0])


def test_pickled_environments_go_on_as_the_originals():
    lives = VectorRobotEnv(2, task=flat())
    lives.reset(seed=1)
    twins = pickle.loads(pickle.dumps(lives))
    for _ in range(5):
        one, other = lives.step([1, 2]), twins.step([1, 2])
        assert np.array_equal(one[0], other[0])
        assert np.array_equal(one[1], other[1])


def test_branch_goes_its_own_way_and_leaves_the_original_as_it_was():
    env = RobotEnv(flat())
    list(play(env, seed=1, steps=5))
    twin, other = env.branch(), env.branch()
    for _ in range(5):
        twin.step(2)
    before = [env.step(1) for _ in range(3)]
    after = [other.step(1) for _ in range(3)]

    assert twin.present.simulation.step > env.present.simulation.step
    assert all(
        np.array_equal(a[0], b[0]) and a[1] == b[1] for a, b in zip(before, after, strict=True)
    )


def test_reset_in_the_middle_begins_anew_and_nothing_grows():
    import gc

    env = RobotEnv(flat(duration="30 min"))
    first = env.reset(seed=7)[0]
    counts = []
    for _ in range(3):
        for _ in range(40):
            env.reset()
            env.step(7)
        gc.collect()
        counts.append(len(gc.get_objects()))

    assert np.array_equal(first, env.reset(seed=7)[0])
    assert counts[2] - counts[1] < 200


def test_policies_from_files_repeat_the_episode(tmp_path):
    path = tmp_path / "policy.onnx"
    path.write_bytes(scores_of_rooms("visited_20min", "visited_6h"))
    content = flat(duration="8 h")
    content["robots"]["astro"]["behaviors"] = [policy(rooms=7, file=str(path))]
    stored = fleet2d.run(content)
    env = RobotEnv(flat(duration="8 h"))
    observation, info = env.reset(seed=1, options={"seed": 4})
    model = copy.copy(env.present.policy("astro"))
    object.__setattr__(model, "file", path)
    truncated = False
    while not truncated:
        observation, _, _, truncated, info = env.step(model.act(observation, info["action_mask"]))

    assert stored.digest == env.run().digest
    assert stored.tables["events"].num_rows > 5


def scores_of_rooms(*names):
    """An ONNX file that prefers rooms where some columns are low, and to rest least."""
    pytest.importorskip("onnx", reason="needs onnx")
    pytest.importorskip("onnxruntime", reason="needs the extra onnx")
    from onnx import TensorProto, helper, numpy_helper

    from fleet2d.entities.robots.policy import COLUMNS

    weights = -np.isin(COLUMNS, names).astype(np.float32)[:, None]
    rest = np.full((1, 1), -9, np.float32)
    graph = helper.make_graph(
        [
            helper.make_node("MatMul", ["observation", "weights"], ["column"]),
            helper.make_node("Squeeze", ["column", "axis"], ["rooms"]),
            helper.make_node("Concat", ["rooms", "rest"], ["scores"], axis=1),
        ],
        "policy",
        [helper.make_tensor_value_info("observation", TensorProto.FLOAT, [1, 7, len(COLUMNS)])],
        [helper.make_tensor_value_info("scores", TensorProto.FLOAT, [1, 8])],
        [
            numpy_helper.from_array(weights, "weights"),
            numpy_helper.from_array(rest, "rest"),
            numpy_helper.from_array(np.array([2]), "axis"),
        ],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 13)], ir_version=8)
    return bytes(model.SerializeToString())


def test_broken_policy_file_is_named(tmp_path):
    pytest.importorskip("onnxruntime", reason="needs the extra onnx")
    path = tmp_path / "policy.onnx"
    path.write_bytes(b"no network")
    content = flat()
    content["robots"]["astro"]["behaviors"] = [policy(rooms=7, file=str(path))]
    with pytest.raises(fleet2d.InputError, match=r"policy\.onnx is no ONNX model"):
        fleet2d.run(content)


def test_discount_is_by_time():
    env = DiscountByTime(RobotEnv(flat(), reward={"near_min": 1.0}), half_life="20 min")
    plain = RobotEnv(flat(), reward={"near_min": 1.0})
    env.reset(seed=1)
    plain.reset(seed=1)
    for number in range(6):
        reward, info = env.step(7)[1], env.step
        assert pytest.approx(plain.step(7)[1] * 2 ** -(number / 2)) == reward
    assert callable(info)


@pytest.mark.parametrize("task", TASKS)
def test_task_draws_homes_apart_for_each_split(task):
    random = np.random.default_rng(0)
    splits = get_args(Split)
    homes = [
        {load_task(task).draw(random, split)["floorplan.seed"] for _ in range(50)}
        for split in splits
    ]

    assert sum(map(len, homes)) == len(set.union(*homes))


@pytest.mark.parametrize(
    ("task", "settings", "message"),
    [
        ("hangot", {}, "hangout"),
        ("hangout", {"split": "validate"}, "did you mean 'validation'"),
        ({"scenario": "bundled:paper"}, {}, "first behavior is a policy"),
        ({"scenario": flat()}, {"reward": {"relocation": 1.0}}, "relocations"),
    ],
)
def test_wrong_settings_are_an_error_with_the_nearest_name(task, settings, message):
    with pytest.raises(Exception, match=message):
        RobotEnv(task, **settings)


def test_picture_of_a_life_shows_the_scores():
    pytest.importorskip("matplotlib")
    from fleet2d.learning.gym.pictures import life_figure

    env = RobotEnv(flat(), render_mode="rgb_array")
    env.reset(seed=1)
    pixels = env.render()
    texts = [text.get_text() for text in life_figure(env, np.arange(8.0)).axes[0].texts]

    assert (np.uint8, 3) == (pixels.dtype, pixels.shape[2])
    assert any(text.startswith("kitchen_1\n") for text in texts)
    with pytest.raises(InputError, match="scores are of 8 actions, the rooms and to rest"):
        life_figure(env, np.arange(7.0))
