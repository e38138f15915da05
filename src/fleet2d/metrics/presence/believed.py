"""What algorithms put out, read as presence by the metrics that measure it."""

from typing import TYPE_CHECKING, Any

import numpy as np

from fleet2d.algorithms.output import RoomDistribution
from fleet2d.algorithms.presence.belief import Presence
from fleet2d.errors import ComponentError

if TYPE_CHECKING:
    from fleet2d.algorithms.algorithm import Present


def presence_of(name: str, state: "Present") -> Presence | None:
    """Return an algorithm's newest output as presence; None before the first.

    A RoomDistribution is taken as that of every user and of anyone, who are never away.

    Raises:
        ComponentError: It is neither.
    """
    output: Any = state.outputs.get(name)
    if output is None or isinstance(output, Presence):
        return output
    if isinstance(output, RoomDistribution):
        rows = len(state.users) + 1
        home = np.tile(output.share, (rows, 1))
        return Presence(state.users, home, np.zeros(rows), state.time)
    raise ComponentError(
        f"algorithms.{name} put out a {type(output).__name__}; this metric measures presence:"
        " a Presence or a RoomDistribution"
    )
