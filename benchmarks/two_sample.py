"""Can a classifier tell simulated days from real ones? Its area under the curve says how well.

    python benchmarks/two_sample.py --data FOLDER [--days 14] [--seed 0] [--json FILE]

--days are those of each bundled persona.

FOLDER has the logs of CASAS, UCI ADL A, and Kasteren A and C. A day is described by numbers that
need no names of activities: how often and how long somebody is where. A persona is fitted to every
other day of a home, lives in the bundled home, and as many of its days are compared with the days
between; then the other way round, so that each real day is compared once. Bundled personas are
compared with all real days, and with those of the home that has a sensor in every room. For
comparison, the days of each real home beside those of the others.

The classifier is a random forest. It is cross-validated by day (five folds) and by home (trained on
the other homes): 0.5 is guessing, 1 means that every day is told. Then the features by which it
tells them: how much the area shrinks if a feature is shuffled among the days that are held out.
"""

import argparse
import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from visits import DAY_S, RoomTrace, grouped_stays, traces_of_log, traces_of_persona

from fleet2d.kernels import F64
from fleet2d.learning.fit.persona import fit_persona
from fleet2d.learning.fit.timeline import find_days, read_timeline
from fleet2d.logs.layout import read_log
from fleet2d.logs.log import AWAY, ActivityLog
from fleet2d.routines.persona import bundled_names

HOMES = {
    "CASAS AL": "casas_al/events_10_days.txt",
    "UCI ADL A": "uci_adl_a",
    "Kasteren A": "kasteren/kast_houseA-ss.txt",
    "Kasteren C": "kasteren/kast_houseC-ss.txt",
}
EVERY_ROOM = "CASAS AL"  # has a motion sensor in every room: the others miss short stays
KINDS = (AWAY, "bathroom", "bedroom", "kitchen", "living_room")
KNOWN = 0.8  # the least known share of a day that is compared
SHORT_S, RETURN_S = 180, 300
NIGHT_S = 6 * 3600
FOLDS = 5
REPEATS = 5
QUANTILES = (0.1, 0.5, 0.9)
FEATURES = (
    "changes of room", "bathroom visits", "longest bathroom visit", "median bathroom visit",
    "visits below 3 min", "returns within 5 min", "outings", "hours out", "changes at night",
    "first change after 4", "last change", "kinds of rooms",
    *(f"stay at home, {100 * q:.0f} %" for q in QUANTILES), "longest stay at home",
    *(f"share in {kind}" for kind in KINDS),
)  # fmt: skip


class Days(NamedTuple):
    """Days, described: float64 (days, FEATURES)."""

    features: F64
    home: str
    numbers: Any


def describe(trace: RoomTrace) -> tuple[F64, Any]:
    """Return the features of the known days of a trace, and their numbers."""
    count = len(trace.rooms) // DAY_S
    known = (trace.rooms[: count * DAY_S] >= 0).reshape(count, DAY_S).mean(axis=1)
    stays = grouped_stays(trace)
    rows = []
    days = [day for day in range(count) if known[day] > KNOWN]
    for day in days:
        begin = day * DAY_S
        first = [k for k, stay in enumerate(stays) if begin <= stay.begin < begin + DAY_S]
        own = [stays[k] for k in first]
        home = [stay for stay in own if stay.kind != AWAY]
        bathroom = [stay.length for stay in home if stay.kind == "bathroom"]
        lengths = np.log([max(stay.length, 1) for stay in home] or [1])
        seconds = [stay.begin - begin for stay in own]
        up = [at for at in seconds if at >= 4 * 3600]
        returns = [
            k for k in first
            if 0 < k < len(stays) - 1 and stays[k - 1].kind == stays[k + 1].kind
            and stays[k].kind != AWAY and stays[k].length < RETURN_S
        ]  # fmt: skip
        share = [_seconds_in(stays, kind, begin) / DAY_S for kind in KINDS]
        rows.append(
            [
                len(own), len(bathroom), np.log(max(bathroom, default=1)),
                np.log(np.median(bathroom or [1])), sum(s.length < SHORT_S for s in home),
                len(returns), sum(stay.kind == AWAY for stay in own), share[0] * 24,
                sum(at < NIGHT_S for at in seconds), min(up, default=DAY_S) / 3600,
                max(seconds, default=0) / 3600, len({stay.kind for stay in own}),
                *np.quantile(lengths, QUANTILES), lengths.max(), *share,
            ]
        )  # fmt: skip
    return np.array(rows, np.float64).reshape(len(rows), len(FEATURES)), np.array(days)


def _seconds_in(stays: Sequence[Any], kind: str, begin: int) -> int:
    """Return the time of a day in a kind of room [s]."""
    ends = [
        (max(s.begin, begin), min(s.begin + s.length, begin + DAY_S))
        for s in stays
        if s.kind == kind
    ]
    return sum(end - first for first, end in ends if end > first)


def fitted_days(path: Path, name: str, seed: int) -> Iterator[tuple[Days, Days]]:
    """Yield every other day of a home, and as many of the persona fitted to the days between."""
    log = read_log(path)
    assert isinstance(log, ActivityLog)
    timeline = read_timeline(log)
    lived = find_days(timeline)
    real, numbers = describe(traces_of_log(path)[0])
    for half in (0, 1):
        fitted = fit_persona(timeline, [day for day in lived if day.number % 2 == half])
        held = numbers % 2 != half
        count = int(np.count_nonzero(held))
        features, made = describe(traces_of_persona(fitted.document, count, seed + half)[0])
        yield Days(real[held], name, numbers[held]), Days(features, name, made + 1000 * half)


def areas(real: Sequence[Days], made: Sequence[Days], seed: int) -> dict[str, Any]:
    """Return the areas under the curve, by day and by home, and what each feature is worth."""
    from sklearn.ensemble import RandomForestClassifier
    from sklearn.inspection import permutation_importance
    from sklearn.metrics import roc_auc_score
    from sklearn.model_selection import GroupKFold

    parts = [*real, *made]
    x = np.concatenate([part.features for part in parts])
    y = np.concatenate([np.full(len(p.features), k < len(real)) for k, p in enumerate(parts)])
    home = np.concatenate([np.full(len(p.features), p.home) for p in parts])
    day = np.concatenate([[f"{p.home} {n}" for n in p.numbers] for p in parts])
    result: dict[str, Any] = {"real": int(y.sum()), "simulated": int((~y).sum())}
    homes = len({part.home for part in real})
    for words, groups, folds in (("day", day, FOLDS), ("home", home, homes)):
        if folds < 2:
            continue
        found = np.full(len(y), np.nan)
        worth = np.zeros(len(FEATURES))
        for train, test in GroupKFold(folds).split(x, y, groups):
            if len({*y[train].tolist()}) < 2:
                continue
            forest = RandomForestClassifier(
                100, min_samples_leaf=3, class_weight="balanced", random_state=seed
            ).fit(x[train], y[train])
            found[test] = forest.predict_proba(x[test])[:, 1]
            if words == "day":
                worth += (
                    permutation_importance(
                        forest,
                        x[test],
                        y[test],
                        scoring="roc_auc",
                        n_repeats=REPEATS,
                        random_state=seed,
                    ).importances_mean
                    / folds
                )
        scored = ~np.isnan(found)
        result[f"by {words}"] = float(roc_auc_score(y[scored], found[scored]))
        if words == "day":
            result["features"] = dict(zip(FEATURES, worth.tolist(), strict=True))
    result["medians"] = {
        name: [float(np.median(x[y][:, k])), float(np.median(x[~y][:, k]))]
        for k, name in enumerate(FEATURES)
    }
    return result


def bundled(days: int, seed: int, homes: Sequence[str]) -> list[Days]:
    """Return the days of the bundled personas, each beside one of the homes."""
    found = []
    for number, name in enumerate(bundled_names()):
        features, made = describe(traces_of_persona(name, days, seed)[0])
        found.append(Days(features, homes[number % len(homes)], made + 10_000 * (number + 1)))
    return found


def show(name: str, found: dict[str, Any]) -> None:
    """Print the areas, and the three features that give simulated days away most."""
    by_home = f", by home {found['by home']:.2f}" if "by home" in found else ""
    print(
        f"{name}: {found['real']} days beside {found['simulated']}; area by day"
        f" {found['by day']:.2f}{by_home}"
    )
    worst = sorted(found["features"].items(), key=lambda item: -item[1])
    for feature, worth in worst[:3]:
        real, made = found["medians"][feature]
        print(f"    {feature}: {worth:.3f}; medians {real:.2f} and {made:.2f}")


def main() -> None:
    """Run the test and print its results."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--days", type=int, default=14)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    pairs = [
        pair
        for name, path in HOMES.items()
        for pair in fitted_days(options.data / path, name, options.seed)
    ]
    real = [pair[0] for pair in pairs]
    people = bundled(options.days, options.seed, list(HOMES))
    results = {
        "fitted": areas(real, [pair[1] for pair in pairs], options.seed),
        "bundled": areas(real, people, options.seed),
        f"bundled beside {EVERY_ROOM} alone": areas(
            [part for part in real if part.home == EVERY_ROOM], people, options.seed
        ),
    }
    for name in HOMES:
        own = [part for part in real if part.home == name]
        others = [part for part in real if part.home != name]
        results[f"{name} beside the other real homes"] = areas(own, others, options.seed)
    for name, found in results.items():
        show(name, found)
    if options.json:
        options.json.write_text(json.dumps(results, indent=1))


if __name__ == "__main__":
    main()
