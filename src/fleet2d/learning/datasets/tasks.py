"""Tasks on a data set, each with its metrics and baselines, and the leaderboard that they fill.

- `rtp`: where a person is now, given the evidence so far, at each label with a stored belief: log
  loss [nats], accuracy and calibration error, over all and by the gap since the last sighting; log
  loss by household and by what was varied; and the difference in log loss to `routine`, over all
  and by gap, with its 95 % interval over homes.
- `ltp`: the share of time in each room, at home: total variation distance to the true shares.
- `next_room`: the kind of place where a person goes next, for each stay: log loss, accuracy.
- `time_to_return`: when a person who is away comes back: mean absolute error [min].
- `activity`: what a person does, given the kind of room and the hour: log loss, accuracy.

Baselines learn from `train` and are scored on another split.
"""

from collections import Counter
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from itertools import chain
from typing import Any, NamedTuple

import numpy as np

from fleet2d.algorithms.presence.belief import ANYONE, AWAY
from fleet2d.algorithms.presence.learned import Weights, shipped_weights
from fleet2d.configuration.problems import check_known
from fleet2d.errors import InputError, errors_as
from fleet2d.kernels import F64, I64, Bool
from fleet2d.learning.datasets.reader import Dataset
from fleet2d.learning.datasets.windows import PRIOR, Windows, predict, windows_of
from fleet2d.metrics.rtp_score import (
    GAP_ENDS,
    GAPS,
    GapMeasures,
    calibration_error,
    log_loss,
    top_k,
)
from fleet2d.studies.intervals import MeanEstimate, estimate

TRAIN = "train"
Scores = dict[str, tuple[dict[str, float], int]]
"""By model: its numbers by metric, and the number of cases that were scored."""
TUNED = "learned, tuned"
SMOOTHING = 1.0  # the pseudocount of each outcome in a baseline
# The largest number of parts of a split that are scored apart.
MAX_PARTS = 20
# The suffixes of the names of an interval's ends.
LOWER_END = " lower end"
UPPER_END = " upper end"


class LeaderboardEntry(NamedTuple):
    """A row of the leaderboard.

    Attributes:
        task: The task.
        model: The name of the model.
        scores: Numbers by metric.
        cases: Number of scored cases.
    """

    task: str
    model: str
    scores: Mapping[str, float]
    cases: int


def windows(data: Dataset, split: str, worker: int = 0, workers: int = 1) -> Iterator[Windows]:
    """Yield the windows of a split, as `windows_of`, shard by shard.

    Args:
        data: The data set.
        split: The split.
        worker: The number of this worker, from 0 on, which gets the shards whose number is `worker`
            modulo `workers`.
        workers: The number of workers that share the shards.
    """
    for number in range(worker, data.shards(split), workers):
        with _agreeing(data, split):
            yield from windows_of(data.shard(split, number))


@contextmanager
def _agreeing(data: Dataset, split: str) -> Iterator[None]:
    """Refuse a data set whose tables don't fit together, such as a label in a room without a row.

    Raises:
        InputError: A computation in the block failed, as none does with the tables of a run.
    """
    place = f"{data.root}: its tables of {split!r} don't fit together, make the data set again"
    with errors_as(InputError, place, of=(ArithmeticError, LookupError, ValueError)):
        yield


class Networks(NamedTuple):
    """The networks that `rtp` scores beside the stored beliefs and the shipped network.

    Attributes:
        models: Further networks, by name.
        tune: The number of days of each person on which a copy of the shipped network is tuned, and
            nothing is scored.
    """

    models: Mapping[str, Weights] = {}
    tune: int = 0


SHIPPED = Networks()


def leaderboard(
    data: Dataset,
    tasks: Sequence[str] = (),
    split: str = "test",
    networks: Networks = SHIPPED,
) -> list[LeaderboardEntry]:
    """Score the baselines of tasks on a split.

    Args:
        data: The data set.
        tasks: Names of tasks; none: all.
        split: The split to score on.
        networks: Further networks that `rtp` scores.

    Raises:
        InputError: There is no such task or split, or networks are tuned without torch.
    """
    for task in tasks:
        check_known(task, "task", TASKS, InputError)
    names = tasks or [t for t in TASKS if t == "rtp" or TRAIN in data.splits]
    if networks.tune and "rtp" in names:
        import fleet2d.learning.datasets.training  # noqa: F401 - an error before scores, without torch
    with _agreeing(data, split):
        return [
            LeaderboardEntry(task, model, scores, cases)
            for task in names
            for model, (scores, cases) in TASKS[task](data, split, networks).items()
        ]


def rtp_scores(belief: F64, truth: I64, gap: F64) -> dict[str, float]:
    """Return log loss, accuracy and calibration error, and log loss and accuracy by gap.

    Args:
        belief: float64 (n, places).
        truth: int64 (n,).
        gap: float64 (n,), minutes since the newest sighting.
    """
    loss = log_loss(belief, truth)
    hit = top_k(belief, truth, 1)
    scores = {
        "log_loss": float(loss.mean()),
        "accuracy": float(hit.mean()),
        "ece": calibration_error(belief, truth),
    }
    for measure, values in (("log_loss", loss), ("accuracy", hit)):
        for name, own in by_gap(gap):
            scores[f"{measure} {name}"] = float(values[own].mean())
    return scores


def by_gap(gap: F64) -> Iterator[tuple[str, Bool]]:
    """Yield each class of gaps that occurs, with a mask of its windows.

    Example:
        >>> [(name, own.tolist()) for name, own in by_gap(np.array([3.0, 300.0]))]
        [('1-5 min', [True, False]), ('over 4 h', [False, True])]
    """
    classes = np.searchsorted(GAP_ENDS, gap)
    for k in np.unique(classes).tolist():
        yield GAPS[k], classes == k


class SplitForecasts(NamedTuple):
    """Beliefs of models in the windows of a split.

    Attributes:
        beliefs: The beliefs by model, float64 (n, places); homes with fewer places have zeros.
        truth: int64 (n,), the place where the person was.
        gap: float64 (n,), minutes since the newest sighting.
        home: str (n,), the home.
        parts: The windows of each household and of each varied value: bool (n,).
    """

    beliefs: Mapping[str, F64]
    truth: I64
    gap: F64
    home: Any
    parts: Mapping[str, Bool]

    def over_homes(self, values: F64, own: Bool) -> MeanEstimate:
        """Return the mean over homes of the means of some windows, and its 95 % interval.

        Args:
            values: float64 (n,).
            own: bool (n,), the windows that count.
        """
        homes, number = np.unique(self.home[own], return_inverse=True)
        means = np.bincount(number, values[own]) / np.bincount(number)
        return estimate(means, {"home": homes.tolist()})


def forecasts(data: Dataset, split: str, networks: Networks = SHIPPED) -> SplitForecasts | None:
    """Return the stored beliefs of a split, those of `learned`, tuned or not, and of networks.

    None if the split has no windows.

    Raises:
        InputError: Networks are tuned without torch.
    """
    if networks.tune:
        from fleet2d.learning.datasets.training import fine_tune
    parts = [part for part in windows(data, split) if len(part.truth)]
    if not parts:
        return None
    weights = {"learned": shipped_weights(), **networks.models}
    beliefs: dict[str, list[F64]] = {}
    for k, whole in enumerate(parts):
        is_first = whole.day < whole.day[0] + networks.tune
        part = whole.rows(~is_first)
        parts[k] = part
        if networks.tune:
            weights[TUNED] = fine_tune(shipped_weights(), [whole.rows(is_first)])
        new = {n: predict(w, part) for n, w in weights.items() if n not in part.beliefs}
        for name, belief in {**part.beliefs, **new}.items():
            beliefs.setdefault(name, []).append(belief)
    counts = [len(part.truth) for part in parts]
    is_part = {}
    for label in sorted({label for part in parts for label in part.labels}):
        has_label = [label in part.labels for part in parts]
        is_part[label] = np.repeat(has_label, counts)
    return SplitForecasts(
        {name: _stacked(own) for name, own in beliefs.items()},
        np.concatenate([part.truth for part in parts]),
        np.concatenate([part.gap for part in parts]),
        np.repeat([part.home for part in parts], counts),
        is_part,
    )


def _stacked(beliefs: Sequence[F64]) -> F64:
    """Return beliefs in several homes as one; homes with fewer places have zeros."""
    whole = np.zeros((sum(map(len, beliefs)), max(belief.shape[1] for belief in beliefs)))
    begin = 0
    for belief in beliefs:
        end = begin + len(belief)
        whole[begin:end, : belief.shape[1]] = belief
        begin = end
    return whole


def _score_rtp(data: Dataset, split: str, networks: Networks) -> Scores:
    made = forecasts(data, split, networks)
    if made is None or not len(made.truth):
        return {}
    found: Scores = {}
    for name, belief in made.beliefs.items():
        scores = rtp_scores(belief, made.truth, made.gap)
        found[name] = {**scores, **_difference(made, name)}, len(made.truth)
    return found


def _difference(made: SplitForecasts, name: str) -> dict[str, float]:
    """Return log loss by household and by varied value, and its difference to `routine`.

    The difference is that over all windows and by gap, with its interval over homes.
    """
    loss = log_loss(made.beliefs[name], made.truth)
    prior = log_loss(made.beliefs[PRIOR], made.truth)
    every = np.ones(len(loss), np.bool_)
    parts = [(label, own) for label, own in made.parts.items() if own.any() and not own.all()]
    scores = {f"log_loss of {label}": float(loss[own].mean()) for label, own in parts[:MAX_PARTS]}
    for gap, own in (("", every), *by_gap(made.gap)):
        difference = made.over_homes(loss - prior, own)
        measure = f"log_loss - {PRIOR} {gap}".rstrip()
        scores[measure] = difference.mean
        if len(np.unique(made.home[own])) > 1:
            scores[f"{measure}{LOWER_END}"] = 0.0 if name == PRIOR else difference.low
            scores[f"{measure}{UPPER_END}"] = 0.0 if name == PRIOR else difference.high
    return scores


def measures_by_gap(made: SplitForecasts) -> GapMeasures:
    """Return accuracy and log loss of each model in each class of gaps, as means over homes."""
    measures: dict[str, Callable[[F64, I64], F64]] = {
        "accuracy": partial(top_k, k=1),
        "log loss [nats]": log_loss,
    }
    found: dict[str, dict[str, dict[str, tuple[float, float, float]]]] = {}
    for measure, score in measures.items():
        found[measure] = {}
        for name, belief in made.beliefs.items():
            values = score(belief, made.truth)
            means = {gap: made.over_homes(values, own) for gap, own in by_gap(made.gap)}
            ends = {gap: (mean.mean, mean.low, mean.high) for gap, mean in means.items()}
            found[measure][name] = ends
    return found


def _score_ltp(data: Dataset, split: str, _: object) -> Scores:
    """Score shares of rooms from all evidence of a run, against the true ones."""
    errors: dict[str, list[float]] = {}
    rooms = _groups(data, "rooms", split)
    evidence = _groups(data, "evidence", split)
    for (run, user), labels in _groups(data, "labels", split, "user").items():
        names = rooms[(run,)]["room"].tolist()
        at_home = labels["place"][labels["place"] != AWAY].tolist()
        if not at_home:
            continue
        truth = np.array([at_home.count(name) for name in names]) / len(at_home)
        seen = np.zeros(len(names))
        watched = np.zeros(len(names))
        rows = evidence.get((run,))
        if rows is not None:
            room = np.array([names.index(name) for name in rows["room"]])
            is_look = rows["user"] == ANYONE
            is_user = rows["user"] == user
            np.add.at(watched, room[is_look], rows["watched"][is_look])
            np.add.at(seen, room[is_user], rows["seen"][is_user] / 60)
        uniform = np.ones(len(names))
        guesses = {
            "uniform": uniform,
            "sighting_share": seen if seen.any() else uniform,
            "exposure_ratio": (seen + 0.01) / (watched + 1),
        }
        for name, guess in guesses.items():
            error = float(np.abs(guess / guess.sum() - truth).sum() / 2)
            errors.setdefault(name, []).append(error)
    found: Scores = {}
    for name, own in errors.items():
        found[name] = {"tv": float(np.mean(own))}, len(own)
    return found


def _next_rooms(labels: Mapping[str, Any]) -> Iterator[tuple[Hashable, str]]:
    """Yield the kind of the place of each stay, and the kind of the next place."""
    following = labels["next_step"].astype(float)
    is_last = np.append(following[1:] != following[:-1], True) & ~np.isnan(following)
    yield from zip(labels["kind"][is_last], labels["next_kind"][is_last], strict=True)


def _activities(labels: Mapping[str, Any]) -> Iterator[tuple[Hashable, str]]:
    """Yield for each label at home the kind of room and the hour, and the activity."""
    rows = zip(labels["kind"], _hours(labels["time"]), labels["activity"], strict=True)
    for kind, hour, activity in rows:
        if kind != AWAY and activity:
            yield (kind, hour), activity


def _hours(times: Any) -> I64:
    return times.astype("datetime64[h]").astype(np.int64) % 24


def _returns(data: Dataset, split: str) -> tuple[I64, F64]:
    """Return the hour of each label of somebody away, and the time until the return [min]."""
    hours = [np.zeros(0, np.int64)]
    minutes = [np.zeros(0)]
    for labels in labels_by_person(data, split):
        time = labels["time"]
        step = labels["step"]
        if len(time) < 2:  # the length of a step is unknown
            continue
        until = labels["next_step"].astype(float) - step
        own = (labels["kind"] == AWAY) & ~np.isnan(until)
        passed_s = (time[1] - time[0]) / np.timedelta64(1, "s")
        step_s = passed_s / max(int(step[1] - step[0]), 1)
        hours.append(_hours(time[own]))
        minutes.append(until[own] * step_s / 60)
    return np.concatenate(hours), np.concatenate(minutes)


def _score_time_to_return(data: Dataset, split: str, _: object) -> Scores:
    hour, known = _returns(data, TRAIN)
    asked, truth = _returns(data, split)
    if not len(known) or not len(truth):
        return {}
    overall = float(np.median(known))
    by_hour = np.full(24, overall)
    for each in np.unique(hour):
        by_hour[each] = np.median(known[hour == each])
    guesses = {"median": np.full(len(truth), overall), "median by hour": np.take(by_hour, asked)}
    found: Scores = {}
    for name, guess in guesses.items():
        found[name] = {"mae_min": float(np.abs(guess - truth).mean())}, len(truth)
    return found


def _score_shares(
    data: Dataset, split: str, _: object, cases: Callable[[Any], Iterable[Any]], given: str
) -> Scores:
    """Score the training's shares of each outcome: overall, and given what is known."""
    known = [*chain.from_iterable(map(cases, labels_by_person(data, TRAIN)))]
    asked = [*chain.from_iterable(map(cases, labels_by_person(data, split)))]
    if not known or not asked:
        return {}
    outcomes = sorted({what for _, what in [*known, *asked]})
    overall = Counter(what for _, what in known)
    counts = Counter(known)
    base = np.array([overall[what] + SMOOTHING for what in outcomes])
    base /= base.sum()
    tables = {}
    for condition, number in Counter(condition for condition, _ in known).items():
        own = np.array([counts[condition, what] for what in outcomes])
        tables[condition] = (own + SMOOTHING * base) / (number + SMOOTHING)
    truth = np.array([outcomes.index(what) for _, what in asked])
    beliefs = {
        "most common": np.tile(base, (len(truth), 1)),
        f"by {given}": np.array([tables.get(condition, base) for condition, _ in asked]),
    }
    found: Scores = {}
    for name, belief in beliefs.items():
        loss = float(log_loss(belief, truth).mean())
        accuracy = float(top_k(belief, truth, 1).mean())
        found[name] = {"log_loss": loss, "accuracy": accuracy}, len(truth)
    return found


def labels_by_person(data: Dataset, split: str) -> Iterator[dict[str, Any]]:
    """Yield the labels of each user of each run, with the kinds of present and next places.

    Args:
        data: The data set.
        split: The split.
    """
    rooms = _groups(data, "rooms", split)
    for (run, _), labels in _groups(data, "labels", split, "user").items():
        own = rooms[(run,)]
        kinds = {**dict(zip(own["room"], own["kind"], strict=True)), AWAY: AWAY, None: None}
        labels["kind"] = np.array([kinds[place] for place in labels["place"]], object)
        labels["next_kind"] = np.array([kinds[place] for place in labels["next_place"]], object)
        yield labels


def _groups(data: Dataset, table: str, split: str, *also: str) -> dict[Any, dict[str, Any]]:
    """Return the rows of a table as arrays by run, and by further columns, in order."""
    rows = data.arrow(table, split)
    columns = {name: rows[name].to_numpy(zero_copy_only=False) for name in rows.column_names}
    keys = [columns[name] for name in ("run", *also)]
    numbers = [np.unique(key, return_inverse=True)[1] for key in keys]
    order = np.lexsort(numbers[::-1])
    changes = np.any([np.diff(number[order], prepend=-1) != 0 for number in numbers], axis=0)
    parts = np.split(order, np.flatnonzero(changes)[1:]) if len(order) else []
    groups = {}
    for part in parts:
        group = tuple(key[part[0]] for key in keys)
        groups[group] = {name: values[part] for name, values in columns.items()}
    return groups


TASKS: Mapping[str, Callable[[Dataset, str, Networks], Scores]] = {
    "rtp": _score_rtp,
    "ltp": _score_ltp,
    "next_room": partial(_score_shares, cases=_next_rooms, given="kind of room"),
    "time_to_return": _score_time_to_return,
    "activity": partial(_score_shares, cases=_activities, given="kind of room and hour"),
}
