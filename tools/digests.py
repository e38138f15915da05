"""Prints the digests of two scenarios, which are the same on every machine."""

import fleet2d

month = fleet2d.run("bundled:paper", seed=4)
family = fleet2d.run("examples/family.yaml", "simulation.duration=2 d", seed=1)
print(month.digest[:16], family.digest[:16])
