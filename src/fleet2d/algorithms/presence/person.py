"""The stays of one person: a hidden Markov model, learned from all days."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from fleet2d.algorithms.presence.counts import Bins
from fleet2d.kernels.smoothing import smooth
from fleet2d.kernels.stays import Moments, StayModel, Stretches, follow

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

# Mean length of a stay before anything was learned, and of the first and last of several stages.
# All in bins.
STAY = 120.0
SHORT, LONG = 5.0, 240.0


class StateLayout(NamedTuple):
    """The states of a person's model.

    Attributes:
        room: int64 (patches + 1,), the room of each patch; the last is away, one past the rooms.
        spread: float64 (patches + 1,), the share of each patch in the floor of its room.
        rooms: Number of rooms.
        stages: Number of stages of a stay.
        possible: float64 (rooms + 1,), 1 for the places where the person may be, 0 for the others.
    """

    room: I64
    spread: F64
    rooms: int
    stages: int
    possible: F64

    @classmethod
    def of(cls, bins: Bins, stages: int) -> Self:
        """Return the states for the rooms and patches of evidence."""
        room, cells = bins.parts.room, bins.parts.cells
        rooms = bins.watched.shape[1]
        floor = np.maximum(cells, 1)
        spread = np.append(floor / np.bincount(room, floor, minlength=rooms)[room], 1.0)
        return cls(np.append(room, rooms), spread, rooms, stages, np.ones(rooms + 1))

    @property
    def anywhere(self) -> F64:
        """The uninformed distribution, equal for rooms and away: (stages, patches + 1)."""
        spread = self.spread * self.possible[self.room]
        return np.tile(spread / (self.possible.sum() * self.stages), (self.stages, 1))

    def unknown_view(self) -> I64:
        """Return -1, for unknown, as the part of each patch in view: int64 (patches + 1,)."""
        return np.full(len(self.room), -1, np.int64)

    def no_moments(self) -> Moments:
        """Return moments that are all zero."""
        places, nodes = self.rooms + 1, (self.rooms + 1) * self.stages
        return Moments(
            np.zeros(nodes),
            np.zeros((nodes, places + 1)),
            np.zeros(len(self.room)),
            np.zeros(places),
            np.zeros(places),
        )


class Prior(NamedTuple):
    """What is assumed of a person before anything was learned.

    Attributes:
        detection: Probability that a person in view is perceived.
        restless: Probability per bin that a person in a room changes patch.
    """

    detection: float
    restless: float


def model_of(moments: Moments, layout: StateLayout, prior: Prior) -> StayModel:
    """Return the most probable transitions: expected counts by expected time, with a prior.

    The prior of a stage is one end after STAY bins (with several stages, 5 to 240 bins), and one
    next room, distributed as rooms are entered overall; with several stages, half of it goes to the
    next stage. The prior of a room is one arrival, spread over its floor, and one change of patch
    after 1 / `restless` bins.
    """
    places, stages = layout.rooms + 1, layout.stages
    lengths = np.linspace(SHORT, LONG, stages) if stages > 1 else np.array([STAY])
    ends = moments.exits.sum(axis=1)
    stay = 1 - (ends + 1) / (moments.time + np.tile(lengths, places))
    entered = moments.exits[:, :places].sum(axis=0) + layout.possible / layout.possible.sum()
    others = np.tile(entered, (places, 1))
    np.fill_diagonal(others, 0.0)
    others = np.repeat(others / others.sum(axis=1, keepdims=True), stages, axis=0)
    next_stage = np.tile(np.arange(stages) < stages - 1, places) / 2
    prior_exits = np.concatenate([others * (1 - next_stage)[:, None], next_stage[:, None]], axis=1)
    follow = (moments.exits + prior_exits) / (ends + 1)[:, None]
    spread = moments.arrivals + layout.spread
    spread = spread / np.bincount(layout.room, spread)[layout.room]
    trials = moments.moves + moments.rests + 1 / max(prior.restless, 1e-6)
    restless = (moments.moves + 1) / np.maximum(trials, 1)
    restless[-1] = 0.0  # away has no patches
    first = np.searchsorted(layout.room, np.arange(places + 1)).astype(np.int64)
    return StayModel(stay, follow, spread, np.minimum(restless, 1), first, prior.detection)


class StretchPlaces(NamedTuple):
    """Where a person was in consecutive stretches of bins.

    Attributes:
        probability: float64 (stretches, rooms + 1), of each room, and of away.
        bins: int64 (stretches,), number of bins of each stretch.
    """

    probability: F64
    bins: I64

    @property
    def by_bin(self) -> F64:
        """The probability in each bin: float64 (bins, rooms + 1)."""
        return np.repeat(self.probability, self.bins, axis=0)


@dataclass
class PersonDay:
    """The messages to one day of a person, and the statistics learned from it.

    Attributes:
        start: float64 (stages, patches), the distribution before the day.
        backward: float64 (stages, patches), the backward message from later days: the likelihood
            of their evidence given each state.
        moments: The expected sufficient statistics of the day.
    """

    start: F64
    backward: F64
    moments: Moments


class Person:
    """The model of one user.

    Attributes:
        model: The transition probabilities.
        total: Sum of the moments of all days, with decayed weights of older ones.
        now: float64 (stages, patches), the distribution after the last bin.
        days: The finished days that are still revisited.
    """

    def __init__(self, layout: StateLayout, prior: Prior) -> None:
        """Begin with the prior."""
        self.layout, self.prior = layout, prior
        self.total = layout.no_moments()
        self.model = model_of(self.total, layout, prior)
        self.now = self.day_start = layout.anywhere
        self.ones = np.ones_like(self.now)
        self.days: list[PersonDay] = []

    def confine(self, possible: F64) -> None:
        """Let the person be in some places only: float64 (rooms + 1,), as `possible`."""
        self.layout = self.layout._replace(possible=possible)
        self.model = model_of(self.total, self.layout, self.prior)
        self.now, self.day_start = self._within(self.now), self._within(self.day_start)

    def _within(self, places: F64) -> F64:
        """Return a distribution without the places where the person can't be."""
        rest = places * self.layout.possible[self.layout.room]
        return rest / rest.sum() if rest.any() else self.layout.anywhere

    @property
    def length_of_stay(self) -> F64:
        """Mean length of a stay in each room, and away [bins]: float64 (rooms + 1,)."""
        places = self.layout.rooms + 1
        time = self.total.time.reshape(places, -1).sum(axis=1)
        ends = self.total.exits[:, :places].reshape(places, -1).sum(axis=1)
        return (time + STAY) / (ends + 1)

    def follow(self, stretches: Stretches) -> StretchPlaces:
        """Filter over the next stretches; return P(room | evidence up to the stretch)."""
        now = np.stack([np.zeros_like(self.now), self.now])
        places = follow(self.model, stretches, now, self.layout.unknown_view())
        self.now = now[0] + now[1]
        return StretchPlaces(places, stretches.bins)

    def end_day(self, stretches: Stretches) -> StretchPlaces:
        """Smooth the finished day as a whole, and learn from it."""
        moments = self.layout.no_moments()
        self.days.append(PersonDay(self.day_start, self.ones, moments))
        return self.revisit(len(self.days) - 1, 1.0, stretches)

    def revisit(self, number: int, weight: float, stretches: Stretches) -> StretchPlaces:
        """Smooth a day with the present model, and update the model by the difference.

        The day before and the next day get new boundary messages, which they use when they are
        revisited.

        Args:
            number: Index of the day in `days`.
            weight: Weight of the day.
            stretches: The evidence of the day.
        """
        day, moments = self.days[number], self.layout.no_moments()
        places, end, begin = smooth(self.model, stretches, day.start, day.backward, moments)
        if number > 0:
            self.days[number - 1].backward = begin
        if number + 1 < len(self.days):
            self.days[number + 1].start = end
        else:
            self.now = self.day_start = end
        self.total = Moments(
            *(
                np.maximum(total + weight * (new - old), 0.0)
                for total, new, old in zip(self.total, moments, day.moments, strict=True)
            )
        )
        day.moments = moments
        self.model = model_of(self.total, self.layout, self.prior)
        return StretchPlaces(places, stretches.bins)

    def fade(self, weight: float) -> None:
        """Multiply the moments learned so far by a weight."""
        if weight < 1:
            self.total = Moments(*(weight * part for part in self.total))

    def forget(self, count: int) -> None:
        """Keep the last `count` days only; the statistics of the others stay."""
        del self.days[:-count]

    def remember(self) -> dict[str, Any]:
        """Return the learned state, as arrays."""
        return self.total._asdict()

    def recall(self, learned: Mapping[str, Any]) -> bool:
        """Restore what `remember` returned; return whether it has the same rooms and stages."""
        arrays = {name: np.asarray(learned.get(name, ())) for name in Moments._fields}
        if any(arrays[name].shape != part.shape for name, part in self.total._asdict().items()):
            return False
        self.total = Moments(**{name: np.array(part, np.float64) for name, part in arrays.items()})
        self.model = model_of(self.total, self.layout, self.prior)
        return True
