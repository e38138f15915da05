"""A person as a hidden Markov chain over rooms: what evidence says of each, how rooms follow."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fleet2d.algorithms.presence.counts import Bins
from fleet2d.kernels.presence import backward, forward

F64 = NDArray[np.float64]

FALSE_ALARM = 1e-3  # weight of the chance that who was seen in a room is elsewhere
SAME_VIEW = 0.02  # part by which the same view of a room may differ from bin to bin
# Mean bins that stages of a stay last before anything was learned, first and last of several.
DWELL = 30.0
SHORT, LONG = 5.0, 60.0


class Sensor(NamedTuple):
    """How evidence comes about.

    Attributes:
        detection: Chance that somebody in view is perceived in a bin.
        restless: Chance that somebody changes place within a room from bin to bin.
        views: How many independent views of a room a robot takes in a bin in which it moves.
        negative: Whether rooms that are watched in vain become less likely.
    """

    detection: float
    restless: float
    views: int = 1
    negative: bool = True


def unknown_seen(bins: Bins) -> NDArray[np.bool_]:
    """Return where somebody was seen who is none of the users: bool (bins, rooms)."""
    users = bins.seen[:, :-1]
    found: NDArray[np.bool_] = bins.seen[:, -1] > users.sum(axis=1)
    return found if users.shape[1] else np.zeros_like(found)


def missed(
    bins: Bins, user: int, before: tuple[F64, NDArray[np.int64]] | None, sensor: Sensor
) -> F64:
    """Return the chance that a user who is in a room isn't perceived there: (bins, rooms).

    With w the share of the room in view, averaged over the bin, d the chance of detection, and m
    that of a change of place (restless):

    - in a new view it is 1 - d (1 - (1 - w)^n): a robot that moves or turns takes n `views` of
      the room, one if a bin has a single step;
    - in one that changed after the user was perceived there, 1 - d w;
    - in the same view as before, which showed the user then, 1 - d (1 - m (1 - w));
    - in the same view, which didn't show the user before, either, q (1 - m w d) + (1 - q) (1 - d):
      who is out of view is still so unless restless; q = (1 - w) / (1 - w + w (1 - d)^2) is the
      chance to be out of view after two looks in vain;
    - where somebody unknown was perceived, who may be the user, it is 1.

    Args:
        bins: The evidence.
        user: Row of the user.
        before: What was watched (rooms,) and seen (users + 1, rooms) in the bin before the first.
        sensor: How evidence comes about.
    """
    w, d, m = bins.watched, sensor.detection, sensor.restless
    first = (np.full(w.shape[1], -1.0), bins.seen[0]) if before is None else before
    watched_before = np.concatenate([first[0][np.newaxis], w[:-1]])
    seen_before = np.concatenate([first[1][np.newaxis, user], bins.seen[:-1, user]]) > 0
    same = np.abs(w - watched_before) <= SAME_VIEW * w
    swept = 1 - d * (1 - power(1 - w, min(sensor.views, bins.bin_steps)))
    left = 1 - d * np.where(same, 1 - m * (1 - w), w)
    hidden = (1 - w) / np.maximum(1 - w + w * ((1 - d) * (1 - d)), 1e-12)
    stale = hidden * (1 - m * w * d) + (1 - hidden) * (1 - d)
    found = np.where(seen_before, left, np.where(same, stale, swept))
    return np.where(unknown_seen(bins) | (w == 0), 1.0, found)


def power(base: F64, exponent: int) -> F64:
    """Return base to a whole power by multiplications, which round alike on every machine.

    Example:
        >>> power(np.array([0.5, 2.0]), 5).tolist()
        [0.03125, 32.0]
    """
    result = np.ones_like(base)
    while exponent:
        if exponent & 1:
            result = result * base
        base, exponent = base * base, exponent >> 1
    return result


def likelihood(
    bins: Bins, user: int, before: tuple[F64, NDArray[np.int64]] | None, sensor: Sensor
) -> F64:
    """Return how well each room, and last away, explains each bin: float64 (bins, rooms + 1).

    A user who was perceived in a bin is in each room with the share of steps at which that was
    there, or, with a small weight, anywhere: taken for somebody else. One who was not is the less
    likely in a room, the more of it was watched (`missed`).

    Args:
        bins: The evidence.
        user: Row of the user.
        before: As for `missed`.
        sensor: How evidence comes about.
    """
    seen = bins.seen[:, user].astype(np.float64)
    total = seen.sum(axis=1, keepdims=True)
    miss = missed(bins, user, before, sensor) if sensor.negative else np.ones_like(seen)
    rooms = np.where(total > 0, seen / np.where(total > 0, total, 1) + FALSE_ALARM * miss, miss)
    away = np.where(total > 0, FALSE_ALARM, 1.0)
    return np.concatenate([rooms, away], axis=1)


def prior(rooms: int, stages: int) -> F64:
    """Return how rooms follow each other before anything was learned, rows sum to one.

    States are the rooms and away, each with its stages, which are passed in order: a stay begins
    with the first and may end after any (a Coxian distribution of its length, which can be more
    and less spread than the geometric one of a single stage). What is zero here stays zero.

    Args:
        rooms: How many rooms there are.
        stages: Stages of a stay in a room.
    """
    places = rooms + 1
    lengths = [DWELL] if stages == 1 else np.linspace(SHORT, LONG, stages).tolist()
    found = np.zeros((places, stages, places, stages))
    for stage, length in enumerate(lengths):
        leave = 1 / length
        onward = leave / 2 if stage < stages - 1 else 0.0
        for place in range(places):
            found[place, stage, :, 0] = (leave - onward) / (places - 1)
            found[place, stage, place, 0] = 0.0
            found[place, stage, place, stage] = 1 - leave
            if onward:
                found[place, stage, place, stage + 1] = onward
    return found.reshape(places * stages, places * stages)


class Chain:
    """What was learned of one user: transitions, and where the user is now.

    Attributes:
        transition: float64 (states, states), rows sum to one.
        pairs: float64 (states, states), expected steps from state to state, older days faded.
        now: float64 (states,), probability after the last bin.
        dawn: float64 (states,), the same before the first bin of the day.
    """

    def __init__(self, rooms: int, stages: int) -> None:
        """Begin without knowing anything."""
        self.stages, self.prior = stages, prior(rooms, stages)
        self.transition = self.prior
        self.pairs = np.zeros_like(self.prior)
        self.now = np.full(len(self.prior), 1 / len(self.prior))
        self.dawn = self.now

    def smooth(self, likely: F64, start: F64, weight: F64, pairs: F64) -> tuple[F64, F64]:
        """Return the probability of each place given all evidence of some bins.

        Args:
            likely: float64 (bins, rooms + 1), from `likelihood`.
            start: float64 (states,), probability before the first bin.
            weight: float64 (bins,), how much each bin counts in `pairs`.
            pairs: float64 (states, states), to which expected steps are added.

        Returns:
            Places given all evidence, float64 (bins, rooms + 1), and states given that up to each
            bin, float64 (bins, states).
        """
        wide = np.repeat(likely, self.stages, axis=1) if self.stages > 1 else likely
        scale = np.empty(len(wide))
        filtered = forward(self.transition, start, wide, scale)
        smoothed = backward(self.transition, start, wide, filtered, scale, weight, pairs)
        return self.places(smoothed), filtered

    def frozen(self) -> "Chain":
        """Return a twin that doesn't change when this one learns."""
        twin = Chain.__new__(Chain)
        twin.__dict__.update(self.__dict__)  # arrays are replaced, never changed
        return twin

    def learn(self) -> None:
        """Estimate transitions anew: expected steps, and a stay's worth of the prior."""
        weight = DWELL if self.stages == 1 else LONG
        counts = self.pairs + weight * self.prior
        self.transition = counts / counts.sum(axis=1, keepdims=True)

    def places(self, states: F64) -> F64:
        """Add up the stages of each place: float64 (bins, rooms + 1)."""
        if self.stages == 1:
            return states
        by_stage = states.reshape(len(states), -1, self.stages)
        places = by_stage[:, :, 0].copy()
        for stage in range(1, self.stages):
            places += by_stage[:, :, stage]
        return places


def with_anyone(chains: list[F64], unknown: NDArray[np.bool_]) -> F64:
    """Add the row of anyone to the probabilities of the users' places.

    A room has somebody in it unless each user, apart from the others, is somewhere else, and for
    sure where somebody unknown was perceived.

    Args:
        chains: Each user's probability of each place, float64 (bins, rooms + 1).
        unknown: From `unknown_seen`.

    Returns:
        float64 (bins, users + 1, rooms + 1).
    """
    empty = np.where(unknown, 0.0, 1.0)
    gone = np.where(unknown.any(axis=1), 0.0, 1.0)
    for places in chains:
        empty = empty * (1 - np.minimum(places[:, :-1], 1))
        gone = gone * places[:, -1]
    anyone = np.concatenate([1 - empty, gone[:, None]], axis=1)
    return np.stack([*chains, anyone], axis=1)
