"""Wrappers for decisions of different lengths."""

from typing import Any, SupportsFloat

import gymnasium

from fleet2d.configuration.units import parse_duration


class DiscountByTime(gymnasium.Wrapper[Any, Any, Any, Any]):  # type: ignore[misc]
    """Discounts rewards by the time since the beginning of the life.

    A reward counts 2 ** -(t / half_life), with t the time at which its interval began; learn with
    a discount factor of 1. `info["discount"]` is that of the next interval.

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
        """How much the next reward counts."""
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
