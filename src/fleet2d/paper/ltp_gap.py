"""Fig. 7 left: how the long-term presence of each room comes near the truth by days.

One person, one home, many robots: patrols of several kinds and hangouts that go by what they
learned, each with draws of its own, while the person lives the same month with each. The gap of a
room is that of the share of time at home between the estimate and where the person really was so
far; mean over robots, and the band that holds 80 % of them.
"""

import time
from typing import TYPE_CHECKING, Any

import numpy as np

from fleet2d.paper.months import CAMERA, USER, Request, Tell, month, run_study
from fleet2d.paper.result import Result, Table, counted

if TYPE_CHECKING:
    from fleet2d.studies.reader import Study

NAME = "ltp-gap"
TITLE = "Fig. 7 left: gap of long-term presence by days"
ESTIMATOR = "likelihood"
BAND = (0.1, 0.9)
SHOWN_DAYS = (1, 3, 7, 14, 21, 30, 60)
PAPER = (
    "the paper's figure: gaps of the rooms that fall with the days, mean and band over 100 robot"
    " behaviors for one user and home; its numbers are not printed",
)

KINDS: tuple[dict[str, Any], ...] = (
    {"type": "patrol", "order": "random", "dwell": "10 min"},
    {"type": "hangout", "source": "ltp", "near": "room", "explore": 0.2},
    {"type": "patrol", "order": "random", "dwell": "20 min"},
    {"type": "hangout", "source": "ltp", "near": "path", "explore": 0.1},
    {"type": "patrol", "dwell": "30 min"},
    {"type": "hangout", "source": "ltp", "near": "path", "explore": 0.3, "period": "1 h"},
)

Gaps = dict[str, list[float]]


def study_of(robots: int, days: int) -> dict[str, Any]:
    """Return the study: robots of even numbers on patrol, of odd ones hanging out.

    Each has a name of its own, and so draws of its own.
    """
    base = month(
        algorithms={"ltp": {"type": "long_term_presence", "estimator": ESTIMATOR, "period": "4 h"}},
        metrics={"gap": {"type": "ltp_gap", "of": "ltp", "period": "1 d"}},
        days=days,
    )
    options = {
        f"robot_{number}": {
            f"robots.robot_{number}": {"camera": CAMERA, **KINDS[number % len(KINDS)]}
        }
        for number in range(robots)
    }
    return {"base": base, "axes": {"robot": {"options": options}}, "keep": {"tables": ["gap"]}}


def gaps(study: "Study") -> list[Gaps]:
    """Return the gap of each room after each day, by robot."""
    rows = study.pandas("gap", columns=["variant", "step", "user", "room", "gap"])
    rows = rows[rows["user"] == USER].sort_values(["variant", "step"], kind="stable")
    return [
        {room: one["gap"].tolist() for room, one in of_robot.groupby("room", sort=False)}
        for _, of_robot in rows.groupby("variant")
    ]


def reproduce(request: Request, tell: Tell) -> Result:
    """Run all months; return the table of mean gaps."""
    robots, days = request.size(100, 30, 4, 3)
    began = time.perf_counter()
    found = gaps(run_study(NAME, study_of(robots, days), request, tell))
    took = time.perf_counter() - began
    by_room = {room: np.array([one[room] for one in found]) for room in found[0]}
    means = {room: values.mean(axis=0) for room, values in by_room.items()}
    every = np.mean(list(by_room.values()), axis=0)
    low, high = np.quantile(every, BAND, axis=0)
    shown = [day for day in SHOWN_DAYS if day <= days]
    lines = {**means, "all rooms": every.mean(axis=0), "  band, low": low, "  band, high": high}
    table = Table(
        f"mean |estimated - true| share of time at home; {counted(robots, 'robot')},"
        f" {counted(days, 'day')}, {ESTIMATOR}",
        ("room", *(f"day {day}" for day in shown)),
        tuple((name, *(f"{line[day - 1]:.3f}" for day in shown)) for name, line in lines.items()),
        (*PAPER, f"{robots * days} days of one home in {took:.1f} s, {request.workers} at a time"),
    )
    numbers = {
        "robots": robots,
        "days": days,
        "estimator": ESTIMATOR,
        "seconds": took,
        "mean": {room: line.tolist() for room, line in means.items()},
        "all_rooms": {
            "mean": every.mean(axis=0).tolist(), "low": low.tolist(), "high": high.tolist(),
        },
        "gaps": found,
    }  # fmt: skip
    return Result(NAME, TITLE, (table,), numbers)
