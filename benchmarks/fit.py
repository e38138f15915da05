"""Fitted personas beside the real logs that they were fitted to, on days held back.

    python benchmarks/fit.py --data ../shared/data/activity --out fit

Writes for each log a picture (time shares by hour, durations of stays) and prints two tables: the
distances of days sampled from the persona, and from a first-order Markov chain of minutes fitted to
the same days, to the days held back; and the shares of time per room.
"""

import argparse
from pathlib import Path

from fleet2d.fit.command import table
from fleet2d.fit.persona import fit_persona, sample_persona, validate
from fleet2d.fit.picture import SAMPLED, draw_persona
from fleet2d.fit.timeline import find_days, read_timeline, shares
from fleet2d.logs.layouts import read_log
from fleet2d.logs.log import ActivityLog

LOGS = {
    "casas_al": "casas_al/events_10_days.txt",
    "uci_adl_a": "uci_adl_a",
    "homer_plus_a": "homer_plus_a",
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, required=True, help="the folder of the three logs")
    parser.add_argument("--out", type=Path, default=Path("fit"), help="where the pictures go")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    for name, path in LOGS.items():
        log = read_log(options.data / path)
        assert isinstance(log, ActivityLog)
        timeline = read_timeline(log)
        days = find_days(timeline)
        fitted = fit_persona(timeline, days)
        print(f"\n## {name}")
        print("\n".join(table(validate(timeline, seed=options.seed))))
        count = len(timeline.places)
        real = shares(timeline.rooms[[day.number for day in days]], count)
        sampled = shares(sample_persona(fitted, timeline, SAMPLED, options.seed)[1], count)
        print(f"{'share of the time':20}{'log':>8}{'persona':>9}")
        for i, place in enumerate(timeline.places):
            print(f"{place:20}{real[i]:8.3f}{sampled[i]:9.3f}")
        draw_persona(timeline, days, fitted, options.out / f"{name}.png", options.seed)


if __name__ == "__main__":
    main()
