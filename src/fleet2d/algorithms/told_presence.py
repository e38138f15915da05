"""Told presence: a belief about where people are, corrected by what others told the robot."""

from datetime import timedelta
from typing import Any, NamedTuple

import numpy as np

from fleet2d.algorithms.algorithm import Algorithm, Present
from fleet2d.algorithms.history import History
from fleet2d.algorithms.presence.belief import BeliefSeries, Presence
from fleet2d.configuration.components import register
from fleet2d.configuration.units import PositiveDuration
from fleet2d.errors import ComponentError
from fleet2d.floorplan.home import Home
from fleet2d.kernels import F64
from fleet2d.runtime.determinism import exp2


class Told(NamedTuple):
    """What somebody said about where a person is.

    Attributes:
        step: When.
        where: "away", "home", or the name of a room.
    """

    step: int
    where: str


@register("algorithm", "told_presence")
class ToldPresence(Algorithm):
    """Real-time presence, corrected by the answers to questions like "is Ben at home?".

    An interaction `{do: ask, about: ben}` that is accepted tells the robot where ben is, as far as
    the person who was asked knows (event `told`). The belief of the algorithm in `reads` about him
    is mixed with that: w answer + (1 - w) belief, where w halves in `half_life`, until the robot
    sees him. It reads evidence only.

    Attributes:
        half_life: Time after which an answer counts half.
    """

    period: PositiveDuration = timedelta(minutes=5)
    half_life: PositiveDuration = timedelta(hours=1)

    def start(self, home: Home) -> None:
        """Begin without answers."""
        if len(self.reads) != 1:
            raise ComponentError("give `reads: [rtp]`, the presence that answers correct")
        self.rooms = {room.name: room.index for room in home.rooms}
        self.told: dict[str, list[Told]] = {}  # in the present period, the last one before it first

    def update(self, history: History, state: Present) -> Any:
        """Correct each bin of the belief by what the robot was told before."""
        belief = state.outputs.get(self.reads[0])
        if belief is None:
            return None
        if not isinstance(belief, Presence) or belief.track is None:
            raise ComponentError(f"{self.reads[0]!r} is no real-time presence: name one in `reads`")
        for event in history.events:
            name, _, where = event.detail.partition(" ")
            if event.event == "told" and name in state.users:
                self.told.setdefault(name, []).append(Told(event.step, where))
            elif event.event == "user_seen" and event.detail in state.users:
                self.told.setdefault(event.detail, []).append(Told(event.step, ""))
        track, step_s = belief.track, history.step_s
        home, away = track.home.copy(), track.away.copy()
        for row, name in enumerate(state.users):
            for number in range(len(home)):
                end = track.begin + (number + 1) * track.bin_steps
                told = [each for each in self.told.get(name, []) if each.step < end]
                if told and told[-1].where:
                    age = timedelta(seconds=(end - told[-1].step) * step_s)
                    self._mix(home[number, row], away[number], row, told[-1], age)
        if self.told:
            away[:, -1] = np.multiply.reduce(away[:, :-1], axis=1)
        self.told = {name: told[-1:] for name, told in self.told.items()}
        series = BeliefSeries(track.begin, track.bin_steps, home, away)
        return Presence(state.users, home[-1].copy(), away[-1].copy(), belief.time, track=series)

    def _mix(self, share: F64, away: F64, row: int, told: Told, age: timedelta) -> None:
        """Mix the belief about a person in a bin, which is changed, with an answer of some age."""
        weight = exp2(-(age / self.half_life))
        joint = share * (1 - away[row])
        if told.where in self.rooms:
            answer, is_away = np.zeros(len(share)), 0.0
            answer[self.rooms[told.where]] = 1
        else:
            is_away = float(told.where == "away")
            answer = share * (1 - is_away)
        joint = weight * answer + (1 - weight) * joint
        away[row] = weight * is_away + (1 - weight) * away[row]
        if away[row] < 1:
            share[:] = joint / joint.sum()
