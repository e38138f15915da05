"""Real-time presence: where each user is now, given all that was and wasn't seen."""

from collections.abc import Mapping, Sequence, Set
from datetime import datetime, timedelta
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, cast

import numpy as np
from pydantic import Field

from fleet2d.algorithms.algorithm import Algorithm, Present
from fleet2d.algorithms.history import History
from fleet2d.algorithms.learned import check_numbers
from fleet2d.algorithms.presence.belief import ANYONE, Presence, Track, are_distributions
from fleet2d.algorithms.presence.counts import in_time
from fleet2d.algorithms.presence.model import Model
from fleet2d.component import OneOf, register
from fleet2d.errors import ComponentError
from fleet2d.units import PositiveDuration

if TYPE_CHECKING:
    from fleet2d.floorplan.home.home import Home

SECOND_US = 1_000_000


@register("algorithm", "real_time_presence", aliases=("rtp",))
class RealTimePresence(Algorithm):
    """Where each user, and anyone, is now: P(room | all that was and wasn't seen so far).

    Its output is a `Presence` of the time of the update; `at` tells of later times, as far as the
    model can. Until the first whole bin (a minute, or a step where that is longer) there is none.
    """

    needs: ClassVar[Set[str]] = frozenset({"evidence"})

    period: PositiveDuration = Field(
        default=timedelta(minutes=5), description="how often it is updated"
    )
    model: Annotated[Model, OneOf("presence_model")] = Field(
        cast("Any", "hmm"), description="how it is worked out"
    )

    def start(self, home: "Home") -> None:
        """Begin without evidence."""
        self.rooms = len(home.rooms)
        self.begun = False
        self.recalled: Mapping[str, Any] | None = None

    def update(self, history: History, state: Present) -> Presence | None:
        """Take in what was watched and seen; return what is believed now."""
        step_us = round(history.step_s * SECOND_US)
        evidence = history.evidence
        bins = in_time(evidence, state.start, step_us)
        if not self.begun:
            self._begin(state)
        if not len(bins.day):
            return None
        home, away = self.model.observe(bins)
        self._check(home, away, len(bins.day), state)
        track = Track(evidence.begin, evidence.bin_steps, home, away)
        time = state.start + timedelta(
            microseconds=(evidence.begin + len(bins.day) * bins.bin_steps) * step_us
        )
        return self.model.presence(state.users, time, bins.bin_steps * step_us, track)

    def _begin(self, state: Present) -> None:
        self._prepare(self.model, len(state.users), state.start)
        self.begun = True

    def _prepare(self, model: Model, users: int, start: datetime) -> None:
        model.begin(self.rooms, users, start.toordinal())
        if self.recalled is not None:
            model.recall(self.recalled)

    def check_learned(self, users: Sequence[str], start: datetime) -> None:
        """Begin on trial with what was learned, which must fit the users."""
        if self.recalled is not None:
            check_numbers("", self.recalled, self.type_name)
            self._prepare(self.model.model_copy(deep=True), len(users), start)

    def _check(self, home: Any, away: Any, bins: int, state: Present) -> None:
        """Refuse what a model says of some bin that is no distribution."""
        users = len(state.users) + 1
        shapes = np.shape(home), np.shape(away)
        wanted = (bins, users, self.rooms), (bins, users)
        if shapes != wanted:
            raise ComponentError(
                f"the model {self.model.type_name} said of {bins} bins, {users - 1} users and"
                f" anyone, and {self.rooms} rooms arrays of shapes {shapes[0]} and {shapes[1]};"
                f" {wanted[0]} (rooms, given at home) and {wanted[1]} (away) are wanted"
            )
        good = are_distributions(home, away)
        if not good.all():
            k, row = np.argwhere(~good)[0].tolist()
            raise ComponentError(
                f"the model {self.model.type_name} said of {(*state.users, ANYONE)[row]!r} in bin"
                f" {k} of {bins} what is no distribution: shares {home[k, row].tolist()}, which sum"
                f" to {home[k, row].sum():g}, away {away[k, row]:g}"
            )

    def remember(self) -> dict[str, Any]:
        """Return what was learned, to start another run from."""
        if not self.begun:
            return {} if self.recalled is None else dict(self.recalled)
        return self.model.remember()

    def recall(self, learned: Mapping[str, Any]) -> None:
        """Go on from what another run has learned."""
        self.recalled = learned or None
