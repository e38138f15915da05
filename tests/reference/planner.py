"""The planner of days in plain Python: what `src/core/planner.hpp` says, one episode at a time."""

from collections.abc import Sequence
from typing import NamedTuple

from fleet2d.routines.distributions import Distribution, draw_weighted

NO_GAP_S = 300
MILLION = 1_000_000
ORDERS = 5  # drawn before a job is left out


class RoomTimes:
    """When rooms are in use, as `fleet2d.kernels.RoomUse`."""

    def __init__(self):
        self.times = {}

    def add(self, room, begin, end):
        self.times.setdefault(room, []).append((begin, end))

    def free(self, rooms, begin, latest, shortest, end_by):
        slots = [
            (*slot, room)
            for room in rooms
            if (slot := self._free_in(room, begin, latest, shortest, end_by)) is not None
        ]
        return min(slots, key=lambda slot: slot[0], default=None)

    def _free_in(self, room, begin, latest, shortest, end_by):
        for first, last in sorted(self.times.get(room, ())):
            if last <= begin:
                continue
            if begin > latest:
                return None
            if begin + shortest <= first:
                return begin, min(end_by, first)
            begin = last
        return (begin, end_by) if begin <= latest else None


class CoreJob(NamedTuple):
    """A row of `jobs` of `fleet2d.kernels.DayPlanner`."""

    activity: int
    starts: Distribution | None
    takes: Distribution
    until: int
    after: Sequence[int]
    chance: int
    needed: bool
    place: int


class CorePastime(NamedTuple):
    """A row of `pastimes` of `fleet2d.kernels.DayPlanner`."""

    activity: int
    weight: int
    takes: Distribution
    first: int
    last: int


class JobChain(NamedTuple):
    """Jobs in order, by number; `preferred` and `latest` have that of going to bed, too."""

    jobs: list[int]
    preferred: list[int]
    latest: list[int]


class SlowPlanner:
    """Draws days, as `fleet2d.kernels.DayPlanner`."""

    def __init__(
        self,
        sleep,
        min_sleep,
        jobs,
        pastimes,
        rest,
        asleep,
    ):
        self.sleep, self.min_sleep = Distribution(*sleep), min_sleep
        self.jobs = [
            CoreJob(activity, starts and Distribution(*starts), Distribution(*takes), *rest)
            for activity, starts, takes, *rest in jobs
        ]
        self.pastimes = [
            CorePastime(activity, weight, Distribution(*takes), *window)
            for activity, weight, takes, *window in pastimes
        ]
        self.rest, self.asleep = rest, asleep

    def plan(
        self,
        draws,
        wake,
        next_wake,
        use=None,
        rooms=(),
    ):
        chain = self._feasible_chain(draws, wake, next_wake)
        if chain is None:
            return []
        day = []
        now = wake
        for i, number in enumerate(chain.jobs):
            job = self.jobs[number]
            end_by = min(job.until, chain.latest[i + 1])
            begin = min(_next_begin(job, now, chain.preferred[i]), chain.latest[i])
            room = -1
            if use is not None and rooms[number]:
                shortest = job.takes.shortest
                slot = use.free(rooms[number], begin, chain.latest[i], shortest, end_by)
                if slot is None:  # others use its rooms all the time: it is left out
                    continue
                begin, end_by, room = slot
            end = begin + job.takes.draw(draws, None, end_by - begin)
            self._fill(day, draws, now, begin)
            day.append((job.activity, begin, end, number, room))
            now = end
        bed = min(max(now, chain.preferred[-1]), chain.latest[-1])
        bed = now if bed - now < NO_GAP_S and now >= self.sleep.shortest else bed
        self._fill(day, draws, now, bed)
        day.append((self.asleep, bed, next_wake, -1, -1))
        return day

    def draw_order(self, draws, chosen, wake, next_wake, by_deadline):
        numbers = {i for i, is_chosen in enumerate(chosen) if is_chosen}
        chain = self._draw_chain(draws, numbers, wake, next_wake, by_deadline)
        return chain.jobs, chain.latest, self._fits(chain, wake)

    def _feasible_chain(self, draws, wake, next_wake):
        chosen = {i for i, job in enumerate(self.jobs) if draws.below(MILLION) < job.chance}
        tries = 0
        while True:
            by_deadline = tries % ORDERS == ORDERS - 1
            chain = self._draw_chain(draws, chosen, wake, next_wake, by_deadline)
            if self._fits(chain, wake):
                return chain
            tries += 1
            if tries % ORDERS == 0:
                dispensable = [i for i in chosen if not self.jobs[i].needed]
                if not dispensable:
                    return None
                chosen.remove(min(dispensable, key=lambda i: (self.jobs[i].chance, -i)))

    def _draw_chain(self, draws, chosen, wake, next_wake, by_deadline):
        latest_bed = min(self.sleep.longest, next_wake - self.min_sleep)
        bed = self.sleep.draw(draws, None, latest_bed)
        preferred = {}
        ranks = {}  # part of the day, time, number
        for i, job in enumerate(self.jobs):
            before = [k for k in job.after if k in preferred]
            follows = job.starts is None and job.place == 0
            if i not in chosen or (follows and not before):
                continue
            part, begin = job.place, wake
            if job.starts is not None:
                begin = job.starts.draw(draws)
            elif job.place > 0:
                begin = bed - job.takes.knots[len(job.takes.knots) // 2]
            elif before:
                part = -1
            preferred[i] = max([begin, *(preferred[k] for k in before)])
            rank = job.starts.longest if by_deadline and job.starts is not None else begin
            ranks[i] = (
                max([part, *(ranks[k][0] for k in before)]),
                max([rank, *(ranks[k][1] for k in before)]),
                i,
            )
        order = sorted(preferred, key=lambda i: ranks[i])
        latest = self._latest(order, latest_bed)
        return JobChain(order, [*(preferred[i] for i in order), bed], latest)

    def _latest(self, order, bed):
        latest = [bed]
        for job in (self.jobs[i] for i in reversed(order)):
            last = min(job.until, latest[-1]) - job.takes.shortest
            latest.append(last if job.starts is None else min(last, job.starts.longest))
        return latest[::-1]

    def _fits(self, chain, wake):
        earliest = wake
        for i, last in zip(chain.jobs, chain.latest, strict=False):
            job = self.jobs[i]
            if job.starts is not None:
                earliest = max(earliest, job.starts.shortest)
            if earliest > last:
                return False
            earliest += job.takes.shortest
        return max(earliest, self.sleep.shortest) <= chain.latest[-1]

    def _fill(self, day, draws, begin, end):
        while begin < end:
            last = day[-1][0] if day else -1
            options = [
                pastime
                for pastime in self.pastimes
                if pastime.first <= begin <= pastime.last
                and pastime.takes.shortest <= end - begin
                and pastime.activity != last
            ]
            if not options:
                over = min(end, begin + NO_GAP_S)
                if last == self.rest and day[-1][3] < 0:
                    day[-1] = (self.rest, day[-1][1], over, -1, -1)
                else:
                    day.append((self.rest, begin, over, -1, -1))
                begin = over
                continue
            pastime = options[draw_weighted(draws, [option.weight for option in options])]
            over = begin + pastime.takes.draw(draws, None, end - begin)
            if end - over < NO_GAP_S and end - begin <= pastime.takes.longest:
                over = end
            day.append((pastime.activity, begin, over, -1, -1))
            begin = over


def _next_begin(job, now, preferred):
    begin = max(now, preferred)
    is_soon = begin - now < NO_GAP_S and (job.starts is None or job.starts.shortest <= now)
    return now if is_soon else begin
