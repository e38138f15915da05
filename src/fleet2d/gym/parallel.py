"""Several robots of one home as agents, by PettingZoo's parallel API."""

from pathlib import Path
from typing import Any

import numpy as np
from gymnasium.spaces import Box, Discrete
from pettingzoo import ParallelEnv

from fleet2d.errors import InputError
from fleet2d.gym.env import OPTIONS, RobotEnv, RobotLife
from fleet2d.gym.task import LearningTask
from fleet2d.kernels import F32

Agents = dict[str, Any]
Source = str | Path | LearningTask


class RobotsEnv(ParallelEnv):  # type: ignore[misc]
    """The decisions of all robots with policies; see `RobotEnv` for its settings.

    A step lasts until any robot has to choose. `infos[robot]["due"]` tells which ones have to; the
    actions of the others are ignored, and their mask allows only to rest.
    """

    metadata = {"name": "fleet2d", "render_modes": ["rgb_array"]}  # noqa: RUF012

    def __init__(
        self, task: str | Path | LearningTask = "hangout", *overrides: str, **settings: Any
    ) -> None:
        robots = RobotEnv.robots_of(task, *overrides)
        self._envs = {
            robot: RobotEnv(task, *overrides, robot=robot, **settings) for robot in robots
        }
        self._first = next(iter(self._envs.values()))
        self.render_mode = settings.get("render_mode")
        self.possible_agents = list(robots)
        self.agents: list[str] = []

    def observation_space(self, agent: str) -> Box:
        """Return the space of a robot's observations."""
        space = self._envs[agent].observation_space
        assert isinstance(space, Box)
        return space

    def action_space(self, agent: str) -> Discrete:
        """Return the space of a robot's actions."""
        space = self._envs[agent].action_space
        assert isinstance(space, Discrete)
        return space

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
        life, before = self.life, self.life.simulation.step
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
                info["action_mask"] = np.zeros_like(info["action_mask"])
                info["action_mask"][-1] = True
            infos[robot] = info
        return observations, infos
