"""Algorithms: components that learn from the history of a run, with an output at each update."""

from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from fleet2d.algorithms.history import History
from fleet2d.algorithms.learned import check_shapes, run_state
from fleet2d.configuration.components import Component
from fleet2d.configuration.units import InputPath, PositiveDuration
from fleet2d.floorplan.home.home import Home
from fleet2d.runtime.determinism import Draws, stream_key


@dataclass(frozen=True)
class Present:
    """The state of a run when an algorithm or a metric is updated.

    Attributes:
        path: The component's path in the scenario, "algorithms.ltp".
        step: The present step; its history ends with it.
        time: Its local time.
        start: The local time of step 0.
        home: The home.
        users: Names of the users, in the order of their indices.
        robots: Names of the robots.
        outputs: The newest output of each algorithm updated before, by name.
    """

    path: str
    step: int
    time: datetime
    start: datetime
    home: Home
    users: tuple[str, ...]
    robots: tuple[str, ...]
    outputs: Mapping[str, Any]
    seed: int

    def random(self, purpose: str) -> Draws:
        """Return the random draws of this component for one purpose, at this step."""
        return Draws(np.uint64(stream_key(self.seed, self.path, purpose)), self.step)


class Algorithm(Component):
    """Base of algorithms, which compute outputs from the history; a subclass writes `update`.

    It is updated after every full `period`, with the history of exactly that period; or, with `on`,
    at the end of each step in which one of these events happens, with the history since the last
    update. What `update` returns (a RoomDistribution, or a mapping of names to numbers or arrays;
    None for nothing) is stored as rows of the algorithm's table, and all components read it from
    the next step on. Run state is set in `start`.

    Attributes:
        period: How often it is updated.
        on: Events that update it, instead of the period: user_seen, user_lost, sensor, or what a
            robot's plan notes.
        reads: Algorithms whose output it uses; they are updated before it.
        learned: Learned state to start from: a file of the folder learned/ of another run.

    Example:
        >>> import numpy as np
        >>> from fleet2d import Algorithm, RoomDistribution
        >>> class SightingShare(Algorithm):
        ...     '''Share of sightings per room.'''
        ...     def start(self, home):
        ...         self.counts = np.zeros(len(home.rooms))
        ...     def update(self, history, state):
        ...         rooms = history.observations.room
        ...         self.counts += np.bincount(rooms, minlength=len(self.counts))
        ...         return RoomDistribution(self.counts)
        >>> SightingShare(period="30 min").period.total_seconds()
        1800.0
    """

    kind: ClassVar[str] = "algorithm"
    # How far before its period it reads the history; timedelta.max: all of it.
    looks_back: ClassVar[timedelta] = timedelta(0)
    # What has to be computed for it: evidence, exposure, explored, first_seen, last_seen …
    needs: ClassVar[Set[str]] = frozenset()

    period: PositiveDuration = timedelta(hours=1)
    on: tuple[str, ...] = ()
    reads: tuple[str, ...] = ()

    learned: InputPath | None = None

    def start(self, home: Home) -> None:
        """Prepare for a run."""

    def remember(self) -> Mapping[str, Any]:
        """Return the learned state: arrays, numbers and texts, in mappings of any depth.

        By default that is all run state: the attributes that are not configuration.
        """
        return run_state(self)

    def recall(self, learned: Mapping[str, Any]) -> None:
        """Restore what `remember` returned in another run; called after `start`.

        Raises:
            ComponentError: It was learned in a home with other rooms.
        """
        check_shapes(run_state(self), learned, type(self).__name__)
        for name, value in learned.items():
            setattr(self, name, value)

    def check_learned(self, users: Sequence[str], start: datetime) -> None:
        """Refuse a state learned with other users; called after `recall`, before the run begins.

        Args:
            users: Names of the users of this run.
            start: Local time of step 0.

        Raises:
            ComponentError: The learned state doesn't fit.
        """

    def files(self) -> list[Path]:
        """Return the files that it reads: the run stores their digests, to be reproducible."""
        return [] if self.learned is None else [self.learned]

    def update(self, history: History, state: Present) -> Any:
        """Process the history since the last update; return the output, or None."""
        raise NotImplementedError
