"""Thompson sampling: ask with the probability that asking is worth it, by what is known so far."""

import math

import numpy as np
from pydantic import Field

from fleet2d.algorithms.timing.timing import HOURS, Asked, TimingPolicy
from fleet2d.configuration.components import register
from fleet2d.configuration.units import Share
from fleet2d.kernels import F64
from fleet2d.runtime.determinism import logistic


@register("timing_policy", "thompson")
class ThompsonTiming(TimingPolicy):
    """Ask with the probability that a yes is likelier than usual, given the answers so far.

    A contextual bandit with probability matching (Thompson 1933): where little is known, that
    probability is near a half, so that it explores; it stops where the answers are clear. The
    rate of yes in a cell of hours and rooms is a beta variable, whose distribution is approximated
    by a logistic one; each answer counts in neighboring hours, and in other rooms, by a part.

    Attributes:
        ask_at: Minimum probability of a yes that is worth asking; null: the share of yeses so
            far, so that it asks at the better times of the day.
        min_chance: Minimum probability of asking anywhere: off-policy estimates need one above 0.
        prior: Number of imagined answers, at even odds.
    """

    ask_at: Share | None = 0.5
    min_chance: Share = 0.02
    prior: float = Field(default=2.0, gt=0)

    def start(self, rooms: int) -> None:
        """Begin with imagined answers only."""
        super().start(rooms)
        self.answers = [0.6 * self.prior, self.prior]  # yeses, and all
        self.yes = np.full((HOURS, rooms), self.prior * 0.6)
        self.no = np.full((HOURS, rooms), self.prior * 0.4)

    def learn(self, asked: Asked) -> None:
        """Count an answer, and less of it near by."""
        self.answers[0] += asked.was_accepted
        self.answers[1] += 1
        counts = self.yes if asked.was_accepted else self.no
        for hour, near in ((-2, 0.25), (-1, 0.5), (0, 1.0), (1, 0.5), (2, 0.25)):
            row = counts[(asked.hour + hour) % HOURS]
            row += 0.3 * near
            if asked.room >= 0:
                row[asked.room] += 0.7 * near

    def chances(self) -> F64:
        """Return the probability that the rate of yes is above `ask_at`."""
        ask_at = self.answers[0] / self.answers[1] if self.ask_at is None else self.ask_at
        chances = np.empty((HOURS, self.rooms))
        for hour in range(HOURS):
            for room in range(self.rooms):
                yes, no = float(self.yes[hour, room]), float(self.no[hour, room])
                total = yes + no
                spread = math.sqrt(yes * no / (total * total * (total + 1)))
                above = logistic(1.7 * (yes / total - ask_at) / spread)
                chances[hour, room] = max(self.min_chance, min(above, 1.0))
        return chances
