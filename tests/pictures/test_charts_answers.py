"""The figure of answers: what robots asked whom, what came of it, and what expired."""

from typing import Any

import pytest
from tests.entities.robots.test_interact import PILL, ana, home
from tests.scenes import scenario

import fleet2d
from fleet2d.errors import InputError
from fleet2d.pictures.charts import answers_figure, asked_of
from fleet2d.viewer.report import report_html


def run_with(outcomes: tuple[str, ...], **changes: Any) -> fleet2d.Run:
    metrics = {"interactions": {"period": "1 h"}}
    return fleet2d.run(
        home("2 h", users={"ana": ana(outcomes=outcomes)}, metrics=metrics, **changes)
    )


@pytest.mark.parametrize(
    ("outcome", "answer"),
    [
        ("accepted", "accepted"),
        ("declined", "declined"),
        ("", "no answer"),
        ("banned", "sent away"),
    ],
)
def test_a_question_is_drawn_by_its_answer(outcome: str, answer: str) -> None:
    (asked, *_), _ = asked_of(run_with((outcome,)))

    assert ("astro", "ana", answer) == (asked.robot, asked.user, asked.answer)
    assert 7 + 1 / 6 <= asked.hours < 7.5  # the run begins at 7:00


def test_expired_requests_are_drawn_at_their_deadline() -> None:
    robots = {"astro": {"behaviors": [{"type": "interact", "seek": False}]}}
    asked, (expired,) = asked_of(run_with(("accepted",), robots=robots))

    assert [] == asked
    assert 8 + 1 / 6 == pytest.approx(expired.hours, abs=1e-3)


def test_annoyance_is_drawn_for_each_person() -> None:
    interactions = {"pill": PILL | {"at": ["07:10", "08:00"], "within": "40 min"}}
    run = run_with(("ignored", "accepted"), interactions=interactions)
    figure = answers_figure(run)
    (line,) = next(axes for axes in figure.axes if axes.get_ylabel() == "annoyance").lines

    assert run.tables["interactions"]["annoyance"].to_pylist() == list(line.get_ydata())


def test_a_run_without_interactions_has_no_such_figure() -> None:
    with pytest.raises(InputError, match="no answers to draw"):
        answers_figure(fleet2d.run(scenario("10 min")))


@pytest.mark.slow
def test_reports_show_answers_if_robots_want_something() -> None:
    without = fleet2d.run(home("10 min", interactions={}, robots={"astro": {}}))

    assert "what they answered" in report_html(run_with(("accepted",)))
    assert "what they answered" not in report_html(without)
