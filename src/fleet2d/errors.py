"""What can go wrong, as a small tree: catch :class:`Fleet2DError` for all of it."""


class Fleet2DError(Exception):
    """Base of every error that Fleet2D raises on purpose."""


class InputError(Fleet2DError):
    """What the user gave is wrong; the message says what, where, and what to do."""


class ScenarioError(InputError):
    """A scenario file, an override or a component's configuration is wrong."""


class FloorPlanError(InputError):
    """A floor plan can't be read, or isn't a home."""


class PlacementError(InputError):
    """An entity can't stand or go where it was told to."""


class ComponentError(Fleet2DError):
    """A behavior, an algorithm or a metric broke its contract during a run."""


class NoWayError(ComponentError):
    """There is no way to a place at present; a shut door may be why."""


class ArtifactError(Fleet2DError):
    """A run could not be stored or read back."""


class RunDirectoryError(InputError):
    """The run directory exists already, is missing, or can't be written."""
