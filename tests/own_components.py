"""Behaviors, algorithms and metrics as a user would write them, for the tests of whole runs."""

import signal
from collections.abc import Mapping
from datetime import timedelta
from typing import Any

import numpy as np
from pydantic import PrivateAttr

from fleet2d import (
    Algorithm,
    Behavior,
    Duration,
    History,
    Home,
    Metric,
    Plan,
    Present,
    RoomDistribution,
    Situation,
)


class Greet(Behavior):
    """Turn to who comes into view, look for who is lost; between that, go here and there at times."""

    patience: Duration = timedelta(minutes=2)

    def start(self, actor: Any) -> None:
        self.greeted = 0

    def decide(self, now: Situation) -> Plan | None:
        plan = now.plan().interrupt_on("user_seen", "user_lost")
        for event in now.events:
            plan.note("reacts", f"{event.event} {event.user} {event.x:.3f} {event.y:.3f}")
        if any(event.event == "user_lost" for event in now.events):
            return plan.turn_by(-0.75)
        if now.events:
            self.greeted += 1
            return plan.turn_by(0.1 * self.greeted).stay(self.patience)
        draws = now.random("wander")
        if draws.uniform() < 0.3:
            return None
        room = draws.choice(["kitchen", "bedroom", "bathroom", "living_room"])
        return plan.go_to(room).stay(self.patience)


class Obey(Behavior):
    """Go where the algorithm `share` says that somebody was seen most."""

    records = frozenset({"obeys"})

    def decide(self, now: Situation) -> Plan | None:
        plan = now.plan()
        if "share" in now.outputs:
            best = int(np.argmax(now.outputs["share"].share))
            plan.go_to(now.home.rooms[best].name, "obey").note("obeys", now.home.rooms[best].name)
        return plan.stay(timedelta(seconds=47))


class Scripted(Behavior):
    """Follow a list of steps: room names, points, seconds to stay, 'leave', 'home' and 'call'."""

    script: tuple[str | float | tuple[float, float], ...] = ()

    def start(self, actor: Any) -> None:
        self.done = False

    def decide(self, now: Situation) -> Plan | None:
        if self.done:
            return None
        self.done = True
        plan = now.plan()
        for item in self.script:
            if item == "call":
                plan.call()
            elif item == "leave":
                plan.leave_home()
            elif item == "home":
                plan.come_home()
            elif isinstance(item, str | tuple):
                plan.go_to(item)
            else:
                plan.stay(timedelta(seconds=item))
        return plan


class Share(Algorithm):
    """Share of sightings per room."""

    def start(self, home: Home) -> None:
        self.counts = np.zeros(len(home.rooms))

    def update(self, history: History, state: Present) -> RoomDistribution:
        self.counts += np.bincount(history.observations.room, minlength=len(self.counts))
        return RoomDistribution(self.counts)


class Smooth(Algorithm):
    """Mean of the latest and the former shares."""

    def start(self, home: Home) -> None:
        self.mean = np.full(len(home.rooms), 1 / len(home.rooms))

    def update(self, history: History, state: Present) -> Mapping[str, Any]:
        self.mean = (self.mean + state.outputs["share"].share) / 2
        return {"room": [room.name for room in state.home.rooms], "mean": self.mean}


class Tick(Algorithm):
    """Count the steps, and store a row now and then."""

    def start(self, home: Home) -> None:
        self.ticks = self.sightings = 0

    def update(self, history: History, state: Present) -> Mapping[str, Any] | None:
        self.ticks += len(history)
        self.sightings += len(history.observations.step)
        lucky = state.random("luck").below(100) == 0
        return {"ticks": self.ticks, "sightings": self.sightings} if lucky else None


class Spy(Metric):
    """Record what each update was handed."""

    def start(self, home: Home) -> None:
        self.handed: list[tuple[int, int]] = []

    def update(self, history: History, state: Present) -> None:
        self.handed.append((history.first, history.end))

    def result(self) -> dict[str, Any]:
        return {"handed": self.handed}


class Visited(Metric):
    """The share of time in the bathroom, of who was there at all."""

    def start(self, home: Home) -> None:
        self.room = home.plan.room("bathroom_1").index
        self.steps: dict[str, list[bool]] = {}

    def update(self, history: History, state: Present) -> None:
        for user in state.users:
            there = history.poses(user).room == self.room
            self.steps.setdefault(user, []).extend(there.tolist())

    def result(self) -> dict[str, Any]:
        return {user: sum(steps) / len(steps) for user, steps in self.steps.items() if any(steps)}


class Impatient(Algorithm):
    """Presses Ctrl-C twice during an update."""

    def start(self, home: Any) -> None:
        self.lived_to_see: list[str] = []

    def update(self, history: History, state: Present) -> None:
        self.lived_to_see.append("first")
        signal.raise_signal(signal.SIGINT)
        self.lived_to_see.append("second")
        signal.raise_signal(signal.SIGINT)
        self.lived_to_see.append("nothing of this")


class Keeper(Algorithm):
    """Counts in an array and a list of its own, and puts out the array itself."""

    _seen: list[int] = PrivateAttr(default_factory=list)

    def start(self, home: Any) -> None:
        self.count = np.zeros(1, np.int64)

    def update(self, history: History, state: Present) -> dict[str, Any]:
        self.count += 1
        self._seen.append(state.step)
        return {"n": self.count, "seen": len(self._seen)}


class Peek(Algorithm):
    """Looks at what another put out, without saying that it reads it."""

    of: str = "keeper"

    def update(self, history: History, state: Present) -> dict[str, Any]:
        return {"seen": int(state.outputs[self.of]["n"][0]) if self.of in state.outputs else -1}


class Scribbler(Behavior):
    """Writes where it may only read."""

    def decide(self, now: Situation) -> Plan:
        now.outputs["mine"] = 1  # type: ignore[index]
        return now.plan().stay()


class Late(Algorithm):
    """Has seen nobody in its first period."""

    def update(self, history: History, state: Present) -> dict[str, Any]:
        return {"user": ["ana"] if state.step > 100 else []}


class Bad(Algorithm):
    """Fails."""

    def update(self, history: History, state: Present) -> None:
        raise RuntimeError("no model today")


class Fidget(Behavior):
    """Go somewhere, stand, sit or lie there for a while, doing something, and go on."""

    def decide(self, now: Situation) -> Plan | None:
        draws = now.random("fidget")
        plan = now.plan().go_to("hall").take(draws.choice(["stand", "sit", "lie"]))
        plan.turn_by(draws.uniform()).note("activity", draws.choice(["cook", "read", "sleep"]))
        return plan.stay(timedelta(seconds=30 + draws.below(60)))


class Lounge(Behavior):
    """Sit down on the first seat of the home for a minute, once."""

    def start(self, actor: Any) -> None:
        self.done = False

    def decide(self, now: Situation) -> Plan | None:
        if self.done:
            return None
        self.done = True
        seat = next(t for t in now.home.objects if any(u.posture == "sit" for u in t.uses))
        return now.plan().use(seat).stay(timedelta(minutes=1))
