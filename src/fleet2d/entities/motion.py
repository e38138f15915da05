"""How a body moves: its pose at a step, and the two kinds of motion."""

from dataclasses import dataclass
from typing import NamedTuple

from fleet2d.kernels.mesh import Mesh
from fleet2d.kernels.motion import Breakpoints, WalkRule


class Pose(NamedTuple):
    """Where a body is at one step: lattice units, 1/4096 turn, 1 = away."""

    x: int
    y: int
    heading: int
    away: int


@dataclass(frozen=True)
class Track:
    """A motion known beforehand."""

    breakpoints: Breakpoints
    step_us: int


@dataclass(frozen=True)
class Walk:
    """A random walk, drawn step by step."""

    walls: Mesh
    space: Mesh
    rule: WalkRule


Motion = Track | Walk
