"""Evidence: what was watched and who was perceived there, minute by minute."""

from collections.abc import Set
from typing import ClassVar

import numpy as np
import pytest
from tests.scenes import TESTS, everything, run

from fleet2d import Algorithm
from fleet2d.algorithms.evidence import SightingCounts, steps_of_bin
from fleet2d.algorithms.observations import PlacedSightings
from fleet2d.errors import ComponentError

HERE = f"{TESTS.as_posix()}/algorithms/test_evidence"


class Tell(Algorithm):
    """Puts out the evidence, and by how much its sums miss those of the exposure."""

    needs: ClassVar[Set[str]] = {"evidence", "exposure"}

    def update(self, history, state):
        evidence = history.evidence
        plan = state.home.plan
        cells = np.bincount(plan.room_of_cell[plan.room_of_cell >= 0])
        summed = evidence.watched.sum(axis=0) * cells * evidence.bin_steps
        bins, _, rooms = evidence.seen.shape
        assert (bins, rooms) == evidence.watched.shape
        assert evidence.begin == history.first
        assert bins * evidence.bin_steps == len(history)
        assert (evidence.seen[:, -1] >= evidence.seen[:, :-1].max(axis=1)).all()
        return {
            "begin": np.full(rooms, evidence.begin),
            "missed": np.abs(summed - history.exposure.max(axis=0)),
            "watched": evidence.watched.sum(axis=0),
            "seen": evidence.seen[:, -1].sum(axis=0),
            "observed": np.bincount(history.observations.room, minlength=rooms),
        }


class Unsaid(Algorithm):
    """Asks for evidence without having said so."""

    def update(self, history, state):
        return {"bins": len(history.evidence)}


def sightings(rows):
    """Return observations of (step, user, room)."""
    step, user, room = np.array(rows, np.int64).reshape(-1, 3).T.copy()
    return PlacedSightings(step, np.arange(len(rows), dtype=np.int32), user, room)


def test_bins_last_a_minute_or_a_step():
    assert [60, 120, 2, 1, 1] == [
        steps_of_bin(us) for us in (1_000_000, 500_000, 25_000_000, 60_000_000, 600_000_000)
    ]


def test_users_perceived_by_two_robots_count_once_and_strangers_only_as_anyone():
    rows = [(0, 0, 1), (0, 0, 1), (1, 0, 1), (1, -1, 1), (59, 1, 0), (60, -1, 0), (120, 0, 0)]

    seen = SightingCounts.of_observations(sightings(rows), 60, (2, 3, 2)).dense

    assert [[0, 2], [1, 0], [1, 2]] == seen[0].tolist()
    assert [[0, 0], [0, 0], [1, 0]] == seen[1].tolist()


def test_nobody_perceived_is_evidence_of_zeros():
    assert 0 == SightingCounts.of_observations(sightings([]), 60, (3, 2, 2)).dense.sum()


def evidence_of(period, what="Tell", **settings):
    content = everything("1 h")
    content["robots"] = {"astro": content["robots"]["astro"]}
    content["algorithms"] = {"tell": {"type": f"{HERE}:{what}", "period": period}}
    return run(content, **settings)


@pytest.mark.parametrize("max_span", [7, None])
def test_bins_sum_up_to_the_exposure_whatever_the_spans(max_span):
    rows = evidence_of("10 min", max_span=max_span).tables["tell"].to_pandas()

    assert 6 == rows["begin"].nunique()
    assert rows["missed"].max() < 1e-6
    assert rows["watched"].sum() > 0
    assert (rows["seen"] <= rows["observed"]).all()
    assert rows["seen"].sum() > 0


def test_missing_needs_are_a_clear_error():
    with pytest.raises(ComponentError, match=r"needs = \{'evidence'\}"):
        evidence_of("10 min", "Unsaid")


def test_a_period_of_half_minutes_is_refused():
    with pytest.raises(ComponentError, match="whole minutes"):
        evidence_of("90 s")
