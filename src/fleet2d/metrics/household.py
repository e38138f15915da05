"""What a household makes of its robots: company, disturbance, drives, searches, answers.

Its numbers are what learning agents are rewarded by (docs/how-to/gym.md), so bundled behaviors and
learned policies are measured alike. They are truth, which robots never read.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import timedelta
from math import dist
from typing import Any, NamedTuple

import numpy as np

from fleet2d.algorithms.algorithm import Present
from fleet2d.algorithms.history import BodyPoses, History
from fleet2d.floorplan.home import Home
from fleet2d.interactions.answers import ASLEEP, LOADS, PRIVATE_ROOMS, ActivityPart
from fleet2d.interactions.interaction import Outcome
from fleet2d.kernels import I64, Bool
from fleet2d.metrics.metric import Metric
from fleet2d.metrics.robots import BREAKS, ENDS
from fleet2d.runtime.clock import DAY_S, HOUR_S
from fleet2d.runtime.events import Event, EventKind

RESTS = timedelta(minutes=1)
"""A robot rests once it hasn't left its place for this long, turning or not."""
APART_M = 0.5
"""A rest farther than this from the one before is a relocation."""

MINUTE_S = 60

TERMS = {
    "near_min": "minutes for which it rests in the room of a person who has time for it",
    "disturbing_min": "minutes in the room of a person who sleeps, or is in a bedroom or bathroom",
    "relocations": "rests at another place than the one before",
    "finds": "searches that end with a person in view who is awake, outside bedrooms and bathrooms",
    "searching_min": "minutes of searching",
    "unvisited_h": "hours since it was last in each room, mean over rooms and time, times days",
    "value": "value of the requests that were accepted in time, in the unit of their worth",
    "bother": "prompts that were noticed, each times the probability that it was a bad time",
    "woken": "prompts that woke a person",
}
"""What is counted for each robot, and in which unit."""

SEARCH_ENDS = frozenset((*ENDS, *BREAKS))
"""What ends a search: its outcome, the next one, or going off."""


def has_time(activity: str) -> bool:
    """Return whether a person has time for a robot: the probability of it is a half or more.

    >>> [has_time(activity) for activity in ("dinner", "work_at_home", "sleep", "")]
    [True, False, False, True]
    """
    return ActivityPart().base >= LOADS.get(activity, 0.0)


class PersonStretch(NamedTuple):
    """A person in the steps of a history; all arrays bool (steps,), rooms int16 (steps,).

    Attributes:
        room: Index of the room; -1 out of rooms, and away.
        is_welcoming: Whether the person has time for a robot, outside bedrooms and bathrooms.
        is_left_alone: Whether the person sleeps, or is in a bedroom or bathroom.
        may_be_found: Whether the person is at home, and not to be left alone.
    """

    room: Any
    is_welcoming: Bool
    is_left_alone: Bool
    may_be_found: Bool


@dataclass
class RobotTrack:
    """What is known of a robot at the end of a history.

    Attributes:
        place: Where it was at the last step [m].
        still_steps: For how many steps it has been there.
        rest: Where it rested last [m]; None: nowhere yet.
        searches: Whether it searches for somebody.
        unvisited: For each room, the number of steps since it was there.
    """

    place: tuple[float, float]
    unvisited: I64
    still_steps: int = 0
    rest: tuple[float, float] | None = None
    searches: bool = False


class HouseholdReward(Metric):
    """What a household makes of each robot, from the beginning of the run.

    `TERMS` names the numbers and their units. A person *has time* who is at home, awake, outside
    bedrooms and bathrooms, and does something that leaves time for a robot with a probability of a
    half or more (`ActivityPart`); without a known activity, any person awake does. Near and
    disturbing minutes are summed over the people. Only resting counts as being near, as passing by
    is no company, but also passing disturbs.
    """

    units = {"near_min": "min", "disturbing_min": "min", "searching_min": "min"}
    least = {"": 0}

    def start(self, home: Home) -> None:
        """Begin counting."""
        self.totals: dict[str, dict[str, float]] = {}  # of each robot; durations in steps
        self.tracks: dict[str, RobotTrack] = {}
        self.activities: dict[str, str] = {}  # of each user at the end of the last history
        self.step_s = 1.0

    def update(self, history: History, state: Present) -> None:
        """Count the steps, events and answers of the history."""
        self.step_s = history.step_s
        rooms = state.home.rooms
        is_private = np.array([*(room.type in PRIVATE_ROOMS for room in rooms), False])
        people = {user: self._person(user, history, is_private) for user in state.users}
        for robot in state.robots:
            poses = history.poses(robot)
            if robot not in self.tracks:
                self.tracks[robot] = RobotTrack(poses.at(0), np.zeros(len(rooms), np.int64))
                self.totals[robot] = dict.fromkeys(TERMS, 0.0)
            track = self.tracks[robot]
            total = self.totals[robot]
            is_resting = _rest(track, poses, history.step_s, total)
            for person in people.values():
                is_together = (poses.room == person.room) & (person.room >= 0)
                total["near_min"] += int((is_together & person.is_welcoming & is_resting).sum())
                total["disturbing_min"] += int((is_together & person.is_left_alone).sum())
            total["unvisited_h"] += _unvisited(track, poses)
            mine = [event for event in history.events if event.entity == robot]
            _search(track, mine, people, history, total)
            for answer in history.answers:
                if answer.robot == robot and answer.outcome:
                    is_mistaken = answer.outcome == Outcome.MISTAKEN
                    total["value"] += answer.value * (answer.outcome == Outcome.ACCEPTED)
                    total["bother"] += 1 if is_mistaken else 1 - answer.willingness
                    total["woken"] += answer.woke

    def result(self) -> dict[str, Any]:
        """Return {robot: {term: total}}."""
        return {robot: self._in_units(robot) for robot in self.totals}

    def _in_units(self, robot: str) -> dict[str, float]:
        """Return the totals of a robot, in the units of `TERMS`."""
        numbers = {term: float(total) for term, total in self.totals[robot].items()}
        for term in ("near_min", "disturbing_min", "searching_min"):
            numbers[term] *= self.step_s / MINUTE_S
        rooms = max(len(self.tracks[robot].unvisited), 1)
        numbers["unvisited_h"] *= self.step_s**2 / HOUR_S / DAY_S / rooms
        return numbers

    def _person(self, user: str, history: History, is_private: Bool) -> PersonStretch:
        """Return how a person is in the steps of a history."""
        begins = [history.first]
        names = [self.activities.get(user, "")]
        for event in history.events:
            if event.entity == user and event.event == EventKind.ACTIVITY:
                begins.append(event.step)
                names.append(event.detail)
        self.activities[user] = names[-1]
        lasts = np.diff(begins, append=history.end)
        is_asleep = np.repeat(np.array([name in ASLEEP for name in names]), lasts)
        is_free = np.repeat(np.array([has_time(name) for name in names]), lasts)
        poses = history.poses(user)
        is_in_private = is_private[poses.room]
        at_home = ~poses.away
        is_left_alone = at_home & (is_asleep | is_in_private)
        may_be_found = at_home & ~is_left_alone
        return PersonStretch(poses.room, may_be_found & is_free, is_left_alone, may_be_found)


def _rest(track: RobotTrack, poses: BodyPoses, step_s: float, total: dict[str, float]) -> Bool:
    """Follow a robot's rests, and count relocations; return at which steps it rests."""
    xy = poses.xy
    has_moved = (np.diff(xy, axis=0, prepend=[track.place]) != 0).any(axis=1)
    index = np.arange(len(xy))
    last_move = np.maximum.accumulate(np.where(has_moved, index, -1))
    still = np.where(last_move < 0, track.still_steps + index, index - last_move)
    rest_steps = round(RESTS.total_seconds() / step_s)
    for begun in np.flatnonzero(still == rest_steps).tolist():
        place = poses.at(begun)
        if track.rest is None:
            track.rest = place
        elif dist(track.rest, place) > APART_M:
            total["relocations"] += 1
            track.rest = place
    track.place = poses.at(-1)
    track.still_steps = int(still[-1]) + 1
    is_resting: Bool = still >= rest_steps
    return is_resting


def _search(
    track: RobotTrack,
    events: Sequence[Event],
    people: dict[str, PersonStretch],
    history: History,
    total: dict[str, float],
) -> None:
    """Follow a robot's searches up to the last step."""
    since = history.first  # the searching before is counted
    for event in events:
        if event.event in SEARCH_ENDS and track.searches:
            track.searches = False
            total["searching_min"] += event.step - since
            at = event.step - history.first
            named = [people[event.detail]] if event.detail in people else people.values()
            is_welcome = any(bool(person.may_be_found[at]) for person in named)
            total["finds"] += event.event == EventKind.FOUND and is_welcome
        if event.event == EventKind.FIND_BEGINS:
            track.searches = True
            since = event.step
    if track.searches:
        total["searching_min"] += history.end - since


def _unvisited(track: RobotTrack, poses: BodyPoses) -> int:
    """Add up, over steps and rooms, the steps since a robot was in each room."""
    begin, end, rooms = poses.visits
    total = 0
    for room, past in enumerate(track.unvisited.tolist()):
        at = 0
        for visit in np.flatnonzero(rooms == room).tolist():
            total += _ages(past, int(begin[visit]) - at)
            at = int(end[visit])
            past = 0
        absent = len(poses) - at
        total += _ages(past, absent)
        track.unvisited[room] = past + absent
    return total


def _ages(past: int, steps: int) -> int:
    """Add up an age that grows by one at each of some steps, from one more than before.

    >>> _ages(10, 2)
    23
    """
    return steps * past + steps * (steps + 1) // 2
