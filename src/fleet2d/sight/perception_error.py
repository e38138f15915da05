"""The base of errors of perception, which change what a camera perceived of people."""

from abc import abstractmethod
from typing import TYPE_CHECKING, Any, ClassVar

from fleet2d.configuration.components import Component

if TYPE_CHECKING:
    from fleet2d.sight.camera_sightings import CameraSightings


class PerceptionError(Component):
    """Base of errors of perception; a subclass writes `distort`. It is no exception.

    An error acts on the sightings of one camera. It may use the sightings and their draws only, and
    treats each by itself: a call has any number of looks, and looks may be computed twice. So it
    keeps no state.

    Example:
        >>> import numpy as np
        >>> import fleet2d
        >>> class Backwards(fleet2d.PerceptionError):
        ...     '''People of whom some are perceived from the wrong side.
        ...
        ...     Attributes:
        ...         share: Share of sightings whose heading is off by half a turn.
        ...     '''
        ...     share: fleet2d.Share = 0.1
        ...     def distort(self, sightings):
        ...         is_wrong = sightings.uniform("backwards") < self.share
        ...         return sightings.replace(heading=sightings.heading + np.pi * is_wrong)
        >>> robot = {"perception": {"errors": {"backwards": Backwards(share="20 %")}}}
        >>> run = fleet2d.run(duration="12 h", seed=4, robots={"astro": robot})
        >>> rows = run.pandas("observations")
        >>> wrong = (rows.heading - rows.true_heading).abs() > 3
        >>> bool(0.19 < wrong.mean() < 0.21)
        True
    """

    kind: ClassVar[str] = "perception_error"

    @abstractmethod
    def distort(self, sightings: "CameraSightings") -> "CameraSightings":
        """Return the sightings with this error: `sightings.replace(…)`, or `sightings.moved(…)`.

        Args:
            sightings: What a camera perceived in some looks, with the errors that come before.
        """

    def __setattr__(self, name: str, value: Any) -> None:
        """Refuse to keep state."""
        if name in type(self).model_fields:
            super().__setattr__(name, value)
        raise AttributeError(
            f"{type(self).__name__}.{name} can't be set: errors of perception keep no state, as"
            " looks may be computed twice; for errors that last use draws such as"
            " sightings.uniform('burst', at=sightings.step // 60)"
        )
