"""Models of real-time presence that follow each person through a Markov chain over rooms."""

from collections.abc import Mapping, Sequence
from datetime import datetime, timedelta
from itertools import pairwise
from typing import Any, ClassVar, NamedTuple

import numpy as np
from pydantic import Field

from fleet2d.algorithms.evidence import Evidence
from fleet2d.algorithms.presence.belief import BeliefSeries, Presence, with_anyone
from fleet2d.algorithms.presence.estimator import normalized
from fleet2d.algorithms.presence.likelihood import Likelihood
from fleet2d.algorithms.presence.model import Model
from fleet2d.algorithms.presence.people import StateLayout, between, stretches_of
from fleet2d.configuration.units import Share
from fleet2d.floorplan.home import Home
from fleet2d.kernels import F64, I64, Bool, DayEvidence, StayModel, advance, follow
from fleet2d.runtime.clock import DAY_MINUTES

WEEKEND = 5  # its first day, Monday being 0
MIN_BINS = DAY_MINUTES  # with fewer bins of evidence, hours aren't distinguished
MAX_RATIO = 20.0  # largest ratio, and inverse of the smallest, of an hour's share to the mean share
MIN_SHARE = 1e-9
MAX_LEAVE = 0.5  # largest probability per bin to leave, unless it was larger before
MAX_HORIZON = 10_080  # bins ahead; later forecasts equal the one at this horizon


class ChainHabits(NamedTuple):
    """Time spent in each place, by hour of the week.

    Attributes:
        week: float64 (168, rooms + 2), bins in each room, away, and all, from Monday 00:00.
        total: float64 (rooms + 2,), the same over all hours.
        smoothing: Bins of average evidence that are added to each hour.
    """

    week: F64
    total: F64
    smoothing: float

    def at(self, model: StayModel, weekday: int, hours: Sequence[int]) -> list[StayModel]:
        """Return the transition probabilities at some hours of a day.

        Let c be the share of time in each place at that hour of working days, or of weekends,
        divided by the share over all hours, clipped to 1/20 … 20. The probability T_ij to go from i
        to j becomes T_ij sqrt(c_j / c_i). If T is reversible and has the overall shares p as its
        stationary distribution, the result has those of the hour: the flow p_i c_i T_ij
        sqrt(c_j / c_i) = p_i T_ij sqrt(c_i c_j) is symmetric.

        Args:
            model: The transition probabilities over all hours.
            weekday: Day of the week, 0 is Monday.
            hours: Hours of the day.
        """
        if self.total[-1] < MIN_BINS:
            return [model] * len(hours)
        days = self.week.reshape(7, 24, -1)[:, hours]
        same_days = days[:WEEKEND] if weekday < WEEKEND else days[WEEKEND:]
        at_hour = same_days.sum(axis=0) + self.smoothing / self.total[-1] * self.total
        mean_share = self.total[:-1] / self.total[-1]
        share = at_hour[:, :-1] / at_hour[:, -1:]
        ratio = np.maximum(share, MIN_SHARE) / np.maximum(mean_share, MIN_SHARE)
        pull = np.sqrt(np.clip(ratio, 1 / MAX_RATIO, MAX_RATIO))
        count, places = pull.shape
        leave = np.tile((1 - model.stay)[:, np.newaxis] * model.follow, (count, 1, 1))
        stages = len(model.stay) // places
        of_node = np.repeat(pull, stages, axis=1)[..., np.newaxis]
        leave[..., :places] *= pull[:, np.newaxis] / of_node
        chance = np.zeros(leave.shape[:2])
        for column in range(leave.shape[2]):  # summed in the same order on every machine
            chance += leave[..., column]
        follow = leave / np.maximum(chance, MIN_SHARE)[..., np.newaxis]
        stay = 1 - np.minimum(chance, np.maximum(1 - model.stay, MAX_LEAVE))
        return [model._replace(stay=s, follow=f) for s, f in zip(stay, follow, strict=True)]


class PersonForecast(NamedTuple):
    """Where a person is, and how the person moves on.

    Attributes:
        now: float64 (nodes,), the probability of each stage of each place, away last.
        model: The transition probabilities.
        habits: How the transitions depend on the hour; None: they don't.
    """

    now: F64
    model: StayModel
    habits: ChainHabits | None = None

    @property
    def places(self) -> F64:
        """The probability of each place: float64 (1, rooms + 1)."""
        return self.now.reshape(1, len(self.model.first) - 1, -1).sum(axis=2)

    def after(self, bins: int, time: datetime, bin_us: int) -> "PersonForecast":
        """Return the forecast for `bins` bins later than `time`."""
        if self.habits is None:
            return self._replace(now=advance(self.now, steps_of(self.model), bins))
        now = self.now
        while bins > 0:
            past = timedelta(minutes=time.minute, seconds=time.second)
            to_next_hour = -((past - timedelta(hours=1)) // timedelta(microseconds=bin_us))
            part = min(bins, max(to_next_hour, 1))
            [model] = self.habits.at(self.model, time.weekday(), [time.hour])
            now = advance(now, steps_of(model), part)
            bins = bins - part
            time = time + timedelta(microseconds=part * bin_us)
        return self._replace(now=now)


class ChainPresence(Presence):
    """Presence with forecasts by transitions; they approach the long-term presence over time."""

    def __init__(
        self,
        users: Sequence[str],
        people: Sequence[PersonForecast],
        time: datetime,
        bin_us: int,
        track: BeliefSeries | None = None,
    ) -> None:
        """Keep the present distributions.

        Args:
            users: Names of the users.
            people: The forecast of each user; without users, one forecast, of anyone.
            time: The local time that it describes.
            bin_us: Length of a bin [us].
            track: The belief at the end of each bin, whose last bin is the present belief.
        """
        self._people = tuple(people)
        self._bin_us = bin_us
        if track is None:
            home, away = split([person.places for person in people], len(users), None)
        else:
            home = track.home
            away = track.away
        super().__init__(users, home[-1], away[-1], time, track=track)

    def corrected(self) -> "ChainPresence":
        """Return a copy with forecasts from the last belief of the track on."""
        assert self.track is not None
        people = []
        for row, person in enumerate(self._people):
            away = self.track.away[-1, row]
            belief = np.append(self.track.home[-1, row] * (1 - away), away)
            stages = person.now.reshape(len(belief), -1)
            spread = normalized(stages) * belief[:, np.newaxis]
            people.append(person._replace(now=spread.ravel()))
        return ChainPresence(self.users, people, self.time, self._bin_us, self.track)

    def at(self, time: datetime) -> "ChainPresence":
        """Return the forecast of a later time, in whole bins; of an earlier one, itself."""
        bins = min((time - self.time) // timedelta(microseconds=self._bin_us), MAX_HORIZON)
        if bins <= 0:
            return self
        ahead = [person.after(bins, self.time, self._bin_us) for person in self._people]
        return ChainPresence(self.users, ahead, time, self._bin_us)


def split(places: list[F64], users: int, unknown: Bool | None) -> tuple[F64, F64]:
    """Return shares of rooms given at home, and of away, for each user and last for anyone.

    Args:
        places: For each person, float64 (bins, rooms + 1), the probability of each place.
        users: Number of users; without users there is one person, of anyone.
        unknown: bool (bins, rooms), where an unknown person was perceived; None: nowhere.
    """
    rows = with_anyone(places, unknown) if users else places[0][:, np.newaxis]
    home = normalized(np.maximum(rows[..., :-1], 0))
    away = np.clip(rows[..., -1], 0, 1)
    return home, away


class Follower:
    """Filters the place of one person bin by bin.

    Attributes:
        now: float64 (2, stages, patches), the probability of each patch, in view and out of view.
        shown: int64 (patches,), the part of each patch in view.
    """

    def __init__(self, layout: StateLayout) -> None:
        """Begin with the uninformed distribution."""
        self.layout = layout
        anywhere = layout.anywhere
        self.now = np.stack([np.zeros_like(anywhere), anywhere])
        self.shown: I64 = np.full(anywhere.shape[1], -1, np.int64)

    def forecast(self, model: StayModel, habits: ChainHabits | None) -> PersonForecast:
        """Return the present distribution over rooms, with the transitions of the person."""
        stages = self.layout.stages
        nodes = self.layout.room[:, np.newaxis] * stages + np.arange(stages)
        mass = np.bincount(nodes.ravel(), (self.now[0] + self.now[1]).T.ravel())
        return PersonForecast(mass.astype(np.float64), model, habits)


def steps_of(model: StayModel) -> F64:
    """Return the transition matrix from bin to bin without evidence: float64 (nodes, nodes)."""
    nodes = len(model.stay)
    places = model.follow.shape[1] - 1
    stages = nodes // places
    steps = np.diag(model.stay)
    leave = (1 - model.stay)[:, np.newaxis] * model.follow
    steps[:, ::stages] += leave[:, :places]
    early = np.arange(nodes)[np.arange(nodes) % stages < stages - 1]
    steps[early, early + 1] += leave[early, places]
    return steps


class Filter(Model):
    """The filter of a hidden Markov model: P(room now | all evidence so far).

    From bin to bin the belief moves on by the transitions and is weighted by the evidence: patches
    that are watched without a sighting lose probability (negative information). The model of a
    person, the likelihood of evidence and the learning after each day are those of the `likelihood`
    estimator, whose keys these are.

    It is right where lengths of stays are about geometric. It fails when routines depend on the
    time of day.

    Attributes:
        detection: Chance that somebody in view is perceived.
    """

    is_by_bin = True
    detection: Share = Field(default=0.95, gt=0, lt=1)
    stages: ClassVar[int] = 1
    negative: ClassVar[bool] = True

    def begin(self, home: Home, users: Sequence[str], start: datetime) -> None:
        """Prepare for a run."""
        super().begin(home, users, start)
        self.learner = Likelihood(detection=self.detection, stages=self.stages)
        self.learner.begin(self.rooms, self.users)
        self.followers: list[Follower] = []

    def observe(self, evidence: Evidence) -> tuple[F64, F64]:
        """Return the filtered belief after each bin."""
        days = [self._observe_day(day) for day in evidence.days]
        home, away = (np.concatenate(parts) for parts in zip(*days, strict=True))
        return home, away

    def _observe_day(self, evidence: Evidence) -> tuple[F64, F64]:
        day, people = self.learner.add(evidence)
        self.followers = self.followers or [Follower(people.layout) for _ in range(people.count)]
        places = [self._follow(user, day, people.model_of(user)) for user in range(people.count)]
        return split(places, self.users, evidence.sightings.unknown)

    def _follow(self, user: int, day: DayEvidence, model: StayModel) -> F64:
        """Return P(room | evidence up to each bin): float64 (bins, rooms + 1)."""
        stretches = stretches_of(day, user, 1)
        if not self.negative:
            stretches = stretches._replace(views=np.zeros_like(stretches.views))
        follower = self.followers[user]
        return follow(model, stretches, follower.now, follower.shown)

    def habits(self, user: int) -> ChainHabits | None:
        """Return how a user's transitions depend on the hour; None: they don't."""
        return None

    def presence(
        self, users: Sequence[str], time: datetime, bin_us: int, track: BeliefSeries
    ) -> Presence:
        """Return the present belief, which forecasts later times by `at`."""
        learned = self.learner.people
        assert learned is not None, "there is a track of evidence"
        people = [
            follower.forecast(learned.model_of(user), self.habits(user))
            for user, follower in enumerate(self.followers)
        ]
        return ChainPresence(users, people, time, bin_us, track)

    def remember(self) -> dict[str, Any]:
        """Return the learned state, as arrays in mappings."""
        return self.learner.remember()

    def recall(self, learned: Mapping[str, Any]) -> None:
        """Restore what `remember` returned; called after `begin`."""
        self.learner.recall(learned, self.day)


class SemiMarkov(Filter):
    """The filter with stays in stages, so that the time already spent in a room matters.

    A hidden semi-Markov model whose lengths of stay have Coxian distributions: a stay passes its
    stages in order and may end in each. With two stages, a person who has just come may leave soon,
    while one who has been there for long stays for long; or the other way round, as is learned.
    """

    stages = 2


class RoutineModel(SemiMarkov):
    """The semi-Markov filter with transitions by the hour, towards the rooms usual at that time.

    From the second day on, transitions depend on the hour of working days and of weekends, by the
    shares of time spent in each room at that hour (`fleet2d.algorithms.presence.chain_model`).

    It is right where days are similar. It fails where they aren't: it is too sure of the routine.

    Attributes:
        smoothing: Bins of average evidence added to each hour.
    """

    smoothing: float = Field(default=60, gt=0)

    def _follow(self, user: int, day: DayEvidence, model: StayModel) -> F64:
        hours = day.minute // 60
        begins = [0, *(np.flatnonzero(np.diff(hours)) + 1).tolist()]
        weekday = (self.learner.counts.today - 1) % 7
        models = self.habits(user).at(model, weekday, hours[begins].tolist())
        parts = pairwise([*begins, len(hours)])
        follow = super()._follow
        each = zip(parts, models, strict=True)
        return np.concatenate([follow(user, between(day, *part), at) for part, at in each])

    def habits(self, user: int) -> ChainHabits:
        """Return how a user's transitions depend on the hour, as learned so far."""
        # places, and all bins
        counts = self.learner.counts
        columns = [*range(self.rooms + 1), -1]
        week = counts.by_hour_of_week[:, user]
        total = counts.total[user]
        return ChainHabits(week[:, columns], total[columns], self.smoothing)


class MarkovDecay(Filter):
    """The row of P^g for the room in which the user was perceived last, g bins ago.

    P is the transition matrix, learned as by `hmm`; but views without a sighting are ignored.
    Before the first sighting it is the result of the transitions from the uniform distribution.
    """

    negative = False
