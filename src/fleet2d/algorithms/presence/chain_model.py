"""Models of real-time presence that follow a person from room to room: the chains."""

from collections.abc import Mapping, Sequence
from datetime import datetime, timedelta
from typing import Any, ClassVar

import numpy as np
from pydantic import Field

from fleet2d.algorithms.presence.belief import Presence, Track
from fleet2d.algorithms.presence.chain import (
    Chain,
    Sensor,
    likelihood,
    unknown_seen,
    with_anyone,
)
from fleet2d.algorithms.presence.counts import Bins
from fleet2d.algorithms.presence.estimator import F64, normalized
from fleet2d.algorithms.presence.likelihood import Likelihood
from fleet2d.algorithms.presence.model import Model
from fleet2d.component import register
from fleet2d.kernels.presence import advance, forward
from fleet2d.units import Share

FARTHEST = 10_080  # bins ahead, beyond which a forecast stays as it is


class ChainPresence(Presence):
    """Presence that goes on by transitions: the later the time, the more like that of all time."""

    def __init__(
        self,
        users: Sequence[str],
        chains: Sequence[tuple[Chain, F64]],
        time: datetime,
        bin_us: int,
        track: Track | None = None,
    ) -> None:
        """Keep where the chains are.

        Args:
            users: Names of the users; without any there is one chain, of anyone.
            chains: Each with the probability of its states.
            time: The local time it is of.
            bin_us: Length of a bin [us].
            track: What was believed on the way here; its end is taken for now.
        """
        self._chains, self._bin_us = tuple(chains), bin_us
        if track is None:
            places = [chain.places(states[np.newaxis]) for chain, states in chains]
            home, away = split(rows(places, len(users), None))
        else:
            home, away = track.home, track.away
        super().__init__(users, home[-1], away[-1], time, track=track)

    def at(self, time: datetime) -> "ChainPresence":
        """Return the forecast of a later time, in whole bins; of an earlier one, itself."""
        bins = min((time - self.time) // timedelta(microseconds=self._bin_us), FARTHEST)
        if bins <= 0:
            return self
        ahead = [(chain, advance(now, chain.transition, bins)) for chain, now in self._chains]
        return ChainPresence(self.users, ahead, time, self._bin_us)


def rows(places: list[F64], users: int, bins: Bins | None) -> F64:
    """Return everybody's places, anyone's last: float64 (bins, users + 1, rooms + 1)."""
    if not users:
        return places[0][:, np.newaxis]
    unknown = np.zeros((len(places[0]), places[0].shape[1] - 1), bool)
    return with_anyone(places, unknown if bins is None else unknown_seen(bins))


def split(everybody: F64) -> tuple[F64, F64]:
    """Return places as shares of rooms given at home, and of away."""
    return normalized(np.maximum(everybody[..., :-1], 0)), np.clip(everybody[..., -1], 0, 1)


@register("presence_model", "hmm")
class Filter(Model):
    """The filter of a hidden Markov model: P(room now | all evidence so far).

    From bin to bin what is believed goes on by the transitions, and is weighed by the evidence:
    rooms watched in vain lose (negative information). Transitions are learned on the way as by the
    `likelihood` estimator, whose keys these are.

    Right where stays are about geometric in length. Breaks when routines differ by time of day.
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
    stages: ClassVar[int] = 1

    def begin(self, rooms: int, users: int, day: int) -> None:
        """Prepare for a run."""
        super().begin(rooms, users, day)
        self.day = day
        self.learner = Likelihood(
            detection=self.detection,
            restless=self.restless,
            views=self.views,
            stages=self.stages,
        )
        self.learner.begin(rooms, users)

    def observe(self, bins: Bins) -> tuple[F64, F64]:
        """Return the filtered belief after each bin."""
        self.learner.observe(bins)
        return split(self.learner.track)

    def presence(self, users: Sequence[str], time: datetime, bin_us: int, track: Track) -> Presence:
        """Return what is believed now, and by `at` the forecast."""
        return ChainPresence(users, self.states(), time, bin_us, track)

    def states(self) -> list[tuple[Chain, F64]]:
        """Return each chain as it is now, which doesn't change, and the probability of states."""
        return [(chain.frozen(), chain.now) for chain in self.learner.chains]

    def remember(self) -> dict[str, Any]:
        """Return all that was learned, as arrays in mappings."""
        return self.learner.remember()

    def recall(self, learned: Mapping[str, Any]) -> None:
        """Go on from what `remember` returned; called after `begin`."""
        self.learner.recall(learned, self.day)


@register("presence_model", "semi_markov")
class SemiMarkov(Filter):
    """The filter with stays in stages, so that how long a stay has lasted matters.

    A hidden semi-Markov model whose lengths of stay are Coxian distributions: a stay passes its
    stages in order and may end in each. With two, who has just come may soon go on, while who has
    been there for long stays for long; or the other way round, as is learned.
    """

    stages: ClassVar[int] = 2


@register("presence_model", "markov")
class MarkovDecay(Filter):
    """The row of P^g of the room in which the user was perceived last, g bins ago.

    P are the transitions, learned as by `hmm`; but here views in vain tell nothing. Before the
    first sighting it is what the transitions lead to from anywhere.
    """

    def begin(self, rooms: int, users: int, day: int) -> None:
        """Prepare for a run."""
        super().begin(rooms, users, day)
        self.now = [chain.now for chain in self.learner.chains]

    def observe(self, bins: Bins) -> tuple[F64, F64]:
        """Return the decayed belief after each bin."""
        places = []
        sensor = Sensor(self.detection, self.restless, self.views, negative=False)
        for user, chain in enumerate(self.learner.chains):
            likely = likelihood(bins, user, None, sensor)
            found = forward(chain.transition, self.now[user], likely, np.empty(len(likely)))
            self.now[user] = found[-1].copy() if len(found) else self.now[user]
            places.append(found)
        self.learner.observe(bins)
        return split(rows(places, self.users, bins))

    def states(self) -> list[tuple[Chain, F64]]:
        """Return each chain as it is now, which doesn't change, and the probability of states."""
        return [
            (chain.frozen(), now) for chain, now in zip(self.learner.chains, self.now, strict=True)
        ]
