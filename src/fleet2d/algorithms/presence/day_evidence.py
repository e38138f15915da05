"""Evidence of a day for the Markov chain of each user; the views that all share are stored once."""

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple, Self

import numpy as np

from fleet2d.algorithms.evidence import SightingCounts
from fleet2d.algorithms.presence.anyone import unknown_seen
from fleet2d.algorithms.presence.counts import Bins
from fleet2d.kernels import I64, U8, Bool
from fleet2d.kernels.presence import WHOLE_PATCH, PeopleEvidence, Stretches, merge_bins


class DayEvidence(NamedTuple):
    """Evidence of one day, or of a part of it.

    Attributes:
        number: The day, as `date.toordinal` counts.
        minute: int64 (bins,), beginning of each bin [minutes since midnight].
        unknown: bool (bins, rooms), where an unknown person was perceived.
        view: int64 (bins,), the row of `views`.
        views: uint8 (views, patches + 1), how much of each patch was watched, 0 to WHOLE_PATCH,
            as in Stretches; consecutive rows differ.
        sightings: Where users were perceived, by patches.
    """

    number: int
    minute: I64
    unknown: Bool
    view: I64
    views: U8
    sightings: SightingCounts

    @classmethod
    def of(cls, bins: Bins) -> Self:
        """Return the evidence of bins of one day."""
        number, sightings = int(bins.day[0]), bins.parts.sightings
        patches = watched_patches(bins)
        watched = np.zeros((len(patches), patches.shape[1] + 1), np.uint8)
        watched[:, :-1] = patches
        return cls(number, bins.minute, unknown_seen(bins), *distinct(watched), sightings)

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """Return consecutive parts of a day as one."""
        if len(parts) == 1:
            return parts[0]
        return cls(
            parts[0].number,
            np.concatenate([part.minute for part in parts]),
            np.concatenate([part.unknown for part in parts]),
            *distinct(np.concatenate([part.views[part.view] for part in parts])),
            SightingCounts.joined([part.sightings for part in parts]),
        )

    def part(self, begin: int, end: int) -> Self:
        """Return the bins from `begin` to `end` - 1."""
        rows = slice(begin, end)
        sightings = self.sightings.between(begin, end)
        return self._replace(
            minute=self.minute[rows],
            unknown=self.unknown[rows],
            view=self.view[rows],
            sightings=sightings,
        )

    def stretches(self, user: int, longest: int) -> Stretches:
        """Return the evidence of one user, with runs of identical consecutive bins merged.

        Args:
            user: Row of the user; the last row is anybody.
            longest: Largest number of bins in a stretch.
        """
        seen = self.sightings.of_user(user)
        return merge_bins(self.minute, self.view, self.views, seen, longest)

    def of_people(self, count: int) -> PeopleEvidence:
        """Return the evidence of the first `count` users; without users, the first is anybody."""
        user, seen_bin, patch, steps, _ = self.sightings
        begin = np.searchsorted(user, np.arange(count + 1)).astype(np.int64)
        return PeopleEvidence(self.minute, self.view, self.views, begin, seen_bin, patch, steps)


def watched_patches(bins: Bins) -> U8:
    """Return how much of each patch was watched, 0 to WHOLE_PATCH: uint8 (bins, patches).

    A patch in which an unknown person was perceived, who may be any user, counts as unwatched.
    """
    shown = bins.parts.shown_parts
    if shown is None:
        whole = np.minimum(bins.parts.shown, 1) * WHOLE_PATCH
        shown = np.rint(whole).astype(np.uint8)
    sightings = bins.parts.sightings
    if sightings.shape[1] > 1:
        shown = np.where(sightings.unknown, np.uint8(0), shown)
    return shown


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


def by_day(bins: Bins) -> list[Bins]:
    """Split evidence into days."""
    ends = [*(np.flatnonzero(np.diff(bins.day)) + 1).tolist(), len(bins.day)]
    return [bins.part(a, b) for a, b in pairwise([0, *ends]) if a < b]
