"""Histories: what happened in a stretch of steps, as algorithms and metrics may know it."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from fleet2d.algorithms.evidence import Evidence
from fleet2d.algorithms.log import BodyPoses
from fleet2d.algorithms.log import Log as Log
from fleet2d.algorithms.observations import Looks, Observations, Truth, frozen
from fleet2d.errors import ComponentError
from fleet2d.interactions.answers import AnswerRecord, Wanted
from fleet2d.kernels import I32, I64, Bool
from fleet2d.runtime.events import Event


@dataclass(frozen=True)
class Readings:
    """Readings of sensors, in order of step; all arrays of one length.

    Attributes:
        step: int64 (n,), the step of each reading.
        sensor: int32 (n,), index of the sensor, in the order of the scenario.
        on: bool (n,), True where the sensor went on (or open), False where off (or shut).
    """

    step: I64
    sensor: I32
    on: Bool


@dataclass(frozen=True)
class History:
    """The steps since the last update of a component, `first` to `end` - 1.

    Attributes:
        first: First step.
        end: One past the last step.
        step_s: Length of a step [s].
        observations: What the robots perceived.
    """

    log: Log
    first: int
    end: int
    step_s: float
    visible: frozenset[str]  # names of the bodies whose poses the component may read
    oldest: int = 0  # the first step that is stored for components that look back
    needs: frozenset[str] = frozenset()  # `needs` of the component's class

    def between(self, first: int, end: int) -> "History":
        """Return the history of the steps from `first` to `end` - 1.

        The component's class declares by `looks_back` how far back that may be.

        Raises:
            ComponentError: These steps are no longer stored, or are yet to come.

        Example:
            >>> from datetime import timedelta
            >>> from fleet2d import Algorithm
            >>> class Sightings(Algorithm):
            ...     '''How often somebody was seen in the last day.'''
            ...     looks_back = timedelta(days=1)
            ...     def update(self, history, state):
            ...         day = history.between(max(0, history.end - 86400), history.end)
            ...         return {"sightings": len(day.observations.step)}
        """
        if not self.oldest <= first <= end <= self.end:
            raise ComponentError(
                f"the steps from {first} to {end} were requested, but only those from"
                f" {self.oldest} to {self.end} are stored: set looks_back in the class to how far"
                " back it looks"
            )
        return replace(self, first=first, end=end)

    def __len__(self) -> int:
        """Return the number of steps."""
        return self.end - self.first

    @cached_property
    def observations(self) -> Observations:
        """What the robots perceived."""
        return self.log.observations(self.first, self.end)

    @cached_property
    def readings(self) -> Readings:
        """The readings of sensors."""
        rows = [row for row in self.log.readings if self.first <= row.step < self.end]
        return Readings(
            frozen(np.array([row.step for row in rows], np.int64)),
            frozen(np.array([row.sensor for row in rows], np.int32)),
            frozen(np.array([row.on for row in rows], np.bool_)),
        )

    @cached_property
    def events(self) -> list[Event]:
        """The events of the visible bodies, in order of step; for algorithms those of robots."""
        events = self.log.events(self.first, self.end)
        return [event for event in events if event.entity in self.visible]

    @cached_property
    def truth(self) -> Truth:
        """The truth, row by row of the observations; for metrics only.

        Raises:
            ComponentError: The component is an algorithm.
        """
        self._check_metric("truth")
        return frozen(Truth.behind(self.observations))

    @cached_property
    def answers(self) -> list[AnswerRecord]:
        """How people answered robots, and what it made of them; for metrics only.

        Raises:
            ComponentError: The component is an algorithm.
        """
        self._check_metric("answers")
        return [record for record in self.log.answers if self.first <= record.step < self.end]

    @cached_property
    def wanted(self) -> list[Wanted]:
        """What robots wanted of people."""
        return [record for record in self.log.wanted if self.first <= record.step < self.end]

    @cached_property
    def looks(self) -> Looks:
        """How often each camera had a user in view, and how often it noticed; for metrics only.

        Raises:
            ComponentError: The component is an algorithm.
        """
        self._check_metric("looks")
        return frozen(self.log.looks(self.first, self.end))

    @cached_property
    def exposure(self) -> I64:
        """Cells of each room in view of each robot, summed over the steps: (robots, rooms).

        Divided by the room's number of cells and by the number of steps, it is the mean share of
        the room that was in view.

        Raises:
            ComponentError: The component's class has no needs = {"exposure"}.
        """
        self._check_needs("exposure")
        return frozen(self.log.exposure(self.first, self.end))

    @cached_property
    def evidence(self) -> Evidence:
        """What robots watched, and which users they perceived there, minute by minute.

        Raises:
            ComponentError: The component's class has no needs = {"evidence"}, or its period is no
                whole number of minutes.
        """
        self._check_needs("evidence")
        return self.log.evidence(self.first, self.end)

    def _check_needs(self, need: str) -> None:
        if need not in self.needs:
            raise ComponentError(
                f"{need} was requested, but is only computed for components that declare it: write"
                f" needs = {{{need!r}}} in the class of the component"
            )

    def _check_metric(self, need: str) -> None:
        if not self._sees_all:
            raise ComponentError(
                f"'{need}' is ground truth: algorithms can't read it, only metrics can"
            )

    def poses(self, name: str) -> BodyPoses:
        """Return the poses of a body. Algorithms may read those of robots, metrics also of users.

        For a robot with `localization`, algorithms get its believed poses, metrics the true ones.

        Raises:
            ComponentError: There is no such body, or it is a user and the component an algorithm.
        """
        if name not in self.visible:
            available = ", ".join(sorted(self.visible))
            reason = (
                "only metrics know where users are"
                if name in self.log.index
                else "there is no such body"
            )
            raise ComponentError(
                f"poses of {name!r} were requested, but {reason}; available: {available}"
            )
        return self.log.poses(name, self.first, self.end, true=self._sees_all)

    @cached_property
    def _sees_all(self) -> bool:
        """Whether it is the history of a metric, to which all bodies are visible."""
        return self.visible == frozenset(self.log.index)
