"""When rooms that only one can use at a time are in use by others of a household."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

Times = Sequence[tuple[int, int]]
# The room of a household that knows nothing of its home.
ANY_ROOM = -1


class Free(NamedTuple):
    """A free time: from when one may be in a room, until when at most, and in which."""

    begin: int
    end: int
    room: int


class Busy(NamedTuple):
    """Which rooms others use when.

    Attributes:
        rooms: For each activity that wants a room to itself, the rooms where it is done, by index,
            in the order of one's preference.
        times: For each room, when others are in it [s], in order of time.
    """

    rooms: Mapping[str, Sequence[int]]
    times: Mapping[int, Times]

    def rooms_of(self, activity: str) -> Sequence[int]:
        """Return where an activity is done, by index, in the order of one's preference."""
        return self.rooms.get(activity, (ANY_ROOM,))

    def free(
        self, activity: str, begin: int, latest: int, shortest: int, end_by: int
    ) -> Free | None:
        """Return the first time at which one of an activity's rooms is free for long enough.

        Args:
            activity: What wants a room to itself.
            begin: The earliest beginning [s].
            latest: The latest beginning [s].
            shortest: How long the room is wanted at least [s].
            end_by: When it has to be over [s].
        """
        best: Free | None = None
        for room in self.rooms_of(activity):
            free = free_time(self.times.get(room, ()), begin, latest, shortest, end_by)
            if free is not None and (best is None or free[0] < best.begin):
                best = Free(*free, room)
        return best


def free_time(
    busy: Times, begin: int, latest: int, shortest: int, end_by: int
) -> tuple[int, int] | None:
    """Return the first beginning from `begin` to `latest` between others' times, and its end.

    >>> free_time([(100, 200)], begin=90, latest=250, shortest=30, end_by=400)
    (200, 400)
    """
    for first, last in busy:
        if last <= begin:
            continue
        if begin > latest:
            return None
        if begin + shortest <= first:
            return begin, min(end_by, first)
        begin = last
    return (begin, end_by) if begin <= latest else None
