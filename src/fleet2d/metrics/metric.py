"""Metrics: components that measure a run. They know the truth, and no component reads them."""

from collections.abc import Mapping, Set
from datetime import timedelta
from typing import Any, ClassVar

from fleet2d.algorithms.algorithm import Present
from fleet2d.algorithms.history import History
from fleet2d.configuration.components import Component
from fleet2d.configuration.units import PositiveDuration
from fleet2d.floorplan.home.home import Home


class Metric(Component):
    """Base of metrics, which measure a run; a subclass writes `update` and `result`.

    Like an algorithm it is updated after every full `period`, or `on` events, also those of users;
    the return value of `update` is stored. Unlike an algorithm it may read the poses of users.

    Attributes:
        period: How often it is updated.
        on: Events that update it, instead of the period: those of the events table, and sensor.
    """

    kind: ClassVar[str] = "metric"
    # How far before its period it reads the history; timedelta.max: all of it.
    looks_back: ClassVar[timedelta] = timedelta(0)
    # What has to be computed for it: exposure, explored, first_seen, last_seen …
    needs: ClassVar[Set[str]] = frozenset()
    unit: ClassVar[str] = ""  # unit of its result, for readers
    units: ClassVar[Mapping[str, str]] = {}  # units of single numbers, by name, where they differ

    period: PositiveDuration = timedelta(days=1)

    on: tuple[str, ...] = ()

    def reads(self) -> tuple[str, ...]:
        """Return the names of the algorithms that it measures, which the scenario must have."""
        return ()

    def start(self, home: Home) -> None:
        """Prepare for a run."""

    def update(self, history: History, state: Present) -> Any:
        """Process the history since the last update; return rows to store, or None."""
        raise NotImplementedError

    def result(self) -> dict[str, Any]:
        """Return the numbers that summarize the run, for the manifest and the closing table."""
        return {}

    @classmethod
    def summary(cls, result: Mapping[str, Any]) -> Mapping[str, Any]:
        """Return the part of a result that the closing table shows; all of it by default."""
        return result
