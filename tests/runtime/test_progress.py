"""Progress is a bar in a terminal, and a line a minute elsewhere."""

import time

import pytest

from fleet2d.runtime import progress


@pytest.fixture(autouse=True)
def soon(monkeypatch):
    """Let a minute be short."""
    monkeypatch.setattr(progress, "LINES_EVERY_S", 0.02)


def test_a_line_a_minute_is_written_without_a_terminal(capsys):
    with progress.progress_bar(show=True) as bar:
        task = bar.add_task("runs", total=40)
        bar.update(task, completed=10)
        time.sleep(0.1)

    first, *_ = lines = capsys.readouterr().err.splitlines()
    assert "25 %: runs" == first
    assert 2 <= len(lines) <= 6


def test_a_task_without_a_total_has_no_percentage(capsys):
    with progress.progress_bar(show=True) as bar:
        bar.add_task("7 runs", total=None)
        time.sleep(0.05)

    assert capsys.readouterr().err.startswith("7 runs\n")


def test_nothing_is_written_if_it_is_not_shown(capsys):
    with progress.progress_bar(show=False) as bar:
        bar.add_task("runs", total=40)
        time.sleep(0.05)

    assert ("", "") == capsys.readouterr()


def test_no_line_comes_after_the_end(capsys):
    with progress.progress_bar(show=True) as bar:
        bar.add_task("runs", total=40)
    time.sleep(0.05)

    assert "" == capsys.readouterr().err
