"""Events of seeing and losing, from sightings that were changed after the look."""

import numpy as np

from fleet2d.kernels import I64
from fleet2d.kernels.sight import USER_LOST, USER_SEEN, SightMemory
from fleet2d.kernels.sight import SightingColumn as Column


def sight_events(
    rows: I64, memory: SightMemory, patience: int, first: int, end: int
) -> list[tuple[int, int, int]]:
    """Return the events (step, identity, kind) of some steps, as `look` notes them, in its order.

    Args:
        rows: The sightings that become known in the steps, (n, columns).
        memory: The memory at the first step; what it holds of identities becomes that at the end.
        patience: Steps without a sighting after which an identity counts as lost.
        first: The first step.
        end: The step after the last one.
    """
    patience = max(patience, 1)
    events: list[tuple[int, int, int]] = []
    for identity in range(len(memory.seen)):
        number = identity if identity < len(memory.seen) - 1 else -1
        steps = np.unique(rows[rows[:, Column.IDENTITY] == number, Column.STEP])
        if memory.seen[identity]:
            steps = np.concatenate([memory.noticed[[identity]], steps])
        elif not len(steps):
            continue
        else:
            events.append((int(steps[0]), identity, USER_SEEN))
        breaks = np.flatnonzero(np.diff(steps) > patience)
        losses, returns = steps[breaks] + patience, steps[breaks + 1]
        last = int(steps[-1])
        is_lost = last + patience < end
        losses = np.append(losses, last + patience) if is_lost else losses
        events += [(max(step, first), identity, USER_LOST) for step in losses.tolist()]
        events += [(step, identity, USER_SEEN) for step in returns.tolist()]
        memory.noticed[identity], memory.seen[identity] = last, not is_lost
    return sorted(events)
