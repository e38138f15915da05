"""What runs of one process share: homes that are read and worked out once."""

from collections import OrderedDict
from collections.abc import Callable, Hashable
from threading import Lock
from typing import Any, TypeVar

from numpy.typing import NDArray

T = TypeVar("T")


class Kept:
    """Values by key, each made when first asked for; those asked for longest ago are dropped.

    Threads may share it: of two that make the same value at a time, both get the first.

    Example:
        >>> kept = Kept(most=2)
        >>> [kept.get(key, lambda: [key]) for key in "aba"]
        [['a'], ['b'], ['a']]
        >>> kept.get("a", list) is kept.get("a", list), len(kept)
        (True, 2)
    """

    def __init__(self, most: int) -> None:
        """Begin with nothing, and keep at most so many values."""
        self._most = most
        self._values: OrderedDict[Hashable, Any] = OrderedDict()
        self._lock = Lock()

    def __len__(self) -> int:
        """Return how many values are kept."""
        return len(self._values)

    def get(self, key: Hashable, make: Callable[[], T]) -> T:
        """Return the value of a key; `make` may raise, and nothing is kept then."""
        with self._lock:
            if key in self._values:
                self._values.move_to_end(key)
                value: T = self._values[key]
                return value
        made = make()
        with self._lock:
            value = self._values.setdefault(key, made)
            while len(self._values) > self._most:
                self._values.popitem(last=False)
        return value

    def keep(self, most: int) -> None:
        """Keep so many values from now on, if that is more than before."""
        self._most = max(self._most, most)

    def clear(self) -> None:
        """Drop everything."""
        with self._lock:
            self._values.clear()


A = TypeVar("A", bound=NDArray[Any])


def read_only(array: A) -> A:
    """Return an array that nobody can change any more: others have the same one."""
    array.setflags(write=False)
    return array
