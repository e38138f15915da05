"""Habits: questions about a person's week, answered from long-term presence."""

from datetime import datetime, timedelta
from typing import Any

import numpy as np

from fleet2d.algorithms.algorithm import Present
from fleet2d.algorithms.history import History
from fleet2d.algorithms.presence.belief import HOURS, presence_of
from fleet2d.kernels import F64, I64
from fleet2d.metrics.ltp_error import LongTermMetric, as_columns, steps_by_hour

MONDAY = datetime(2026, 1, 5)
USUALLY = 0.5  # share of the time from which on somebody is usually there


def answer_scores(truth: F64, belief: F64) -> dict[str, float]:
    """Score answers about hours of the week: is somebody usually home then, and where?

    Args:
        truth: float64 (hours, places), the true share of each place in these hours, away last.
        belief: float64 (hours, places), what is believed.

    Returns:
        The measures of `Habits`.

    Example:
        >>> truth = np.array([[0.9, 0.1], [0.2, 0.8], [0.6, 0.4]])
        >>> scores = answer_scores(truth, np.array([[1.0, 0.0], [0.4, 0.6], [0.3, 0.7]]))
        >>> {name: round(score, 2) for name, score in scores.items()}
        {'home': 0.67, 'always_home': 0.67, 'away_f1': 0.67, 'place': 0.67, 'probability': 0.2}
    """
    is_away = truth[:, -1] > USUALLY
    told_away = belief[:, -1] > USUALLY
    answered = truth[np.arange(len(truth)), belief.argmax(axis=1)]
    either = is_away.sum() + told_away.sum()
    return {
        "home": float((is_away == told_away).mean()),
        "always_home": float(1 - is_away.mean()),
        "away_f1": float(2 * (is_away & told_away).sum() / either) if either else 1.0,
        "place": float((answered == truth.max(axis=1)).mean()),
        "probability": float(np.abs(truth[:, -1] - belief[:, -1]).mean()),
    }


class Habits(LongTermMetric):
    """Questions about a user's week, such as "when is Ben usually home on Thursdays?".

    Each hour of the week that there was is asked about. Answers come from the presence that `of`
    believes for that hour, the truth is where the user really was in it, on all its weeks:

    - home: share of the hours of which it tells rightly whether the user is usually home, which is
      at least half of the time;
    - always_home: the same for the naive answer that the user always is;
    - away_f1: harmonic mean of precision and recall for the hours when the user is usually away;
    - place: share of the hours for which its likeliest place is where the user is most often;
    - probability: mean difference of the probability to be away from the true share.

    Stored per period and user; the result has the values at the end. It is of use with `by:
    hour_of_week`: other presence answers alike for all hours.
    """

    unit = "at the end"
    units = {
        "home": "share of hours told rightly",
        "always_home": "the same without looking",
        "place": "share of hours told rightly",
        "probability": "difference to the truth",
    }
    least = {"": 0}
    largest = {"": 1}
    better = {"": "higher", "probability": "lower"}

    def start(self, home: Any) -> None:
        """Begin counting."""
        super().start(home)
        self.last: dict[str, dict[str, float]] = {}

    def update(self, history: History, state: Present) -> Any:
        """Ask about each hour of the week so far; return a row for each user."""
        counts, _ = self.count(steps_by_hour(history, state), history)
        presence = presence_of(self.of, state)
        if presence is None or not state.users:
            return None
        hours = [MONDAY + timedelta(hours=hour) for hour in range(HOURS)]
        home, away = zip(*(presence.at(hour).arrays for hour in hours), strict=True)
        away_share = np.array(away)[..., np.newaxis]
        belief = np.concatenate([np.array(home) * (1 - away_share), away_share], axis=2)
        for row, user in enumerate(state.users):
            self.last[user] = self._ask(counts[:, row], belief[:, row])
        columns = as_columns([self.last[user] for user in state.users])
        return {"user": np.array(state.users, dtype=object), **columns}

    def _ask(self, steps: I64, belief: F64) -> dict[str, float]:
        total = steps.sum(axis=1)
        lived = total > 0
        return answer_scores(steps[lived] / total[lived, np.newaxis], belief[lived])

    def result(self) -> dict[str, Any]:
        """Return {user: {home, always_home, away_f1, place, probability}} at the end."""
        return self.last
