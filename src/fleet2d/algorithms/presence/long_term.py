"""Long-term presence: where people usually are; and the base of algorithms of presence."""

from collections.abc import Mapping, Sequence
from datetime import datetime, timedelta
from typing import Any, Literal, cast

import numpy as np
from pydantic import Field

from fleet2d.algorithms.algorithm import Algorithm, Present, check_numbers
from fleet2d.algorithms.history import History
from fleet2d.algorithms.presence.belief import Presence
from fleet2d.algorithms.presence.estimator import SECOND_US, Estimator
from fleet2d.configuration.components import OneOf
from fleet2d.configuration.problems import problem
from fleet2d.configuration.units import PositiveDuration, Share
from fleet2d.floorplan.home import Home
from fleet2d.kernels import F64
from fleet2d.runtime.clock import DAY
from fleet2d.runtime.determinism import stream_key


class PresenceAlgorithm(Algorithm):
    """Base of algorithms of presence: a component of theirs learns from the evidence."""

    needs = frozenset({"evidence"})

    def start(self, home: Home) -> None:
        """Begin without evidence."""
        self.home = home
        self.has_begun = False
        self.learned_state: Mapping[str, Any] | None = None

    @property
    def _learner(self) -> Any:
        """The component that learns: an estimator, or a model."""
        raise NotImplementedError

    def _prepare(self, learner: Any, users: Sequence[str], start: datetime) -> None:
        """Begin a run with the learned state of another one."""
        raise NotImplementedError

    def _begin_once(self, state: Present) -> None:
        if not self.has_begun:
            self._prepare(self._learner, state.users, state.start)
            self.has_begun = True

    def check_learned(self, users: Sequence[str], start: datetime) -> None:
        """Restore the learned state in a copy, which raises if it doesn't fit the users."""
        if self.learned_state is not None:
            check_numbers("", self.learned_state, self.type_name)
            self._prepare(self._learner.model_copy(deep=True), users, start)

    def remember(self) -> dict[str, Any]:
        """Return the learned state, from which another run can start."""
        if self.has_begun:
            return self._learner.remember()
        return {} if self.learned_state is None else dict(self.learned_state)

    def recall(self, learned: Mapping[str, Any]) -> None:
        """Restore the learned state of another run."""
        self.learned_state = learned or None


class LongTermPresence(PresenceAlgorithm):
    """Share of time that each user, and anyone, spends in each room, from robots' evidence.

    Its output is a `Presence`: `share` is given at home, `with_away` of all time; with `by:
    hour_of_week` both are for the present hour of the week, and `at` returns other hours.

    Attributes:
        estimator: The estimator of the shares.
        by: One estimate, or one for each hour of the week.
        smoothing: Duration of average evidence added to each hour of the week.
        half_life: Age at which evidence counts half; null: all evidence counts alike.
        interval: Coverage of its intervals, such as 0.9.
    """

    estimator: OneOf[Estimator] = cast("Any", "exposure_ratio")
    by: Literal["overall", "hour_of_week"] = "overall"
    smoothing: PositiveDuration = timedelta(hours=1)
    half_life: PositiveDuration | None = None
    interval: Share | None = Field(default=None, gt=0, lt=1)

    def model_post_init(self, _: object, /) -> None:
        """Refuse an interval that the estimator cannot give."""
        if self.interval is not None and self.by != "overall":
            raise problem(f"'interval' can't be combined with 'by: {self.by}': leave one out")
        if self.interval is not None and not self.estimator.has_interval:
            raise problem(
                f"'interval: {self.interval:g}' needs an estimator that has intervals, and"
                f" {self.estimator.type_name} has none: leave it out, or choose another"
            )

    def start(self, home: Home) -> None:
        """Begin without evidence."""
        super().start(home)
        self.ends: tuple[F64, F64] | None = None
        self.until = -1  # the last finished day that the interval knows

    def update(self, history: History, state: Present) -> Presence:
        """Process the evidence of the period; return the presence from all evidence so far."""
        self._begin_once(state)
        evidence = history.evidence
        self.estimator.observe(evidence)
        step = timedelta(microseconds=round(history.step_s * SECOND_US))
        time = state.time + step
        if self.by == "hour_of_week":
            smoothing = self.smoothing / (evidence.bin_steps * step)
            return self.estimator.weekly(state.users, time, smoothing)
        presence = self.estimator.presence(state.users, time)
        return presence if self.interval is None else self._with_interval(presence, state)

    @property
    def _learner(self) -> Estimator:
        return self.estimator

    def _prepare(self, learner: Estimator, users: Sequence[str], start: datetime) -> None:
        half_life = None if self.half_life is None else self.half_life / DAY
        learner.begin(len(self.home.rooms), len(users), half_life)
        if self.learned_state is not None:
            learner.recall(self.learned_state, start.toordinal())

    def _with_interval(self, presence: Presence, state: Present) -> Presence:
        """Add the interval, which is updated when a day is over and always holds the estimate."""
        assert self.interval is not None
        if self.until != self.estimator.counts.today:
            self.until = self.estimator.counts.today
            key = stream_key(state.seed, state.path, f"days until {self.until}")
            self.ends = self.estimator.interval(np.uint64(key), self.interval)
        assert self.ends is not None
        home, away = presence.arrays
        share = np.concatenate([home, away[:, np.newaxis]], axis=1)
        ends = np.minimum(self.ends[0], share), np.maximum(self.ends[1], share)
        return Presence(presence.users, home, away, presence.time, ends)
