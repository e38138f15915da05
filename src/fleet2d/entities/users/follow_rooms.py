"""Plans that follow visits of rooms: the body is in each room at the step of the log."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from fleet2d.entities.nearest import Nearest
from fleet2d.entities.plan import Note
from fleet2d.floorplan.home.space import straight_way
from fleet2d.kernels import I64
from fleet2d.kernels.motion import time_route
from fleet2d.logs.log import AWAY
from fleet2d.logs.rooms import DOOR
from fleet2d.logs.visits import UNKNOWN, LoggedVisit

if TYPE_CHECKING:
    from fleet2d.entities.actor import Actor
    from fleet2d.entities.plan import Plan


# In visits shorter than this, the body stops at the nearest point of the room [us].
BRIEF_US = 10_000_000


@dataclass
class Paces:
    """Counts of the walks in a replay.

    Attributes:
        walks: The number of walks.
        hurried: Those faster than the body walks, because the log leaves no more time.
        over: Those of the hurried ones that are implausibly fast.
        fastest: The speed of the fastest walk [m/s].
    """

    walks: int = 0
    hurried: int = 0
    over: int = 0
    fastest: float = 0.0


class RoomFollower:
    """Plans the way through visits: the body leaves each room in time for the next visit.

    Args:
        actor: The body.
        visits: Its visits, in order; the first begins at step 0 or before.
        at_once: Whether it goes to the next room as soon as it may, and waits there.
        limit: A walk faster than this is counted as implausible [m/s].
    """

    def __init__(
        self,
        actor: "Actor",
        visits: Sequence[LoggedVisit],
        at_once: bool = False,
        limit: float = float("inf"),
    ) -> None:
        self.actor = actor
        self.limit = limit
        self.visits = visits
        self.at_once = at_once
        self.step_us = actor.clock.step_us
        self.paces = Paces()
        self._nearest: dict[int, Nearest] = {}

    def follow(self, plan: "Plan", current: int, *, rejoin: bool) -> "Plan":
        """Fill a plan from its beginning, in visit `current`, to the end of the log.

        Args:
            plan: An empty plan.
            current: The number of the visit at the beginning of the plan.
            rejoin: Whether the body may be somewhere else, and walks to the visit's room first;
                else it is put there.
        """
        if rejoin:
            self._catch_up(plan, self.visits[current])
        elif self.visits[current].place == UNKNOWN:
            self._vanish(plan, plan.time_us)
        else:
            self._appear(plan, self.visits[current], plan.time_us, known=False)
        for i in range(current + 1, len(self.visits)):
            before, visit = self.visits[i - 1], self.visits[i]
            arrive_us = visit.first * self.step_us
            self._note_activities(plan, before)
            if arrive_us <= plan.time_us:  # still catching up
                self._catch_up(plan, visit)
            elif visit.place == UNKNOWN:
                self._vanish(plan, arrive_us)
            elif before.place == UNKNOWN:
                self._appear(plan, visit, arrive_us)
            else:
                self._walk(plan, before, visit)
        self._note_activities(plan, self.visits[-1])
        return plan.stay()

    def _catch_up(self, plan: "Plan", visit: LoggedVisit) -> None:
        """Walk to a visit that has already begun."""
        if visit.place == UNKNOWN:
            self._vanish(plan, plan.time_us)
        elif visit.place == AWAY:
            plan.leave_home()
        else:
            plan.go_to_point(*self._spot(visit, plan))

    def _spot(self, visit: LoggedVisit, plan: "Plan") -> tuple[int, int]:
        if visit.place in (DOOR, AWAY):
            return self.actor.way_out
        return self.actor.find((visit.place,), max(visit.first, 0) * self.step_us, "spot")

    def _vanish(self, plan: "Plan", at_us: int) -> None:
        """Make the body's position unknown: it is away, without having walked out."""
        plan.jump(at_us, away=1).note("unknown")

    def _appear(self, plan: "Plan", visit: LoggedVisit, at_us: int, *, known: bool = True) -> None:
        """Put the body where the log has it."""
        x, y = self._spot(visit, plan)
        plan.jump(at_us, x=x, y=y, away=int(visit.place == AWAY))
        if known:
            plan.note("known", visit.place)

    def _walk(self, plan: "Plan", before: LoggedVisit, visit: LoggedVisit) -> None:
        """Walk from one visit to the next, so as to arrive in time."""
        arrive_us = visit.first * self.step_us
        may_leave = max(plan.time_us, before.keep * self.step_us)
        if before.place == AWAY:
            self._come_home(plan, before, arrive_us)
            may_leave = max(plan.time_us, may_leave)
        spot = self._spot(visit, plan)
        rows = self._way(plan, spot)
        lasts_us = (visit.keep - visit.first) * self.step_us
        if visit.place not in (DOOR, AWAY) and (
            rows[-1, 0] > arrive_us - may_leave or lasts_us < BRIEF_US
        ):
            rows = self._way(plan, self._near(plan, spot))
        self._set_out(plan, rows, may_leave, arrive_us, before)
        if visit.place == AWAY:
            plan.jump(arrive_us, away=1).note("left_home")

    def _come_home(self, plan: "Plan", out: LoggedVisit, arrive_us: int) -> None:
        back_us = max(plan.time_us, min((out.last + 1) * self.step_us, arrive_us - 1))
        plan.jump(back_us, away=0).note("came_home")

    def _near(self, plan: "Plan", spot: tuple[int, int]) -> tuple[int, int]:
        """Return the place in the room of a spot that is nearest to the body."""
        plan_of_home = self.actor.home.plan
        room = plan_of_home.room_at(*plan_of_home.lattice.to_metres(spot).tolist())
        if room is None:
            return spot
        if room.index not in self._nearest:
            self._nearest[room.index] = Nearest(self.actor, room.index)
        x, y = self._nearest[room.index].of(np.array([[plan.x, plan.y]], np.int64))[0].tolist()
        return x, y

    def _way(self, plan: "Plan", spot: tuple[int, int]) -> I64:
        """Return the breakpoints of the way to a spot: time since its beginning, x, y, heading."""
        route = self.actor.space.route((plan.x, plan.y), spot)
        if route is None:  # a door is shut at present, but the log says that somebody went there
            route = straight_way((plan.x, plan.y), spot)
        return time_route(route, 0, plan.heading, self.actor.speed, self.actor.turn_rate)

    def _set_out(
        self, plan: "Plan", rows: I64, may_leave: int, arrive_us: int, before: LoggedVisit
    ) -> None:
        """Follow the breakpoints of a way, at a time and speed that let the body arrive in time."""
        takes = int(rows[-1, 0])
        if not takes:
            plan.follow(np.array([[arrive_us, *rows[-1, 1:], 0]], np.int64))
            return
        leave = max(may_leave, arrive_us - takes)
        if self.at_once:
            leave = min(leave, max(may_leave, (before.last + 1) * self.step_us))
        window = arrive_us - leave
        self.paces.walks += 1
        times = rows[:, 0]
        if takes > window:
            times = times * window // takes
            self.paces.hurried += 1
            speed = self.actor.entity.speed * takes / max(window, 1)
            self.paces.over += speed > self.limit
            self.paces.fastest = max(self.paces.fastest, speed)
        block = np.zeros((len(rows) + 1, 5), np.int64)
        block[:-1, 0], block[:-1, 1:4] = leave + times, rows[:, 1:]
        block[-1] = block[-2]
        block[-1, 0] = arrive_us
        plan.follow(block)

    def _note_activities(self, plan: "Plan", visit: LoggedVisit) -> None:
        """Add rows for the activities of a visit, except those before the plan begins."""
        for step, activity in visit.activities:
            at_us = max(step, 0) * self.step_us
            if activity and at_us >= plan.began[0] * self.step_us:
                plan.notes.append(Note(at_us, "activity", activity))
