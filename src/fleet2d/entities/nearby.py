"""Free points near a person or an object, where a body can stand."""

from collections.abc import Iterator

from fleet2d.entities.body import Body
from fleet2d.kernels.numbers import TURN, UNIT, cosine, sine


def points_at_distance(
    body: Body, center: tuple[int, int], distance: int, directions: int
) -> Iterator[tuple[int, int]]:
    """Yield the points at a distance from a point where a body can stand, in the point's room.

    Args:
        body: The body.
        center: The point [lattice].
        distance: The distance [lattice].
        directions: How many directions are tried, evenly spaced.
    """
    plan, space = body.home.plan, body.space
    room = plan.room_at(*plan.lattice.to_metres(center).tolist())
    for i in range(directions):
        heading = i * TURN // directions
        x = center[0] + distance * cosine(heading) // UNIT
        y = center[1] + distance * sine(heading) // UNIT
        is_in_room = plan.room_at(*plan.lattice.to_metres((x, y)).tolist()) == room
        if is_in_room and space.part_at(x, y) == body.part:
            yield x, y
