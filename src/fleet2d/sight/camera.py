"""The camera of a robot: its field of view, and the probability that it notices a user."""

from collections.abc import Sequence
from datetime import timedelta
from typing import NamedTuple, Self

from pydantic import Field, model_validator

from fleet2d.configuration.components import Settings
from fleet2d.configuration.problems import problem, problem_at
from fleet2d.configuration.units import (
    AngleDeg,
    Duration,
    Length,
    PositiveDuration,
    Share,
    format_duration,
    micros,
    whole_steps,
)
from fleet2d.kernels.numbers import TURN, UNIT, cosine, sine
from fleet2d.sight.perception import Perception

# Squares of distances in lattice units stay far inside 64 bits.
FARTHEST_M = 10_000
MOST_POINTS = 32


class Pan(Settings):
    """Pan of a camera: it looks in each direction for some time, then in the next.

    Attributes:
        headings_deg: Directions, one after the other, relative to its heading on the body.
        dwell: How long it looks in each direction.
    """

    headings_deg: tuple[AngleDeg, ...] = Field(
        min_length=1, max_length=64, examples=[[-45, 0, 45, 0]]
    )
    dwell: PositiveDuration = timedelta(seconds=5)


class Lens(NamedTuple):
    """A camera in integer units for the sight kernel; see `fleet2d.kernels.sight.Lenses`."""

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

    def body(self, radius: float) -> list[tuple[int, int]]:
        """Return the points of a body of `radius` [lattice units] to look at: its centre first."""
        steps = [round(i * TURN / self.points) for i in range(self.points)]
        along, half = round(radius), UNIT // 2
        circle = [
            ((along * cosine(h) + half) // UNIT, (along * sine(h) + half) // UNIT) for h in steps
        ]
        return [(0, 0), *((int(x), int(y)) for x, y in circle)]


# A user not noticed for this long is lost, where a camera doesn't say otherwise.
USUAL_PATIENCE = timedelta(seconds=5)


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
        offset: Where it is mounted: forward and left of the body's centre [m].
        heading_deg: The direction in which it looks, counter-clockwise from the body's heading.
        pan: The directions between which it turns; null: its direction is fixed.
        period: Time from look to look; null: one in every step.
        latency: Time from a look until its detections are known.
        body_points: Points on a circle of a user's radius that are looked at besides the centre:
            one in view is enough; 0: only the centre counts.
        perception: Its errors; null: the robot's `perception`.
    """

    range: tuple[Length, Length] = Field(default=(0.0, 4.5), examples=[[0.3, 4.5]])
    angle_deg: AngleDeg = Field(default=108.0, gt=0, le=360)
    detection: Share = 1.0
    lost_after: Duration | None = Field(default=None, examples=["5 s"])
    offset: tuple[Length, Length] = Field(default=(0.0, 0.0), examples=[[0.1, 0]])
    heading_deg: AngleDeg = 0.0
    pan: Pan | None = None
    period: PositiveDuration | None = None
    latency: Duration = timedelta(0)
    body_points: int = Field(default=0, ge=0, le=MOST_POINTS)
    perception: Perception | None = None

    @model_validator(mode="after")
    def _range_is_ordered(self) -> Self:
        near, far = self.range
        if not 0 <= near < far:
            raise problem(
                f"range is [{near:g}, {far:g}]: the nearest distance must be below the farthest"
            )
        if far > FARTHEST_M:
            raise problem(f"range ends at {far:g} m: {FARTHEST_M:g} m is beyond any home")
        if max(map(abs, self.offset)) > FARTHEST_M:
            raise problem_at(("offset",), f"{FARTHEST_M:g} m from its body is beyond any home")
        return self

    @model_validator(mode="after")
    def _looks_before_it_forgets(self) -> Self:
        patience = USUAL_PATIENCE if self.lost_after is None else self.lost_after
        if self.period is not None and self.period > patience:
            raise problem_at(
                ("period",),
                f"{format_duration(self.period)} is longer than lost_after,"
                f" {format_duration(patience)}: each user would be lost between two looks",
            )
        return self

    def lens(self, units_per_m: float, step_us: int) -> Lens:
        """Convert the camera to integer units: lattice units, parts of a turn, and steps.

        Raises:
            ValueError: The period, or a given `lost_after`, is not a multiple of the step.
        """
        lost_us = micros(USUAL_PATIENCE if self.lost_after is None else self.lost_after)
        if lost_us % step_us and self.lost_after is not None:
            raise ValueError(
                f"lost_after is {format_duration(self.lost_after)}, which is not a multiple of"
                f" simulation.step ({step_us / 1e6:g} s): it would act as"
                f" {-(-lost_us // step_us) * step_us / 1e6:g} s; choose a multiple"
            )
        near, far = (round(distance * units_per_m) for distance in self.range)
        period = 1
        if self.period is not None:
            period = whole_steps(self.period, step_us, "period", ValueError)
        return Lens(
            near=near,
            far=far,
            # At 0, both borders are one line, and what lies right behind is on it, too.
            half_angle=max(1, round(self.angle_deg / 360 * TURN)),
            chance=round(self.detection * 2**53),
            patience=-(-lost_us // step_us),
            forward=round(self.offset[0] * units_per_m),
            left=round(self.offset[1] * units_per_m),
            heading=headings([self.heading_deg])[0],
            pans=headings(self.pan.headings_deg if self.pan else ()),
            pan_us=micros(self.pan.dwell) if self.pan else 1,
            period=period,
            latency=-(-micros(self.latency) // step_us),
            points=self.body_points,
        )


def headings(degrees: Sequence[float]) -> tuple[int, ...]:
    """Return angles in 1/4096 of a turn, rounded.

    >>> headings([90, -45])
    (1024, 3584)
    """
    return tuple(round(angle / 360 * TURN) % TURN for angle in degrees)
