"""Disturbed cameras: the effect of interventions on the tables of the kernel that looks."""

from collections.abc import Sequence
from fractions import Fraction

import numpy as np

from fleet2d.kernels import I64
from fleet2d.kernels.sight import (
    FORCED_IDENTITY,
    FORCED_MISS,
    About,
    Lenses,
    SightingColumn,
    SightMemory,
)
from fleet2d.sight.camera import Disturbance, TableContext, of_camera
from fleet2d.sight.perception import Perception

# Squared distance beyond which a dark camera sees nobody.
NOT_EVEN_AT_0 = -1


def present_errors(disturbances: Sequence[Disturbance], camera: str) -> Perception | None:
    """Return the present errors of a camera, by the latest intervention; None: the usual ones."""
    errs = [
        disturbance.errs
        for disturbance in of_camera(disturbances, camera)
        if disturbance.errs is not None
    ]
    return errs[-1] if errs else None


def dark_cameras(disturbances: Sequence[Disturbance], cameras: Sequence[str]) -> list[int]:
    """Return the cameras that see nothing, by number."""
    return [
        c
        for c, camera in enumerate(cameras)
        if any(disturbance.dark for disturbance in of_camera(disturbances, camera))
    ]


def worsen(lenses: Lenses, disturbances: Sequence[Disturbance], cameras: Sequence[str]) -> None:
    """Change lenses in place: dark cameras see nobody, others notice people less often."""
    lenses.widest[dark_cameras(disturbances, cameras)] = NOT_EVEN_AT_0
    for c, camera in enumerate(cameras):
        for disturbance in of_camera(disturbances, camera):
            chance = Fraction(int(lenses.chance[c])) * Fraction(disturbance.detection)
            lenses.chance[c] = round(chance)


def forced_of(
    disturbances: Sequence[Disturbance], cameras: Sequence[str], people: Sequence[str]
) -> I64:
    """Return what each person in view is perceived as, (cameras, people); see About.FORCED."""
    index = {name: u for u, name in enumerate(people)} | {"": -1}
    forced = np.zeros((len(cameras), len(people)), np.int64)
    for c, camera in enumerate(cameras):
        for disturbance in of_camera(disturbances, camera):
            if disturbance.missed is not None:
                forced[c, index[disturbance.missed]] = FORCED_MISS
            if disturbance.mistaken is not None:
                user, other = disturbance.mistaken
                forced[c, index[user]] = FORCED_IDENTITY + index[other]
    return forced


def injected_by(
    disturbances: Sequence[Disturbance], cameras: Sequence[str], context: TableContext
) -> I64:
    """Return the false sightings of cameras that aren't dark, (n, 5); see ErrorTables."""
    dark = dark_cameras(disturbances, cameras)
    index = {name: u for u, name in enumerate(context.users)} | {"": -1}
    rows = [
        (
            c,
            index[sighting.user],
            *context.lattice.to_lattice((sighting.x, sighting.y)),
            sighting.heading,
        )
        for c, camera in enumerate(cameras)
        for disturbance in of_camera(disturbances, camera)
        if (sighting := disturbance.injected) is not None and c not in dark
    ]
    return np.array(rows, np.int64).reshape(-1, 5)


def carry_over(memory: SightMemory, old: SightMemory, forced: I64) -> SightMemory:
    """Return the memory of cameras for other errors, with the content of the old memory.

    Args:
        memory: The new memory, of a robot that has seen nobody.
        old: The memory of the same cameras so far.
        forced: What each user in view is perceived as from now on, (cameras, users).
    """
    about = old.about.copy()
    about[..., About.FORCED.value] = forced
    rows = max(memory.backlog.shape[1], int(old.waiting[:, 1].max(initial=0)))
    backlog = np.zeros((len(about), rows, len(SightingColumn)), np.int64)
    waiting = np.zeros_like(old.waiting)
    for c, (begin, length) in enumerate(old.waiting.tolist()):
        places = (begin + np.arange(length)) % max(1, old.backlog.shape[1])
        backlog[c, :length], waiting[c, 1] = old.backlog[c, places], length
    return SightMemory(old.noticed, old.seen, about, backlog, waiting)
