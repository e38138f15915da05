"""Filtered and smoothed stays against products of whole matrices, and in pieces as at once."""

import hashlib
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.reference import presence as slow

from fleet2d._core import smooth
from fleet2d.algorithms.presence.chain_model import steps_of
from fleet2d.algorithms.presence.people import distinct
from fleet2d.kernels import Moments, StayModel, Stretches, advance, follow

SIZES = (2, 1, 3, 1)  # three rooms of so many patches, and away
ROOM = np.array([0, 0, 1, 2, 2, 2, 3])
PATCHES, PLACES = 7, 4


class Case(NamedTuple):
    """A person, some evidence, and what was known before."""

    model: StayModel
    stretches: Stretches
    now: Any
    shown: Any
    seen: Any


def case(seed, stages, count, longest, sizes=SIZES):
    random = np.random.default_rng(seed)
    places, patches = len(sizes), sum(sizes)
    nodes = places * stages
    chances = random.dirichlet(np.ones(places + 1), nodes)
    chances[np.arange(nodes), np.arange(nodes) // stages] = 0.0
    chances[stages - 1 :: stages, places] = 0.0
    chances /= chances.sum(axis=1, keepdims=True)
    spread = np.concatenate([random.dirichlet(np.ones(n)) for n in sizes])
    first = np.append(0, np.cumsum(sizes))
    model = StayModel(
        random.uniform(0.3, 0.99, nodes), chances, spread,
        np.append(random.uniform(0, 0.3, places - 1), 0.0), first, float(random.uniform(0.3, 0.95)),
    )  # fmt: skip
    shown = random.choice([0, 0, 60, 60, 255], (count, patches)).astype(np.uint8)
    shown[:, -1] = 0
    is_same = random.random(count) < 0.5  # the view often stays as it was
    for t in np.flatnonzero(is_same[1:]) + 1:
        shown[t] = shown[t - 1]
    seen = np.zeros((count, patches))
    for t in np.flatnonzero(random.random(count) < 0.4):
        patch = random.choice(patches - 1, random.integers(1, 3), replace=False)
        seen[t, patch] = random.dirichlet(np.ones(len(patch)))
    begin = np.append(0, (seen > 0).sum(axis=1).cumsum())
    stretches = Stretches(
        random.integers(1, longest + 1, count), *distinct(shown), begin,
        np.nonzero(seen)[1], seen[seen > 0],
    )  # fmt: skip
    now = random.random((2, stages, patches))
    before = random.choice([-1, 0, 60], patches)
    return Case(model, stretches, now / now.sum(), before.astype(np.int64), seen)


def no_moments(model):
    (nodes, columns), patches = model.follow.shape, len(model.spread)
    rooms = np.zeros(columns - 1), np.zeros(columns - 1)
    return Moments(np.zeros(nodes), np.zeros((nodes, columns)), np.zeros(patches), *rooms)


def by_state(now):
    """The order of the twin: stage, patch, in view or not."""
    return np.moveaxis(now, 0, -1).ravel()


def by_place(states, stages):
    """Sums of the twin's states by room."""
    by_patch = states.reshape(len(states), stages, PATCHES, 2).sum(axis=(1, 3))
    return np.array([np.bincount(ROOM, row, PLACES) for row in by_patch])


def twin(of):
    model, stretches = of.model, of.stretches
    return slow.stays(
        model,
        stretches.bins.tolist(),
        stretches.views[stretches.view].tolist(),
        of.seen.tolist(),
        of.shown,
    )


@given(st.integers(0, 10_000), st.integers(1, 3), st.integers(1, 7), st.integers(1, 4))
def test_following_is_the_product_of_matrices(seed, stages, count, longest):
    of = case(seed, stages, count, longest)
    steps, weights = twin(of)
    for step in steps:
        assert np.abs(step.sum(axis=1) - 1).max() < 1e-9
    filtered, _ = slow.posteriors(steps, weights, by_state(of.now), np.ones(len(steps[0])))
    now, shown = of.now.copy(), of.shown.copy()
    places = follow(of.model, of.stretches, now, shown)
    assert np.abs(by_place(filtered, stages) - places).max() < 1e-9
    assert np.abs(filtered[-1] - by_state(now)).max() < 1e-9
    assert of.stretches.views[of.stretches.view[-1]].tolist() == shown.tolist()


@given(st.integers(0, 10_000), st.integers(1, 2), st.integers(1, 6))
def test_smoothing_is_the_product_of_matrices(seed, stages, count):
    of = case(seed, stages, count, longest=3)
    of.shown[:] = -1  # nothing is known of the view before
    prior = of.now.sum(axis=0)
    future = np.random.default_rng(seed).random((stages, PATCHES))
    steps, weights = twin(of)
    start = by_state(np.stack([np.zeros_like(prior), prior]))
    _, smoothed = slow.posteriors(steps, weights, start, by_state(np.stack([future, future])))
    places, _, _ = smooth(of.model, of.stretches, prior, future, no_moments(of.model))
    assert np.abs(by_place(smoothed, stages) - places).max() < 1e-9


@pytest.mark.parametrize(
    ("stages", "digest"),
    [
        (1, "d18b333b922d83c9cf8332079d7d07e6a641a4212b8b4259c9f4f70744122765"),
        (2, "9063b3df558bf6a8782e68b8c3c324a261515bcc38635c5cce02e0669c35fb6b"),
    ],
)
def test_stays_are_the_same_to_the_last_bit_on_every_machine(stages, digest):
    """A sum over more than eight rooms once was added up in another order uncompiled."""
    of = portable(case(3, stages, 12, 3, sizes=(2, 1, 3, 1, 4, 2, 1, 5, 2, 3, 1, 2, 1)))
    prior, moments = of.now.sum(axis=0), no_moments(of.model)
    smoothed = smooth(of.model, of.stretches, prior, np.ones_like(prior), moments)
    now = of.now.copy()
    followed = follow(of.model, of.stretches, now, of.shown.copy())
    places = b"".join(part.tobytes() for part in (*smoothed, *moments, followed, now))
    assert digest == hashlib.sha256(places).hexdigest()


def portable(of):
    """Round what NumPy draws by logarithms, which differ in the last bit between machines."""
    model, stretches, now, shown, seen = of
    model = StayModel(
        *(np.round(part, 6) if part is not model.first else part for part in model[:-1]),
        round(model.detection, 6),
    )
    return Case(
        model, stretches._replace(share=np.round(stretches.share, 6)), np.round(now, 9), shown, seen
    )


@pytest.mark.parametrize("stages", [1, 2, 3])
def test_without_evidence_stages_follow_each_other_by_their_steps(stages):
    of = case(9, stages, 6, 1)
    blind = of.stretches._replace(
        views=np.zeros_like(of.stretches.views), begin=np.zeros(7, np.int64)
    )
    steps = steps_of(of.model)
    assert np.abs(steps.sum(axis=1) - 1).max() < 1e-12
    mass = np.zeros(PLACES * stages)
    for s in range(stages):
        mass[s::stages] += np.bincount(ROOM, of.now.sum(axis=0)[s], PLACES)
    places = follow(of.model, blind, of.now.copy(), np.full(PATCHES, -1))
    for t in range(6):
        later = advance(mass, steps, t + 1).reshape(PLACES, stages).sum(axis=1)
        assert np.abs(later - places[t]).max() < 1e-12
