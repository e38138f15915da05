"""Environments of Gymnasium and PettingZoo in which agents learn to be home robots.

Needs the extra `gym`. Importing this package registers the environments `fleet2d/Hangout-v1`,
`fleet2d/Find-v1`, `fleet2d/Patrol-v1` and `fleet2d/Interact-v1`;
"fleet2d.learning.gym:fleet2d/Hangout-v1" does so by itself.
"""

from fleet2d.errors import extra
from fleet2d.runtime.memory import library_imports

with library_imports():
    with extra("gym", "fleet2d.learning.gym needs gymnasium and pettingzoo"):
        import gymnasium
        import pettingzoo  # noqa: F401

    from fleet2d.learning.gym.env import DiscountByTime as DiscountByTime
    from fleet2d.learning.gym.env import RobotEnv as RobotEnv
    from fleet2d.learning.gym.env import RobotLife as RobotLife
    from fleet2d.learning.gym.env import RobotsEnv as RobotsEnv
    from fleet2d.learning.gym.env import VectorRobotEnv as VectorRobotEnv
    from fleet2d.learning.gym.task import LearningTask as LearningTask
    from fleet2d.learning.gym.task import load_task as load_task

for _name in ("Hangout", "Find", "Patrol", "Interact"):
    gymnasium.register(
        id=f"fleet2d/{_name}-v1",
        entry_point="fleet2d.learning.gym.env:RobotEnv",
        vector_entry_point="fleet2d.learning.gym.env:VectorRobotEnv",
        kwargs={"task": _name.lower()},
        disable_env_checker=True,  # without wrappers `make` returns the environment itself
        order_enforce=False,
    )
