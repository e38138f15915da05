"""A new estimator of long-term presence in one file, compared with the built-in ones in some homes.

python examples/own_presence/compare.py [HOMES]
"""

import sys

import numpy as np

import fleet2d


class LastWeek(fleet2d.Algorithm):
    """Share of watched minutes in which somebody was seen, over the last seven days."""

    needs = frozenset({"evidence"})

    def start(self, home):
        """Begin with seven empty days: for each room, minutes seen and minutes watched."""
        self.days = np.zeros((7, 2, len(home.rooms)))

    def update(self, history, state):
        """Add an hour; each day replaces the one a week ago."""
        evidence, day = history.evidence, state.time.weekday()
        if state.time.hour == 0:
            self.days[day] = 0
        seen = evidence.seen[:, -1].sum(axis=0) / evidence.bin_steps
        self.days[day] += seen, evidence.watched.sum(axis=0)
        seen, watched = self.days.sum(axis=0)
        return fleet2d.RoomDistribution(seen / np.maximum(watched, 1))


def errors(home: int) -> dict[str, float]:
    """Return each algorithm's total variation distance to the truth, after a week in a home."""
    ours = {"naive": "sighting_share", "weighed": "exposure_ratio", "likely": "likelihood"}
    algorithms = {
        name: {"type": "long_term_presence", "estimator": estimator}
        for name, estimator in ours.items()
    }
    algorithms["mine"] = {"type": f"{__file__}:LastWeek"}
    metrics = {name: {"type": "ltp_error", "of": name} for name in algorithms}
    users = {"ana": {"type": "routine", "persona": "works_from_home"}}
    robots = {"astro": {"type": "patrol", "dwell": "5 min"}}
    simulation = {"start": "2026-01-05", "duration": {"days": 7}, "seed": home}
    scenario = {"floorplan": {"type": "synthetic", "seed": home}, "users": users, "robots": robots}
    scenario |= {"simulation": simulation, "algorithms": algorithms, "metrics": metrics}
    return {name: m["anyone"]["tv"] for name, m in fleet2d.run(scenario).metrics.items()}


if __name__ == "__main__":
    homes = int(sys.argv[1]) if len(sys.argv) > 1 else 10
    rows = [errors(home) for home in range(homes)]
    print({name: round(float(np.mean([row[name] for row in rows])), 3) for name in rows[0]})
