"""What an algorithm has learned: kept, recalled in another run, refused where it doesn't fit."""

from datetime import timedelta
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
from tests.scenes import TESTS, everything, run

from fleet2d import Algorithm
from fleet2d.algorithms.algorithm import load_learned, save_learned
from fleet2d.errors import ComponentError, InputError

HERE = f"{TESTS.as_posix()}/algorithms/test_algorithm_learned"


class Counts(Algorithm):
    """Counts sightings per room, and keeps some more."""

    def start(self, home):
        self.counts = np.zeros(len(home.rooms))
        self.more: dict[str, Any] = {"days": 0, "by_hour": {"noon": np.arange(3)}, "word": "x"}

    def update(self, history, state):
        self.counts += np.bincount(history.observations.room, minlength=len(self.counts))
        self.more["days"] += 1
        return {"counts": self.counts, "days": np.full(len(self.counts), self.more["days"])}


class Hoards(Algorithm):
    """Keeps what no file can hold."""

    def start(self, home):
        self.queue = object()

    def update(self, history, state):
        """Do nothing."""


class LooksBack(Algorithm):
    """Asks for more than its period."""

    looks_back: ClassVar[timedelta] = timedelta(minutes=30)
    minutes: int = 30

    def update(self, history, state):
        first = max(0, history.first - 60 * self.minutes)
        wide = history.between(first, history.end)
        return {"steps": len(wide), "moved": wide.poses("astro").distance,
                "seen": len(wide.observations.step)}  # fmt: skip


def content(what, **more):
    return {
        **everything("1 h"),
        "algorithms": {"mine": {"type": f"{HERE}:{what}", "period": "10 min", **more}},
    }


def test_a_run_starts_from_the_learned_state_of_another(tmp_path):
    first = run(content("Counts"), "artifacts.learned=true", out=tmp_path / "first")
    learned = tmp_path / "first" / "learned" / "mine.npz"
    second = run(content("Counts", learned=str(learned)), out=tmp_path / "second")

    counts, days = (first.tables["mine"][name].to_numpy() for name in ("counts", "days"))
    more, later = (second.tables["mine"][name].to_numpy() for name in ("counts", "days"))
    rooms = len(counts) // 6
    assert counts[-rooms:].sum() > 0
    assert (counts[-rooms:] + counts[:rooms] == more[:rooms]).all()  # the same first ten minutes
    assert (days + 6 == later).all()
    assert str(learned) in {Path(file["path"]).as_posix() for file in second.manifest["inputs"]}


def test_nothing_is_stored_unasked(tmp_path):
    run(content("Counts"), out=tmp_path / "run")
    assert not (tmp_path / "run" / "learned").exists()


def test_learned_state_that_cannot_be_stored_is_reported_and_the_run_is_complete(tmp_path):
    stored = run(content("Hoards"), "artifacts.learned=true", out=tmp_path / "run")

    assert "complete" == stored.manifest["status"]
    assert any("'queue'" in note and "remember()" in note for note in stored.manifest["notes"])


def test_learned_state_of_another_home_is_refused(tmp_path):
    path = tmp_path / "mine.npz"
    save_learned({"counts": np.zeros(99)}, path, "mine")
    with pytest.raises(ComponentError, match=r"'counts' of shape \(99,\).*in another home"):
        run(content("Counts", learned=str(path)))


@pytest.mark.parametrize("text", ["", "nonsense", "PK\x03\x04"])
def test_a_file_that_is_none_is_refused_in_plain_words(tmp_path, text):
    path = tmp_path / "mine.npz"
    path.write_text(text)
    with pytest.raises(InputError, match="is not a file of learned state"):
        run(content("Counts", learned=str(path)))


def test_nested_mappings_come_back(tmp_path):
    state = {"a": {"b": np.eye(2), "c": {"d": 1.5}}, "e": "word", "f": True}
    save_learned(state, tmp_path / "x.npz", "x")
    loaded = load_learned(tmp_path / "x.npz")

    assert (np.eye(2) == loaded["a"].pop("b")).all()
    assert {"a": {"c": {"d": 1.5}}, "e": "word", "f": True} == loaded


def test_looking_back_returns_the_requested_steps():
    stored = run({**content("LooksBack"), "metrics": {"distance": {"period": "10 min"}}})
    steps = stored.tables["mine"]["steps"].to_pylist()

    assert [600, 1200, 1800, 2400, 2400, 2400] == steps
    whole = run(content("LooksBack", period="1 h")).tables["mine"]
    assert 3600 == whole["steps"][0].as_py()
    assert whole["moved"][0].as_py() > 0


def test_looking_back_farther_than_declared_is_refused():
    with pytest.raises(ComponentError, match="set looks_back in the class"):
        run(content("LooksBack", minutes=31))


def test_looking_back_is_the_same_for_every_span():
    assert run(content("LooksBack")).digest == run(content("LooksBack"), max_span=11).digest
