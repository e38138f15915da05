"""Metrics: algorithms that only record. They know the truth, and nobody acts on what they say."""

from collections.abc import Mapping, Set
from datetime import timedelta
from typing import TYPE_CHECKING, Any, ClassVar

from pydantic import Field

from fleet2d.algorithms.history import History
from fleet2d.component import Component
from fleet2d.units import PositiveDuration

if TYPE_CHECKING:
    from fleet2d.algorithms.algorithm import Present
    from fleet2d.floorplan.home.home import Home


class Metric(Component):
    """Base of what measures a run; a subclass writes `update` and `result`.

    Like an algorithm it is updated after every full `period`, or `on` events, of users, too; what
    `update` returns is stored. Unlike one it may ask for the poses of users.
    """

    kind: ClassVar[str] = "metric"
    looks_back: ClassVar[timedelta] = timedelta(0)  # how far beyond its period; timedelta.max: all
    needs: ClassVar[Set[str]] = frozenset()  # of exposure, explored, first_seen, last_seen …
    unit: ClassVar[str] = ""  # of its result, for people to read
    units: ClassVar[Mapping[str, str]] = {}  # of single numbers by name, where theirs is another

    period: PositiveDuration = Field(
        default=timedelta(days=1), description="how often it is updated"
    )

    on: tuple[str, ...] = Field(
        default=(),
        description="events that update it, instead of the period: those of the events table, and"
        " sensor",
    )

    def reads(self) -> tuple[str, ...]:
        """Return the algorithms that it measures: a scenario without one of them is refused."""
        return ()

    def start(self, home: "Home") -> None:
        """Prepare for a run."""

    def update(self, history: History, state: "Present") -> Any:
        """Take in the history since the last update; return rows to store, or None."""
        raise NotImplementedError

    def result(self) -> dict[str, Any]:
        """Return the few numbers that sum up the run, for the manifest and the closing table."""
        return {}

    @classmethod
    def summary(cls, result: Mapping[str, Any]) -> Mapping[str, Any]:
        """Return what of a result the closing table shows: of many numbers, those that matter."""
        return result
