"""How a body moves: its pose at a step, and the two kinds of motion."""

from dataclasses import dataclass
from typing import NamedTuple

from fleet2d.kernels.motion import Breakpoints, WalkRule
from fleet2d.kernels.space import Mesh


class Pose(NamedTuple):
    """The pose of a body at one step.

    Attributes:
        x: Position [lattice].
        y: Position [lattice].
        heading: Counter-clockwise from +x [1/4096 turn].
        away: 1 if the body is out of the home, else 0.
    """

    x: int
    y: int
    heading: int
    away: int


@dataclass(frozen=True)
class Track:
    """A motion along breakpoints that are known beforehand."""

    breakpoints: Breakpoints
    step_us: int


@dataclass(frozen=True)
class RandomWalk:
    """A random walk, drawn step by step."""

    walls: Mesh
    space: Mesh
    rule: WalkRule


Motion = Track | RandomWalk
