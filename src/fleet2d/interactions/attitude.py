"""Attitude of a person to a robot over months: truth, which only metrics read.

Numbers for which no study is known are defaults of Fleet2D; docs/how-to/interactions.md has the
sources and ranges of all of them.
"""

from dataclasses import dataclass, field
from datetime import datetime, timedelta

from pydantic import Field

from fleet2d.configuration.components import Component
from fleet2d.configuration.units import PositiveDuration, Share
from fleet2d.interactions.interaction import Outcome
from fleet2d.runtime.clock import DAY, DAY_S, midnight_of
from fleet2d.runtime.determinism import exp2
from fleet2d.runtime.local_time import written

# Time over which prompts are averaged.
BURDEN_OVER = timedelta(days=7)
# Part of the distance to full trust that an accepted interaction gains.
GAINS = 0.05
# Part of the trust that a mistake costs, and a request for nothing.
MISTAKE = 0.3
FOR_NOTHING = 0.03
# Half-life of lost trust, while nothing else happens.
TRUST_RECOVERS = timedelta(days=30)
# Part of the distance to a full habit that an accepted interaction gains.
HABIT_FORMS = 0.15


@dataclass
class AttitudeState:
    """A person's attitude to one robot.

    Attributes:
        time: The moment of the state.
        novelty: 1 at first, falling to 0.
        burden: Recent prompts a day, an exponential mean.
        annoyance: Accumulated by badly timed prompts, fading; 0: none.
        trust: 0 to 1.
        habits: How much each interaction is expected at a time of day, and when: strength from 0 to
            1, and the time of day [s], by the interaction's name.
        last: Time at which the robot last addressed the person; None: never.
    """

    time: datetime
    novelty: float = 1.0
    burden: float = 0.0
    annoyance: float = 0.0
    trust: float = 0.5
    habits: dict[str, tuple[float, float]] = field(default_factory=dict)
    last: datetime | None = None

    def expects(self, name: str, time: datetime, window: timedelta) -> float:
        """Return the strength with which an interaction is expected at a time, 0 to 1."""
        strength, usual_s = self.habits.get(name, (0.0, 0.0))
        off_s = abs((written(time) - midnight_of(time)).total_seconds() - usual_s)
        return strength if min(off_s, DAY_S - off_s) <= window.total_seconds() else 0.0


class Attitude(Component):
    """The change of a person's attitude to a robot: interest that fades, some patience.

    Attributes:
        novelty_lasts: Half-life of the novelty.
        annoyance_lasts: Half-life of annoyance.
        trust: Trust at first, to which it recovers.
        annoyed_by: Annoyance added by a prompt at the worst moment; at a good one, none.
    """

    kind = "attitude"

    novelty_lasts: PositiveDuration = timedelta(days=14)
    annoyance_lasts: PositiveDuration = timedelta(days=2)
    trust: Share = 0.5
    annoyed_by: float = Field(default=0.4, ge=0, le=100)

    def begin(self, start: datetime) -> AttitudeState:
        """Return the attitude to a robot that has just come."""
        return AttitudeState(start, trust=self.trust)

    def pass_time(self, state: AttitudeState, time: datetime) -> None:
        """Let novelty, annoyance and the memory of prompts fade until a time; trust recovers."""
        passed = time - state.time
        state.novelty *= exp2(-(passed / self.novelty_lasts))
        state.annoyance *= exp2(-(passed / self.annoyance_lasts))
        state.burden *= exp2(-(passed / BURDEN_OVER) * 1.4426950408889634)
        lost = max(0.0, self.trust - state.trust)
        state.trust += lost * (1 - exp2(-(passed / TRUST_RECOVERS)))
        state.time = time

    def addressed(
        self, state: AttitudeState, name: str, outcome: Outcome, willingness: float
    ) -> None:
        """Update the attitude after the person was addressed at the time of the state.

        Args:
            state: The attitude.
            name: The interaction's name.
            outcome: The person's answer.
            willingness: Probability that the person was available, 0 at the worst moment.
        """
        state.last = state.time
        state.burden += DAY / BURDEN_OVER
        is_mistaken = outcome == Outcome.MISTAKEN
        state.annoyance += self.annoyed_by * (1 if is_mistaken else 1 - willingness)
        if outcome == Outcome.ACCEPTED:
            state.trust += GAINS * (1 - state.trust)
            strength, usual_s = state.habits.get(name, (0.0, 0.0))
            time_s = (written(state.time) - midnight_of(state.time)).total_seconds()
            is_usual = state.expects(name, state.time, timedelta(hours=1)) > 0
            usual_s = usual_s + 0.3 * (time_s - usual_s) if is_usual else time_s
            strength = strength if is_usual else 0.0
            state.habits[name] = (strength + HABIT_FORMS * (1 - strength), usual_s)
        elif outcome not in (Outcome.DEFERRED, Outcome.IGNORED):
            self.let_down(state, outcome)

    def let_down(self, state: AttitudeState, outcome: Outcome = Outcome.DECLINED) -> None:
        """Lower trust after a request for nothing, or a mistake."""
        is_worse = outcome in (Outcome.MISTAKEN, Outcome.SWITCHED_OFF)
        state.trust *= 1 - (MISTAKE if is_worse else FOR_NOTHING)


class SteadyAttitude(Attitude):
    """A person whose interest doesn't fade, and who is soon at peace: about a quarter of people."""

    novelty_lasts: PositiveDuration = timedelta(days=36500)
    annoyance_lasts: PositiveDuration = DAY
    annoyed_by: float = Field(default=0.2, ge=0, le=100)


class LeavingAttitude(Attitude):
    """A person who soon loses interest and is easily annoyed: more than half of app users."""

    novelty_lasts: PositiveDuration = timedelta(days=5)
    annoyance_lasts: PositiveDuration = timedelta(days=5)
    annoyed_by: float = Field(default=0.7, ge=0, le=100)
    trust: Share = 0.35
