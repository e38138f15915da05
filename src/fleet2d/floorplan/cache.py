"""Caches that the runs of one process share: homes are read and computed only once."""

from collections import OrderedDict
from collections.abc import Callable, Hashable
from threading import Lock
from typing import Any, TypeVar

from numpy.typing import NDArray

T = TypeVar("T")


class Cache:
    """The most recently used values by key, each made at its first use.

    Threads may share a cache: if two make the same value at a time, both get the first.

    Example:
        >>> cache = Cache(size=2)
        >>> [cache.get(key, lambda: [key]) for key in "aba"]
        [['a'], ['b'], ['a']]
        >>> cache.get("a", list) is cache.get("a", list), len(cache)
        (True, 2)
    """

    def __init__(self, size: int) -> None:
        """Make an empty cache that holds at most `size` values."""
        self._size = size
        self._values: OrderedDict[Hashable, Any] = OrderedDict()
        self._lock = Lock()

    def __len__(self) -> int:
        """Return the number of values."""
        return len(self._values)

    def get(self, key: Hashable, make: Callable[[], T]) -> T:
        """Return the value of a key; if `make` raises, nothing is stored."""
        with self._lock:
            if key in self._values:
                self._values.move_to_end(key)
                return self._values[key]
        new = make()
        with self._lock:
            value = self._values.setdefault(key, new)
            while len(self._values) > self._size:
                self._values.popitem(last=False)
        return value

    def grow(self, size: int) -> None:
        """Hold at least `size` values from now on."""
        self._size = max(self._size, size)

    def clear(self) -> None:
        """Drop all values."""
        with self._lock:
            self._values.clear()


A = TypeVar("A", bound=NDArray[Any])


def read_only(array: A) -> A:
    """Return the same array, made read-only, as is due where several runs share it."""
    array.setflags(write=False)
    return array
