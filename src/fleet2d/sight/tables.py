"""Perception in the integers of the kernels: tables of probabilities, computed once at set-up."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal

import numpy as np

from fleet2d.configuration.problems import suggest
from fleet2d.configuration.units import micros
from fleet2d.errors import ScenarioError
from fleet2d.floorplan.geometry.lattice import Lattice
from fleet2d.kernels import I64
from fleet2d.kernels.numbers import BELL_STD, HALF_TURN, TURN
from fleet2d.kernels.sight import (
    AT_BEARING,
    AT_DISTANCE,
    AT_FACING,
    AT_LIGHT,
    AT_MISTAKEN,
    AT_POSTURE,
    AT_RIGHT,
    AT_SEEMS,
    AT_SHOWN,
    AT_STAY,
    BEARING_NOISE,
    BINS,
    DOUBLINGS,
    HEADING_NOISE,
    KEEPS,
    MINUTES,
    MOST_GHOSTS,
    ONE,
    POSTURES,
    RANGE_NOISE,
    RANGE_SHARE,
    SHIFT,
    TABLE,
    ErrorTables,
    GhostDraw,
    Lenses,
    UserDraw,
)
from fleet2d.runtime.determinism import sum_in_order
from fleet2d.sight.camera import Lens
from fleet2d.sight.curve import chance, cumulative, decay
from fleet2d.sight.perception import POSTURES as POSTURE_NAMES
from fleet2d.sight.perception import Attributes, Detection, FalsePositives, Identity, Perception

SUM_ERROR = 1e-6  # largest excess over 1 of a sum of probabilities


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
    reach, widest = np.zeros(shape, np.int64), np.zeros(shape, np.int64)
    for c, lens in enumerate(lenses):
        for u, radius in enumerate(context.radii):
            body = lens.body(radius)
            bodies[c, u, : len(body)] = body
            reach[c, u] = round(radius) + 1 if lens.points else 0
            widest[c, u] = (lens.far + reach[c, u]) ** 2
    pans = np.zeros((len(lenses), max(1, *(len(lens.pans) for lens in lenses), 0)), np.int64)
    for c, lens in enumerate(lenses):
        pans[c, : len(lens.pans)] = lens.pans
    return Lenses(
        near_squared=_row(lens.near**2 for lens in lenses),
        far_squared=_row(lens.far**2 for lens in lenses),
        half_angle=_row(lens.half_angle for lens in lenses),
        chance=_row(lens.chance for lens in lenses),
        moves=_row(bool(lens.forward or lens.left or lens.heading or lens.pans) for lens in lenses),
        forward=_row(lens.forward for lens in lenses),
        left=_row(lens.left for lens in lenses),
        heading=_row(lens.heading for lens in lenses),
        pans=pans,
        pan_count=_row(len(lens.pans) for lens in lenses),
        pan_us=_row(lens.pan_us for lens in lenses),
        period=_row(lens.period for lens in lenses),
        latency=_row(lens.latency for lens in lenses),
        errs=_row(errs),
        points=_row(lens.points for lens in lenses),
        bodies=bodies,
        reach=reach,
        widest=widest,
    )


def _row(values: object) -> I64:
    return np.array([int(value) for value in values], np.int64)  # type: ignore[attr-defined]


def error_tables(
    lenses: Sequence[Lens], perceptions: Sequence[Perception | None], context: TableContext
) -> ErrorTables:
    """Return the errors of each camera of a robot; the caller fills in the keys of the streams.

    Raises:
        ScenarioError: A user is unknown, probabilities add up to more than 1, or a rate is above
            one false positive per look.
    """
    cameras, users = len(lenses), len(context.users)
    models = [perception or Perception() for perception in perceptions]
    sources = 1 + max(len(model.false_positives.spots) for model in models)
    # If no camera errs, no table is ever read.
    errs = any(perception is not None for perception in perceptions)
    tables = ErrorTables(
        table=np.zeros((cameras, TABLE if errs else 1), np.int64),
        confusion=np.zeros((cameras, users, users), np.int64),
        has_ghosts=np.zeros(cameras, np.int64),
        ghosts=np.full((cameras, MOST_GHOSTS), ONE, np.int64),
        source=np.full((cameras, sources), ONE, np.int64),
        spot=np.zeros((cameras, sources, 3), np.int64),
        looks_like=np.zeros((cameras, users + 1), np.int64),
        keys=np.zeros((cameras, users, len(UserDraw)), np.uint64),
        ghost_keys=np.zeros((cameras, len(GhostDraw)), np.uint64),
    )
    for c, (lens, perception) in enumerate(zip(lenses, perceptions, strict=True)):
        if perception is not None:
            reach = lens.far + max((round(radius) + 2 for radius in context.radii), default=0)
            table = tables.table[c]
            table[SHIFT] = max(0, reach.bit_length() - (BINS - 1).bit_length())
            _fill_detection(table, lens, perception.detection, context)
            _fill_identity(table, tables.confusion[c], perception.identity, context)
            _fill_attributes(table, perception.attributes, context)
            _fill_false_positives(tables, c, lens, perception.false_positives, context)
    return tables


def _distances(table: I64, context: TableContext) -> list[float]:
    """Return the distance at the middle of each entry of the tables by distance [m]."""
    width = 1 << int(table[SHIFT])
    return [(i + 0.5) * width / context.lattice.units_per_m for i in range(BINS)]


def _put(table: I64, at: int, values: Sequence[int] | I64) -> None:
    """Write values to a camera's table from the index `at` on."""
    table[at : at + len(values)] = values


def _fill_detection(table: I64, lens: Lens, model: Detection, context: TableContext) -> None:
    _put(table, AT_DISTANCE, model.distance.chances(_distances(table, context)))
    angles = [360 * i / TURN for i in range(-HALF_TURN, HALF_TURN)]
    if not model.bearing.reaches_below_zero:
        angles = [abs(angle) for angle in angles]
    _put(table, AT_BEARING, model.bearing.chances(angles))
    turns = [360 * i / TURN for i in range(HALF_TURN + 1)]
    _put(table, AT_FACING, model.orientation.chances(turns))
    _put(table, AT_POSTURE, [chance(model.posture.get(name, 1.0)) for name in POSTURE_NAMES])
    count = lens.points + 1
    shares = [i / count for i in range(count + 1)]
    _put(table, AT_SHOWN, model.visible_share.chances(shares))
    hours = [(minute + 0.5) / 60 for minute in range(MINUTES)]
    _put(table, AT_LIGHT, model.light.around_the_clock().chances(hours))
    if model.memory:
        steps = Decimal(context.step_us) / micros(model.memory)
        _put(table, AT_STAY, [chance(decay(steps * 2**i)) for i in range(DOUBLINGS)])


def _fill_identity(table: I64, confusion: I64, model: Identity, context: TableContext) -> None:
    distances = _distances(table, context)
    mistaken = model.mistaken.chances(distances)
    right = ONE - mistaken if model.right is None else model.right.chances(distances)
    excess = np.flatnonzero(right + mistaken > ONE + chance(SUM_ERROR))
    if len(excess):
        i = int(excess[0])
        raise ScenarioError(
            f"{context.path}: perception.identity: at {distances[i]:.2f} m, right"
            f" ({right[i] / ONE:.3g}) and mistaken ({mistaken[i] / ONE:.3g}) add up to more than 1"
        )
    _put(table, AT_RIGHT, right)
    _put(table, AT_MISTAKEN, mistaken)
    table[KEEPS] = model.per_track
    _check_users(model.confusion, "confusion", context)
    for u, user in enumerate(context.users):
        others = model.confusion.get(user)
        if others is None:
            rest = [name for name in context.users if name != user]
            others = {name: 1 / len(rest) for name in rest}
        _check_users(others, f"confusion.{user}", context)
        confusion[u] = _whole(cumulative(others, context.users), others, context.users)


def _whole(sums: list[int], shares: Mapping[str, float], order: Sequence[str]) -> list[int]:
    """Set cumulative probabilities to 1 from the last possible outcome on, despite rounding."""
    last = max((i for i, name in enumerate(order) if shares.get(name)), default=len(order))
    return [*sums[:last], *[ONE] * (len(sums) - last)]


def _check_users(names: Mapping[str, object], key: str, context: TableContext) -> None:
    for name in names:
        if name not in context.users:
            raise ScenarioError(
                f"{context.path}: perception: {key}: there is no user {name!r}"
                f"{suggest(name, context.users)}"
            )


def _fill_attributes(table: I64, model: Attributes, context: TableContext) -> None:
    per_bell = 65536 / BELL_STD
    table[RANGE_NOISE] = round(model.range_noise * context.lattice.units_per_m * per_bell)
    table[RANGE_SHARE] = round(model.range_noise_share * per_bell * 65536)
    table[BEARING_NOISE] = round(model.bearing_noise_deg / 360 * 2 * TURN * per_bell)
    table[HEADING_NOISE] = round(model.heading_noise_deg / 360 * TURN * per_bell)
    for i, posture in enumerate(POSTURE_NAMES):
        others: dict[str, float] = dict(model.posture.get(posture, {}).items())
        others[posture] = 1 - sum_in_order(others.values())
        sums = _whole(cumulative(others, POSTURE_NAMES), others, POSTURE_NAMES)
        _put(table, AT_SEEMS + POSTURES * i, sums)


def _fill_false_positives(
    tables: ErrorTables, camera: int, lens: Lens, model: FalsePositives, context: TableContext
) -> None:
    _check_users(model.looks_like, "looks_like", context)
    tables.looks_like[camera] = cumulative(model.looks_like, [*context.users, None])
    tables.looks_like[camera, -1] = ONE
    rates = [model.per_hour, *(spot.per_hour for spot in model.spots)]
    if not any(rates):
        return
    tables.has_ghosts[camera] = 1
    hours = Decimal(lens.period * context.step_us) / (3600 * 10**6)
    mean = sum(map(Decimal, rates)) * hours
    if mean > 1:
        raise ScenarioError(
            f"{context.path}: perception.false_positives: {sum_in_order(rates):g} per hour exceeds"
            f" the limit of one per look ({float(1 / hours):g} per hour at this period)"
        )
    # A sum of Poisson processes is one, whose points belong to each by its share of the rate.
    term, total = decay(mean), 0.0
    for count in range(MOST_GHOSTS):
        total += term
        tables.ghosts[camera, count] = chance(min(total, 1.0))
        term *= float(mean) / (count + 1)
    shares = {str(i): rate / sum_in_order(rates) for i, rate in enumerate(rates)}
    tables.source[camera, : len(rates)] = _whole(
        cumulative(shares, list(shares)), shares, list(shares)
    )
    for i, spot in enumerate(model.spots, 1):
        x, y = context.lattice.point_at(spot.at)
        noise = round(spot.spread * context.lattice.units_per_m * 65536 / BELL_STD)
        tables.spot[camera, i] = x, y, noise


def is_perfect(perception: Perception | None) -> bool:
    """Return whether a look has no errors, so that it needs no tables; `errors` come after it."""
    return perception is None or perception.model_copy(update={"errors": {}}) == Perception()
