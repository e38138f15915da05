"""Exceptions: catch :class:`Fleet2DError` for all of them."""

# A longer line of a message quotes input, and is shortened to its head and tail [characters].
_LONGEST, _HEAD, _TAIL = 1000, 600, 300
_MOST_LINES = 200


class Fleet2DError(Exception):
    """Base of all errors that Fleet2D raises.

    Example:
        >>> len(str(Fleet2DError("x" * 10**6)))
        903
    """

    def __init__(self, *args: object) -> None:
        """Shorten very long lines of the message, and very many."""
        super().__init__(*(_cut(arg) if isinstance(arg, str) else arg for arg in args))


def _cut(text: str) -> str:
    if len(text) <= _LONGEST:
        return text
    lines = text.split("\n")
    if len(lines) > _MOST_LINES:
        lines[_MOST_LINES:] = [f"... {len(lines) - _MOST_LINES} more lines"]
    return "\n".join(
        line if len(line) <= _LONGEST else f"{line[:_HEAD]}...{line[-_TAIL:]}" for line in lines
    )


class InputError(Fleet2DError):
    """The user's input is wrong; the message says what, where, and what to do."""


class ScenarioError(InputError):
    """A scenario file, an override or a component's configuration is wrong."""


class FloorPlanError(InputError):
    """A floor plan can't be read, or isn't a home."""


class PlacementError(InputError):
    """An entity can't stand at a place, or can't get there."""


class ComponentError(Fleet2DError):
    """A behavior, an algorithm or a metric broke its contract during a run."""


class NoWayError(ComponentError):
    """There is no way to a place at present, for example because a door is shut."""


class ArtifactError(Fleet2DError):
    """A run could not be stored or read back."""


class RunDirectoryError(InputError):
    """The run directory exists already, is missing, or can't be written."""
