"""How true the people are: simulated time use beside the American Time Use Survey.

    python benchmarks/people.py compare [--people 1000] [--weeks 1] [--figure FILE] [--json FILE]
    python benchmarks/people.py held-out --data FOLDER [--people 1000]   # starts of activities
    python benchmarks/people.py measures --data FOLDER [--days 28]   # days, as those of real people
    python benchmarks/people.py visits --data FOLDER [--days 28]   # moving about, as real people
    python benchmarks/people.py rooms [--figure FILE]      # room_sampling: shares over time
    python benchmarks/people.py speed [--users N]          # how long people take
    python benchmarks/people.py derive SURVEY_FOLDER       # writes routines/survey.json anew

`compare` draws the days of that many people of each group of `population`, and prints how far the
share of them that do each activity is from the survey's, by hour: the total variation distance, and
the largest difference of each activity. `held-out` prints how likely the survey's hours at which
activities begin are under such people: the table that these draw from doesn't have them. `measures`
prints fourteen measures of the days of each persona, with and without short stays, and of the logs,
on the first of which the rates of short stays were chosen; then how far the days of a persona
fitted to a log are from days held back, beside copied days and a Markov chain. `visits` prints
how often each persona visits bathrooms, goes somewhere for less than three minutes, and comes back,
and how long it stays in which kind of room, and how its hours differ from the survey's, beside the
real homes of CASAS and UCI ADL and the simulated one of HOMER+; it fails where a persona is outside
the spread of the real ones. `rooms` simulates a user who samples rooms and prints how far the
shares of time are from the given ones after 1, 2, 4, … days. `speed` times the planning of days,
the base month with a routine beside the one with a schedule (in processor time: other work on the
machine doesn't count), and a month of N people. `derive` makes the table that `population` draws
from of the survey's summary files.
"""

import argparse
import csv
import json
import math
import resource
import statistics
import tempfile
import time
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from datetime import date, timedelta
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from visits import (
    MEDIANS,
    ActivityTrace,
    Measures,
    RoomTrace,
    Visits,
    count_visits,
    grouped_stays,
    measure,
    spread,
    stays,
    traces_of_log,
    traces_of_persona,
)

import fleet2d
import fleet2d.routines.survey as survey
from fleet2d.kernels import F64
from fleet2d.learning.fit.command import table
from fleet2d.learning.fit.timeline import ks_distance, read_timeline
from fleet2d.learning.fit.validation import validate
from fleet2d.logs.layout import read_log
from fleet2d.logs.log import ActivityLog
from fleet2d.routines.interruptions import without_interruptions
from fleet2d.routines.life import Life
from fleet2d.routines.persona import bundled_names, bundled_persona
from fleet2d.runtime.determinism import Draws, stream_key

LOGS = {
    "CASAS AL": "casas_al/events_10_days.txt",
    "UCI ADL A": "uci_adl_a",
    "HOMER+ A": "homer_plus_a",
}
# Logs that nothing was chosen on, and that aren't fitted.
UNSEEN = {"Kasteren A": "kasteren/kast_houseA-ss.txt", "Kasteren C": "kasteren/kast_houseC-ss.txt"}
REAL = ("CASAS AL", "UCI ADL A")
# Which group of the survey a persona is most like, and which category an activity counts for there.
LIKE = {"works_outside": "workers", "retired": "retired", "works_from_home": "workers"}
CATEGORY_OF = {
    "sleep": "sleeping", "nap": "sleeping", "work": "work", "work_at_home": "work",
    "cook": "food_prep",
    "breakfast": "eating", "lunch": "eating", "dinner": "eating", "snack": "eating", "tv": "tv",
    "laundry": "laundry", "exercise": "exercise", "sport": "exercise", "walk": "exercise",
}  # fmt: skip
MONDAY = date(2026, 1, 5).toordinal()
GROUPS = {"O1": "workers", "O2": "retired", "O3": "working_parents", "O4": "at_home"}
# Codes of the survey's lexicon, longest prefix first, and the category or activity that they are.
CODES = {
    "0101": "sleeping", "0102": "wash", "0103": "wash", "0104": "wash", "0105": "wash",
    "020102": "laundry", "0201": "clean", "0202": "food_prep", "020203": "dishes", "0203": "tidy",
    "0205": "garden", "0206": "care", "0208": "tidy", "0209": "paperwork", "02": "tidy",
    "03": "care", "04": "care", "05": "work", "06": "study", "07": "shopping", "08": "errand",
    "09": "errand", "10": "errand", "11": "eating", "1201": "talk", "1202": "outing",
    "120303": "tv", "120304": "tv", "120301": "rest", "120307": "games", "120308": "computer",
    "120312": "read", "1203": "hobby", "1204": "outing", "12": "talk", "13": "exercise",
    "14": "outing", "15": "errand", "16": "phone", "18": "travel", "50": "rest",
}  # fmt: skip


def category(code: str) -> str:
    """Return what a code of the survey's lexicon is for us."""
    return next((CODES[code[:n]] for n in (6, 4, 2) if code[:n] in CODES), "rest")


def parts(shares: list[float], whole: int = 10_000) -> list[int]:
    """Round shares to parts of a whole that add up to it (largest remainders)."""
    total = sum(shares)
    exact = [share / total * whole for share in shares]
    result = [int(x) for x in exact]
    rest = sorted(range(len(exact)), key=lambda i: result[i] - exact[i])
    for i in rest[: whole - sum(result)]:
        result[i] += 1
    return result


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def derive(folder: Path) -> dict[str, Any]:
    """Make our table of the survey's summary files."""
    shares: dict[tuple[str, str, int], dict[str, float]] = defaultdict(dict)
    for row in rows(folder / "time_at_activity.csv"):
        key = row["stratum"], row["day_type"], int(row["hour"])
        shares[key][row["category"]] = float(row["weighted_pct"])
    at_home = {
        (row["analysis"].split("_")[0], row["stratum"]): round(float(row["pct_home"]) * 100)
        for row in rows(folder / "tewhere_validation.csv")
    }
    minutes, groups = [], {}
    for stratum, name in GROUPS.items():
        episodes, time, weight = Counter(), Counter(), 0.0
        for row in rows(folder / f"activity_frequency_{stratum}.csv"):
            what = category(row["trcode"])
            episodes[what] += int(row["n_episodes"])
            time[what] += int(row["n_episodes"]) * float(row["mean_duration_min"])
            weight += float(row["total_weighted_min"])
        minutes.append(weight)
        others = sorted(set(episodes) - set(survey.CATEGORIES))
        groups[name] = {
            "work_at_home": at_home["D4", stratum],
            "minutes": {c: round(time[c] / episodes[c]) for c in survey.CATEGORIES if episodes[c]},
            "other": {
                c: [share, round(time[c] / episodes[c])]
                for c, share in zip(others, parts([episodes[c] for c in others]), strict=True)
                if share
            },
        }
        for kind in ("weekday", "weekend"):
            groups[name][kind] = [
                parts([shares[stratum, kind, h][c] for c in survey.CATEGORIES]) for h in range(24)
            ]
    for name, share in zip(groups, parts(minutes), strict=True):
        groups[name] = {"share": share, **groups[name]}
    return {
        "source": "U.S. Bureau of Labor Statistics, American Time Use Survey, 2022-2023"
        " (https://www.bls.gov/tus/), summarised by group: shares of people in parts of 10,000 who"
        " do each category at half past each hour, of days that begin at 04:00; mean minutes of an"
        " episode; what 'other' is made of, by share of episodes and mean minutes",
        "categories": list(survey.CATEGORIES),
        "eat_at_home": at_home["D5", "all"],
        "exercise_at_home": at_home["D6", "all"],
        "groups": groups,
    }


def written(table: dict[str, Any]) -> str:
    """Write the table with a line per hour."""
    text = json.dumps(table, indent=1)
    lines, depth = [], 0
    for line in text.splitlines():
        inner = line.strip()
        if depth and lines:
            space = " " if lines[-1][-1] == "," and not inner.startswith("]") else ""
            lines[-1] += space + inner
            depth += inner.endswith("[") - inner.startswith("]")
        else:
            lines.append(line)
            opens = inner.endswith("[") and not inner.startswith(('"weekday"', '"weekend"'))
            depth = int(opens)
    return "\n".join(lines) + "\n"


def lived(
    group: str, people: int, weeks: int
) -> Iterator[tuple[str, Sequence[survey.SurveyEpisode]]]:
    """Yield the kind of day and the episodes of each day of some people, from 4 to 4 o'clock."""
    table = survey.group(group)
    for person in range(people):
        key = stream_key(4, f"users.person_{person}", "population")
        state = survey.first_state(table, Draws(key, 0), MONDAY)
        for ordinal in range(MONDAY, MONDAY + 7 * weeks):
            blocks, state = survey.draw_episodes(table, Draws(key, ordinal), ordinal, state)
            yield "weekend" if date.fromordinal(ordinal).weekday() > 4 else "weekday", blocks


def measured(group: str, people: int, weeks: int) -> dict[str, list[Counter[str]]]:
    """Count what people do at half past each hour, by kind of day."""
    counts = {kind: [Counter() for _ in range(24)] for kind in ("weekday", "weekend")}
    for kind, blocks in lived(group, people, weeks):
        k = 0
        for hour in range(4, 28):
            while blocks[k].end <= hour * 3600 + 1800:
                k += 1
            counts[kind][hour % 24][blocks[k].category] += 1
    return counts


def held_out(folder: Path, people: int) -> dict[str, list[tuple[float, float, float]]]:
    """Score the hours at which the survey's activities begin, which the model wasn't made of.

    As in the survey's table, a begin counts by the minutes of its episode.

    Returns:
        By activity, for each group of people: the negative log likelihood [nats] of a begin under
        the simulated people, under the hours' shares of time, and under the survey itself.
    """
    wanted: dict[tuple[str, str], np.ndarray] = defaultdict(lambda: np.zeros(24))
    for row in rows(folder / "time_of_day_distributions.csv"):
        share = float(row["pct_of_category"]) / 100
        wanted[row["stratum"], row["category"]][int(row["hour"])] = share
    found = defaultdict(list)
    for stratum, group in GROUPS.items():
        begins = defaultdict(lambda: np.ones(24))  # nothing is impossible
        for _, blocks in lived(group, people, 1):
            for begin, block in zip([4 * 3600, *(b.end for b in blocks)], blocks, strict=False):
                begins[block.category][begin // 3600 % 24] += (block.end - begin) / 60
        for (of, category), shares in wanted.items():
            if of != stratum or not shares.any():
                continue
            by_day = [survey.shares(group, kind) for kind in ("weekday", "weekend")]
            weekday, weekend = ([hour[category] for hour in hours] for hours in by_day)
            times = 5 * np.array(weekday) + 2 * np.array(weekend) + 1e-6
            scores = [
                -float(shares @ np.log(np.maximum(chances / chances.sum(), 1e-300)))
                for chances in (begins[category], times, shares)
            ]
            found[category].append((scores[0], scores[1], scores[2]))
    return found


def show_held_out(folder: Path, people: int) -> None:
    """Print the scores of `held_out`, means over the groups."""
    found = held_out(folder, people)
    print("nats of a begin: simulated, by shares of time, by the survey; any hour alike: 3.178")
    means = {name: np.mean(scores, axis=0) for name, scores in sorted(found.items())}
    for name, scores in {**means, "all": np.mean(list(means.values()), axis=0)}.items():
        print(f"{name:12}" + "".join(f"{score:9.3f}" for score in scores))


def compare(people: int, weeks: int) -> list[dict[str, Any]]:
    """Return a row for each group, kind of day and hour."""
    result = []
    for group in survey.groups():
        counts = measured(group, people, weeks)
        for kind, by_hour in counts.items():
            for hour, count in enumerate(by_hour):
                wanted = survey.shares(group, kind)[hour]
                total = sum(count.values())
                ours = {c: count[c] / total for c in survey.CATEGORIES}
                apart = {c: ours[c] - wanted[c] for c in survey.CATEGORIES}
                result.append(
                    {
                        "group": group, "day": kind, "hour": hour, "ours": ours, "survey": wanted,
                        "apart": apart, "tv": sum(map(abs, apart.values())) / 2,
                    }
                )  # fmt: skip
    return result


def show(found: list[dict[str, Any]]) -> None:
    """Print the table."""
    print(f"{'group':<17}{'day':<9}{'TV median':>10}{'worst':>8}   largest difference per activity")
    for group in survey.groups():
        for kind in ("weekday", "weekend"):
            some = [r for r in found if (r["group"], r["day"]) == (group, kind)]
            tvs = [r["tv"] for r in some]
            far = {c: max(abs(r["apart"][c]) for r in some) for c in survey.CATEGORIES}
            told = " ".join(f"{c} {v:.3f}" for c, v in far.items())
            print(f"{group:<17}{kind:<9}{statistics.median(tvs):>10.4f}{max(tvs):>8.4f}   {told}")
    tvs = [r["tv"] for r in found]
    print(f"{'all':<26}{statistics.median(tvs):>10.4f}{max(tvs):>8.4f}")


def draw(found: list[dict[str, Any]], path: Path) -> None:
    """Draw shares by hour, ours as lines over the survey's as dots."""
    import matplotlib.pyplot as plt

    groups = survey.groups()
    size = 13, 3 * len(groups)
    figure, axes = plt.subplots(len(groups), 2, figsize=size, sharex=True, sharey=True)
    for i, group in enumerate(groups):
        for j, kind in enumerate(("weekday", "weekend")):
            some = [r for r in found if (r["group"], r["day"]) == (group, kind)]
            for c in survey.CATEGORIES:
                (line,) = axes[i, j].plot(range(24), [r["ours"][c] for r in some], lw=1.2, label=c)
                axes[i, j].plot(
                    range(24), [r["survey"][c] for r in some], "o", ms=3, color=line.get_color()
                )
            axes[i, j].set_title(f"{group}, {kind} (lines: simulated, dots: survey)", fontsize=9)
    axes[0, 1].legend(fontsize=7, ncol=3)
    figure.supxlabel("hour of the day")
    figure.supylabel("share of people")
    figure.tight_layout()
    figure.savefig(path, dpi=110)


SHARES = {"living_room": 0.4, "bedroom": 0.3, "kitchen": 0.15, "bathroom": 0.05, "away": 0.1}
DWELL_S = 1800


def rooms_over_time(days: int, seeds: int) -> list[tuple[int, float, float]]:
    """Return days, the mean error of a share over rooms and seeds, and the one to be expected."""
    errors = defaultdict(list)
    for seed in range(seeds):
        user = {"type": "room_sampling", "shares": SHARES}
        stored = fleet2d.run(
            {
                "simulation": {"start": "2026-01-05", "duration": f"{days} d", "seed": seed},
                "floorplan": {"type": "bundled"},
                "users": {"ana": user},
            }
        )
        kinds = np.array([room.type for room in stored.plan.rooms] + ["away"])
        rooms = kinds[stored.path("ana", every=timedelta(minutes=1)).room]
        for day in (2**k for k in range(days.bit_length())):
            told = rooms[: day * 1440]
            told = told[np.isin(told, list(SHARES))]
            errors[day] += [(np.mean(told == room) - share) ** 2 for room, share in SHARES.items()]
    spread = 1 + (2 / 3) ** 2
    variance = statistics.mean(p * (1 - p) for p in SHARES.values()) * spread * DWELL_S / 86_400
    return [
        (day, math.sqrt(statistics.mean(squares)), math.sqrt(variance / day))
        for day, squares in errors.items()
    ]


def show_measures(data: Path, days: int, seed: int) -> None:
    """Print the measures of the logs' days and of the personas', and those of fitted personas."""
    print(f"personas: {days} days from Monday, 2026-01-05, seed {seed}, bundled home, furnished")
    print("means per day or night; medians of bathroom min and stays min")
    print("KS of the lengths of stays from each log, and of those in living rooms")
    homes = {name: traces_of_log(data / path) for name, path in (LOGS | UNSEEN).items()}
    real = {name: lengths_of(homes[name]) for name in (*REAL, *UNSEEN)}
    columns = [name.replace("_", " ") for name in Measures._fields]
    columns += ["living min", "bath < 1 min"]
    columns += [f"{what} {name}" for what in ("KS", "LR") for name in real]
    print(f"{'':30}" + "".join(f"{column:>15}" for column in columns))
    for name, traces in homes.items():
        print_measures(name, traces, real)
    calm = {"needs": {"pick_up": None, "freshen_up": None}}
    for name in bundled_names():
        print_measures(name, traces_of_persona(name, days, seed), real)
        plain = traces_of_persona({"extends": name, **calm}, days, seed)
        print_measures(f"{name}, no short stays", plain, real)
    for name, path in LOGS.items():
        log = read_log(data / path)
        assert isinstance(log, ActivityLog)
        print(f"\n{name}: fitted")
        print("\n".join(table(validate(read_timeline(log)))))


class Lengths(NamedTuple):
    """The sorted lengths of the stays of a home, and of those in its living room [min]."""

    stays_min: F64
    living_min: F64


def lengths_of(traces: tuple[RoomTrace, ActivityTrace]) -> Lengths:
    """Return the lengths of the stays of a person."""
    living = [s.length / 60 for s in grouped_stays(traces[0]) if s.kind == "living_room"]
    return Lengths(np.sort(measure(*traces).stays_min), np.sort(living))


def print_measures(
    name: str, traces: tuple[RoomTrace, ActivityTrace], real: Mapping[str, Lengths]
) -> None:
    """Print a row of the table of measures."""
    found = measure(*traces)
    cells = [
        float((np.median if key in MEDIANS else np.mean)(values)) if values else math.nan
        for key, values in found._asdict().items()
    ]
    living = lengths_of(traces).living_min
    cells += [
        float(np.median(living)) if len(living) else math.nan,
        sum(m < 1 for m in found.bathroom_min) / len(found.bathroom_min),
        *(ks_distance(np.sort(found.stays_min), log.stays_min) for log in real.values()),
        *(
            ks_distance(living, log.living_min) if len(living) and len(log.living_min) else math.nan
            for log in real.values()
        ),
    ]
    print(f"{name:30}" + "".join(f"{cell:>15.2f}" for cell in cells))


def show_visits(data: Path, days: int, seed: int) -> bool:
    """Print the table of visits; return whether every persona is within the real homes' spread."""
    homes = {name: traces_of_log(data / path)[0] for name, path in LOGS.items()}
    lives = {name: traces_of_persona(name, days, seed)[0] for name in bundled_names()}
    print(f"personas: {days} days from Monday, 2026-01-05, seed {seed}, bundled home, furnished")
    print("per day: mean [lowest to highest day]")
    print(f"{'':18}" + "".join(f"{name.replace('_', ' '):>20}" for name in Visits._fields))
    counted = {name: count_visits(*trace) for name, trace in (homes | lives).items()}
    for name, visits in counted.items():
        cells = [f"{statistics.mean(v):.1f} [{min(v)} to {max(v)}]" for v in visits]
        print(f"{name:18}" + "".join(f"{cell:>20}" for cell in cells))
    low, high = spread([counted[name] for name in REAL])
    cells = [f"{a} to {b}" for a, b in zip(low, high, strict=True)]
    print(f"{'spread, real homes':18}" + "".join(f"{cell:>20}" for cell in cells))
    show_dwell(homes | lives)
    show_hours(days, seed)
    good = True
    for name in bundled_names():
        for field, a, b, values in zip(Visits._fields, low, high, counted[name], strict=True):
            if not a <= statistics.mean(values) <= b:
                print(f"{name}: {field} {statistics.mean(values):.1f} is outside {a} to {b}")
                good = False
    return good


def show_dwell(traces: dict[str, RoomTrace]) -> None:
    """Print visits per day and the quartiles of their lengths, by kind of room."""
    print("\nvisits a day x median minutes [quartiles]")
    for name, (trace, kinds) in traces.items():
        found = stays(trace, kinds)
        print(name)
        for kind in sorted({stay.kind for stay in found}):
            minutes = [stay.length / 60 for stay in found if stay.kind == kind]
            low, middle, high = np.quantile(minutes, (0.25, 0.5, 0.75))
            count = len(minutes) * 86_400 / len(trace)
            print(f"  {kind:14}{count:6.1f} x {middle:6.1f} [{low:.1f} to {high:.1f}]")


def show_hours(days: int, seed: int) -> None:
    """Print how far personas' hours are from the survey's group that is most like them."""
    print("\ntotal variation from the survey's group, per hour of weekdays: median, worst")
    print("(personas claim no group; `population` does: see compare)")
    for name, group in LIKE.items():
        life = Life(bundled_persona(name), seed, "users.ana")
        counts = [Counter[str]() for _ in range(24)]
        for ordinal in range(MONDAY, MONDAY + days):
            if date.fromordinal(ordinal).weekday() > 4:
                continue
            for episode in without_interruptions(life.day(ordinal)):
                first = -(-(episode.begin - 1800) // 3600)
                for hour in range(first, (episode.end - 1 - 1800) // 3600 + 1):
                    counts[hour % 24][CATEGORY_OF.get(episode.activity, "other")] += 1
        tvs = []
        for hour, count in enumerate(counts):
            wanted, total = survey.shares(group, "weekday")[hour], sum(count.values())
            tvs.append(sum(abs(count[c] / total - wanted[c]) for c in survey.CATEGORIES) / 2)
        print(f"{name:18}{group:18}{statistics.median(tvs):8.3f}{max(tvs):8.3f}")


def draw_rooms(found: list[tuple[int, float, float]], path: Path) -> None:
    """Draw the error of the shares over time."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(6, 4))
    days, errors, expected = zip(*found, strict=True)
    axes.loglog(days, errors, "o-", label="simulated")
    axes.loglog(days, expected, "--", label="standard error of independent visits")
    axes.set(xlabel="days", ylabel="error of a room's share of time (root mean square)")
    axes.legend()
    figure.tight_layout()
    figure.savefig(path, dpi=110)


def time_planning() -> None:
    """Print how long the planning of a day takes."""
    for name in bundled_names():
        print(f"a day of {name:<16} {planning_ms(name):6.3f} ms")


def planning_ms(persona: str) -> float:
    """Return how long the planning of a day of a persona takes, mean of a year [ms]."""
    life = Life(bundled_persona(persona), 4, "users.ana")
    life.day(MONDAY - 1)
    began = time.process_time()
    for ordinal in range(MONDAY, MONDAY + 365):
        life.day(ordinal)
    return 1e3 * (time.process_time() - began) / 365


def time_month() -> None:
    """Print how long the base month takes with a schedule, and with routines."""
    best = month_times(bundled_names())
    for name, took in best.items():
        more = took / best["schedule"] - 1
        print(f"month, {name:<16} {took:6.3f} s of processor time, {more:+.0%}")


def month_times(personas: Sequence[str], repeats: int = 5) -> dict[str, float]:
    """Return how long the base month takes with a schedule, and with personas, in turn [s]."""
    best: dict[str, float] = {}
    for turn in range(repeats + 1):
        for name in ("schedule", *personas):
            content = fleet2d.load_scenario("bundled:rounds").resolved()
            if name != "schedule":
                content["users"] = {"ana": {"type": "routine", "persona": name}}
            with tempfile.TemporaryDirectory() as folder:
                began = time.process_time()
                fleet2d.run(content, out=f"{folder}/run")
                took = time.process_time() - began
            if turn:
                best[name] = min(best.get(name, took), took)
    return best


def time_crowd(users: int, days: int) -> None:
    """Print how long so many people take, and how much memory."""
    personas = bundled_names()
    content = {
        "simulation": {"start": "2026-01-05", "duration": f"{days} d", "seed": 4},
        "floorplan": {"type": "bundled", "furnish": True},
        "users": {
            f"user_{i}": {"type": "routine", "persona": personas[i % len(personas)]}
            for i in range(users)
        },
    }
    with tempfile.TemporaryDirectory() as folder:
        began, cpu = time.perf_counter(), time.process_time()
        fleet2d.run(content, out=f"{folder}/run")
        took, cpu = time.perf_counter() - began, time.process_time() - cpu
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    print(
        f"{users} users, {days} days: {took:.1f} s, {cpu:.1f} s of processor time, {memory:.2f} GB"
    )


def parsed() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    commands = parser.add_subparsers(dest="command", required=True)
    one = commands.add_parser("compare")
    one.add_argument("--people", type=int, default=1000, help="of each group")
    one.add_argument("--weeks", type=int, default=1)
    one.add_argument("--figure", type=Path)
    one.add_argument("--json", type=Path, help="write the rows to this file, too")
    two = commands.add_parser("derive")
    two.add_argument("folder", type=Path)
    six = commands.add_parser("held-out")
    six.add_argument("--data", type=Path, required=True, help="the folder of the survey")
    six.add_argument("--people", type=int, default=1000, help="of each group")
    for name in ("visits", "measures"):
        five = commands.add_parser(name)
        five.add_argument("--data", type=Path, required=True, help="the folder of the logs")
        five.add_argument("--days", type=int, default=28)
        five.add_argument("--seed", type=int, default=4)
    three = commands.add_parser("rooms")
    three.add_argument("--days", type=int, default=64)
    three.add_argument("--seeds", type=int, default=8)
    three.add_argument("--figure", type=Path)
    four = commands.add_parser("speed")
    four.add_argument("--users", type=int, default=50)
    four.add_argument("--days", type=int, default=30)
    return parser.parse_args()


def main() -> None:
    """Do what is asked for."""
    arguments = parsed()
    if arguments.command == "visits":
        if not show_visits(arguments.data, arguments.days, arguments.seed):
            raise SystemExit(1)
    elif arguments.command == "measures":
        show_measures(arguments.data, arguments.days, arguments.seed)
    elif arguments.command == "held-out":
        show_held_out(arguments.data, arguments.people)
    elif arguments.command == "rooms":
        rooms = rooms_over_time(arguments.days, arguments.seeds)
        print("days   error of a share   to be expected")
        for day, error, expected in rooms:
            print(f"{day:>4}   {error:>16.4f}   {expected:>14.4f}")
        if arguments.figure:
            draw_rooms(rooms, arguments.figure)
    elif arguments.command == "speed":
        time_planning()
        time_month()
        time_crowd(arguments.users, arguments.days)
    elif arguments.command == "derive":
        survey.TABLE.write_text(written(derive(arguments.folder)), encoding="utf-8")
    else:
        show_compared(arguments)


def show_compared(arguments: argparse.Namespace) -> None:
    """Print how far people are from the survey, and write rows and a figure if asked for."""
    found = compare(arguments.people, arguments.weeks)
    show(found)
    if arguments.json:
        arguments.json.write_text(json.dumps(found, indent=1))
    if arguments.figure:
        draw(found, arguments.figure)


if __name__ == "__main__":
    main()
