"""The base of objects that have a state of their own during a run."""

from typing import ClassVar

from fleet2d.component import Component


class HomeObject(Component):
    """An object of the home with a state: a door, a sensor.

    Furniture that just stands there is part of the floor plan.
    """

    kind: ClassVar[str] = "object"
