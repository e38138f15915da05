"""What is learned of a person: expected counts against those of all paths, and the model from them."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from tests.algorithms.presence.worlds import MONDAY, counts_of, evidence_of, patch_evidence
from tests.kernels.test_presence_people import by_bin
from tests.kernels.test_presence_stays import PATCHES, PLACES, ROOM, by_state, case, twin

from fleet2d._core import smooth
from fleet2d.algorithms.evidence import Evidence
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
from fleet2d.kernels import DayEvidence, Moments, Stretches, merge_bins

PRIOR = Prior(0.9, 0.05)


def expected(seed: int, stages: int) -> tuple[Any, Moments, Any]:
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
    by_node = np.zeros((PLACES * stages,) * 2)
    np.add.at(by_node, (node[:, None], node[None]), pairs)
    assert np.abs(by_node.sum(axis=1) - moments.time).max() < 1e-9
    for k in range(PLACES * stages):
        room, stage = divmod(k, stages)
        for other in set(range(PLACES)) - {room}:
            exits = by_node[k, other * stages : (other + 1) * stages].sum()
            assert exits == pytest.approx(moments.exits[k, other], abs=1e-9)
        onward = by_node[k, k + 1] if stage + 1 < stages else 0.0
        assert onward == pytest.approx(moments.exits[k, PLACES], abs=1e-9)
    assert moments.arrivals.sum() == pytest.approx(
        moments.exits[:, :PLACES].sum() + moments.moves.sum()
    )
    rests = np.diagonal(by_node).reshape(PLACES, stages).sum(axis=1)
    assert np.abs(rests - moments.moves - moments.rests).max() < 1e-9


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


def bins_of(shown: Any, seen: Any, start: int = 0) -> Evidence:
    """One user's evidence of two rooms, the first of two patches; bins of a minute of 10 steps."""
    shown, seen = np.array(shown, float), np.repeat(np.array(seen)[:, None], 2, axis=1)
    room = np.array([0, 0, 1])
    by_room = np.stack([shown[:, :2].mean(axis=1), shown[:, 2]], axis=1)
    by_patch = patch_evidence(room, np.array([4, 4, 8]), shown, seen)
    in_rooms = np.stack([seen[..., :2].sum(axis=-1), seen[..., 2]], axis=-1)
    return evidence_of(by_room, in_rooms, MONDAY, 10, by_patch, begin=start * 10)


def first_stretches(bins: Evidence, longest: int) -> Stretches:
    return stretches_of(day_evidence(bins), 0, longest)


def shown_of(stretches: Stretches) -> Any:
    """Return the part of each patch in view, in 1/255, by stretch: uint8 (stretches, patches)."""
    return stretches.views[stretches.view]


def test_equal_bins_are_merged_within_an_hour():
    shown = [[0, 1, 0]] * 6 + [[0, 1, 0.5]] * 2
    seen = [[0, 0, 0]] * 2 + [[0, 7, 0]] * 2 + [[0, 3, 3]] * 2 + [[0, 0, 0]] * 2
    merged = first_stretches(bins_of(shown, seen, start=57), longest=5)
    assert [2, 1, 1, 1, 1, 2] == merged.bins.tolist()  # the hour ends after three
    assert [0, 0, 0, 0, 0, 1] == merged.view.tolist()
    assert [0, 0, 1, 2, 4, 6, 6] == merged.begin.tolist()
    assert [1, 1, 1, 2, 1, 2] == merged.patch.tolist()
    assert [1, 1, 0.5, 0.5, 0.5, 0.5] == merged.share.tolist()
    assert [0, 255, 128, 0] == shown_of(merged)[-1].tolist()
    assert [1] * 8 == first_stretches(bins_of(shown, seen), longest=1).bins.tolist()


def test_where_somebody_unknown_was_seen_nothing_is_watched_in_vain():
    bins = bins_of([[1, 1, 1]], [[0, 0, 0]])
    seen = np.array([[[0, 0, 0], [0, 0, 4]]])  # anybody, but not the user
    bins = replace(bins, by_patch=bins.by_patch._replace(sightings=counts_of(seen)))
    assert [255, 255, 0, 0] == shown_of(first_stretches(bins, longest=1))[0].tolist()


def test_a_user_never_seen_in_a_watched_patch_may_be_in_the_other():
    """However long a robot looks at one patch of a room, the other may have somebody in it."""
    prior, seen = Prior(0.9, 1e-6), [[0, 0, 0]] * 600
    bins = bins_of([[1, 0, 1]] * 600, seen)
    people = People(StateLayout.of(bins, 1), prior, 1, longest=5)
    places = by_bin(people.end_day(day_evidence(bins)), 0)
    assert places[300, 0] > 0.1
    assert places[300, 1] < 0.01
    hidden = bins_of([[0.5, 0, 1]] * 600, seen)
    people = People(StateLayout.of(hidden, 1), prior, 1, longest=5)
    again = by_bin(people.end_day(day_evidence(hidden)), 0)
    assert places[300, 0] + 0.02 < again[300, 0]


def test_revisited_days_count_once():
    random = np.random.default_rng(3)
    looks = random.integers(0, 3, 3 * 1440)
    shown = np.eye(3)[looks]
    seen = (np.eye(3)[looks] * (random.random((3 * 1440, 1)) < 0.3) * 5).astype(int)
    bins = bins_of(shown, seen)
    people = People(StateLayout.of(bins, 2), PRIOR, 1, longest=1)
    days = [day_evidence(bins.between(day * 1440, (day + 1) * 1440)) for day in range(3)]
    for day in days:
        people.end_day(day)
    for _ in range(20):
        for number in (2, 1, 0):
            people.revisit(number, 1.0)
    for total, parts in zip(
        people.total, zip(*(day.moments for day in people.days), strict=True), strict=True
    ):
        assert np.abs(total - np.sum(parts, axis=0)).max() < 1e-6
    assert 3 * 1440 == pytest.approx(people.total.time.sum(), rel=1e-9)


def crowd_of(count: int, bins: int, seed: int) -> Evidence:
    """Evidence of several users of two rooms, most of whom are hardly ever seen."""
    random = np.random.default_rng(seed)
    shown = random.choice([0, 0, 0.4, 1], (bins // 4 + 1, 3)).repeat(4, axis=0)[:bins]
    seen = np.where(random.random((bins, count + 1, 3)) < 0.02, random.integers(1, 9), 0)
    seen[:, -1] = seen.max(axis=1)
    base = bins_of(shown, seen[:, 0])
    by_patch = base.by_patch._replace(sightings=counts_of(seen))
    in_rooms = np.stack([seen[..., :2].max(axis=-1), seen[..., 2]], axis=-1)
    return replace(base, by_patch=by_patch, sightings=counts_of(in_rooms))


@pytest.mark.parametrize("count", [1, 3, 4, 13])
@pytest.mark.parametrize("stages", [1, 3])
def test_people_learn_together_as_each_alone_to_the_last_bit(count, stages):
    bins = crowd_of(count, 300, count)
    layout, day = StateLayout.of(bins, stages), day_evidence(bins)
    people = People(layout, PRIOR, count, longest=5)
    alone = [People(layout, PRIOR, 1, longest=5) for _ in range(count)]
    for user, person in enumerate(alone):
        rows = day.user == user
        only = DayEvidence(*day[:3], *(column[rows] for column in day[3:]))
        only = only._replace(user=np.zeros(rows.sum(), np.int64))
        person.follow(between(only, 0, 100))
        person.end_day(only)
        person.revisit(0, 0.7)
    people.follow(between(day, 0, 100))
    people.end_day(day)
    people.revisit(0, 0.7)
    for user, person in enumerate(alone):
        assert np.array_equal(people.now[user], person.now[0])
        for together, single in zip(people.total, person.total, strict=True):
            assert np.array_equal(together[user], single[0])
        for part, expected in zip(people.model_of(user), person.model_of(0), strict=True):
            assert np.array_equal(part, expected)


def test_merging_bins_loses_nothing():
    for seed in range(20):
        random = np.random.default_rng(seed)
        shown = random.choice([0, 255], (90, 3), p=[0.9, 0.1]).astype(np.uint8)
        seen = random.choice([0, 3], (90, 3), p=[0.95, 0.05]).astype(np.int64)
        view, views = distinct(shown)
        sightings = (*np.nonzero(seen), seen[seen > 0])
        bins, row, *places = merge_bins(np.arange(90), view, *sightings, 4)
        merged = Stretches(bins, row, views, *places)
        assert 90 == merged.bins.sum()
        assert merged.bins.max() <= 4
        at = np.repeat(np.arange(len(merged.bins)), merged.bins)
        assert np.array_equal(shown_of(merged)[at], shown)
        rebuilt = np.zeros((len(merged.bins), 3))
        stretch = np.repeat(np.arange(len(merged.bins)), np.diff(merged.begin))
        rebuilt[stretch, merged.patch] = merged.share
        assert np.allclose(rebuilt[at], seen / np.maximum(seen.sum(axis=1, keepdims=True), 1))
