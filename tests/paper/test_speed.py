"""Watching a run: every frame of a film of the base scenario is drawn."""

from fleet2d.paper.speed import time_frames


def test_watching_counts_the_time_between_frames() -> None:
    timing = time_frames(60, 10, from_hour=1)
    assert 600 == timing["simulated_s"]
