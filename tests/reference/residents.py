"""Slow, obvious twin of residents: activities leg by leg of a plan, as a person does them."""

from datetime import timedelta

from fleet2d._core import Bits
from fleet2d.entities.users.resident import KnownHome, Seat, Spot
from fleet2d.kernels import TURN, turn_between
from fleet2d.routines.distributions import exponential
from fleet2d.routines.planner import PLANNED, RESUMES
from fleet2d.runtime.determinism import Draws

SECOND_US = 1_000_000
AnyPlace = Spot | Seat


class SlowHome(KnownHome):
    """A home in which a person does activities by Python alone."""

    def __init__(self, person, actor):
        super().__init__(person, actor)
        self.number = -1
        self.place = None
        self.base = None

    def in_core(self, name, venue):
        return name, venue

    def live(self, plan, stints, until_us, *, continues):
        began_us = plan.time_us
        for (name, venue), number, end_us, role, stays in stints:
            if plan.time_us >= until_us:
                return
            if plan.time_us >= end_us:
                continue
            if not venue.rooms and not venue.activity.away:
                if plan.time_us == began_us:
                    plan.note("way_blocked", name).stay_until(end_us)
                return
            again = continues and number == self.number
            draws = Draws(self._person.key, number + 512 * again)
            if not again:
                self.begin(plan, name, venue, role, stays, draws)
            if self.place is not None and venue.small_moves:
                self.place = self.move_about(plan, venue, self.place, end_us, draws)
            self.number = number
            plan.stay_until(end_us)

    def begin(self, plan, name, venue, role, stays, draws):
        self.place = None
        if role == PLANNED:
            self.base = None
        if venue.activity.away:
            plan.leave_home()
        elif not stays:
            if role == RESUMES and self.base is not None:
                self.place = self.base
                self.settle(plan, venue, self.base)
            else:
                self.place = self.choose(plan, venue, draws)
            if role == PLANNED:
                self.base = self.place
        plan.note("activity", name)

    def go(self, plan, activity, venue, draws):
        self.choose(plan, venue, draws)

    def choose(self, plan, venue, draws):
        """Go to where an activity is done."""
        kind, spots = venue.activity.choose, self._person.spots
        rooms, seats = venue.rooms, venue.seats
        place: AnyPlace
        if kind == "here":
            plan.come_home()
            room = self._actor.home.plan.room_of_point(plan.x, plan.y)
            seats = [] if room is None else self.seats_in(venue, room)
            place = draws.choice(seats) if seats else Spot(plan.x, plan.y)
        else:
            if kind == "nearest" and len(rooms) > 1:
                rooms = [spots.nearest(rooms, plan.x, plan.y)]
                seats = self.seats_in(venue, rooms[0])
            room = draws.choice(rooms)
            if kind == "each_time":
                seats = self.seats_in(venue, room)
            place = draws.choice(seats or spots.in_room(room))
        self.settle(plan, venue, place)
        return place

    def seats_in(self, venue, room):
        activity = venue.activity
        return self._person.spots.at_furniture(activity, (room,))

    def settle(self, plan, venue, place):
        if isinstance(place, Seat):
            plan.use(*place)
        else:
            place.walk(plan)
        if venue.activity.posture != "stand":
            plan.take(venue.activity.posture)

    def move_about(self, plan, venue, place, end_us, draws):
        """Turn, move and fetch things, each after times of its own."""
        bits, end_us, facing = Bits(draws), end_us - 90 * SECOND_US, plan.heading
        means = dict(venue.small_moves)

        def wait(kind):
            return exponential(means[kind]).knots[bits.take(7)] * SECOND_US

        due = {kind: plan.time_us + wait(kind) for kind in means}
        while min(due.values()) < end_us:
            kind = min(due, key=lambda kind: due[kind])
            if kind == "shifts":
                others = [time for other, time in due.items() if other != kind]
                while due[kind] < min([end_us, *(time + 1 for time in others)]):
                    plan.stay_until(due[kind])
                    towards = (facing + bits.take(10) - 512) % TURN
                    plan._turn(turn_between(plan.heading, towards))
                    due[kind] = plan.time_us + wait(kind)
                continue
            plan.stay_until(due[kind])
            if kind == "fetches":
                self.fetch(plan, venue, place, end_us, draws)
            elif venue.seats and isinstance(place, Spot):
                place = self.choose(plan, venue, draws)
            else:
                place = draws.choice(self._person.spots.in_room(draws.choice(venue.rooms)))
                place.walk(plan)
            facing = plan.heading
            due[kind] = plan.time_us + wait(kind)
        return place

    def fetch(self, plan, venue, place, end_us, draws):
        if not venue.stores or venue.fetch_takes is None:
            return
        takes_us = venue.fetch_takes.draw(draws) * SECOND_US
        room = draws.choice(venue.stores)
        spot = draws.choice(self._person.spots.in_room(room))
        wait_us = self.wait(room.index, plan.time_us, takes_us)
        if wait_us is not None and plan.time_us + wait_us + takes_us < end_us:
            plan.stay_until(plan.time_us + wait_us)
            spot.walk(plan)
            plan.stay(timedelta(microseconds=takes_us))
            self.settle(plan, venue, place)
