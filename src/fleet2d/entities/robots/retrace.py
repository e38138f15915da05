"""Retrace: drive the path that a robot vacuum recorded in its map."""

from pathlib import Path
from typing import ClassVar

import numpy as np
from pydantic import Field

from fleet2d.configuration.components import register
from fleet2d.configuration.units import InputPath, Length
from fleet2d.entities.behavior import Actor, Behavior, Situation
from fleet2d.entities.place import Nearest, avoided_rooms, lies_in
from fleet2d.entities.plan import Plan
from fleet2d.errors import FloorPlanError, PlacementError
from fleet2d.floorplan.formats.valetudo import read_valetudo_paths
from fleet2d.kernels import I64


@register("behavior", "retrace")
class Retrace(Behavior):
    """Drive the path in the map of a Valetudo robot, in the home of that map, at the robot's speed.

    The map has no times; for a log with times use the behavior `replay`. Points nearer to each
    other than `spacing` are thinned out. A point that the body can't get to is replaced by the
    nearest one that it can, if that is within `reach`. At the end of the path it starts again,
    after `cooldown`. Events: `retraces`, with the number of points, and `retraced`.

    Attributes:
        path: The map's JSON file.
        spacing: Points of the path nearer than this are left out [m].
        reach: A point farther than this from free space is left out [m].
        avoid: Rooms, or kinds of rooms if the home has them, whose part of the path is left out.
    """

    records: ClassVar[frozenset[str]] = frozenset({"retraced", "retraces"})
    resumes: ClassVar[bool] = True

    path: InputPath
    spacing: Length = Field(default=0.1, ge=0)
    reach: Length = Field(default=1.0, ge=0)
    avoid: tuple[str, ...] = ()

    def files(self) -> tuple[Path, ...]:
        """Return the files that it reads."""
        return (self.path,)

    def start(self, actor: Actor) -> None:
        """Read the path and move its points to free places.

        Raises:
            PlacementError: The map has no path, or none that the robot can drive here.
        """
        try:
            pieces = read_valetudo_paths(self.path)
        except FloorPlanError as error:
            raise PlacementError(
                f"{actor.path}: {error}; it retraces the map of a Valetudo robot, and a log of"
                " positions with times is for the behavior 'replay'"
            ) from error
        if not pieces:
            raise PlacementError(f"{actor.path}: {self.path} holds no path to retrace")
        lattice = actor.home.plan.lattice
        points: I64 = lattice.to_lattice(np.concatenate(pieces))
        near: I64 = Nearest(actor).of(points)
        squared_moves = ((near - points) ** 2).sum(axis=1)
        reachable = near[squared_moves <= (self.reach * lattice.units_per_m) ** 2]
        avoided = avoided_rooms(actor, "retrace.avoid", self.avoid)
        points_left = _thin_out(reachable, self.spacing * lattice.units_per_m)
        self.points = [p for p in points_left if not lies_in(actor, p, avoided)]
        if len(self.points) < 2:
            raise PlacementError(
                f"{actor.path}: of the path in {self.path}, {len(self.points)} points are within"
                f" {self.reach:g} m of where the robot can be and goes: is this the home of that"
                " map?"
            )

    def decide(self, now: Situation) -> Plan:
        """Drive the whole path."""
        plan = now.plan().note("retraces", f"{len(self.points)} points")
        for x, y in self.points:
            if not now.actor.may_block_routes or plan.reaches(x, y):
                plan.go_to_point(x, y)
        return plan.note("retraced")


def _thin_out(points: I64, spacing: float) -> list[tuple[int, int]]:
    """Return points in order, each farther than `spacing` from the one before [lattice]."""
    path: list[tuple[int, int]] = []
    for x, y in points.tolist():
        if not path or (x - path[-1][0]) ** 2 + (y - path[-1][1]) ** 2 > spacing * spacing:
            path.append((x, y))
    return path
