"""Errors of perception: their base, and the sightings that they change."""

import dataclasses
from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fleet2d import kernels
from fleet2d.configuration.components import Component
from fleet2d.errors import ComponentError
from fleet2d.floorplan.home import Home
from fleet2d.floorplan.placed_objects import POSTURES
from fleet2d.kernels import BELL_STD, F64, I16, I64, NOBODY, ONE, QUARTER, TURN, UNIT, Bool
from fleet2d.runtime.clock import DAY_US, HOUR_US
from fleet2d.runtime.determinism import stream_key
from fleet2d.runtime.local_time import readings_of

MAX_DISTANCE_M = 10_000.0
"""Largest coordinate of a perceived position [m]."""
MAX_VALUE = 1e6
"""Largest absolute value of other numbers."""
MAX_DRAWS_PER_LOOK = 64
"""Draws of the false positives of one look; what is beyond repeats them."""
FALSE_POSITIVE = "a false positive"


@dataclass(frozen=True)
class ErrorStream:
    """The address of the random draws of one error of one camera.

    Attributes:
        seed: The seed of the run.
        path: The path of the robot, "robots.astro".
        name: The camera and the error.
    """

    seed: int
    path: str
    name: str

    def key(self, purpose: str, person: str = "") -> np.uint64:
        """Return the key of the stream for a purpose, and for a person if given."""
        return stream_key(self.seed, self.path, f"{self.name}: {purpose}: {person}")


@dataclass(frozen=True, eq=False)
class CameraSightings:
    """The people that one camera noticed in some looks: n sightings, one element each.

    The arrays are read-only; `replace` and `moved` return changed sightings. Values are those of
    the table of observations, with the errors that come before. Users are numbers, -1 for nobody.

    Attributes:
        camera: Name of the camera.
        users: Names of the users: user 0 is the first.
        home: The home.
        start: Local time of step 0.
        step_s: Length of a step [s].
        step: Step of the look: int64 (n,).
        user: The recognized user, -1 if not recognized: int64 (n,).
        x: Perceived position [m]: float64 (n,).
        y: Perceived position [m]: float64 (n,).
        heading: Perceived heading [rad]: float64 (n,).
        posture: Perceived posture, 0 stands, 1 sits, 2 lies: int64 (n,).
        noticed: Whether the person is noticed at all, true at first: bool (n,).
        true_user: The true user, -1 for a false positive: int64 (n,).
        true_x: True position [m]: float64 (n,).
        true_y: True position [m]: float64 (n,).
        true_heading: True heading [rad]: float64 (n,).
        true_posture: True posture: int64 (n,).
        camera_x: Position of the camera [m]: float64 (n,).
        camera_y: Position of the camera [m]: float64 (n,).
        camera_heading: Heading of the camera [rad]: float64 (n,).
    """

    camera: str
    users: Sequence[str]
    home: Home
    start: datetime
    step_s: float
    step: I64
    user: I64
    x: F64
    y: F64
    heading: F64
    posture: I64
    noticed: Bool
    true_user: I64
    true_x: F64
    true_y: F64
    true_heading: F64
    true_posture: I64
    camera_x: F64
    camera_y: F64
    camera_heading: F64
    _stream: ErrorStream = ErrorStream(0, "", "")

    def __post_init__(self) -> None:
        """Make the arrays read-only."""
        for value in vars(self).values():
            if isinstance(value, np.ndarray):
                value.setflags(write=False)

    def __len__(self) -> int:
        """Return the number of sightings."""
        return len(self.step)

    @property
    def distance(self) -> F64:
        """Perceived distance from the camera [m]: float64 (n,)."""
        return np.sqrt((self.x - self.camera_x) ** 2 + (self.y - self.camera_y) ** 2)

    @property
    def hour(self) -> F64:
        """Time of day of the look [hours], from 0 to 24: float64 (n,)."""
        elapsed_us = self.step * round(self.step_s * 1e6)
        return readings_of(self.start, elapsed_us) % DAY_US / HOUR_US

    @property
    def true_room(self) -> I16:
        """Room of the true position, an index of `home.rooms`, -1 in none: int16 (n,)."""
        plan = self.home.plan
        x, y = plan.lattice.to_lattice(np.stack([self.true_x, self.true_y], axis=1)).T
        rooms: I16 = kernels.rooms_at(plan.room_of_place, x.copy(), y.copy())
        return rooms

    def replace(
        self,
        *,
        x: ArrayLike | None = None,
        y: ArrayLike | None = None,
        heading: ArrayLike | None = None,
        posture: ArrayLike | None = None,
        user: ArrayLike | None = None,
        noticed: ArrayLike | None = None,
    ) -> "CameraSightings":
        """Return the sightings with other values: arrays (n,), or one value for all sightings.

        Stored values are rounded: positions to the lattice of the home, headings to 1/4096 turn.

        Args:
            x: Perceived position [m].
            y: Perceived position [m].
            heading: Perceived heading [rad], any number of turns.
            posture: Perceived posture: 0, 1 or 2.
            user: The recognized user; -1: not recognized.
            noticed: Whether the person is noticed.

        Raises:
            ComponentError: A value has another shape, isn't finite, or is out of bounds.
        """
        new: dict[str, Any] = {}
        for name, value in (("x", x), ("y", y)):
            if value is not None:
                new[name] = self._numbers(name, value, MAX_DISTANCE_M, " m")
        if heading is not None:
            new["heading"] = self._numbers("heading", heading, MAX_VALUE)
        if posture is not None:
            new["posture"] = self._codes("posture", posture, 0, len(POSTURES))
        if user is not None:
            new["user"] = self._codes("user", user, NOBODY, len(self.users))
        if noticed is not None:
            new["noticed"] = self._array("noticed", noticed, "b", "true and false")
        return dataclasses.replace(self, **new)

    def moved(
        self, *, turn_deg: ArrayLike = 0.0, scale: ArrayLike = 1.0, offset: ArrayLike = 0.0
    ) -> "CameraSightings":
        """Return the sightings at other places, as seen from the camera; headings stay.

        Args:
            turn_deg: Angle by which they are turned round the camera, counter-clockwise, rounded to
                1/8192 turn (0.044 degrees).
            scale: Factor of the distance.
            offset: Length added to the distance [m]; the sum is at least 0.

        Raises:
            ComponentError: A value has another shape, isn't finite, or moves them out of bounds.
        """
        turns = self._numbers("turn_deg", turn_deg, MAX_VALUE) / 360 * (2 * TURN)
        factor = self._numbers("scale", scale, MAX_VALUE)
        added = self._numbers("offset", offset, MAX_VALUE)
        distance = self.distance
        sines = kernels.half_sines()
        target = np.maximum(0.0, distance * factor + added)
        stretch = target / np.where(distance > 0, distance, 1.0)
        angle = kernels.rounded(turns)
        along = sines[(angle + 2 * QUARTER) % (2 * TURN)] / UNIT * stretch
        up = sines[angle % (2 * TURN)] / UNIT * stretch
        dx = self.x - self.camera_x
        dy = self.y - self.camera_y
        x = self.camera_x + (dx * along - dy * up)
        y = self.camera_y + (dx * up + dy * along)
        return self.replace(x=x, y=y)

    def uniform(self, purpose: str, *, at: ArrayLike | None = None, shared: bool = False) -> F64:
        """Return random numbers from 0 to 1, 1 excluded: float64 (n,).

        Equal arguments give equal numbers; each purpose, person, camera and error has its own.

        Args:
            purpose: The quantity that is drawn.
            at: A further address of the numbers, (n,) or one for all, rounded down; None: the step.
                `step // 60` gives all sightings of a person in sixty steps the same number.
            shared: Whether all people have the same numbers.
        """
        return self._draw(kernels.random_shares, purpose, at, shared) / ONE

    def bell(self, purpose: str, *, at: ArrayLike | None = None, shared: bool = False) -> F64:
        """Return bell-shaped random numbers, mean 0, standard deviation 1: float64 (n,).

        The numbers are cut at 4.88; the arguments are those of `uniform`.
        """
        return self._draw(kernels.random_bells, purpose, at, shared) / BELL_STD

    def _draw(self, draw: Any, purpose: str, at: ArrayLike | None, shared: bool) -> F64:
        steps = self.step if at is None else np.floor(self._numbers("at", at, 2.0**53))
        steps = np.ascontiguousarray(steps, np.int64)
        draws = np.empty(len(self))
        if shared:
            draws[:] = draw(self._stream.key(purpose), steps)
            return draws
        for person in np.unique(self.true_user).tolist():
            rows = np.flatnonzero(self.true_user == person)
            name = FALSE_POSITIVE
            addresses = steps[rows]
            if person == NOBODY:  # a look may have several false positives
                first = np.searchsorted(self.step[rows], self.step[rows])
                addresses = addresses * MAX_DRAWS_PER_LOOK + (np.arange(len(rows)) - first)
            else:
                name = self.users[person]
            draws[rows] = draw(self._stream.key(purpose, name), addresses)
        return draws

    def _array(self, name: str, value: ArrayLike, kinds: str, what: str) -> NDArray[Any]:
        """Return an array (n,) of a value.

        Raises:
            ComponentError: The value has another shape or type.
        """
        array = np.asarray(value)
        if array.shape not in ((), (len(self),)):
            raise ComponentError(
                f"{name} has the shape {array.shape}: expected ({len(self)},), an element for each"
                " sighting, or one value for all"
            )
        if array.dtype.kind not in kinds:
            raise ComponentError(f"{name} holds {array.dtype}: expected {what}")
        return np.array(np.broadcast_to(array, (len(self),)))

    def _numbers(self, name: str, value: ArrayLike, most: float, unit: str = "") -> F64:
        array = self._array(name, value, "fiu", "numbers").astype(np.float64)
        wrong = np.flatnonzero(~(np.isfinite(array) & (np.abs(array) <= most)))
        if len(wrong):
            raise ComponentError(
                f"{name} is {array[wrong[0]]:g} for the look at step {self.step[wrong[0]]}:"
                f" expected a number from -{most:,.0f} to {most:,.0f}{unit}"
            )
        return array

    def _codes(self, name: str, value: ArrayLike, least: int, end: int) -> I64:
        array = self._array(name, value, "iu", "integers").astype(np.int64)
        wrong = np.flatnonzero((array < least) | (array >= end))
        if len(wrong):
            raise ComponentError(
                f"{name} is {array[wrong[0]]} for the look at step {self.step[wrong[0]]}:"
                f" expected {least} to {end - 1}"
            )
        return array


class PerceptionError(Component):
    """Base of errors of perception, which are no exceptions; a subclass writes `distort`.

    An error acts on the sightings of one camera. It may use the sightings and their draws only, and
    treats each by itself, without state: a call has any number of looks, and looks may be computed
    twice.

    Example:
        >>> import numpy as np
        >>> import fleet2d
        >>> class Backwards(fleet2d.PerceptionError):
        ...     '''People of whom some are perceived from the wrong side.
        ...
        ...     Attributes:
        ...         share: Share of sightings whose heading is off by half a turn.
        ...     '''
        ...     share: fleet2d.Share = 0.1
        ...     def distort(self, sightings):
        ...         is_wrong = sightings.uniform("backwards") < self.share
        ...         return sightings.replace(heading=sightings.heading + np.pi * is_wrong)
        >>> robot = {"perception": {"errors": {"backwards": Backwards(share="20 %")}}}
        >>> run = fleet2d.run(duration="3 d", seed=4, robots={"astro": robot})
        >>> rows = run.pandas("observations")
        >>> wrong = (rows.heading - rows.true_heading).abs() > 3
        >>> bool(0.19 < wrong.mean() < 0.21)
        True
    """

    kind = "perception_error"

    @abstractmethod
    def distort(self, sightings: "CameraSightings") -> "CameraSightings":
        """Return the sightings with this error: `sightings.replace(…)`, or `sightings.moved(…)`.

        Args:
            sightings: The perceptions of a camera in some looks, with the errors that come before.
        """

    def __setattr__(self, name: str, value: Any) -> None:
        """Refuse to keep state."""
        if name in type(self).model_fields:
            super().__setattr__(name, value)
        raise AttributeError(
            f"{type(self).__name__}.{name} can't be set: errors of perception keep no state, as"
            " looks may be computed twice; for errors that last use draws such as"
            " sightings.uniform('burst', at=sightings.step // 60)"
        )
