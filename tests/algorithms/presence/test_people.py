"""What is learned of a person: expected counts against those of all paths, and the model from them."""

from dataclasses import replace

import numpy as np
import pytest
from tests.algorithms.presence.worlds import MONDAY, counts_of, evidence_of, patch_evidence
from tests.kernels.test_presence_people import by_bin
from tests.kernels.test_presence_stays import PATCHES, PLACES, ROOM, by_state, case, twin

from fleet2d._core import smooth
from fleet2d.algorithms.presence.people import (
    MEAN_STAY,
    People,
    Prior,
    StateLayout,
    between,
    day_evidence,
    distinct,
    model_of,
    stretches_of,
)
from fleet2d.kernels import DayEvidence, merge_bins

PRIOR = Prior(0.9, 0.05)


def expected(seed, stages):
    """Return a case of bins one by one, what is expected of it, and probabilities of steps."""
    of = case(seed, stages, 6, longest=1)
    of.shown[:] = -1
    prior, future = of.now.sum(axis=0), np.random.default_rng(seed).random((stages, PATCHES))
    moments = StateLayout(ROOM, np.ones(PATCHES), PLACES - 1, stages, np.ones(PLACES)).no_moments()
    smooth(of.model, of.stretches, prior, future, moments)
    steps, weights = twin(of)
    ahead = [by_state(np.stack([future, future]))]
    for step, weight in zip(steps[::-1], weights[::-1], strict=True):
        ahead.insert(0, step @ (weight * ahead[0]))
    now, pairs = by_state(np.stack([np.zeros_like(prior), prior])), []
    for step, weight, later in zip(steps, weights, ahead[1:], strict=True):
        both = now[:, None] * step * (weight * later)[None]
        pairs.append(both / both.sum())
        now = (now @ step) * weight
    node = ROOM[None] * stages + np.arange(stages)[:, None]
    return node.repeat(2), moments, np.sum(pairs, axis=0)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("stages", [1, 2])
def test_expected_exits_and_time_equal_pairs_of_states(seed, stages):
    node, moments, pairs = expected(seed, stages)
    nodes = PLACES * stages
    of_node = np.equal.outer(np.arange(nodes), node)
    by_node = (of_node @ pairs @ of_node.T).reshape(nodes, PLACES, stages)
    assert by_node.sum(axis=(1, 2)) == pytest.approx(moments.time, abs=1e-9)
    room, stage = np.divmod(np.arange(nodes), stages)
    exits = by_node.sum(axis=2)
    exits[np.arange(nodes), room] = 0
    assert exits == pytest.approx(moments.exits[:, :PLACES], abs=1e-9)
    ahead = np.append(by_node, np.zeros((nodes, PLACES, 1)), axis=2)
    onward = ahead[np.arange(nodes), room, stage + 1]
    assert onward == pytest.approx(moments.exits[:, PLACES], abs=1e-9)
    assert moments.arrivals.sum() == pytest.approx(exits.sum() + moments.moves.sum())
    rests = by_node[np.arange(nodes), room, stage].reshape(PLACES, stages).sum(axis=1)
    assert rests == pytest.approx(moments.moves + moments.rests, abs=1e-9)


def test_before_anything_is_learned_all_is_as_likely_and_stays_last_two_hours():
    layout = StateLayout(ROOM, np.array([0.5, 0.5, 1, 0.2, 0.3, 0.5, 1]), 3, 1, np.ones(4))
    model = model_of(layout.no_moments(1), layout, PRIOR)
    assert [1 - 1 / MEAN_STAY] * 4 == pytest.approx(model.stay[0].tolist())
    assert [0, 1 / 3, 1 / 3, 1 / 3, 0] == pytest.approx(model.follow[0, 0].tolist())
    assert layout.spread.tolist() == pytest.approx(model.spread[0].tolist())
    assert [0.05, 0.05, 0.05, 0] == pytest.approx(model.restless[0].tolist())


def test_transitions_are_counts_by_time_plus_one_prior_event():
    layout = StateLayout(ROOM, np.array([0.5, 0.5, 1, 0.2, 0.3, 0.5, 1]), 3, 1, np.ones(4))
    moments = layout.no_moments(1)
    moments.time[0, 0] = 880.0
    moments.exits[0, 0, [1, 3]] = 6.0, 3.0
    moments.arrivals[0, :2] = 3.0, 7.0
    moments.moves[0, 0] = 9.0
    moments.rests[0, 0] = 971.0
    model = model_of(moments, layout, PRIOR)
    assert 1 - 10 / 1000 == pytest.approx(model.stay[0, 0])
    entered = np.array([0.25, 6.25, 0.25, 3.25])  # to each room overall, and a quarter each
    expected = (np.array([0, 6, 0, 3]) + np.append(0, entered[1:]) / entered[1:].sum()) / 10
    assert expected.tolist() == pytest.approx(model.follow[0, 0, :4].tolist())
    assert [3.5 / 11, 7.5 / 11] == pytest.approx(model.spread[0, :2].tolist())
    assert 10 / 1000 == pytest.approx(model.restless[0, 0])


def bins_of(shown, seen, start=0):
    """One user's evidence of two rooms, the first of two patches; bins of a minute of 10 steps."""
    shown, seen = np.array(shown, float), np.repeat(np.array(seen)[:, None], 2, axis=1)
    room = np.array([0, 0, 1])
    by_room = np.stack([shown[:, :2].mean(axis=1), shown[:, 2]], axis=1)
    by_patch = patch_evidence(room, np.array([4, 4, 8]), shown, seen)
    in_rooms = np.stack([seen[..., :2].sum(axis=-1), seen[..., 2]], axis=-1)
    return evidence_of(by_room, in_rooms, MONDAY, 10, by_patch, begin=start * 10)


def first_stretches(bins, longest):
    return stretches_of(day_evidence(bins), 0, longest)


def shown_of(stretches):
    """Return the part of each patch in view, in 1/255, by stretch: uint8 (stretches, patches)."""
    return stretches.views[stretches.view]


def test_where_somebody_unknown_was_seen_nothing_is_watched_in_vain():
    bins = bins_of([[1, 1, 1]], [[0, 0, 0]])
    seen = np.array([[[0, 0, 0], [0, 0, 4]]])  # anybody, but not the user
    bins = replace(bins, by_patch=bins.by_patch._replace(sightings=counts_of(seen)))
    assert [255, 255, 0, 0] == shown_of(first_stretches(bins, longest=1))[0].tolist()


def test_a_user_never_seen_in_a_watched_patch_may_be_in_the_other():
    """However long a robot looks at one patch of a room, the other may have somebody in it."""

    def places(part):
        bins = bins_of([[part, 0, 1]] * 600, [[0, 0, 0]] * 600)
        people = People(StateLayout.of(bins, 1), Prior(0.9, 1e-6), 1, longest=5)
        return by_bin(people.end_day(day_evidence(bins)), 0)[300]

    assert places(1)[0] > 0.1
    assert places(1)[1] < 0.01
    assert places(0.5)[0] > places(1)[0] + 0.02


def test_revisited_days_count_once():
    random = np.random.default_rng(3)
    shown = np.eye(3)[random.integers(0, 3, 3 * 1440)]
    seen = (shown * (random.random((3 * 1440, 1)) < 0.3) * 5).astype(int)
    bins = bins_of(shown, seen)
    people = People(StateLayout.of(bins, 2), PRIOR, 1, longest=1)
    for day in range(3):
        people.end_day(day_evidence(bins.between(day * 1440, (day + 1) * 1440)))
    for number in (2, 1, 0) * 20:
        people.revisit(number, 1.0)
    for total, *parts in zip(people.total, *(day.moments for day in people.days), strict=True):
        assert total == pytest.approx(np.sum(parts, axis=0), abs=1e-6)
    assert 3 * 1440 == pytest.approx(people.total.time.sum(), rel=1e-9)


def crowd_of(count, bins, seed):
    """Evidence of several users of two rooms, most of whom are hardly ever seen."""
    random = np.random.default_rng(seed)
    shown = random.choice([0, 0, 0.4, 1], (bins // 4 + 1, 3)).repeat(4, axis=0)[:bins]
    seen = np.where(random.random((bins, count + 1, 3)) < 0.02, random.integers(1, 9), 0)
    seen[:, -1] = seen.max(axis=1)
    base = bins_of(shown, seen[:, 0])
    by_patch = base.by_patch._replace(sightings=counts_of(seen))
    in_rooms = np.stack([seen[..., :2].max(axis=-1), seen[..., 2]], axis=-1)
    return replace(base, by_patch=by_patch, sightings=counts_of(in_rooms))


@pytest.mark.parametrize(("count", "stages"), [(1, 1), (4, 3), (13, 1)])
def test_people_learn_together_as_each_alone_to_the_last_bit(count, stages):
    bins = crowd_of(count, 300, count)
    layout, day = StateLayout.of(bins, stages), day_evidence(bins)

    def learned(count, day):
        people = People(layout, PRIOR, count, longest=5)
        people.follow(between(day, 0, 100))
        people.end_day(day)
        people.revisit(0, 0.7)
        return people

    people = learned(count, day)
    for user in range(count):
        rows = day.user == user
        only = DayEvidence(*day[:3], *(column[rows] for column in day[3:]))
        person = learned(1, only._replace(user=np.zeros(rows.sum(), np.int64)))
        together = people.now[user], *(part[user] for part in people.total), *people.model_of(user)
        alone = person.now[0], *(part[0] for part in person.total), *person.model_of(0)
        for part, single in zip(together, alone, strict=True):
            assert np.array_equal(part, single)


@pytest.mark.parametrize("seed", range(20))
def test_merging_bins_loses_nothing(seed):
    random = np.random.default_rng(seed)
    shown = random.choice([0, 255], (90, 3), p=[0.9, 0.1]).astype(np.uint8)
    seen = random.choice([0, 3], (90, 3), p=[0.95, 0.05]).astype(np.int64)
    view, views = distinct(shown)
    sightings = (*np.nonzero(seen), seen[seen > 0])
    bins, row, begin, patch, share = merge_bins(np.arange(90), view, *sightings, 4)
    assert 90 == bins.sum()
    assert bins.max() <= 4
    assert np.array_equal(views[row].repeat(bins, axis=0), shown)
    rebuilt = np.zeros((len(bins), 3))
    rebuilt[np.arange(len(bins)).repeat(np.diff(begin)), patch] = share
    expected = seen / np.maximum(seen.sum(axis=1, keepdims=True), 1)
    assert rebuilt.repeat(bins, axis=0) == pytest.approx(expected)
