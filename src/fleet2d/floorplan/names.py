"""Names of rooms and objects, each unique in its plan."""

from collections import Counter, defaultdict
from collections.abc import Sequence
from itertools import count
from typing import Protocol, TypeVar

from fleet2d.configuration.problems import suggest
from fleet2d.errors import FloorPlanError, InputError


class Named(Protocol):
    """Something with a name."""

    @property
    def name(self) -> str:
        """Its name."""


N = TypeVar("N", bound=Named)


def find_named(
    things: Sequence[N],
    name: object,
    owner: str,
    noun: str,
    error: type[InputError] = FloorPlanError,
) -> N:
    """Return the thing of a name; `owner` and `noun` are for the message.

    Raises:
        InputError: None has that name; of the type `error`.
    """
    names = [thing.name for thing in things]
    if name in names:
        return things[names.index(str(name))]
    raise error(f"{owner} has no {noun} {name!r}{suggest(name, names, f'Its {noun}s are')}")


def number_names(names: Sequence[str | None], types: Sequence[str], noun: str) -> list[str]:
    """Return a name for each thing: its own if it isn't empty, or its type and a number.

    Raises:
        FloorPlanError: Two have the same name.

    Example:
        >>> number_names(["den", None, "room_0"], ["office", "room", "room"], "room")
        ['den', 'room_1', 'room_0']
    """
    own = Counter(name for name in names if name)
    twice = [name for name, uses in own.items() if uses > 1]
    if twice:
        raise FloorPlanError(f"two {noun}s are named {twice[0]!r}: give each {noun} its own name")
    numbers: defaultdict[str, count[int]] = defaultdict(count)
    return [
        name or next(new for k in numbers[kind] if (new := f"{kind}_{k}") not in own)
        for name, kind in zip(names, types, strict=True)
    ]


def distinct_names(names: Sequence[str | None], plural: str, notes: list[str]) -> list[str | None]:
    """Return names with a number added to those that occur before, and add a note for each.

    Example:
        >>> distinct_names(["Bath", "Bath", None, "Bath 2"], "rooms", [])
        ['Bath', 'Bath 3', None, 'Bath 2']
    """
    numbers: defaultdict[str, count[int]] = defaultdict(lambda: count(2))
    used = set[str]()
    distinct: list[str | None] = []
    for name in names:
        unique = name
        if name is not None and name in used:
            candidates = (f"{name} {k}" for k in numbers[name])
            unique = next(new for new in candidates if new not in used and new not in names)
            notes.append(f"several {plural} are called {name}: one of them is {unique} here")
        used |= {unique} if unique is not None else set()
        distinct.append(unique)
    return distinct
