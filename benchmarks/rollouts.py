"""How often the intervals of a rollout hold on every day, and how often a guard stops it wrongly.

    python benchmarks/rollouts.py --rollouts 1000

Robots differ, their days depend on the days before, and so does what the change does to them. Of
each shape of data many rollouts are looked at on each day; one fails if a single interval misses
what the change does in the mean.
"""

import argparse
from collections.abc import Callable

import numpy as np

from fleet2d.kernels import F64
from fleet2d.studies.intervals import LEVEL
from fleet2d.studies.rollout import looks_of

DAYS = 30
STAGES = ((4, 0.02), (10, 0.1), (18, 0.5))  # from which day on, and the share of robots
EFFECT = 0.3
MEMORY = 0.6  # of a day for the day before

Draw = Callable[[np.random.Generator, int], F64]
SHAPES: dict[str, Draw] = {
    "normal": lambda g, n: g.normal(0, 1, n),
    "lognormal": lambda g, n: g.lognormal(0, 1, n),
    "70 % are zero": lambda g, n: np.where(g.random(n) < 0.7, 0.0, g.exponential(1, n)),
    "one in ten is eight times the others": lambda g, n: np.where(g.random(n) < 0.1, 8.0, 1.0),
    "shares near 0": lambda g, n: g.beta(0.5, 10, n),
}
"""How robots differ."""


def rollout(shape: str, robots: int, seed: int, *, sums: bool) -> tuple[bool, bool]:
    """Simulate a rollout.

    Args:
        shape: How robots differ.
        robots: Their number.
        seed: The seed.
        sums: Whether the metric adds up over days, as distance does; else it is a mean so far.

    Returns:
        Whether all intervals hold; and whether a guard at the true effect would stop it, wrongly.
    """
    generator = np.random.default_rng(seed)
    level = SHAPES[shape](generator, robots)
    scale = level.std() or 1.0
    noise = np.zeros((robots, DAYS))
    for day in range(DAYS):
        noise[:, day] = MEMORY * noise[:, day - 1] + generator.normal(0, 1, robots) * scale / 2
    size = level / level.mean() if shape != "normal" else np.ones(robots)  # as large as the robot's
    days = level[:, None] + noise * size[:, None]
    share = generator.random(robots)
    begins = np.full(robots, 1 << 40)
    for day, part in reversed(STAGES):
        begins[share < part] = day
    effects = EFFECT * scale * generator.exponential(1, robots)  # it differs between robots
    changed = days + effects[:, None] * (np.arange(DAYS) >= begins[:, None])
    count = 1.0 if sums else np.arange(1, DAYS + 1)
    without, treated = (np.cumsum(table, axis=1) / count for table in (days, changed))
    looked = range(int(begins.min()), DAYS)
    looks = looks_of(without, treated, begins, 1 - (1 - LEVEL) / len(looked), looked)
    holds, stops = True, False
    for look in looks:
        exposed = np.maximum(look.day - begins[begins < look.day], 0).mean()
        true = EFFECT * scale * exposed / (1 if sums else look.day)
        if np.isfinite(look.low):
            holds = holds and look.low <= true <= look.high
            stops = stops or look.low > true
    return bool(holds), bool(stops)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--rollouts", type=int, default=1000)
    count = parser.parse_args().rollouts
    print("| robots differ as | robots | sums hold on all days | means | stopped wrongly |")
    print("| --- | ---: | ---: | ---: | ---: |")
    for shape in SHAPES:
        for robots in (400, 2000):
            cells = [
                np.array([rollout(shape, robots, seed, sums=sums) for seed in range(count)])
                for sums in (True, False)
            ]
            holds = [f"{cell[:, 0].mean():.3f}" for cell in cells]
            wrong = max(cell[:, 1].mean() for cell in cells)
            print(f"| {shape} | {robots:,} | {' | '.join(holds)} | {wrong:.3f} |", flush=True)


if __name__ == "__main__":
    main()
