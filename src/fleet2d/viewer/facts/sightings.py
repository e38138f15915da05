"""The stretches of a run in which robots noticed users, correctly or by mistake."""

from typing import Any

import numpy as np

from fleet2d.kernels import I64, Bool
from fleet2d.runs.run import Run, categories
from fleet2d.viewer.facts.contract import SightingFacts

JOIN_S = 6.0  # shorter gaps between sightings are no gaps in a lane


def sightings_of(run: Run) -> list[SightingFacts]:
    """Return the stretches in which each robot noticed each user, in order."""
    if "observations" not in run.tables:
        return []
    table = run.tables["observations"]
    step = table["step"].to_numpy()
    robot, robots = categories(table["robot"])
    user, users = categories(table["user"])
    false = np.zeros(len(step), np.bool_)
    if "true_user" in table.column_names:
        true_user, true_names = categories(table["true_user"])
        names = np.array([*users, ""], dtype=object)
        true = np.array([*true_names, ""], dtype=object)
        is_mistaken = (names[user] != true[true_user]) & (user >= 0)
        false = (true_user < 0) | is_mistaken
    gap = max(1, round(JOIN_S * 1e6 / run.manifest["step_us"]))
    lanes = []
    for r, robot_name in enumerate(robots):
        for u, user_name in enumerate([*users, ""]):
            code = u if user_name else -1
            rows = (robot == r) & (user == code)
            if rows.any():
                first, last, is_false = _stretches(step[rows], false[rows], gap)
                lanes.append(
                    SightingFacts(
                        robot=robot_name,
                        user=user_name,
                        first=first.tolist(),
                        last=last.tolist(),
                        false=is_false.tolist(),
                    )
                )
    return lanes


def _stretches(step: I64, false: Bool, gap: int) -> tuple[I64, I64, Any]:
    """Return first and last step of each stretch without a gap, and whether it is of false ones."""
    order = np.argsort(step, kind="stable")
    step, false = step[order], false[order]
    cuts = (np.diff(step) > gap) | (false[1:] != false[:-1])
    begins = np.append(0, np.flatnonzero(cuts) + 1)
    ends = np.append(begins[1:] - 1, len(step) - 1)
    return step[begins], step[ends], false[begins]
