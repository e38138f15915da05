"""Scores of real-time presence: probabilities of rooms over time, against the true room."""

from collections.abc import Mapping
from datetime import timedelta
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fleet2d.algorithms.algorithm import Present
from fleet2d.algorithms.evidence import steps_of_bin
from fleet2d.algorithms.history import History
from fleet2d.algorithms.observations import NOWHERE
from fleet2d.algorithms.presence.belief import BeliefReader
from fleet2d.algorithms.presence.estimator import natural_log
from fleet2d.configuration.units import PositiveDuration
from fleet2d.floorplan.home import Home
from fleet2d.kernels import F64, I64, UNKNOWN_TRUTH, Bool
from fleet2d.metrics.metric import Metric, columns_of
from fleet2d.runtime.determinism import sum_in_order
from fleet2d.runtime.events import EventKind

MIN_PROBABILITY = 1e-6  # smaller probabilities are raised to this before taking logarithms
GROUP_COUNT = 15  # number of groups of about equal size, by forecast probability
# Upper ends of the classes of the gap since a user was last seen [min], and their names.
GAP_ENDS = (1, 5, 15, 60, 240)
GAPS = ("0-1 min", "1-5 min", "5-15 min", "15-60 min", "1-4 h", "over 4 h", "never seen")
UNSEEN = len(GAPS) - 1
ALL = "all"
TRUTH_UNKNOWN = "truth unknown"
SUMMARY_SCORES = ("log_loss", "top_1", "ece", "skill", "reference_skill")  # in the closing table
NEVER = -1
GapMeasures = Mapping[str, Mapping[str, Mapping[str, tuple[float, float, float]]]]
"""By measure, model and gap: a mean, and the ends of its interval, NaN if there is none."""


class UnknownPlaces:
    """The steps at which nobody knows where a user is, as in the gaps of a log."""

    def __init__(self) -> None:
        """Begin with all places known."""
        self._since: dict[str, bool] = {}  # whether a place is unknown at the end of the history

    def at(self, user: str, history: History, steps: I64) -> Bool:
        """Return whether a user's place is unknown at each of some steps of a history: bool (n,).

        Histories must follow each other.
        """
        if user not in history.log.untracked:
            return np.zeros(len(steps), np.bool_)
        changes = [
            (event.step, event.event == EventKind.UNKNOWN)
            for event in history.events
            if event.entity == user and event.event in (EventKind.UNKNOWN, EventKind.KNOWN)
        ]
        begins = np.array([step for step, _ in changes], np.int64)
        values = np.array([self._since.get(user, False), *(value for _, value in changes)])
        self._since[user] = bool(values[-1])
        is_unknown: Bool = values[np.searchsorted(begins, steps, side="right")]
        return is_unknown


def log_loss(probability: F64, truth: I64) -> F64:
    """Return -ln max(p(truth), 1e-6) of each forecast [nats]; strictly proper but for the clip.

    Args:
        probability: float64 (n, places), rows sum to one.
        truth: int64 (n,), the true place.

    Example:
        >>> log_loss(np.array([[0.5, 0.5], [1.0, 0.0]]), np.array([0, 1])).round(3).tolist()
        [0.693, 13.816]
    """
    return -natural_log(np.maximum(_of(probability, truth), MIN_PROBABILITY))


def brier_score(probability: F64, truth: I64) -> F64:
    """Return sum over places of (p - 1{truth})^2 of each forecast, 0 to 2; strictly proper.

    Example:
        >>> brier_score(np.array([[0.5, 0.5], [1.0, 0.0]]), np.array([0, 1])).tolist()
        [0.5, 2.0]
    """
    return (probability * probability).sum(axis=1) - 2 * _of(probability, truth) + 1


def top_k(probability: F64, truth: I64, k: int) -> F64:
    """Return 1 for each forecast whose k likeliest places include the truth, 0 for others.

    With equally likely places it is the probability that the truth is included if ties are broken
    at random: 1/2 for one of two equal places. The mean is the accuracy. It is not a proper score:
    read it together with one.

    Example:
        >>> top_k(np.array([[0.5, 0.5, 0], [0.6, 0.3, 0.1]]), np.array([0, 1]), 1).tolist()
        [0.5, 0.0]
        >>> top_k(np.array([[0.5, 0.5, 0], [0.6, 0.3, 0.1]]), np.array([0, 1]), 2).tolist()
        [1.0, 1.0]
    """
    true = _of(probability, truth)[:, np.newaxis]
    above = (probability > true).sum(axis=1)
    equal = (probability == true).sum(axis=1)
    return np.clip((k - above) / equal, 0, 1)


def groups_of(values: F64, masses: int = GROUP_COUNT) -> I64:
    """Return the index of the group of each value: groups of about equal size, ascending.

    Equal values are in the same group, that of the middle of their ranks.

    Example:
        >>> groups_of(np.array([0.9, 0.1, 0.5, 0.5, 0.5, 0.2]), masses=3).tolist()
        [2, 0, 1, 1, 1, 0]
    """
    order = np.sort(values)
    first = np.searchsorted(order, values)
    last = np.searchsorted(order, values, "right")
    return (first + last - 1) // 2 * masses // max(len(values), 1)


def calibration_error(probability: F64, truth: I64, masses: int = GROUP_COUNT) -> float:
    """Return the expected calibration error: sum over groups of n_g / n |accuracy - confidence|.

    The groups are of about equal size by confidence, the probability of the likeliest place
    (`groups_of`); accuracy and confidence are means over a group. 0 without forecasts.

    Example:
        >>> calibration_error(np.array([[0.75, 0.25]] * 4), np.array([0, 0, 0, 1]))
        0.0
    """
    if not len(truth):
        return 0.0
    return _gaps(probability.max(axis=1), top_k(probability, truth, 1), masses)


def classwise_error(probability: F64, truth: I64, masses: int = GROUP_COUNT) -> float:
    """Return the class-wise calibration error: the mean of the calibration errors of all places.

    The error of a place is the sum over groups of n_g / n |share true - mean probability|, with
    groups of about equal size by its probability (Kull and others, 2019). Places that are neither
    forecast nor true count with 0. 0 without forecasts.

    Example:
        >>> classwise_error(np.array([[0.75, 0.25]] * 4), np.array([0, 0, 0, 0]))
        0.25
    """
    if not len(truth):
        return 0.0
    places = range(probability.shape[1])
    gaps = (_gaps(probability[:, c], (truth == c).astype(np.float64), masses) for c in places)
    return sum_in_order(gaps) / len(places)


class Murphy(NamedTuple):
    """The Brier score in parts: it is reliability - resolution + uncertainty.

    Attributes:
        reliability: Squared difference of forecast probability and frequency; 0 is best.
        resolution: Variance of the frequency between forecasts; larger is better.
        uncertainty: The Brier score of a forecaster that always predicts the base rate; it depends
            on the truth, not on the forecasts.
    """

    reliability: float
    resolution: float
    uncertainty: float


def murphy(probability: F64, truth: I64, masses: int = GROUP_COUNT) -> Murphy:
    """Return Murphy's split of the Brier score, summed over places.

    For each place, forecasts are put into groups of about equal size by its probability
    (`groups_of`): reliability is the sum of n_g / n (mean probability - share true)^2, uncertainty
    s (1 - s) with s the share true of all. Resolution is the remainder, so that the parts add up:
    the sum of n_g / n (share true - s)^2, except for differences within groups (Stephenson and
    others, 2008); for forecasts with few distinct values it is exactly that.

    Example:
        >>> probability = np.array([[0.5, 0.5]] * 2 + [[1.0, 0.0]] * 2)
        >>> murphy(probability, np.array([0, 1, 0, 0]))
        Murphy(reliability=0.0, resolution=0.125, uncertainty=0.375)
    """
    count = max(len(truth), 1)
    reliability = uncertainty = 0.0
    for place in range(probability.shape[1]):
        forecast = probability[:, place]
        true = (truth == place).astype(np.float64)
        size, difference = _grouped(forecast, true, masses)
        reliability += float((difference * difference / np.maximum(size, 1)).sum()) / count
        share = float(true.sum()) / count
        uncertainty += share * (1 - share)
    brier = float(brier_score(probability, truth).sum()) / count
    return Murphy(reliability, reliability + uncertainty - brier, uncertainty)


def reliability_curve(forecast: F64, true: F64, masses: int = GROUP_COUNT) -> tuple[F64, F64, I64]:
    """Return the points of a reliability diagram.

    Args:
        forecast: float64 (n,), probabilities.
        true: float64 (n,), 1 where the event happened, 0 elsewhere.
        masses: Number of groups of about equal size.

    Returns:
        For each group that isn't empty: mean probability, share of true events, and size.

    Example:
        >>> forecast, true = np.array([0.2, 0.2, 0.2, 0.2, 0.8]), np.array([1, 0, 0, 0, 1.0])
        >>> [part.tolist() for part in reliability_curve(forecast, true, masses=2)]
        [[0.2, 0.8], [0.25, 1.0], [4, 1]]
    """
    group = groups_of(forecast, masses)
    counts = np.bincount(group, minlength=masses)
    size = counts[counts > 0]
    confidence = np.bincount(group, forecast, masses)[counts > 0] / size
    share = np.bincount(group, true, masses)[counts > 0] / size
    return confidence, share, size.astype(np.int64)


def _gaps(forecast: F64, true: F64, masses: int) -> float:
    return float(np.abs(_grouped(forecast, true, masses)[1]).sum()) / len(forecast)


def _grouped(forecast: F64, true: F64, masses: int) -> tuple[I64, F64]:
    """Return the size of each group of forecasts, and its sum of truth minus forecast."""
    group = groups_of(forecast, masses)
    size: I64 = np.bincount(group, minlength=masses)
    difference = np.bincount(group, true - forecast, masses).astype(np.float64)
    return size, difference


def sharpness(probability: F64) -> F64:
    """Return the entropy of each forecast [nats]; compare it between calibrated forecasts only.

    Example:
        >>> sharpness(np.array([[1.0, 0.0], [0.5, 0.5]])).round(4).tolist()
        [0.0, 0.6931]
    """
    positive = np.where(probability > 0, probability, 1)
    entropy: F64 = -(positive * natural_log(positive)).sum(axis=1)
    return np.maximum(entropy, 0)


def skill(score: float, reference: float) -> float:
    """Return 1 - score / reference: 1 is perfect, 0 as good as the reference, or if that is 0.

    Example:
        >>> skill(0.5, 2.0)
        0.75
    """
    return 1 - score / reference if reference > 0 else 0.0


def _of(values: NDArray[Any], truth: I64) -> NDArray[Any]:
    return values[np.arange(len(truth)), truth]


class ScoredBins(NamedTuple):
    """Scored bins of one user.

    Attributes:
        gap: int64 (n,), index in GAPS.
        truth: int64 (n,), the true place: the index of a room; one past the rooms is away.
        last: int64 (n,), the room of the last correct sighting, NEVER before the first.
        belief: float64 (n, places), the probability of each place.
        reference: float64 (n, places), likewise for the reference algorithm, NaN where it has no
            output; (n, 0) without a reference.
    """

    gap: I64
    truth: I64
    last: I64
    belief: F64
    reference: F64

    def of(self, which: Bool) -> "ScoredBins":
        """Return the bins of a mask."""
        return ScoredBins._make(column[which] for column in self)


class RtpScore(Metric):
    """Scores of real-time presence and of a naive guess, minute by minute, by last-seen gap.

    At the end of every bin (a minute, or a step where that is longer) the belief is compared with
    the room that the user was in, or with away, which is one more place (with `given_home` bins
    away are left out, and shares are given at home). The belief is the algorithm's track of the
    bin, which uses evidence up to the end of the bin only; for an algorithm without a track it is a
    forecast: its newest output before the period, `at` that time.

    The gap is the time since a robot last perceived that user correctly, or `never seen`; of a real
    robot's detections, whose truth nobody knows, since it last perceived them. Bins in which nobody
    knows where the user was, as in the gaps of a log, are left out: their number is `bins` of the
    class `truth unknown`. For each class of gaps and over all:

    - log_loss: mean of -ln p(truth), with p at least 1e-6 [nats];
    - brier: mean of sum over places of (p - 1{truth})^2, 0 to 2; its parts `reliability`,
      `resolution` and `uncertainty` (Murphy, `scores.murphy`): brier = reliability - resolution +
      uncertainty;
    - top_1, top_2: share of bins in which the truth was the likeliest place, or one of the two
      likeliest (ties count by their share);
    - ece: expected calibration error of the likeliest place, 15 groups of about equal size by
      confidence; ece_classwise: the mean over places of the same of each place's probability;
    - sharpness: mean entropy of the belief [nats], small is sharp;
    - naive_log_loss, naive_brier, naive_top_1: of the naive guess, probability 1 for the room of
      the last correct sighting, and uniform before the first;
    - skill: 1 - log_loss / naive_log_loss;
    - with `reference`, over the bins for which that algorithm has an output: reference_log_loss,
      reference_brier, reference_top_1 of its belief, and reference_skill: 1 - log_loss /
      reference_log_loss. The usual reference is long-term presence of the hour of the week,
      `{type: real_time_presence, model: hour_of_week}`.

    Its period must be that of the algorithm. Stored per period and user: bins and sums of scores
    by class of gaps. The result has the means over the run, per user. Minutes of a day depend on
    each other: for confidence intervals compare runs, or days, not minutes.

    Attributes:
        of: The algorithm whose presence is scored.
        period: How often it is updated: the period of the algorithm.
        given_home: Whether only bins at home count.
        reference: Another algorithm to which the skill is relative, too.
    """

    unit = "all gaps"
    units = {
        "log_loss": "nats, 0 is best",
        "top_1": "share of minutes guessed right",
        "ece": "mean gap of forecasts and rates",
        "skill": "1 best, 0 like last room seen",
        "reference_skill": "1 best, 0 like the reference",
    }
    least = dict.fromkeys(
        ("log_loss", "brier", "top_1", "top_2", "ece", "ece_classwise", "sharpness"), 0
    )
    largest = {
        **dict.fromkeys(("top_2", "ece", "ece_classwise", "skill", "reference_skill"), 1),
        "brier": 2,
    }
    better = {
        **dict.fromkeys(("log_loss", "brier", "reliability", "ece", "ece_classwise"), "lower"),
        **dict.fromkeys(("top_1", "top_2", "skill", "reference_skill", "resolution"), "higher"),
    }

    of: str
    period: PositiveDuration = timedelta(minutes=5)
    given_home: bool = False
    reference: str | None = None

    def reads(self) -> tuple[str, ...]:
        """Return the name of the scored algorithm, and of the reference if there is one."""
        return (self.of,) if self.reference is None else (self.of, self.reference)

    def start(self, home: Home) -> None:
        """Begin scoring."""
        self.beliefs = [BeliefReader(name) for name in self.reads()]
        self.last: dict[str, tuple[int, int]] = {}  # step and room of the last correct sighting
        self.scored: dict[str, list[ScoredBins]] = {}
        self.unknown = UnknownPlaces()
        self.left_out: dict[str, int] = {}  # bins of users whose place is unknown

    def update(self, history: History, state: Present) -> Any:
        """Score the bins of the period; return a row for each user and class of gaps in it."""
        size = steps_of_bin(round(history.step_s * 1e6))
        ends = np.arange(-(-(history.first + 1) // size) * size, history.end + 1, size) - 1
        beliefs = [self._places(reader.at(history, state, ends)) for reader in self.beliefs]
        rows: list[tuple[Any, ...]] = []
        for row, user in enumerate(state.users):
            gap, last = self._sightings(user, row, history, ends)
            if beliefs[0] is None:
                continue
            of_user = [None if belief is None else belief[:, row] for belief in beliefs]
            scored = self._score(user, of_user, gap, last, history, ends)
            self.scored.setdefault(user, []).append(scored)
            rows += [(user, *sums) for sums in _sums(scored)]
        return columns_of(("user", "gap", "bins", "log_loss", "brier", "top_1"), rows)

    def _places(self, shares: tuple[F64, F64] | None) -> F64 | None:
        """Return the probability of each scored place: rooms, and away unless `given_home`."""
        if shares is None:
            return None
        home = shares[0]
        away = shares[1][..., np.newaxis]
        return home if self.given_home else np.concatenate([home * (1 - away), away], axis=-1)

    def _sightings(self, user: str, row: int, history: History, ends: I64) -> tuple[I64, I64]:
        """Return the steps since the last correct sighting at the ends of bins, and its room."""
        observations = history.observations
        true = history.truth.user
        is_correct = (observations.user == row) & ((true == row) | (true == UNKNOWN_TRUTH))
        last_step, last_room = self.last.get(user, (NEVER, NEVER))
        steps = np.concatenate([[last_step], observations.step[is_correct]]).astype(np.int64)
        rooms = np.concatenate([[last_room], observations.room[is_correct]]).astype(np.int64)
        index = np.searchsorted(steps, ends, side="right") - 1
        self.last[user] = int(steps[-1]), int(rooms[-1])
        return np.where(steps[index] == NEVER, NEVER, ends - steps[index]), rooms[index]

    def _score(
        self, user: str, beliefs: list[F64 | None], gap: I64, last: I64, history: History, ends: I64
    ) -> ScoredBins:
        poses = history.poses(user)
        index = ends - history.first
        is_away = poses.away[index]
        room = poses.room[index].astype(np.int64)
        belief = beliefs[0]
        assert belief is not None
        reference = np.full_like(belief, np.nan)[:, : None if beliefs[1:] else 0]
        for other in beliefs[1:]:
            reference = reference if other is None else other
        minutes = gap * history.step_s / 60
        label = np.where(gap == NEVER, UNSEEN, np.searchsorted(GAP_ENDS, minutes))
        truth = np.where(is_away, belief.shape[1] - 1, room)
        # Outside all rooms no place is the truth.
        is_in_room = room != NOWHERE
        is_scored = ~is_away & is_in_room if self.given_home else is_away | is_in_room
        is_unknown = self.unknown.at(user, history, ends)
        self.left_out[user] = self.left_out.get(user, 0) + int(is_unknown.sum())
        is_scored &= ~is_unknown
        return ScoredBins(label, truth, last, belief, reference).of(is_scored)

    def result(self) -> dict[str, Any]:
        """Return {user: {class of gaps: scores, "all": scores}}."""
        results: dict[str, Any] = {}
        for user, parts in self.scored.items():
            scored = ScoredBins(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))
            groups = {name: scored.gap == g for g, name in enumerate(GAPS)}
            groups[ALL] = np.ones(len(scored.gap), bool)
            scores: dict[str, dict[str, float]] = {
                name: self._means(scored.of(mask)) for name, mask in groups.items() if mask.any()
            }
            if self.left_out.get(user):
                scores[TRUTH_UNKNOWN] = {"bins": self.left_out[user]}
            if scores:
                results[user] = scores
        return results

    def _means(self, scored: ScoredBins) -> dict[str, float]:
        belief = scored.belief
        truth = scored.truth
        means = _mean_scores(belief, truth)
        guess = _mean_scores(self._naive(scored), truth)
        scores = {
            "bins": len(truth),
            **means,
            **murphy(belief, truth)._asdict(),
            "top_2": float(top_k(belief, truth, 2).mean()),
            "ece": calibration_error(belief, truth),
            "ece_classwise": classwise_error(belief, truth),
            "sharpness": float(sharpness(belief).mean()),
            **{f"naive_{name}": value for name, value in guess.items()},
            "skill": skill(means["log_loss"], guess["log_loss"]),
        }
        is_known = ~np.isnan(scored.reference).any(axis=1)
        if self.reference is not None and is_known.any():
            loss = float(log_loss(belief[is_known], truth[is_known]).mean())
            reference = _mean_scores(scored.reference[is_known], truth[is_known])
            scores |= {f"reference_{name}": value for name, value in reference.items()}
            scores["reference_skill"] = skill(loss, reference["log_loss"])
        return scores

    def _naive(self, scored: ScoredBins) -> F64:
        """Return the naive guess: probability 1 for the last room, or uniform before a sighting."""
        places = scored.belief.shape[1]
        rooms = places if self.given_home else places - 1
        guess: F64 = (scored.last[:, None] == np.arange(places)).astype(np.float64)
        guess[scored.last == NEVER, :rooms] = 1 / rooms
        return guess

    @classmethod
    def summary(cls, result: Mapping[str, Any]) -> Mapping[str, Any]:
        """Return each user's main scores over all gaps."""
        summary = {}
        for user, scores in result.items():
            if ALL in scores:
                main = [name for name in SUMMARY_SCORES if name in scores[ALL]]
                summary[user] = {name: scores[ALL][name] for name in main}
        return summary


def _sums(scored: ScoredBins) -> list[tuple[Any, ...]]:
    """Return the number of bins and the sums of scores of each class of gaps that occurs."""
    bins = np.bincount(scored.gap, minlength=len(GAPS)).tolist()
    scores = _scores(scored.belief, scored.truth).values()
    sums = [np.bincount(scored.gap, values, len(GAPS)).tolist() for values in scores]
    return [row for row in zip(GAPS, bins, *sums, strict=True) if row[1]]


def _mean_scores(belief: F64, truth: I64) -> dict[str, float]:
    return {name: float(values.mean()) for name, values in _scores(belief, truth).items()}


def _scores(belief: F64, truth: I64) -> dict[str, F64]:
    return {
        "log_loss": log_loss(belief, truth),
        "brier": brier_score(belief, truth),
        "top_1": top_k(belief, truth, 1),
    }
