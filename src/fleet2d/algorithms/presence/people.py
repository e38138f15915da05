"""The stays of people: hidden Markov models, learned from the evidence of all days."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Self

import numpy as np

from fleet2d.algorithms.evidence import Evidence
from fleet2d.kernels import (
    F64,
    I64,
    U8,
    DayEvidence,
    Moments,
    PeoplePlaces,
    StayModel,
    Stretches,
    follow_people,
    learned_stays,
    merge_bins,
    smooth_people,
    watched_views,
)

# Mean length of a stay before anything was learned, and of the first and last of several stages.
# All in bins.
MEAN_STAY = 120.0
SHORTEST_STAGE = 5.0
LONGEST_STAGE = 240.0


def day_evidence(evidence: Evidence) -> DayEvidence:
    """Return the evidence of bins of one day."""
    sightings = evidence.by_patch.sightings
    _, users, _ = sightings.shape
    watched = watched_views(evidence.by_patch.shown_255, *sightings[:-1], users)
    return DayEvidence(evidence.minute, *watched, *sightings[:-1])


def joined(parts: Sequence[DayEvidence]) -> DayEvidence:
    """Return consecutive parts of a day as one."""
    first = np.cumsum([0, *(len(part.minute) for part in parts)]).tolist()
    first_view = np.cumsum([0, *(len(part.views) for part in parts)]).tolist()
    number, views = distinct(np.concatenate([part.views for part in parts]))
    view = [part.view + begin for part, begin in zip(parts, first_view, strict=False)]
    moved = [part._replace(bin=part.bin + begin) for part, begin in zip(parts, first, strict=False)]
    minute, _, _, *sightings = (np.concatenate(column) for column in zip(*moved, strict=True))
    order = np.argsort(sightings[0], kind="stable")
    own = (column[order] for column in sightings)
    return DayEvidence(minute, number[np.concatenate(view)], views, *own)


def between(day: DayEvidence, begin: int, end: int) -> DayEvidence:
    """Return the bins from `begin` to `end` - 1 of a day."""
    minute, view, views, *sightings = day
    is_part = (begin <= day.bin) & (day.bin < end)
    columns = (column[is_part] for column in sightings)
    part = DayEvidence(minute[begin:end], view[begin:end], views, *columns)
    return part._replace(bin=part.bin - begin)


def stretches_of(day: DayEvidence, user: int, longest: int) -> Stretches:
    """Return the evidence of one user, with runs of identical consecutive bins merged.

    Args:
        day: The evidence.
        user: Row of the user; the last row is anybody.
        longest: Largest number of bins in a stretch.
    """
    own = slice(*np.searchsorted(day.user, [user, user + 1]).tolist())
    sightings = day.bin[own], day.patch[own], day.steps[own]
    bins, view, begin, patch, share = merge_bins(day.minute, day.view, *sightings, longest)
    return Stretches(bins, view, day.views, begin, patch, share)


def distinct(rows: U8) -> tuple[I64, U8]:
    """Return rows (n, width) without repetitions of the row before.

    Returns:
        For each row the number of the one that it is equal to, int64 (n,), and these, uint8.

    Example:
        >>> number, rows = distinct(np.array([[0, 9], [0, 9], [3, 9], [0, 9]], np.uint8))
        >>> number.tolist(), rows.tolist()
        ([0, 0, 1, 2], [[0, 9], [3, 9], [0, 9]])
    """
    is_new = np.ones(len(rows), bool)
    is_new[1:] = (rows[1:] != rows[:-1]).any(axis=1)
    return np.cumsum(is_new) - 1, rows[is_new]


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
    def of(cls, evidence: Evidence, stages: int) -> Self:
        """Return the states for the rooms and patches of evidence."""
        room = evidence.by_patch.room
        cells = evidence.by_patch.cells
        rooms = evidence.watched.shape[1]
        floor = np.maximum(cells, 1)
        spread = np.append(floor / np.bincount(room, floor, minlength=rooms)[room], 1.0)
        return cls(np.append(room, rooms), spread, rooms, stages, np.ones(rooms + 1))

    @property
    def anywhere(self) -> F64:
        """The distribution before any evidence: (stages, patches + 1), the last column is away.

        Each room and away have equal shares, which their patches and the stages divide.
        """
        spread = self.spread * self.possible[self.room]
        return np.tile(spread / (self.possible.sum() * self.stages), (self.stages, 1))

    def no_moments(self, *people: int) -> Moments:
        """Return moments of some people that are all zero, with people as the first dimension."""
        places = self.rooms + 1
        nodes = (self.rooms + 1) * self.stages
        shapes = (nodes,), (nodes, places + 1), (len(self.room),), (places,), (places,)
        return Moments(*(np.zeros((*people, *shape)) for shape in shapes))


class Prior(NamedTuple):
    """The assumptions about a person before anything was learned.

    Attributes:
        detection: Probability that a person in view is perceived.
        restless: Probability per bin that a person moves to another patch (a part) of the room.
    """

    detection: float
    restless: float


def model_of(moments: Moments, layout: StateLayout, prior: Prior) -> StayModel:
    """Return the most probable transitions: expected counts by expected time, with a prior.

    The prior of a stage is one end after MEAN_STAY bins (with several stages, 5 to 240), and one
    next room, distributed as rooms are entered overall; with several stages, half of it goes to the
    next stage. The prior of a room is one arrival, spread over its floor, and one change of patch
    after 1 / `restless` bins.

    Args:
        moments: What was learned, with people as the first dimension.
        layout: The states.
        prior: What was assumed before.

    Returns:
        The transitions, likewise.
    """
    stages = layout.stages
    lengths = (
        np.linspace(SHORTEST_STAGE, LONGEST_STAGE, stages) if stages > 1 else np.array([MEAN_STAY])
    )
    first = np.searchsorted(layout.room, np.arange(layout.rooms + 2)).astype(np.int64)
    learned = learned_stays(moments, lengths, layout.spread, layout.possible, first, prior.restless)
    return StayModel(*learned, first, prior.detection)


@dataclass
class PeopleDay:
    """One day of people: its evidence, the messages to it, and the statistics learned from it.

    Attributes:
        evidence: The evidence.
        start: float64 (people, stages, patches), the distribution before the day.
        backward: float64 (people, stages, patches), the backward message from later days: the
            likelihood of their evidence given each state.
        moments: The expected sufficient statistics of the day, with people as first dimension.
    """

    evidence: DayEvidence
    start: F64
    backward: F64
    moments: Moments


class People:
    """The models of all users.

    Attributes:
        model: The transition probabilities, with people as first dimension.
        total: Sum of the moments of all days, with decayed weights of older ones, likewise.
        now: float64 (people, stages, patches), the distribution after the last bin.
        days: The finished days that are still revisited; the statistics of others stay in `total`.
    """

    def __init__(self, layout: StateLayout, prior: Prior, count: int, longest: int) -> None:
        """Begin with the prior.

        Args:
            layout: The states that a person can be in: patches of rooms, and away, in each stage.
            prior: The transition probabilities that are assumed before any evidence.
            count: Number of people.
            longest: Largest number of consecutive bins with equal evidence that are merged.
        """
        self.layout = layout
        self.prior = prior
        self.count = count
        self.longest = longest
        self.total = layout.no_moments(count)
        self.model = model_of(self.total, layout, prior)
        self.now = self.day_start = np.repeat(layout.anywhere[None], count, axis=0)
        self.days: list[PeopleDay] = []

    def model_of(self, person: int) -> StayModel:
        """Return the transition probabilities of one person."""
        stay, follow, spread, restless, first, detection = self.model
        own = (stay[person], follow[person], spread[person], restless[person])
        return StayModel(*own, first, detection)

    def confine(self, possible: F64) -> None:
        """Let people be in some places only: float64 (rooms + 1,), as `possible`."""
        self.layout = self.layout._replace(possible=possible)
        self.model = model_of(self.total, self.layout, self.prior)
        self.now = np.stack([*map(self._within, self.now)])
        self.day_start = np.stack([*map(self._within, self.day_start)])

    def _within(self, places: F64) -> F64:
        """Return one person's distribution without the places where the person can't be."""
        rest = places * self.layout.possible[self.layout.room]
        return rest / rest.sum() if rest.any() else self.layout.anywhere

    @property
    def length_of_stay(self) -> F64:
        """Mean length of a stay in each room, and away [bins]: float64 (people, rooms + 1)."""
        places = self.layout.rooms + 1
        time = self.total.time.reshape(self.count, places, -1).sum(axis=2)
        ends = self.total.exits[..., :places].reshape(self.count, places, -1).sum(axis=2)
        return (time + MEAN_STAY) / (ends + 1)

    def follow(self, part: DayEvidence) -> PeoplePlaces:
        """Filter over the next part of a day; return P(room | evidence up to the stretch)."""
        self.now = self.now.copy()
        return PeoplePlaces(*follow_people(self.model, part, self.longest, self.now))

    def end_day(self, day: DayEvidence) -> PeoplePlaces:
        """Smooth the finished day as a whole, and learn from it."""
        moments = self.layout.no_moments(self.count)
        self.days.append(PeopleDay(day, self.day_start, np.ones_like(self.day_start), moments))
        return self.revisit(len(self.days) - 1, 1.0)

    def revisit(self, number: int, weight: float) -> PeoplePlaces:
        """Smooth a day with the present models, and update the models by the difference.

        The day before and the next day get new boundary messages, which they use when they are
        revisited.

        Args:
            number: Index of the day in `days`.
            weight: Weight of the day.
        """
        day = self.days[number]
        moments = self.layout.no_moments(self.count)
        places, end, begin = smooth_people(
            self.model, day.evidence, self.longest, day.start, day.backward, moments
        )
        if number > 0:
            self.days[number - 1].backward = begin
        if number + 1 < len(self.days):
            self.days[number + 1].start = end
        else:
            self.now = self.day_start = end
        parts = zip(self.total, moments, day.moments, strict=True)
        self.total = Moments(*(np.maximum(t + weight * (new - old), 0.0) for t, new, old in parts))
        day.moments = moments
        self.model = model_of(self.total, self.layout, self.prior)
        return PeoplePlaces(*places)

    def fade(self, weight: float) -> None:
        """Multiply the moments learned so far by a weight."""
        if weight < 1:
            self.total = Moments(*(weight * part for part in self.total))

    def remember(self) -> dict[str, Any]:
        """Return the learned moments of each person, as arrays, by number."""
        return {str(person): self._learned(person) for person in range(self.count)}

    def _learned(self, person: int) -> dict[str, F64]:
        return {name: part[person] for name, part in self.total._asdict().items()}

    def recall(self, learned: Mapping[str, Any]) -> bool:
        """Restore what `remember` returned; return whether it has the same people and states."""
        for person in range(self.count):
            own = learned.get(str(person), {})
            for name, part in self._learned(person).items():
                values = np.asarray(own.get(name, ()))
                if values.shape != part.shape:
                    return False
                part[:] = values
        self.model = model_of(self.total, self.layout, self.prior)
        return True
