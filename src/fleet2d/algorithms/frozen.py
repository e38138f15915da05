"""Read-only views: components share the same arrays, so none of them may change one."""

from typing import Any, TypeVar

import numpy as np

T = TypeVar("T")


def frozen(value: T) -> T:
    """Return a value with read-only views in place of its arrays, in tuples of any depth.

    Example:
        >>> counts = np.zeros(3)
        >>> frozen((counts, "x"))[0].flags.writeable, counts.flags.writeable
        (False, True)
    """
    return _frozen(value)


def _frozen(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        view = value.view()
        view.setflags(write=False)
        return view
    if isinstance(value, tuple):
        parts = map(_frozen, value)
        return type(value)(*parts) if hasattr(value, "_fields") else tuple(parts)
    return value
