"""How good a robot's perception is: precision, recall, and who is taken for whom."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from fleet2d.algorithms.history import History
from fleet2d.component import register
from fleet2d.metrics.metric import Metric

if TYPE_CHECKING:
    from fleet2d.algorithms.algorithm import Present
    from fleet2d.floorplan.home.home import Home

UNKNOWN = "unknown"  # the name in the confusion of somebody not recognized
NO_ONE = "nobody"  # the name there of who isn't there at all: a false positive


@register("metric", "detections")
class Detections(Metric):
    """Precision, recall and identity confusion of each robot, over all its cameras.

    A look is one camera at one step at which it takes an image; a user is in view if the camera's
    geometry shows the user, whatever its perception makes of it.

    - `recall`: looks in which a user in view was noticed / looks with that user in view, added up
      over users: TP / (TP + FN).
    - `precision`: observations of somebody who is there, recognized right or not / all
      observations: TP / (TP + FP).
    - `recognized`: observations that name the user whom they are of / observations of users; one
      that names nobody counts as not recognized.
    - `confusion`: for each user, and for nobody (false positives), the shares of observations that
      name each user, or nobody (`unknown`); each sums to one.

    A number without anything to divide by is left out. Stored per period: looks, detections, false
    positives and identities, by robot and user.
    """

    unit: ClassVar[str] = "share"

    def start(self, home: "Home") -> None:
        """Begin counting."""
        self.looks: NDArray[np.int64] | None = None  # (robots, users, 2): in view, noticed
        self.taken: NDArray[np.int64]  # (robots, users + 1, users + 1): true, perceived
        self.names: tuple[tuple[str, ...], tuple[str, ...]] = ((), ())

    def update(self, history: History, state: "Present") -> Any:
        """Count looks and observations; return a row for each robot and user."""
        robots, users = len(state.robots), len(state.users)
        if self.looks is None:
            self.looks = np.zeros((robots, users, 2), np.int64)
            self.taken = np.zeros((robots, users + 1, users + 1), np.int64)
            self.names = state.robots, state.users
        seen = history.looks
        looks = np.zeros((robots, users, 2), np.int64)
        np.add.at(looks, seen.robot, np.stack([seen.in_view, seen.detected], axis=-1))
        observed = history.observations
        taken = np.zeros((robots, users + 1, users + 1), np.int64)
        # Whoever is not there, or not recognized, is -1: the last.
        np.add.at(taken, (observed.robot, history.truth.user, observed.user), 1)
        self.looks += looks
        self.taken += taken
        return self._rows(looks, taken)

    def _rows(self, looks: NDArray[np.int64], taken: NDArray[np.int64]) -> Any:
        """Return a row for each robot and user, last nobody: the false positives."""
        robots, users = self.names
        if not (robots and users):
            return None
        names = np.array([*users, NO_ONE], dtype=object)
        count = len(names)
        padded = np.concatenate([looks, np.zeros((len(robots), 1, 2), np.int64)], axis=1)
        right = np.diagonal(taken, axis1=1, axis2=2).copy()
        right[:, -1] = 0
        return {
            "robot": np.repeat(np.array(robots, dtype=object), count),
            "user": np.tile(names, len(robots)),
            "in_view": padded[..., 0].ravel(),
            "detected": padded[..., 1].ravel(),
            "observed": taken.sum(axis=2).ravel(),
            "recognized": right.ravel(),
            "unknown": taken[:, :, -1].ravel(),
        }

    def result(self) -> dict[str, Any]:
        """Return {robot: {precision, recall, recognized, confusion}}, each where it can be told."""
        if self.looks is None:
            return {}
        robots, users = self.names
        return {
            robot: self._summary(self.looks[r], self.taken[r], users)
            for r, robot in enumerate(robots)
        }

    def _summary(
        self, looks: NDArray[np.int64], taken: NDArray[np.int64], users: tuple[str, ...]
    ) -> dict[str, Any]:
        found: dict[str, Any] = {}
        real, total = int(taken[:-1].sum()), int(taken.sum())
        if total:
            found["precision"] = real / total
        if looks[:, 0].sum():
            found["recall"] = int(looks[:, 1].sum()) / int(looks[:, 0].sum())
        if real:
            found["recognized"] = int(np.trace(taken[:-1, :-1])) / real
        confusion = {
            true: {
                perceived: int(taken[t, p]) / int(taken[t].sum())
                for p, perceived in enumerate((*users, UNKNOWN))
                if taken[t, p]
            }
            for t, true in enumerate((*users, NO_ONE))
            if taken[t].sum()
        }
        if confusion:
            found["confusion"] = confusion
        return found

    @classmethod
    def summary(cls, result: Mapping[str, Any]) -> Mapping[str, Any]:
        """Return all but who is taken for whom."""
        return {
            robot: {key: value for key, value in numbers.items() if key != "confusion"}
            for robot, numbers in result.items()
        }
