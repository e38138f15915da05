"""Disturbances: temporary interventions on what a robot's cameras see."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from fleet2d.sight.perception import Perception


class FalseSighting(NamedTuple):
    """A false positive in every look of a camera.

    Attributes:
        user: Name of the user it is recognized as; empty for an unknown person.
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
        mistaken: Name of a user, and the name it is recognized as, empty for an unknown person.
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
        """Return whether it disturbs a camera."""
        return self.camera in (None, camera)


def of_camera(disturbances: Sequence[Disturbance], camera: str) -> list[Disturbance]:
    """Return the disturbances of a camera, in the order in which they began."""
    return [disturbance for disturbance in disturbances if disturbance.is_of(camera)]
