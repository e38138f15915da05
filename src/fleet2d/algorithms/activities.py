"""What the users of a run do, and what the cameras take it for.

Both follow from when each activity began and from the step of a look, so nothing of it is worked
out before somebody asks.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fleet2d.kernels.look import CAMERA, SIGHTING, STEP, USER
from fleet2d.kernels.perception import ONE, random_shares

I64 = NDArray[np.int64]
Names = NDArray[np.object_]  # str, or None where nothing is told

# A row of observations: that of the sight kernel, and the robot's index behind it.
ROBOT = SIGHTING
NOTHING = 0  # the code of an activity that nobody has told
TOLD = "activity"  # the event by which a plan tells what is done from then on


@dataclass(frozen=True)
class ActivitySense:
    """How one camera tells what users do.

    Attributes:
        latency: Steps from a look to its rows.
        keys: The stream of each user, uint64 (users,).
        confusion: What each activity is taken for, with which probability, and right otherwise;
            None: this camera doesn't tell activities.
    """

    latency: int
    keys: NDArray[np.uint64]
    confusion: Mapping[str, Mapping[str, float]] | None


class Activities:
    """When each user began which activity, and how each camera of each robot tells them.

    Example:
        >>> sense = ActivitySense(0, np.array([7], np.uint64), {"cook": {"bake": 1.0}})
        >>> activities = Activities(1, {(0, 0): sense})
        >>> activities.begin(0, 10, "cook")
        >>> rows = np.zeros((2, ROBOT + 1), np.int64)
        >>> rows[:, STEP] = 9, 10
        >>> activities.true(rows).tolist(), activities.perceived(rows).tolist()
        ([None, 'cook'], [None, 'bake'])
    """

    def __init__(self, users: int, senses: Mapping[tuple[int, int], ActivitySense]) -> None:
        """Begin with nothing told; `senses` are by index of the robot and of its camera."""
        self._senses = dict(senses)
        self._codes: dict[str | None, int] = {None: NOTHING}
        self._begun: list[tuple[list[int], list[int]]] = [([], [NOTHING]) for _ in range(users)]

    @property
    def users(self) -> int:
        """How many users there are."""
        return len(self._begun)

    @property
    def are_told(self) -> bool:
        """Whether any camera tells activities."""
        return any(sense.confusion is not None for sense in self._senses.values())

    def begin(self, user: int, step: int, activity: str) -> None:
        """Take down what a user does from a step on; steps must not run backwards."""
        steps, codes = self._begun[user]
        steps.append(step)
        codes.append(self._code(activity))

    def now(self, user: int) -> str | None:
        """Return what a user began last; None if nothing is known."""
        return list(self._codes)[self._begun[user][1][-1]]

    def true(self, rows: I64) -> Names:
        """Return what the user of each row of observations did at the look."""
        return self._named(self._looked_at(rows)[0])

    def perceived(self, rows: I64) -> Names:
        """Return what the user of each row was taken to do."""
        return self._named(self._looked_at(rows)[1])

    def _code(self, activity: str) -> int:
        return self._codes.setdefault(activity, len(self._codes))

    def _named(self, codes: I64) -> Names:
        return np.array(list(self._codes), object)[codes]

    def _looked_at(self, rows: I64) -> tuple[I64, I64]:
        """Return codes of the true and the perceived activities."""
        true, taken = (np.full(len(rows), NOTHING, np.int64) for _ in range(2))
        if not self.are_told:
            return true, taken
        for (robot, camera), sense in self._senses.items():
            mine = (rows[:, ROBOT] == robot) & (rows[:, CAMERA] == camera)
            for user, (steps, codes) in enumerate(self._begun):
                at = np.flatnonzero(mine & (rows[:, USER] == user))
                looks = rows[at, STEP] - sense.latency
                begun = np.searchsorted(np.array(steps, np.int64), looks, side="right")
                true[at] = np.array(codes, np.int64)[begun]
                if sense.confusion is not None:
                    draws = random_shares(sense.keys[user], looks)
                    taken[at] = self._taken_for(true[at], draws, sense.confusion)
        return true, taken

    def _taken_for(
        self, true: I64, draws: I64, confusion: Mapping[str, Mapping[str, float]]
    ) -> I64:
        """Return what activities are taken for, by draws [2**-31]."""
        taken = true.copy()
        for activity, others in confusion.items():
            ends = np.rint(np.cumsum(list(others.values())) * ONE).astype(np.int64)
            outcomes = np.array([self._code(name) for name in (*others, activity)], np.int64)
            mine = np.flatnonzero(true == self._code(activity))
            taken[mine] = outcomes[np.searchsorted(ends, draws[mine], side="right")]
        return taken
