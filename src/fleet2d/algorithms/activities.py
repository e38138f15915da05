"""Activities of the users of a run, true and as cameras perceive them.

Both follow from the steps at which activities began and from the step of a look, so they are
computed on demand.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fleet2d.kernels import I64, U64
from fleet2d.kernels.sight import ONE, random_shares
from fleet2d.kernels.sight import SightingColumn as Column

Names = NDArray[np.object_]  # str, or None where no activity is known

# A row of observations is a row of the sight kernel, followed by the robot's index.
ROBOT = len(Column)
NOTHING = 0  # the code for no known activity


@dataclass(frozen=True)
class ActivitySense:
    """How one camera perceives activities.

    Attributes:
        latency: Steps from a look to its observations.
        keys: uint64 (users,), the key of the random stream of each user.
        confusion: For each activity, the probabilities of being mistaken for others; None: this
            camera perceives no activities.
    """

    latency: int
    keys: U64
    confusion: Mapping[str, Mapping[str, float]] | None


class Activities:
    """The activities of each user over time, and how the cameras of each robot perceive them.

    Attributes:
        are_perceived: Whether any camera perceives activities.

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
        """Begin without activities; `senses` are by index of the robot and of its camera."""
        self._senses = dict(senses)
        self.are_perceived = any(sense.confusion is not None for sense in senses.values())
        self._codes: dict[str | None, int] = {None: NOTHING}
        self._begun: list[tuple[list[int], list[int]]] = [([], [NOTHING]) for _ in range(users)]

    @property
    def users(self) -> int:
        """Number of users."""
        return len(self._begun)

    def begin(self, user: int, step: int, activity: str) -> None:
        """Record the activity of a user from a step on; steps must not decrease."""
        steps, codes = self._begun[user]
        if not self.are_perceived:  # then only the present one is asked for
            steps.clear()
            codes.clear()
        steps.append(step)
        codes.append(self._code(activity))

    def now(self, user: int) -> str | None:
        """Return the activity that a user began last; None if none is known."""
        return list(self._codes)[self._begun[user][1][-1]]

    def true(self, rows: I64) -> Names:
        """Return the true activity of the user of each row at its look: object (n,)."""
        return self._names(self._codes_of(rows)[0])

    def perceived(self, rows: I64) -> Names:
        """Return the perceived activity of the user of each row: object (n,)."""
        return self._names(self._codes_of(rows)[1])

    def _code(self, activity: str) -> int:
        return self._codes.setdefault(activity, len(self._codes))

    def _names(self, codes: I64) -> Names:
        return np.array(list(self._codes), object)[codes]

    def _codes_of(self, rows: I64) -> tuple[I64, I64]:
        """Return the codes of the true and of the perceived activities: int64 (n,) each."""
        true, perceived = (np.full(len(rows), NOTHING, np.int64) for _ in range(2))
        if not self.are_perceived:
            return true, perceived
        for (robot, camera), sense in self._senses.items():
            is_camera = (rows[:, ROBOT] == robot) & (rows[:, Column.CAMERA] == camera)
            for user, (steps, codes) in enumerate(self._begun):
                index = np.flatnonzero(is_camera & (rows[:, Column.USER] == user))
                looks = rows[index, Column.STEP] - sense.latency
                position = np.searchsorted(np.array(steps, np.int64), looks, side="right")
                true[index] = np.array(codes, np.int64)[position]
                if sense.confusion is not None:
                    draws = random_shares(sense.keys[user], looks)
                    perceived[index] = self._confused(true[index], draws, sense.confusion)
        return true, perceived

    def _confused(self, true: I64, draws: I64, confusion: Mapping[str, Mapping[str, float]]) -> I64:
        """Return the codes of perceived activities, by random draws [2**-31]."""
        perceived = true.copy()
        for activity, others in confusion.items():
            ends = np.rint(np.cumsum(list(others.values())) * ONE).astype(np.int64)
            outcomes = np.array([self._code(name) for name in (*others, activity)], np.int64)
            index = np.flatnonzero(true == self._code(activity))
            perceived[index] = outcomes[np.searchsorted(ends, draws[index], side="right")]
        return perceived
