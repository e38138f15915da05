"""Scores of real-time presence, by the time since users were last seen."""

from collections.abc import Mapping
from datetime import timedelta
from typing import Any, ClassVar, NamedTuple

import numpy as np

from fleet2d.algorithms.algorithm import Present
from fleet2d.algorithms.evidence import steps_of_bin
from fleet2d.algorithms.history import History
from fleet2d.algorithms.observations import NOWHERE
from fleet2d.configuration.components import register
from fleet2d.configuration.units import PositiveDuration
from fleet2d.floorplan.home.home import Home
from fleet2d.kernels import F64, I64, Bool
from fleet2d.metrics.metric import Metric
from fleet2d.metrics.presence.belief_reader import BeliefReader
from fleet2d.metrics.presence.scores import (
    brier_score,
    calibration_error,
    classwise_error,
    log_loss,
    murphy,
    sharpness,
    skill,
    top_k,
)

# Upper ends of the classes of the gap since a user was last seen [min], and their names.
GAP_ENDS = (1, 5, 15, 60, 240)
GAPS = ("0-1 min", "1-5 min", "5-15 min", "15-60 min", "1-4 h", "over 4 h", "never seen")
UNSEEN = len(GAPS) - 1
ALL = "all"
SHOWN = ("log_loss", "top_1", "ece", "skill", "reference_skill")  # in the closing table
NEVER = -1


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
        gap, truth, last = self.gap[which], self.truth[which], self.last[which]
        return ScoredBins(gap, truth, last, self.belief[which], self.reference[which])


@register("metric", "rtp_score")
class RtpScore(Metric):
    """Scores of real-time presence and of a naive guess, minute by minute, by last-seen gap.

    At the end of every bin (a minute, or a step where that is longer) the belief is compared with
    the room that the user was in, or with away, which is one more place (with `given_home` bins
    away are left out, and shares are given at home). The belief is the algorithm's track of the
    bin, which uses evidence up to the end of the bin only; for an algorithm without a track it is a
    forecast: its newest output before the period, `at` that time.

    The gap is the time since a robot last perceived that user correctly, or `never seen`. For each
    class of gaps and over all:

    - log_loss: mean of -ln p(truth), p raised to 1e-6 at least [nats];
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
      `{type: rtp, model: hour_of_week}`.

    Its period must be that of the algorithm. Stored per period and user: bins and sums of scores
    by class of gaps. The result has the means over the run, per user. Minutes of a day depend on
    each other: for confidence intervals compare runs, or days, not minutes.

    Attributes:
        of: The algorithm whose presence is scored.
        period: How often it is updated: the period of the algorithm.
        given_home: Whether only bins at home count.
        reference: Another algorithm to which the skill is relative, too.
    """

    unit: ClassVar[str] = "all gaps"
    units: ClassVar[Mapping[str, str]] = {
        "log_loss": "nats, 0 is best",
        "top_1": "share of minutes guessed right",
        "ece": "mean gap of forecasts and rates",
        "skill": "1 best, 0 like last room seen",
        "reference_skill": "1 best, 0 like the reference",
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

    def update(self, history: History, state: Present) -> Any:
        """Score the bins of the period; return a row for each user and class of gaps in it."""
        size = steps_of_bin(round(history.step_s * 1e6))
        ends = np.arange(-(-(history.first + 1) // size) * size, history.end + 1, size) - 1
        beliefs = [reader.at(history, state, ends) for reader in self.beliefs]
        rows: list[tuple[Any, ...]] = []
        for row, user in enumerate(state.users):
            gap, last = self._sightings(user, row, history, ends)
            if beliefs[0] is None:
                continue
            places = [
                None if shares is None else self._places(shares[0][:, row], shares[1][:, row])
                for shares in beliefs
            ]
            scored = self._score(user, places, gap, last, history, ends)
            self.scored.setdefault(user, []).append(scored)
            rows += [(user, *sums) for sums in _sums(scored)]
        if not rows:
            return None
        names = ("user", "gap", "bins", "log_loss", "brier", "top_1")
        columns = dict(zip(names, zip(*rows, strict=True), strict=True))
        return {
            name: np.array(values, dtype=object if name in ("user", "gap") else None)
            for name, values in columns.items()
        }

    def _places(self, home: F64, away: F64) -> F64:
        """Return the probability of each scored place: rooms, and away unless `given_home`."""
        if self.given_home:
            return home
        return np.concatenate([home * (1 - away)[:, None], away[:, None]], axis=1)

    def _sightings(self, user: str, row: int, history: History, ends: I64) -> tuple[I64, I64]:
        """Return the steps since the last correct sighting at the ends of bins, and its room."""
        observations = history.observations
        is_correct = (observations.user == row) & (history.truth.user == row)
        last_step, last_room = self.last.get(user, (NEVER, NEVER))
        steps = np.concatenate([[last_step], observations.step[is_correct]]).astype(np.int64)
        rooms = np.concatenate([[last_room], observations.room[is_correct]]).astype(np.int64)
        index = np.searchsorted(steps, ends, side="right") - 1
        self.last[user] = int(steps[-1]), int(rooms[-1])
        return np.where(steps[index] == NEVER, NEVER, ends - steps[index]), rooms[index]

    def _score(
        self, user: str, beliefs: list[F64 | None], gap: I64, last: I64, history: History, ends: I64
    ) -> ScoredBins:
        poses, index = history.poses(user), ends - history.first
        is_away, room = poses.away[index], poses.room[index].astype(np.int64)
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
        return ScoredBins(label, truth, last, belief, reference).of(is_scored)

    def result(self) -> dict[str, Any]:
        """Return {user: {class of gaps: scores, "all": scores}}."""
        results: dict[str, Any] = {}
        for user, parts in self.scored.items():
            scored = ScoredBins(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))
            groups = {name: scored.gap == g for g, name in enumerate(GAPS)}
            groups[ALL] = np.ones(len(scored.gap), bool)
            scores = {
                name: self._means(scored.of(mask)) for name, mask in groups.items() if mask.any()
            }
            if scores:
                results[user] = scores
        return results

    def _means(self, scored: ScoredBins) -> dict[str, float]:
        belief, truth = scored.belief, scored.truth
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
        return {
            user: {name: scores[ALL][name] for name in SHOWN if name in scores[ALL]}
            for user, scores in result.items()
        }


def _sums(scored: ScoredBins) -> list[tuple[str, int, float, float, float]]:
    """Return the number of bins and the sums of scores of each class of gaps that occurs."""
    belief, truth = scored.belief, scored.truth
    columns = log_loss(belief, truth), brier_score(belief, truth), top_k(belief, truth, 1)
    bins = np.bincount(scored.gap, minlength=len(GAPS))
    loss, brier, top = (np.bincount(scored.gap, values, len(GAPS)) for values in columns)
    return [
        (GAPS[g], int(bins[g]), float(loss[g]), float(brier[g]), float(top[g]))
        for g in np.flatnonzero(bins).tolist()
    ]


def _mean_scores(belief: F64, truth: I64) -> dict[str, float]:
    return {
        "log_loss": float(log_loss(belief, truth).mean()),
        "brier": float(brier_score(belief, truth).mean()),
        "top_1": float(top_k(belief, truth, 1).mean()),
    }
