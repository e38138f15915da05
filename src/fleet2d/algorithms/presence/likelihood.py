"""Full likelihood: stays as a hidden chain, of which empty views are evidence, too."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from statistics import NormalDist
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from fleet2d.algorithms.presence.anyone import unknown_seen
from fleet2d.algorithms.presence.counts import Bins
from fleet2d.algorithms.presence.estimator import F64, FEWEST_DAYS, Estimator, normalized
from fleet2d.algorithms.presence.person import Habits, Layout, Person, watched_patches
from fleet2d.component import register
from fleet2d.errors import ComponentError
from fleet2d.kernels.evidence import sum_places
from fleet2d.kernels.stays import Stretches, take_together
from fleet2d.units import Share

I64 = NDArray[np.int64]

# Earlier days that are gone through again when a day is over, in turn; and how many are kept.
REVISITS = 2
KEPT = 64


@register("presence_estimator", "likelihood", aliases=("hmm",))
class Likelihood(Estimator):
    """Expected share of time per room given all that was and wasn't seen, in a hidden chain.

    Each user is in one patch of one room, or away (`fleet2d.algorithms.patches`). A stay in a room
    lasts a number of bins that is geometric, or with several `stages` a sum of such (a Coxian
    distribution: a hidden semi-Markov model), and is followed by one in another room; who stays
    changes patch at times. Who comes to a patch is in its part that is in view with the chance of
    `shown`, the largest share of it in view at once in the bin, and is so until moving, or until
    what is in view changes: who sits behind a corner stays there, however long the robot looks.
    Evidence is explained

    - if the user was perceived: by a patch with the share of sightings in it; by anything else,
      as somebody else was taken for the user, with 0.001 of what follows;
    - if not: by who is in view with 1 - detection, by who isn't with 1. A patch in which somebody
      unknown was perceived, who may be the user, isn't in view.

    Consecutive bins of an hour in which the same was in view and perceived are taken `together`;
    what happens within them is taken to happen as they begin, once. With 1 it is exact, and takes
    as much longer.

    Shares are the means of P(room | all evidence), by smoothing. Lengths of stay, what follows
    what, who comes to which patch and changes it how often are learned by expectation and
    maximization with one event each beforehand (`fleet2d.algorithms.presence.person`). When a day
    is over it is smoothed as a whole, and so are two of the last 64 days, in turn, with messages
    from and to the days beside them (incremental, after Neal and Hinton 1998); the day under way
    is only filtered.

    Right when the robot acts on what it has perceived only (then where it looks can be ignored:
    missing at random, Rubin 1976) and looks at every patch at times. Breaks when the model is
    wrong: stays that differ much by time of day, people who follow each other, patches never
    looked at (there the prior speaks: such time is mostly taken for away), users who are hardly
    ever recognized.

    Anyone is taken from all users, apart from each other, and unknown people where seen; without
    users it is one person's chain.
    """

    detection: Share = Field(
        default=0.95, description="chance that somebody in view is perceived", gt=0, lt=1
    )
    restless: Share = Field(
        default=0.05,
        description="chance a bin that who stays in a room changes patch, before it is learned",
    )
    stages: int = Field(
        default=1, ge=1, le=4, description="of a stay; above 1 its length isn't geometric"
    )
    together: int = Field(
        default=5,
        ge=1,
        le=60,
        description="most bins, alike in what was in view and seen, that are taken together",
    )

    def begin(self, rooms: int, users: int, half_life: float | None = None) -> None:
        """Prepare for a run."""
        super().begin(rooms, users, half_life)
        self.people: list[Person] = []
        self.learned: Mapping[str, Any] = {}
        self.parts: list[Day] = []  # of the day under way
        self.days: list[Day] = []  # those that are gone through again, without their views
        self.hours: list[F64] = []  # their sums by hour
        self.turn = 0  # of the day gone through last

    def width(self, rooms: int) -> int:
        """Return how many numbers `sums` has: of rooms and away bins and their doubt, and all."""
        return 2 * (rooms + 1) + 1

    def shares(self, sums: F64) -> tuple[F64, F64]:
        """Return expected bins per room by all at home, and those away by all."""
        rooms, bins = (sums.shape[-1] - 3) // 2, sums[..., -1]
        away = np.where(bins > 0, sums[..., rooms] / np.where(bins > 0, bins, 1), 0.0)
        return normalized(np.maximum(sums[..., :rooms], 0)), np.clip(away, 0, 1)

    def interval(self, key: np.uint64, level: float) -> tuple[F64, F64]:
        """Return the ends of intervals for the shares of time in each room of the time so far.

        What is in doubt is the time in which nobody saw the user: with p = P(room | all evidence)
        of each bin, the number of bins in a room has the variance 2 l sum p (1 - p), where l is how
        long a stay there lasts on average, because bins of a stay depend on each other. That is
        doubled, for what isn't known of the stays themselves, and the ends are those of a normal
        distribution; below the share of one bin, the lower end is 0. Of fewer than two whole days
        little is known: 0 and 1.

        Args:
            key: Of the stream of draws, which it has no need of.
            level: How often the interval should hold the truth, as 0.9.

        Returns:
            Lower and upper ends, float64 (users + 1, rooms + 1) each, away last.
        """
        shape = (self.users + 1, self.rooms + 1)
        if len(self.counts.days) < FEWEST_DAYS:
            return np.zeros(shape), np.ones(shape)
        total, lengths = self.counts.total, [person.length_of_stay for person in self.people]
        anyone = [np.max(lengths, axis=0)] if self.users else []
        doubt = np.maximum(total[:, self.rooms + 1 : -1], 0) * np.array(lengths + anyone)
        at_home = np.maximum(total[:, : self.rooms].sum(axis=1, keepdims=True), 1)
        of = np.concatenate([np.repeat(at_home, self.rooms, axis=1), total[:, -1:]], axis=1)
        home, away = self.shares(total)
        share = np.concatenate([home, away[:, None]], axis=1)
        # Rounded to where no library disagrees.
        quantile = round(NormalDist().inv_cdf((1 + level) / 2), 6)
        half = quantile * np.sqrt(4 * doubt) / of
        low = np.where(share - half < 1 / of, 0.0, share - half)
        return low, np.minimum(share + half, 1)

    def observe(self, bins: Bins) -> None:
        """Take in evidence that follows on that before."""
        for day in by_day(bins):
            part = self.take_in(day)
            places = [
                person.follow(part.stretches(user, self.together))
                for user, person in enumerate(self.people)
            ]
            self.counts.add_hours(*self._by_hour(places, part))

    def take_in(self, bins: Bins) -> "Day":
        """Take in evidence of one day, from which is learned when the next has begun."""
        if not self.people:
            self._meet(bins)
        part = Day.of(bins)
        if part.number != self.counts.today:
            if self.parts:
                self._end_day(part.number)
            self.counts.begin_day(part.number)
        self.parts.append(part)
        return part

    def _meet(self, bins: Bins) -> None:
        layout, habits = Layout.of(bins, self.stages), Habits(self.detection, self.restless)
        self.people = [Person(layout, habits) for _ in range(max(self.users, 1))]
        for i, person in enumerate(self.people):
            if self.learned and not person.recall(self.learned.get(str(i), {})):
                raise ComponentError(
                    f"what was learned doesn't tell of stays of {self.stages} stages in"
                    f" {len(layout.room) - 1} patches of {self.rooms} rooms: it is from another"
                    " home, other users, another estimator, or one with other stages"
                )

    def _by_hour(self, places: list[F64], day: "Day") -> tuple[I64, F64]:
        """Return the hours of bins, as ordinal * 24 + hour, and what adds up in each.

        That is places p, p (1 - p), and 1: float64 (hours, users + 1, width).
        """
        hour = day.minute // 60
        first = np.concatenate([[0], np.flatnonzero(np.diff(hour)) + 1])
        sums = sum_places(np.stack(places), day.unknown, self.users, first)
        return day.number * 24 + hour[first], sums

    def _whole_day(self, places: list[F64], day: "Day") -> F64:
        """Return what adds up in each hour of a day: float64 (24, users + 1, width)."""
        hours, sums = self._by_hour(places, day)
        found = np.zeros((24, *sums.shape[1:]))
        found[hours % 24] = sums
        return found

    def _end_day(self, following: int) -> None:
        """Smooth the day under way as a whole, learn from it, and go through earlier ones again."""
        day, self.parts = Day.joined(self.parts), []
        places = [
            person.end_day(day.stretches(user, self.together))
            for user, person in enumerate(self.people)
        ]
        self.counts.hours = self._whole_day(places, day)
        self.hours.append(self.counts.hours)
        self.days.append(day._replace(watched=None, sightings=None))
        for _ in range(REVISITS):
            self.turn = (self.turn - 1) % len(self.days)
            self._revisit(self.turn)
        fade = self.counts.faded(following - self.counts.today)
        for person in self.people:
            person.fade(fade)
            person.forget(KEPT)
        del self.days[:-KEPT], self.hours[:-KEPT]

    def _revisit(self, number: int) -> None:
        """Go through a day again, and put what it says now in place of what it said."""
        day = self.days[number]
        weight = self.counts.faded(self.counts.today - day.number)
        places = [person.revisit(number, weight) for person in self.people]
        hours = self._whole_day(places, day)
        self.counts.put(day.number, self.hours[number], hours)
        self.hours[number] = hours

    def remember(self) -> dict[str, Any]:
        """Return all that was learned, as arrays in mappings."""
        stays = {str(i): person.remember() for i, person in enumerate(self.people)}
        return {**super().remember(), "stays": stays or self.learned}

    def recall(self, learned: Mapping[str, Any], today: int) -> None:
        """Go on from what `remember` returned; called after `begin`."""
        super().recall(learned, today)
        self.learned = learned.get("stays", {})


class Day(NamedTuple):
    """Evidence of one day, or of a part of it, as the chains of users need it.

    Attributes:
        number: Of the day, as `date.toordinal` counts.
        minute: int64 (bins,), since midnight.
        unknown: bool (bins, rooms), where somebody was perceived who is no user.
        watched: uint8 (bins, patches), from `watched_patches`; None once the day is learned from.
        sightings: Who was perceived where; None likewise.
    """

    number: int
    minute: I64
    unknown: NDArray[np.bool_]
    watched: NDArray[np.uint8] | None
    sightings: "Sightings | None"

    @classmethod
    def of(cls, bins: Bins) -> Self:
        """Return evidence of one day."""
        number, watched = int(bins.day[0]), watched_patches(bins)
        return cls(number, bins.minute, unknown_seen(bins), watched, Sightings.of(bins.parts.seen))

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """Return parts of a day that follow each other as one."""
        if len(parts) == 1:
            return parts[0]
        lengths = [len(part.minute) for part in parts]
        return cls(
            parts[0].number,
            np.concatenate([part.minute for part in parts]),
            np.concatenate([part.unknown for part in parts]),
            np.concatenate([part.watched for part in parts if part.watched is not None]),
            Sightings.joined([part.sightings for part in parts if part.sightings], lengths),
        )

    def stretches(self, user: int, longest: int) -> Stretches:
        """Return the evidence of one user, bins that are alike taken together."""
        assert self.watched is not None
        assert self.sightings is not None
        seen = self.sightings.of_user(user, self.watched.shape)
        return take_together(self.minute, self.watched, seen, longest)


class Sightings(NamedTuple):
    """Where users were perceived, which is hardly anywhere at most times: arrays of one length.

    Attributes:
        user: int64, rising.
        bin: int64, rising for each user.
        patch: int64.
        steps: int64, at how many steps.
    """

    user: I64
    bin: I64
    patch: I64
    steps: I64

    @classmethod
    def of(cls, seen: I64) -> Self:
        """Return the sightings in counts (bins, users + 1, patches), as in Parts."""
        steps = seen.ravel()
        places = np.flatnonzero(steps > 0)  # quicker than with three axes, or of the numbers
        bins, user, patch = np.unravel_index(places, seen.shape)
        return cls(user, bins, patch, steps[places])._by_user()

    @classmethod
    def joined(cls, parts: Sequence[Self], lengths: Sequence[int]) -> Self:
        """Return sightings in parts of so many bins that follow each other as one."""
        first = np.cumsum([0, *lengths[:-1]])
        moved = [part._replace(bin=part.bin + at) for part, at in zip(parts, first, strict=True)]
        return cls(*(np.concatenate(column) for column in zip(*moved, strict=True)))._by_user()

    def _by_user(self) -> Self:
        order = np.argsort(self.user, kind="stable")
        return type(self)(*(column[order] for column in self))

    def of_user(self, user: int, shape: tuple[int, ...]) -> I64:
        """Return those of a user as counts, int64 of a shape (bins, patches)."""
        begin, end = np.searchsorted(self.user, [user, user + 1])
        seen = np.zeros(shape, np.int64)
        seen[self.bin[begin:end], self.patch[begin:end]] = self.steps[begin:end]
        return seen


def by_day(bins: Bins) -> list[Bins]:
    """Return evidence as that of its days."""
    ends = [*(np.flatnonzero(np.diff(bins.day)) + 1).tolist(), len(bins.day)]
    return [bins.part(a, b) for a, b in pairwise([0, *ends]) if a < b]
