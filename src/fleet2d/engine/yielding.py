"""Yielding: robots keep clear of people and of each other, wherever they stop, turn or pass.

The paths of all bodies are known until their next decisions. Whenever somebody will come too near
to a robot within the next seconds, the robot gets another plan: it waits, goes round, stops beside,
or steps aside and comes back. A plan is taken only if it meets nobody on the known paths. Of two
robots, the right of way says which one yields; the other drives on, and stops at the last step if
its path isn't free. So robots never overlap: a robot that stops has kept its distance, and nobody
else drives into it.

People, logs and real bodies never change their ways. Where one of them walks into a robot that
can't get out of the way, the two overlap, with an event.
"""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from datetime import timedelta
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from fleet2d.configuration.units import micros
from fleet2d.engine.basis import Basis, Watcher
from fleet2d.entities import giving_way
from fleet2d.entities.behavior import Situation
from fleet2d.entities.body import Bodies, Pose, Track
from fleet2d.entities.decisions import DecidingActor
from fleet2d.entities.giving_way import plan_after, plan_along, plan_around, plan_here, yielder
from fleet2d.entities.place import is_point
from fleet2d.entities.plan import Note, Plan
from fleet2d.entities.yielder import AsideSearch, BodyInWay
from fleet2d.floorplan.lattice import LatticePoint
from fleet2d.kernels import I64, SUB, Bool, Distances
from fleet2d.runtime.events import EventKind

EndPlan = Callable[[int, int], None]

# A robot yields to encounters this far ahead.
AHEAD = timedelta(seconds=5)
# Its new plan has to be free for this long.
FREE_FOR = timedelta(seconds=15)
# It tries these waits in order.
WAITS = tuple(timedelta(seconds=seconds) for seconds in (1, 2, 4, 8))
WAITS_ASIDE = timedelta(seconds=2), timedelta(seconds=8)
# A plan that isn't free for long is kept for this time before the next try.
PAUSE = timedelta(seconds=2)
# Waiting for another robot for this long is a deadlock, after which the other one yields for a
# while.
DEADLOCK = timedelta(seconds=10)
SWAPPED_FOR = timedelta(seconds=30)
# A wait that begins this soon after another one, and this near, continues it.
SAME_WAIT = timedelta(seconds=15)
SAME_PLACE_M = 1.5
# A robot stands at most this long before it looks again.
LONGEST_PAUSE = timedelta(minutes=10)
# After waiting in vain for this long, a robot skips its stop.
GIVES_UP = timedelta(minutes=2)
# Gap at which bodies pass, and gap at which a robot with the right of way stops [m].
PASSING_GAP_M = 0.02
LEAST_GAP_M = 0.01
# Places to step aside to: how far away they may be [m], the distance between them [cells], and how
# many are tried.
NEAR_M = 1.2
FAR_M = 3.0
ASIDE_CELLS = 4
ASIDE_TRIES = 12
NO_WAITS = np.zeros(0, np.int64)

# These are values of `Distances.counts`.
OWN_MOTION = 1
OTHERS_MOTION = 2


class GivenWay(NamedTuple):
    """The wait of a robot for others.

    Attributes:
        since: The step at which it began.
        last: The last step at which it had to wait.
        place: The position at which it began [lattice].
        swaps: Number of deadlocks that it has ended meanwhile.
        pause: Number of steps for which it stood when it last found nothing better.
    """

    since: int
    last: int
    place: LatticePoint
    swaps: int = 0
    pause: int = 0


@dataclass
class Patience:
    """A time in which a robot doesn't react to a body, for want of anything better.

    Attributes:
        until: The step before which it lasts.
        planned_at: The step at which the other one began its plan; another plan ends it.
        other: The row of the other one.
        ignores: Whether the robot ignores the other body, since they overlap; else it only stops.
    """

    until: int
    planned_at: int
    other: int
    ignores: bool = False


class Yielding(Watcher):
    """The robots of a run that keep clear of all bodies."""

    def __init__(self, basis: Basis) -> None:
        """Prepare for the robots, unless the scenario says that bodies are ghosts."""
        settings = basis.scenario.simulation
        self._actors = basis.actors
        self._bodies = basis.bodies
        self._rule = settings.right_of_way
        self._users = basis.bodies.users
        robots = () if settings.ghosts or len(self._actors) < 2 else basis.robots
        self.rows = [robot.row for robot in robots if not robot.is_recorded]
        self._number = {row: number for number, row in enumerate(self.rows)}
        self._rows = np.array(self.rows, np.int64)
        self._step_us = basis.clock.step_us
        # Delayed robots take the same poses at later steps, whose views are cached.
        self._beat_us = self._step_us if len(self.rows) > 1 else 1
        self._ahead = self._steps(AHEAD)
        self._free_for = self._steps(FREE_FOR)
        self._tries = np.array(list(map(self._steps, WAITS)), np.int64)
        self._tries_aside = np.array(list(map(self._steps, WAITS_ASIDE)), np.int64)
        self._waits: dict[int, GivenWay] = {}
        # These are the steps and places at which there was no way round.
        self._looked_round: dict[int, tuple[int, object]] = {}
        self._told: dict[tuple[int, int], int] = {}
        self._patience: dict[tuple[int, int], Patience] = {}
        self._pauses: dict[int, Patience] = {}  # of robots that found nothing better than to stand
        self._swapped: dict[tuple[int, int], int] = {}
        self._stuck: tuple[bool, ...] = ()
        self._distances: Distances | None = None
        # The distances without patience, and the pairs of robots that have swapped their order.
        self._without_patience: tuple[list[tuple[int, int]], Distances] | None = None
        self._strictest: tuple[I64, Distances] | None = None  # with its leads
        self.overlaps: dict[tuple[str, str], int] = {}
        if self.rows:
            self._set_up()

    @property
    def is_needed(self) -> bool:
        """Whether any robot yields."""
        return bool(self.rows)

    waits = is_needed

    @property
    def notes(self) -> list[str]:
        """A remark on how often somebody who doesn't yield walked into a robot."""
        return [
            f"robots.{robot}: {other} walked into it {count} time{'s' if count > 1 else ''}"
            for (robot, other), count in self.overlaps.items()
        ]

    def limit(self, bodies: Bodies, end: int) -> int:
        """Return the step after the span's first at which a robot has to react, or `end`."""
        step = self.next_step
        first = step + 1
        while first < end:
            changes = [change for change in self._changes() if change > step]
            until = min([end, *(change for change in changes if change > first)])
            is_same = all(change > first for change in changes)
            kept = self._present_distances(step) if is_same else self._kept_distances(first)
            found = self._meetings(kept, first, until)
            if found:
                return min(due for _, due, _, _ in found)
            first = until
        return end

    def _changes(self) -> Iterator[int]:
        """Yield the steps at which robots react to others again."""
        for patience in self._patience.values():
            yield patience.until
        for pause in self._pauses.values():
            yield pause.until
        yield from self._swapped.values()

    def _meetings(
        self, distances: Distances, first: int, end: int
    ) -> list[tuple[int, int, int, int]]:
        return self._bodies.timelines.meetings(self._rows, distances, first, end)

    def answer(
        self, step: int, outputs: Mapping[str, Any], begun: set[int], end_plan: EndPlan
    ) -> None:
        """Give other plans to robots that would come too near to somebody.

        Args:
            step: The present step, at which all bodies have decided.
            outputs: The outputs of algorithms, for behaviors.
            begun: The rows of these robots whose plans begin now; those of others are added.
            end_plan: Called with a row and the step before its plan is replaced.
        """
        self._refresh(step)
        found = self._meetings(self._present_distances(step), step, step + 1)
        for row, _, at, other in found:
            now = Situation(self._actors[row], step, (), outputs)
            for each, plan in self._plans(now, at, other):
                self._follow(each, plan, begun, end_plan)
        # Robots that would still drive into somebody in this step stop, then those that would hit
        # them.
        while found:
            found = self._meetings(self._strict_distances(step), step, step + 1)
            for row, *_ in found:
                now = Situation(self._actors[row], step, (), outputs)
                self._follow(now, self._stop(now), begun, end_plan)

    def _follow(self, now: Situation, plan: Plan, begun: set[int], end_plan: EndPlan) -> None:
        """Let a robot follow another plan from now on."""
        row = now.actor.row
        actor = self._actors[row]
        if row not in begun:
            end_plan(row, now.step)
        begun.add(row)
        plan.interrupts = actor.arbiter.own
        actor.follow_instead(plan, now)
        self._bodies.follow(row, actor.motion, plan.began[1], plan.posture_times())
        after = self._bodies.pose_at(row, now.step + 1)
        if after.position == actor.state.position:
            plan.notes[:0] = self._overlap_notes(now, self._hits(now))

    def _set_up(self) -> None:
        """Compute the distances between bodies, and move robots that begin in others."""
        actors = self._actors
        units = actors[0].home.lattice.units_per_m
        radii = np.array([actor.entity.radius for actor in actors])
        touch = radii[self._rows, None] + radii

        def lattice(gap: float) -> I64:
            return np.ceil((touch + gap) * units).astype(np.int64)

        self._hard = lattice(0.0)
        self._near = lattice(PASSING_GAP_M)
        self._least = lattice(LEAST_GAP_M)
        self._nothing = np.zeros_like(self._near)
        self._strangers = np.zeros_like(self._near[:1])  # bodies that don't yield
        self._strangers[:, self._rows] = -1
        self._reach = self._near + SUB  # with room to move
        self._alone = np.full(touch.shape, OWN_MOTION, np.uint8)
        self._counts = np.zeros_like(self._alone)
        self._polite = self._near.copy()
        people = slice(self._users)
        for number, row in enumerate(self.rows):
            gives_way = getattr(actors[row].entity, "gives_way", None)
            if gives_way is not None:  # `Clearance` handles people that stand
                self._counts[number, people] = OTHERS_MOTION
                self._polite[number, people] = lattice(gives_way.distance)[number, people]
        self._passing = self._distances_by_row(self._near, self._nothing)
        self._politely = self._distances_by_row(self._polite, self._nothing)
        self._everybody = self._distances_by_row(self._near, self._hard)
        self._same_place = SAME_PLACE_M * units
        self._order()
        for row in self.rows:
            self._begin_apart(actors[row])

    def _distances_by_row(self, near: I64, hard: I64) -> dict[int, Distances]:
        """Return the distances of each robot from all bodies, whoever moves, by row."""
        nothing = self._nothing[:1]
        counts = np.zeros_like(self._counts[:1])
        return {
            row: Distances(nothing, near[i : i + 1], hard[i : i + 1], counts)
            for row, i in self._number.items()
        }

    def _order(self) -> None:
        """Ask the rule which robots go first; bool (robots, bodies)."""
        self._first = np.zeros(self._near.shape, np.bool_)
        for i, one in enumerate(self.rows):
            for other in self.rows[i + 1 :]:
                goes = self._rule.goes_first(self._actors[one], self._actors[other])
                self._first[i, other] = goes
                self._first[self._number[other], one] = not goes

    def _refresh(self, step: int) -> None:
        """Update the distances after bodies have begun plans."""
        if not self._rule.is_fixed:
            self._order()
            self._distances = None
            self._without_patience = None
        stuck = tuple([_is_stuck(self._actors[row]) for row in self.rows])
        if stuck != self._stuck:
            self._stuck = stuck
            self._distances = None
            self._without_patience = None

    def _present_distances(self, step: int) -> Distances:
        """Return the distances that robots keep from all bodies at a step."""
        may_end = self._patience or self._pauses or self._swapped
        if self._distances is not None and not may_end:
            return self._distances
        lasting: tuple[dict[Any, Patience], ...] = self._patience, self._pauses
        for patiences in lasting:
            for key, patience in list(patiences.items()):
                begun = self._actors[patience.other].planned_at
                if patience.until <= step or begun > patience.planned_at:
                    del patiences[key]
                    self._distances = None
        for pair, until in list(self._swapped.items()):
            if until <= step:
                del self._swapped[pair]
                self._distances = None
        if self._distances is None:
            self._distances = self._kept_distances(step)
        return self._distances

    def _kept_distances(self, step: int) -> Distances:
        """Return the distances that robots keep at a step if nobody decides before it."""
        usual = self._usual_distances(step)
        lead = usual.lead.copy()
        near = usual.near.copy()
        hard = usual.hard.copy()
        counts = usual.counts.copy()
        for row, pause in self._pauses.items():
            if pause.until <= step:
                continue
            i = self._number[row]
            lead[i, self._rows] = 0
            near[i, self._rows] = self._least[i, self._rows]
            hard[i, self._rows] = 0
            counts[i, self._rows] = OWN_MOTION
        for (row, other), patience in self._patience.items():
            if patience.until <= step:
                continue
            i = self._number[row]
            lead[i, other] = -1 if patience.ignores else 0
            near[i, other] = self._least[i, other]
            hard[i, other] = 0
            counts[i, other] = OWN_MOTION if other in self._number else self._counts[i, other]
        for number, is_stuck in enumerate(self._stuck):
            if is_stuck:
                lead[number] = -1
        return Distances(lead, near, hard, counts)

    def _usual_distances(self, step: int) -> Distances:
        """Return the distances that robots keep at a step without patience."""
        swapped = self._swapped_at(step)
        if self._without_patience is None or self._without_patience[0] != swapped:
            first = self._first_now(step)
            kept = Distances(
                lead=np.where(first, 0, self._ahead),
                near=np.where(first, self._least, self._near),
                hard=np.where(first, 0, self._hard),
                counts=np.where(first, OWN_MOTION, self._counts).astype(np.uint8),
            )
            self._without_patience = swapped, kept
        return self._without_patience[1]

    def _first_now(self, step: int) -> Bool:
        """Return which robots go before others at a step, bool (robots, bodies)."""
        first = self._first.copy()
        for one, other in self._swapped_at(step):
            row = self._number[one]
            first[row, other] = not first[row, other]
            row = self._number[other]
            first[row, one] = not first[row, one]
        for number, is_stuck in enumerate(self._stuck):
            if is_stuck:
                first[:, self.rows[number]] = False
        return first

    def _swapped_at(self, step: int) -> list[tuple[int, int]]:
        """Return the pairs of robots whose order is swapped at a step."""
        return [pair for pair, until in self._swapped.items() if until > step]

    def _strict_distances(self, step: int) -> Distances:
        """Return the distances at which robots stop at the last moment."""
        lead = self._present_distances(step).lead
        if self._strictest is None or self._strictest[0] is not lead:
            strict = Distances(np.minimum(lead, 0), self._least, self._nothing, self._alone)
            self._strictest = lead, strict
        return self._strictest[1]

    def _goes_first(self, row: int, other: int, step: int) -> bool:
        """Return whether a robot only has to stop before another one, and needn't yield."""
        counts = self._present_distances(step).counts
        return other in self._number and bool(counts[self._number[row], other] == OWN_MOTION)

    def _have_patience(
        self, now: Situation, other: int, steps: int, *, ignores: bool = False
    ) -> None:
        """Make a robot ignore, or only stop for, another body for some steps."""
        planned_at = self._actors[other].planned_at
        patience = Patience(now.step + steps, planned_at, other, ignores)
        self._patience[now.actor.row, other] = patience
        self._distances = None

    def _swap(self, row: int, other: int, step: int) -> None:
        """Let the other one of two robots yield for a while."""
        pair = _pair(row, other)
        lasts = self._steps(SWAPPED_FOR)
        until = self._swapped.get(pair)
        if until is None:
            self._swapped[pair] = step + lasts
        elif step < until - lasts + self._steps(DEADLOCK):
            return  # else two blocked robots would swap there and back
        else:
            del self._swapped[pair]
        for one, another in ((row, other), (other, row)):
            self._patience.pop((one, another), None)
            self._pauses.pop(one, None)
        self._distances = None

    def _plans(self, now: Situation, at: int, other: int) -> list[tuple[Situation, Plan]]:
        """Return other plans for a robot, or for the body that it meets at a step; empty: go on."""
        row = now.actor.row
        if self._goes_first(row, other, now.step):
            if self._rests(other, now.step):
                round_it = self._plan_by_waiting(now, at, other)
                if round_it is not None:
                    return [(now, self._noted(now, other, round_it))]
            # A shorter time than the other one looks ahead would never let it get away.
            stop = self._stop(now, self._ahead)
            return [(now, self._blocked(now, at, other, stop))]
        stays = self._hit_at_rest(now, self._everybody[row])
        if stays is None:
            plan = self._plan_by_waiting(now, at, other)
        elif self._keeps_its_place(now, at, other):
            return []
        elif (passing := self._plan_passing(now, at, other)) is not None:
            return [passing]
        else:
            plan = self._plan_aside(now, at, self._politely[row])
            if plan is None and self._counts[self._number[row]].any():  # then less politely
                plan = self._plan_aside(now, at, self._passing[row])
        if plan is None:
            plan = self._plan_in_vain(now, at, other, stays)
        else:
            plan = self._noted(now, other, plan)
        return [] if plan is None else [(now, plan)]

    def _plan_in_vain(
        self, now: Situation, at: int, other: int, stays: tuple[int, int] | None
    ) -> Plan | None:
        """Return the plan of a robot that can only stop; None to go on."""
        actor = self._actors[now.actor.row]
        pause = self._pause(now)
        if self._queues(actor, other, now.step, at):
            pause = max(pause, self._rest_of(other, now.step))
        is_hit = stays is not None and stays[0] <= at and other not in self._number
        if is_hit and at > now.step:  # stopping doesn't delay the hit
            self._have_patience(now, other, max(pause, at - now.step))
            return None
        if is_hit:
            return self._plan_when_hit(now, pause)
        self._have_patience(now, other, pause)
        planned_at = self._actors[other].planned_at
        self._pauses[actor.row] = Patience(now.step + pause, planned_at, other)
        plan = self._blocked(now, at, other, self._stop(now, pause))
        wait = self._waits.get(actor.row)
        if wait is not None:
            self._waits[actor.row] = wait._replace(pause=pause)
        return plan

    def _plan_by_waiting(self, now: Situation, at: int, other: int) -> Plan | None:
        """Return a plan that goes on later, or round bodies that stand; None if none is free."""
        plan = self._plan_past(now, at, other, self._tries)
        if plan is not None:
            return plan
        actor = self._actors[now.actor.row]
        standing = self._standing(now)
        stop = self._stop_of(actor, at)
        seen = actor.state, actor.arrangement, stop, standing.tobytes()
        last, where = self._looked_round.get(actor.row, (None, None))
        if last is not None and (now.step - last < self._ahead or where == seen):
            return None
        timelines = self._bodies.timelines
        charger = _charger(actor)
        around = plan_around(now, actor.plan, timelines, standing, at, charger, self._beat_us)
        if around is not None and self._is_free(now, around):
            return around
        self._looked_round[actor.row] = now.step, None if around is not None else seen
        return None

    def _plan_past(self, now: Situation, at: int, other: int, waits: I64) -> Plan | None:
        """Return a plan to go on past a body, later or by a point beside it; None without one."""
        actor = self._actors[now.actor.row]
        number = self._number[actor.row]
        in_way = BodyInWay(
            other=other,
            near=int(self._near[number, other]),
            distance=3 * int(self._polite[number, other]) // 2,
            room_of_place=actor.home.plan.room_of_place,
            parts=actor.space.part_lookup,
            part=actor.part,
        )
        kept = self._politely[actor.row]
        continued = self._bodies.timelines.way_past(
            yielder(actor, self._beat_us), now.step, at, in_way, waits, kept, self._free_until(now)
        )
        return None if continued is None else plan_along(now, actor.plan, continued)

    def _plan_passing(self, now: Situation, at: int, other: int) -> tuple[Situation, Plan] | None:
        """Return a plan to pass a standing robot with the right of way; None if it can't."""
        row = now.actor.row
        if other not in self._number or not self._rests(row, now.step):
            return None
        theirs = Situation(self._actors[other], now.step, (), now.outputs)
        plan = self._plan_past(theirs, at, row, NO_WAITS)
        return None if plan is None else (theirs, self._noted(theirs, row, plan))

    def _plan_aside(self, now: Situation, at: int, kept: Distances) -> Plan | None:
        """Return a plan to step aside and come back, by the nearest place; None without one.

        If it can't come back, it waits for the known time, and then looks again.
        """
        actor = self._actors[now.actor.row]
        cell = actor.home.lattice.cell
        aside = AsideSearch(
            part_of_cell=actor.space.part_of_cell,
            part=actor.part,
            begin=partial(_place_inside, actor),
            near_cells=int(NEAR_M / cell),
            far_cells=int(FAR_M / cell),
            spacing=ASIDE_CELLS,
            most=ASIDE_TRIES,
            reach=self._reach[self._number[actor.row]],
        )
        body = yielder(actor, self._beat_us)
        waits = self._tries_aside
        rests = self._free_for
        until = self._free_until(now)
        way_aside = self._bodies.timelines.way_aside
        continued = way_aside(body, now.step, at, aside, waits, rests, kept, until)
        return None if continued is None else plan_along(now, actor.plan, continued)

    def _stop(self, now: Situation, steps: int = 0) -> Plan:
        """Return a plan to stop for a moment, and then to go on."""
        row = now.actor.row
        wait = np.array([max(steps, self._steps(PAUSE))])
        continued = self._bodies.timelines.way_after_a_wait(
            row, now.step, wait, self._politely[row], now.step
        )
        assert continued is not None, "up to the present step, it meets nobody"
        return plan_along(now, now.actor.plan, continued)

    def _pause(self, now: Situation) -> int:
        """Return the number of steps to stand before the next look, larger each time."""
        wait = self._waits.get(now.actor.row)
        last = 0 if wait is None or not self._goes_on(wait, now) else wait.pause
        return min(max(self._steps(PAUSE), 2 * last), self._steps(LONGEST_PAUSE))

    def _plan_when_hit(self, now: Situation, pause: int) -> Plan | None:
        """Note once who walks into a robot now; the robot goes on, ignoring them."""
        hits = self._hits(now)
        for other in hits:
            stays = self._steps(GIVES_UP) if self._rests(other, now.step) else pause
            self._have_patience(now, other, stays, ignores=True)
        notes = self._overlap_notes(now, hits)
        if not notes:
            return None
        plan = plan_after(now, now.actor.plan, now.step)
        plan.notes[:0] = notes
        return plan

    def _overlap_notes(self, now: Situation, others: list[int]) -> list[Note]:
        """Return new notes that others walk into a robot now."""
        row = now.actor.row
        robot = self._actors[row].name
        notes = []
        for other in others:
            told = self._told.get((row, other))
            self._told[row, other] = now.step
            if told is not None and now.step - told <= self._steps(SAME_WAIT):
                continue
            name = self._actors[other].name
            self.overlaps[robot, name] = self.overlaps.get((robot, name), 0) + 1
            notes.append(Note(now.step * self._step_us, EventKind.OVERLAPS, name))
        return notes

    def _hits(self, now: Situation) -> list[int]:
        """Return the bodies that would walk into a standing robot in this step without yielding."""
        row = now.actor.row
        kept = self._everybody[row]
        meeting_at_rest = self._bodies.timelines.meeting_at_rest
        hits = list[int]()
        lead = self._strangers
        while True:  # mostly there is nobody
            only = kept._replace(lead=lead)
            _, other = meeting_at_rest(row, only, now.step, now.step + 1)
            if other < 0:
                return hits
            hits.append(other)
            lead = lead.copy()
            lead[0, other] = -1

    def _noted(self, now: Situation, other: int, plan: Plan) -> Plan:
        """Add a note to a plan at the beginning of a wait that the robot gives way."""
        row = now.actor.row
        wait = self._waits.get(row)
        if wait is not None and self._goes_on(wait, now):
            self._waits[row] = wait._replace(last=now.step)
        else:
            self._waits[row] = GivenWay(now.step, now.step, now.actor.state.position)
            note = Note(now.step * self._step_us, EventKind.GIVES_WAY, self._actors[other].name)
            plan.notes.insert(0, note)
        return plan

    def _goes_on(self, wait: GivenWay, now: Situation) -> bool:
        """Return whether a present wait of a robot continues an earlier one."""
        is_soon = now.step - wait.last <= self._steps(SAME_WAIT) + wait.pause
        moved = math.dist(wait.place, now.actor.state.position)
        return is_soon and moved <= self._same_place

    def _blocked(self, now: Situation, at: int, other: int, plan: Plan) -> Plan:
        """Return the plan of a blocked robot: to wait, or to skip its stop."""
        row = now.actor.row
        actor = self._actors[row]
        taken = self._is_taken(actor, other, now.step, at)
        queues = self._queues(actor, other, now.step, at)
        here = None
        if taken and not queues:
            here = plan_here(now, actor.plan, self._bodies.timelines, at, self._beat_us)
        if here is not None:
            return self._noted(now, other, here)
        self._noted(now, other, plan)
        if queues:
            return plan
        wait = self._waits[row]
        waited = now.step - wait.since
        name = self._actors[other].name
        patience = DEADLOCK if taken else GIVES_UP
        if waited >= self._steps(patience) and _goes_somewhere(actor):
            self._waits[row] = wait._replace(since=now.step, swaps=0)
            return self._without_stop(now, name)
        longest = (wait.swaps + 1) * self._steps(DEADLOCK)
        if other in self._number and waited >= longest:
            self._waits[row] = wait._replace(swaps=wait.swaps + 1)
            self._swap(row, other, now.step)
            plan.notes.insert(0, Note(now.step * self._step_us, EventKind.DEADLOCK, name))
        return plan

    def _without_stop(self, now: Situation, name: str) -> Plan:
        """Return the plan without the stop that can't be reached; else a step of standing."""
        actor = self._actors[now.actor.row]
        stands = timedelta(microseconds=self._step_us)
        plan = now.plan().stay(stands).note(EventKind.GIVES_UP, name)
        rest = giving_way.without_next_stop(plan, actor.plan, now.step)
        if rest is not None:
            return rest
        if actor.order is None and actor.arbiter.active is not None:
            actor.behaviors[actor.arbiter.active].give_up(now)
        return now.plan().stay(stands).note(EventKind.GIVES_UP, name)

    def _free_until(self, now: Situation) -> int:
        """Return the step up to which a plan has to be free."""
        return now.step + self._free_for

    def _hit_at_rest(self, now: Situation, kept: Distances) -> tuple[int, int] | None:
        """Return the step at which somebody would come too near to a standing robot, and who."""
        row = now.actor.row
        met = self._bodies.timelines.meeting_at_rest(row, kept, now.step, self._free_until(now))
        return None if met[0] < 0 else met

    def _is_free(self, now: Situation, plan: Plan) -> bool:
        """Return whether a plan keeps a robot clear of everybody, as far as is known."""
        motion = plan.finish()
        if not isinstance(motion, Track):
            return True
        row = now.actor.row
        on = motion.breakpoints
        kept = self._politely[row]
        step, _ = self._bodies.timelines.meeting_on(row, on, kept, now.step, self._free_until(now))
        return step < 0

    def _rests(self, row: int, step: int) -> bool:
        """Return whether a body stays where it is for a while, as far as is known."""
        return self._bodies.timelines.rests(row, step, step + self._free_for)

    def _standing(self, now: Situation) -> I64:
        """Return where others stand or will stop, and the distances to keep: int64 (n, 3)."""
        row = now.actor.row
        reach = self._reach[self._number[row]]
        return self._bodies.timelines.standing(row, now.step, self._free_for, reach)

    def _stop_of(self, actor: DecidingActor, step: int) -> LatticePoint | None:
        """Return the next stop of a body after a step, or its position; None for a random walk."""
        motion = actor.motion
        if not isinstance(motion, Track):
            return None
        track = motion.breakpoints
        stop = giving_way.next_stop(actor, track, (step + 1) * self._step_us)
        stop = len(track.time) - 1 if stop is None else stop
        return int(track.x[stop]), int(track.y[stop])

    def _is_taken(self, actor: DecidingActor, other: int, step: int, at: int) -> bool:
        """Return whether another body stays where a robot wants to stop next."""
        near = int(self._near[self._number[actor.row], other])
        until = step + self._free_for
        return self._bodies.timelines.takes_stop(
            actor.row, actor.space.mesh, step, at, other, near, until
        )

    def _queues(self, actor: DecidingActor, other: int, step: int, at: int) -> bool:
        """Return whether another body stays at the charger that a robot wants to get to."""
        goes_charging = self._stop_of(actor, at) == _charger(actor)
        return goes_charging and self._is_taken(actor, other, step, at)

    def _rest_of(self, row: int, step: int) -> int:
        """Return the number of steps for which a body surely stays: a power of two."""
        steps = self._free_for
        rests = self._bodies.timelines.rests
        while steps < self._steps(LONGEST_PAUSE) and rests(row, step, step + 2 * steps):
            steps *= 2
        return steps

    def _keeps_its_place(self, now: Situation, at: int, other: int) -> bool:
        """Let a robot yield that wants to stop where another stands; return whether it does."""
        row = now.actor.row
        if other not in self._number or _pair(row, other) in self._swapped:
            return False
        if not self._is_taken(self._actors[other], row, now.step, at):
            return False
        self._swap(row, other, now.step)
        return True

    def _begin_apart(self, actor: DecidingActor) -> None:
        """Move a robot that was drawn into somebody to the nearest free place."""
        start = actor.entity.start
        if actor.state.away or (start is not None and is_point(start)):
            return
        here = actor.state.position
        others = [each for each in self._actors[: actor.row] if not each.state.away]
        points = [each.state.position for each in others]
        positions = np.array(points, np.int64).reshape(-1, 2)
        reach = self._near[self._number[actor.row], [each.row for each in others]]
        squared = ((positions - here) ** 2).sum(axis=1)
        if (squared >= reach * reach).all():
            return
        detour = giving_way.RoutesAround(actor, np.column_stack([positions, reach]))
        beside = giving_way.beside(actor, here, detour)
        beside = beside or giving_way.beside(actor, here, detour, in_room=False)
        if beside is not None:
            actor.state = Pose(*beside, actor.state.heading, 0)

    def _steps(self, duration: timedelta) -> int:
        return max(-(-micros(duration) // self._step_us), 1)


def _pair(row: int, other: int) -> tuple[int, int]:
    return min(row, other), max(row, other)


def _is_stuck(actor: DecidingActor) -> bool:
    return actor.is_stuck or (actor.charge is not None and actor.charge.is_empty)


def _place_inside(actor: DecidingActor) -> LatticePoint:
    """Return the position of a robot, or the nearest place in its space."""
    x, y = actor.state.position
    if actor.space.part_of_cell[y // SUB, x // SUB] == actor.part:
        return x, y
    return actor.space.nearest(x, y, actor.part) or (x, y)


def _charger(actor: DecidingActor) -> LatticePoint | None:
    return None if actor.charge is None else actor.charge.charger


def _goes_somewhere(actor: DecidingActor) -> bool:
    motion = actor.motion
    if not isinstance(motion, Track):
        return True
    track = motion.breakpoints
    return bool(np.ptp(track.x) or np.ptp(track.y))
