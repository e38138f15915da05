"""Sequences whose items are made when they are needed."""

from abc import abstractmethod
from collections.abc import Sequence
from typing import Any, TypeVar, overload

Item = TypeVar("Item", covariant=True)


class LazySequence(Sequence[Item]):
    """Base of sequences that keep only the item asked for last; a slice is a list of items."""

    @abstractmethod
    def item(self, index: int) -> Item:
        """Make the item at an index."""

    @overload
    def __getitem__(self, index: int) -> Item: ...
    @overload
    def __getitem__(self, index: slice) -> list[Item]: ...
    def __getitem__(self, index: int | slice) -> Item | list[Item]:
        """Return an item, or the items of a slice."""
        if isinstance(index, slice):
            return [self.item(i) for i in range(*index.indices(len(self)))]
        last, item = self.__dict__.get("_last", (None, None))
        if last != index:
            item = self.item(index)
            self.__dict__["_last"] = index, item  # subclasses may be frozen
        return item

    def __getstate__(self) -> dict[str, Any]:
        """Leave out the item that is kept."""
        return {name: value for name, value in self.__dict__.items() if name != "_last"}
