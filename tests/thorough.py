"""How much tests try: a part by default, all of it with FLEET2D_THOROUGH=1, before a release."""

import os

THOROUGH = os.environ.get("FLEET2D_THOROUGH") == "1"


def examples(whole: int) -> int:
    """Return how many of `whole` examples a property test tries: a third unless it is thorough."""
    return whole if THOROUGH else -(-whole // 3)
