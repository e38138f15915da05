"""Metrics of sightings: how much of the home robots observe, whom they see, and mistake."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from fleet2d.algorithms.algorithm import Present
from fleet2d.algorithms.history import History
from fleet2d.floorplan.home import Home
from fleet2d.kernels import I64, UNKNOWN_TRUTH, list_sightings
from fleet2d.metrics.metric import Metric
from fleet2d.runtime.clock import HOUR_S

UNKNOWN = "unknown"  # name in the confusion of a person not recognized
NO_ONE = "nobody"  # name in the confusion of false positives
SHARES = {"half": 0.5, "most": 0.9}


class Sightings(Metric):
    """Share of a user's steps at home at which at least one robot perceives the user.

    Detections of a real robot count while the user is known to be at home.
    """

    unit = "share of time at home"
    better = {"": "higher"}

    def start(self, home: Home) -> None:
        """Begin counting."""
        self.steps: dict[str, list[int]] = {}  # seen, at home

    def update(self, history: History, state: Present) -> Any:
        """Count detections by step."""
        observations = history.observations
        seen = observations.placed_in(None)
        seen = seen._replace(step=seen.step - history.first)
        users = len(state.users)
        rows, _, _, steps = list_sightings(*seen, len(history), 1, users + 1, 1)
        steps_seen = dict(zip(rows.tolist(), steps.tolist(), strict=True))
        for row, user in enumerate(state.users):
            in_view = steps_seen.get(row, 0)
            if user in history.log.untracked and in_view:
                at = np.unique(observations.step[observations.user == row]) - history.first
                in_view = int((~history.poses(user).away[at]).sum())
            counts = self.steps.setdefault(user, [0, 0])
            counts[0] += in_view
            counts[1] += int(history.poses(user).time_in_rooms[:-1].sum())

    def result(self) -> dict[str, Any]:
        """Return {user: share}, without users who were never at home."""
        return {user: seen / at_home for user, (seen, at_home) in self.steps.items() if at_home}


class Detections(Metric):
    """Precision, recall and identity confusion of each robot, over all its cameras.

    A look is one image of one camera, at one step; a user is in view if the camera's geometry shows
    the user, regardless of its perception.

    - `recall`: looks in which a user in view was noticed / looks with that user in view, summed
      over users: TP / (TP + FN).
    - `precision`: observations of somebody who is there, recognized correctly or not / all
      observations: TP / (TP + FP).
    - `recognized`: observations with the correct user / observations of users; an observation of
      nobody known counts as not recognized.
    - `confusion`: for each user, and for nobody (false positives), the shares of observations
      recognized as each user, or as nobody (`unknown`), zeros too; each sums to one.

    A ratio whose denominator is 0 is left out. Observations of a real robot, whose truth nobody
    knows, count in none of them: `unknown_truth` is their number. Stored per period: looks,
    detections, false positives and identities, by robot and user.
    """

    unit = "share"
    units = {"unknown_truth": "observations"}
    better = dict.fromkeys(("recall", "precision", "recognized"), "higher")

    def start(self, home: Home) -> None:
        """Begin counting."""
        nothing = np.zeros((), np.int64)
        self.looks = nothing  # (robots, users, 2): in view, noticed
        self.confusion = nothing  # (robots, users + 1, users + 1): true, perceived
        self.unknown = nothing  # (robots,): observations whose truth nobody knows
        self.names: tuple[tuple[str, ...], tuple[str, ...]] = ((), ())

    def update(self, history: History, state: Present) -> Any:
        """Count looks and observations; return a row for each robot and user."""
        robots = len(state.robots)
        users = len(state.users)
        self.names = state.robots, state.users
        counts = history.looks
        observations = history.observations
        looks = np.zeros((robots, users, 2), np.int64)
        np.add.at(looks, counts.robot, np.stack([counts.in_view, counts.detected], axis=-1))
        confusion = np.zeros((robots, users + 1, users + 1), np.int64)
        # A false positive, or a person not recognized, is -1: the last entry.
        true = history.truth.user
        known = true != UNKNOWN_TRUTH
        np.add.at(confusion, (observations.robot[known], true[known], observations.user[known]), 1)
        self.unknown = self.unknown + np.bincount(observations.robot[~known], minlength=robots)
        self.looks = self.looks + looks
        self.confusion = self.confusion + confusion
        return self._rows(looks, confusion)

    def _rows(self, looks: I64, confusion: I64) -> Any:
        """Return a row for each robot and user, and last for nobody: the false positives."""
        robots, users = self.names
        if not (robots and users):
            return None
        names = np.array([*users, NO_ONE], dtype=object)
        count = len(names)
        padded = np.pad(looks, ((0, 0), (0, 1), (0, 0)))
        correct = np.diagonal(confusion, axis1=1, axis2=2).copy()
        correct[:, -1] = 0
        return {
            "robot": np.repeat(np.array(robots, dtype=object), count),
            "user": np.tile(names, len(robots)),
            "in_view": padded[..., 0].ravel(),
            "detected": padded[..., 1].ravel(),
            "observed": confusion.sum(axis=2).ravel(),
            "recognized": correct.ravel(),
            "unknown": confusion[:, :, -1].ravel(),
        }

    def result(self) -> dict[str, Any]:
        """Return {robot: {precision, recall, recognized, confusion}}, without undefined ratios."""
        return {robot: self._numbers(r) for r, robot in enumerate(self.names[0])}

    def _numbers(self, robot: int) -> dict[str, Any]:
        looks = self.looks[robot]
        counts = self.confusion[robot]
        users = self.names[1]
        real = counts[:-1].sum()
        ratios = {
            "precision": (real, counts.sum()),
            "recall": (looks[:, 1].sum(), looks[:, 0].sum()),
            "recognized": (np.trace(counts[:-1, :-1]), real),
        }
        numbers: dict[str, Any] = {
            name: int(part) / int(whole) for name, (part, whole) in ratios.items() if whole
        }
        confusion = {}
        for true, row in zip((*users, NO_ONE), counts.tolist(), strict=True):
            perceived = zip((*users, UNKNOWN), row, strict=True)
            if any(row):
                confusion[true] = {name: count / sum(row) for name, count in perceived}
        if confusion:
            numbers["confusion"] = confusion
        if self.unknown[robot]:
            numbers["unknown_truth"] = int(self.unknown[robot])
        return numbers

    @classmethod
    def summary(cls, result: Mapping[str, Any]) -> Mapping[str, Any]:
        """Return all numbers but the confusion of identities."""
        summary = {}
        for robot, numbers in result.items():
            summary[robot] = {name: each for name, each in numbers.items() if name != "confusion"}
        return summary


class Coverage(Metric):
    """Share of the floor of all rooms that was in view of a robot, and times to half and 90 %.

    `share`: the cells of rooms that were in view at some step, as in the layer `first_seen`,
    divided by all cells of rooms, with furniture or without. `half_h`, `most_h`: hours from the
    start of the run to the step at which half, and 90 %, of these cells had been in view; left out
    if that never happened.
    """

    needs = frozenset({"first_seen"})
    unit = "h"
    units = {"share": "share of the floor"}
    least = {"": 0}
    better = {"share": "higher"}

    def start(self, home: Home) -> None:
        """Begin without any cells seen."""
        self.first: dict[str, Any] = {}  # sorted first steps of the cells seen, by robot
        self.cells = int(np.count_nonzero(home.plan.room_of_cell >= 0))
        self.step_s = 0.0

    def update(self, history: History, state: Present) -> Any:
        """Read the layers of first steps; return a row for each robot."""
        self.step_s = history.step_s
        inside = state.home.plan.room_of_cell >= 0
        for robot in state.robots:
            layer = f"first_seen.{robot}"
            if layer in state.home.layers:
                first = state.home.layers[layer].values[inside]
                self.first[robot] = np.sort(first[(first >= 0) & (first < history.end)])
        if not self.first:
            return None
        shares = [len(first) / self.cells for first in self.first.values()]
        return {"robot": np.array(list(self.first), dtype=object), "share": np.array(shares)}

    def result(self) -> dict[str, Any]:
        """Return {robot: {share, half_h, most_h}}, hours only where the share was reached."""
        numbers: dict[str, Any] = {}
        for robot, first in self.first.items():
            numbers[robot] = {"share": len(first) / self.cells}
            for name, share in SHARES.items():
                needed = int(np.ceil(share * self.cells))
                if 0 < needed <= len(first):
                    numbers[robot][f"{name}_h"] = int(first[needed - 1]) * self.step_s / HOUR_S
        return numbers
