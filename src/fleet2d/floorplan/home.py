"""The home of a run: its floor plan, and the space that bodies of each size have in it."""

from fleet2d.errors import PlacementError
from fleet2d.floorplan.plan import FloorPlan, Room
from fleet2d.floorplan.space import Space

# Where one leaves a home whose plan names no entrance: the first of these that it has.
WAYS_OUT = ("entryway", "lobby", "hallway", "hall", "living_room", "kitchen")


class Home:
    """A floor plan as the entities of a run use it.

    Attributes:
        plan: The floor plan.
        rooms: Its rooms, in index order.

    Example:
        >>> import fleet2d
        >>> home = fleet2d.Home(fleet2d.load_floorplan())
        >>> home.space(radius=0.2).parts
        1
    """

    def __init__(self, plan: FloorPlan) -> None:
        self.plan = plan
        self.rooms: tuple[Room, ...] = plan.rooms
        self._spaces: dict[float, Space] = {}

    def __deepcopy__(self, memo: dict[int, object]) -> "Home":
        """Return itself: a home has no state, so that branches of a run share it."""
        return self

    def space(self, radius: float) -> Space:
        """Return the space of bodies of `radius` [m], built when first asked for."""
        if radius not in self._spaces:
            self._spaces[radius] = Space(self.plan, radius)
        return self._spaces[radius]

    def way_out(self, space: Space, part: int) -> tuple[int, int]:
        """Return the lattice point where a body in a part of the space leaves the home.

        Raises:
            PlacementError: The space has no such part.
        """
        found = space.nearest(*self._door(space, part), part)
        if found is None:
            raise PlacementError(
                f"a body of radius {space.radius:g} m fits nowhere in {self.plan.name}"
            )
        return found

    def _door(self, space: Space, part: int) -> tuple[int, int]:
        """Return the plan's entrance, or the middle of the room that one likely leaves from."""
        at = self.plan.entrance
        if at is None:
            rooms = [room for kind in WAYS_OUT for room in self.rooms if room.type == kind]
            rooms += sorted(self.rooms, key=lambda room: -room.cells)
            reachable = (room for room in rooms if len(space.cells(room.index, part)))
            at = next(reachable, self.rooms[0]).anchor_xy
        x, y = self.plan.lattice.to_lattice(at).tolist()
        return x, y
