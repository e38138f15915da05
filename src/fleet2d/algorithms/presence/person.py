"""One person's stays, as far as they are known: learned from all days, and gone through again."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from fleet2d.algorithms.presence.counts import Bins
from fleet2d.kernels.smoothing import smooth
from fleet2d.kernels.stays import WHOLE_PATCH, Moments, Stretches, Ways, follow, take_together

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

# Bins that one stay lasts before anything was learned, and first and last of several stages.
STAY = 120.0
SHORT, LONG = 5.0, 240.0


class Layout(NamedTuple):
    """What a person's states are.

    Attributes:
        room: int64 (patches + 1,), the room of each patch, and last away, one past the last room.
        spread: float64 (patches + 1,), the share of each patch in the floor of its room.
        rooms: How many rooms there are.
        stages: Stages of a stay.
    """

    room: I64
    spread: F64
    rooms: int
    stages: int

    @classmethod
    def of(cls, bins: Bins, stages: int) -> Self:
        """Return the layout of evidence."""
        room, cells = bins.parts.room, bins.parts.cells
        rooms = bins.watched.shape[1]
        floor = np.maximum(cells, 1)
        spread = np.append(floor / np.bincount(room, floor, minlength=rooms)[room], 1.0)
        return cls(np.append(room, rooms), spread, rooms, stages)

    @property
    def anywhere(self) -> F64:
        """A state that nothing is known of: rooms and away alike, (stages, patches + 1)."""
        return np.tile(self.spread / ((self.rooms + 1) * self.stages), (self.stages, 1))

    def unknown_view(self) -> I64:
        """Return what part of each patch is in view, which isn't known: int64 (patches + 1,)."""
        return np.full(len(self.room), -1, np.int64)

    def no_moments(self) -> Moments:
        """Return moments of nothing."""
        places, nodes = self.rooms + 1, (self.rooms + 1) * self.stages
        return Moments(
            np.zeros(nodes),
            np.zeros((nodes, places + 1)),
            np.zeros(len(self.room)),
            np.zeros(places),
            np.zeros(places),
        )


class Habits(NamedTuple):
    """What is known of a person beforehand.

    Attributes:
        detection: Chance that who is in view is perceived.
        restless: Chance a bin that who stays in a room changes patch.
    """

    detection: float
    restless: float


def ways_of(moments: Moments, layout: Layout, habits: Habits) -> Ways:
    """Return how a person goes on, most probably: expected counts by expected time, and a prior.

    A stage is given one end after STAY bins beforehand (of several stages, 5 to 240 bins), and one
    follower, drawn as rooms are entered overall; with several stages, half of it the next one. A
    room is given one arrival, spread over its floor; and one change of patch, after as many bins
    as `restless` says.
    """
    places, stages = layout.rooms + 1, layout.stages
    lengths = np.linspace(SHORT, LONG, stages) if stages > 1 else np.array([STAY])
    ends = moments.exits.sum(axis=1)
    stay = 1 - (ends + 1) / (moments.time + np.tile(lengths, places))
    entered = moments.exits[:, :places].sum(axis=0) + 1 / places
    others = np.tile(entered, (places, 1))
    np.fill_diagonal(others, 0.0)
    others = np.repeat(others / others.sum(axis=1, keepdims=True), stages, axis=0)
    onward = np.tile(np.arange(stages) < stages - 1, places) / 2
    before = np.concatenate([others * (1 - onward)[:, None], onward[:, None]], axis=1)
    follows = (moments.exits + before) / (ends + 1)[:, None]
    spread = moments.arrivals + layout.spread
    spread = spread / np.bincount(layout.room, spread)[layout.room]
    trials = moments.moves + moments.rests + 1 / max(habits.restless, 1e-6)
    restless = (moments.moves + 1) / np.maximum(trials, 1)
    restless[-1] = 0.0  # away has no patches
    first = np.searchsorted(layout.room, np.arange(places + 1)).astype(np.int64)
    return Ways(stay, follows, spread, np.minimum(restless, 1), first, habits.detection)


@dataclass
class Visit:
    """A day of a person.

    Attributes:
        stretches: The evidence.
        dawn: float64 (stages, patches), probability before it.
        dusk: float64 (stages, patches), how likely each makes the days after.
        moments: What is expected of it.
    """

    stretches: Stretches
    dawn: F64
    dusk: F64
    moments: Moments


class Person:
    """What was learned of one user.

    Attributes:
        ways: How the user goes on.
        total: Moments of all days, older ones faded.
        now: float64 (stages, patches), probability after the last bin.
        days: The days that are over, as far as they are gone through again.
    """

    def __init__(self, layout: Layout, habits: Habits) -> None:
        """Begin without knowing anything."""
        self.layout, self.habits = layout, habits
        self.total = layout.no_moments()
        self.ways = ways_of(self.total, layout, habits)
        self.now = self.dawn = layout.anywhere
        self.ones = np.ones_like(self.now)
        self.days: list[Visit] = []

    @property
    def length_of_stay(self) -> F64:
        """How many bins a stay in each room, and away, lasts on average: float64 (rooms + 1,)."""
        places = self.layout.rooms + 1
        time = self.total.time.reshape(places, -1).sum(axis=1)
        ends = self.total.exits[:, :places].reshape(places, -1).sum(axis=1)
        length: F64 = (time + STAY) / (ends + 1)
        return length

    def follow(self, stretches: Stretches) -> F64:
        """Go on over some stretches.

        Returns:
            P(room | evidence up to there) in each bin, float64 (bins, rooms + 1).
        """
        now = np.stack([np.zeros_like(self.now), self.now])
        places = follow(self.ways, stretches, now, self.layout.unknown_view())
        self.now = now[0] + now[1]
        return np.repeat(places, stretches.bins, axis=0)

    def end_day(self, stretches: Stretches) -> F64:
        """Smooth the day that is over as a whole, and learn from it.

        Returns:
            P(room) in each of its bins, float64 (bins, rooms + 1).
        """
        nothing = self.layout.no_moments()
        self.days.append(Visit(stretches, self.dawn, self.ones, nothing))
        return self.revisit(len(self.days) - 1, 1.0)

    def revisit(self, number: int, weight: float) -> F64:
        """Go through a day again, by what is known now; learn what that changes.

        Messages go to the day before and to the next, which use them when their turn comes.

        Args:
            number: Of the day, in `days`.
            weight: What it counts.
        """
        day, moments = self.days[number], self.layout.no_moments()
        places, end, begin = smooth(self.ways, day.stretches, day.dawn, day.dusk, moments)
        if number > 0:
            self.days[number - 1].dusk = begin
        if number + 1 < len(self.days):
            self.days[number + 1].dawn = end
        else:
            self.now = self.dawn = end
        self.total = Moments(
            *(
                np.maximum(total + weight * (new - old), 0.0)
                for total, new, old in zip(self.total, moments, day.moments, strict=True)
            )
        )
        day.moments = moments
        self.ways = ways_of(self.total, self.layout, self.habits)
        return np.repeat(places, day.stretches.bins, axis=0)

    def fade(self, weight: float) -> None:
        """Let all that was learned count less."""
        if weight < 1:
            self.total = Moments(*(weight * part for part in self.total))

    def forget(self, kept: int) -> None:
        """Keep the last days only; what was learned of the others stays."""
        del self.days[:-kept]

    def remember(self) -> dict[str, Any]:
        """Return what was learned, as arrays."""
        return self.total._asdict()

    def recall(self, learned: Mapping[str, Any]) -> bool:
        """Go on from what `remember` returned; tell whether it is of the same rooms and stages."""
        found = {name: np.asarray(learned.get(name, ())) for name in Moments._fields}
        if any(found[name].shape != part.shape for name, part in self.total._asdict().items()):
            return False
        self.total = Moments(**{name: np.array(part, np.float64) for name, part in found.items()})
        self.ways = ways_of(self.total, self.layout, self.habits)
        return True


def watched_patches(bins: Bins) -> NDArray[np.uint8]:
    """Return how much of each patch was watched, up to WHOLE_PATCH: uint8 (bins, patches).

    One in which somebody unknown was perceived, who may be any user, doesn't count as watched.
    """
    seen, users = bins.parts.seen, bins.parts.seen.shape[1] - 1
    shown = bins.parts.shown_parts
    if shown is None:
        whole = np.minimum(bins.parts.shown, 1) * WHOLE_PATCH
        shown = np.rint(whole).astype(np.uint8)
    if users:
        known = seen[:, 0] if users == 1 else seen[:, :-1].sum(axis=1)
        shown = np.where(seen[:, -1] > known, np.uint8(0), shown)
    return shown


def stretches_of(
    bins: Bins, user: int, longest: int, watched: NDArray[np.uint8] | None = None
) -> Stretches:
    """Return the evidence of one user, bins that are alike taken together.

    Args:
        bins: The evidence.
        user: Row of the user; the last is anybody.
        longest: Most bins of a stretch.
        watched: `watched_patches` of these bins, where it is known already: for all users it is
            the same.
    """
    watched = watched_patches(bins) if watched is None else watched
    seen = np.ascontiguousarray(bins.parts.seen[:, user])
    return take_together(bins.minute, watched, seen, longest)
