"""Models of real-time presence that follow a person from room to room: the chains."""

from collections.abc import Mapping, Sequence
from datetime import datetime, timedelta
from itertools import pairwise
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from fleet2d.algorithms.presence.anyone import unknown_seen, with_anyone
from fleet2d.algorithms.presence.belief import Presence, Track
from fleet2d.algorithms.presence.counts import Bins
from fleet2d.algorithms.presence.estimator import F64, normalized
from fleet2d.algorithms.presence.habits import Habits
from fleet2d.algorithms.presence.likelihood import Likelihood, by_day
from fleet2d.algorithms.presence.model import Model
from fleet2d.algorithms.presence.person import Person, stretches_of
from fleet2d.component import register
from fleet2d.kernels.presence import advance
from fleet2d.kernels.stays import Stretches, Ways, follow
from fleet2d.units import Share

I64 = NDArray[np.int64]

FARTHEST = 10_080  # bins ahead, beyond which a forecast stays as it is


class Going(NamedTuple):
    """Where somebody is now, and how that goes on.

    Attributes:
        now: float64 (nodes,), probability of each stage of each place, away last.
        ways: How the person goes on.
        habits: What differs by the hour; None: nothing.
    """

    now: F64
    ways: Ways
    habits: Habits | None = None

    @property
    def places(self) -> F64:
        """The probability of each place: float64 (1, rooms + 1)."""
        found: F64 = self.now.reshape(1, len(self.ways.first) - 1, -1).sum(axis=2)
        return found

    def after(self, bins: int, time: datetime, bin_us: int) -> "Going":
        """Return where somebody is some bins later than `time`, without evidence."""
        if self.habits is None:
            return self._replace(now=advance(self.now, steps_of(self.ways), bins))
        now = self.now
        while bins > 0:
            since = timedelta(minutes=time.minute, seconds=time.second)
            hour = -((since - timedelta(hours=1)) // timedelta(microseconds=bin_us))
            part = min(bins, max(hour, 1))
            ways = self.habits.at(self.ways, time.weekday(), time.hour)
            now = advance(now, steps_of(ways), part)
            bins, time = bins - part, time + timedelta(microseconds=part * bin_us)
        return self._replace(now=now)


class ChainPresence(Presence):
    """Presence that goes on by transitions: the later the time, the more like that of all time."""

    def __init__(
        self,
        users: Sequence[str],
        people: Sequence[Going],
        time: datetime,
        bin_us: int,
        track: Track | None = None,
    ) -> None:
        """Keep where people are.

        Args:
            users: Names of the users.
            people: Each user; without any there is one person, of anyone.
            time: The local time it is of.
            bin_us: Length of a bin [us].
            track: What was believed on the way here; its end is taken for now.
        """
        self._people, self._bin_us = tuple(people), bin_us
        if track is None:
            home, away = split([person.places for person in people], len(users), None)
        else:
            home, away = track.home, track.away
        super().__init__(users, home[-1], away[-1], time, track=track)

    def at(self, time: datetime) -> "ChainPresence":
        """Return the forecast of a later time, in whole bins; of an earlier one, itself."""
        bins = min((time - self.time) // timedelta(microseconds=self._bin_us), FARTHEST)
        if bins <= 0:
            return self
        ahead = [person.after(bins, self.time, self._bin_us) for person in self._people]
        return ChainPresence(self.users, ahead, time, self._bin_us)


def split(places: list[F64], users: int, bins: Bins | None) -> tuple[F64, F64]:
    """Return everybody's places, anyone's last, as shares of rooms given at home, and of away.

    Args:
        places: Each person's, float64 (bins, rooms + 1).
        users: How many users there are; without any there is one person, of anyone.
        bins: The evidence, which tells of unknown people; None: nobody unknown was seen.
    """
    everybody = places[0][:, np.newaxis]
    if users:
        nobody = np.zeros((len(places[0]), places[0].shape[1] - 1), bool)
        everybody = with_anyone(places, nobody if bins is None else unknown_seen(bins))
    return normalized(np.maximum(everybody[..., :-1], 0)), np.clip(everybody[..., -1], 0, 1)


class Follower:
    """Follows one person bin by bin.

    Attributes:
        now: float64 (2, stages, patches), the probability of each patch, in view and not.
        shown: int64 (patches,), what part of each patch is in view.
    """

    def __init__(self, person: Person) -> None:
        """Begin without knowing anything."""
        anywhere = person.layout.anywhere
        self.now = np.stack([np.zeros_like(anywhere), anywhere])
        self.shown: I64 = np.full(anywhere.shape[1], -1, np.int64)

    def follow(self, ways: Ways, stretches: Stretches) -> F64:
        """Return P(room | evidence up to each bin): float64 (bins, rooms + 1).

        Args:
            ways: How the person goes on, as far as that was learned.
            stretches: The evidence, of one bin each.
        """
        return follow(ways, stretches, self.now, self.shown)

    def going(self, person: Person, habits: Habits | None) -> Going:
        """Return where the person is, without patches."""
        stages = person.layout.stages
        nodes = person.layout.room[:, np.newaxis] * stages + np.arange(stages)
        mass = np.bincount(nodes.ravel(), (self.now[0] + self.now[1]).T.ravel())
        return Going(mass.astype(np.float64), person.ways, habits)


def steps_of(ways: Ways) -> F64:
    """Return how stages follow each other from bin to bin without evidence: (nodes, nodes)."""
    nodes, places = len(ways.stay), ways.follow.shape[1] - 1
    stages = nodes // places
    steps, leave = np.diag(ways.stay), (1 - ways.stay)[:, np.newaxis] * ways.follow
    steps[:, ::stages] += leave[:, :places]
    passed = np.arange(nodes)[np.arange(nodes) % stages < stages - 1]
    steps[passed, passed + 1] += leave[passed, places]
    return steps


@register("presence_model", "hmm")
class Filter(Model):
    """The filter of a hidden Markov model: P(room now | all evidence so far).

    From bin to bin what is believed goes on by the transitions, and is weighed by the evidence:
    patches of rooms that are watched in vain lose (negative information). What a person is, how
    evidence is explained, and how it is learned after each day says the `likelihood` estimator,
    whose keys these are.

    Right where stays are about geometric in length. Breaks when routines differ by time of day.
    """

    detection: Share = Field(
        default=0.95, description="chance that somebody in view is perceived", gt=0, lt=1
    )
    restless: Share = Field(
        default=0.05,
        description="chance a bin that who stays in a room changes patch, before it is learned",
    )
    stages: ClassVar[int] = 1
    negative: ClassVar[bool] = True

    def begin(self, rooms: int, users: int, day: int) -> None:
        """Prepare for a run."""
        super().begin(rooms, users, day)
        self.day = day
        self.learner = Likelihood(
            detection=self.detection, restless=self.restless, stages=self.stages
        )
        self.learner.begin(rooms, users)
        self.followers: list[Follower] = []

    def observe(self, bins: Bins) -> tuple[F64, F64]:
        """Return the filtered belief after each bin."""
        found = [self._observe_day(day) for day in by_day(bins)]
        home, away = (np.concatenate(parts) for parts in zip(*found, strict=True))
        return home, away

    def _observe_day(self, bins: Bins) -> tuple[F64, F64]:
        self.learner.take_in(bins)
        people = self.learner.people
        self.followers = self.followers or [Follower(person) for person in people]
        places = [self._follow(user, bins) for user in range(len(people))]
        return split(places, self.users, bins)

    def _follow(self, user: int, bins: Bins) -> F64:
        stretches = stretches_of(bins, user, 1)
        if not self.negative:
            stretches = stretches._replace(shown=np.zeros_like(stretches.shown))
        return self.followers[user].follow(self.learner.people[user].ways, stretches)

    def habits(self, user: int) -> Habits | None:
        """Return what differs by the hour."""
        return None

    def presence(self, users: Sequence[str], time: datetime, bin_us: int, track: Track) -> Presence:
        """Return what is believed now, and by `at` the forecast."""
        pairs = enumerate(zip(self.learner.people, self.followers, strict=True))
        now = [follower.going(person, self.habits(user)) for user, (person, follower) in pairs]
        return ChainPresence(users, now, time, bin_us, track)

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


@register("presence_model", "routine")
class Routine(SemiMarkov):
    """The semi-Markov filter by the hour: people are drawn to where they usually are then.

    Rooms follow each other more or less often by the hour of working days and of weekends, as far
    as shares of time differ then (`fleet2d.algorithms.presence.habits`), from the second day on.

    Right where days are alike. Breaks when they aren't: it is surer of the usual.
    """

    smoothing: float = Field(
        default=60, gt=0, description="bins of average evidence each hour is given beforehand"
    )

    def _follow(self, user: int, bins: Bins) -> F64:
        habits, ways = self.habits(user), self.learner.people[user].ways
        hours = bins.day * 24 + bins.minute // 60
        ends = [0, *(np.flatnonzero(np.diff(hours)) + 1).tolist(), len(hours)]
        found = []
        for part in (bins.part(a, b) for a, b in pairwise(ends)):
            now = habits.at(ways, int(part.day[0] - 1) % 7, int(part.minute[0]) // 60)
            found.append(self.followers[user].follow(now, stretches_of(part, user, 1)))
        return np.concatenate(found)

    def habits(self, user: int) -> Habits:
        """Return what differs by the hour, as far as it was learned."""
        counts, columns = self.learner.counts, [*range(self.rooms + 1), -1]  # places, and all bins
        week, total = counts.by_hour_of_week[:, user], counts.total[user]
        return Habits(week[:, columns], total[columns], self.smoothing)


@register("presence_model", "markov")
class MarkovDecay(Filter):
    """The row of P^g of the room in which the user was perceived last, g bins ago.

    P are the transitions, learned as by `hmm`; but here views in vain tell nothing. Before the
    first sighting it is what the transitions lead to from anywhere.
    """

    negative: ClassVar[bool] = False
