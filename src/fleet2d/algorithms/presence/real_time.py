"""Real-time presence: where each user is now, given all evidence so far."""

from collections.abc import Mapping, Sequence, Set
from datetime import datetime, timedelta
from typing import Annotated, Any, ClassVar, cast

import numpy as np

from fleet2d.algorithms.algorithm import Algorithm, Present
from fleet2d.algorithms.history import History
from fleet2d.algorithms.learned import check_numbers
from fleet2d.algorithms.presence.belief import ANYONE, BeliefSeries, Presence, are_distributions
from fleet2d.algorithms.presence.counts import in_time
from fleet2d.algorithms.presence.model import Model
from fleet2d.configuration.components import OneOf, register
from fleet2d.configuration.units import PositiveDuration
from fleet2d.errors import ComponentError
from fleet2d.floorplan.home.home import Home

SECOND_US = 1_000_000


@register("algorithm", "real_time_presence", aliases=("rtp",))
class RealTimePresence(Algorithm):
    """Where each user, and anyone, is now: P(room | all evidence so far).

    Its output is a `Presence` at the time of the update; `at` forecasts later times, as far as the
    model can. There is none until the first whole bin (a minute, or a step where that is longer).

    Attributes:
        period: How often it is updated.
        model: The model that computes it.
    """

    needs: ClassVar[Set[str]] = frozenset({"evidence"})

    period: PositiveDuration = timedelta(minutes=5)
    model: Annotated[Model, OneOf("presence_model")] = cast("Any", "hmm")

    def start(self, home: Home) -> None:
        """Begin without evidence."""
        self.rooms = len(home.rooms)
        self.has_begun = False
        self.learned_state: Mapping[str, Any] | None = None

    def update(self, history: History, state: Present) -> Presence | None:
        """Process the evidence of the period; return the present belief."""
        step_us = round(history.step_s * SECOND_US)
        evidence = history.evidence
        bins = in_time(evidence, state.start, step_us)
        if not self.has_begun:
            self._begin(state)
        if not len(bins.day):
            return None
        home, away = self.model.observe(bins)
        self._check(home, away, len(bins.day), state)
        track = BeliefSeries(evidence.begin, evidence.bin_steps, home, away)
        time = state.start + timedelta(
            microseconds=(evidence.begin + len(bins.day) * bins.bin_steps) * step_us
        )
        return self.model.presence(state.users, time, bins.bin_steps * step_us, track)

    def _begin(self, state: Present) -> None:
        self._prepare(self.model, len(state.users), state.start)
        self.has_begun = True

    def _prepare(self, model: Model, users: int, start: datetime) -> None:
        model.begin(self.rooms, users, start.toordinal())
        if self.learned_state is not None:
            model.recall(self.learned_state)

    def check_learned(self, users: Sequence[str], start: datetime) -> None:
        """Restore the learned state in a copy, which raises if it doesn't fit the users."""
        if self.learned_state is not None:
            check_numbers("", self.learned_state, self.type_name)
            self._prepare(self.model.model_copy(deep=True), len(users), start)

    def _check(self, home: Any, away: Any, bins: int, state: Present) -> None:
        """Refuse a model's belief if it has wrong shapes or isn't a distribution."""
        users = len(state.users) + 1
        shapes = np.shape(home), np.shape(away)
        expected = (bins, users, self.rooms), (bins, users)
        if shapes != expected:
            raise ComponentError(
                f"the model {self.model.type_name} returned arrays of shapes {shapes[0]} and"
                f" {shapes[1]}, expected {expected[0]} (rooms, given at home) and {expected[1]}"
                f" (away) for {bins} bins, {users - 1} users and anyone, and {self.rooms} rooms"
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

    def remember(self) -> dict[str, Any]:
        """Return the learned state, from which another run can start."""
        if not self.has_begun:
            return {} if self.learned_state is None else dict(self.learned_state)
        return self.model.remember()

    def recall(self, learned: Mapping[str, Any]) -> None:
        """Restore the learned state of another run."""
        self.learned_state = learned or None
