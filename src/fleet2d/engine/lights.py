"""The lights that people switch: on where they are awake in the dark, off when they leave."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from fleet2d.engine.basis import Basis
from fleet2d.entities.behavior import DARK, Actor, HoursSpan, holds
from fleet2d.entities.body import Track
from fleet2d.entities.decisions import DecidingActor, StandStill
from fleet2d.floorplan.home import Home
from fleet2d.floorplan.placed_objects import POSTURES
from fleet2d.kernels import rooms_at
from fleet2d.runtime.events import HOME, Event, EventKind

if TYPE_CHECKING:
    from fleet2d.runtime.clock import Sun

LYING = POSTURES.index("lie")
NOWHERE = -1


def switch(home: Home, rooms: Sequence[int], step: int, *, is_on: bool) -> list[Event]:
    """Switch the lights of rooms; return an event for each that was not so already."""
    kind = EventKind.LIGHT_ON if is_on else EventKind.LIGHT_OFF
    changed = [room for room in rooms if (room in home.unlit) == is_on]
    home.set_lights(changed, is_on=is_on)
    return [Event(step, HOME, kind, home.rooms[room].name) for room in changed]


class PeopleSwitches:
    """What people with `lights` do: each is in one room, or asleep or away.

    All lights are off at first. Who enters a room within the own hours, gets up there, or is there
    when the hours begin, has the light on; who leaves it or lies down switches it off, unless
    another one of these people is there awake. Who has to hold still, after a fall, switches none.
    """

    def __init__(self, basis: Basis) -> None:
        self._home, self._clock, self._bodies = basis.home, basis.clock, basis.bodies
        users = basis.scenario.users.values()
        sun = basis.clock.sun
        self._hours: dict[int, tuple[HoursSpan | Sun, ...]] = {
            row: tuple(sun if span == DARK and sun else span for span in user.lights)
            for row, user in enumerate(users)
            if user.lights
        }
        self._awake_in = dict.fromkeys(self._hours, NOWHERE)
        if self._hours:
            basis.home.set_lights(range(len(basis.home.rooms)), is_on=False)

    def steps(self, row: int, actor: Actor) -> list[int]:
        """Return the steps of a body's new plan at which it may switch a light."""
        if row not in self._hours or not isinstance(actor.motion, Track):
            return []
        first, clock = actor.planned_at, self._clock
        over_at = actor.plan.over_at
        end = clock.steps if over_at is None else min(over_at, clock.steps)
        runs = self._bodies.runs(row, first, max(end, first + 1))
        rooms = rooms_at(self._home.plan.room_of_place, runs.x, runs.y)
        is_awake = (runs.away == 0) & (runs.posture != LYING)
        changes = np.diff(np.where(is_awake, rooms, NOWHERE)) != 0
        steps = [first, *runs.step[1:][changes].tolist()]
        for span in self._hours[row]:
            begin = span.next_begin(clock.time(first))
            while (step := clock.step_at_or_after(clock.elapsed(begin))) < end:
                steps.append(step)
                begin = span.next_begin(begin)
        return steps

    def see_to(self, row: int, actor: Actor, step: int) -> list[Event]:
        """Let a body switch lights where it is at a step; return the events."""
        if isinstance(actor, DecidingActor) and isinstance(actor.order, StandStill):
            return []
        pose, clock, before = actor.state, self._clock, self._awake_in[row]
        is_awake = not pose.away and actor.posture_code(step * clock.step_us) != LYING
        room = self._home.plan.room_at(*self._home.plan.lattice.xy_of(pose.x, pose.y))
        now = NOWHERE if room is None or not is_awake else room.index
        self._awake_in[row] = now
        events: list[Event] = []
        if before not in {NOWHERE, *self._awake_in.values()}:
            events += switch(self._home, [before], step, is_on=False)
        hours, time = self._hours[row], clock.time(step)
        begins = step > 0 and not holds(hours, clock.time(step - 1))
        if now != NOWHERE and holds(hours, time) and (now != before or begins):
            events += switch(self._home, [now], step, is_on=True)
        return events
