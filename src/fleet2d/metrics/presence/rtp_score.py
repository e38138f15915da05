"""How well real-time presence tells where users are, by how long ago they were seen."""

from collections.abc import Mapping
from datetime import timedelta
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from fleet2d.algorithms.evidence import steps_of_bin
from fleet2d.algorithms.history import History
from fleet2d.algorithms.observations import NOWHERE
from fleet2d.component import register
from fleet2d.metrics.metric import Metric
from fleet2d.metrics.presence.believed import Belief
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
from fleet2d.units import PositiveDuration

if TYPE_CHECKING:
    from fleet2d.algorithms.algorithm import Present
    from fleet2d.floorplan.home.home import Home

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

# Upper ends of the bins of the gap since a user was last seen [min], and their names.
GAP_ENDS = (1, 5, 15, 60, 240)
GAPS = ("0-1 min", "1-5 min", "5-15 min", "15-60 min", "1-4 h", "over 4 h", "never seen")
UNSEEN = len(GAPS) - 1
ALL = "all"
SHOWN = ("log_loss", "top_1", "ece", "skill", "reference_skill")  # in the closing table
NEVER = -1


class Scored(NamedTuple):
    """Bins of a user that were scored.

    Attributes:
        gap: int64 (n,), index in GAPS.
        truth: int64 (n,), the place: a room, or behind them away.
        last: int64 (n,), the room of the last right sighting, NEVER before the first.
        belief: float64 (n, places).
        reference: float64 (n, places), NaN where the other algorithm told nothing; (n, 0) if there
            is no other.
    """

    gap: I64
    truth: I64
    last: I64
    belief: F64
    reference: F64

    def of(self, which: NDArray[np.bool_]) -> "Scored":
        """Return some of them."""
        gap, truth, last = self.gap[which], self.truth[which], self.last[which]
        return Scored(gap, truth, last, self.belief[which], self.reference[which])


@register("metric", "rtp_score")
class RtpScore(Metric):
    """Scores of real-time presence, minute by minute, by last-seen gap, and of the naive guess.

    At the end of every bin (a minute, or a step where that is longer) what was believed then is
    compared with the room that the user was in, or away, which is one more place (with
    `given_home` bins away are left out, and shares are given at home). What was believed is the
    algorithm's track of the bin, which uses evidence up to its end and none after; an algorithm
    without one is asked for a forecast: its newest output before, `at` that time.

    The gap is the time since a robot last perceived that user rightly, or `never seen`. Per gap bin
    and over all:

    - log_loss: mean of -ln p(truth), p raised to 1e-6 at least [nats];
    - brier: mean of sum over places of (p - 1{truth})^2, 0 to 2; its parts `reliability`,
      `resolution` and `uncertainty` (Murphy, `scores.murphy`): brier = reliability - resolution +
      uncertainty;
    - top_1, top_2: share of bins in which the truth was the likeliest place, or one of the two
      likeliest (ties share);
    - ece: expected calibration error of the likeliest place, 15 groups of about equal size by
      confidence; ece_classwise: the mean over places of the same of each place's probability;
    - sharpness: mean entropy of what was believed [nats], small is sharp;
    - naive_log_loss, naive_brier, naive_top_1: of the room of the last right sighting, for sure,
      and all rooms alike before the first;
    - skill: 1 - log_loss / naive_log_loss;
    - with `reference`, of the bins of which that algorithm tells something: reference_log_loss,
      reference_brier, reference_top_1 of what it believed, and reference_skill:
      1 - log_loss / reference_log_loss. The usual reference is long-term presence of the hour of
      the week, `{type: rtp, model: hour_of_week}`.

    Its period must be that of the algorithm. Stored per period and user: bins and sums of scores
    per gap bin. The result has the means over the run, per user. Minutes of a day depend on each
    other: for intervals compare runs, or days, not minutes.
    """

    unit: ClassVar[str] = "all gaps"
    units: ClassVar[Mapping[str, str]] = {
        "log_loss": "nats, 0 is best",
        "top_1": "share of minutes told right",
        "ece": "share too sure, or too unsure",
        "skill": "1 is best, 0 the room seen last",
        "reference_skill": "1 is best, 0 the reference",
    }

    of: str = Field(description="the algorithm whose presence is scored")
    period: PositiveDuration = Field(
        default=timedelta(minutes=5), description="how often it is updated; that of the algorithm"
    )
    given_home: bool = Field(default=False, description="whether only bins at home count")
    reference: str | None = Field(
        default=None, description="another algorithm, by which the skill is measured, too"
    )

    def reads(self) -> tuple[str, ...]:
        """Return the algorithm that it scores, and that which it compares it with."""
        return (self.of,) if self.reference is None else (self.of, self.reference)

    def start(self, home: "Home") -> None:
        """Begin scoring."""
        self.beliefs = [Belief(name) for name in self.reads()]
        self.last: dict[str, tuple[int, int]] = {}  # step and room of the last right sighting
        self.kept: dict[str, list[Scored]] = {}

    def update(self, history: History, state: "Present") -> Any:
        """Score the bins of the period; return a row for each user and gap bin that came up."""
        size = steps_of_bin(round(history.step_s * 1e6))
        ends = np.arange(-(-(history.first + 1) // size) * size, history.end + 1, size) - 1
        believed, *compared = [belief.at(history, state, ends) for belief in self.beliefs]
        rows: list[tuple[Any, ...]] = []
        for row, user in enumerate(state.users):
            gap, last = self._sightings(user, row, history, ends)
            if believed is None:
                continue
            told = [
                None if found is None else self._places(found[0][:, row], found[1][:, row])
                for found in (believed, *compared)
            ]
            scored = self._scored(user, told, gap, last, history, ends)
            self.kept.setdefault(user, []).append(scored)
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
        """Return the probability of each place that is scored: rooms, and away if that is one."""
        if self.given_home:
            return home
        return np.concatenate([home * (1 - away)[:, None], away[:, None]], axis=1)

    def _sightings(self, user: str, row: int, history: History, ends: I64) -> tuple[I64, I64]:
        """Return the steps since the last right sighting at the ends of bins, and its room."""
        observed = history.observations
        right = (observed.user == row) & (history.truth.user == row)
        before = self.last.get(user, (NEVER, NEVER))
        steps = np.concatenate([[before[0]], observed.step[right]]).astype(np.int64)
        rooms = np.concatenate([[before[1]], observed.room[right]]).astype(np.int64)
        at = np.searchsorted(steps, ends, side="right") - 1
        self.last[user] = int(steps[-1]), int(rooms[-1])
        return np.where(steps[at] == NEVER, NEVER, ends - steps[at]), rooms[at]

    def _scored(
        self,
        user: str,
        told: list[F64 | None],
        gap: I64,
        last: I64,
        history: History,
        ends: I64,
    ) -> Scored:
        poses, at = history.poses(user), ends - history.first
        gone, room = poses.away[at], poses.room[at].astype(np.int64)
        belief = told[0]
        assert belief is not None
        reference = np.full_like(belief, np.nan)[:, : None if told[1:] else 0]
        for other in told[1:]:
            reference = reference if other is None else other
        minutes = gap * history.step_s / 60
        label = np.where(gap == NEVER, UNSEEN, np.searchsorted(GAP_ENDS, minutes))
        truth = np.where(gone, belief.shape[1] - 1, room)
        # Beside all rooms nothing is right.
        counts = ~gone & (room != NOWHERE) if self.given_home else gone | (room != NOWHERE)
        return Scored(label, truth, last, belief, reference).of(counts)

    def result(self) -> dict[str, Any]:
        """Return {user: {gap bin: scores, "all": scores}}."""
        found: dict[str, Any] = {}
        for user, parts in self.kept.items():
            scored = Scored(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))
            groups = {name: scored.gap == g for g, name in enumerate(GAPS)}
            groups[ALL] = np.ones(len(scored.gap), bool)
            scores = {
                name: self._means(scored.of(mine)) for name, mine in groups.items() if mine.any()
            }
            if scores:
                found[user] = scores
        return found

    def _means(self, scored: Scored) -> dict[str, float]:
        belief, truth = scored.belief, scored.truth
        means = _mean_scores(belief, truth)
        guess = _mean_scores(self._naive(scored), truth)
        found = {
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
        known = ~np.isnan(scored.reference).any(axis=1)
        if self.reference is not None and known.any():
            mine = float(log_loss(belief[known], truth[known]).mean())
            other = _mean_scores(scored.reference[known], truth[known])
            found |= {f"reference_{name}": value for name, value in other.items()}
            found["reference_skill"] = skill(mine, other["log_loss"])
        return found

    def _naive(self, scored: Scored) -> F64:
        """Return the naive guess: the last room, for sure, or all rooms alike."""
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


def _sums(scored: Scored) -> list[tuple[str, int, float, float, float]]:
    """Return bins and sums of scores of each gap bin that came up."""
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
