"""The bar of a study: how many variants, how fast, and how many failed."""

from rich.progress import Progress

from fleet2d.studies import progress
from fleet2d.studies.directory import Counts
from fleet2d.studies.progress import BarObserver
from fleet2d.studies.results import VariantResult


def test_a_bar_counts_what_is_complete_and_names_rate_and_failures(monkeypatch):
    now_s = 100.0
    monkeypatch.setattr(progress.time, "monotonic", lambda: now_s)
    bar = Progress(disable=True)
    observer = BarObserver(bar)
    observer.on_start(Counts(10, 4, 0), workers=2)
    statuses = ["complete", "failed"]
    for status in statuses:
        now_s += 10.0
        observer.on_result(VariantResult({"status": status}))
    (task,) = bar.tasks
    assert (6, 10) == (task.completed, task.total)
    assert "6.0 variants/min, 1 failed" == task.description
