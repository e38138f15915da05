"""Which conclusions about when to ask stand, whatever the numbers of people's answers are.

    python benchmarks/timing_ranges.py [--samples 128] [--lives 4] [--pictures docs/images]

Most numbers of how people answer are our own guesses, each with a range, which
docs/how-to/interactions.md has. This draws all of them at once from their ranges, by a Sobol'
sequence, and lives the same lives under each policy with each draw. It prints in how many draws
each conclusion of docs/results/timing.md holds, and what part of the variance of the difference is
due to each number: first-order Sobol' indices, from a polynomial chaos expansion of second degree
without products (Sudret 2008). Draws timing_ranges.png.

Then it repeats a published finding: when users of an app that notifies them once a day at 11:00
disengage (no use in seven days or more), of whom 24 % stay, 19 % leave slowly and 57 % fast
(PMC7762688). The kinds of people have those shares here; the days are the model's.

A life here is that of a persona, with the requests, answers, attitudes and policies of the
simulator, but without the home: who is at home is met at once.
"""

import argparse
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from datetime import datetime, timedelta
from functools import cache, partial
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure
from scipy.special import expit
from scipy.stats import qmc

from fleet2d.algorithms import timing
from fleet2d.algorithms.timing import (
    Asked,
    FixedTimes,
    LogisticTiming,
    ThompsonTiming,
    TimingPolicy,
    TwoStageTiming,
)
from fleet2d.interactions.answers import KIND_LOGITS, LOADS, Answers, Circumstances
from fleet2d.interactions.interaction import Interaction, Outcome, Request, RequestQueue
from fleet2d.kernels import F64
from fleet2d.routines.life import Life
from fleet2d.routines.persona import bundled_persona
from fleet2d.runtime.determinism import Draws, stream_key

PERSONAS = ("retired", "works_from_home", "works_outside", "student", "child", "night_shift")
START = datetime(2026, 1, 5)
DAYS = 28
MINUTES = 1440
STEP = timedelta(minutes=10)
# As of the behavior `interact`: between two draws for a request, and after an answer but yes.
LOOK, AGAIN = timedelta(minutes=20), timedelta(minutes=10)
USEFUL_HOURS = (9, 10, 11, 17, 18, 19, 20)
# The requests of examples/studies/base/timing.yaml.
REQUESTS = {
    "pill": {"do": "remind", "at": ["08:00", "20:00"], "within": "3 h", "worth": 5},
    "music": {"do": "offer", "every": "4 h", "within": "4 h", "worth": 2},
}
POLICIES: dict[str, tuple[TimingPolicy | None, range]] = {
    "as soon as it is due": (None, range(24)),
    "fixed times": (FixedTimes(hours=USEFUL_HOURS), range(24)),
    "greedy logistic": (LogisticTiming(), range(24)),
    "Thompson": (ThompsonTiming(), range(24)),
    "Thompson by day": (ThompsonTiming(), range(8, 21)),
    "two stages": (TwoStageTiming(), range(24)),
}
# What docs/results/timing.md concludes: that the first policy is worth more than the second.
CONCLUSIONS = (
    ("Thompson", "as soon as it is due"),
    ("fixed times", "greedy logistic"),
    ("Thompson", "greedy logistic"),
    ("Thompson by day", "fixed times"),
    ("two stages", "fixed times"),
    ("two stages", "Thompson"),
)


class Number(NamedTuple):
    """A number of ours: its default, and its range."""

    name: str
    default: float
    low: float
    high: float


NUMBERS = (
    Number("notice.asleep", -4, -5, -2),
    Number("activity.base", 1.2, 0.2, 2.2),
    Number("activity.loads, times", 1, 0.5, 1.5),
    Number("importance of a reminder", 0.6, -0.4, 1.6),
    Number("importance of an offer", -0.4, -1.4, 0.6),
    Number("importance.worth", 1.5, 0.5, 2.5),
    Number("recency.at_once", -1.5, -3, 0),
    Number("burden.each", -0.35, -0.7, 0),
    Number("burden.tolerance", 4, 2, 8),
    Number("attitude.novelty", 0.7, 0, 1.4),
    Number("attitude.habit", 0.8, 0, 1.6),
    Number("attitude.trust", 0.8, 0, 1.6),
    Number("attitude.annoyance", -0.4, -0.8, 0),
    Number("months.annoyed_by", 0.4, 0.1, 0.8),
    Number("months.annoyance_lasts [d]", 2, 0.5, 7),
    Number("months.novelty_lasts [d]", 14, 5, 60),
    Number("sends_away_at", 3, 1.5, 6),
    Number("gives_up_below", 0.1, 0, 0.3),
)


def answers_with(values: F64) -> Answers:
    """Return a person's answers with values of all numbers of ours, in their order."""
    given = {number.name: float(value) for number, value in zip(NUMBERS, values, strict=True)}

    def of(part: str) -> dict[str, float]:
        starts = (name.split(".") for name in given if name.startswith(f"{part}."))
        return {key: given[f"{part}.{key}"] for _, key in starts if " " not in key}

    loads = {name: load * given["activity.loads, times"] for name, load in LOADS.items()}
    kinds = {
        **KIND_LOGITS,
        "remind": given["importance of a reminder"],
        "offer": given["importance of an offer"],
    }
    months = {
        "annoyed_by": given["months.annoyed_by"],
        "annoyance_lasts": timedelta(days=given["months.annoyance_lasts [d]"]),
        "novelty_lasts": timedelta(days=given["months.novelty_lasts [d]"]),
    }
    return Answers.model_validate(
        {
            "notice": of("notice"),
            "activity": {"base": given["activity.base"], "loads": loads},
            "importance": {"kinds": kinds, "worth": given["importance.worth"]},
            "recency": of("recency"),
            "burden": of("burden"),
            "attitude": of("attitude"),
            "months": months,
            "sends_away_at": given["sends_away_at"],
            "gives_up_below": given["gives_up_below"],
        }
    )


class Minutes(NamedTuple):
    """What a person does in each minute: the number of the activity, and of its room; -1: out."""

    activity: list[int]
    room: list[int]
    activities: list[str]
    rooms: list[str]


@cache
def lived(persona: str, seed: int, days: int) -> Minutes:
    """Return a life of a persona."""
    person = bundled_persona(persona)
    life = Life(person, seed, "users.ana")
    names = sorted(person.used_activities)
    kinds = sorted({person.activity(name).rooms[0] for name in names})
    doing = np.zeros(days * MINUTES, np.int64)
    for day in range(-1, days):
        for episode in life.day(START.toordinal() + day):
            begin, end = (max(0, day * MINUTES + at // 60) for at in episode[1:3])
            doing[begin:end] = names.index(episode.activity)
    rooms = np.array(
        [
            -1 if person.activity(name).away else kinds.index(person.activity(name).rooms[0])
            for name in names
        ]
    )
    return Minutes(doing.tolist(), rooms[doing].tolist(), names, kinds)


class Encounters:
    """A life with a robot that follows a policy."""

    def __init__(
        self,
        policy: str,
        answers: Answers,
        seed: int,
        requests: Mapping[str, Mapping[str, Any]] = REQUESTS,
        days: int = DAYS,
    ) -> None:
        self.minutes = lived(PERSONAS[seed % len(PERSONAS)], seed, days)
        self.answers = answers
        self.seed = seed
        self.state = answers.months.begin(START)
        kind, self.hours = POLICIES[policy]
        wanted = {name: Interaction(to="ana", **keys) for name, keys in requests.items()}
        self.queue = RequestQueue(wanted, START)
        self.policies: dict[str, TimingPolicy] = {}
        for name, interaction in wanted.items():
            if kind is not None:
                self.policies[name] = kind.model_copy(deep=True)
                self.policies[name].start(len(self.minutes.rooms))
                self.policies[name].worth = interaction.worth
        self.chances: dict[str, F64] = {}
        self.draws = stream_key(seed, "robots.astro", "timing")
        self.set_aside: dict[str, datetime] = {}
        self.best: dict[str, tuple[datetime, float]] = {}
        self.left_alone = START
        self.gave_none_in = -1
        self.is_over = False
        self.value = 0.0
        self.accepted_on: list[int] = []

    def live(self) -> float:
        """Return the value of what is accepted in all days."""
        time = START
        for minute in range(0, len(self.minutes.room), int(STEP / timedelta(minutes=1))):
            time = START + timedelta(minutes=minute)
            self.queue.advance(time)
            room = self.minutes.room[minute]
            if (
                not self.queue.open
                or room < 0
                or self.is_over
                or time < self.left_alone
                or time.hour not in self.hours
            ):
                continue
            if room != self.gave_none_in:
                self.gave_none_in = -1
                for request in self.queue.ready(time):
                    if self.is_good(request, time, room):
                        self.ask(request, time, minute)
                        break
        return self.value

    def is_good(self, request: Request, time: datetime, room: int) -> bool:
        """Draw whether to ask now, as `interact` does."""
        if not self.policies:
            return True
        if self.set_aside.get(request.name, time) > time:
            return False
        self.set_aside[request.name] = time + LOOK
        chances = self.chances.get(request.name)
        chance = 1.0 if chances is None else float(chances[time.hour][room])
        since, best = self.best.get(request.name, (request.since, 0.0))
        best = best if since == request.since else 0.0
        chance = max(0.0, (chance - best) / (1 - best)) if best < 1 else 0.0
        number = int((time - START) / STEP) * 2 + (request.name == "music")
        is_drawn = Draws(self.draws, number).uniform() < chance
        self.best[request.name] = request.since, 0.0 if is_drawn else best + chance * (1 - best)
        return is_drawn

    def ask(self, request: Request, time: datetime, minute: int) -> None:
        """Ask, and let the robot and the person learn from it."""
        room = self.minutes.room[minute]
        now = Circumstances(
            time=time, name=request.name, interaction=request.interaction,
            activity=self.minutes.activities[self.minutes.activity[minute]],
            room=self.minutes.rooms[room], company=0, is_moving=False, is_lying=False,
            distance=request.interaction.distance, in_sight=True, from_behind=False,
        )  # fmt: skip
        months = self.answers.months
        months.pass_time(self.state, time)
        reply = self.answers.reply(now, self.state, self.seed, "users.ana", minute * 60)
        outcome = Outcome.IGNORED if reply is None else reply.outcome
        if reply is not None:
            months.addressed(self.state, request.name, outcome, reply.willingness)
        value = request.value_at(time)
        later = time + (timedelta(0) if reply is None else reply.later)
        self.queue.settle(request, outcome, time, later)
        asked = Asked("ana", request.name, time.hour, room, "" if reply is None else str(outcome))
        for name, policy in self.policies.items():
            (policy.learn if name == request.name else policy.learn_from_other)(asked)
            self.chances[name] = policy.chances()
        if outcome == Outcome.ACCEPTED:
            self.value += value
            self.accepted_on.append(minute // MINUTES)
            return
        pauses = {
            Outcome.SENT_AWAY: self.answers.away_for,
            Outcome.BANNED: self.answers.away_for,  # it may meet her in another room
            Outcome.SWITCHED_OFF: self.answers.off_for,
        }
        self.left_alone = time + pauses.get(outcome, AGAIN)
        self.is_over = outcome == Outcome.SWITCHED_OFF and self.answers.has_enough(self.state)
        if outcome == Outcome.IGNORED:
            self.gave_none_in = room


def values_of(numbers: F64, lives: int) -> list[float]:
    """Return the mean value of some lives under each policy."""
    timing._logistic = expit  # many times as fast; its last bits differ between machines
    answers = answers_with(numbers)
    return [
        float(np.mean([Encounters(policy, answers, k).live() for k in range(lives)]))
        for policy in POLICIES
    ]


def drop_out(people: int, days: int = 90) -> None:
    """Print when people of each kind disengage from one notification a day, beside the paper."""
    daily = {"app": {"do": "offer", "at": ["11:00"], "within": "12 h", "worth": 1}}
    kinds = {"steady": 0.2418, "fading": 0.1913, "leaving": 0.5668}
    ends: dict[str, list[int]] = {}
    for kind, share in kinds.items():
        answers = Answers.model_validate({"months": {"type": kind}})
        for person in range(round(people * share)):
            life = Encounters("as soon as it is due", answers, person, daily, days)
            life.live()
            used = [-1, *life.accepted_on, days + 7]
            end = next(a + 1 for a, b in pairwise(used) if b - a > 7)
            ends.setdefault(kind, []).append(end)
    found = np.array([end for each in ends.values() for end in each])
    print(f"disengaged, of {len(found)} people notified once a day (app: half on day 22)")
    for day in (7, 22, 45, 90):
        of_kind = ", ".join(f"{k} {np.mean(np.array(e) < day):.0%}" for k, e in ends.items())
        print(f"  by day {day}: {np.mean(found < day):.0%} ({of_kind})")
    print(f"  half on day {np.median(found):.0f}")


def indices_of(draws: F64, differences: F64) -> tuple[F64, float]:
    """Return Sobol' indices of a difference, and the share of its variance told in held-out draws.

    Args:
        draws: The numbers, scaled to 0 to 1: (draws, numbers).
        differences: The difference in each draw.
    """
    x = 2 * draws - 1
    count = x.shape[1]
    # Legendre polynomials of unit variance.
    terms = np.hstack([np.sqrt(3) * x, np.sqrt(5) / 2 * (3 * x**2 - 1)])
    wanted = differences - differences.mean()

    def fit(rows: F64, ridge: float) -> F64:
        matrix = terms[rows].T @ terms[rows] + ridge * np.eye(terms.shape[1])
        return np.linalg.solve(matrix, terms[rows].T @ wanted[rows])

    def error(ridge: float) -> float:
        fold = np.arange(len(x)) % 8
        parts = [wanted[fold == k] - terms[fold == k] @ fit(fold != k, ridge) for k in range(8)]
        return float(np.concatenate(parts).var())

    ridge = min((10.0**power for power in np.arange(-1, 5, 0.5)), key=error)
    squares = fit(np.full(len(x), True), ridge) ** 2
    return squares.reshape(2, count).sum(0) / wanted.var(), 1 - error(ridge) / float(wanted.var())


def draw(differences: list[F64], indices: list[F64], path: Path) -> None:
    """Draw the differences over the draws, and what they are due to."""
    names = [f"{one} −\n{other}" for one, other in CONCLUSIONS]
    figure = Figure(figsize=(11, 5.6), dpi=100, layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=(1, 1.1))
    left.boxplot(differences, orientation="horizontal", whis=(5, 95), showfliers=False)
    left.set_yticks(range(1, len(names) + 1), names, fontsize=8)
    left.axvline(0, color="#999999", lw=1)
    left.invert_yaxis()
    left.set_xlabel("difference of values: median, quartiles, 5 to 95 % of the draws")
    left.spines[["top", "right"]].set_visible(False)
    image = right.imshow(np.array(indices), cmap="Blues", vmin=0, vmax=1, aspect="auto")
    right.set_yticks(range(len(names)), [])
    labels = [number.name for number in NUMBERS]
    right.set_xticks(range(len(NUMBERS)), labels, rotation=60, ha="right", fontsize=8)
    figure.colorbar(image, ax=right, label="first-order Sobol' index")
    figure.savefig(path)


def main() -> None:
    """Live all lives, print the tables and draw the picture."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--samples", type=int, default=128, help="draws, a power of two")
    parser.add_argument("--lives", type=int, default=4)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--pictures", type=Path)
    arguments = parser.parse_args()
    low, high = (np.array([getattr(n, end) for n in NUMBERS]) for end in ("low", "high"))
    draws = qmc.Sobol(len(NUMBERS), rng=4).random(arguments.samples)
    defaults = np.array([number.default for number in NUMBERS])
    with ProcessPoolExecutor(arguments.workers) as pool:
        live = partial(values_of, lives=arguments.lives)
        at_defaults, *rows = pool.map(live, [defaults, *(low + draws * (high - low))], chunksize=8)
    values = dict(zip(POLICIES, np.array(rows).T, strict=True))
    print(f"value of {DAYS} days: at the defaults; median and 5 to 95 % of {len(rows)} draws")
    for (name, found), value in zip(values.items(), at_defaults, strict=True):
        spread = np.quantile(found, (0.5, 0.05, 0.95))
        print(f"  {name:22}{value:7.0f}{spread[0]:8.0f} ({spread[1]:.0f} to {spread[2]:.0f})")
    differences, indices = [], []
    print("in how many draws the first is worth more; which numbers that depends on")
    for one, other in CONCLUSIONS:
        differences.append(values[one] - values[other])
        index, explained = indices_of(draws, differences[-1])
        indices.append(index)
        most = [f"{NUMBERS[k].name} {index[k]:.2f}" for k in np.argsort(-index)[:4]]
        holds = f"{np.mean(differences[-1] > 0):4.0%}"
        print(f"  {one} > {other}: {holds}; {', '.join(most)} (held out: {explained:.2f})")
    drop_out(200)
    if arguments.pictures:
        draw(differences, indices, arguments.pictures / "timing_ranges.png")


if __name__ == "__main__":
    main()
