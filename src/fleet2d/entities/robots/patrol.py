"""Patrol: a robot's rounds through rooms or along waypoints."""

from collections.abc import Sequence
from datetime import timedelta
from typing import ClassVar, Literal, Self

from pydantic import model_validator

from fleet2d.configuration.components import register
from fleet2d.configuration.problems import problem
from fleet2d.configuration.units import Duration
from fleet2d.entities.behavior import Actor, Behavior, Situation
from fleet2d.entities.place import (
    Place,
    Point,
    available_places,
    avoided_rooms,
    furniture_of,
    is_point,
    lies_in,
    stops_at,
)
from fleet2d.entities.plan import Plan
from fleet2d.entities.robots.approach import stops_with_view, unwatched
from fleet2d.floorplan.plan import Room

MAX_NAMED = 6  # how many rooms a note names


@register("behavior", "patrol")
class Patrol(Behavior):
    """Make rounds: go to each room or waypoint in turn, look around, stay a while, go on.

    In a room the robot stops at the point farthest from its walls, or where it sees the room's
    places. Stops behind a shut door are left out of a round.

    Attributes:
        rooms: The rooms of a round; all: every room that it can enter.
        waypoints: Points [x, y] in metres to go to instead of rooms.
        dwell: How long it stays at each stop.
        order: Stops in the order given, or reshuffled for each round.
        look_around: Turn once on the spot on arriving at a stop.
        avoid: Rooms, or kinds of rooms if the home has them, without stops.
        stop_at: Where it stops in a room that a round names: in its middle, or at up to four points
            from which it sees all places at the room's furniture (without any, 95 % of the floor).
    """

    resumes: ClassVar[bool] = True

    rooms: Literal["all"] | tuple[Place, ...] = "all"
    waypoints: tuple[Point, ...] = ()
    dwell: Duration = timedelta(minutes=5)
    order: Literal["fixed", "random"] = "fixed"
    look_around: bool = True
    avoid: tuple[str, ...] = ()
    stop_at: Literal["middle", "view"] = "middle"

    @model_validator(mode="after")
    def _goes_somewhere(self) -> Self:
        if self.waypoints and self.rooms != "all":
            raise problem("rooms and waypoints are both given: keep one of them")
        if not self.waypoints and not self.rooms:
            raise problem("there is nowhere to go: name rooms, or waypoints, or leave out 'rooms'")
        return self

    def start(self, actor: Actor) -> None:
        """Find the stops, and note what a robot that does nothing else never sees from them."""
        if self.waypoints:
            stops = [actor.point(point) for point in self.waypoints]
        elif self.rooms == "all":
            stops = [s for room in actor.reachable_rooms() for s in self._stops_in(actor, room)]
        else:
            places = available_places(actor, "patrol.rooms", self.rooms)
            stops = [stop for place in places for stop in self._stops_at(actor, place)]
        if self.avoid:
            avoided = avoided_rooms(actor, "patrol.avoid", self.avoid)
            stops = [stop for stop in stops if not lies_in(actor, stop, avoided)]
        self.stops = stops if self.waypoints else list(dict.fromkeys(stops))
        only_patrols = all(isinstance(each, Patrol) for each in actor.behaviors)
        if actor.entity.eyes and self.look_around and only_patrols:
            self._note_unwatched(actor)

    def _stops_at(self, actor: Actor, place: Place) -> list[tuple[int, int]]:
        if self.stop_at == "middle" or is_point(place) or furniture_of(actor, place) is not None:
            return stops_at(actor, place)
        return [
            stop
            for room in actor.rooms(place)  # type: ignore[arg-type]
            for stop in self._stops_in(actor, room)
        ]

    def _stops_in(self, actor: Actor, room: Room) -> Sequence[tuple[int, int]]:
        return stops_with_view(actor, room) if self.stop_at == "view" else [actor.middle(room)]

    def _note_unwatched(self, actor: Actor) -> None:
        hidden = unwatched(actor, self.stops)
        if not hidden:
            return
        more = f", and {len(hidden) - MAX_NAMED} more" if len(hidden) > MAX_NAMED else ""
        hint = "" if self.stop_at == "view" else "; stop_at: view stops where it sees them"
        actor.notes.append(
            f"patrol: people there are never in view from its {len(self.stops)} stops:"
            f" {', '.join(hidden[:MAX_NAMED])}{more}{hint}"
        )

    def decide(self, now: Situation) -> Plan:
        """Plan one round."""
        stops = self.stops
        if self.order == "random":
            stops = now.random("order").shuffled(stops)
        plan, has_stop = now.plan(), False
        for stop in stops:
            if now.actor.may_block_routes and not plan.reaches(*stop):
                continue  # in a later round its door may be open, or its costs lower
            plan.go_to_point(*stop)
            if self.look_around:
                plan.turn_by(1.0)
            plan.stay(self.dwell)
            has_stop = True
        return plan if has_stop else plan.stay(self.dwell)
