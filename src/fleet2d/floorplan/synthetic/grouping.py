"""Groups of rooms that stay together: a bedroom and its bathroom, small rooms in a row."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from fleet2d.floorplan.synthetic.draws import Choices
from fleet2d.floorplan.synthetic.program import Brief
from fleet2d.floorplan.synthetic.slicing import Slot

RoomGroup = list[Slot]
"""Slots that stay next to each other in this order."""


@dataclass
class Groups:
    """The rooms of a home, sorted by where they may go.

    Attributes:
        entry: The group with the entryway, or None; its first slot is the entryway.
        private: Groups for strips; the first is that of the main bedroom, which comes last in it.
        service: Rooms for a block of their own: garage, gym and what goes with them.
        pantry: Small rooms beside the kitchen.
        closet: A small room for the end of a corridor, or None.
    """

    entry: RoomGroup | None = None
    private: list[RoomGroup] = field(default_factory=list)
    service: list[int] = field(default_factory=list)
    pantry: list[int] = field(default_factory=list)
    closet: int | None = None


def group_rooms(briefs: Sequence[Brief], choices: Choices) -> Groups:
    """Group the rooms by where they may go."""
    by_kind = _by_kind(briefs)
    groups = Groups()
    if by_kind["garage"]:
        groups.service = by_kind["garage"] + by_kind["gym"]
    small = _small_rooms(by_kind, groups, choices)
    shared = [i for i in by_kind["bathroom"] if briefs[i].partner is None]
    fronts = choices.shuffled(shared + small)
    for bed in by_kind["bedroom"]:
        owned = [i for i, brief in enumerate(briefs) if brief.partner == bed]
        groups.private.append([*_beside(owned, fronts, briefs, choices), (bed,)])
    if by_kind["entryway"]:
        groups.entry = _entry_group(by_kind["entryway"][0], fronts, briefs, choices)
    for room in fronts:
        if briefs[room].kind == "bathroom":
            groups.private.append([(room,)])
        elif groups.closet is None and briefs[room].kind in ("storage", "toilet"):
            groups.closet = room
        else:
            groups.pantry.append(room)
    groups.private += [[(i,)] for i in by_kind["office"]]
    if not by_kind["garage"]:
        groups.private += [[(i,)] for i in by_kind["gym"]]
    return groups


def _by_kind(briefs: Sequence[Brief]) -> dict[str, list[int]]:
    kinds = ("garage", "gym", "laundry", "storage", "toilet", "bathroom", "bedroom", "office")
    return {
        kind: [i for i, brief in enumerate(briefs) if brief.kind == kind]
        for kind in (*kinds, "entryway")
    }


def _small_rooms(by_kind: dict[str, list[int]], groups: Groups, choices: Choices) -> list[int]:
    """Return the small rooms for strips; the others go to the service block or the kitchen."""
    strip_rooms = list(by_kind["toilet"])
    for room in by_kind["laundry"] + by_kind["storage"]:
        place = choices.weighted((("service", 60), ("pantry", 25), ("strip", 15)))
        if place == "service" and groups.service:
            groups.service.append(room)
        elif place == "strip" or groups.pantry:
            strip_rooms.append(room)
        else:
            groups.pantry.append(room)
    return strip_rooms


def _beside(
    owned: list[int], fronts: list[int], briefs: Sequence[Brief], choices: Choices
) -> list[Slot]:
    """Return the slots beside a bedroom: a room of its own at the back, a shared one before it."""
    if len(owned) >= 2:
        first, second = sorted(owned, key=lambda i: briefs[i].area)[:2]
        return [(first, second)]
    if not owned:
        return []
    if fronts and choices.chance(60):
        return [(fronts.pop(), owned[0])]
    return [(owned[0],)]


def _entry_group(
    entry: int, fronts: list[int], briefs: Sequence[Brief], choices: Choices
) -> list[Slot]:
    """Return the entryway, maybe with a toilet beside it and a coat room behind that."""
    toilets = [i for i in fronts if briefs[i].kind == "toilet"]
    closets = [i for i in fronts if briefs[i].kind == "storage"]
    if toilets and closets and choices.chance(75):
        fronts.remove(toilets[0])
        fronts.remove(closets[0])
        return [(entry,), (toilets[0], closets[0])]
    return [(entry,)]
