"""The core of a home, which is its living spaces, and the block with its garage."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from fleet2d.floorplan.synthetic.draws import Choices
from fleet2d.floorplan.synthetic.geometry import Box
from fleet2d.floorplan.synthetic.grouping import Groups
from fleet2d.floorplan.synthetic.program import Brief
from fleet2d.floorplan.synthetic.slicing import Cut, Leaf, Tree, choose_squarest, tree_area


def core_trees(groups: Groups, briefs: Sequence[Brief], choices: Choices) -> list[Tree]:
    """Draw trees of living room, dining room and kitchen; wings join them at high x or high y."""
    room_of = {brief.kind: i for i, brief in enumerate(briefs)}
    living = Leaf(room_of["living_room"])
    trees: list[Tree] = []
    for across in (True, False):
        kitchen = _kitchen(room_of["kitchen"], groups.pantry, across, choices)
        if "dining_room" in room_of:
            trees += _with_dining(living, Leaf(room_of["dining_room"]), kitchen, across)
            continue
        trees += [Cut(across, (kitchen, living)), Cut(across, (living, kitchen))]
        share = choices.between(45, 65)
        low, high = Leaf(living.room, share), Leaf(living.room, 100 - share)
        trees.append(Cut(across, (low, Cut(not across, (kitchen, high)))))
    return choices.shuffled(trees)[: max(5, len(trees) * 5 // 6)]


def _with_dining(living: Leaf, dining: Leaf, kitchen: Tree, across: bool) -> list[Tree]:
    sides = (Cut(not across, (dining, kitchen)), Cut(not across, (kitchen, dining)))
    return [
        *(Cut(across, (side, living)) for side in sides),
        *(Cut(across, (living, side)) for side in sides),
        Cut(across, (kitchen, dining, living)),
        Cut(across, (living, dining, kitchen)),
    ]


def _kitchen(kitchen: int, pantry: Sequence[int], across: bool, choices: Choices) -> Tree:
    """Return the kitchen, with small rooms at one end of it."""
    if not pantry:
        return Leaf(kitchen)
    side: Tree = Leaf(pantry[0])
    if len(pantry) > 1:
        side = Cut(across, tuple(Leaf(room) for room in pantry))
    pair = (side, Leaf(kitchen))
    return Cut(not across, pair if choices.chance(50) else pair[::-1])


@dataclass(frozen=True)
class Service:
    """A block of garage and what is beside it.

    Attributes:
        trees: Ways to divide it.
        width: Its width, where the core is high enough [units].
        whole: Whether it is as high as the core in any case.
        at_high: Whether it is flush with the core's high side, else with its low one.
        out: How far it stands out there [units].
    """

    trees: list[Tree]
    width: int
    whole: bool
    at_high: bool
    out: int

    def boxes(self, areas: Mapping[int, float], right: int, low: int, high: int) -> list[Box]:
        """Return its rooms left of a core between two heights [units]."""
        area = tree_area(self.trees[0], areas)
        height = min(int(area / self.width + 0.5), high - low)
        if self.whole or height > high - low - 20:
            height = high - low
        if not self.whole:
            low, high = (low, high + self.out) if self.at_high else (low - self.out, high)
        low, high = (high - height, high) if self.at_high else (low, low + height)
        width = int(area / height + 0.5)
        return choose_squarest(self.trees, areas, (right - width, low, right, high))


def service_block(groups: Groups, outline: str | None, choices: Choices) -> Service | None:
    """Draw a block of garage and what is beside it."""
    if not groups.service:
        return None
    garage, *others = (Leaf(room) for room in groups.service)
    trees: list[Tree] = []
    for across in (True, False):
        rest: Tree = others[0] if len(others) == 1 else Cut(not across, tuple(others))
        if not others:
            trees = [garage]
        else:
            trees += [Cut(across, (garage, rest)), Cut(across, (rest, garage))]
    return Service(
        choices.shuffled(trees),
        choices.between(72, 130),
        outline is not None,
        choices.chance(50),
        choices.pick((0, 0, 20, 40)),
    )
