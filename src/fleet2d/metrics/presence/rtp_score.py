"""How well real-time presence tells where users are, by how long ago they were seen."""

from collections.abc import Mapping
from datetime import timedelta
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from fleet2d.algorithms.evidence import steps_of_bin
from fleet2d.algorithms.history import History
from fleet2d.algorithms.observations import NOWHERE
from fleet2d.algorithms.presence.belief import Presence
from fleet2d.component import register
from fleet2d.errors import ComponentError
from fleet2d.metrics.metric import Metric
from fleet2d.metrics.presence.believed import presence_of
from fleet2d.metrics.presence.scores import (
    brier_score,
    calibration_error,
    log_loss,
    skill,
    top_1,
)
from fleet2d.units import PositiveDuration

if TYPE_CHECKING:
    from fleet2d.algorithms.algorithm import Present
    from fleet2d.floorplan.home import Home

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

# Upper ends of the bins of the gap since a user was last seen [min], and their names.
GAP_ENDS = (1, 5, 15, 60, 240)
GAPS = ("0-1 min", "1-5 min", "5-15 min", "15-60 min", "1-4 h", "over 4 h")
ALL = "all"
SHOWN = ("log_loss", "brier", "top_1", "skill")  # in the closing table
NEVER = -1


@register("metric", "rtp_score")
class RtpScore(Metric):
    """Scores of real-time presence, minute by minute, by last-seen gap, and of the naive guess.

    At the end of every bin (a minute, or a step where that is longer) what was believed then is
    compared with the room that the user was in, or away, which is one more place (with
    `given_home` bins away are left out, and shares are given at home). What was believed is the
    algorithm's track of the bin, which uses evidence up to its end and none after; an algorithm
    without one is asked for a forecast: its newest output before, `at` that time.

    The gap is the time since a robot last perceived that user rightly. Per gap bin and over all:

    - log_loss: mean of -ln p(truth), p raised to 1e-6 at least [nats];
    - brier: mean of sum over places of (p - 1{truth})^2, 0 to 2;
    - top_1: share of bins in which the likeliest place was right (ties share);
    - ece: expected calibration error, 15 groups of equal size by confidence;
    - naive_log_loss, naive_brier, naive_top_1: of the room of the last right sighting, for sure,
      and all rooms alike before the first;
    - skill: 1 - log_loss / naive_log_loss.

    Its period must be that of the algorithm. Stored per period and user: bins and sums of scores
    per gap bin. The result has the means over the run, per user.
    """

    unit: ClassVar[str] = "per user and last-seen gap"

    of: str = Field(description="the algorithm whose presence is scored")
    period: PositiveDuration = Field(
        default=timedelta(minutes=5), description="how often it is updated; that of the algorithm"
    )
    given_home: bool = Field(default=False, description="whether only bins at home count")

    def reads(self) -> tuple[str, ...]:
        """Return the algorithm that it scores."""
        return (self.of,)

    def start(self, home: "Home") -> None:
        """Begin scoring."""
        self.before: Presence | None = None
        self.last: dict[str, tuple[int, int]] = {}  # step and room of the last right sighting
        self.kept: dict[str, list[tuple[I64, I64, F64, F64]]] = {}

    def update(self, history: History, state: "Present") -> Any:
        """Score the bins of the period; return a row for each user and gap bin that came up."""
        presence = presence_of(self.of, state)
        step_us = round(history.step_s * 1e6)
        size = steps_of_bin(step_us)
        ends = np.arange(-(-(history.first + 1) // size) * size, history.end + 1, size) - 1
        believed = self._believed(presence, history, state, ends)
        self.before = presence if presence is not None else self.before
        rows: list[tuple[str, str, int, float, float, float]] = []
        for row, user in enumerate(state.users):
            gap, last = self._sightings(user, row, history, ends)
            if believed is not None:
                home, away = believed
                rows += self._score(user, home[:, row], away[:, row], gap, last, history, ends)
        if not rows:
            return None
        names = ("user", "gap", "bins", "log_loss", "brier", "top_1")
        columns = dict(zip(names, zip(*rows, strict=True), strict=True))
        return {
            name: np.array(values, dtype=object if name in ("user", "gap") else None)
            for name, values in columns.items()
        }

    def _believed(
        self, presence: Presence | None, history: History, state: "Present", ends: I64
    ) -> tuple[F64, F64] | None:
        """Return what was believed at the ends of bins: shares of rooms and of away, by bin."""
        if presence is not None and presence.track is not None:
            track = presence.track
            last = track.begin + len(track.away) * track.bin_steps - 1
            if not len(ends):
                return None
            begin = int(ends[0]) + 1 - track.bin_steps
            if last < history.first:  # an old one: it had no whole bin in this period
                return None
            if track.begin != begin or last != ends[-1]:
                raise ComponentError(
                    f"algorithms.{self.of} tells of the steps {track.begin} to {last}, but this"
                    f" metric's period has the whole bins {begin} to {int(ends[-1])}: give both the"
                    " same period"
                )
            return track.home, track.away
        if self.before is None or not len(ends):
            return None
        times = [state.start + timedelta(seconds=(int(e) + 1) * history.step_s) for e in ends]
        arrays = [self.before.at(time).arrays for time in times]
        return np.array([home for home, _ in arrays]), np.array([away for _, away in arrays])

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

    def _score(
        self, user: str, home: F64, away: F64, gap: I64, last: I64, history: History, ends: I64
    ) -> list[tuple[str, str, int, float, float, float]]:
        poses, at = history.poses(user), ends - history.first
        gone, room = poses.away[at], poses.room[at].astype(np.int64)
        scored = ~gone if self.given_home else gone | (room != NOWHERE)
        scored &= gone | (room != NOWHERE)  # beside all rooms: nothing is right
        rooms = home.shape[1]
        truth = np.where(gone, rooms, room)[scored]
        naive = np.where(last[:, None] == NEVER, 1 / rooms, last[:, None] == np.arange(rooms))
        if not self.given_home:
            home = np.concatenate([home * (1 - away)[:, None], away[:, None]], axis=1)
            naive = np.concatenate([naive, np.zeros((len(naive), 1))], axis=1)
        minutes = gap * history.step_s / 60
        label = np.where(gap == NEVER, len(GAP_ENDS), np.searchsorted(GAP_ENDS, minutes))[scored]
        found, guess = home[scored], naive[scored]
        self.kept.setdefault(user, []).append((label, truth, found, guess))
        values = np.stack(
            [log_loss(found, truth), brier_score(found, truth), top_1(found, truth)], axis=1
        )
        return [
            (user, GAPS[g], int((label == g).sum()), *values[label == g].sum(axis=0).tolist())
            for g in range(len(GAPS))
            if (label == g).any()
        ]

    def result(self) -> dict[str, Any]:
        """Return {user: {gap bin: scores, "all": scores}}."""
        found: dict[str, Any] = {}
        for user, parts in self.kept.items():
            label, truth, belief, naive = (np.concatenate(p) for p in zip(*parts, strict=True))
            groups = {name: label == g for g, name in enumerate(GAPS)}
            groups[ALL] = np.ones(len(label), bool)
            scores = {
                name: _summary(truth[mine], belief[mine], naive[mine])
                for name, mine in groups.items()
                if mine.any()
            }
            if scores:
                found[user] = scores
        return found

    @classmethod
    def summary(cls, result: Mapping[str, Any]) -> Mapping[str, Any]:
        """Return each user's main scores over all gaps."""
        return {
            user: {name: scores[ALL][name] for name in SHOWN} for user, scores in result.items()
        }


def _summary(truth: I64, belief: F64, naive: F64) -> dict[str, float]:
    means = {
        f"{prefix}{name}": float(score(p, truth).mean())
        for prefix, p in (("", belief), ("naive_", naive))
        for name, score in (("log_loss", log_loss), ("brier", brier_score), ("top_1", top_1))
    }
    return {
        "bins": len(truth),
        **means,
        "ece": calibration_error(belief, truth),
        "skill": skill(means["log_loss"], means["naive_log_loss"]),
    }
