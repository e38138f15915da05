"""Cameras of robots: settings, errors and disturbances, and their form in integers of the core."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import timedelta
from decimal import Decimal
from operator import attrgetter
from typing import NamedTuple

import numpy as np
from pydantic import Field

from fleet2d import kernels
from fleet2d.configuration import units
from fleet2d.configuration.components import OneOf, Settings
from fleet2d.configuration.problems import check_known, problem, problem_at
from fleet2d.configuration.units import AngleDeg, Duration, Length, PositiveDuration, Share
from fleet2d.errors import ScenarioError
from fleet2d.floorplan.lattice import Lattice
from fleet2d.floorplan.placed_objects import POSTURES
from fleet2d.kernels import BELL_STD, I64, ONE, TURN, UNIT, ErrorTables, Lenses, TablePart
from fleet2d.runtime.clock import HOUR_US
from fleet2d.runtime.determinism import sum_in_order
from fleet2d.sight import perception
from fleet2d.sight.failures import Failures
from fleet2d.sight.fov import FieldOfView, LineOfSight
from fleet2d.sight.perception import Attributes, Detection, FalsePositives, Identity, Perception

# Squares of distances in lattice units stay far inside 64 bits.
MAX_DISTANCE_M = 10_000
MAX_POINTS = 32
# By default, a camera sees within these distances and this width.
DEFAULT_RANGE_M = (0.0, 4.5)
DEFAULT_ANGLE_DEG = 108.0
# By default, a user not noticed for this long is lost.
DEFAULT_PATIENCE = timedelta(seconds=5)


class Pan(Settings):
    """Pan of a camera: it looks in each direction for some time, then in the next.

    Attributes:
        headings_deg: Directions, one after the other, relative to its heading on the body.
        dwell: Time of looking in each direction.
    """

    headings_deg: tuple[AngleDeg, ...] = Field(
        min_length=1, max_length=64, examples=[[-45, 0, 45, 0]]
    )
    dwell: PositiveDuration = timedelta(seconds=5)


class Lens(NamedTuple):
    """A camera in integer units for the sight kernel; see `fleet2d.kernels.Lenses`."""

    near: int  # lattice units
    far: int
    half_angle: int  # 1/8192 of a turn
    chance: int  # times 2**53
    patience: int  # steps
    forward: int  # lattice units
    left: int
    heading: int  # 1/4096 of a turn
    pans: tuple[int, ...]
    pan_us: int
    period: int  # steps
    latency: int
    points: int

    @property
    def is_moved(self) -> bool:
        """Whether the camera isn't at the centre or doesn't look along the body's heading."""
        return bool(self.forward or self.left or self.heading or self.pans)

    def body(self, radius: float) -> list[tuple[int, int]]:
        """Return the points of a body of `radius` [lattice units] to look at: its centre first."""
        size = round(radius)
        half = UNIT // 2
        points = [(0, 0)]
        for number in range(self.points):
            heading = round(number * TURN / self.points)
            x = size * kernels.cosine(heading) + half
            y = size * kernels.sine(heading) + half
            points.append((x // UNIT, y // UNIT))
        return points


class Camera(Settings):
    """A camera on a body. By default it is at the centre and looks along the body's heading.

    A user is in view when the user's centre is between the two ranges, within the angle, and no
    wall touches the line between the camera and the centre. Ranges and offset are rounded to the
    lattice, the half angle to 1/8192 of a turn (0.044 degrees), headings to 1/4096. A camera that
    its offset puts into a wall sees nothing.

    Attributes:
        range: Nearest and farthest distance at which it sees [m].
        angle_deg: Width of the field of view, centred on the heading.
        detection: Probability that a user in view is noticed, in each look.
        lost_after: A user not noticed for this long counts as lost (event user_lost): a multiple of
            the step; left out: 5 s, or the next multiple above; with several cameras, the longest
            counts.
        offset: The place where it is mounted: forward and left of the body's centre [m].
        height: Its height [m], for `sight.heights`; left out: 15/16 of the body's height. The
            camera of a user who sits or lies is lower in proportion.
        heading_deg: The direction in which it looks, counter-clockwise from the body's heading.
        pan: The directions between which it turns; null: its direction is fixed.
        period: Time from look to look; null: one in every step.
        latency: Time from a look until its detections are known.
        body_points: Points on a circle of a user's radius that are looked at besides the centre:
            one in view is enough; 0: only the centre counts.
        perception: Its errors; null: the robot's `perception`.
        fails: Its failures, during which it sees nothing; null: none.
    """

    range: tuple[Length, Length] = Field(default=DEFAULT_RANGE_M, examples=[[0.3, 4.5]])
    angle_deg: AngleDeg = Field(default=DEFAULT_ANGLE_DEG, gt=0, le=360)
    detection: Share = 1.0
    lost_after: Duration | None = Field(default=None, examples=["5 s"])
    offset: tuple[Length, Length] = Field(default=(0.0, 0.0), examples=[[0.1, 0]])
    height: Length | None = Field(default=None, ge=0, le=4)
    heading_deg: AngleDeg = 0.0
    pan: Pan | None = None
    period: PositiveDuration | None = None
    latency: Duration = timedelta(0)
    body_points: int = Field(default=0, ge=0, le=MAX_POINTS)
    perception: Perception | None = None
    fails: Failures | None = None

    def model_post_init(self, _: object, /) -> None:
        """Require a range and a position within a home, and looks more frequent than forgetting."""
        near, far = self.range
        if not 0 <= near < far:
            raise problem(
                f"range is [{near:g}, {far:g}]: the nearest distance must be below the farthest"
            )
        if far > MAX_DISTANCE_M:
            raise problem(f"range ends at {far:g} m: {MAX_DISTANCE_M:g} m is beyond any home")
        if max(map(abs, self.offset)) > MAX_DISTANCE_M:
            raise problem_at(("offset",), f"{MAX_DISTANCE_M:g} m from its body is beyond any home")
        patience = DEFAULT_PATIENCE if self.lost_after is None else self.lost_after
        if self.period is not None and self.period > patience:
            raise problem_at(
                ("period",),
                f"{units.format_duration(self.period)} is longer than lost_after,"
                f" {units.format_duration(patience)}: each user would be lost between two looks",
            )

    def lens(self, units_per_m: float, step_us: int) -> Lens:
        """Convert the camera to integer units: lattice units, parts of a turn, and steps.

        Raises:
            ValueError: The period, or a given `lost_after`, is not a multiple of the step.
        """
        lost_us = units.micros(DEFAULT_PATIENCE if self.lost_after is None else self.lost_after)
        if lost_us % step_us and self.lost_after is not None:
            raise ValueError(
                f"lost_after is {units.format_duration(self.lost_after)}, which is not a multiple"
                f" of simulation.step ({step_us / 1e6:g} s): it would act as"
                f" {-(-lost_us // step_us) * step_us / 1e6:g} s; choose a multiple"
            )
        near, far = (round(distance * units_per_m) for distance in self.range)
        period = 1
        if self.period is not None:
            period = units.whole_steps(self.period, step_us, "period", ValueError)
        return Lens(
            near=near,
            far=far,
            # At 0, both borders are one line, on which points right behind the camera lie, too.
            half_angle=max(1, round(self.angle_deg / 360 * TURN)),
            chance=round(self.detection * 2**53),
            patience=-(-lost_us // step_us),
            forward=round(self.offset[0] * units_per_m),
            left=round(self.offset[1] * units_per_m),
            heading=headings([self.heading_deg])[0],
            pans=headings(self.pan.headings_deg if self.pan else ()),
            pan_us=units.micros(self.pan.dwell) if self.pan else 1,
            period=period,
            latency=-(-units.micros(self.latency) // step_us),
            points=self.body_points,
        )


def headings(degrees: Sequence[float]) -> tuple[int, ...]:
    """Return angles in 1/4096 of a turn, rounded.

    >>> headings([90, -45])
    (1024, 3584)
    """
    return tuple(round(angle / 360 * TURN) % TURN for angle in degrees)


@dataclass(frozen=True)
class TableContext:
    """Everything that tables depend on besides the cameras.

    Attributes:
        users: Names of the users.
        radii: Radii of the users [lattice units].
        lattice: The home's lattice.
        step_us: Length of a step [us].
        path: The robot's path in the scenario, for errors.
    """

    users: Sequence[str]
    radii: Sequence[float]
    lattice: Lattice
    step_us: int
    path: str


def stack_lenses(lenses: Sequence[Lens], errs: Sequence[bool], context: TableContext) -> Lenses:
    """Return the cameras of a robot as the kernel's arrays."""
    shape = (len(lenses), len(context.users))
    bodies = np.zeros((*shape, max(lens.points for lens in lenses) + 1, 2), np.int64)
    reach = np.zeros(shape, np.int64)
    widest = np.zeros(shape, np.int64)
    pan_count = _row(len(lens.pans) for lens in lenses)
    pans = np.zeros((len(lenses), pan_count.max(initial=1)), np.int64)
    for c, lens in enumerate(lenses):
        pans[c, : len(lens.pans)] = lens.pans
        for u, radius in enumerate(context.radii):
            body = lens.body(radius)
            bodies[c, u, : len(body)] = body
            reach[c, u] = round(radius) + 1 if lens.points else 0
            widest[c, u] = (lens.far + reach[c, u]) ** 2
    same = {name: _row(map(attrgetter(name), lenses)) for name in _SAME}
    return Lenses(
        near_squared=_row(lens.near**2 for lens in lenses),
        far_squared=_row(lens.far**2 for lens in lenses),
        moves=_row(lens.is_moved for lens in lenses),
        pans=pans,
        pan_count=pan_count,
        errs=_row(errs),
        bodies=bodies,
        reach=reach,
        widest=widest,
        **same,
    )


# Lenses take these fields from each Lens as they are.
_SAME = (set(Lens._fields) & set(Lenses._fields)) - {"pans"}


def _row(values: Iterable[int]) -> I64:
    return np.fromiter(values, np.int64)


def error_tables(
    lenses: Sequence[Lens], perceptions: Sequence[Perception | None], context: TableContext
) -> ErrorTables:
    """Return the errors of each camera of a robot; the caller fills in the keys of the streams.

    Raises:
        ScenarioError: A user is unknown, probabilities add up to more than 1, or a rate is above
            one false positive per look.
    """
    cameras = len(lenses)
    users = len(context.users)
    models = [errors or Perception() for errors in perceptions]
    sources = 1 + max(len(model.false_positives.spots) for model in models)
    # If no camera errs, no table is ever read.
    errs = any(errors is not None for errors in perceptions)
    tables = ErrorTables(
        table=np.zeros((cameras, kernels.TABLE if errs else 1), np.int64),
        confusion=np.zeros((cameras, users, users), np.int64),
        has_ghosts=np.zeros(cameras, np.int64),
        ghosts=np.full((cameras, kernels.MAX_GHOSTS), ONE, np.int64),
        source=np.full((cameras, sources), ONE, np.int64),
        spot=np.zeros((cameras, sources, 3), np.int64),
        looks_like=np.zeros((cameras, users + 1), np.int64),
        keys=np.zeros((cameras, users, len(kernels.UserDraw)), np.uint64),
        ghost_keys=np.zeros((cameras, len(kernels.GhostDraw)), np.uint64),
    )
    for c, (lens, errors) in enumerate(zip(lenses, perceptions, strict=True)):
        if errors is not None:
            reach = lens.far + max((round(radius) + 2 for radius in context.radii), default=0)
            excess_bits = reach.bit_length() - (kernels.BINS - 1).bit_length()
            table = tables.table[c]
            table[TablePart.SHIFT] = max(0, excess_bits)
            _fill_detection(table, lens, errors.detection, context)
            _fill_identity(table, tables.confusion[c], errors.identity, context)
            _fill_attributes(table, errors.attributes, context)
            _fill_false_positives(tables, c, lens, errors.false_positives, context)
    return tables


def _distances(table: I64, context: TableContext) -> list[float]:
    """Return the distance at the middle of each entry of the tables by distance [m]."""
    width = 1 << int(table[TablePart.SHIFT])
    return [(i + 0.5) * width / context.lattice.units_per_m for i in range(kernels.BINS)]


def _put(table: I64, at: int, values: Sequence[int] | I64) -> None:
    """Write values to a camera's table from the index `at` on."""
    table[at : at + len(values)] = values


def _fill_detection(table: I64, lens: Lens, model: Detection, context: TableContext) -> None:
    _put(table, TablePart.DISTANCE, model.distance.chances(_distances(table, context)))
    angles = [360 * i / TURN for i in range(-kernels.HALF_TURN, kernels.HALF_TURN)]
    if not any(angle < 0 for angle, _ in model.bearing.points):
        angles = [abs(angle) for angle in angles]
    _put(table, TablePart.BEARING, model.bearing.chances(angles))
    turns = [360 * i / TURN for i in range(kernels.HALF_TURN + 1)]
    _put(table, TablePart.FACING, model.orientation.chances(turns))
    factors = [model.posture.get(name, 1.0) for name in POSTURES]
    _put(table, TablePart.POSTURE, list(map(perception.chance, factors)))
    count = lens.points + 1
    shares = [i / count for i in range(count + 1)]
    _put(table, TablePart.SHOWN, model.visible_share.chances(shares))
    hours = [(minute + 0.5) / 60 for minute in range(kernels.MINUTES)]
    _put(table, TablePart.LIGHT, model.light.around_the_clock().chances(hours))
    if model.memory:
        steps = Decimal(context.step_us) / units.micros(model.memory)
        stay = (perception.decay(steps * 2**i) for i in range(kernels.DOUBLINGS))
        _put(table, TablePart.STAY, [perception.chance(share) for share in stay])


def _fill_identity(table: I64, confusion: I64, model: Identity, context: TableContext) -> None:
    distances = _distances(table, context)
    mistaken = model.mistaken.chances(distances)
    right = ONE - mistaken if model.right is None else model.right.chances(distances)
    excess = np.flatnonzero(right + mistaken > ONE + perception.chance(perception.SUM_ERROR))
    if len(excess):
        i = int(excess[0])
        raise ScenarioError(
            f"{context.path}: perception.identity: at {distances[i]:.2f} m, right"
            f" ({right[i] / ONE:.3g}) and mistaken ({mistaken[i] / ONE:.3g}) add up to more than 1"
        )
    _put(table, TablePart.RIGHT, right)
    _put(table, TablePart.MISTAKEN, mistaken)
    table[TablePart.KEEPS] = model.per_track
    _check_users(model.confusion, "confusion", context)
    for u, user in enumerate(context.users):
        others = model.confusion.get(user)
        if others is None:
            rest = [name for name in context.users if name != user]
            others = {name: 1 / len(rest) for name in rest}
        _check_users(others, f"confusion.{user}", context)
        confusion[u] = _whole_sums(others, context.users)


def _whole_sums(shares: Mapping[str, float], order: Sequence[str]) -> list[int]:
    """Return cumulative probabilities: 1 at the last possible outcome, despite rounding."""
    possible = [number for number, name in enumerate(order) if shares.get(name)]
    last = max(possible, default=len(order))
    return perception.cumulative(shares, order)[:last] + [ONE] * (len(order) - last)


def _check_users(names: Mapping[str, object], key: str, context: TableContext) -> None:
    for name in names:
        check_known(name, "user", context.users, where=f"{context.path}: perception: {key}: ")


def _fill_attributes(table: I64, model: Attributes, context: TableContext) -> None:
    per_bell = 65536 / BELL_STD
    table[TablePart.RANGE_NOISE] = round(model.range_noise * context.lattice.units_per_m * per_bell)
    table[TablePart.RANGE_SHARE] = round(model.range_noise_share * per_bell * 65536)
    table[TablePart.BEARING_NOISE] = round(model.bearing_noise_deg / 360 * 2 * TURN * per_bell)
    table[TablePart.HEADING_NOISE] = round(model.heading_noise_deg / 360 * TURN * per_bell)
    for i, posture in enumerate(POSTURES):
        others: dict[str, float] = dict(model.posture.get(posture, {}).items())
        others[posture] = 1 - sum_in_order(others.values())
        _put(table, TablePart.SEEMS + len(POSTURES) * i, _whole_sums(others, POSTURES))


def _fill_false_positives(
    tables: ErrorTables, camera: int, lens: Lens, model: FalsePositives, context: TableContext
) -> None:
    _check_users(model.looks_like, "looks_like", context)
    tables.looks_like[camera] = perception.cumulative(model.looks_like, [*context.users, None])
    tables.looks_like[camera, -1] = ONE
    rates = [model.per_hour, *(spot.per_hour for spot in model.spots)]
    if not any(rates):
        return
    tables.has_ghosts[camera] = 1
    hours = Decimal(lens.period * context.step_us) / HOUR_US
    mean = sum(map(Decimal, rates)) * hours
    if mean > 1:
        raise ScenarioError(
            f"{context.path}: perception.false_positives: {sum_in_order(rates):g} per hour exceeds"
            f" the limit of one per look ({float(1 / hours):g} per hour at this period)"
        )
    # A sum of Poisson processes is one, too; each source has its share of the points by its rate.
    term = perception.decay(mean)
    total = 0.0
    for count in range(kernels.MAX_GHOSTS):
        total += term
        tables.ghosts[camera, count] = perception.chance(min(total, 1.0))
        term *= float(mean) / (count + 1)
    total_rate = sum_in_order(rates)
    shares = {str(i): rate / total_rate for i, rate in enumerate(rates)}
    tables.source[camera, : len(rates)] = _whole_sums(shares, list(shares))
    for i, spot in enumerate(model.spots, 1):
        x, y = context.lattice.point_at(spot.at)
        noise = round(spot.spread * context.lattice.units_per_m * 65536 / BELL_STD)
        tables.spot[camera, i] = x, y, noise


def is_perfect(errors: Perception | None) -> bool:
    """Return whether a look has no errors, and so needs no tables; `errors` act afterwards."""
    if errors is None:
        return True
    lit = errors.detection.model_copy(update={"unlit": Detection().unlit})
    return errors.model_copy(update={"errors": {}, "detection": lit}) == Perception()


class FalseSighting(NamedTuple):
    """A false positive in every look of a camera.

    Attributes:
        user: Name of the recognized user; empty for an unknown person.
        x: Position [m].
        y: Position [m].
        heading: Heading [1/4096 turn].
    """

    user: str
    x: float
    y: float
    heading: int


@dataclass(frozen=True)
class Disturbance:
    """One disturbance of a robot's cameras.

    Attributes:
        camera: Name of the camera; None: all.
        dark: Whether the camera sees nothing at all.
        detection: Factor of the probability that a user in view is noticed.
        errs: The errors that replace the camera's own; None: no change.
        missed: Name of a user who isn't noticed; None: no change.
        mistaken: Name of a user, and the name under which it is recognized, empty for an unknown
            person.
        injected: A false positive in every look.
    """

    camera: str | None = None
    dark: bool = False
    detection: float = 1.0
    errs: Perception | None = None
    missed: str | None = None
    mistaken: tuple[str, str] | None = None
    injected: FalseSighting | None = None

    def is_of(self, camera: str) -> bool:
        """Return whether a camera is disturbed."""
        return self.camera in (None, camera)


def dark_cameras(names: Collection[str], disturbances: Iterable[Disturbance]) -> set[str]:
    """Return the cameras that see nothing at all because of disturbances."""
    darkness = (disturbance for disturbance in disturbances if disturbance.dark)
    return {name for each in darkness for name in names if each.is_of(name)}


class SightSettings(Settings):
    """The computation of views in a run.

    Attributes:
        method: Method that decides whether somebody is in view: line_of_sight, visibility_polygon,
            flashlight, or your own.
        people_occlude: Whether bodies hide people from cameras: a body blocks each line of sight
            that passes within its radius.
        heights: Whether the heights of cameras, bodies and furniture matter: low furniture hides
            only the lower parts of what is behind it, and so do bodies, if they hide people.
        seen_every: Time between two computations of the area in view, for layers of seen cells
            and the exposure of rooms; null: in every step.
    """

    method: OneOf[FieldOfView] = LineOfSight()
    people_occlude: bool = False
    heights: bool = False
    seen_every: PositiveDuration | None = None
