"""Fitted personas beside the real logs that they were fitted to, on days held back.

    python benchmarks/fit.py --data ../shared/data/activity --out fit

Writes for each log a picture (time shares by hour, durations of stays) and prints how far days are
from the days held back, by minutes and by seconds: days sampled from the persona, from a private
one and from one of laws, copied days, and those of a first-order Markov chain; then what a persona
repeats of its log, and the shares of time per room.
"""

import argparse
from pathlib import Path

from fleet2d.learning.fit.command import table
from fleet2d.learning.fit.persona import fit_persona
from fleet2d.learning.fit.picture import SAMPLED, draw_persona
from fleet2d.learning.fit.privacy import repeats
from fleet2d.learning.fit.timeline import find_days, read_timeline, shares
from fleet2d.learning.fit.validation import sample_persona, simulated_repeats, validate
from fleet2d.logs.layout import read_log
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
        private = fit_persona(timeline, days, private=True)
        validation = validate(timeline, seed=options.seed, private=True)
        for unit, distances in (("", validation.rooms), (" to the second", validation.seconds)):
            cells = " ".join(f"{value:.3f}" for value in distances[0])
            print(f"{'a private persona' + unit:34}{cells}")
        print(f"the persona repeats of its log: {simulated_repeats(fitted)}")
        print(f"a private one: {simulated_repeats(private)}")
        print(f"days of the log, of each other: {repeats(fitted.log, fitted.log)}")
        count = len(timeline.places)
        real = shares(timeline.rooms[[day.number for day in days]], count)
        sampled = shares(sample_persona(fitted, timeline, SAMPLED, options.seed)[1], count)
        print(f"{'share of the time':20}{'log':>8}{'persona':>9}")
        for i, place in enumerate(timeline.places):
            print(f"{place:20}{real[i]:8.3f}{sampled[i]:9.3f}")
        draw_persona(timeline, days, fitted, options.out / f"{name}.png", options.seed)


if __name__ == "__main__":
    main()
