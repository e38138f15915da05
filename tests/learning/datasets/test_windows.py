"""Windows: features that use the past of what was perceived, and nothing else."""

import numpy as np
import pyarrow as pa
import pytest

import fleet2d
from fleet2d.errors import InputError
from fleet2d.learning.datasets.tables import SCHEMAS
from fleet2d.learning.datasets.windows import Windows, windows_of, windows_of_run


@pytest.fixture
def tables(data):
    return {name: data.arrow(name, "train") for name in SCHEMAS}


def features(tables) -> list[Windows]:
    return list(windows_of(tables))


def changed(table: pa.Table, column, which, value) -> pa.Table:
    values = table[column].to_pylist()
    for row in np.flatnonzero(which):
        values[row] = value(values[row]) if callable(value) else value
    at = table.column_names.index(column)
    return table.set_column(at, column, pa.array(values, table.schema.field(column).type))


def test_there_is_a_window_for_each_belief_of_each_user(tables):
    parts = features(tables)
    users = [name for names in tables["runs"]["users"].to_pylist() for name in names]

    assert users == [part.user for part in parts]
    for part in parts:
        assert 6 * 60 // 7 == len(part.truth)
        assert part.features.shape[:2] == (len(part.truth), len(part.places))
        assert (np.diff(part.step) == 420).all()
        assert np.isfinite(part.features).all()
        assert np.abs(part.beliefs["routine"].sum(axis=1) - 1).max() < 1e-5


@pytest.mark.parametrize("last", [8, 19, 25, 38])
def test_evidence_after_a_window_changes_nothing_in_it(tables, last):
    """Every column of evidence is changed from the step after a window on; features until then are
    the same.
    """
    cut = int(features(tables)[0].step[last])
    late = tables["evidence"]["step"].to_numpy() > cut
    assert late.any()
    evidence = tables["evidence"]
    for column, value in (("watched", 0.987), ("seen", 59), ("user", "ana")):
        evidence = changed(evidence, column, late, value)

    for one, other in zip(
        features(tables), features({**tables, "evidence": evidence}), strict=True
    ):
        early = one.step <= cut
        assert last + 1 == early.sum()
        assert np.array_equal(one.features[early], other.features[early])
        assert not np.array_equal(one.features, other.features)


def test_beliefs_after_a_moment_change_nothing_before(tables):
    late = tables["beliefs"]["step"].to_numpy() >= 3 * 3600
    beliefs = changed(tables["beliefs"], "probability", late, 0.01)

    for one, other in zip(features(tables), features({**tables, "beliefs": beliefs}), strict=True):
        early = one.step < 3 * 3600
        assert np.array_equal(one.features[early], other.features[early])


def test_the_truth_is_in_no_feature(tables):
    """Labels, which nobody perceives, are all changed: features are the same, the truth isn't."""
    everywhere = np.ones(len(tables["labels"]), bool)
    labels = changed(tables["labels"], "place", everywhere, "away")
    labels = changed(labels, "activity", everywhere, "sleep")

    for one, other in zip(features(tables), features({**tables, "labels": labels}), strict=True):
        assert np.array_equal(one.features, other.features)
        assert (other.truth == len(other.places) - 1).all()
    assert any((part.truth < len(part.places) - 1).any() for part in features(tables))


def test_windows_equal_those_of_the_model_in_the_loop():
    """The features of a data set and those that the model computes as the run goes are the same."""
    from fleet2d.algorithms.presence.learned import shipped_weights
    from fleet2d.learning.datasets.windows import predict

    run = fleet2d.run(
        "bundled:paper",
        "simulation.duration=8 h",
        "simulation.start=2026-01-05 14:00",
        "robots.astro.behaviors=[{type: patrol, dwell: 5 min}]",
        seed=3,
        algorithms={
            "evidence": {"type": "evidence_table"},
            "belief_routine": {
                "type": "real_time_presence",
                "model": "routine",
                "period": "10 min",
            },
            "rtp": {"type": "real_time_presence", "model": "learned", "period": "10 min"},
        },
        metrics={"stays": {}},
    )
    [part] = windows_of_run(run)
    rows = run.arrow("rtp").to_pydict()
    share = np.array([s for s, u in zip(rows["share"], rows["user"], strict=True) if u == "ana"])
    share = share.reshape(len(part.truth), -1)
    in_the_loop = np.concatenate([share[:, :-1] * (1 - share[:, -1:]), share[:, -1:]], axis=1)

    assert np.abs(predict(shipped_weights(), part) - in_the_loop).max() < 1e-4


def test_a_run_without_the_tables_says_what_to_add():
    run = fleet2d.run("bundled:paper", "simulation.duration=1 h", seed=1)
    with pytest.raises(InputError, match="type: evidence_table"):
        windows_of_run(run)


def test_a_data_set_without_beliefs_of_routine_says_so(tables):
    with pytest.raises(InputError, match="beliefs of routine"):
        features({**tables, "beliefs": SCHEMAS["beliefs"].empty_table()})
