"""What fails in the middle of a run: whose fault it is, when, and that the run so far is readable."""

from datetime import timedelta

import numpy as np
import pytest
from tests.scenes import digests, run, scenario, table

import fleet2d
from fleet2d import Algorithm, Behavior, Metric
from fleet2d.algorithms.presence.estimator import Estimator
from fleet2d.algorithms.presence.model import Model
from fleet2d.errors import ComponentError

AT = 10_799
"""The step of the third hour's end, at which everything here fails."""


def unknown_key():
    return {}["kitchen"]


class Fails(Algorithm):
    """Puts out a number twice, and then fails, or asks for evidence that others have asked for."""

    how: str

    def update(self, history, state):
        if state.step >= AT and self.how == "raises":
            unknown_key()
        return {"n": 1.0 if self.how == "raises" else len(history.evidence)}


class FailsMetric(Metric):
    """Fails when it is updated, or at the end."""

    when: str

    def update(self, history, state):
        if self.when == "update" and state.step == AT:
            unknown_key()

    def result(self):
        return {"n": np.nan} if self.when == "not a number" else unknown_key()


class FailsEstimator(Estimator):
    """Fails in the third hour."""

    how: str

    def width(self, rooms):
        return rooms + 1

    def sums(self, bins):
        if bins.minute[0] >= 9 * 60 and self.how == "raises":
            unknown_key()
        return np.ones((*bins.seen.shape[:2], self.rooms + 1))

    def shares(self, sums):
        home = sums[..., :-1] / sums[..., :-1].sum(axis=-1, keepdims=True)
        bad = sums[..., -1].max() > 120 and self.how == "not a number"
        return home * (np.nan if bad else 1.0), np.zeros(sums.shape[:-1])


class FailsModel(Model):
    """Fails in the third hour."""

    how: str

    def observe(self, bins):
        home = np.full((len(bins.day), self.users + 1, self.rooms), 1 / self.rooms)
        away = np.zeros(home.shape[:2])
        if bins.minute[0] >= 9 * 60:
            match self.how:
                case "raises":
                    unknown_key()
                case "sum":
                    home[7, 0] *= 2
                case "not a number":
                    away[7, 0] = np.nan
                case "short":
                    return home[1:], away[1:]
        return home, away


class FailsBehavior(Behavior):
    """Goes nowhere, and fails."""

    def decide(self, now):
        if now.step >= AT:
            unknown_key()
        return now.plan().stay(now.time.replace(hour=9, minute=59, second=59) - now.time)


def content(**more):
    found = scenario(
        "5 h",
        users={"ana": {"type": "meander"}},
        robots={"astro": {"type": "patrol", "dwell": "30 s"}},
        algorithms={"ltp": {"type": "long_term_presence"}},
    )
    for section, entries in more.items():
        found[section] = {**found[section], **entries} if section in found else entries
    return found


MINE = f"{__name__}:"


def algorithm(kind, **fields):
    return {"algorithms": {"mine": {"type": kind, **fields}}}


def estimator(how):
    return algorithm("long_term_presence", estimator={"type": f"{MINE}FailsEstimator", "how": how})


def model(how):
    failing = {"type": f"{MINE}FailsModel", "how": how}
    return algorithm("real_time_presence", period="1 h", model=failing)


METRIC = {"mine": {"type": f"{MINE}FailsMetric", "when": "update", "period": "1 h"}}
BODY = {"mine": {"type": f"{MINE}FailsBehavior"}}
TRACE = ["KeyError: 'kitchen'", "in update: unknown_key(); ", "in unknown_key: "]
CASES = [
    (algorithm(f"{MINE}Fails", how="raises"), "algorithms.mine", TRACE),
    (estimator("raises"), "algorithms.mine", ["KeyError"]),
    (estimator("not a number"), "algorithms.mine", ["not a distribution", "nan"]),
    (model("raises"), "algorithms.mine", ["KeyError"]),
    (model("sum"), "algorithms.mine", ["FailsModel", "'ana' in bin 7 of 60", "sum to 2"]),
    (model("not a number"), "algorithms.mine", ["'ana' in bin 7 of 60", "away nan"]),
    (model("short"), "algorithms.mine", ["(59, 2, 6) and (59, 2)", "(60, 2, 6)"]),
    ({"metrics": METRIC}, "metrics.mine", ["KeyError"]),
    ({"robots": BODY}, "robots.mine", ["KeyError", "in decide"]),
]


@pytest.fixture(scope="module")
def alike():
    """A run that ends where the others fail."""
    return digests(run(content(), f"simulation.duration={AT + 1} s"))


@pytest.mark.slow
@pytest.mark.parametrize(("changes", "path", "words"), CASES)
def test_an_error_names_who_failed_and_when_and_the_run_so_far_is_whole(
    changes, path, words, alike, tmp_path
):
    with pytest.raises(ComponentError) as caught:
        run(content(**changes), out=tmp_path / "run")
    for word in (path, f"step {AT}", *words):
        assert word in str(caught.value)
    assert any(str(tmp_path / "run") in note for note in caught.value.__notes__)

    stored = fleet2d.open_run(tmp_path / "run")
    assert "failed" == stored.status
    assert [] == stored.verify()
    assert any(str(caught.value) in note for note in stored.notes)
    if path == "robots.mine":
        return
    assert AT + 1 == stored.manifest["steps"]
    assert alike["key_frames"] == digests(stored)["key_frames"]
    assert 179 * 60 == table(stored, "trajectories", entity="ana")["step"].max()
    if "mine" in stored.tables:
        assert {3599, 7199} <= set(table(stored, "mine")["step"].tolist())


@pytest.mark.parametrize("when", ["result", "not a number"])
def test_a_metric_that_fails_at_the_end_leaves_the_run_readable(when, tmp_path):
    broken = {"mine": {"type": f"{MINE}FailsMetric", "when": when}}
    with pytest.raises(ComponentError, match=r"metrics\.mine failed at step 18000"):
        run(content(metrics=broken), out=tmp_path / "run")
    stored = fleet2d.open_run(tmp_path / "run")
    assert "failed" == stored.status
    assert [] == stored.verify()
    assert digests(run(content()))["key_frames"] == digests(stored)["key_frames"]


def test_needs_that_another_one_declares_are_refused_all_the_same():
    with pytest.raises(ComponentError, match=r"needs = \{'evidence'\}"):
        run(content(**algorithm(f"{MINE}Fails", how="evidence")), "simulation.duration=1 h")


class Greedy(Algorithm):
    """Asks for exposure between other steps than those of updates."""

    needs = frozenset({"exposure"})
    looks_back = timedelta.max

    def update(self, history, state):
        first = 1234 if state.step >= AT else 0
        return {"cells": history.between(first, history.end).exposure.sum(dtype=float)}


def test_exposure_between_other_steps_than_updates_is_refused_not_wrong():
    with pytest.raises(ComponentError, match="from update to update, and none is at step 1234"):
        run(content(algorithms={"mine": {"type": f"{MINE}Greedy"}}))


USERS_OWN = """
import fleet2d

def deeper(rooms):
    return rooms[99]

class Broken(fleet2d.Algorithm):
    def update(self, history, state):
        return {"name": deeper(state.home.rooms).name}
"""


@pytest.mark.slow
def test_the_command_line_shows_the_users_own_lines_and_where_the_run_is(fleet2d, tmp_path):
    (tmp_path / "mine.py").write_text(USERS_OWN)
    override = "algorithms.broken.type=mine:Broken"
    code, _, err = fleet2d(
        "run", "bundled:paper", "simulation.duration=2 h", override, "--out", "out", "--quiet"
    )
    assert 1 == code
    error, where = err.strip().splitlines()
    assert (
        "error: algorithms.broken failed at step 3599: IndexError: tuple index out of range"
        ' (mine.py:9, in update: return {"name": deeper(state.home.rooms).name};'
        " mine.py:5, in deeper: return rooms[99])"
    ) == error
    assert "the run until then, 2026-01-05 01:00:00, is in out" == where
    code, _, err = fleet2d("show", "out")
    assert 0 == code, err
    assert (tmp_path / "out" / "picture.png").stat().st_size > 10_000
