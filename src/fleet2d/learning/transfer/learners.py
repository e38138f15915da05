"""Gradient-boosted trees that predict a room or an activity from the hours before."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from fleet2d.errors import extra
from fleet2d.kernels import F64, I16, I64
from fleet2d.learning.transfer.traces import CLASSES, KINDS, MinuteTrace
from fleet2d.runtime.clock import DAY_MINUTES

STRIDE = 5  # minutes between moments
HISTORY = 180  # minutes of a trace before its first moment
LONGEST = 2 * DAY_MINUTES  # the time since a room was visited is cut here [min]
SHORT = 15  # minutes of the shorter time whose shares of rooms are features
# The part of the probability that is shared among all outcomes, also unseen ones.
FLOOR = 0.02
# The weight of a home's own moments among others.
OWN_WEIGHT = 10.0
CATEGORICAL = (0, 1)
SETTINGS: dict[str, dict[str, Any]] = {
    "usual": {"max_iter": 20, "learning_rate": 0.2, "max_leaf_nodes": 15, "min_samples_leaf": 20},
    "regularised": {"max_iter": 20, "max_leaf_nodes": 6, "min_samples_leaf": 100},
}


class ForecastMoments(NamedTuple):
    """Moments of a trace: features, outcome, and day.

    Attributes:
        inputs: float32 (n, features); the first two are the place now, and the one before.
        outcome: The room or activity to predict, int64 (n,).
        day: The number of the day of each, int64 (n,).
        weight: The weight in training, float64 (n,).
    """

    inputs: Any
    outcome: I64
    day: I64
    weight: F64

    def where(self, chosen: Any) -> "ForecastMoments":
        """Return some of the moments."""
        return ForecastMoments(*(column[chosen] for column in self))

    def weighted(self, weight: float) -> "ForecastMoments":
        """Return the same moments with another weight."""
        return self._replace(weight=np.full(len(self.outcome), weight))


def moments(trace: MinuteTrace, task: str) -> ForecastMoments:
    """Return the moments of a trace at which a task predicts.

    Args:
        trace: The trace.
        task: "room in N min", from the rooms so far; or "activity", from sensors so far.
    """
    ahead = 0 if task == "activity" else int(task.split()[2])
    codes = trace.rooms if ahead else trace.sensors
    outcomes = trace.rooms if ahead else trace.activities
    count = len(codes)
    at = np.arange(HISTORY, count - ahead, STRIDE)
    known = np.isin(at // DAY_MINUTES, trace.days) & (codes[at] >= 0)
    then = at + ahead
    known_then = np.isin(then // DAY_MINUTES, trace.days) & (outcomes[then] >= 0)
    at = at[known & known_then]
    outcome = outcomes[at + ahead].astype(np.int64)
    features = _features(codes, trace.weekday, at)
    return ForecastMoments(features, outcome, at // DAY_MINUTES, np.ones(len(at)))


def _features(codes: I16, weekday: int, at: I64) -> Any:
    minutes = np.arange(len(codes))
    is_new = np.append(True, codes[1:] != codes[:-1])
    begin = np.maximum.accumulate(np.where(is_new, minutes, 0))
    before = np.where(begin > 0, codes[np.maximum(begin - 1, 0)], -1)
    columns = [
        np.maximum(codes[at], 0),
        before[at] + 1,
        np.log1p(at - begin[at]),
        at % DAY_MINUTES / 60,
        (weekday + at // DAY_MINUTES) % 7 >= 5,
    ]
    for code in range(len(KINDS)):
        here = codes == code
        last = np.maximum.accumulate(np.where(here, minutes, -LONGEST))
        columns.append(np.log1p(np.minimum(at - last[at], LONGEST)))
        total = np.append(0, np.cumsum(here))
        columns += [(total[at + 1] - total[at + 1 - span]) / span for span in (SHORT, HISTORY)]
    return np.stack(columns, axis=1).astype(np.float32)


def pooled(parts: Sequence[ForecastMoments], rows: int, seed: int) -> ForecastMoments:
    """Return moments of several traces together, at most `rows` of them, drawn at random."""
    whole = ForecastMoments(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))
    if len(whole.outcome) <= rows:
        return whole
    chosen = np.random.default_rng(seed).choice(len(whole.outcome), rows, replace=False)
    return whole.where(np.sort(chosen))


def fit_and_predict(
    known: ForecastMoments, asked: ForecastMoments, learner: str, outcomes: int
) -> F64:
    """Train a model and return the probability of each outcome at other moments.

    Args:
        known: The moments to learn from.
        asked: The moments to predict.
        learner: A name of SETTINGS.
        outcomes: The number of outcomes.

    Returns:
        float64 (n, outcomes). Outcomes that the training never saw have the same small share.
    """
    with extra("transfer", "models of rooms and activities need scikit-learn"):
        from sklearn.ensemble import HistGradientBoostingClassifier
        from threadpoolctl import threadpool_limits
    found = np.zeros((len(asked.outcome), outcomes))
    seen = np.unique(known.outcome)
    if len(seen) < 2:
        found[:, seen] = 1.0
    else:
        model = HistGradientBoostingClassifier(
            **SETTINGS[learner],
            max_bins=63,
            l2_regularization=1.0,
            categorical_features=CATEGORICAL,
            early_stopping=False,
            random_state=0,
        )
        with threadpool_limits(1):  # workers share the cores
            model.fit(known.inputs, known.outcome, sample_weight=known.weight)
            found[:, model.classes_] = model.predict_proba(asked.inputs)
    return (1 - FLOOR) * found + FLOOR / outcomes


class Forecast(NamedTuple):
    """The scores of predictions at moments, with the day of each.

    Attributes:
        loss: float64 (n,) [nats].
        hit: float64 (n,), 1 where the most probable outcome came true.
        day: int64 (n,).
        metrics: Further numbers.
    """

    loss: F64
    hit: F64
    day: I64
    metrics: dict[str, float]


def forecast(known: ForecastMoments, asked: ForecastMoments, learner: str, task: str) -> Forecast:
    """Train a model, and score it."""
    outcomes = CLASSES if task == "activity" else KINDS
    found = fit_and_predict(known, asked, learner, len(outcomes))
    truth = asked.outcome
    guess = found.argmax(axis=1)
    rows = np.arange(len(truth))
    metrics = {"unseen": float(np.mean(~np.isin(truth, known.outcome)))}
    if task == "activity":
        metrics["macro_f1"] = macro_f1(truth, guess)
    else:
        metrics["naive_accuracy"] = float(np.mean(asked.inputs[:, 0] == truth))
    loss = -np.log(found[rows, truth])
    return Forecast(loss, (guess == truth) * 1.0, asked.day, metrics)


def macro_f1(truth: I64, guess: I64) -> float:
    """Return the mean of F1 over the outcomes that occur.

    >>> round(macro_f1(np.array([0, 0, 1, 2]), np.array([0, 1, 1, 0])), 3)
    0.389
    """
    scores = []
    for outcome in np.unique(truth):
        right = np.count_nonzero((truth == outcome) & (guess == outcome))
        scores.append(2 * right / np.count_nonzero(np.r_[truth, guess] == outcome))
    return float(np.mean(scores))
