"""Many lives in one process, which share their homes, with batched observations."""

from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space

from fleet2d.gym.env import RobotEnv
from fleet2d.kernels import F32, F64, I64, Bool


class VectorRobotEnv(gymnasium.vector.VectorEnv[F32, I64, Any]):  # type: ignore[misc]
    """Some environments that are stepped together.

    Where a life is over, the next step begins a new one, and ignores the action. `info` has the
    arrays `action_mask`, bool (n, actions), and `elapsed_s`, float64 (n,).

    Args:
        num_envs: Number of environments.
        settings: Those of `RobotEnv`.
    """

    metadata = {"autoreset_mode": AutoresetMode.NEXT_STEP}  # noqa: RUF012 - as Gymnasium declares it

    def __init__(self, num_envs: int = 1, *overrides: str, **settings: Any) -> None:
        task = settings.pop("task", "hangout")
        self.envs = [RobotEnv(task, *overrides, **settings) for _ in range(num_envs)]
        for env in self.envs[1:]:
            env.variants = self.envs[0].variants  # homes are shared
        self.num_envs = num_envs
        self.single_observation_space = self.envs[0].observation_space
        self.single_action_space = self.envs[0].action_space
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        actions = int(self.single_action_space.n)
        self._observations = np.zeros(self.observation_space.shape or (), np.float32)
        self._masks = np.zeros((num_envs, actions), np.bool_)
        self._elapsed_s = np.zeros(num_envs)
        self._over = np.zeros(num_envs, np.bool_)

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[F32, dict[str, Any]]:
        """Begin new lives; environment i has the seed `seed` + i."""
        seeds = (
            [None if seed is None else seed + i for i in range(self.num_envs)]
            if seed is None or isinstance(seed, int)
            else seed
        )
        for number, env in enumerate(self.envs):
            self._keep(number, *env.reset(seed=seeds[number], options=options))
        self._over[:] = False
        return self._observations.copy(), self._info()

    def step(self, actions: Any) -> tuple[F32, F64, Bool, Bool, dict[str, Any]]:
        """Let all robots act."""
        rewards = np.zeros(self.num_envs)
        terminated, truncated = (np.zeros(self.num_envs, np.bool_) for _ in range(2))
        for number, env in enumerate(self.envs):
            if self._over[number]:
                self._keep(number, *env.reset())
                continue
            observation, rewards[number], terminated[number], truncated[number], info = env.step(
                actions[number]
            )
            self._keep(number, observation, info)
        self._over = terminated | truncated
        return self._observations.copy(), rewards, terminated, truncated, self._info()

    def action_masks(self) -> Bool:
        """Return which actions are possible, bool (n, actions)."""
        return self._masks.copy()

    def _keep(self, number: int, observation: F32, info: dict[str, Any]) -> None:
        self._observations[number], self._masks[number] = observation, info["action_mask"]
        self._elapsed_s[number] = info["elapsed_s"]

    def _info(self) -> dict[str, Any]:
        every = np.ones(self.num_envs, np.bool_)
        return {
            "action_mask": self._masks.copy(),
            "_action_mask": every,
            "elapsed_s": self._elapsed_s.copy(),
            "_elapsed_s": every,
        }
