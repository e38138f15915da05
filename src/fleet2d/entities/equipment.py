"""Equipment of robots with a state of its own: batteries, and errors of localization."""

from collections.abc import Sequence
from datetime import timedelta
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from fleet2d import kernels
from fleet2d.configuration.components import Settings
from fleet2d.configuration.problems import problem_at
from fleet2d.configuration.units import AngleDeg, Length, PositiveDuration, Share, micros
from fleet2d.entities.body import Body, Motion, Track
from fleet2d.entities.place import Place, stop_at
from fleet2d.entities.plan import Note, Plan
from fleet2d.kernels import (
    BELL_STD,
    F64,
    I64,
    TURN,
    BatteryState,
    Breakpoints,
    Window,
)
from fleet2d.runtime.clock import MINUTE_US
from fleet2d.runtime.determinism import stream_key
from fleet2d.runtime.events import EventKind

# The table of events gets a row `battery` when the charge has changed by this much.
RECORDED_CHANGE = 0.05
_NONE = np.zeros(0, np.int64)
NO_BREAKPOINTS = Breakpoints(_NONE, _NONE, _NONE, _NONE, np.zeros(0, np.uint8))


class Battery(Settings):
    """A battery, described by its running times; the charge falls at one of two constant rates.

    Attributes:
        driving: Time that a full charge lasts driving or turning.
        standing: Time that a full charge lasts standing still.
        charging: Time to charge from empty to full.
        charger: The place of the charger: a point, or a room, for the point farthest from its
            walls.
        charge: Charge when the run begins.
        wakes_at: Charge at which a robot with an empty battery is on again, after somebody has put
            it to its charger.
    """

    driving: PositiveDuration
    standing: PositiveDuration
    charging: PositiveDuration
    charger: Place
    charge: Share = 1.0
    wakes_at: Share = Field(default=0.05, gt=0)


class ChargeCurve(NamedTuple):
    """The charge over time while a motion is followed.

    Attributes:
        begins: Moments at which the rate changes [us], int64 (n,).
        level: Charge at each of those moments, 0 to 1, float64 (n,).
        rates: The rate from each of those moments on [1/us], float64 (n,).
    """

    begins: I64
    level: F64
    rates: F64

    def levels(self, moments: I64) -> F64:
        """Return the charge, float64 (n,), at moments from `begins[0]` on [us], int64 (n,)."""
        piece = np.searchsorted(self.begins, moments, side="right") - 1
        since = moments - self.begins[piece]
        levels: F64 = self.level[piece] + self.rates[piece] * since
        return levels.clip(0.0, 1.0)


class Charge:
    """The charge of a robot in a run. Whenever the robot stands at its charger, it charges.

    Attributes:
        level: Charge at the last decision, 0 to 1.
        charger: Position of the charger [lattice].
        is_broken: Whether the charger doesn't charge.
        is_off: Whether the robot is off, so that its charge doesn't fall.
        wakes_at: Charge at which the robot is on again after its battery was empty.
    """

    is_broken = False
    is_off = False

    def __init__(self, battery: Battery, body: Body) -> None:
        self.level = battery.charge
        self.wakes_at = battery.wakes_at
        self._gain = 1 / micros(battery.charging)  # charge per us
        self._rates = -1 / micros(battery.driving), -1 / micros(battery.standing), self._gain
        self.charger = stop_at(body, battery.charger)
        self._recorded = -1.0
        self._since_us = 0

    @property
    def is_empty(self) -> bool:
        """Whether the charge is 0."""
        return self.level <= 0

    @property
    def percent(self) -> str:
        """The charge for the table of events."""
        return f"{100 * self.level:.1f} %"

    def follow(self, motion: Motion, until_us: int) -> None:
        """Update the charge after a motion from the last decision to a moment.

        Call this before setting `level`, `is_broken` or `is_off` at that moment.
        """
        if self.is_off:
            self.level = float(self.course(motion).levels(np.array([until_us]))[0])
        else:
            self.level = kernels.charge_at(_track(motion), self._state, until_us)
        self._since_us = until_us

    def course(self, motion: Motion) -> ChargeCurve:
        """Return the course of the charge from the last decision on during a motion."""
        if self.is_off:  # a robot that is off rests
            track = _track(motion)
            ends = np.stack([track.x, track.y], axis=1)[-1:].tolist()
            charges = list(self.charger) in ends and not self.is_broken
            piece = [self._since_us], [self.level], [self._gain if charges else 0.0]
            return ChargeCurve(*map(np.array, piece))
        return ChargeCurve(*kernels.charge_pieces(_track(motion), self._state))

    def falls_to(self, level: float, motion: Motion) -> int | None:
        """Return the time at which a motion brings the charge down to a level [us]; None: never."""
        return kernels.charge_falls_to(_track(motion), self._state, level)

    def time_to_charge(self, level: float) -> int:
        """Return the time to charge to a level [us]."""
        return max(0, int((level - self.level) / self._gain) + 1)

    def wakes_after(self, motion: Motion) -> int | None:
        """Return the time of charging until a robot at rest is on again [us]; None: never."""
        is_charging = self.is_off and self.course(motion).rates[0] > 0
        return self.time_to_charge(self.wakes_at) if is_charging else None

    def record(self, plan: Plan) -> None:
        """Note the charge at the beginning of a plan, if it differs from the last one noted."""
        change = abs(self.level - self._recorded)
        if change >= RECORDED_CHANGE or (self.level <= 0) != (self._recorded <= 0):
            self._recorded = self.level
            begin_us = plan.began[0] * plan.step_us
            plan.notes.insert(0, Note(begin_us, EventKind.BATTERY, self.percent))

    @property
    def _state(self) -> BatteryState:
        return BatteryState(
            self.level, self._since_us, *self._rates, *self.charger, is_broken=self.is_broken
        )


def _track(motion: Motion) -> Breakpoints:
    """Return the track of a motion, empty for a random walk, which never stops."""
    return motion.breakpoints if isinstance(motion, Track) else NO_BREAKPOINTS


MAX_CORRECTION_INTERVAL = timedelta(days=1)
# Noise per unit of random_bell is in 1/65536 of the unit of its quantity.
FINE = 1 << 16
ALONG_AXES = [f"{kind} {axis}" for kind in ("drift", "left", "jump") for axis in "xy"]
PURPOSES = (*ALONG_AXES, "turn", "jumps", "when")


class Localization(Settings):
    """The error of a robot's estimate of its own pose; by default there is none.

    The error drifts from a residual after each correction, may jump once between two corrections,
    and is corrected at fixed intervals. People that the robot sees are misplaced by the error, too.

    Attributes:
        drift: Standard deviation per axis, a minute after a correction [m].
        drift_deg: Standard deviation of the heading, a minute after a correction [deg].
        jump: Standard deviation per axis of a jump [m].
        jumps_per_hour: Mean number of jumps of the error.
        corrected_every: Time from correction to correction.
        left: Standard deviation per axis that remains after a correction [m].
        relocalizes: Time for which the camera has to see the home until a kidnapped or lost robot
            knows where it is; null: it knows when the intervention ends.
    """

    drift: Length = Field(default=0.0, ge=0, le=10)
    drift_deg: AngleDeg = Field(default=0.0, ge=0, le=90)
    jump: Length = Field(default=0.0, ge=0, le=100)
    jumps_per_hour: float = Field(default=0.0, ge=0)
    corrected_every: PositiveDuration = timedelta(minutes=10)
    left: Length = Field(default=0.0, ge=0, le=10)
    relocalizes: PositiveDuration | None = None

    def model_post_init(self, _: object, /) -> None:
        """Refuse jumps more frequent than corrections."""
        if self.corrected_every > MAX_CORRECTION_INTERVAL:
            raise problem_at(("corrected_every",), "at most a day is between two corrections")
        expected = self.jumps_per_hour * self.corrected_every / timedelta(hours=1)
        if expected > 1:
            raise problem_at(
                ("jumps_per_hour",),
                f"{expected:g} jumps between two corrections: at most one is possible;"
                " correct more often, or have fewer",
            )


class Displacement(NamedTuple):
    """A period in which a robot believes itself to be where it was before it was carried off.

    Attributes:
        first: The first step.
        end: The step after the last one.
        x: The believed x minus the true one [lattice].
        y: Likewise.
        turn: The believed heading minus the true one [1/4096 turn].
    """

    first: int
    end: int
    x: int
    y: int
    turn: int


class Offsets(NamedTuple):
    """The believed pose of a robot minus its true pose, int64 (n,) each.

    Attributes:
        x: Error along x [lattice].
        y: Error along y [lattice].
        turn: Error of the heading [1/4096 turn].
    """

    x: I64
    y: I64
    turn: I64


class Drift:
    """The error of one robot in a run: a function of the step alone.

    Example:
        >>> drift = Drift(Localization(drift="2 cm", corrected_every="5 min"), 1280, 10**6, 4, "me")
        >>> at = drift.at(np.array([0, 150, 299, 300]))
        >>> bool(at.x[0] == 0 == at.x[3]), bool(abs(at.x[2]) > abs(at.x[1]) > 0)
        (True, True)
    """

    def __init__(
        self,
        settings: Localization,
        units_per_m: float,
        step_us: int,
        seed: int,
        path: str,
        displacements: Sequence[Displacement] = (),
    ) -> None:
        """Derive one random stream per kind of draw.

        Args:
            settings: The sizes of the errors.
            units_per_m: Lattice units per metre.
            step_us: Length of a step [us].
            seed: The seed of the run.
            path: The path of the robot in the scenario, "robots.astro".
            displacements: The displacements of the robot, a list that may grow.
        """
        self._displacements = displacements
        self._step_us = step_us
        self._every_us = micros(settings.corrected_every)
        hours = settings.corrected_every / timedelta(hours=1)
        self._jump_chance = settings.jumps_per_hour * hours
        self._drift = _noise(settings.drift * units_per_m)
        self._jump = _noise(settings.jump * units_per_m)
        self._residual = _noise(settings.left * units_per_m)
        self._turn = _noise(settings.drift_deg / 360 * TURN)
        self._keys = {p: stream_key(seed, path, f"localization: {p}") for p in PURPOSES}

    def at(self, steps: I64) -> Offsets:
        """Return the error at some steps, int64 (n,), in any order."""
        moments = steps * self._step_us
        numbers, which = np.unique(moments // self._every_us, return_inverse=True)
        intervals: list[int] = numbers.tolist()
        elapsed_us = moments - numbers[which] * self._every_us
        jumps_at = np.array([self._jumps_at(interval) for interval in intervals], np.int64)
        has_jumped = elapsed_us >= jumps_at[which]

        def sample(purpose: str, noise: int) -> I64:
            """Return the draw of each step's interval."""
            draws = [kernels.random_bell(self._keys[purpose], interval) for interval in intervals]
            return (np.array(draws, np.int64) * noise)[which]

        def along(axis: str) -> I64:
            """Return the error along an axis at each step."""
            left = sample(f"left {axis}", self._residual)
            jump = sample(f"jump {axis}", self._jump)
            drift = sample(f"drift {axis}", self._drift)
            return left + has_jumped * jump + _after(drift, elapsed_us)

        turn = _after(sample("turn", self._turn), elapsed_us)
        off = np.array([along("x"), along("y"), turn]) // FINE
        for first, end, *moved in self._displacements:
            is_displaced = (steps >= first) & (steps < end)
            off[:, is_displaced] += np.array([moved]).T
        return Offsets(*off)

    def misplace(self, x: I64, y: I64, robot_x: I64, robot_y: I64, steps: I64) -> tuple[I64, I64]:
        """Return the places at which the robot believes seen points to be: x and y [lattice].

        Args:
            x: The points' true x [lattice], int64 (n,).
            y: The points' true y [lattice], int64 (n,).
            robot_x: The robot's true x [lattice], int64 (n,).
            robot_y: The robot's true y [lattice], int64 (n,).
            steps: The steps, int64 (n,).
        """
        off = self.at(steps)
        dx, dy = kernels.turned(x - robot_x, y - robot_y, 2 * off.turn)
        return robot_x + off.x + dx, robot_y + off.y + dy

    def believed(self, runs: Window) -> Window:
        """Return the poses that the robot believes to have."""
        lengths = np.diff(runs.step, append=runs.end)
        steps = np.arange(runs.first, runs.end, dtype=np.int64)
        x, y, turn = self.at(steps)
        x += np.repeat(runs.x, lengths)
        y += np.repeat(runs.y, lengths)
        heading = (np.repeat(runs.heading, lengths) + turn) % TURN
        away = np.repeat(runs.away, lengths)
        postures = np.zeros(len(steps), np.int8)
        columns: tuple[NDArray[Any], ...] = (x, y, heading, away, postures)
        return Window(runs.first, *(column[np.newaxis] for column in columns))

    def _jumps_at(self, interval: int) -> int:
        """Return the time of a jump within an interval [us]; the interval's length: no jump."""
        if kernels.random_uniform(self._keys["jumps"], interval) >= self._jump_chance:
            return self._every_us
        return int(kernels.random_below(self._keys["when"], interval, self._every_us))


def _noise(deviation: float) -> int:
    return round(deviation / BELL_STD * FINE)


def _after(speed: I64, elapsed_us: I64) -> I64:
    """Return a drift [per minute] after some time; milliseconds keep products within 64 bits."""
    return speed * (elapsed_us // 1000) // (MINUTE_US // 1000)
