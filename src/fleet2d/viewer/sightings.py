"""In which stretches of a run robots noticed users, and which of that was false."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fleet2d.runs.run import Run
from fleet2d.viewer.contract import SightingFacts

I64 = NDArray[np.int64]
JOINED_S = 6.0  # a camera that misses somebody for so long goes on seeing them in the lane


def sightings_of(run: Run) -> list[SightingFacts]:
    """Return the stretches in which each robot noticed each user, in order."""
    if "observations" not in run.tables:
        return []
    table = run.tables["observations"]
    step = table["step"].to_numpy()
    robot, robots = _codes(table["robot"])
    user, users = _codes(table["user"])
    false = np.zeros(len(step), np.bool_)
    if "true_user" in table.column_names:
        true_user, true_names = _codes(table["true_user"])
        names = np.array([*users, ""], dtype=object)
        true = np.array([*true_names, ""], dtype=object)
        mistaken = (names[user] != true[true_user]) & (user >= 0)
        false = (true_user < 0) | mistaken
    gap = max(1, round(JOINED_S * 1e6 / run.manifest["step_us"]))
    lanes = []
    for r, robot_name in enumerate(robots):
        for u, user_name in enumerate([*users, ""]):
            code = u if user_name else -1
            mine = (robot == r) & (user == code)
            if mine.any():
                first, last, wrong = _stretches(step[mine], false[mine], gap)
                lanes.append(
                    SightingFacts(
                        robot=robot_name,
                        user=user_name,
                        first=first.tolist(),
                        last=last.tolist(),
                        false=wrong.tolist(),
                    )
                )
    return lanes


def _stretches(step: I64, false: NDArray[np.bool_], gap: int) -> tuple[I64, I64, Any]:
    """Return first step, last step and falseness of runs of steps that lie close together."""
    order = np.argsort(step, kind="stable")
    step, false = step[order], false[order]
    cuts = (np.diff(step) > gap) | (false[1:] != false[:-1])
    begins = np.append(0, np.flatnonzero(cuts) + 1)
    ends = np.append(begins[1:] - 1, len(step) - 1)
    return step[begins], step[ends], false[begins]


def _codes(column: Any) -> tuple[I64, list[str]]:
    """Return a column of words as numbers, -1 for none, and the words."""
    encoded = column.cast("string").combine_chunks().dictionary_encode()
    codes = encoded.indices.fill_null(-1).to_numpy(zero_copy_only=False).astype(np.int64)
    return codes, encoded.dictionary.to_pylist()
