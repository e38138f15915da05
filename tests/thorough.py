"""How much tests try: a part by default, all of it with FLEET2D_THOROUGH=1, before a release."""

import os
from collections.abc import Sequence
from typing import TypeVar

Case = TypeVar("Case")

THOROUGH = os.environ.get("FLEET2D_THOROUGH") == "1"


def some(cases: Sequence[Case], step: int) -> Sequence[Case]:
    """Return every `step`-th of alike cases; all of them if it is thorough."""
    return cases if THOROUGH else cases[::step]


def examples(whole: int) -> int:
    """Return how many of `whole` examples a property test tries: a fifth unless it is thorough."""
    return whole if THOROUGH else -(-whole // 5)
