"""Metrics of bodies: how far robots drive on what charge, where users stay, and with whom."""

from collections.abc import Mapping
from datetime import timedelta
from itertools import pairwise
from math import dist
from typing import Any, get_args

import numpy as np
from pydantic import Field

from fleet2d.algorithms.algorithm import Present
from fleet2d.algorithms.history import History
from fleet2d.algorithms.presence.belief import AWAY
from fleet2d.configuration.units import Length, PositiveDuration
from fleet2d.entities.power import PowerState
from fleet2d.floorplan.home import Home
from fleet2d.metrics.metric import Metric, nested, pairs_of
from fleet2d.runtime.clock import DAY_S
from fleet2d.runtime.events import EventKind

RestPlace = tuple[float, float]

# The number of places per user in the closing table.
MAX_PLACES = 4


class Distance(Metric):
    """Metres that each body covers per day, as the sum of its moves from step to step.

    The way through stairs or a lift doesn't count; that to where an intervention puts a body does.
    """

    unit = "m a day"
    least = {"": 0}

    def start(self, home: Home) -> None:
        """Begin counting."""
        self.metres: dict[str, float] = {}
        self.last: dict[str, tuple[float, float]] = {}
        self.days = 0.0

    def update(self, history: History, state: Present) -> Any:
        """Add up the moves."""
        for name in (*state.users, *state.robots):
            poses = history.poses(name)
            between = poses.distance_from(self.last[name]) if name in self.last else 0.0
            self.metres[name] = self.metres.get(name, 0.0) + between + poses.distance
            self.last[name] = poses.at(-1)
        self.days += history.days

    def result(self) -> dict[str, Any]:
        """Return {name: metres per day}."""
        return {name: metres / self.days for name, metres in self.metres.items() if self.days}


class Travel(Metric):
    """Relocations and metres a day, of each robot.

    A robot rests where its position doesn't change for `rest` or longer, turning or not. A
    relocation is a rest more than `apart` away from the previous rest. Metres are the sum of the
    moves from step to step. What an intervention moves counts as if the robot had driven.

    Attributes:
        rest: Shortest time at one place that is a rest.
        apart: Distance between two places of rest [m].
    """

    units = {"relocations": "a day", "metres": "m a day"}
    least = {"": 0}

    rest: PositiveDuration = timedelta(minutes=1)
    apart: Length = Field(default=0.5, ge=0)

    def start(self, home: Home) -> None:
        """Begin counting."""
        self.metres: dict[str, float] = {}
        self.relocations: dict[str, int] = {}
        self.last_rest: dict[str, RestPlace] = {}  # place of the last rest
        self.standing: dict[str, tuple[RestPlace, int]] = {}  # place, and for how many steps
        self.days = 0.0

    def update(self, history: History, state: Present) -> Any:
        """Add up moves and rests."""
        rest_steps = self.rest.total_seconds() / history.step_s
        for robot in state.robots:
            poses = history.poses(robot)
            standing = self.standing.get(robot, (poses.at(0), 0))
            between = poses.distance_from(standing[0])
            self.metres[robot] = self.metres.get(robot, 0.0) + between + poses.distance
            self.relocations.setdefault(robot, 0)
            changes = np.flatnonzero((np.diff(poses.xy, axis=0) != 0).any(axis=1)) + 1
            for begin, end in pairwise([0, *changes.tolist(), len(history)]):
                place = poses.at(begin)
                steps = end - begin
                standing = place, steps + (standing[1] if standing[0] == place else 0)
                if standing[1] >= rest_steps:
                    last = self.last_rest.setdefault(robot, place)
                    if dist(last, place) > self.apart:
                        self.relocations[robot] += 1
                        self.last_rest[robot] = place
            self.standing[robot] = standing
        self.days += history.days

    def result(self) -> dict[str, Any]:
        """Return {robot: {relocations, metres}}, both per day."""
        return {
            robot: {"relocations": count / self.days, "metres": self.metres[robot] / self.days}
            for robot, count in self.relocations.items()
        }


CHARGE_ENDS = (EventKind.CHARGED, EventKind.POWER_OFF)


class BatteryUse(Metric):
    """Lowest charge, dockings a day, and shares of time charging and empty, of each robot.

    From the events `battery`, `docks` and `charged`. `lowest` is the lowest charge in these events:
    they happen at decisions, after a change of 5 %, when the robot docks, and when it is empty.
    `dockings` counts `docks`. `charging` is the share of the run's steps from a `docks` to the
    `charged` after it, to where it goes off, or to the end of the run; a robot at its charger
    charges at other times, too. `empty` is the share of steps with an empty battery, until a script
    charges it again.
    """

    unit = "share of time"
    units = {"lowest": "share of a full charge", "dockings": "a day"}
    least = {"": 0}

    def start(self, home: Home) -> None:
        """Begin counting."""
        self.lowest: dict[str, float] = {}
        self.dockings: dict[str, int] = {}
        self.docked_at: dict[str, int] = {}
        self.charging: dict[str, int] = {}  # steps
        self.empty_at: dict[str, int] = {}
        self.empty: dict[str, int] = {}  # steps, up to the last charge
        self.steps = 0
        self.step_s = 1.0

    def update(self, history: History, state: Present) -> Any:
        """Read the events."""
        for event in history.events:
            name = event.entity
            if event.event in (EventKind.BATTERY, EventKind.DOCKS, EventKind.CHARGED):
                level = float(event.detail.removesuffix(" %")) / 100
                self.lowest[name] = min(self.lowest.get(name, 1.0), level)
                if event.event == EventKind.BATTERY and level == 0:
                    self.empty_at.setdefault(name, event.step)
                elif name in self.empty_at:
                    steps = event.step - self.empty_at.pop(name)
                    self.empty[name] = self.empty.get(name, 0) + steps
            if event.event == EventKind.DOCKS:
                self.dockings[name] = self.dockings.get(name, 0) + 1
                self.docked_at.setdefault(name, event.step)
            elif event.event in CHARGE_ENDS and name in self.docked_at:
                steps = event.step - self.docked_at.pop(name)
                self.charging[name] = self.charging.get(name, 0) + steps
        self.steps = history.end
        self.step_s = history.step_s

    def result(self) -> dict[str, Any]:
        """Return {robot: {lowest, dockings, charging, empty}}."""
        numbers = {}
        for name, lowest in self.lowest.items():
            present = self.steps - self.docked_at[name] if name in self.docked_at else 0
            empty = self.empty.get(name, 0) + self.steps - self.empty_at.get(name, self.steps)
            numbers[name] = {
                "lowest": lowest,
                "dockings": self.dockings.get(name, 0) / (self.steps * self.step_s / DAY_S),
                "charging": (self.charging.get(name, 0) + present) / self.steps,
                "empty": empty / self.steps,
            }
        return numbers


class Uptime(Metric):
    """Share of time that each robot is on, how often a day it is off and why, and for how long.

    From the events `power_off` and `power_on`: while it is off, a robot sees and does nothing, so
    what other metrics say of its time with people includes that time. `longest` is the longest time
    off [s]; `off`, `crash`, `update` and `empty` count how often a day each of them happens.
    """

    unit = "a day"
    units = {"on": "share of time", "longest": "s"}
    least = {"": 0}
    better = {"on": "higher", "longest": "lower"}

    def start(self, home: Home) -> None:
        """Begin counting."""
        self.times: dict[str, dict[str, int]] = {}  # by robot and reason
        self.off_at: dict[str, int] = {}
        self.steps_off: dict[str, list[int]] = {}
        self.end = 0
        self.days = 0.0
        self.step_s = 1.0

    def update(self, history: History, state: Present) -> Any:
        """Read the events; return the share of the period in which each robot was on."""
        off = dict.fromkeys(state.robots, 0)
        reasons = [reason for reason in get_args(PowerState) if reason != "on"]
        for robot in state.robots:
            self.times.setdefault(robot, dict.fromkeys(reasons, 0))
            self.steps_off.setdefault(robot, [])
        for event in history.events:
            name = event.entity
            if event.event == EventKind.POWER_OFF:
                self.times[name][event.detail] += 1
                self.off_at[name] = event.step
            elif event.event == EventKind.POWER_ON:
                began = self.off_at.pop(name)
                self.steps_off[name].append(event.step - began)
                off[name] += event.step - max(began, history.first)
        for name, began in self.off_at.items():
            off[name] += history.end - max(began, history.first)
        self.end = history.end
        self.days += history.days
        self.step_s = history.step_s
        shares = [1 - steps / len(history) for steps in off.values()]
        return {"robot": np.array(list(off), dtype=object), "on": np.array(shares)}

    def result(self) -> dict[str, Any]:
        """Return {robot: {on, longest, and how often a day for each reason}}."""
        numbers: dict[str, Any] = {}
        for name, times in self.times.items():
            still_off = [self.end - self.off_at[name]] if name in self.off_at else []
            steps = [*self.steps_off[name], *still_off]
            numbers[name] = {"on": 1 - sum(steps) / self.end}
            numbers[name]["longest"] = max(steps, default=0) * self.step_s
            numbers[name] |= {reason: count / self.days for reason, count in times.items()}
        return numbers


class RoomShare(Metric):
    """Share of time that each user spends in each room, and away.

    Stored per period; the result is over the whole run. Shares of a user sum to one.
    """

    unit = "share of time"

    def start(self, home: Home) -> None:
        """Begin counting."""
        self.names = [*(room.name for room in home.rooms), AWAY]
        self.seconds: dict[str, Any] = {}

    def update(self, history: History, state: Present) -> Any:
        """Count the steps per room."""
        shares = []
        for user in state.users:
            steps = history.poses(user).time_in_rooms
            self.seconds[user] = self.seconds.get(user, 0) + steps
            shares.append(steps / steps.sum())
        if not shares:
            return None
        return {
            "user": np.repeat(state.users, len(self.names)),
            "room": np.tile(self.names, len(shares)),
            "share": np.concatenate(shares),
        }

    def result(self) -> dict[str, Any]:
        """Return {user: {room: share}} of all rooms, and away."""
        result = {}
        for user, steps in self.seconds.items():
            shares = (steps / steps.sum()).tolist()
            result[user] = dict(zip(self.names, shares, strict=True))
        return result

    @classmethod
    def summary(cls, result: Mapping[str, Any]) -> Mapping[str, Any]:
        """Return the places where each user is most of the time, the longest first."""
        places = {}
        for user, shares in result.items():
            most = sorted(shares.items(), key=lambda item: -item[1])[:MAX_PLACES]
            places[user] = {room: share for room, share in most if share}
        return places


class Stays(Metric):
    """Where each user truly is: a row for each stay in a room, or away.

    Columns: `user`; `place`, the name of the room, or away; `begin` and `end`, the first step of
    the stay and one past the last. A stay that goes on at the end of a period continues in the row
    of the next one.
    """

    def start(self, home: Home) -> None:
        """Keep the names of rooms."""
        self.places = np.array([*(room.name for room in home.rooms), AWAY], object)

    def update(self, history: History, state: Present) -> Any:
        """Return the stays of the period."""
        visits = [history.poses(user).visits for user in state.users]
        if not visits:
            return None
        counts = [len(room) for *_, room in visits]
        begin, end, room = (np.concatenate(columns) for columns in zip(*visits, strict=True))
        return {
            "user": np.repeat(np.array(state.users, object), counts),
            "place": self.places[room],  # NOWHERE is the last
            "begin": history.first + begin,
            "end": history.first + end,
        }


class CoPresence(Metric):
    """Share of a user's steps at home in which a robot is in the same room.

    For each robot and user: steps at which both are in the same room, divided by the steps at which
    the user is at home. Between two rooms, where no room is, they don't count as together.
    """

    unit = "share of time at home"

    def start(self, home: Home) -> None:
        """Begin counting."""
        self.steps: dict[tuple[str, str], list[int]] = {}  # together, at home

    def update(self, history: History, state: Present) -> Any:
        """Count the steps together."""
        for pair in pairs_of(history, state):
            counts = self.steps.setdefault(pair.names, [0, 0])
            counts[0] += pair.user_poses.steps_together(pair.robot_poses)
            counts[1] += pair.user_poses.steps_at_home

    def result(self) -> dict[str, Any]:
        """Return {robot: {user: share}}, without users who were never at home."""
        steps = self.steps.items()
        return nested({pair: together / home for pair, (together, home) in steps if home})
