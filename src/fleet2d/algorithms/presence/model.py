"""Real-time presence: the algorithm, the base of its models, simple ones, and answers of people."""

from collections.abc import Mapping, Sequence
from datetime import datetime, timedelta
from itertools import pairwise
from typing import Any, ClassVar, NamedTuple, cast

import numpy as np
from pydantic import Field

from fleet2d.algorithms.algorithm import Algorithm, Present
from fleet2d.algorithms.evidence import Evidence
from fleet2d.algorithms.history import History
from fleet2d.algorithms.presence.belief import (
    ANYONE,
    AWAY,
    HOURS,
    BeliefSeries,
    Presence,
    WeeklyPresence,
    belief_labels,
    check_distributions,
)
from fleet2d.algorithms.presence.estimator import SECOND_US, Estimator
from fleet2d.algorithms.presence.long_term import PresenceAlgorithm
from fleet2d.configuration.components import Component, OneOf
from fleet2d.configuration.units import PositiveDuration, whole_steps
from fleet2d.errors import ComponentError
from fleet2d.floorplan.home import Home
from fleet2d.kernels import F64
from fleet2d.runtime.determinism import exp2
from fleet2d.runtime.events import EventKind

NEVER = -1


class Model(Component):
    """Base of models of where people are now; a subclass writes `observe` and `presence`.

    A scenario names a model of your own, such as one learned elsewhere, by `model: module:Class`.
    """

    kind = "presence_model"
    # Whether the belief after a bin is the same however many bins `observe` gets at a time.
    is_by_bin: ClassVar[bool] = False

    def check(self) -> None:
        """Refuse files that it can't use; called when a run is set up.

        Raises:
            InputError: A file is damaged, or of something else.
        """

    def begin(self, home: Home, users: Sequence[str], start: datetime) -> None:
        """Prepare for a run.

        Args:
            home: The home: its rooms, with their kinds and floor, and the ways between them.
            users: Names of the users.
            start: Local time at which the run begins; each bin of evidence has its own.
        """
        self.rooms = len(home.rooms)
        self.users = len(users)
        self.day = start.toordinal()

    def observe(self, evidence: Evidence) -> tuple[F64, F64]:
        """Process the next bins of evidence; return the belief after each bin.

        The belief after a bin may use evidence up to that bin only.

        Returns:
            Shares of rooms given at home, float64 (bins, users + 1, rooms), and of away, float64
            (bins, users + 1).
        """
        raise NotImplementedError

    def presence(
        self, users: Sequence[str], time: datetime, bin_us: int, track: BeliefSeries
    ) -> Presence:
        """Return the present belief, which may forecast later times by `at`.

        Args:
            users: Names of the users.
            time: Local time at which the last bin ended.
            bin_us: Length of a bin [us].
            track: The belief at the end of each bin; its last bin is the present belief.
        """
        return Presence(users, track.home[-1], track.away[-1], time, track=track)

    def remember(self) -> dict[str, Any]:
        """Return the learned state, as arrays in mappings."""
        return {}

    def recall(self, learned: Mapping[str, Any]) -> None:
        """Restore what `remember` returned; called after `begin`."""


class LastSeen(Model):
    """Probability 1 for the room in which the user was perceived last; uniform before that.

    In a bin with sightings in several rooms, the room with most of them counts; nobody is ever
    away. The naive baseline: right just after a sighting, and overconfident later.
    """

    is_by_bin = True

    def begin(self, home: Home, users: Sequence[str], start: datetime) -> None:
        """Prepare for a run."""
        super().begin(home, users, start)
        self.last = np.full(self.users + 1, NEVER)

    def observe(self, evidence: Evidence) -> tuple[F64, F64]:
        """Return the last room of each user after each bin."""
        seen = evidence.seen
        room = np.where(np.any(seen > 0, axis=2), seen.argmax(axis=2), NEVER)
        room = np.concatenate([self.last[np.newaxis], room])
        newest = np.where(room != NEVER, np.arange(len(room))[:, np.newaxis], 0)
        room = np.take_along_axis(room, np.maximum.accumulate(newest, axis=0), axis=0)
        self.last = room[-1]
        home = (room[1:, :, np.newaxis] == np.arange(self.rooms)).astype(np.float64)
        home[room[1:] == NEVER] = 1 / self.rooms
        return home, np.zeros(home.shape[:2])


class LongTerm(Model):
    """Long-term presence, regardless of recent sightings.

    Attributes:
        estimator: The estimator of long-term presence.
    """

    estimator: OneOf[Estimator] = cast("Any", "likelihood")

    def begin(self, home: Home, users: Sequence[str], start: datetime) -> None:
        """Prepare for a run."""
        super().begin(home, users, start)
        self.estimator.begin(self.rooms, self.users)

    def observe(self, evidence: Evidence) -> tuple[F64, F64]:
        """Return the belief before these bins, repeated for each of them."""
        home, away = self.estimator.shares(self.estimator.counts.total)
        self.estimator.observe(evidence)
        count = len(evidence)
        return np.repeat(home[np.newaxis], count, axis=0), np.repeat(away[np.newaxis], count, 0)

    def remember(self) -> dict[str, Any]:
        """Return the learned state, as arrays in mappings."""
        return self.estimator.remember()

    def recall(self, learned: Mapping[str, Any]) -> None:
        """Restore what `remember` returned; called after `begin`."""
        self.estimator.recall(learned, self.day)


class HourOfWeek(LongTerm):
    """Long-term presence of the hour of the week, regardless of recent sightings.

    Attributes:
        smoothing: Bins of average evidence added to each hour.
    """

    smoothing: float = Field(default=60, gt=0)

    def observe(self, evidence: Evidence) -> tuple[F64, F64]:
        """Return the belief before these bins, for the hour of each of them."""
        home, away = self.week()
        self.estimator.observe(evidence)
        hour = ((evidence.day - 1) * 24 + evidence.minute // 60) % HOURS
        return home[hour], away[hour]

    def week(self) -> tuple[F64, F64]:
        """Return shares of rooms and of away for each hour of the week."""
        return self.estimator.shares(self.estimator.smoothed_week(self.smoothing))

    def presence(
        self, users: Sequence[str], time: datetime, bin_us: int, track: BeliefSeries
    ) -> Presence:
        """Return the belief for the present hour, and by `at` for others."""
        return WeeklyPresence(users, self.week(), time, track=track)


class RealTimePresence(PresenceAlgorithm):
    """Where each user, and anyone, is now: P(room | all evidence so far).

    Its output is a `Presence` at the time of the update; `at` forecasts later times, as far as the
    model can. There is none until the first whole bin (a minute, or a step where that is longer).

    Attributes:
        period: How often it is updated.
        model: The model that computes it.
    """

    is_real_time = True

    period: PositiveDuration = timedelta(minutes=5)
    model: OneOf[Model] = cast("Any", "learned")

    def start(self, home: Home) -> None:
        """Begin without evidence, with a model that has usable files."""
        super().start(home)
        self.model.check()

    def update(self, history: History, state: Present) -> Presence | None:
        """Process the evidence of the period; return the present belief."""
        self._begin_once(state)
        evidence = history.evidence
        return self._process(evidence, history.step_s, state) if len(evidence) else None

    def _process(self, evidence: Evidence, step_s: float, state: Present) -> Presence:
        """Process evidence of a bin or more; return the belief after it."""
        home, away = self.model.observe(evidence)
        self._check(home, away, len(evidence), state)
        track = BeliefSeries(evidence.begin, evidence.bin_steps, home, away)
        step_us = round(step_s * SECOND_US)
        steps = evidence.begin + len(evidence) * evidence.bin_steps
        time = state.start + timedelta(microseconds=steps * step_us)
        return self.model.presence(state.users, time, evidence.bin_steps * step_us, track)

    @property
    def _learner(self) -> Model:
        return self.model

    def _prepare(self, learner: Model, users: Sequence[str], start: datetime) -> None:
        learner.begin(self.home, users, start)
        if self.learned_state is not None:
            learner.recall(self.learned_state)

    def _check(self, home: Any, away: Any, bins: int, state: Present) -> None:
        """Refuse a model's belief if it has wrong shapes or isn't a distribution."""
        users = len(state.users) + 1
        rooms = len(self.home.rooms)
        shapes = np.shape(home), np.shape(away)
        expected = (bins, users, rooms), (bins, users)
        if shapes != expected:
            raise ComponentError(
                f"the model {self.model.type_name} returned arrays of shapes {shapes[0]} and"
                f" {shapes[1]}, expected {expected[0]} (rooms, given at home) and {expected[1]}"
                f" (away) for {bins} bins, {users - 1} users and anyone, and {rooms} rooms"
            )
        source = f"the model {self.model.type_name} returned a wrong belief: "
        check_distributions(home, away, (*state.users, ANYONE), source)


class BeliefTable(RealTimePresence):
    """The belief of a model of real-time presence at regular times, as rows of a table.

    The rows are those that `real_time_presence` stores with the period `every`, up to rounding. But
    there is no present belief, which anything could read during the run, and models that follow
    people bin by bin get the evidence of a whole `period` at once, which is many times as fast.

    Columns: `at`, the step of the belief; `user`; `room`, or away; `share`, of rooms given at home.

    Attributes:
        every: Time between two beliefs.
    """

    period: PositiveDuration = timedelta(hours=1)
    every: PositiveDuration = timedelta(minutes=5)

    def update(self, history: History, state: Present) -> Any:
        """Process the evidence of the period; return its beliefs, None without any."""
        self._begin_once(state)
        evidence = history.evidence
        step_us = round(history.step_s * SECOND_US)
        bin_steps = evidence.bin_steps
        every = whole_steps(self.every, step_us, f"{state.path}.every", ComponentError)
        if every % bin_steps:
            raise ComponentError(f"{state.path}.every must be a whole number of minutes")
        first = evidence.begin
        end = evidence.begin + len(evidence) * bin_steps
        due = np.arange(first // every + 1, end // every + 1) * every
        bins = (due - first) // bin_steps  # that are over by then
        # With islands, the rooms watched in the whole evidence bound the places of people.
        is_whole = self.model.is_by_bin and evidence.by_patch.island is None
        ends = [len(evidence)] if is_whole else [*bins.tolist(), len(evidence)]
        parts = [evidence.between(a, b) for a, b in pairwise([0, *ends]) if a < b]
        beliefs = [self._process(part, history.step_s, state) for part in parts]
        if not len(due):
            return None
        if is_whole:
            track = beliefs[0].track
            assert track is not None, "models that go bin by bin have one"
            home = track.home[bins - 1]
            away = track.away[bins - 1]
        else:
            in_time = [belief.arrays for belief in beliefs[: len(due)]]
            home, away = map(np.array, zip(*in_time, strict=True))
        names = (*state.users, ANYONE)
        places = (*(room.name for room in self.home.rooms), AWAY)
        labels = belief_labels(names, places)
        columns = {"at": np.repeat(due - 1, len(names) * len(places))}
        columns |= {name: np.tile(label, len(due)) for name, label in labels.items()}
        columns["share"] = np.concatenate([home, away[..., np.newaxis]], axis=2).ravel()
        return columns


class Told(NamedTuple):
    """An answer to the question where a person is.

    Attributes:
        step: When.
        where: "away", "home", or the name of a room.
    """

    step: int
    where: str


class ToldPresence(Algorithm):
    """Real-time presence, corrected by the answers to questions like "is Ben at home?".

    An interaction `{do: ask, about: ben}` that is accepted tells the robot where ben is, as far as
    the person who was asked knows (event `told`). The belief of the algorithm in `reads` about him
    is mixed with that: w answer + (1 - w) belief, where w halves in `half_life`, until the robot
    sees him. It reads evidence only.

    Attributes:
        half_life: Time after which an answer counts half.
    """

    is_real_time = True

    period: PositiveDuration = timedelta(minutes=5)
    half_life: PositiveDuration = timedelta(hours=1)

    def long_term_state(self) -> Mapping[str, Any]:
        """Return nothing: answers are about the present."""
        return {}

    def start(self, home: Home) -> None:
        """Begin without answers."""
        self.rooms = {room.name: room.index for room in home.rooms}
        self.told: dict[str, list[Told]] = {}  # in the present period, the last one before it first

    def check_sources(self, sources: Mapping[str, Algorithm]) -> None:
        """Refuse anything but one presence; the output of your own class shows in the run."""
        if len(sources) != 1:
            raise ComponentError("give `reads: [rtp]`, the presence that answers correct")
        for name, source in sources.items():
            is_presence = isinstance(source, RealTimePresence | ToldPresence)
            is_own = not type(source).__module__.startswith("fleet2d.")
            if not (is_presence or is_own) or isinstance(source, BeliefTable):
                raise self._not_presence(name)

    def _not_presence(self, name: str) -> ComponentError:
        return ComponentError(f"{name!r} is not a real-time presence: name one in `reads`")

    def update(self, history: History, state: Present) -> Any:
        """Correct each bin of the belief by earlier answers of people."""
        belief = state.outputs.get(self.reads[0])
        if belief is None:
            return None
        if not isinstance(belief, Presence) or belief.track is None:
            raise self._not_presence(self.reads[0])
        for event in history.events:
            name, _, where = event.detail.partition(" ")
            if event.event == EventKind.TOLD and name in state.users:
                self.told.setdefault(name, []).append(Told(event.step, where))
            elif event.event == EventKind.USER_SEEN and event.detail in state.users:
                self.told.setdefault(event.detail, []).append(Told(event.step, ""))
        track = belief.track
        step_s = history.step_s
        home = track.home.copy()
        away = track.away.copy()
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
            answer = np.zeros(len(share))
            is_away = 0.0
            answer[self.rooms[told.where]] = 1
        else:
            is_away = float(told.where == "away")
            answer = share * (1 - is_away)
        joint = weight * answer + (1 - weight) * joint
        away[row] = weight * is_away + (1 - weight) * away[row]
        if away[row] < 1:
            share[:] = joint / joint.sum()
