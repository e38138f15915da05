"""Metrics of robots toward people: how soon they find them, and how often they are in the way."""

from datetime import timedelta
from typing import Any, NamedTuple

import numpy as np
from pydantic import Field

from fleet2d.algorithms.algorithm import Present
from fleet2d.algorithms.history import History
from fleet2d.configuration.units import Length, PositiveDuration, Speed, micros
from fleet2d.floorplan.home import Home
from fleet2d.floorplan.lattice import LatticePoint
from fleet2d.floorplan.space import Space
from fleet2d.kernels import F64, I64, points_in_sight
from fleet2d.metrics.metric import (
    Metric,
    columns_of,
    in_sight,
    kaplan_meier,
    nested,
    pairs_of,
    quantile,
    restricted_mean,
)
from fleet2d.runtime.determinism import sum_in_order
from fleet2d.runtime.events import Event, EventKind
from fleet2d.sight.camera import DEFAULT_RANGE_M

ENDS = (EventKind.FOUND, EventKind.NOT_AT_HOME, EventKind.GAVE_UP)
BREAKS = (EventKind.FIND_BEGINS, EventKind.POWER_OFF)
"""What ends a search without an outcome: the next one, or going off."""


class ReachTime(Metric):
    """Seconds that a robot would drive to a user who called it, at evenly spaced times.

    Each user at home calls every robot at intervals of `every`, from the start of the run on. The
    time is the length of the shortest route of a body of `radius` to the free place nearest to the
    user, divided by `speed`, without turns and without people in the way; doors and furniture are
    as they are when the metric is updated. Calls without a route count as unreached only.

    Attributes:
        every: Time between two calls of a user.
        speed: Driving speed that is assumed [m/s].
        radius: The robot's radius [m].
    """

    hidden = frozenset({"calls"})
    unit = "s"
    units = {"calls": "calls", "unreached": "calls"}
    least = {"": 0}
    better = {"": "lower"}

    every: PositiveDuration = timedelta(minutes=10)
    speed: Speed = Field(default=0.6, gt=0)
    radius: Length = Field(default=0.15, gt=0, le=2)

    def start(self, home: Home) -> None:
        """Begin with no calls."""
        self.seconds: dict[tuple[str, str], list[float]] = {}
        self.unreached: dict[tuple[str, str], int] = {}

    def update(self, history: History, state: Present) -> Any:
        """Add the calls of each user at home."""
        step_us = round(history.step_s * 1e6)
        every = max(1, -(-micros(self.every) // step_us))
        calls = np.arange(-history.first % every, len(history), every)
        space = state.home.space(self.radius)
        lattice = state.home.plan.lattice
        for pair in pairs_of(history, state):
            key = pair.names
            seconds = self.seconds.setdefault(key, [])
            self.unreached.setdefault(key, 0)
            for i in calls[pair.at_home[calls]].tolist():
                start = lattice.point_at(pair.robot_poses.at(i))
                target = lattice.point_at(pair.user_poses.at(i))
                route = _route(space, space.part_near(*start), start, target)
                if route is None:
                    self.unreached[key] += 1
                else:
                    metres = float(_lengths(route).sum()) / lattice.units_per_m
                    seconds.append(metres / self.speed)

    def result(self) -> dict[str, Any]:
        """Return {robot: {user: {mean, p90, calls, unreached}}}.

        `mean` and `p90` are of the times that the robot would take [s]; p90 is interpolated
        linearly. `calls` is the number of calls, `unreached` that of those without a route.
        """
        results: dict[str, Any] = {}
        for (robot, user), seconds in self.seconds.items():
            numbers: dict[str, Any] = {"calls": len(seconds) + self.unreached[robot, user]}
            if seconds:
                numbers["mean"] = sum_in_order(seconds) / len(seconds)
                numbers["p90"] = float(np.quantile(seconds, 0.9))
            numbers["unreached"] = self.unreached[robot, user]
            results.setdefault(robot, {})[user] = numbers
        return results


def _route(space: Space, part: int, start: LatticePoint, target: LatticePoint) -> I64 | None:
    """Return the shortest route in a part of the space to its place nearest to the target."""
    goal = target if space.part_at(*target) == part else space.nearest(*target, part)
    return None if goal is None else space.route(start, goal)


def _lengths(route: I64) -> F64:
    legs = np.diff(route, axis=0)
    return np.sqrt((legs * legs).sum(axis=1).astype(np.float64))


class SearchRecord(NamedTuple):
    """A search for a user, a row of the table.

    Attributes:
        robot: Name of the robot.
        user: Name of the user.
        began: Step at which it began.
        seconds: Duration [s].
        end: Outcome: one of ENDS, `false` where the robot mistook another person for the user, or
            `open` during the search, or where it was broken off: by the next one, by going off, or
            by the end of the run.
        at_home: Whether the user was at home when it began.
        metres: During the search, the robot's total distance driven when it began; after it, the
            distance driven during the search [m].
        ideal: Length of the shortest route to a place from which the user is visible [m].
    """

    robot: str
    user: str
    began: int
    seconds: float
    end: str
    at_home: bool
    metres: float
    ideal: float


class TimeToFind(Metric):
    """Durations and outcomes of the searches of behavior `find` for a user, for each robot.

    A search lasts from its event `find_begins` to `found`, `not_at_home` or `gave_up`. It succeeds
    after that time T if it ends by `found`, and the user then is at home and no farther than
    `sight` from the robot, from centre to centre; else the find is false. A search that doesn't
    succeed is censored where it ends, or where the run ends: T is later than that.

    Of searches for users who were at home when they began:

    - `success`: searches that succeed with T <= `deadline` / all.
    - `median`, `p90`: the smallest t with S(t) <= 0.5, or 0.1 [s], where S(t) = P(T > t) is the
      estimate of Kaplan and Meier; left out where S stays above.
    - `mean`: restricted mean: the integral of S from 0 to `deadline`, which is E min(T, deadline)
      [s]. After the last end S stays constant.
    - `spl`: the mean of l / max(l, d), 0 for searches that don't succeed. Here d is the distance
      that the robot drove, and l the ideal distance: along the shortest path to the place of the
      user when the search began, until the user is within `sight` with no wall between [m].
    - `ratio`: sum of max(l, d) / sum of l, over searches that succeed: 1 is ideal.
    - `false`, `false_out`: number of searches that ended by a false find, and by `not_at_home`.

    Of searches for users who were out: `out_told`: searches that ended by `not_at_home` / all, and
    `out_mean`: their mean duration [s]. Searches for anyone aren't counted.

    Attributes:
        deadline: Longest search that counts as a success.
        sight: How far a robot recognizes somebody [m].
        radius: The robot's radius [m].
    """

    hidden = frozenset({"p90", "spl", "out_mean"})
    unit = "s"
    units = {
        "searches": "in all",
        **dict.fromkeys(("success", "spl", "out_told"), "share of searches"),
        "ratio": "times the way",
        **dict.fromkeys(("false", "false_out"), "searches"),
    }
    least = {"": 0}
    better = {
        **dict.fromkeys(("success", "spl", "out_told"), "higher"),
        **dict.fromkeys(("mean", "median", "p90", "ratio", "false", "false_out"), "lower"),
    }

    deadline: PositiveDuration = timedelta(minutes=10)
    sight: Length = Field(default=DEFAULT_RANGE_M[1], gt=0)
    radius: Length = Field(default=0.15, gt=0, le=2)

    def start(self, home: Home) -> None:
        """Begin without searches."""
        self.open: dict[str, SearchRecord] = {}
        self.done: dict[str, list[SearchRecord]] = {}
        self.driven: dict[str, float] = {}  # distance of each robot before the period [m]
        self.last: dict[str, tuple[float, float]] = {}
        self.end = 0
        self.step_s = 1.0

    def update(self, history: History, state: Present) -> Any:
        """Update the searches; return a row for each that ended."""
        ended: list[SearchRecord] = []
        for robot in state.robots:
            driven = self._driven(history, robot)
            for event in history.events:
                if event.entity != robot:
                    continue
                metres = float(driven[event.step - history.first])
                if event.event in (*ENDS, *BREAKS) and robot in self.open:
                    ended.append(self._end(history, event, metres))
                if event.event == EventKind.FIND_BEGINS and event.detail in state.users:
                    self.open[robot] = self._begin(history, state, event, metres)
            self.driven[robot] = float(driven[-1])
        for search in ended:
            self.done.setdefault(search.robot, []).append(search)
        self.end = history.end
        self.step_s = history.step_s
        return columns_of(SearchRecord._fields, ended)

    def _driven(self, history: History, robot: str) -> F64:
        """Return the distance driven by a robot up to each step of the period [m]."""
        xy = history.poses(robot).xy
        start = self.last.get(robot, tuple(xy[0].tolist()))
        moves = np.diff(xy, axis=0, prepend=[start])
        self.last[robot] = history.poses(robot).at(-1)
        lengths = np.sqrt((moves * moves).sum(axis=1))
        return self.driven.get(robot, 0.0) + np.cumsum(lengths)

    def _begin(self, history: History, state: Present, event: Event, metres: float) -> SearchRecord:
        i = event.step - history.first
        user = history.poses(event.detail)
        robot = event.entity
        at_home = not bool(user.away[i])
        ideal = 0.0
        if at_home:
            ideal = self._ideal(state.home, history.poses(robot).at(i), user.at(i))
        return SearchRecord(robot, event.detail, event.step, 0.0, "open", at_home, metres, ideal)

    def _end(self, history: History, event: Event, metres: float) -> SearchRecord:
        search = self.open.pop(event.entity)
        end = event.event if event.event in ENDS else search.end
        i = event.step - history.first
        user = history.poses(search.user)
        gap = np.array(history.poses(event.entity).at(i)) - user.at(i)
        is_too_far = float((gap * gap).sum()) > self.sight**2
        if end == EventKind.FOUND and (user.away[i] or is_too_far):
            end = "false"
        seconds = (event.step - search.began) * history.step_s
        return search._replace(metres=metres - search.metres, seconds=seconds, end=end)

    def _ideal(self, home: Home, robot: tuple[float, float], user: tuple[float, float]) -> float:
        """Return the shortest distance to drive until a robot could see a user [m]."""
        plan = home.plan
        space = home.space(self.radius)
        lattice = plan.lattice
        start = lattice.point_at(robot)
        target = lattice.point_at(user)
        part = space.part_at(*start)
        route = None if part < 0 else _route(space, part, start, target)
        if route is None:
            return 0.0
        legs = _lengths(route)
        total = float(legs.sum())
        along = np.append(0.0, np.cumsum(legs))
        at = np.append(np.arange(0.0, total, lattice.units_per_m / 10), total)
        points = np.stack([np.interp(at, along, route[:, k]) for k in (0, 1)], axis=1)
        points = np.rint(points).astype(np.int64)
        is_near = ((points - target) ** 2).sum(axis=1) <= (self.sight * lattice.units_per_m) ** 2
        is_visible = is_near & points_in_sight(plan.sight_mesh, target[0], target[1], points)
        first = int(np.argmax(is_visible)) if is_visible.any() else len(at) - 1
        return float(at[first]) / lattice.units_per_m

    def result(self) -> dict[str, Any]:
        """Return {robot: numbers}, without undefined ones."""
        searches = {robot: list(done) for robot, done in self.done.items()}
        for robot, search in self.open.items():
            cut = search._replace(seconds=(self.end - search.began) * self.step_s)
            searches.setdefault(robot, []).append(cut)
        return {robot: self._numbers(records) for robot, records in searches.items()}

    def _numbers(self, searches: list[SearchRecord]) -> dict[str, Any]:
        until = self.deadline.total_seconds()
        at_home = [s for s in searches if s.at_home]
        away = [s for s in searches if not s.at_home]
        numbers: dict[str, Any] = {
            "searches": len(searches),
            "false": sum(s.end == "false" for s in searches),
            "false_out": sum(s.end == EventKind.NOT_AT_HOME for s in at_home),
        }
        if at_home:
            finds = [s for s in at_home if s.end == EventKind.FOUND]
            curve = kaplan_meier(
                [s.seconds for s in at_home], [s.end == EventKind.FOUND for s in at_home]
            )
            in_time = [s for s in finds if s.seconds <= until]
            numbers["success"] = len(in_time) / len(at_home)
            numbers["mean"] = restricted_mean([c for c in curve if c[0] <= until], until)
            for name, share in (("median", 0.5), ("p90", 0.9)):
                if (time := quantile(curve, share)) is not None:
                    numbers[name] = time
            quality = [s.ideal / max(s.ideal, s.metres) if s.metres > 0 else 1.0 for s in finds]
            numbers["spl"] = sum_in_order(quality) / len(at_home)
            if sum_in_order(s.ideal for s in finds) > 0:
                most = sum_in_order(max(s.ideal, s.metres) for s in finds)
                numbers["ratio"] = most / sum_in_order(s.ideal for s in finds)
        if away:
            correct = [s for s in away if s.end == EventKind.NOT_AT_HOME]
            numbers["out_told"] = len(correct) / len(away)
            if correct:
                numbers["out_mean"] = sum_in_order(s.seconds for s in correct) / len(correct)
        return numbers


# Hall's zones, by the distance at which they end [m].
ZONES = {"intimate": 0.45, "personal": 1.2, "social": 3.6}


class Blocking(Metric):
    """How often, and for how long, a robot is in the way of a user who walks.

    A step counts when the user moves in it, and the centres are nearer than `clearance` at its
    begin or at its end: two bodies of the usual radii (0.2 and 0.15 m) would touch at 0.35 m. A
    block is an unbroken run of such steps; `blocks` counts blocks, and `seconds` is the duration of
    their steps. People walk as if there were no robot, so this is how often they would have had to
    change their path or stop. `asides`, for people who react to robots, is how often they stepped
    aside for it.

    Attributes:
        clearance: Distance between the centres [m].
    """

    unit = "a day"
    units = {"seconds": "s a day"}
    least = {"": 0}
    better = {"": "lower"}

    clearance: Length = Field(default=0.4, gt=0, le=3)

    def start(self, home: Home) -> None:
        """Begin counting."""
        self.counts: dict[tuple[str, str], dict[str, float]] = {}
        self.last: dict[tuple[str, str], tuple[tuple[float, float], bool, bool]] = {}
        self.days = 0.0

    def update(self, history: History, state: Present) -> Any:
        """Count the steps in which a user walks into a robot."""
        for pair in pairs_of(history, state):
            key = pair.names
            is_near = pair.distance < self.clearance
            xy = pair.user_poses.xy
            # A step leads from one pose to the next: the first from the last of the last period.
            start, was_near, was_blocked = self.last.get(
                key, (pair.user_poses.at(0), bool(is_near[0]), False)
            )
            moves = (np.diff(xy, axis=0, prepend=[start]) != 0).any(axis=1) & pair.at_home
            is_blocked = moves & (is_near | np.append(was_near, is_near[:-1]))
            begins = is_blocked & ~np.append(was_blocked, is_blocked[:-1])
            counts = self.counts.setdefault(key, {"blocks": 0, "seconds": 0.0, "asides": 0})
            counts["blocks"] += int(np.count_nonzero(begins))
            counts["seconds"] += int(np.count_nonzero(is_blocked)) * history.step_s
            self.last[key] = pair.user_poses.at(-1), bool(is_near[-1]), bool(is_blocked[-1])
        steps_aside = {f"steps aside for {robot}": robot for robot in state.robots}
        for event in history.events:
            if event.event == EventKind.REACTS and event.detail in steps_aside:
                met = self.counts.get((steps_aside[event.detail], event.entity))
                if met is not None:  # else a robot stepped aside, by a behavior of its own
                    met["asides"] += 1
        self.days += history.days

    def result(self) -> dict[str, Any]:
        """Return {robot: {user: {blocks, seconds, asides}}}, per day."""
        rates = {}
        for pair, counts in self.counts.items():
            rates[pair] = {name: value / self.days for name, value in counts.items()}
        return nested(rates)


class Intrusion(Metric):
    """Minutes a day that a robot is in each of Hall's zones of a user.

    Intimate: nearer than 0.45 m; personal: 0.45 to 1.2 m; social: 1.2 to 3.6 m, between the
    centres. Only steps count at which both are at home and no wall is between them. It is a proxy:
    how people feel about a robot depends on much else.
    """

    hidden = frozenset({"social"})
    unit = "min a day"
    least = {"": 0}
    better = {"": "lower"}

    def start(self, home: Home) -> None:
        """Begin counting."""
        self.minutes: dict[tuple[str, str], F64] = {}  # in each zone
        self.days = 0.0

    def update(self, history: History, state: Present) -> Any:
        """Count the steps in each zone; return a row for each robot and user."""
        rows = []
        for pair in pairs_of(history, state):
            distance = pair.distance
            key = pair.names
            near = np.flatnonzero(distance < max(ZONES.values()))
            near = near[in_sight(state.home.plan, pair, near)]
            counts, _ = np.histogram(distance[near], [0.0, *ZONES.values()])
            minutes = counts * history.step_s / 60
            self.minutes[key] = self.minutes.get(key, 0.0) + minutes
            rows.append((*key, *minutes.tolist()))
        self.days += history.days
        return columns_of(("robot", "user", *ZONES), rows)

    def result(self) -> dict[str, Any]:
        """Return {robot: {user: {zone: minutes a day}}}."""
        rates = {}
        for pair, minutes in self.minutes.items():
            rates[pair] = dict(zip(ZONES, (minutes / self.days).tolist(), strict=True))
        return nested(rates)
