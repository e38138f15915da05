"""A camera that looks at users who are somewhere else in each step: what comes of a perception."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import shapely
from tests.meshed_homes import home_of

from fleet2d.algorithms.observations import SightingTable
from fleet2d.floorplan.lattice import Lattice
from fleet2d.kernels import (
    F64,
    I8,
    MAX_GHOSTS,
    DetectionRule,
    Mesh,
    Window,
    detect,
    new_memory,
)
from fleet2d.runtime.determinism import stream_key
from fleet2d.sight.camera import Camera, TableContext, error_tables, stack_lenses
from fleet2d.sight.perception import Perception

UNITS_PER_M = 1280  # cells of 5 cm
SIDE_M = 20.0
LATTICE = Lattice(cell=0.05, origin=(0.0, 0.0), columns=400, rows=400)
PILLAR = shapely.box(12, 10.3, 12.5, 11.5)


def hall(*pillars):
    """Return a hall of 20 m by 20 m, with pillars [m]."""
    space = shapely.box(0, 0, SIDE_M, SIDE_M).difference(shapely.union_all(pillars))
    return home_of([shapely.transform(space, lambda xy: np.rint(xy * UNITS_PER_M))]).mesh


HALL = hall()


def scene(users=("ana", "ben", "cleo"), step_us=10**6):
    """Return the scene of users of 20 cm."""
    return TableContext(users, [0.2 * UNITS_PER_M] * len(users), LATTICE, step_us, "robots.r")


@dataclass
class Watch:
    """What is watched: poses by step, of the robot (steps, 3) and of each user (users, steps, 3).

    Poses are x, y [m] and heading [deg]; the robot is in the middle of the hall and looks along +x.
    """

    users: F64
    camera: Mapping[str, Any] = field(default_factory=dict)
    perception: Mapping[str, Any] = field(default_factory=dict)
    robot: F64 | None = None
    posture: I8 | None = None
    names: Sequence[str] = ("ana", "ben", "cleo", "dora")
    step_s: float = 1.0
    start_h: float = 0.0
    seed: int = 1
    walls: Mesh = HALL
    radius: float = 0.2

    def look(self):
        """Return all sightings, a row each."""
        count, steps = self.users.shape[:2]
        camera = Camera.model_validate(
            {"range": [0, 9], "angle_deg": 360, **self.camera, "perception": self.perception}
        )
        step_us = round(self.step_s * 1e6)
        lens = camera.lens(UNITS_PER_M, step_us)
        scene = TableContext(
            self.names[:count], [self.radius * UNITS_PER_M] * count, LATTICE, step_us, "robots.r"
        )
        errors = error_tables([lens], [camera.perception or Perception()], scene)
        for u, name in enumerate(scene.users):
            for i in range(errors.keys.shape[2]):
                errors.keys[0, u, i] = stream_key(self.seed, "robots.r", f"{i} {name}")
        for i in range(errors.ghost_keys.shape[1]):
            errors.ghost_keys[0, i] = stream_key(self.seed, "robots.r", f"{i} ghost")
        burst = count + MAX_GHOSTS * int(errors.has_ghosts[0])
        rule = DetectionRule(
            lens.patience, step_us, round(self.start_h * 3.6e9), burst, False, False
        )
        memory = new_memory(1, count, burst * (lens.latency // lens.period + 2))
        robot = (
            np.tile([SIDE_M / 2, SIDE_M / 2, 0.0], (steps, 1)) if self.robot is None else self.robot
        )
        posture = np.zeros((count + 1, steps), np.int8)
        if self.posture is not None:
            posture[1:] = self.posture
        poses = _lattice(np.concatenate([robot[None], self.users]))
        window = Window(0, *poses, np.zeros((count + 1, steps), np.uint8), posture)
        lenses = stack_lenses([lens], [True], scene)
        done, step, index, distinct, *_ = detect(
            self.walls, lenses, errors, rule, window, 0, 1, memory
        )
        assert done == steps
        return SightingTable(step, index, distinct.T).rows()


def _lattice(poses):
    """Return x, y and heading as the kernels have them."""
    x, y = (np.rint(poses[..., i] * UNITS_PER_M).astype(np.int64) for i in (0, 1))
    return [x, y, np.rint(poses[..., 2] / 360 * 4096).astype(np.int64) % 4096]


def around(distance, bearing_deg, facing_deg=0.0):
    """Return poses (1, n, 3) of a user at distances and bearings from the middle of the hall."""
    angle = np.deg2rad(bearing_deg)
    x = SIDE_M / 2 + distance * np.cos(angle)
    y = SIDE_M / 2 + distance * np.sin(angle)
    return np.stack([x, y, np.broadcast_to(facing_deg, x.shape)], axis=-1)[None]


def agree(hits, expected, z=4.5):
    """Return whether independent yes/no outcomes happen as often as their probabilities say.

    A true model fails in one of 150,000 cases (4.5 standard deviations of the binomial).
    """
    p = np.broadcast_to(np.asarray(expected, np.float64), hits.shape)
    assert len(hits) > 100
    spread = np.sqrt((p * (1 - p)).sum())
    return bool(abs(hits.sum() - p.sum()) <= z * spread + 0.5 + 1e-3 * p.sum())
