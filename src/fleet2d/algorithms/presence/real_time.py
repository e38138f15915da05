"""Real-time presence: where each user is now, given all evidence so far."""

from collections.abc import Sequence
from datetime import datetime, timedelta
from typing import Annotated, Any, cast

import numpy as np

from fleet2d.algorithms.algorithm import Present
from fleet2d.algorithms.history import History
from fleet2d.algorithms.presence.belief import ANYONE, BeliefSeries, Presence, are_distributions
from fleet2d.algorithms.presence.long_term import SECOND_US, PresenceAlgorithm
from fleet2d.algorithms.presence.model import Model
from fleet2d.configuration.components import OneOf, register
from fleet2d.configuration.units import PositiveDuration
from fleet2d.errors import ComponentError
from fleet2d.floorplan.home import Home


@register("algorithm", "real_time_presence", aliases=("rtp",))
class RealTimePresence(PresenceAlgorithm):
    """Where each user, and anyone, is now: P(room | all evidence so far).

    Its output is a `Presence` at the time of the update; `at` forecasts later times, as far as the
    model can. There is none until the first whole bin (a minute, or a step where that is longer).

    Attributes:
        period: How often it is updated.
        model: The model that computes it.
    """

    period: PositiveDuration = timedelta(minutes=5)
    model: Annotated[Model, OneOf("presence_model")] = cast("Any", "hmm")

    def start(self, home: Home) -> None:
        """Begin without evidence, with a model whose files can be used."""
        super().start(home)
        self.model.check()

    def update(self, history: History, state: Present) -> Presence | None:
        """Process the evidence of the period; return the present belief."""
        self._begin_once(state)
        evidence = history.evidence
        if not len(evidence):
            return None
        home, away = self.model.observe(evidence)
        self._check(home, away, len(evidence), state)
        track = BeliefSeries(evidence.begin, evidence.bin_steps, home, away)
        step_us = round(history.step_s * SECOND_US)
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
        users, rooms = len(state.users) + 1, len(self.home.rooms)
        shapes = np.shape(home), np.shape(away)
        expected = (bins, users, rooms), (bins, users)
        if shapes != expected:
            raise ComponentError(
                f"the model {self.model.type_name} returned arrays of shapes {shapes[0]} and"
                f" {shapes[1]}, expected {expected[0]} (rooms, given at home) and {expected[1]}"
                f" (away) for {bins} bins, {users - 1} users and anyone, and {rooms} rooms"
            )
        is_valid = are_distributions(home, away)
        if not is_valid.all():
            k, row = np.argwhere(~is_valid)[0].tolist()
            raise ComponentError(
                f"the model {self.model.type_name} returned no distribution for"
                f" {(*state.users, ANYONE)[row]!r} in bin {k} of {bins}: shares"
                f" {home[k, row].tolist()}, which sum to {home[k, row].sum():g}, away"
                f" {away[k, row]:g}"
            )
