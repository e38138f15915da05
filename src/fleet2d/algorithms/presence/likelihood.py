"""Full likelihood: rooms as a hidden Markov chain, of which empty views are evidence, too."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from fleet2d.algorithms.presence.chain import (
    Chain,
    Sensor,
    likelihood,
    unknown_seen,
    with_anyone,
)
from fleet2d.algorithms.presence.counts import Bins
from fleet2d.algorithms.presence.estimator import F64, Estimator, normalized
from fleet2d.component import register
from fleet2d.errors import ComponentError
from fleet2d.units import Share

# Days over after which all of them are gone through again.
REFITS = (1, 2, 4, 8, 16, 32, 64)
ROUNDS = 4  # of expectation and maximization in each


@register("presence_estimator", "likelihood", aliases=("hmm",))
class Likelihood(Estimator):
    """Expected share of time per room given all that was and wasn't seen, in a hidden Markov model.

    Each user is a chain that is in one room, or away, in each bin, and goes on by transition
    probabilities that are learned. A bin's evidence is explained by a room the better, the more
    the user was seen there, and the worse, the more of it was watched in vain
    (`fleet2d.algorithms.presence.chain`). Shares are the means of P(room | all evidence), by
    smoothing; transitions maximize the posterior by expectation and maximization (Baum and Welch),
    with one stay's worth of a prior.

    Within a day, each update smooths its own bins; at midnight the day is smoothed as a whole and
    its expected steps are added (incremental EM after Neal and Hinton). After 1, 2, 4, 8 … 64 days
    all days are gone through again, four times.

    Right when the robot acts on what it has perceived only (then where it looks can be ignored:
    missing at random, Rubin 1976) and sometimes looks everywhere. Breaks when the model is wrong:
    stays that differ much by time of day, people who follow each other, rooms never watched (there
    the prior speaks), users who are hardly ever recognized.

    Anyone is taken from all users, apart from each other, and unknown people where seen; without
    users it is one person's chain.
    """

    detection: Share = Field(
        default=0.95, description="chance a bin that somebody in view is perceived", gt=0, lt=1
    )
    restless: Share = Field(
        default=0.05, description="chance a bin that somebody changes place within a room"
    )
    views: int = Field(
        default=30, ge=1, description="independent views of a room in a bin in which a robot moves"
    )
    stages: int = Field(
        default=1, ge=1, le=4, description="of a stay; above 1 its length isn't geometric"
    )

    def begin(self, rooms: int, users: int, half_life: float | None = None) -> None:
        """Prepare for a run."""
        super().begin(rooms, users, half_life)
        self.sensor = Sensor(self.detection, self.restless, self.views)
        self.chains = [Chain(rooms, self.stages) for _ in range(max(users, 1))]
        self.before: tuple[F64, NDArray[np.int64]] | None = None
        self.dawn: tuple[F64, NDArray[np.int64]] | None = None
        self.parts: list[Bins] = []  # of the day under way
        self.memory: list[Bins] | None = []  # the days that are over, until the last refit
        self.track = np.zeros((0, users + 1, rooms + 1))

    def width(self, rooms: int) -> int:
        """Return how many numbers `sums` has: bins in each room, away, and all."""
        return rooms + 2

    def shares(self, sums: F64) -> tuple[F64, F64]:
        """Return expected bins per room by all at home, and those away by all."""
        bins = sums[..., -1]
        away = np.where(bins > 0, sums[..., -2] / np.where(bins > 0, bins, 1), 0.0)
        return normalized(np.maximum(sums[..., :-2], 0)), np.clip(away, 0, 1)

    def observe(self, bins: Bins) -> None:
        """Take in evidence that follows on that before.

        `track` is then what was believed after each of its bins: float64 (bins, users + 1,
        rooms + 1), away last.
        """
        track = [np.zeros((0, self.users + 1, self.rooms + 1))]
        ends = [*(np.flatnonzero(np.diff(bins.day)) + 1).tolist(), len(bins.day)]
        begin = 0
        for end in ends:
            if begin < end:
                track.append(self._observe_day(bins.part(begin, end)))
            begin = end
        self.track = np.concatenate(track)

    def _observe_day(self, bins: Bins) -> F64:
        day = int(bins.day[0])
        if day != self.counts.today:
            if self.parts:
                self._end_day(day)
            self.counts.begin_day(day)
            self.dawn = self.before
            for chain in self.chains:
                chain.dawn = chain.now
        weight = np.ones(len(bins.day))
        smoothed, filtered = [], []
        for user, chain in enumerate(self.chains):
            likely = likelihood(bins, user, self.before, self.sensor)
            # Expected steps are counted when the day is over.
            places, states = chain.smooth(likely, chain.now, weight, np.zeros_like(chain.prior))
            chain.now = states[-1].copy()
            smoothed.append(places)
            filtered.append(chain.places(states))
        self.counts.add(bins.day, bins.minute, self._values(smoothed, bins))
        self.before = bins.watched[-1], bins.seen[-1]
        self.parts.append(bins)
        return self._rows(filtered, bins)

    def _rows(self, chains: list[F64], bins: Bins) -> F64:
        return with_anyone(chains, unknown_seen(bins)) if self.users else chains[0][:, None]

    def _values(self, chains: list[F64], bins: Bins) -> F64:
        rows = self._rows(chains, bins)
        return np.concatenate([rows, np.ones((*rows.shape[:2], 1))], axis=2)

    def _end_day(self, following: int) -> None:
        """Smooth the day under way as a whole, learn from it, and at times from all days."""
        day, self.parts = joined(self.parts), []
        smoothed = []
        for user, chain in enumerate(self.chains):
            pairs = np.zeros_like(chain.prior)
            likely = likelihood(day, user, self.dawn, self.sensor)
            smoothed.append(chain.smooth(likely, chain.dawn, np.ones(len(likely)), pairs)[0])
            chain.pairs = (chain.pairs + pairs) * self.counts.faded(following - self.counts.today)
            chain.learn()
        self.counts.hours = by_hour(day, self._values(smoothed, day))[0]
        if self.memory is None:
            return
        self.memory.append(day)
        if len(self.memory) in REFITS:
            self._refit(self.memory)
        if len(self.memory) == REFITS[-1]:
            self.memory = None

    def _refit(self, memory: list[Bins]) -> None:
        """Go through all days again, until transitions hardly change."""
        bins, today = joined(memory), self.counts.today
        days, index = np.unique(bins.day, return_inverse=True)
        weight = np.array([self.counts.faded(today - day) for day in days.tolist()])[index]
        smoothed = []
        for user, chain in enumerate(self.chains):
            likely = likelihood(bins, user, None, self.sensor)
            start = np.full(len(chain.prior), 1 / len(chain.prior))
            for _ in range(ROUNDS):
                pairs = np.zeros_like(chain.prior)
                places, states = chain.smooth(likely, start, weight, pairs)
                chain.pairs = pairs
                chain.learn()
            smoothed.append(places)
            chain.now = states[-1].copy()
        hours = by_hour(bins, self._values(smoothed, bins))
        self.counts.hours = hours[-1]
        self.counts.replace(hours[:-1])

    def remember(self) -> dict[str, Any]:
        """Return all that was learned, as arrays in mappings."""
        chains = {
            str(i): {"transition": chain.transition, "pairs": chain.pairs}
            for i, chain in enumerate(self.chains)
        }
        return {**super().remember(), "chains": chains}

    def recall(self, learned: Mapping[str, Any], today: int) -> None:
        """Go on from what `remember` returned; called after `begin`."""
        super().recall(learned, today)
        for i, chain in enumerate(self.chains):
            found = learned.get("chains", {}).get(str(i), {})
            if np.shape(found.get("transition")) != chain.prior.shape:
                raise ComponentError(
                    f"what was learned has no transitions between {len(chain.prior)} states: it is"
                    " from another estimator, or one with other stages"
                )
            chain.transition = np.array(found["transition"], np.float64)
            chain.pairs = np.array(found["pairs"], np.float64)
        self.memory = None


def joined(parts: list[Bins]) -> Bins:
    """Return bins that follow each other as one."""
    return Bins(
        np.concatenate([part.day for part in parts]),
        np.concatenate([part.minute for part in parts]),
        parts[0].bin_steps,
        np.concatenate([part.watched for part in parts]),
        np.concatenate([part.seen for part in parts]),
    )


def by_hour(bins: Bins, values: F64) -> F64:
    """Sum the values of bins by day and hour: float64 (days, 24, *)."""
    days = np.unique(bins.day)
    slot = np.searchsorted(days, bins.day) * 24 + bins.minute // 60
    first = np.concatenate([[0], np.flatnonzero(np.diff(slot)) + 1])
    sums = np.zeros((len(days) * 24, *values.shape[1:]))
    sums[slot[first]] = np.add.reduceat(values, first, axis=0)
    return sums.reshape(len(days), 24, *values.shape[1:])
