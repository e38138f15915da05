"""Occupancy: when other members of a household use rooms that only one can use at a time."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

Times = Sequence[tuple[int, int]]
# The only room of a household whose rooms are unknown.
ANY_ROOM = -1


class FreeSlot(NamedTuple):
    """A time in which a room is free.

    Attributes:
        begin: When it begins [s].
        end: When it ends [s].
        room: The room, by index.
    """

    begin: int
    end: int
    room: int


class Occupancy(NamedTuple):
    """The times at which others use rooms.

    Attributes:
        rooms: For each exclusive activity, the rooms where it is done, by index, the preferred one
            first.
        times: For each room, begin and end of its use by others [s], in order of time.
    """

    rooms: Mapping[str, Sequence[int]]
    times: Mapping[int, Times]

    def rooms_of(self, activity: str) -> Sequence[int]:
        """Return the rooms of an activity, by index, the preferred one first."""
        return self.rooms.get(activity, (ANY_ROOM,))

    def free(
        self, activity: str, begin: int, latest: int, shortest: int, end_by: int
    ) -> FreeSlot | None:
        """Return the first time at which one of an activity's rooms is free for long enough.

        Args:
            activity: An exclusive activity.
            begin: The earliest begin [s].
            latest: The latest begin [s].
            shortest: The least duration [s].
            end_by: The latest end [s].
        """
        best: FreeSlot | None = None
        for room in self.rooms_of(activity):
            free = free_slot(self.times.get(room, ()), begin, latest, shortest, end_by)
            if free is not None and (best is None or free[0] < best.begin):
                best = FreeSlot(*free, room)
        return best


def free_slot(
    times: Times, begin: int, latest: int, shortest: int, end_by: int
) -> tuple[int, int] | None:
    """Return begin and end of the first free time that begins from `begin` to `latest` [s].

    The room is in use at `times`; None if it isn't free for long enough.

    >>> free_slot([(100, 200)], begin=90, latest=250, shortest=30, end_by=400)
    (200, 400)
    """
    for first, last in times:
        if last <= begin:
            continue
        if begin > latest:
            return None
        if begin + shortest <= first:
            return begin, min(end_by, first)
        begin = last
    return (begin, end_by) if begin <= latest else None
