"""Adaptive numbers of seeds: who gets more, when it ends, and that it continues."""

from pathlib import Path
from typing import Any

import pytest
from tests.studies.scenes import SPEED, base, digests, run, small

import fleet2d
from fleet2d.errors import ScenarioError
from fleet2d.studies.driver import Observer
from fleet2d.studies.executors import LocalExecutor

AGAINST = {SPEED: 0.3}


class Notes(Observer):
    """Collects remarks."""

    def __init__(self) -> None:
        self.notes = list[str]()

    def on_note(self, text: str) -> None:
        self.notes.append(text)


def study(**adapt: Any) -> dict[str, Any]:
    settings = {"metric": "distance.astro", "against": AGAINST, "seeds": 2, **adapt}
    robots = {"astro": {"type": "patrol", "dwell": 0}}
    axes = {SPEED: [0.3, 0.6, 0.9]}
    return small(base=base(robots=robots), axes=axes, replicates=8, adapt=settings)


def seeds(opened: Any) -> dict[float, int]:
    return dict(opened.variants.group_by(SPEED, maintain_order=True).len().iter_rows())


def test_a_wide_enough_interval_ends_after_the_first_round(tmp_path: Path) -> None:
    observer = Notes()
    counts, opened = run(study(width=1e9), tmp_path / "study", observer=observer)
    assert (6, 6) == (counts.total, counts.complete)
    assert {0.3: 2, 0.6: 2, 0.9: 2} == seeds(opened)
    assert any("no more than 2 seeds" in note for note in observer.notes)


def test_an_interval_that_stays_too_wide_gets_all_seeds(tmp_path: Path) -> None:
    counts, opened = run(study(width=1e-9), tmp_path / "study")
    assert 24 == counts.complete
    assert {0.3: 8, 0.6: 8, 0.9: 8} == seeds(opened)


def test_values_that_are_clearly_worse_get_no_more_seeds(tmp_path: Path) -> None:
    observer = Notes()
    _, opened = run(study(goal="minimize", seeds=4), tmp_path / "study", observer=observer)
    # A fast robot covers more distance, which is worse here; then nothing is left to compare.
    assert {0.3: 4, 0.6: 4, 0.9: 4} == seeds(opened)
    assert 2 == sum("clearly worse after 4 seeds" in note for note in observer.notes)
    _, opened = run(study(goal="maximize", seeds=4), tmp_path / "other")
    assert {0.3: 8, 0.6: 8, 0.9: 8} == seeds(opened)


def test_it_continues_with_the_same_decisions(tmp_path: Path) -> None:
    _, first = run(study(width=1e9), tmp_path / "study")
    counts, again = run(study(width=1e9), tmp_path / "study")
    assert 6 == counts.complete
    assert digests(first) == digests(again)
    counts, more = run(study(width=1e-9), tmp_path / "study")
    assert 24 == counts.complete
    assert set(digests(first)) < set(digests(more))


def test_results_of_later_rounds_do_not_change_earlier_decisions(tmp_path: Path) -> None:
    """A study that was interrupted amid a round, and continued, gave up other values."""
    _, opened = run(study(width=1e-9), tmp_path / "study")
    table = opened.paired("distance.astro", AGAINST)
    width = 1.1 * (table["high"] - table["low"]).max()  # narrow enough with all eight seeds
    _, continued = run(study(width=width), tmp_path / "study")
    assert min(seeds(continued).values()) > 2  # two seeds alone have wide intervals


def test_remarks_are_printed_without_a_terminal(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    fleet2d.study(study(width=1e9), tmp_path / "study", executor="serial")
    assert "note: no more than 2 seeds" in capsys.readouterr().err


def test_rounds_that_a_study_did_not_need_are_not_called_new(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for _ in range(2):
        fleet2d.study(study(width=1e9), tmp_path / "study", executor="serial")
    assert "new" not in capsys.readouterr().err


@pytest.mark.slow
def test_workers_in_processes_decide_the_same(tmp_path: Path) -> None:
    content = study(width=1e9)
    _, serial = run(content, tmp_path / "serial")
    _, local = run(content, tmp_path / "local", LocalExecutor(2), 2)
    assert digests(serial) == digests(local)


@pytest.mark.parametrize(
    ("adapt", "message"),
    [
        ({}, "give width, or goal"),
        ({"width": 1, "metric": "distnce.astro"}, "did you mean 'distance'"),
        ({"width": 1, "against": {SPEED: 0.5}}, "no variant has 0.5"),
        ({"width": 1, "against": {"speed": 0.3}}, "no axis 'speed'"),
    ],
)
def test_wrong_settings_are_refused(tmp_path: Path, adapt: dict[str, Any], message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        run(study(**adapt), tmp_path / "study")
