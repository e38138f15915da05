"""Robots' lives as environments: one robot by Gymnasium, several of a home by PettingZoo."""

import copy
import operator
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any, Literal, Self, SupportsFloat, cast, get_args

import gymnasium
import numpy as np
from gymnasium.spaces import Box, Discrete
from gymnasium.vector import SyncVectorEnv
from pettingzoo import ParallelEnv

from fleet2d.configuration.documents import Document
from fleet2d.configuration.problems import check_known
from fleet2d.configuration.units import parse_duration
from fleet2d.engine.access import measured, run_until_asked, situation_of
from fleet2d.engine.simulation import Simulation
from fleet2d.entities.behavior import Situation
from fleet2d.entities.decisions import DecidingActor
from fleet2d.entities.robots.policy import LearnedBehavior
from fleet2d.errors import InputError
from fleet2d.kernels import F32, Bool
from fleet2d.learning.gym.task import METRIC, LearningTask, Split, Variants, checked, load_task
from fleet2d.metrics.household import TERMS
from fleet2d.runs.run import Run

OPTIONS = ("values", "seed")
"""The options of `RobotEnv.reset`."""
Reward = Mapping[str, float] | Callable[["RobotEnv"], float] | None


class RobotLife:
    """A run in which policies of robots wait for their actions.

    Attributes:
        simulation: The run.
        robots: The names of the robots.
        due: The robots that have to choose now.
    """

    def __init__(self, simulation: Simulation, robots: tuple[str, ...]) -> None:
        self._follow(simulation, robots)
        self.due = run_until_asked(simulation, *robots)

    def _follow(self, simulation: Simulation, robots: tuple[str, ...]) -> None:
        self.simulation = simulation
        self.robots = robots
        actors = simulation.actors
        self._actors = {robot: actors[robot] for robot in robots}
        self._now: dict[str, Situation] = {}  # the newest situation of each robot

    def __getstate__(self) -> tuple[Simulation, tuple[str, ...], list[str]]:
        """Return the simulation, the robots and those due; all else follows from them."""
        return self.simulation, self.robots, self.due

    def __setstate__(self, state: tuple[Simulation, tuple[str, ...], list[str]]) -> None:
        """Continue the same life."""
        simulation, robots, self.due = state
        self._follow(simulation, robots)

    def actor(self, robot: str) -> DecidingActor:
        """Return a robot."""
        return self._actors[robot]

    def policy(self, robot: str) -> LearnedBehavior:
        """Return the policy of a robot."""
        return cast("LearnedBehavior", self._actors[robot].behaviors[0])

    def act(self, actions: Mapping[str, int]) -> None:
        """Let robots that have to choose act, up to the next step at which one has to choose.

        Raises:
            InputError: An action is masked or out of range; nothing has changed then.
        """
        for robot in self.due:
            self.policy(robot).check(self.now(robot), actions[robot], self.mask(robot))
        for robot in self.due:
            self.policy(robot).given = int(actions[robot])
        self.due = run_until_asked(self.simulation, *self.robots)

    def now(self, robot: str) -> Situation:
        """Return the situation of a robot at the present step."""
        now = self._now.get(robot)
        if now is None or now.step != self.simulation.step:
            now = self._now[robot] = situation_of(self.simulation, robot)
        return now

    def mask(self, robot: str) -> Bool:
        """Return which actions are possible at the present step, bool (rows + 1,), read-only."""
        return self.policy(robot).mask(self.now(robot))

    def is_empty(self, robot: str) -> bool:
        """Whether the battery of a robot is empty, so that it never decides again."""
        charge = self.actor(robot).charge
        return charge is not None and charge.is_empty

    def terms(self, robot: str) -> dict[str, float]:
        """Return the terms of rewards, from the beginning to the present step."""
        nothing = dict.fromkeys(TERMS, 0.0)  # metrics have no results at the first step
        terms: dict[str, float] = measured(self.simulation, METRIC).get(robot, nothing)
        return terms

    def copy(self) -> "RobotLife":
        """Return an independent copy."""
        return copy.deepcopy(self)


class RobotEnv(gymnasium.Env[F32, np.int64]):  # type: ignore[misc]
    """The decisions of one robot, each lasting until the next: a semi-Markov process.

    An observation is a table float32 (rows, columns): a row for each room, with the columns
    `COLUMNS` of `fleet2d.entities.robots.policy`, or for each interaction, with `ASK_COLUMNS` of
    `fleet2d.entities.robots.ask_policy`. Action r is to go to room r, or to serve the request of
    interaction r; the last one is to rest, to give up a search, or to wait. `info` has the
    `action_mask`, int8, the length of the interval since the last decision, `elapsed_s`, and the
    local `time`. A life is truncated at the end of its scenario, and terminated when the robot's
    battery is empty.

    Args:
        task: hangout, find, patrol, interact, a file of a task or a scenario, or a `LearningTask`.
        overrides: Changes of the scenario, such as "simulation.duration=3 d".
        robot: The robot; left out: the only one with a policy.
        reward: Weights of terms in place of the task's, or a function that is called with the
            environment after each step.
        split: The split whose values are drawn.
        masked: How an impossible action counts: as the last action, or as an error.
        truth: Whether `info` has the true places of everybody.

    Example:
        >>> env = RobotEnv("hangout", "simulation.duration=1 d")
        >>> observation, info = env.reset(seed=1)
        >>> observation.shape, int(info["action_mask"].sum()) > 1
        ((16, 40), True)
        >>> action = np.flatnonzero(info["action_mask"])[0]
        >>> _, reward, terminated, truncated, info = env.step(action)
        >>> info["elapsed_s"] > 60, terminated
        (True, False)
    """

    metadata = {"render_modes": ["rgb_array"]}

    def __init__(
        self,
        task: str | Path | Mapping[str, Any] | LearningTask = "hangout",
        *overrides: str,
        robot: str | None = None,
        reward: Reward = None,
        split: Split = "train",
        masked: Literal["error", "rest"] = "rest",
        truth: bool = False,
        render_mode: str | None = None,
    ) -> None:
        check_known(split, "split", get_args(Split), InputError)
        check_known(masked, "value of masked", ("rest", "error"), InputError)
        self.variants = Variants(load_task(task), overrides)
        self.reward: Any = self.variants.task.reward if reward is None else reward
        if not callable(self.reward):
            self.reward = checked(Document({"reward": self.reward}, {})).reward
        self.split = split
        self.masked = masked
        self.truth = truth
        self.render_mode = render_mode
        variant = self.variants.first(self.split)
        self.robot = robot or variant.robots[0]
        self.robots: tuple[str, ...] = (self.robot,)  # the robots that choose in its lives
        if self.robot not in variant.robots or (robot is None and len(variant.robots) > 1):
            raise InputError(
                f"name the robot that learns by robot=…: one of {', '.join(variant.robots)}"
            )
        policy = variant.scenario.robots[self.robot].behaviors[0]
        assert isinstance(policy, LearnedBehavior)
        shape = policy.rows, len(policy.columns)
        self.observation_space = gymnasium.spaces.Box(-1.0, 1.0, shape, np.float32)
        self.action_space = gymnasium.spaces.Discrete(policy.rows + 1)
        self.life: RobotLife | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[F32, dict[str, Any]]:
        """Begin a new life.

        Args:
            seed: Seed of all further draws.
            options: `values`: values of the keys that vary; `seed`: the seed of the life.

        Raises:
            InputError: The scenario with these values is wrong.
        """
        options = options or {}
        for name in options:
            check_known(name, "option", OPTIONS, InputError)
        super().reset(seed=seed)
        drawn_values = self.variants.task.draw(self.np_random, self.split)
        values = drawn_values | options.get("values", {})
        drawn = int(self.np_random.integers(2**53))
        variant = self.variants.load(values)
        if not {*self.robots} <= {*variant.robots}:
            raise InputError(
                f"robots with policies are {', '.join(variant.robots)}, expected"
                f" {', '.join(self.robots)}, in the scenario with {values}"
            )
        simulation = variant.scenario.simulation
        settings = simulation.model_copy(update={"seed": options.get("seed", drawn)})
        scenario = variant.scenario.model_copy(update={"simulation": settings})
        self.join(RobotLife(Simulation(scenario), self.robots))
        return self.observe(0)

    def join(self, life: RobotLife) -> None:
        """Go on in a life, which other robots may share."""
        self.life = life
        self._step = life.simulation.step
        self._terms = {} if callable(self.reward) else life.terms(self.robot)

    def step(self, action: Any) -> tuple[F32, float, bool, bool, dict[str, Any]]:
        """Let the robot act until it has to choose again.

        Raises:
            InputError: The action is masked or out of range, or the life is over; nothing has
                changed then.
        """
        life = self.present
        if not life.due:
            raise InputError("the life is over: call reset()")
        life.act({self.robot: self.allowed(action)})
        step = life.simulation.step
        clock = life.simulation.clock
        elapsed_s = (step - self._step) * clock.step_us / 1e6
        self._step = step
        reward = self.collect()
        observation, info = self.observe(elapsed_s)
        is_empty = life.is_empty(self.robot)
        return observation, reward, is_empty, not life.due and not is_empty, info

    def allowed(self, action: Any) -> int:
        """Return an action; a masked one becomes that to rest, if so configured.

        Raises:
            InputError: The action isn't a whole number.
        """
        try:
            action = operator.index(action)
        except TypeError:
            raise InputError(f"an action is a whole number, got {action!r}") from None
        rest = int(self.action_space.n) - 1
        if self.masked == "rest" and 0 <= action <= rest and not self.action_masks()[action]:
            return rest
        return action

    def collect(self) -> float:
        """Return the reward since the last call."""
        if callable(self.reward):
            return float(self.reward(self))
        before = self._terms
        self._terms = self.present.terms(self.robot)
        return sum(w * (self._terms[name] - before[name]) for name, w in self.reward.items())

    def branch(self) -> Self:
        """Return an independent copy of the environment and its life, for a search over futures."""
        twin = copy.copy(self)
        twin.life = self.present.copy()
        twin._np_random = copy.deepcopy(self._np_random)
        return twin

    def run(self) -> Run:
        """End the life here, and return it as a run: its tables, metrics and pictures."""
        return self.present.simulation.finish()

    def action_masks(self) -> Bool:
        """Return which actions are possible, bool (rows + 1,); MaskablePPO calls this method."""
        return self.present.mask(self.robot)

    def render(self) -> Any:
        """Return a picture of the present moment, uint8 (height, width, 3)."""
        from fleet2d.learning.gym.pictures import life_figure, pixels_of

        return pixels_of(life_figure(self))

    @property
    def present(self) -> RobotLife:
        """The present life.

        Raises:
            InputError: No life has begun yet.
        """
        if self.life is None:
            raise InputError("there is no life yet: call reset()")
        return self.life

    def observe(self, elapsed_s: float) -> tuple[F32, dict[str, Any]]:
        """Return the observation and the information of the present step."""
        life = self.present
        now = life.now(self.robot)
        policy = life.policy(self.robot)
        info: dict[str, Any] = {
            "elapsed_s": float(elapsed_s),
            "action_mask": life.mask(self.robot).astype(np.int8),
            "time": now.time.isoformat(),
        }
        if self.truth:
            info["truth"] = life.simulation.state
        return policy.observe(now), info


class DiscountByTime(gymnasium.Wrapper[Any, Any, Any, Any]):  # type: ignore[misc]
    """Discounts rewards by the time since the beginning of the life.

    A reward counts 2 ** -(t / half_life), with t the time at which its interval began; learn with
    a discount factor of 1. `info["discount"]` is the discount of the next interval.

    Args:
        env: The environment.
        half_life: The time after which a reward counts half, such as "6 h".
    """

    def __init__(self, env: gymnasium.Env[Any, Any], half_life: str = "6 h") -> None:
        super().__init__(env)
        self._half_life_s = parse_duration(half_life).total_seconds()
        self._elapsed_s = 0.0

    @property
    def discount(self) -> float:
        """The discount of the next reward."""
        return float(2 ** -(self._elapsed_s / self._half_life_s))

    def reset(self, **settings: Any) -> tuple[Any, dict[str, Any]]:
        """Begin a new life, without discount."""
        observation, info = self.env.reset(**settings)
        self._elapsed_s = 0.0
        return observation, {**info, "discount": 1.0}

    def step(self, action: Any) -> tuple[Any, SupportsFloat, bool, bool, dict[str, Any]]:
        """Act, and discount the reward."""
        discount = self.discount
        observation, reward, terminated, truncated, info = self.env.step(action)
        self._elapsed_s += info["elapsed_s"]
        info = {**info, "discount": self.discount}
        return observation, float(reward) * discount, terminated, truncated, info


class VectorRobotEnv(SyncVectorEnv):  # type: ignore[misc]
    """Some environments that are stepped together; they share their homes.

    If a life is over, the next step begins a new one and ignores the action. `info` has the
    arrays `action_mask`, int8 (n, actions), and `elapsed_s`, float64 (n,).

    Args:
        num_envs: Number of environments.
        settings: The settings of `RobotEnv`.
    """

    def __init__(self, num_envs: int = 1, *overrides: str, **settings: Any) -> None:
        variants = RobotEnv(settings.pop("task", "hangout"), *overrides, **settings).variants
        # Gymnasium keeps functions that make environments, which must be picklable.
        super().__init__([partial(_env_with, variants, settings)] * num_envs)

    def action_masks(self) -> Bool:
        """Return which actions are possible, bool (n, actions)."""
        return np.stack([env.action_masks() for env in self.envs])


def _env_with(variants: Variants, settings: Mapping[str, Any]) -> RobotEnv:
    """Return an environment that shares the homes of others."""
    env = RobotEnv(variants.task, *variants.overrides, **settings)
    env.variants = variants
    return env


Agents = dict[str, Any]


class RobotsEnv(ParallelEnv):  # type: ignore[misc]
    """The decisions of all robots with policies; see `RobotEnv` for its settings.

    A step lasts until any robot has to choose. `infos[robot]["due"]` says whether a robot has to;
    the actions of the others are ignored, and their masks allow only to rest.
    """

    metadata = {"name": "fleet2d", "render_modes": ["rgb_array"]}

    def __init__(
        self, task: str | Path | LearningTask = "hangout", *overrides: str, **settings: Any
    ) -> None:
        robots = Variants(load_task(task), overrides).first("train").robots
        self._envs = {
            robot: RobotEnv(task, *overrides, robot=robot, **settings) for robot in robots
        }
        self._first = next(iter(self._envs.values()))
        self.render_mode = settings.get("render_mode")
        self.possible_agents = list(robots)
        self.agents: list[str] = []

    def observation_space(self, agent: str) -> Box:
        """Return the space of a robot's observations."""
        return cast("Box", self._envs[agent].observation_space)

    def action_space(self, agent: str) -> Discrete:
        """Return the space of a robot's actions."""
        return cast("Discrete", self._envs[agent].action_space)

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Agents, Agents]:
        """Begin a new life of all robots; options without a meaning are ignored."""
        options = {name: value for name, value in (options or {}).items() if name in OPTIONS}
        self._first.robots = tuple(self.possible_agents)
        self._first.reset(seed=seed, options=options)
        life = self.life
        for env in self._envs.values():
            env.join(life)
        self.agents = list(self.possible_agents)
        return self._observe(0.0)

    @property
    def life(self) -> RobotLife:
        """The life that all robots share."""
        return self._first.present

    def step(self, actions: Agents) -> tuple[Agents, Agents, Agents, Agents, Agents]:
        """Let the robots act that have to choose, until one has to choose again.

        Raises:
            InputError: The action of a robot that has to choose is missing, masked or out of range;
                nothing has changed then.
        """
        life = self.life
        before = life.simulation.step
        for robot in life.due:
            if robot not in actions:
                raise InputError(f"{robot} has to choose: give its action")
        due = {robot: self._envs[robot].allowed(actions[robot]) for robot in life.due}
        life.act(due)
        rewards = {robot: self._envs[robot].collect() for robot in self.agents}
        over = not life.due
        empty = {robot: life.is_empty(robot) for robot in self.agents}
        elapsed_s = (life.simulation.step - before) * life.simulation.clock.step_us / 1e6
        observations, infos = self._observe(elapsed_s)
        truncated = {robot: over and not empty[robot] for robot in self.agents}
        terminated = {robot: over and empty[robot] for robot in self.agents}
        if over:
            self.agents = []
        return observations, rewards, terminated, truncated, infos

    def render(self) -> Any:
        """Return a picture of the present moment, uint8 (height, width, 3)."""
        return self._first.render()

    def _observe(self, elapsed_s: float) -> tuple[Agents, Agents]:
        observations: dict[str, F32] = {}
        infos: Agents = {}
        for robot in self.agents:
            observations[robot], info = self._envs[robot].observe(elapsed_s)
            info["due"] = robot in self.life.due
            if not info["due"]:
                info["action_mask"][:-1] = 0
            infos[robot] = info
        return observations, infos
