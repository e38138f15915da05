"""The ladder of real-time presence: by hand on small evidence, and better from rung to rung."""

from dataclasses import replace
from datetime import datetime, timedelta
from types import SimpleNamespace

import numpy as np
import pytest
from tests.algorithms.presence.worlds import (
    DAY,
    MONDAY,
    SUNDAY_LATE,
    any_evidence,
    evidence,
    evidence_of,
    home_of,
    patrol,
    person,
    pieces,
)

from fleet2d.algorithms.algorithm import to_columns
from fleet2d.algorithms.presence.belief import BeliefSeries
from fleet2d.algorithms.presence.chain_model import (
    Filter,
    MarkovDecay,
    RoutineModel,
    SemiMarkov,
    steps_of,
)
from fleet2d.algorithms.presence.exposure_ratio import ExposureRatio
from fleet2d.algorithms.presence.learned import LearnedModel
from fleet2d.algorithms.presence.model import (
    BeliefTable,
    HourOfWeek,
    LastSeen,
    LongTerm,
    RealTimePresence,
)
from fleet2d.configuration.components import components
from fleet2d.errors import ComponentError
from fleet2d.metrics.rtp_score import log_loss

CHAINS = [MarkovDecay, Filter, SemiMarkov, RoutineModel]
# A network in an ONNX file is tested where its package is installed: tests/extras.
ALL = [cls for name, cls in components("presence_model").items() if name != "onnx"]
MINUTE = 60_000_000


def followed(model, bins, rooms, users, length=60):
    """What a model believes at the end; its track is of all bins."""
    model.begin(home_of(rooms), [f"u{i}" for i in range(users)], MONDAY)
    beliefs = [model.observe(part) for part in pieces(bins, length)]
    home, away = (np.concatenate(parts) for parts in zip(*beliefs, strict=True))
    users_ = [f"u{i}" for i in range(users)]
    return model.presence(users_, MONDAY, MINUTE, BeliefSeries(0, 1, home, away))


@pytest.mark.parametrize("cls", ALL)
def test_every_bin_has_a_distribution_for_everybody(cls):
    for users, rooms in ((0, 3), (1, 1), (2, 3), (2, 20)):
        bins = any_evidence(1, users=users, bins=200, rooms=rooms)
        track = followed(cls(), bins, rooms, users).track
        assert (200, users + 1, rooms) == track.home.shape
        assert np.abs(track.home.sum(axis=2) - 1).max() < 1e-9
        assert ((track.away >= 0) & (track.away <= 1)).all()


@pytest.mark.parametrize("cls", ALL)
def test_the_future_changes_nothing(cls):
    """What is believed of a bin is the same whatever comes behind its update."""
    bins, other = any_evidence(2, bins=120), any_evidence(3, bins=120)
    watched, seen = (
        np.concatenate([getattr(bins, name)[:60], getattr(other, name)[60:]])
        for name in ("watched", "seen")
    )
    mixed = evidence_of(watched, seen, SUNDAY_LATE, bins.bin_steps)
    for length in (60, 120) if cls.is_by_bin else (60,):
        one, two = (followed(cls(), b, 3, 2, length=length).track.home[:60] for b in (bins, mixed))
        # What is learned at midnight from a whole day isn't known before.
        known = bins.day[:60] <= (bins.day[0] if length > 60 else bins.day[-1])
        assert np.array_equal(one[known], two[known])


@pytest.mark.parametrize("island", [None, [0, 0, 2]], ids=["joined", "islands"])
@pytest.mark.parametrize("cls", [LastSeen, HourOfWeek, RoutineModel, LearnedModel])
def test_a_table_of_beliefs_has_those_of_frequent_updates(cls, island):
    """Every seven minutes, from periods of 35 minutes; what lies behind a row isn't used in it."""
    bins = any_evidence(2, bins=70)
    bins.watched[:40, 2] = 0  # so that the second island is unknown at first
    islands = None if island is None else np.array(island)
    bins = replace(bins, by_patch=bins.by_patch._replace(island=islands))

    expected = [rows["share"] for rows in updates(RealTimePresence(model=cls()), bins, 7)]
    made = updates(BeliefTable(model=cls(), every=timedelta(minutes=7)), bins, 35)

    assert (
        np.abs(np.concatenate(expected) - [s for rows in made for s in rows["share"]]).max() < 1e-12
    )
    steps = [int(at) for rows in made for at in rows["at"][:: 3 * 4]]
    assert [42 * k - 1 for k in range(1, 11)] == steps


def updates(algorithm, bins, length):
    """The columns that an algorithm makes of evidence that comes in pieces."""
    home = home_of(3)
    algorithm.start(home)
    state = SimpleNamespace(users=("u0", "u1"), start=SUNDAY_LATE, path="algorithms.x")
    made = []
    for part in pieces(bins, length):
        history = SimpleNamespace(evidence=part, step_s=60 / part.bin_steps)
        output = algorithm.update(history, state)
        made.append(to_columns(output, [room.name for room in home.rooms], "algorithms.x"))
    return made


def test_a_table_of_beliefs_is_due_at_whole_minutes():
    table = BeliefTable(model=LastSeen(), every=timedelta(seconds=90))
    with pytest.raises(ComponentError, match=r"algorithms\.x\.every must be a whole number of min"):
        updates(table, any_evidence(2), 20)


def test_last_seen_is_the_room_of_the_newest_sighting():
    bins = any_evidence(4, bins=150)
    track = followed(LastSeen(), bins, 3, 2, length=11).track
    for row in range(3):
        share = np.full(3, 1 / 3)
        for seen, home in zip(bins.seen[:, row], track.home[:, row], strict=True):
            share = np.eye(3)[seen.argmax()] if seen.any() else share
            assert share.tolist() == home.tolist()
    assert not track.away.any()


def test_long_term_is_the_estimate_before_the_update():
    bins = any_evidence(5, bins=90)
    track = followed(LongTerm(estimator=ExposureRatio()), bins, 3, 2, length=30).track
    estimator = ExposureRatio()
    estimator.begin(3, 2)
    for k, part in enumerate(pieces(bins, 30)):
        expected = estimator.presence(["u0", "u1"], MONDAY)
        for t in (30 * k, 30 * k + 29):
            assert expected.arrays[0].tolist() == track.home[t].tolist()
        estimator.observe(part)


def test_hour_of_week_distinguishes_hours():
    bins = evidence(person(3 * DAY, 3, 5), 3, patrol, 5)
    model = HourOfWeek(estimator=ExposureRatio(), smoothing=1)
    now = followed(model, bins, 3, 1)
    week = model.estimator.weekly(["u0"], MONDAY, 1)
    for hours in (0, 5, 30):
        later = MONDAY + timedelta(hours=hours, minutes=3)
        assert week.at(later).share("u0").tolist() == now.at(later).share("u0").tolist()


def test_markov_decay_is_the_row_of_the_power_since_the_last_sighting():
    watched, seen = np.ones((40, 3)), np.zeros((40, 2, 3), np.int64)
    seen[4, :, 1] = 1
    model = MarkovDecay()
    track = followed(model, evidence_of(watched, seen), 3, 1).track
    steps = steps_of(model.learner.people.model_of(0))
    away = track.away[4:, :1]
    belief = np.hstack([track.home[4:, 0] * (1 - away), away])
    powers = np.array([np.linalg.matrix_power(steps, t)[1] for t in range(36)])
    assert belief == pytest.approx(powers, abs=5e-3)  # a false alarm is possible, too
    # Three rooms in view in vain: the filter knows that the user is out.
    filtered = followed(Filter(), evidence_of(watched, seen), 3, 1).track
    assert filtered.away[39, 0] > 0.9 > 0.4 > track.away[39, 0]


@pytest.mark.parametrize("cls", CHAINS)
def test_a_forecast_equals_filtering_without_evidence(cls):
    bins = any_evidence(6, bins=60, users=1)
    start = SUNDAY_LATE + timedelta(minutes=30)
    blind = evidence_of(np.zeros((30, 3)), np.zeros((30, 2, 3), np.int64), start, 6)
    model = cls()
    now = followed(model, bins.between(0, 30), 3, 1)
    home, away = model.observe(blind)
    for k in (1, 7, 30):
        later = now.at(MONDAY + timedelta(minutes=k))
        assert home[k - 1, 0] == pytest.approx(later.share("u0"), abs=1e-9)
        assert away[k - 1, 0] == pytest.approx(later.away("u0"), abs=1e-9)
    assert now.at(MONDAY) is now is now.at(MONDAY - timedelta(days=1))
    twice = now.at(MONDAY + timedelta(minutes=3)).at(MONDAY + timedelta(minutes=7))
    once = now.at(MONDAY + timedelta(minutes=7))
    assert twice.with_away("u0") == pytest.approx(once.with_away("u0"))


def test_a_forecast_does_not_change_with_later_evidence():
    bins = evidence(person(DAY + 60, 3, 7), 3, patrol, 7)
    model = Filter()
    now = followed(model, bins.between(0, DAY), 3, 1)
    soon = datetime(2026, 1, 5, 1)
    before = now.at(soon).with_away("u0")
    model.observe(bins.between(DAY, DAY + 60))  # learns from the day before
    assert before.tolist() == now.at(soon).with_away("u0").tolist()


def late_loss(track, where):
    """Return the mean log loss of where the first user is, from the eleventh day on."""
    home, away = track.home[10 * DAY :, 0], track.away[10 * DAY :, 0]
    belief = np.concatenate([home * (1 - away)[:, None], away[:, None]], axis=1)
    return float(log_loss(belief, where[10 * DAY :]).mean())


@pytest.mark.slow
def test_each_rung_of_the_ladder_is_better_than_the_one_below():
    """Log loss of the last 10 of 20 days of a Markov person, 4 runs; gaps are over 10 % of it."""
    scores = {cls: [] for cls in (LastSeen, LongTerm, MarkovDecay, Filter)}
    for seed in range(3):
        where = person(20 * DAY, 5, seed)
        bins = evidence(where, 5, patrol, seed)
        for cls, values in scores.items():
            values.append(late_loss(followed(cls(), bins, 5, 1, length=360).track, where))
    last, long_, markov, full = (np.mean(values) for values in scores.values())
    assert full < 0.9 * markov
    assert markov < 0.9 * long_
    assert long_ < 0.9 * last


@pytest.mark.parametrize("cls", ALL)
def test_learning_continues_from_a_learned_state(cls):
    bins = any_evidence(8, bins=2000)
    one, other = cls(), cls()
    followed(one, bins, 3, 2)
    other.begin(home_of(3), ["u0", "u1"], MONDAY)
    other.recall(one.remember())
    home, _ = other.observe(any_evidence(9).between(20, 21))
    assert np.abs(home.sum(axis=2) - 1).max() < 1e-9
    if cls in CHAINS:
        for part, same in zip(one.learner.people.model, other.learner.people.model, strict=True):
            assert np.array_equal(part, same)


def sleeper(days, seed):
    """Somebody in room 0 at night and in rooms 1 and 2 by day, for an hour or so at a time."""
    random = np.random.default_rng(seed)
    where, now = np.empty(days * DAY, np.int64), 0
    for t in range(days * DAY):
        night = not 7 * 60 <= t % DAY < 23 * 60
        if random.random() < 1 / 60 or (now == 0) != night:
            now = 0 if night else int(random.integers(1, 3))
        where[t] = now
    return where


@pytest.mark.slow
def test_models_with_hours_are_better_for_people_with_regular_hours():
    """Log loss of the last 10 of 20 days, 2 runs of a person whose days are alike."""
    scores = {cls: [] for cls in (SemiMarkov, RoutineModel)}
    for seed in range(2):
        where = sleeper(20, seed)
        bins = evidence(where, 3, patrol, seed)
        for cls, values in scores.items():
            values.append(late_loss(followed(cls(), bins, 3, 1).track, where))
    assert np.mean(scores[RoutineModel]) < 0.9 * np.mean(scores[SemiMarkov])


def test_a_forecast_of_the_routine_uses_the_hours_until_then():
    where = sleeper(8, 3)
    now = followed(RoutineModel(), evidence(where, 3, patrol, 3), 3, 1)
    night = now.at(MONDAY + timedelta(hours=3)).with_away("u0")
    noon = now.at(MONDAY + timedelta(hours=13)).with_away("u0")
    assert night[0] > 0.6 > 0.4 > noon[0]
