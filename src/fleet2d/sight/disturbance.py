"""Disturbances: what somebody outside does for a while to what a robot's cameras see."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from fleet2d.sight.perception import Perception


class FalseSighting(NamedTuple):
    """Somebody who is perceived in every look, and isn't there.

    Attributes:
        user: For whom it is taken; empty for somebody unknown.
        x, y: Where [m].
        heading: Where it seems to face [1/4096 turn].
    """

    user: str
    x: float
    y: float
    heading: int


@dataclass(frozen=True)
class Disturbance:
    """One disturbance of a robot's cameras.

    Attributes:
        camera: The camera; None: all.
        dark: Whether it sees nothing at all.
        detection: Factor of the probability that a user in view is noticed.
        errs: How it errs instead; None: as before.
        missed: A user who isn't noticed; None: nobody.
        mistaken: A user, and for whom it is taken; empty for somebody unknown.
        injected: Somebody who isn't there.
    """

    camera: str | None = None
    dark: bool = False
    detection: float = 1.0
    errs: Perception | None = None
    missed: str | None = None
    mistaken: tuple[str, str] | None = None
    injected: FalseSighting | None = None

    def is_of(self, camera: str) -> bool:
        """Tell whether it disturbs a camera."""
        return self.camera in (None, camera)


def of_camera(disturbances: Sequence[Disturbance], camera: str) -> list[Disturbance]:
    """Return those of a camera, in the order in which they began."""
    return [each for each in disturbances if each.is_of(camera)]
