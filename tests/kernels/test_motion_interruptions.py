"""Interruptions of a day: what is refused; `tests/routines/test_interruptions.py` has the twin."""

import pytest

from fleet2d.kernels import Interruptions, RoomUse, StepDraws

OFTEN = list(range(1, 257))


def rules(**changes):
    """Rules of three activities, with one need."""
    parts = {
        "steps": [(1, 1024, OFTEN)], "every": OFTEN, "asleep": None, "chances": (0, 0, 0, 0),
        "patience": 60, "hours": None, "met_by": [1], "away": [2], "sleep": 0, "activities": 3,
    } | changes  # fmt: skip
    names = ("steps", "every", "asleep", "chances", "patience", "hours", "met_by")
    need = tuple(parts[name] for name in names)
    return Interruptions([need], [], parts["away"], [], parts["sleep"], parts["activities"])


@pytest.mark.parametrize(
    ("part", "value", "message"),
    [
        ("steps", [(3, 1024, OFTEN)], "no such activity"),
        ("steps", [(1, 1025, OFTEN)], "chances must be 0 to 1024"),
        ("steps", [(1, 1024, OFTEN[1:])], "quantiles must be 256"),
        ("every", [0] * 256, "quantiles must be 1 to 2"),
        ("asleep", [2**40] * 256, "quantiles must be 1 to 2"),
        ("chances", (0, -1, 0, 0), "chances must be 0 to 1024"),
        ("patience", -1, "patience must be 0 to 2"),
        ("hours", (-1, 5), "hours must begin at 0"),
        ("met_by", [-1], "no such activity"),
        ("away", [3], "no such activity"),
        ("sleep", 3, "no such activity"),
        ("activities", 0, "activities must be 1 to 2"),
    ],
)
def test_wrong_rules_are_refused(part, value, message):
    with pytest.raises(ValueError, match=message):
        rules(**{part: value})


@pytest.mark.parametrize(
    ("day", "message"),
    [
        ([], "must have an episode"),
        ([(3, 0, 9, -1)], "no such activity"),
        ([(1, 9, 8, -1)], "end after they begin"),
        ([(1, 0, 2**20, -1)], "within 2"),
    ],
)
def test_wrong_days_are_refused(day, message):
    with pytest.raises(ValueError, match=message):
        rules().interrupt(StepDraws(1, 2), day)


def test_rooms_are_those_of_the_activities():
    with pytest.raises(ValueError, match="rooms must be those of each activity"):
        rules().interrupt(StepDraws(1, 2), [(1, 0, 9, -1)], RoomUse(), [[], []])
