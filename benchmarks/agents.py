"""How fast environments for agents are; needs the extra `gym`.

    python benchmarks/agents.py

Prints decisions a second, and the time of resets and branches: the best of several runs in
processor time.
"""

import time
from collections.abc import Callable
from random import Random

HOME = {"floorplan.seed": 3, "users.ana.persona": "retired"}


def best_s(function: Callable[[], object], repeats: int) -> float:
    """Return the least processor time of a call [s]."""
    times = []
    for _ in range(repeats):
        began = time.process_time()
        function()
        times.append(time.process_time() - began)
    return min(times)


def decisions_a_second(task: str) -> float:
    """Return the rate of decisions drawn at random in a known home."""
    from fleet2d.learning.gym import RobotEnv

    env, random, counts = RobotEnv(task), Random(0), list[int]()
    values = {key: HOME[key] for key in env.variants.task.vary}

    def live() -> None:
        mask, count, is_over = env.action_masks(), 0, False
        while not is_over:
            action = random.choice(mask.nonzero()[0].tolist())
            _, _, terminated, truncated, info = env.step(action)
            mask, count, is_over = info["action_mask"], count + 1, terminated or truncated
        counts.append(count)

    rates = []
    for _ in range(5):
        env.reset(seed=1, options={"values": values})
        rates.append(best_s(live, 1))
    return max(count / seconds for count, seconds in zip(counts, rates, strict=True))


def main() -> None:
    """Print all measurements."""
    from fleet2d.learning.gym import RobotEnv

    for task in ("hangout", "find", "patrol"):
        print(f"{task:<8} {decisions_a_second(task):7.0f} decisions a second")
    env = RobotEnv("hangout")
    known_s = best_s(lambda: env.reset(seed=1, options={"values": HOME}), 200)
    seeds = iter(range(100, 200))
    new_s = best_s(
        lambda: env.reset(options={"values": {**HOME, "floorplan.seed": next(seeds)}}), 10
    )
    print(f"reset    {1000 * known_s:7.2f} ms in a known home, {1000 * new_s:.1f} ms in a new one")
    env.reset(seed=1, options={"values": HOME})
    random = Random(0)
    for _ in range(3 * 48):
        env.step(random.choice(env.action_masks().nonzero()[0].tolist()))
    print(f"branch   {1000 * best_s(env.branch, 20):7.2f} ms after three active days")


if __name__ == "__main__":
    main()
