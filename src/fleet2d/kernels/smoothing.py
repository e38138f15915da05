"""Stays of a person given all evidence, earlier and later; and what to learn from them."""

import numpy as np
from numpy.typing import NDArray

from fleet2d.kernels._jit import kernel
from fleet2d.kernels.stays import WHOLE, Filtered, Moments, Stretches, Ways, filter_stays

F64 = NDArray[np.float64]


@kernel
def smooth(
    ways: Ways, stretches: Stretches, dawn: F64, dusk: F64, moments: Moments
) -> tuple[F64, F64, F64]:
    """Return where a person was, given all evidence of some stretches.

    Between two stretches a person may go on once: leave a stage, with the chance to do so within
    the later one, or change patch within the room. With stretches of one bin that is a hidden
    Markov chain; with longer ones, what happens within a stretch is taken to happen as it begins.
    Who comes to a patch of which a part is in view is in that part with the chance of its size,
    and stays in it or out of it until the person moves or what is in view of it changes. In view
    one isn't perceived in any of n bins with (1 - detection)^n; out of view never, unless nothing
    of the patch was in view where somebody was perceived: positions may be noisy.

    Args:
        ways: How the person goes on.
        stretches: The evidence.
        dawn: (stages, patches), probability before the first stretch.
        dusk: (stages, patches), how likely each makes what comes after the last.
        moments: To add to.

    Returns:
        P(room) in each stretch, float64 (stretches, rooms + 1); the probability of stage and patch
        after the last, given what was before, and how likely each before the first makes the
        evidence, largest 1: float64 (stages, patches) each.
    """
    count, first, (stages, patches) = len(stretches.bins), ways.first, dawn.shape
    now = np.zeros((2, stages, patches))
    now[1] = dawn
    found = filter_stays(ways, stretches, now, np.full(patches, -1, np.int64))
    places, end = np.zeros((count, len(first) - 1)), found.inside[count] + found.outside[count]
    total = 0.0
    for s in range(stages):
        for p in range(patches):
            total += end[s, p] * dusk[s, p]
    ahead = np.empty((2, stages, patches))  # of who is in view, and who isn't
    ahead[0] = ahead[1] = dusk / total
    likely = np.empty((3, stages, patches))
    for t in range(count - 1, -1, -1):
        total = 0.0  # not by `sum`, which adds in another order where it isn't compiled
        for k in range(len(ways.stay)):
            s, part = k % stages, 0.0
            now_in, now_out = found.inside[t + 1, s], found.outside[t + 1, s]
            if_in, if_out = ahead[0, s], ahead[1, s]
            for p in range(first[k // stages], first[k // stages + 1]):
                part += now_in[p] * if_in[p] + now_out[p] * if_out[p]
            places[t, k // stages] += part
            total += part
        places[t] /= total
        _weigh(stretches, t, found, ahead, likely)
        _step_back(ways, stretches.bins[t], t, found, likely, ahead, moments)
    return places, end, ahead[1] / ahead[1].max()


@kernel
def _weigh(stretches: Stretches, t: int, found: Filtered, ahead: F64, likely: F64) -> None:
    """Write how well a stretch and all after it is explained by each state in it.

    Args:
        stretches: The evidence.
        t: The stretch.
        found: What was filtered.
        ahead: (2, stages, patches), how likely each state makes all after the stretch.
        likely: (3, stages, patches) to write to: of who is in view, who isn't, and who comes,
            scaled so that products with the probability of a step sum to one.
    """
    view, (_, stages, patches) = stretches.shown[t], ahead.shape
    for side in range(2):
        chance = found.likely[t, side] * found.scale[t]
        for s in range(stages):
            now, then = likely[side, s], ahead[side, s]
            for p in range(patches):
                now[p] = chance * then[p]
    for i in range(stretches.begin[t], stretches.begin[t + 1]):
        p = stretches.patch[i]
        side = 0 if view[p] > 0 else 1
        for s in range(stages):
            likely[side, s, p] *= 1.0 + stretches.share[i] / found.likely[t, side]
    for s in range(stages):
        in_view, hidden, comes = likely[0, s], likely[1, s], likely[2, s]
        for p in range(patches):
            shown = view[p] * (1.0 / WHOLE)
            comes[p] = shown * in_view[p] + (1.0 - shown) * hidden[p]


@kernel
def _leave(
    ways: Ways, bins: int, t: int, found: Filtered, likely: F64, moments: Moments
) -> tuple[F64, F64]:
    """Add up what is expected of those who leave a room in a stretch, or change patch.

    Args:
        ways: How the person goes on.
        bins: Of the stretch.
        t: Its number.
        found: What was filtered.
        likely: (3, stages, patches), from `_weigh`.
        moments: To add to.

    Returns:
        How likely each node makes what follows if they do, float64 (nodes,); and how many come to
        each room from others, float64 (rooms + 1,).
    """
    follow, spread, first = ways.follow, ways.spread, ways.first
    mass, kept, hop, stages = found.mass[t], found.kept[t], found.hop[t], likely.shape[1]
    nodes, places = len(ways.stay), follow.shape[1] - 1
    drawn, comers, go = np.zeros(nodes), np.zeros(places), np.empty(nodes)
    for k in range(nodes):
        comes, part = likely[2, k % stages], 0.0
        for p in range(first[k // stages], first[k // stages + 1]):
            part += spread[p] * comes[p]
        drawn[k] = part
    halfway = 0.5 * (bins + 1)  # bins until what happens in a stretch, on average
    for k in range(nodes):
        left = 0.0
        for j in range(places):
            chance = (1.0 - kept[k]) * follow[k, j]
            left += chance * drawn[j * stages]
            comers[j] += mass[k] * chance
            moments.exits[k, j] += mass[k] * chance * drawn[j * stages]
        moved = kept[k] * hop[k] * drawn[k]
        go[k] = left + moved
        moments.time[k] += mass[k] * (halfway * left + bins * moved)
        moments.moves[k // stages] += mass[k] * moved
        moments.rests[k // stages] += mass[k] * (halfway - 1.0) * moved
    return go, comers


@kernel
def _step_back(
    ways: Ways, bins: int, t: int, found: Filtered, likely: F64, ahead: F64, moments: Moments
) -> None:
    """Write how likely each state before a stretch makes what follows, and add up what is expected.

    Args:
        ways: How the person goes on.
        bins: Of the stretch.
        t: Its number.
        found: What was filtered.
        likely: (3, stages, patches), from `_weigh`.
        ahead: (2, stages, patches) to write to.
        moments: To add to.
    """
    follow, spread, first, same = ways.follow, ways.spread, ways.first, found.same[t]
    mass, kept, hop, stages = found.mass[t], found.kept[t], found.hop[t], ahead.shape[1]
    arrivals, places, halfway = moments.arrivals, follow.shape[1] - 1, 0.5 * (bins + 1)
    go, comers = _leave(ways, bins, t, found, likely, moments)
    for k in range(len(ways.stay)):
        r, s = k // stages, k % stages
        begin, end = first[r], first[r + 1]
        came = kept[k] * hop[k] * mass[k] + (comers[r] if s == 0 else 0.0)
        comes, to_in, to_out = likely[2, s], ahead[0, s], ahead[1, s]
        was_in, was_out = found.inside[t, s], found.outside[t, s]
        for p in range(begin, end):
            arrivals[p] += came * spread[p] * comes[p]
            to_in[p] = to_out[p] = go[k]
        for then in range(s, min(s + 2, stages)):  # in the same stage, or in the next one
            chance = kept[k] * (1.0 - hop[k]) if then == s else (1.0 - kept[k]) * follow[k, places]
            in_view, hidden, comes, total = likely[0, then], likely[1, then], likely[2, then], 0.0
            for p in range(begin, end):
                if_in = chance * (in_view[p] if same[p] else comes[p])
                if_out = chance * (hidden[p] if same[p] else comes[p])
                to_in[p] += if_in
                to_out[p] += if_out
                total += was_in[p] * if_in + was_out[p] * if_out
            if then == s:
                moments.time[k] += bins * total
                moments.rests[r] += bins * total
            else:
                moments.time[k] += halfway * total
                moments.exits[k, places] += total
