"""Fig. 7 left: how the estimate of long-term presence converges over the days.

One person, one home, many robots: patrols of several kinds, and hangouts that use what they
learned. Each robot has random draws of its own, and the person lives the same month with each. The
gap of a room is the difference between its estimated and its true share of time at home so far. The
result is the mean over robots, and the band that contains 80 % of them.
"""

import time
from typing import TYPE_CHECKING, Any

import numpy as np

from fleet2d.paper.months import CAMERA, USER, OnProgress, PaperOptions, month, run_study
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
"""The gap of each room after each day, by room."""


def study_of(robots: int, days: int) -> dict[str, Any]:
    """Return the study: robots of even numbers patrol, robots of odd numbers hang out.

    Each has a name of its own, and so random draws of its own.
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
        {room: group["gap"].tolist() for room, group in robot_rows.groupby("room", sort=False)}
        for _, robot_rows in rows.groupby("variant")
    ]


def reproduce(options: PaperOptions, on_progress: OnProgress) -> Result:
    """Run all months; return the table of mean gaps."""
    robots, days = options.size(100, 30, 4, 3)
    start_s = time.perf_counter()
    robot_gaps = gaps(run_study(NAME, study_of(robots, days), options, on_progress))
    duration_s = time.perf_counter() - start_s
    rooms = {room: np.array([each[room] for each in robot_gaps]) for room in robot_gaps[0]}
    means = {room: values.mean(axis=0) for room, values in rooms.items()}
    overall = np.mean(list(rooms.values()), axis=0)
    low, high = np.quantile(overall, BAND, axis=0)
    listed_days = [day for day in SHOWN_DAYS if day <= days]
    lines = {**means, "all rooms": overall.mean(axis=0), "  band, low": low, "  band, high": high}
    table = Table(
        f"mean |estimated - true| share of time at home; {counted(robots, 'robot')},"
        f" {counted(days, 'day')}, {ESTIMATOR}",
        ("room", *(f"day {day}" for day in listed_days)),
        tuple(
            (name, *(f"{line[day - 1]:.3f}" for day in listed_days)) for name, line in lines.items()
        ),
        (
            *PAPER,
            f"{robots * days} days of one home in {duration_s:.1f} s, {options.workers} at a time",
        ),
    )
    numbers = {
        "robots": robots,
        "days": days,
        "estimator": ESTIMATOR,
        "seconds": duration_s,
        "mean": {room: line.tolist() for room, line in means.items()},
        "all_rooms": {
            "mean": overall.mean(axis=0).tolist(), "low": low.tolist(), "high": high.tolist(),
        },
        "gaps": robot_gaps,
    }  # fmt: skip
    return Result(NAME, TITLE, (table,), numbers)
