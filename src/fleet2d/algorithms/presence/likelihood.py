"""Full likelihood: stays as a hidden Markov chain, for which empty views are evidence, too."""

from collections.abc import Mapping
from statistics import NormalDist
from typing import Any, NamedTuple

import numpy as np
from pydantic import Field

from fleet2d.algorithms.evidence import Evidence
from fleet2d.algorithms.presence.estimator import MIN_DAYS, Estimator, normalized, ratio
from fleet2d.algorithms.presence.people import People, Prior, StateLayout, day_evidence, joined
from fleet2d.configuration.units import Share
from fleet2d.errors import ComponentError
from fleet2d.kernels import F64, I64, Bool, DayEvidence, PeoplePlaces, sum_places

# Chance per bin that a person in a room changes patch, before it is learned.
RESTLESS = 0.05
# Number of earlier days that are revisited in turn when a day is over, and of those stored.
REVISITS = 2
STORED_DAYS = 64


class StoredDay(NamedTuple):
    """A day that is revisited, beside what `People.days` has of it.

    Attributes:
        number: The day, as `date.toordinal` counts.
        hours: float64 (24, users + 1, width), its sums by hour.
        unknown: bool (bins, rooms), where an unknown person was perceived.
    """

    number: int
    hours: F64
    unknown: Bool


class Likelihood(Estimator):
    """Expected share of time in each room given all evidence, in a hidden Markov chain.

    Each user is in one patch of one room, or away (`fleet2d.algorithms.evidence`). The length of a
    stay in a room is geometric, or with several `stages` a sum of geometric lengths (a Coxian
    distribution: a hidden semi-Markov model); then the user goes to another room. During a stay the
    user changes patch at times. A user who comes to a patch is in its visible part with the
    probability `shown`, the largest share of the patch in view at once in the bin, and stays in or
    out of view until the user moves or the view changes: a person who sits behind a corner stays
    hidden, however long the robot looks. The likelihood of evidence is

    - if the user was perceived: for each patch the share of sightings in it; for any other place,
      as another person may have been mistaken for the user, 0.001 of the likelihood below;
    - if not: 1 - detection for a user in view, 1 for a user out of view. A patch in which an
      unknown person was perceived, who may be the user, counts as out of view.

    Consecutive bins of an hour with the same view and the same sightings are merged, at most
    `together` bins; the model allows one transition as they begin. With 1 it is exact, and takes
    correspondingly longer.

    Shares are the means of P(room | all evidence), by smoothing. Lengths of stays, transitions
    between rooms, and the choice and change of patches are learned by expectation maximization
    with a prior of one event each (`fleet2d.algorithms.presence.people`). When a day is over it is
    smoothed as a whole, and so are two of the last 64 days, in turn, with messages from and to the
    days next to them (incremental, after Neal and Hinton 1998); the present day is only filtered.

    It is right when the robot acts only on what it has perceived (then the choice of looks can be
    ignored: missing at random, Rubin 1976) and looks at every patch at times. It fails when the
    model is wrong: stays that depend strongly on the time of day, people who follow each other,
    patches that are never watched (the prior decides: such time mostly counts as away), users who
    are hardly ever recognized.

    A person is never in a part of the home that nothing joins with what robots have looked into:
    evidence can't distinguish such rooms from away. In rooms that robots could look into, but never
    did, the prior decides; their intervals, and that of away, hold all of that time.

    Anyone follows from all users, taken as independent, and from unknown people where they are
    seen; without users it is the chain of one person.

    Attributes:
        detection: Chance that somebody in view is perceived.
        stages: Number of stages of a stay; above 1 its length isn't geometric.
        together: Largest number of consecutive bins with equal evidence that are merged.
    """

    detection: Share = Field(default=0.95, gt=0, lt=1)
    stages: int = Field(default=1, ge=1, le=4)
    together: int = Field(default=5, ge=1, le=60)

    def begin(self, rooms: int, users: int, half_life: float | None = None) -> None:
        """Prepare for a run."""
        super().begin(rooms, users, half_life)
        self.people: People | None = None
        self.learned: Mapping[str, Any] = {}
        self.parts: list[DayEvidence] = []  # the parts of the present day
        self.unknown: list[Bool] = []  # where an unknown person was perceived in each of them
        self.days: list[StoredDay] = []  # the days that are revisited
        self.turn = 0  # index of the day that was revisited last
        self.is_watched = np.zeros(rooms, bool)  # whether a robot has looked into the room
        self.island: I64 | None = None  # as in `Parts`

    def width(self, rooms: int) -> int:
        """Return the number of columns of `sums`: p and p (1 - p) of each place, and bins."""
        return 2 * (rooms + 1) + 1

    def shares(self, sums: F64) -> tuple[F64, F64]:
        """Return the expected share of rooms given at home, and of away."""
        rooms = (sums.shape[-1] - 3) // 2
        away = ratio(sums[..., rooms], sums[..., -1])
        return normalized(np.maximum(sums[..., :rooms], 0)), np.clip(away, 0, 1)

    def interval(self, key: np.uint64, level: float) -> tuple[F64, F64]:
        """Return intervals for the shares of time in each room, over the time so far.

        The time in which nobody saw the user is uncertain: with p = P(room | all evidence) of each
        bin, the number of bins in a room has the variance 2 l sum p (1 - p), where l is the mean
        length of a stay there, because the bins of a stay depend on each other. The variance is
        doubled, as the model of stays is uncertain, too, and the ends are quantiles of a normal
        distribution; below the share of one bin, the lower end is 0. With fewer than two whole days
        the ends are 0 and 1.

        Args:
            key: Key of the stream of random draws, which isn't used.
            level: Probability with which the interval should hold the truth, such as 0.9.

        Returns:
            Lower and upper ends, float64 (users + 1, rooms + 1) each, away last.
        """
        shape = (self.users + 1, self.rooms + 1)
        if len(self.counts.days) < MIN_DAYS:
            return np.zeros(shape), np.ones(shape)
        assert self.people is not None, "days are over"
        total = self.counts.total
        lengths = self.people.length_of_stay
        if self.users:
            lengths = np.append(lengths, [np.max(lengths, axis=0)], axis=0)
        variance = np.maximum(total[:, self.rooms + 1 : -1], 0) * lengths
        at_home = np.maximum(total[:, : self.rooms].sum(axis=1, keepdims=True), 1)
        bins = np.concatenate([np.repeat(at_home, self.rooms, axis=1), total[:, -1:]], axis=1)
        home, away = self.shares(total)
        share = np.concatenate([home, away[:, None]], axis=1)
        # Rounded so that all math libraries agree.
        quantile = round(NormalDist().inv_cdf((1 + level) / 2), 6)
        half = quantile * np.sqrt(4 * variance) / bins
        low = np.where(share - half < 1 / bins, 0.0, share - half)
        return self._with_hidden_time(low, np.minimum(share + half, 1), half * bins)

    def _with_hidden_time(self, low: F64, high: F64, error: F64) -> tuple[F64, F64]:
        """Widen intervals where rooms were never watched: that time may be away, or the reverse.

        Args:
            low: Lower ends of the shares, float64 (users + 1, rooms + 1).
            high: Upper ends.
            error: Half the width of the interval of each place's time [bins].
        """
        is_hidden = ~self.is_watched
        if not (self.is_watched.any() and (is_hidden & self._possible_rooms).any()):
            return low, high
        time = np.maximum(self.counts.total[:, : self.rooms + 1], 0)
        is_hidden = np.append(is_hidden, True)
        at_home = np.maximum(time[:, :-1].sum(axis=1, keepdims=True), 1)
        unseen = time[:, is_hidden].sum(axis=1, keepdims=True)
        seen = np.maximum(time[:, ~is_hidden].sum(axis=1, keepdims=True), 1)
        most_unseen = unseen + error[:, is_hidden].sum(axis=1, keepdims=True)
        low = np.where(is_hidden, 0.0, low * at_home / (seen + unseen))
        high = np.where(is_hidden, most_unseen / (seen + unseen), high * at_home / seen)
        return low, np.minimum(high, 1)

    def observe(self, evidence: Evidence) -> None:
        """Process the next bins of evidence."""
        for day in evidence.days:
            part, people = self.add(day)
            hours, sums = self._by_hour(people.follow(part), part, self.unknown[-1])
            self.counts.add_hours(self.counts.today * 24 + hours, sums)

    def add(self, evidence: Evidence) -> tuple[DayEvidence, People]:
        """Add evidence of one day, which is learned from when the next day begins."""
        people = self.people = self.people or self._create_people(evidence)
        self._look_into(evidence, people)
        number = int(evidence.day[0])
        if number != self.counts.today:
            if self.parts:
                self._end_day(number, people)
            self.counts.begin_day(number)
        part = day_evidence(evidence)
        self.parts.append(part)
        self.unknown.append(evidence.sightings.unknown)
        return part, people

    def _create_people(self, evidence: Evidence) -> People:
        layout = StateLayout.of(evidence, self.stages)
        prior = Prior(self.detection, RESTLESS)
        people = People(layout, prior, max(self.users, 1), self.together)
        if self.learned and not people.recall(self.learned):
            raise ComponentError(
                f"the learned state doesn't fit {self.stages} stages in {len(layout.room) - 1}"
                f" patches of {self.rooms} rooms: it is from another home, other users, another"
                " estimator, or one with other stages"
            )
        return people

    def _look_into(self, evidence: Evidence, people: People) -> None:
        """Note the watched rooms; people can only be in rooms that are joined with one of them."""
        if self.is_watched.all():
            return
        is_watched = self.is_watched | evidence.watched.any(axis=0)
        if np.array_equal(is_watched, self.is_watched):
            return
        before = self._possible_rooms
        self.is_watched = is_watched
        self.island = evidence.by_patch.island
        if not np.array_equal(self._possible_rooms, before):
            people.confine(np.append(self._possible_rooms, True).astype(np.float64))

    @property
    def _possible_rooms(self) -> Bool:
        """The rooms that are joined with those that robots have looked into: bool (rooms,)."""
        if self.island is None or not self.is_watched.any():
            return np.ones(self.rooms, bool)
        return np.isin(self.island, self.island[self.is_watched])

    def _by_hour(self, places: PeoplePlaces, day: DayEvidence, unknown: Bool) -> tuple[I64, F64]:
        """Return the hours of the bins, and the sums of each hour.

        The sums are those of p, p (1 - p), and 1: float64 (hours, users + 1, width).
        """
        hour = day.minute // 60
        begins = hour[1:] != hour[:-1]
        first = np.concatenate([[0], begins.nonzero()[0] + 1])
        return hour[first], sum_places(places, unknown, self.users, first)

    def _whole_day(self, places: PeoplePlaces, day: DayEvidence, unknown: Bool) -> F64:
        """Return a day's sums of places and of moments per hour: float64 (24, users + 1, width).

        The last row is of anybody.
        """
        hours, sums = self._by_hour(places, day, unknown)
        by_hour = np.zeros((24, *sums.shape[1:]))
        np.add.at(by_hour, hours, sums)
        return by_hour

    def _end_day(self, next_day: int, people: People) -> None:
        """Smooth the present day as a whole, learn from it, and revisit earlier days."""
        day = joined(self.parts)
        unknown = np.concatenate(self.unknown)
        self.parts = []
        self.unknown = []
        self.counts.hours = self._whole_day(people.end_day(day), day, unknown)
        self.days.append(StoredDay(self.counts.today, self.counts.hours, unknown))
        for _ in range(REVISITS):
            self.turn = (self.turn - 1) % len(self.days)
            self._revisit(self.turn, people)
        fade = self.counts.faded(next_day - self.counts.today)
        people.fade(fade)
        del people.days[:-STORED_DAYS], self.days[:-STORED_DAYS]

    def _revisit(self, number: int, people: People) -> None:
        """Smooth a day with the present model, and replace its sums."""
        day = self.days[number]
        weight = self.counts.faded(self.counts.today - day.number)
        places = people.revisit(number, weight)
        hours = self._whole_day(places, people.days[number].evidence, day.unknown)
        self.counts.put(day.number, day.hours, hours)
        self.days[number] = day._replace(hours=hours)

    def remember(self) -> dict[str, Any]:
        """Return the learned state, as arrays in mappings."""
        stays = self.learned if self.people is None else self.people.remember()
        return {**super().remember(), "stays": stays}

    def recall(self, learned: Mapping[str, Any], today: int) -> None:
        """Restore what `remember` returned; called after `begin`."""
        super().recall(learned, today)
        self.learned = learned.get("stays", {})
