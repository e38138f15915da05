"""What robots asked whom, and what came of it, as a film tells it."""

import numpy as np
import pytest
from matplotlib.figure import Figure
from tests.entities.robots.test_interact import ana, home

import fleet2d
from fleet2d.viewing.stage import Stage, asked_of


def run_with(outcomes, **changes):
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
def test_a_question_is_drawn_by_its_answer(outcome, answer):
    (asked, *_) = asked_of(run_with((outcome,)))

    assert ("astro", "pill ana", answer) == (asked.robot, asked.text, asked.answer)
    assert 600 <= asked.step < 1800


def test_a_question_lasts_until_it_is_carried_out_or_the_robot_withdraws():
    for outcome, takes in (("accepted", 30), ("", 0)):
        run = run_with((outcome,))
        (talk, *_) = asked_of(run)
        assert talk.end is not None
        if outcome:
            assert talk.step + 5 == talk.answered
            assert takes <= talk.end - talk.step - 5 <= takes + 2
        else:
            assert talk.answered is None
            assert talk.end - talk.step == pytest.approx(20, abs=2)  # its patience


def test_a_film_says_what_is_asked_and_answered_beside_the_robot():
    run = run_with(("accepted",))
    (talk, *_) = asked_of(run)
    stage = Stage(run, talk.step - 60, talk.step + 120, figure=Figure())
    robot = next(body for body in stage.bodies if body.facts["name"] == "astro")

    def shown(step):
        stage.show(step)
        return str(robot.name.get_text())

    assert talk.answered is not None
    assert talk.end is not None
    assert "Astro" == shown(talk.step - 1)
    assert "Astro: pill ana?" == shown(talk.step) == shown(talk.answered - 1)
    assert "Astro: pill ana, accepted" == shown(talk.answered) == shown(talk.end)
    assert "Astro" == shown(talk.end + 1)
    # The film draws a new frame at each of these moments.
    moments = np.array([talk.step, talk.answered, talk.end + 1]) - (talk.step - 60)
    assert stage.changes()[moments].all()
