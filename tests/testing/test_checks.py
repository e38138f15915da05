"""The check of one's own algorithms: sound ones pass, each broken promise is named."""

import itertools
import random
from typing import Any, ClassVar

import numpy as np
import pytest

from fleet2d import Algorithm, CameraSightings, PerceptionError, RoomDistribution
from fleet2d.sight.built_in_errors import Miscalibration, Outliers
from fleet2d.testing import check_algorithm, check_perception_error

SHARED = [0]


class Sound(Algorithm):
    """Share of sightings, with a draw of its own."""

    def start(self, home):
        self.counts = np.zeros(len(home.rooms))

    def update(self, history, state):
        self.counts += np.bincount(history.observations.room, minlength=len(self.counts))
        self.counts[state.random("noise").below(len(self.counts))] += 1
        return RoomDistribution(self.counts)


class OnSight(Algorithm):
    """Counts who comes into view, when somebody does, and marks where."""

    on: tuple[str, ...] = ("user_seen",)

    def start(self, home):
        self.seen = 0
        self.marks = home.layers.add("marks", "int32")

    def update(self, history, state):
        self.seen += sum(event.event == "user_seen" for event in history.events)
        x, y = history.observations.x[-1], history.observations.y[-1]
        self.marks.set_at(x, y, self.marks.at(x, y) + 1)
        return {"seen": self.seen}

    def remember(self):
        return {"seen": self.seen}


class Dice(Algorithm):
    """Draws from the global generator."""

    def update(self, history, state):
        return {"roll": random.random()}


class Shared(Algorithm):
    """Keeps its state in a global list."""

    def update(self, history, state):
        SHARED[0] += 1
        return {"count": SHARED[0]}


class Opaque(Algorithm):
    """Keeps what no file holds."""

    def start(self, home):
        self.home_again = home

    def update(self, history, state):
        return {"x": 1}


class Fickle(Algorithm):
    """Puts out other columns each time."""

    def update(self, history, state):
        return {f"x{state.step}": 1}


class NotANumber(Algorithm):
    """Puts out NaN."""

    def update(self, history, state):
        return {"x": np.nan}


class Meddler(Algorithm):
    """Moves a room's label for everybody."""

    seen: ClassVar[list[Any]] = []

    def update(self, history, state):
        state.outputs["x"] = 1


@pytest.mark.slow
def test_sound_algorithms_pass():
    check_algorithm(Sound, period="30 min")
    check_algorithm(OnSight)


@pytest.mark.parametrize(
    ("cls", "words"),
    [
        (Dice, "two runs with one seed differ"),
        (Shared, "two runs with one seed differ"),
        (Opaque, "'home_again'"),
        (Fickle, "the names must be the same"),
        (NotANumber, "not finite"),
        (Meddler, "does not support item assignment"),
    ],
)
def test_each_broken_promise_is_named(cls, words):
    with pytest.raises(AssertionError, match=words):
        check_algorithm(cls)


COUNT = itertools.count()


class Counting(PerceptionError):
    """Shifts people by what no seed determines."""

    def distort(self, sightings: CameraSightings) -> CameraSightings:
        return sightings.moved(offset=0.001 * next(COUNT))


class Joint(PerceptionError):
    """Shifts all people of a call by the same, so that it matters how many looks a call has."""

    def distort(self, sightings: CameraSightings) -> CameraSightings:
        return sightings.moved(offset=0.01 * len(sightings))


class Undefined(PerceptionError):
    """Returns what can't be stored."""

    def distort(self, sightings: CameraSightings) -> CameraSightings:
        return sightings.replace(x=np.nan)


def test_the_built_in_errors_pass():
    check_perception_error(Outliers, share="10 %", lasts="5 s")
    check_perception_error(Miscalibration, yaw_deg=3)


@pytest.mark.parametrize(
    ("cls", "message"),
    [
        (Counting, "Counting:\n- two runs with one seed differ"),
        (Joint, "Joint:\n- a run in spans of 7 steps differs: treat each sighting by itself"),
        (Undefined, "errors.checked failed at step .*: x is nan"),
    ],
)
def test_each_problem_is_named(cls, message):
    with pytest.raises(AssertionError, match=message):
        check_perception_error(cls)
