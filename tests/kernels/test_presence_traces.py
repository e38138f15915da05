"""Traces of evidence, and the network over places, against their slow twins."""

import numpy as np
import pytest
from tests.reference import traces as slow

from fleet2d.kernels import (
    TRACE_FEATURES,
    PlaceNetwork,
    TracedEvidence,
    TracedRooms,
    place_probabilities,
    trace_evidence,
    trace_size,
)


def rooms_of(random, count):
    at = random.uniform(0, 12, (count, 2))
    return TracedRooms(random.dirichlet(np.ones(count)), np.abs(at[:, None] - at).sum(axis=2) / 10)


def evidence_of(random, bins, rooms, first, put_back=0):
    minute = first + np.arange(bins) * 37  # more than a day
    minute[bins // 2 :] -= put_back  # as a clock is, in the middle
    watched = random.random((bins, rooms)) * (random.random((bins, rooms)) < 0.5)
    seen = random.random((bins, rooms)) * (random.random((bins, rooms)) < 0.1)
    unknown = (random.random((bins, rooms)) < 0.1).astype(np.uint8)
    belief = random.dirichlet(np.full(rooms + 1, 0.1), bins)
    day, minute = 739_000 + minute // 1440, minute % 1440
    return TracedEvidence(day, minute, watched, seen, unknown, belief)


@pytest.mark.parametrize("put_back", [0, 60, 120])
@pytest.mark.parametrize("seed", range(10))
def test_features_equal_those_of_the_twin(seed, put_back):
    random = np.random.default_rng(seed)
    count = [1, 2, 3, 7, 40][seed % 5]
    home = rooms_of(random, count)
    evidence = evidence_of(random, 150, count, 100 * seed, put_back)
    twin = slow.Traces(count)
    expected = [twin.add(home, *bin_) for bin_ in zip(*evidence, strict=True)]

    features = trace_evidence(np.zeros(trace_size(home)), home, evidence)

    assert (150, count + 1, TRACE_FEATURES) == features.shape
    assert np.abs(features - np.array(expected)).max() < 1e-8


def test_features_are_the_same_in_parts():
    random = np.random.default_rng(5)
    home, evidence = rooms_of(random, 4), evidence_of(random, 90, 4, 0)
    memory, whole = np.zeros(trace_size(home)), np.zeros(trace_size(home))
    parts = [
        trace_evidence(memory, home, TracedEvidence(*(part[a : a + 30] for part in evidence)))
        for a in (0, 30, 60)
    ]

    assert np.array_equal(np.concatenate(parts), trace_evidence(whole, home, evidence))
    assert np.array_equal(memory, whole)


@pytest.mark.parametrize("seed", range(9))
def test_probabilities_equal_those_of_the_twin(seed):
    random = np.random.default_rng(seed)
    width, hidden, count = 5, [1, 3, 8][seed % 3], [1, 2, 9][seed % 3]
    network = PlaceNetwork(
        random.normal(size=(width, hidden)),
        random.normal(size=(hidden, hidden)),
        random.normal(size=(hidden, hidden)),
        random.normal(size=hidden),
        random.normal(size=hidden),
    )
    places, features = random.normal(size=(count, hidden)), random.normal(size=(20, count, width))

    probability = place_probabilities(network, places, features)

    expected = slow.place_probabilities(network, places, features)
    assert np.abs(probability - expected).max() < 1e-9
    assert np.abs(probability.sum(axis=1) - 1).max() < 1e-12


def test_certainty_is_no_overflow():
    network = PlaceNetwork(np.zeros((1, 1)), np.zeros((1, 1)), np.zeros((1, 1)), *np.zeros((2, 1)))
    features = np.array([[[0.0], [-5000.0], [800.0]]])

    assert [[0.0, 0.0, 1.0]] == place_probabilities(network, np.zeros((3, 1)), features).tolist()
