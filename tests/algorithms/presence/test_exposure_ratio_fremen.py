"""FreMEn against its definition with complex numbers, and on a rhythm that it must find."""

import numpy as np
import pytest
from tests.algorithms.presence.worlds import DAY, MONDAY, evidence_of, pieces
from tests.reference import presence as slow

from fleet2d.algorithms.presence.exposure_ratio import Fremen


def rhythmic(days, seed):
    """A person in room 0 from 8 to 20 h, else in room 1, but for one bin in ten; looks at random."""
    random = np.random.default_rng(seed)
    bins = days * DAY
    hour = np.arange(bins) // 60 % 24
    where = np.where((hour >= 8) & (hour < 20), 0, 1)
    where = np.where(random.random(bins) < 0.1, random.integers(0, 3, bins), where)
    looks = random.integers(0, 3, bins)
    watched, seen = np.zeros((bins, 3)), np.zeros((bins, 2, 3), np.int64)
    part = random.choice([0.4, 1.0], bins)
    watched[np.arange(bins), looks] = part
    hit = (where == looks) & (random.random(bins) < part)
    seen[hit, :, looks[hit]] = 1
    return evidence_of(watched, seen)


@pytest.mark.parametrize("days", [1, 4])
def test_forecasts_equal_the_definition(days):
    # A bin of the next day ends the days before.
    whole = rhythmic(days + 1, days).between(0, days * DAY + 1)
    # With weights as published: in view as a whole or not at all.
    watched = (whole.watched > 0).astype(float)
    estimator = Fremen()
    estimator.begin(3, 1)
    for part in pieces(evidence_of(watched, whole.seen), 360):
        estimator.observe(part)
    minutes = np.array([777, 9999])
    by_order = estimator._by_order(minutes)
    for room in range(3):
        samples = np.flatnonzero(watched[:-1, room])
        state = whole.seen[samples, 0, room]
        for k, at in enumerate(minutes.tolist()):
            expected = [slow.fremen(samples, state, days, m, at) for m in range(5)]
            assert expected == pytest.approx(by_order[k, 0, room, :5], abs=1e-6)


def test_a_daily_rhythm_is_detected_and_its_order_chosen():
    estimator = Fremen()
    estimator.begin(3, 1)
    for part in pieces(rhythmic(9, 1)):
        estimator.observe(part)
    week = estimator.presence(["u0"], MONDAY).by_hour_of_week("u0")
    assert week[[9, 12, 18, 36, 100 + 8], 0].min() > 0.6
    assert week[[1, 3, 22, 26], 1].min() > 0.6
    assert estimator.fit[0, :2].argmax(axis=1).min() >= 1
    # Room 2, where nothing is regular, stays as it is: little is gained by any period.
    assert np.ptp(week[:, 2]) < 0.15


def test_before_a_day_is_over_all_rooms_are_alike():
    estimator = Fremen()
    estimator.begin(3, 1)
    estimator.observe(rhythmic(1, 2).between(0, 600))
    presence = estimator.presence(["u0"], MONDAY)
    assert [1 / 3] * 3 == presence.share("u0").tolist()
    assert 0.0 == presence.away("u0")
