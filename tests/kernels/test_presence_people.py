"""The stays of people who are followed side by side, against products of matrices one by one."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from tests.kernels.test_presence_stays import PATCHES, SIZES, by_place, case, no_moments
from tests.reference import presence as slow

from fleet2d.kernels import (
    DayEvidence,
    Moments,
    PeoplePlaces,
    StayModel,
    follow_people,
    learned_stays,
    smooth_people,
)

BINS = 6


def by_bin(places, person):
    """Return the probability of one person's places in each bin: float64 (bins, rooms + 1)."""
    own = slice(places.begin[person], places.begin[person + 1])
    return np.repeat(places.probability[own], places.bins[own], axis=0)


def models(seed, stages, people):
    """People in the same rooms, of whom each has other habits."""
    each = [case(seed * 100 + number, stages, 1, 1, SIZES).model for number in range(people)]
    columns = (np.stack(column) for column in list(zip(*each, strict=True))[:4])
    return StayModel(*columns, each[0].first, each[0].detection)


def evidence(seed, people):
    """Bins with views that change, in which some people are perceived in one patch or in two."""
    random = np.random.default_rng(seed)
    views = random.choice([0, 0, 60, 255], (3, PATCHES)).astype(np.uint8)
    views[:, -1] = 0
    view = np.sort(random.integers(0, 3, BINS))
    hit = random.random((people, BINS, PATCHES)) < 0.08
    hit[..., -1] = False
    person, bin_, patch = np.nonzero(hit)
    steps = random.integers(1, 9, len(patch))
    return DayEvidence(np.arange(BINS), view, views, person, bin_, patch, steps)


def states(random, people, stages):
    values = random.random((people, stages, PATCHES))
    return values / values.sum(axis=(1, 2), keepdims=True)


@given(st.integers(0, 10_000), st.integers(1, 2), st.integers(1, 13))
def test_people_side_by_side_are_the_products_of_their_own_matrices(seed, stages, people):
    model, day = models(seed, stages, people), evidence(seed, people)
    random = np.random.default_rng(seed)
    prior, future = states(random, people, stages), states(random, people, stages)
    moments = Moments(
        *(np.stack([part] * people) for part in no_moments(case(0, stages, 1, 1).model))
    )
    now = prior.copy()

    followed = PeoplePlaces(*follow_people(model, day, 1, now))
    smoothed = PeoplePlaces(*smooth_people(model, day, 1, prior, future, moments)[0])

    for person, (filtered, both) in enumerate(slow.people(model, day, prior, future)):
        assert np.abs(by_place(filtered, stages) - by_bin(followed, person)).max() < 1e-9
        assert np.abs(by_place(both, stages) - by_bin(smoothed, person)).max() < 1e-9
        after = filtered[-1].reshape(stages, PATCHES, 2).sum(axis=2)
        assert np.abs(after - now[person]).max() < 1e-9
    in_home = moments.time.sum(axis=1)
    assert np.abs(in_home - BINS).max() < 1e-9


@given(st.integers(0, 10_000), st.integers(1, 3), st.integers(1, 4), st.integers(1, 20))
def test_learned_stays_are_those_of_whole_arrays(seed, people, stages, rooms):
    random = np.random.default_rng(seed)
    places = rooms + 1
    patches = random.integers(1, 5, places)
    first = np.cumsum([0, *patches])
    shapes = (places * stages,), (places * stages, places + 1), (first[-1],), (places,), (places,)
    counts = Moments(*(random.choice([0, 0.25, 9], (people, *shape)) for shape in shapes))
    length, spread = random.uniform(1, 200, stages), random.uniform(0.1, 1, first[-1])
    possible = random.choice([0.0, 1.0], places)
    possible[:2] = 1  # somewhere to go from each place
    restless = float(random.choice([0, 0.05, 1]))
    asked = counts, length, spread, possible, first, restless

    for part, expected in zip(learned_stays(*asked), slow.learned_stays(*asked), strict=True):
        assert part.shape == expected.shape
        assert np.abs(part - expected).max(initial=0) < 1e-12
