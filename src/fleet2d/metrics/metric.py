"""The base of metrics, and what they share: pairs of robot and user, curves of survival."""

from collections.abc import Iterator, Mapping, Sequence, Set
from datetime import timedelta
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np

from fleet2d.algorithms.algorithm import Present
from fleet2d.algorithms.history import BodyPoses, History
from fleet2d.configuration.components import Component
from fleet2d.configuration.units import PositiveDuration
from fleet2d.floorplan.home import Home
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.kernels import F64, I64, Bool, pairs_in_sight
from fleet2d.runtime.determinism import sum_in_order

BetterValues = Mapping[str, Literal["higher", "lower"]]
"""Which of two values is better, by the name of the number, "" for all others."""


class Metric(Component):
    """Base of metrics, which measure a run; a subclass writes `update` and `result`.

    Like an algorithm it is updated after every full `period`, or `on` events, also those of users;
    the return value of `update` is stored. Unlike an algorithm it may read the poses of users.

    What readers and answers of studies need to know is declared by class attributes: `unit`, the
    range `least` to `largest`, and which values are `better`; see `docs/how-to/studies.md` for an
    example.

    Attributes:
        period: How often it is updated.
        on: Events that update it, instead of the period: those of the events table, and sensor.
    """

    kind = "metric"
    # How far before its period it reads the history; timedelta.max: all of it.
    looks_back: ClassVar[timedelta] = timedelta(0)
    # What has to be computed for it: exposure, explored, first_seen, last_seen …
    needs: ClassVar[Set[str]] = frozenset()
    unit: ClassVar[str] = ""  # unit of its result, for readers
    units: ClassVar[Mapping[str, str]] = {}  # units of single numbers, by name, where they differ
    # Limits of its numbers by name, "" for all others; those whose unit is a share are 0 to 1.
    least: ClassVar[Mapping[str, float]] = {}
    largest: ClassVar[Mapping[str, float]] = {}
    # Of the numbers that neither name nor "" names, no value is better.
    better: ClassVar[BetterValues] = {}
    hidden: ClassVar[Set[str]] = frozenset()  # numbers that the closing table leaves out

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
        """Return the part of a result that the closing table shows: by default all but `hidden`."""
        return _without(cls.hidden, result)


def _without(hidden: Set[str], result: Mapping[str, Any]) -> dict[str, Any]:
    """Return a result without the numbers of some names, however deep they are."""
    return {
        name: _without(hidden, value) if isinstance(value, Mapping) else value
        for name, value in result.items()
        if isinstance(value, Mapping) or name not in hidden
    }


def nested(numbers: Mapping[tuple[str, str], Any]) -> dict[str, Any]:
    """Return numbers of pairs, such as robots and users, as {robot: {user: numbers}}.

    >>> nested({("astro", "ana"): 1, ("astro", "ben"): 2})
    {'astro': {'ana': 1, 'ben': 2}}
    """
    results: dict[str, Any] = {}
    for (first, second), value in numbers.items():
        results.setdefault(first, {})[second] = value
    return results


def columns_of(names: Sequence[str], rows: Sequence[Sequence[Any]]) -> dict[str, Any] | None:
    """Return the rows of a table as columns; None without any.

    >>> columns_of(("user", "steps"), [("ana", 1), ("ben", 2)])
    {'user': array(['ana', 'ben'], dtype='<U3'), 'steps': array([1, 2])}
    """
    columns = map(np.array, zip(*rows, strict=True))
    return dict(zip(names, columns, strict=True)) if rows else None


# It stands between the parts of the name of a number.
SEPARATOR = " · "


def flat(result: Any, name: str = "") -> list[tuple[str, Any]]:
    """Return nested results of metrics as rows (name, value).

    >>> flat({"distance": {"ana": 334.25}})
    [('distance · ana', 334.25)]
    """
    if not isinstance(result, Mapping):
        return [(name, result)]
    return [
        row
        for key, value in result.items()
        for row in flat(value, f"{name}{SEPARATOR}{key}" if name else str(key))
    ]


class RobotUserPair(NamedTuple):
    """A robot and a user over some steps.

    Attributes:
        robot: The robot's name.
        user: The user's name.
        robot_poses: Poses of the robot.
        user_poses: Poses of the user.
    """

    robot: str
    user: str
    robot_poses: BodyPoses
    user_poses: BodyPoses

    @property
    def names(self) -> tuple[str, str]:
        """The names of the robot and the user."""
        return self.robot, self.user

    @property
    def at_home(self) -> Bool:
        """Whether both are at home at each step: bool (steps,)."""
        return ~(self.robot_poses.away | self.user_poses.away)

    @property
    def distance(self) -> F64:
        """Distance between the centres at each step [m]: float64 (steps,), infinite while away."""
        gap = self.robot_poses.xy - self.user_poses.xy
        return np.where(self.at_home, np.sqrt((gap * gap).sum(axis=1)), np.inf)


def pairs_of(history: History, state: Present) -> Iterator[RobotUserPair]:
    """Yield every robot with every user."""
    for robot in state.robots:
        for user in state.users:
            yield RobotUserPair(robot, user, history.poses(robot), history.poses(user))


def in_sight(plan: FloorPlan, pair: RobotUserPair, steps: I64) -> Bool:
    """Return whether no wall of the plan is between the two at each of some steps: bool (n,).

    Doors count as open, and furniture as too low to block the view.
    """
    robot_xy = plan.lattice.to_lattice(pair.robot_poses.xy[steps])
    user_xy = plan.lattice.to_lattice(pair.user_poses.xy[steps])
    places = np.concatenate([robot_xy, user_xy], axis=1)
    is_new = np.append(True, (places[1:] != places[:-1]).any(axis=1))[: len(places)]
    is_visible = pairs_in_sight(plan.sight_mesh, robot_xy[is_new], user_xy[is_new])
    return is_visible[np.cumsum(is_new) - 1]


def kaplan_meier(times: Sequence[float], happened: Sequence[bool]) -> list[tuple[float, float]]:
    """Return the survival curve: the share without an event by each time of an event.

    Kaplan and Meier, Journal of the American Statistical Association 53, 1958. A time censored at t
    counts as at risk up to and including t.

    Args:
        times: The duration of each observation.
        happened: Whether the event happened at its end; else the time is censored.

    Returns:
        (time, share) pairs, ascending: the share without an event up to and including the time.

    Example:
        >>> kaplan_meier([1.0, 2.0, 2.0, 5.0], [True, False, True, False])
        [(1.0, 0.75), (2.0, 0.5)]
    """
    share = 1.0
    curve = list[tuple[float, float]]()
    for time in sorted({t for t, h in zip(times, happened, strict=True) if h}):
        at_risk = sum(t >= time for t in times)
        events = sum(t == time and h for t, h in zip(times, happened, strict=True))
        share *= 1 - events / at_risk
        curve.append((time, share))
    return curve


def quantile(curve: Sequence[tuple[float, float]], share: float) -> float | None:
    """Return the first time by which the event has happened for a share; None if it never has.

    >>> quantile([(1.0, 0.75), (2.0, 0.5)], 0.5)
    2.0
    """
    return next((time for time, rest in curve if rest <= 1 - share + 1e-12), None)


def restricted_mean(curve: Sequence[tuple[float, float]], until: float) -> float:
    """Return the area under the curve up to a time: the mean of min(time, until).

    >>> restricted_mean([(1.0, 0.75), (2.0, 0.5)], 4.0)
    2.75
    """
    times = [0.0, *(min(time, until) for time, _ in curve), until]
    shares = [1.0, *(share for _, share in curve)]
    return sum_in_order((np.diff(times) * np.array(shares)).tolist())
