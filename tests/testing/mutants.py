"""Seeded bugs: behaviors of Fleet2D that are wrong on purpose, one class each."""

from datetime import timedelta
from typing import Any, ClassVar

from pydantic import model_validator

from fleet2d.entities.behavior import Actor, Situation
from fleet2d.entities.plan import Plan
from fleet2d.entities.robots.dock import Dock
from fleet2d.entities.robots.find import Find
from fleet2d.entities.robots.follow import Come, Follow
from fleet2d.entities.robots.interact import Interact, Opportunistic
from fleet2d.entities.robots.patrol import Patrol, Scheduled
from fleet2d.runtime.clock import midnight_of

LATE = timedelta(seconds=30)
MUCH_LATER = timedelta(minutes=30)


class OtherSettings:
    """Does as if other settings were given."""

    settings: ClassVar[dict[str, Any]]

    @model_validator(mode="before")
    @classmethod
    def _change(cls, data):
        return {**data, **cls.settings}


class Late:
    """Waits for half a minute before its first plan."""

    def start(self, actor: Actor):
        super().start(actor)
        self.has_waited = False

    def decide(self, now: Situation) -> Plan | None:
        is_called = now.command is not None or not getattr(self, "answers", ())
        if self.has_waited or not is_called:
            return super().decide(now)
        self.has_waited = True
        return now.plan().stay(LATE)


def next_room(now: Situation, x, y) -> tuple[int, int]:
    """Return the middle of the room after that of a point [lattice]."""
    rooms = now.actor.reachable_rooms()
    at = now.home.plan.room_at(*now.home.plan.lattice.to_metres((x, y)).tolist())
    index = next(i for i, room in enumerate(rooms) if at is not None and room.name == at.name)
    return now.actor.middle(rooms[(index + 1) % len(rooms)])


class ComeLate(Late, Come):
    """Comes 30 s late."""


class ComeToNextRoom(Come):
    """Comes to the next room."""

    def decide(self, now: Situation) -> Plan | None:
        command = now.take_command("come")
        if command is None:
            return super().decide(now)
        names = [room.name for room in now.actor.reachable_rooms()]
        target = now.actor.rooms(command.place)[0].name
        other = names[(names.index(target) + 1) % len(names)]
        self.command = command._replace(place=(other,))
        return super().decide(now)


class ComeAndGo(OtherSettings, Come):
    """Doesn't wait where it is called to."""

    settings: ClassVar = {"stay": "10 s"}


class FindOther(Find):
    """Looks for Ben."""

    def _commanded_user(self, now: Situation) -> str | None:
        return None if super()._commanded_user(now) is None else "ben"

    def decide(self, now: Situation) -> Plan | None:
        plan = super().decide(now)
        if self.search is not None:
            self.search.user = "ben"
        return plan


class FindLate(Late, Find):
    """Begins to look 30 s late."""


class FindTooNear(Find):
    """Drives up to the person whom it has found."""

    def _approach(self, now: Situation, plan: Plan, x, y) -> Plan:
        user, self.search = self.search.user, None
        goal = now.home.plan.lattice.point_at((x, y))
        return (
            plan.note("found", user)
            .go_to_point(*now.actor.point(now.home.plan.lattice.to_metres(goal).tolist()))
            .stay(self.stay)
        )


class FindFromAfar(Find):
    """Stays where it sees the person."""

    def _approach(self, now: Situation, plan: Plan, x, y) -> Plan:
        user, self.search = self.search.user, None
        return plan.note("found", user)


class FindRarely(OtherSettings, Find):
    """Looks half as often."""

    settings: ClassVar = {"every": "40 min"}


class FollowOther(OtherSettings, Follow):
    """Follows Ben."""

    settings: ClassVar = {"user": "ben"}


class FollowTooNear(OtherSettings, Follow):
    """Keeps 30 cm away."""

    settings: ClassVar = {"distance": 0.3}


class FollowShortly(OtherSettings, Follow):
    """Follows for a minute only, and then rests for an hour."""

    settings: ClassVar = {"longest": "1 min", "cooldown": "1 h"}


class PatrolLate(Late, Patrol):
    """Begins 30 s late."""


class PatrolAnytime(OtherSettings, Patrol):
    """Ignores its hours."""

    settings: ClassVar = {"when": []}


class PatrolNextRooms(Patrol):
    """Goes to the room after each of its rooms."""

    def decide(self, now: Situation) -> Plan:
        stops = self.stops
        self.stops = [next_room(now, *stop) for stop in stops]
        plan = super().decide(now)
        self.stops = stops
        return plan


class PatrolEverywhere(OtherSettings, Patrol):
    """Ignores which rooms it may enter."""

    settings: ClassVar = {"rooms": "all"}


class PatrolWithoutAvoiding(OtherSettings, Patrol):
    """Ignores `no_stops_in`."""

    settings: ClassVar = {"no_stops_in": []}


class DockLate(OtherSettings, Dock):
    """Waits until it is nearly empty."""

    settings: ClassVar = {"threshold": "3 %"}


class DockShortly(OtherSettings, Dock):
    """Leaves the charger too early."""

    settings: ClassVar = {"until": "40 %"}


class GreetAnybody(OtherSettings, Opportunistic):
    """Ignores whom to greet."""

    settings: ClassVar = {"users": []}


class GreetTooNear(OtherSettings, Opportunistic):
    """Comes too near."""

    settings: ClassVar = {"distance": 0.3}


class GreetAgain(OtherSettings, Opportunistic):
    """Greets again every minute."""

    settings: ClassVar = {"again": "1 min"}


class VisitLate(Scheduled):
    """Sets out 30 s late."""

    def _due(self, since):
        yield from ((due + LATE, number) for due, number in super()._due(since - LATE))


class VisitTwice(Scheduled):
    """Comes back an hour later."""

    def _due(self, since):
        hour = timedelta(hours=1)
        again = [(due + hour, number) for due, number in super()._due(midnight_of(since))]
        yield from sorted([*super()._due(since), *(due for due in again if due[0] > since)])


class VisitNextRoom(Scheduled):
    """Goes to the next room."""

    def decide(self, now: Situation) -> Plan | None:
        stops = self.stops
        self.stops = [next_room(now, *stop) for stop in stops]
        plan = super().decide(now)
        self.stops = stops
        return plan


class VisitDaily(Scheduled):
    """Ignores the days of its visits."""

    @model_validator(mode="before")
    @classmethod
    def _change(cls, data):
        return {**data, "visits": [{**visit, "on": "daily"} for visit in data["visits"]]}


class AskLate(Interact):
    """Does nothing for a request that is between half an hour and two and a half hours old."""

    def decide(self, now: Situation) -> Plan | None:
        is_left = now.requests is not None and any(
            request.since + timedelta(hours=2, minutes=30) > now.time > request.since + MUCH_LATER
            for request in now.requests.open
        )
        return None if is_left else super().decide(now)


class AskWithoutSeeking(OtherSettings, Interact):
    """Asks only people who come by."""

    settings: ClassVar = {"seek": False}
