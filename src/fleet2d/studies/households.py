"""Households of lives: their people, personas, and the bedrooms that they need."""

import math
from collections.abc import Mapping
from typing import Any

from fleet2d.errors import InputError

NAMES = ("ana", "ben", "cleo", "dan", "eva", "finn", "gina", "hugo")
CHILD = "child"
"""The persona of those of whom two share a bedroom."""


def members_of(household: Any) -> dict[str, Any]:
    """Return the section `users` of a household: a list of personas, or users by name.

    Example:
        >>> members_of(["retired"])
        {'ana': {'type': 'routine', 'persona': 'retired'}}
    """
    if isinstance(household, Mapping):
        return dict(household)
    if len(household) > len(NAMES):
        raise InputError(
            f"a household of {len(household)} personas: name its users, as in {{ana: …}}, where"
            f" there are more than {len(NAMES)}"
        )
    pairs = zip(NAMES, household, strict=False)
    return {name: {"type": "routine", "persona": persona} for name, persona in pairs}


def personas_of(household: Any) -> list[str]:
    """Return a word for each member of a household: persona, log or type."""
    return [_persona_of(name, user) for name, user in members_of(household).items()]


def _persona_of(name: str, user: Any) -> str:
    if not isinstance(user, Mapping):
        return str(user)
    members = (user.get("household") or {}).get("members") or {}
    persona = user.get("persona") or members.get(name) or user.get("path") or user.get("type")
    extended = persona.get("extends") if isinstance(persona, Mapping) else None
    return str(extended or persona)


def bedrooms_needed(household: Any) -> int:
    """Return how many bedrooms a household needs: one per couple, other adult, and two children.

    >>> bedrooms_needed(["works_outside", "child", "child"])
    2
    """
    people = members_of(household)
    couples: set[frozenset[str]] = set()
    for user in people.values():
        if isinstance(user, Mapping):
            pairs = (user.get("household") or {}).get("couples") or ()
            couples |= {frozenset(pair) for pair in pairs if {*pair} <= people.keys()}
    children = personas_of(household).count(CHILD)
    return max(len(people) - children - len(couples) + math.ceil(children / 2), 1)
