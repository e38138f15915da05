"""Stays of a person, hidden or seen: a semi-Markov chain over patches of rooms, filtered.

No logarithm, no library's product, and one order of sums: what is learned, and where a robot goes
because of it, is the same on every machine.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fleet2d.kernels._jit import kernel

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
U8 = NDArray[np.uint8]

WHOLE = 255  # of a patch in view
FALSE_ALARM = 1e-3  # weight of the chance that who was seen in a patch is elsewhere
NEVER_SURE = 1e-12  # least chance not to be perceived, however long one is in view


class Stretches(NamedTuple):
    """Evidence of one user, of which bins that are alike are taken together.

    Attributes:
        bins: int64 (stretches,), how many bins each has.
        hour: int64 (stretches,), of the day.
        shown: uint8 (stretches, patches), what part of each patch was in view, in 1/255; the last
            patch is away, which never is.
        begin: int64 (stretches + 1,), where each stretch's sightings begin in the next two.
        patch: int64 (sightings,), where the user was perceived.
        share: float64 (sightings,), at what share of the steps with a sighting.
    """

    bins: I64
    hour: I64
    shown: U8
    begin: I64
    patch: I64
    share: F64


class Ways(NamedTuple):
    """How a person goes on: in stages of a stay, and from room to room.

    A stage is that of a room, or of away, the last; number room * stages + stage.

    Attributes:
        stay: float64 (stages,), chance to be in the same stage a bin later.
        follow: float64 (stages, rooms + 2), where those go who aren't: to each room, away, and the
            next stage of the same; rows sum to one.
        spread: float64 (patches,), who comes to a room comes to which of its patches.
        restless: float64 (rooms + 1,), chance a bin that who stays in a room changes patch.
        first: uint64 (rooms + 2,), the first patch of each room, that of away, and their number.
        detection: Chance that who is in view is perceived in a bin.
    """

    stay: F64
    follow: F64
    spread: F64
    restless: F64
    first: NDArray[np.uint64]
    detection: float


class Moments(NamedTuple):
    """What is expected of a person's stays, given all evidence.

    Attributes:
        time: float64 (stages,), bins.
        exits: float64 (stages, rooms + 2), how often each is followed by what.
        arrivals: float64 (patches,), how often who came, or changed patch, came there.
        moves: float64 (rooms + 1,), changes of patch; rests, bins without one.
    """

    time: F64
    exits: F64
    arrivals: F64
    moves: F64
    rests: F64


@kernel
def whole_power(base: float, exponent: int) -> float:
    """Return base to a whole power, by multiplications."""
    result = 1.0
    while exponent > 0:
        if exponent & 1:
            result *= base
        base *= base
        exponent >>= 1
    return result


@kernel
def take_together(minute: I64, shown: U8, seen: I64, longest: int) -> Stretches:
    """Take together bins in which the same was in view and the user was perceived alike.

    Bins in which the user was perceived in several patches stay by themselves.

    Args:
        minute: (bins,) since midnight; no stretch goes on into another hour.
        shown: (bins, patches), as in Stretches, away left out.
        seen: (bins, patches), steps at which the user was perceived in each.
        longest: Most bins of a stretch.
    """
    count, patches = shown.shape
    places, sightings = np.zeros(count, np.int64), 0
    only = np.full(count, -1, np.int64)  # the patch in which the user was perceived
    for t in range(count):
        for p in range(patches):
            if seen[t, p] > 0:
                places[t] += 1
                only[t] = p
        sightings += places[t]
    bins, hour = np.zeros(count, np.int64), np.zeros(count, np.int64)
    opened, begin = np.zeros(count, np.int64), np.zeros(count + 1, np.int64)
    patch, share = np.zeros(sightings, np.int64), np.zeros(sightings)
    n = k = 0
    for t in range(count):
        alike = n > 0 and bins[n - 1] < longest and hour[n - 1] == minute[t] // 60
        alike = alike and places[t] < 2 and places[t - 1] < 2 and only[t] == only[t - 1]
        p = 0 if alike else patches
        while p < patches and shown[t, p] == shown[t - 1, p]:
            p += 1
        if alike and p == patches:
            bins[n - 1] += 1
            continue
        total = 0.0
        for p in range(patches):
            total += seen[t, p]
        for p in range(patches):
            if seen[t, p] > 0:
                patch[k], share[k] = p, seen[t, p] / total
                k += 1
        bins[n], hour[n], opened[n] = 1, minute[t] // 60, t
        n += 1
        begin[n] = k
    kept = np.zeros((n, patches + 1), np.uint8)
    for i in range(n):
        kept[i, :patches] = shown[opened[i]]
    return Stretches(
        bins[:n].copy(), hour[:n].copy(), kept, begin[: n + 1].copy(), patch[:k], share[:k]
    )


class Filtered(NamedTuple):
    """What the evidence up to each stretch says of a person, and before the first.

    Attributes:
        inside: float64 (stretches + 1, stages, patches), probability of each stage of a stay and of
            the part of the patch that is in view.
        outside: The same of the other part.
        mass: float64 (stretches + 1, nodes), their sums by stage of a room.
        kept: float64 (stretches, nodes), chance to be in the same stage after it.
        hop: The same of a change of patch.
        likely: float64 (stretches, 2), how well who is in view, and who isn't, explains that the
            user wasn't perceived with them.
        scale: float64 (stretches,), by which all that was multiplied to sum to one.
        same: bool (stretches, patches), whether as much of the patch is in view as before.
    """

    inside: F64
    outside: F64
    mass: F64
    kept: F64
    hop: F64
    likely: F64
    scale: F64
    same: NDArray[np.bool_]


@kernel
def filter_stays(ways: Ways, stretches: Stretches, now: F64, shown: I64) -> Filtered:
    """Return what the evidence up to each stretch says; see `smoothing.smooth`.

    Args:
        ways: How the person goes on.
        stretches: The evidence.
        now: (2, stages, patches), probability before the first, in view and not.
        shown: (patches,), what part of each patch was in view before, -1 if that isn't known.
    """
    count, nodes, (_, stages, patches) = len(stretches.bins), len(ways.stay), now.shape
    inside = np.empty((count + 1, stages, patches))
    outside = np.empty((count + 1, stages, patches))
    kept, hop = np.empty((count, nodes)), np.empty((count, nodes))
    mass, likely = np.zeros((count + 1, nodes)), np.empty((count, 2))
    same = np.empty((count, patches), np.bool_)
    inside[0], outside[0] = now[0], now[1]
    for k in range(nodes):
        for p in range(ways.first[k // stages], ways.first[k // stages + 1]):
            mass[0, k] += now[0, k % stages, p] + now[1, k % stages, p]
    for t in range(count):
        bins = stretches.bins[t]
        for k in range(nodes):
            kept[t, k] = whole_power(ways.stay[k], bins)
            hop[t, k] = 1.0 - whole_power(1.0 - ways.restless[k // stages], bins)
        missed = max(whole_power(1.0 - ways.detection, bins), NEVER_SURE)
        weight = FALSE_ALARM if stretches.begin[t + 1] > stretches.begin[t] else 1.0
        likely[t, 0], likely[t, 1] = weight * missed, weight
        for p in range(patches):
            before = shown[p] if t == 0 else np.int64(stretches.shown[t - 1, p])
            same[t, p] = np.int64(stretches.shown[t, p]) == before
    found = Filtered(inside, outside, mass, kept, hop, likely, np.empty(count), same)
    _filter(ways, stretches, found)
    return found


@kernel
def _filter(ways: Ways, stretches: Stretches, found: Filtered) -> None:
    """Write what the evidence up to each stretch says of it."""
    follow, spread, first = ways.follow, ways.spread, ways.first
    kept, hop, mass, into = found.kept, found.hop, found.mass, np.empty(follow.shape[1] - 1)
    nodes, places, stages = len(ways.stay), len(into), found.inside.shape[1]
    for t in range(len(stretches.bins)):
        into[:] = 0.0
        for k in range(nodes):
            for j in range(places):
                into[j] += mass[t, k] * (1.0 - kept[t, k]) * follow[k, j]
        view, same = stretches.shown[t], found.same[t]
        for k in range(nodes):
            r, s = k // stages, k % stages
            rest, came = kept[t, k] * (1.0 - hop[t, k]), kept[t, k] * hop[t, k] * mass[t, k]
            on = 0.0 if s == 0 else (1.0 - kept[t, k - 1]) * follow[k - 1, places]
            came += into[r] if s == 0 else 0.0
            was_in, was_out = found.inside[t, s], found.outside[t, s]
            last_in, last_out = found.inside[t, max(s - 1, 0)], found.outside[t, max(s - 1, 0)]
            now_in, now_out = found.inside[t + 1, s], found.outside[t + 1, s]
            for p in range(first[r], first[r + 1]):
                shown = view[p] * (1.0 / WHOLE)
                stay_in = rest * was_in[p] + on * last_in[p]
                stay_out = rest * was_out[p] + on * last_out[p]
                drawn = came * spread[p] + (0.0 if same[p] else stay_in + stay_out)
                in_view = shown * drawn + (stay_in if same[p] else 0.0)
                hidden = (1.0 - shown) * drawn + (stay_out if same[p] else 0.0)
                now_in[p], now_out[p] = in_view * found.likely[t, 0], hidden * found.likely[t, 1]
        for i in range(stretches.begin[t], stretches.begin[t + 1]):
            p = stretches.patch[i]
            for s in range(stages):
                if view[p] > 0:
                    found.inside[t + 1, s, p] *= 1.0 + stretches.share[i] / found.likely[t, 0]
                else:
                    found.outside[t + 1, s, p] *= 1.0 + stretches.share[i] / found.likely[t, 1]
        _normalize(first, t, found)


@kernel
def _normalize(first: NDArray[np.uint64], t: int, found: Filtered) -> None:
    """Let what is known after a stretch sum to one."""
    stages, total = found.inside.shape[1], 0.0
    now_in, now_out, mass = found.inside[t + 1], found.outside[t + 1], found.mass[t + 1]
    for k in range(len(mass)):
        s, part = k % stages, 0.0
        for p in range(first[k // stages], first[k // stages + 1]):
            part += now_in[s, p] + now_out[s, p]
        mass[k] = part
        total += part
    found.scale[t] = 1.0 / total
    mass *= found.scale[t]
    now_in *= found.scale[t]
    now_out *= found.scale[t]


@kernel
def follow(ways: Ways, stretches: Stretches, now: F64, shown: I64) -> F64:
    """Return where a person was, given the evidence up to each stretch; see `smoothing.smooth`.

    Args:
        ways: How the person goes on.
        stretches: The evidence, of one stretch at least.
        now: (2, stages, patches), probability before the first stretch, in view and not; becomes
            that after the last.
        shown: (patches,), what part of each patch was in view before, -1 if that isn't known;
            becomes that of the last.

    Returns:
        P(room), away last, in each stretch: float64 (stretches, rooms + 1).
    """
    count, stages = len(stretches.bins), now.shape[1]
    found = filter_stays(ways, stretches, now, shown)
    places = np.zeros((count, len(ways.first) - 1))
    for t in range(count):
        for k in range(len(ways.stay)):
            places[t, k // stages] += found.mass[t + 1, k]
    now[0], now[1] = found.inside[count], found.outside[count]
    shown[:] = stretches.shown[count - 1]
    return places
