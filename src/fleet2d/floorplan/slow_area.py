"""Areas that slow robots down: wet floors, deep carpets, and edges at which they stop."""

from collections.abc import Iterator, Sequence
from datetime import timedelta
from fractions import Fraction
from itertools import compress, pairwise
from math import ceil
from operator import gt
from typing import NamedTuple

import numpy as np
from pydantic import Field
from shapely import Polygon

from fleet2d.configuration.components import Settings
from fleet2d.configuration.problems import problem, problem_at
from fleet2d.configuration.units import Duration, Length, Share, micros
from fleet2d.floorplan.lattice import Lattice, LatticePoint
from fleet2d.kernels import I64, TURN, turn_between


class SlowArea(Settings):
    """An area in which robots drive slowly, or at whose edge they stop; they don't know of it.

    Attributes:
        area: Its corners [m].
        speed: Their speed in it, as a share of the usual one; turning on the spot is as ever.
        stop: How long they stop when they enter it.
    """

    area: tuple[tuple[Length, Length], ...] = Field(
        min_length=3, max_length=1000, examples=[[[1.0, 0.5], [2.5, 0.5], [2.5, 2.0]]]
    )
    speed: Share = Field(default=1.0, ge=0.01)
    stop: Duration = timedelta(0)

    def model_post_init(self, _: object, /) -> None:
        """Refuse sides that cross, and an area without effect."""
        if not Polygon(self.area).is_valid:
            raise problem_at(("area",), "the sides cross: give the corners in their order")
        if self.speed == 1 and not self.stop:
            raise problem("it slows nobody down: give 'speed' below 100 %, or 'stop'")

    def on(self, lattice: Lattice) -> "SlowRegion":
        """Return the area on the lattice."""
        corners = [(int(x), int(y)) for x, y in lattice.to_lattice(np.array(self.area)).tolist()]
        return SlowRegion(tuple(corners), Fraction(self.speed), micros(self.stop))


class SlowRegion(NamedTuple):
    """A slow area on the lattice.

    Attributes:
        corners: Its corners [lattice].
        speed: The speed in it, as a share of the usual one.
        stop_us: How long a robot stops when it enters it [us].
    """

    corners: tuple[LatticePoint, ...]
    speed: Fraction
    stop_us: int

    def sides(self) -> Iterator[tuple[LatticePoint, LatticePoint]]:
        """Yield its sides."""
        return pairwise([*self.corners, self.corners[0]])

    def holds(self, x: Fraction, y: Fraction) -> bool:
        """Return whether a point lies in it, by the number of sides on its right."""
        is_inside = False
        for (ax, ay), (bx, by) in self.sides():
            if (ay > y) != (by > y):
                is_inside ^= x < ax + (y - ay) * Fraction(bx - ax, by - ay)
        return is_inside

    def crossings(self, start: LatticePoint, end: LatticePoint) -> set[Fraction]:
        """Return where a leg crosses its sides, as shares of the leg strictly between 0 and 1."""
        x, y = start
        dx = end[0] - start[0]
        dy = end[1] - start[1]
        shares = set()
        for (ax, ay), (bx, by) in self.sides():
            cross = dx * (by - ay) - dy * (bx - ax)
            if cross:
                along = Fraction((ax - x) * (by - ay) - (ay - y) * (bx - ax), cross)
                across = Fraction((ax - x) * dy - (ay - y) * dx, cross)
                if 0 < along < 1 and 0 <= across <= 1:
                    shares.add(along)
        return shares


def slowed(rows: I64, regions: Sequence[SlowRegion]) -> I64:
    """Return the breakpoints of a motion that leads through slow regions.

    Where regions overlap, the slowest counts. A leg has further breakpoints where it crosses a
    side, rounded to the lattice; later times move by what the robot loses, rounded up to
    microseconds.

    Args:
        rows: Time [us], x, y [lattice], heading [1/4096 turn], away; int64 (n, 5). The first is
            where the motion begins.
        regions: The regions.

    Returns:
        int64 (m, 5), from the first row on.
    """
    result = [rows[0].tolist()]
    time_us = int(rows[0, 0])
    x, y = (Fraction(int(value)) for value in rows[0, 1:3])
    within = [region.holds(x, y) for region in regions]
    for (t0, x0, y0, h0, _), (t1, x1, y1, h1, away) in pairwise(rows.tolist()):
        if (x0, y0) == (x1, y1):
            time_us += t1 - t0
            result.append([time_us, x1, y1, h1, away])
            continue
        shares = set().union(*(region.crossings((x0, y0), (x1, y1)) for region in regions))
        for begin, end in pairwise([Fraction(0), *sorted(shares), Fraction(1)]):
            middle = (begin + end) / 2
            now = [r.holds(x0 + middle * (x1 - x0), y0 + middle * (y1 - y0)) for r in regions]
            entered = compress(regions, map(gt, now, within))
            stop_us = max((region.stop_us for region in entered), default=0)
            within = now
            if stop_us:
                time_us += stop_us
                result.append([time_us, *result[-1][1:]])
            speed = min((region.speed for region in compress(regions, now)), default=1)
            time_us += ceil((t1 - t0) * (end - begin) / speed)
            turned = round(turn_between(h0, h1) * end)
            point = round(x0 + end * (x1 - x0)), round(y0 + end * (y1 - y0))
            result.append([time_us, *point, (h0 + turned) % TURN, away])
    return np.array(result, np.int64)
