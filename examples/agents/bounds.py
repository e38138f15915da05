"""What nobody can beat: bounds of each task's reward in one life, by who knows all of it.

People don't react to a robot, so where they are and what they do follows from a life in which the
robot only rests. Each bound leaves out something that costs, so no policy's expected reward exceeds
it; `docs/how-to/gym.md` says what. For the task hangout there is also a plan that keeps to the
rules.
"""

from collections.abc import Callable
from datetime import timedelta
from itertools import pairwise, takewhile
from typing import Any, NamedTuple

import numpy as np

from fleet2d.interactions.answers import (
    ASLEEP,
    HALF_WORTH,
    KIND_LOGITS,
    LOADS,
    PRIVATE_ROOMS,
    Answers,
)
from fleet2d.interactions.attitude import GAINS, HABIT_FORMS
from fleet2d.learning.gym import RobotEnv
from fleet2d.metrics.household import APART_M, RESTS, has_time
from fleet2d.metrics.household import TERMS as TERMS
from fleet2d.runs.run import Run
from fleet2d.runtime.determinism import logistic

SECOND = timedelta(seconds=1)
DAY = timedelta(days=1)
DAY_S = 86400
# Places nearer than this to each other count as the same in bounds: twice what a relocation needs.
SAME_M = 2 * APART_M


class Person(NamedTuple):
    """A person at each step of a life; arrays of one length.

    Attributes:
        room: Index of the room, -1 for none.
        begins: The steps at which activities begin.
        activities: The activities.
        has_time: Whether the person has time for a robot, outside bedrooms and bathrooms.
        left_alone: Whether the person sleeps, or is in a bedroom or bathroom.
        may_be_found: Whether the person is at home, and not to be left alone.
        away: Whether the person is out.
    """

    room: Any
    begins: list[int]
    activities: list[str]
    has_time: Any
    left_alone: Any
    may_be_found: Any
    away: Any


def rested_life(env: RobotEnv, **options: Any) -> Run:
    """Return a life, by the options of `RobotEnv.reset`, in which the robot only rests."""
    _, info = env.reset(options=options)
    is_over = False
    while not is_over:
        _, _, terminated, truncated, info = env.step(len(info["action_mask"]) - 1)
        is_over = terminated or truncated
    return env.run()


def person_of(life: Run, name: str) -> Person:
    """Return what a person does in a life with steps of a second."""
    path = life.path(name, every=SECOND)
    rows = [row for row in life.arrow("events").to_pylist() if row["entity"] == name]
    doing = [row for row in rows if row["event"] == "activity"]
    begins = [0, *(row["step"] for row in doing)]
    activities = ["", *(row["detail"] for row in doing)]
    lasts = np.diff(begins, append=len(path.step))
    sleeps = np.repeat([activity in ASLEEP for activity in activities], lasts)
    is_free = np.repeat([has_time(activity) for activity in activities], lasts)
    private = np.array([*(room.type in PRIVATE_ROOMS for room in life.plan.rooms), False])
    at_home = ~path.away
    left_alone = at_home & (sleeps | private[path.room])
    may_be_found = at_home & ~left_alone
    return Person(
        room=path.room,
        begins=begins,
        activities=activities,
        has_time=may_be_found & is_free,
        left_alone=left_alone,
        may_be_found=may_be_found,
        away=path.away,
    )


# Hangout


class Stations(NamedTuple):
    """Where a robot waits: the place at which it starts, and one in each room that it can enter.

    Attributes:
        room: Index of the room of each, int64 (stations,); the start is the first.
        least_s: Steps of the shortest thinkable way between each two, int64 (stations, stations).
        usual_s: Those that a way takes by the robot's own estimate.
        apart: Whether a move between them surely is a relocation.
        period_s: How long it waits.
    """

    room: Any
    least_s: Any
    usual_s: Any
    apart: Any
    period_s: int


def stations_of(env: RobotEnv) -> Stations:
    """Return the stations of the robot in a new life."""
    actor: Any = env.present.actor(env.robot)
    policy: Any = env.present.policy(env.robot)
    points = np.array([actor.state.position, *policy.poses.points.tolist()])
    rooms = actor.home.plan.rooms
    start_room = actor.home.plan.room_of_point(*actor.state.position)
    gaps = np.sqrt(((points[:, None] - points[None]) ** 2).sum(axis=2))
    metres = gaps / actor.home.plan.lattice.units_per_m
    walked = np.array([actor.space.distances(tuple(p), points) for p in points.tolist()])
    assert len(rooms) > int(policy.poses.index.max())
    return Stations(
        room=np.array([-1 if start_room is None else start_room.index, *policy.poses.index]),
        least_s=np.ceil(gaps / actor.speed).astype(np.int64),
        usual_s=np.ceil(actor.seconds(walked)).astype(np.int64),
        apart=metres > SAME_M,
        period_s=round(policy.period.total_seconds()),
    )


def counted(people: list[Person], stations: Stations, what: str) -> Any:
    """Return for how many steps before each something holds in each station's room.

    int64 (stations, steps + 1), summed over the people.
    """
    steps = len(people[0].room)
    sums = np.zeros((len(stations.room), steps + 1), np.int64)
    for person in people:
        here = (stations.room[:, None] == person.room) & getattr(person, what)
        sums[:, 1:] += np.cumsum(here, axis=1)
    return sums


def hangout_bound(people: list[Person], stations: Stations, weights: dict[str, float]) -> float:
    """Return a bound of the reward of waiting: by dynamic programming over stations and seconds.

    The robot drives straight at full speed, may leave at any second once it has waited a period,
    and disturbs nobody.
    """
    near = counted(people, stations, "has_time") / 60 * weights["near_min"]
    count, steps = len(stations.room), near.shape[1] - 1
    rest_s = round(RESTS.total_seconds())
    price = -weights["relocations"] * stations.apart
    price[0] = 0.0  # to leave its start before it has rested there is no relocation
    best = np.zeros((count, steps + stations.period_s + int(stations.least_s.max()) + 1))
    for end in range(steps, 0, -stations.period_s):
        begin = max(0, end - stations.period_s)
        times = np.arange(begin, end)
        leaves = np.full((count, end - begin), -np.inf)
        for to in range(1, count):
            for here in range(count):
                arrives = times + stations.least_s[here, to]
                until = arrives + stations.period_s
                gain = (
                    near[to, until.clip(max=steps)] - near[to, (arrives + rest_s).clip(max=steps)]
                )
                worth = np.maximum(gain, 0) + best[to, until] - price[here, to]
                leaves[here] = np.maximum(leaves[here], np.where(here == to, -np.inf, worth))
        # To leave at t is worth near[t + 1] - near[begin] from `begin` on, as to stay until then.
        past = near[:, begin + 1 : end + 1]
        stays = best[:, end] + near[:, end]
        later = np.concatenate([leaves + past, stays[:, None]], axis=1)
        ahead = np.maximum.accumulate(later[:, ::-1], axis=1)[:, ::-1]
        best[:, begin:end] = ahead[:, :-1] - near[:, begin:end]
    return float(best[0, 0])


def hangout_plan(
    people: list[Person], stations: Stations, weights: dict[str, float]
) -> Callable[[Any, Any, RobotEnv], int]:
    """Return how to wait knowing the whole life: the best decisions if ways take the usual time."""
    near = counted(people, stations, "has_time") / 60 * weights["near_min"]
    disturbing = counted(people, stations, "left_alone") / 60 * weights["disturbing_min"]
    count, steps = len(stations.room), near.shape[1] - 1
    rest_s = round(RESTS.total_seconds())
    longest = int(stations.usual_s.max()) + stations.period_s + 1
    best = np.zeros((count, steps + longest + 1))

    def values(here: int, times: Any) -> Any:
        """Return the value of going to each station, by time: (stations, times)."""
        worth = np.full((count, len(times)), -np.inf)
        for to in range(count):
            if to == 0 and here != 0:
                continue
            ways_s = 0 if here == to else stations.usual_s[here, to]
            until = times + ways_s + stations.period_s
            stop = until.clip(max=steps)
            rests = (times + (ways_s + rest_s if here != to else 0)).clip(max=steps)
            worth[to] = near[to, stop] - np.minimum(near[to, rests], near[to, stop])
            worth[to] += disturbing[to, stop] - disturbing[to, (times + ways_s).clip(max=steps)]
            worth[to] += best[to, until] + (here != to) * weights["relocations"]
        return worth

    for end in range(steps, 0, -stations.period_s):
        times = np.arange(max(0, end - stations.period_s), end)
        for here in range(count):
            best[here, times] = values(here, times).max(axis=0)

    at = [0]

    def choose(_: Any, mask: Any, env: RobotEnv) -> int:
        now = np.array([env.present.simulation.step])
        at[0] = int(values(at[0], now)[:, 0].argmax()) if now[0] else at[0]
        if not now[0]:
            at[0] = int(values(0, now)[:, 0].argmax())
        return len(mask) - 1 if at[0] == 0 else int(stations.room[at[0]])

    return choose


# Find and patrol


def find_bound(
    people: list[Person], weights: dict[str, float], every_s: int, lasts_s: int
) -> float:
    """Return a bound of the reward of searching: all that can succeed do, at once."""
    may = np.any([person.may_be_found for person in people], axis=0)
    found = sum(bool(may[begin : begin + lasts_s].any()) for begin in range(0, len(may), every_s))
    return found * weights["finds"]


def patrol_bound(rooms: int, steps: int, weights: dict[str, float]) -> float:
    """Return a bound of the reward of visiting: as if each way led through all rooms at once.

    With m relocations there are at most m + 2 ways, which cut the absence of each room into as many
    stretches; absences last (rooms - 1) * steps together, as it is in one room at a time. The mean
    age is least if all are equally long.
    """
    days = steps / DAY_S
    moves = np.arange(steps // 60)
    absent = (rooms - 1) / rooms
    unvisited_h = absent**2 * 24 * days**2 / 2 / (moves + 2)
    rewards = weights["unvisited_h"] * unvisited_h + weights["relocations"] * moves
    return float(rewards.max())


# Interact


class Piece(NamedTuple):
    """A stretch of time in which a person does one thing at home, open for a request [s]."""

    begin: int
    end: int
    activity: str


def interact_bound(life: Run, interactions: Any, weights: dict[str, float]) -> float:
    """Return a bound of the expected reward of asking, by who doesn't know how answers are drawn.

    Each request is served by itself, by a robot that stands in front of the person whenever it
    likes, and asks at the best moments, knowing what the person does. Nobody moves or has company,
    and attitudes are the best that are possible: all requests so far were accepted, and no prompt
    annoyed. How often to ask, and when, is found by dynamic programming over the stretches of time
    between changes of activity.
    """
    start = life.clock.start
    end = start + life.clock.steps * SECOND
    total = 0.0
    for interaction in interactions.values():
        person = person_of(life, interaction.to)
        same_person = [each for each in interactions.values() if each.to == interaction.to]
        for number, due in enumerate(_times(interaction, start, end)):
            since = int((due - start) / SECOND)
            accepted = sum(len(_times(each, start, due)) for each in same_person)
            logit = _best_logit(interaction, since, number, accepted)
            pieces = _pieces(person, since, since + int(interaction.within / SECOND))
            total += _worth_of_request(pieces, since, interaction, logit, weights)
    return total


def _times(interaction: Any, start: Any, end: Any) -> list[Any]:
    """Return when requests come up from the start of a run up to before a time."""
    return list(takewhile(lambda at: at < end, interaction.times(start, start)))


def _best_logit(interaction: Any, since_s: int, same: int, accepted: int) -> float:
    """Return the largest possible logit of accepting, if all requests before were accepted."""
    answers = Answers()
    part: Any = answers.attitude
    months: Any = answers.months
    importance: Any = answers.importance
    trust = 1 - (1 - months.trust) * (1 - GAINS) ** accepted
    habit = 1 - (1 - HABIT_FORMS) ** same
    novelty = 2 ** -(since_s / months.novelty_lasts.total_seconds())
    worth = interaction.worth
    return float(
        KIND_LOGITS[interaction.do]
        + importance.worth * worth / (worth + HALF_WORTH)
        + part.novelty * novelty
        + part.habit * habit
        + part.trust * (2 * trust - 1)
    )


def _pieces(person: Person, since: int, until: int) -> list[Piece]:
    """Return what a person does at home in a stretch of steps, in order."""
    until = min(until, len(person.room))
    changes = 1 + np.flatnonzero(np.diff(person.away[since:until])) + since
    within = [step for step in person.begins if since < step < until]
    edges = sorted({since, until, *changes.tolist(), *within})
    pieces = []
    for begin, end in pairwise(edges):
        if not person.away[begin]:
            doing = person.activities[int(np.searchsorted(person.begins, begin, "right")) - 1]
            pieces.append(Piece(begin, end, doing))
    return pieces


def _worth_of_request(
    pieces: list[Piece], since: int, interaction: Any, logit: float, weights: dict[str, float]
) -> float:
    """Return the value of a request: at most one prompt a try, each at the best moment left.

    A later try may be in the same piece as the one before.
    """
    answers = Answers()
    notice: Any = answers.notice
    activity: Any = answers.activity
    accepts = logistic(logit)
    ahead = np.zeros(len(pieces) + 1)  # with no try left, from each piece on
    for _ in range(interaction.tries):
        now = np.zeros(len(pieces) + 1)
        for k in range(len(pieces) - 1, -1, -1):
            doing = pieces[k].activity
            asleep = doing in ASLEEP
            notices = logistic(notice.base + asleep * notice.asleep)
            available = logistic(activity.base - LOADS.get(doing, 0.0))
            yes = notices * available * accepts
            value = interaction.value_after((pieces[k].begin - since) * SECOND)
            gain = (
                weights["value"] * yes * value
                + weights["bother"] * notices * (1 - available)
                + weights["woken"] * notices * asleep
            )
            now[k] = max(now[k + 1], gain + (1 - yes) * ahead[k])
        ahead = now
    return float(ahead[0])
