"""Slow, obvious twins of the estimators and measures of presence: loops, and all paths of a chain."""

import math
from itertools import pairwise, permutations

import numpy as np
from scipy.optimize import linprog

WEEK = 10_080


def sighting_share(seen):
    """Sightings per room by all sightings; seen[bin][room] of one user."""
    counts = np.sum(seen, axis=0)
    return list(counts / counts.sum() if counts.any() else np.full(len(counts), 1 / len(counts)))


def exposure_ratio(seen, watched, bin_steps, detection):
    """Sightings by exposure with one bin of average beforehand; shares at home, and away."""
    n, e = np.sum(seen, axis=0) / bin_steps, np.sum(watched, axis=0)
    average = n.sum() / e.sum() if e.any() else 0.0
    rate = (n + average) / (e + 1)
    if not rate.any():
        return [1 / len(rate)] * len(rate), float(e.any())
    return list(rate / rate.sum()), max(0.0, 1 - rate.sum() / detection)


def stays(model, bins, shown, seen, shown_before):
    """A person's chain written out: transitions and evidence between all states, for each stretch.

    States are stage of a stay, patch, and whether out of the part of the patch that is in view.

    Args:
        model: stay, follow, spread, restless, first, detection.
        bins: Of each stretch.
        shown: What of each patch is in view, of 255; away last.
        seen: Of each stretch the share of sightings by patch.
        shown_before: As shown, before the first stretch.
    """
    places, patches = len(model.first) - 1, len(model.spread)
    stages = len(model.stay) // places
    room = np.repeat(np.arange(places), np.diff(model.first))
    steps, weights = [], []
    for n, now, before, hits in zip(bins, shown, [shown_before, *shown], seen, strict=False):
        in_view = np.array(now) / 255
        sides = np.stack([in_view, 1 - in_view], axis=1)
        spread = model.spread[:, None] * sides
        step = np.zeros((stages, patches, 2) * 2)
        for s, p, side in np.ndindex(stages, patches, 2):
            row, k, here = step[s, p, side], room[p] * stages + s, room == room[p]
            kept, calm = model.stay[k] ** n, (1 - model.restless[room[p]]) ** n
            onward = (1 - kept) * model.follow[k][places]
            for stage, chance in ((s, kept * calm), (s + 1, onward)):
                if chance and now[p] == before[p]:
                    row[stage, p, side] += chance
                elif chance:
                    row[stage, p] += chance * sides[p]
            row[s, here] += kept * (1 - calm) * spread[here]
            row[0] += (1 - kept) * model.follow[k][room][:, None] * spread
        weight = np.ones((stages, patches, 2))
        weight[..., 0] = (1 - model.detection) ** n
        if any(hits):
            hit = np.where(np.arange(2) == (in_view[:, None] == 0), np.array(hits)[:, None], 0)
            weight = hit + 1e-3 * weight
        steps.append(step.reshape([stages * patches * 2] * 2))
        weights.append(weight.ravel())
    return steps, weights


def _shares(values):
    return values / values.sum()


def posteriors(steps, weights, start, end):
    """Filtered and smoothed probabilities of the states of a chain, by products of matrices."""
    forward, backward = [np.asarray(start)], [np.asarray(end)]
    for step, weight in zip(steps, weights, strict=True):
        forward.append(_shares(forward[-1] @ step * weight))
    for step, weight in zip(steps[::-1], weights[::-1], strict=True):
        backward.append(_shares(step @ (weight * backward[-1])))
    pairs = zip(forward[1:], backward[-2::-1], strict=True)
    return np.array(forward[1:]), np.array([_shares(before * later) for before, later in pairs])


def people(model, day, prior, future):
    """Filtered and smoothed states of people one by one, each bin a stretch of its own.

    Args:
        model: As for `stays`, with people as the first dimension.
        day: view, views, user, bin, patch, steps: the evidence of all people.
        prior: Of each person by stage and patch, out of view.
        future: Likelihood of later evidence, of each person by stage and patch.
    """
    shown = day.views[day.view].tolist()
    for person, own in enumerate(zip(*model[:4], strict=True)):
        seen, mine = np.zeros((len(day.view), day.views.shape[1])), day.user == person
        seen[day.bin[mine], day.patch[mine]] = day.steps[mine]
        seen /= np.maximum(seen.sum(axis=1, keepdims=True), 1)
        before = [-1] * seen.shape[1]
        chain = stays(type(model)(*own, *model[4:]), [1] * len(shown), shown, seen.tolist(), before)
        start = np.stack([np.zeros_like(prior[person]), prior[person]], axis=-1)
        end = np.stack([future[person]] * 2, axis=-1)
        yield posteriors(*chain, start.ravel(), end.ravel())


def fremen(minutes, state, days, m, at):
    """The forecast of order m at a minute of the week, from samples of one room, by definition."""
    mean = np.mean(state)
    orders = np.array([i for i in range(1, 101) if 1.5 * 7 / i <= days])
    turns = np.exp(2j * np.pi * np.outer(orders, minutes) / WEEK)
    gamma = (turns * (state - mean)).mean(axis=1)
    best = np.argsort(-np.abs(gamma), kind="stable")[:m]
    waves = 2 * np.abs(gamma) * np.cos(2 * np.pi * at * orders / WEEK - np.angle(gamma))
    return float(np.clip(mean + waves[best].sum(), 0, 1))


def transport(truth, estimate, cost):
    """The least cost of any flow, as a linear program."""
    leaves = np.kron(np.eye(len(truth)), np.ones(len(truth)))
    arrives = np.kron(np.ones(len(truth)), np.eye(len(truth)))
    ways = np.vstack([leaves, arrives])[:-1]  # the last one follows from the others
    masses = 1e6 * np.concatenate([estimate, truth])[:-1]  # the solver ignores what is below 1e-7
    return linprog(np.ravel(cost), A_eq=ways, b_eq=masses).fun / 1e6


def in_groups(said, masses):
    """Indices of what was said by group: as often as not smaller, equal ones together."""
    groups = [[] for _ in range(masses)]
    for i, value in enumerate(said):
        below = sum(other < value for other in said)
        same = sum(other == value for other in said)
        middle = (below + below + same - 1) // 2
        groups[middle * masses // len(said)].append(i)
    return groups


def gaps(said, true, masses):
    """Mean gap between what was said and what came true, by groups."""
    total = 0.0
    for group in in_groups(said, masses):
        if group:
            mean = sum(said[i] for i in group) / len(group)
            share = sum(true[i] for i in group) / len(group)
            total += len(group) / len(said) * abs(share - mean)
    return total


def among_best(row, truth, k):
    """Share of all orders of places, likeliest first, in which the truth is among the first k."""
    orders = [
        order
        for order in permutations(range(len(row)))
        if all(row[a] >= row[b] for a, b in pairwise(order))
    ]
    return sum(truth in order[:k] for order in orders) / len(orders)


def calibration_error(p, truth, masses):
    """Gap between accuracy and confidence, by groups of equal size."""
    sure = [max(row) for row in p]
    right = [
        (row[t] == max(row)) / sum(x == max(row) for x in row)
        for row, t in zip(p, truth, strict=True)
    ]
    return gaps(sure, right, masses)


def classwise_error(p, truth, masses):
    """Mean over places of the gap of each place's probability."""
    places = range(len(p[0]))
    return sum(
        gaps([row[c] for row in p], [float(t == c) for t in truth], masses) for c in places
    ) / len(places)


def murphy(p, truth):
    """Reliability, resolution and uncertainty, grouped by what exactly was said of each place."""
    reliability = resolution = uncertainty = 0.0
    for c, said in enumerate(np.transpose(p)):
        came = np.equal(truth, c)
        uncertainty += came.mean() * (1 - came.mean())
        for value in set(said.tolist()):
            group = came[said == value]
            part = len(group) / len(truth)
            reliability += part * (value - group.mean()) ** 2
            resolution += part * (group.mean() - came.mean()) ** 2
    return reliability, resolution, uncertainty


def kendall(true, guess):
    """Kendall's tau of the pairs that differ in truth, pair by pair."""
    pairs = [(i, j) for j in range(len(true)) for i in range(j) if true[i] != true[j]]
    agree = sum((true[i] - true[j]) * (guess[i] - guess[j]) > 0 for i, j in pairs)
    differ = sum((true[i] - true[j]) * (guess[i] - guess[j]) < 0 for i, j in pairs)
    return (agree - differ) / len(pairs) if pairs else 1.0


def learned_stays(moments, length, spread, possible, first, restless):
    """The most probable transitions, as sums and quotients of whole arrays."""
    places, stages = len(possible), len(length)
    time, exits, arrivals, moves, rests = moments
    ends = exits.sum(axis=-1)
    stay = 1 - (ends + 1) / (time + np.tile(length, places))
    entered = exits[..., :places].sum(axis=-2) + possible / possible.sum()
    others = np.repeat(entered[..., None, :], places, axis=-2)
    others[..., np.arange(places), np.arange(places)] = 0.0
    others = np.repeat(others / others.sum(axis=-1, keepdims=True), stages, axis=-2)
    next_stage = np.tile(np.arange(stages) < stages - 1, places) / 2
    prior_exits = np.empty_like(exits)
    prior_exits[..., :places] = others * (1 - next_stage)[:, None]
    prior_exits[..., places] = next_stage
    follow = (exits + prior_exits) / (ends + 1)[..., None]
    come = arrivals + spread
    room = np.repeat(np.arange(places), np.diff(first))
    in_room = np.array([[math.fsum(own[room == r]) for r in range(places)] for own in come])
    trials = moves + rests + 1 / max(restless, 1e-6)
    change = np.minimum((moves + 1) / np.maximum(trials, 1), 1)
    change[..., -1] = 0.0  # away has no patches
    return stay, follow, come / in_room[:, room], change
