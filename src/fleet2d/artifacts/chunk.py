"""Chunks of a table: consecutive rows in the one form that is both hashed and stored."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fleet2d.artifacts.table import DTYPES, Column, TableSpec
from fleet2d.errors import ArtifactError
from fleet2d.kernels import I64, Bool


class ColumnChunk(NamedTuple):
    """Consecutive values of one column, in the one form that is both hashed and stored.

    Attributes:
        values: Numbers or category codes, (n,), 0 where missing; for strings their UTF-8 bytes.
        valid: Which values are not missing, (n,) bool; None if the column isn't nullable.
        lengths: Bytes of each string, (n,) int64; None for every other kind.
    """

    values: NDArray[Any]
    valid: Bool | None = None
    lengths: I64 | None = None


Chunk = dict[str, ColumnChunk]


class Dictionary(dict[str | None, int]):
    """A growing dictionary: looking up a new word gives it the next code.

    Example:
        >>> words = Dictionary()
        >>> words["on"], words["off"], words["on"], words.in_order()
        (0, 1, 0, ['on', 'off'])
    """

    def __missing__(self, word: str | None) -> int:
        """Enter a new word."""
        if not isinstance(word, str):
            raise ArtifactError(f"expected text, got {word!r}")
        self[word] = code = len(self) - (None in self)
        return code

    def enter(self, words: Iterable[str]) -> None:
        """Enter words in the order of their codes."""
        for word in words:
            self[word]  # looking a new word up enters it

    def in_order(self) -> list[str]:
        """Return all words in the order of their codes."""
        return [word for word in self if word is not None]


def new_dictionaries(spec: TableSpec) -> dict[str, Dictionary]:
    """Return an empty dictionary for each column of a table whose dictionary grows."""
    return {column.name: Dictionary() for column in spec.columns if column.is_growing}


def empty_chunk(column: Column) -> ColumnChunk:
    """Return no values of a column."""
    valid = np.empty(0, np.bool_) if column.nullable else None
    if column.kind == "string":
        return ColumnChunk(np.empty(0, np.uint8), valid, np.empty(0, np.int64))
    return ColumnChunk(np.empty(0, DTYPES[column.kind]), valid)


def encode_strings(strings: Sequence[str | None], nullable: bool) -> ColumnChunk:
    """Turn strings into their UTF-8 bytes and the length of each."""
    encoded = [string.encode() if string else b"" for string in strings]
    lengths = np.fromiter(map(len, encoded), np.int64, len(encoded))
    values = np.frombuffer(b"".join(encoded), np.uint8)
    return ColumnChunk(values, _valid(strings) if nullable else None, lengths)


def encode_words(strings: Sequence[str | None], words: Dictionary, nullable: bool) -> ColumnChunk:
    """Turn strings into codes, entering new ones into `words`."""
    if nullable:
        words[None] = 0  # a missing value is stored as code 0 and marked by `valid`
    codes = np.fromiter(map(words.__getitem__, strings), np.int32, len(strings))
    return ColumnChunk(codes, _valid(strings) if nullable else None)


def _valid(strings: Sequence[str | None]) -> Bool:
    return np.fromiter((string is not None for string in strings), np.bool_, len(strings))
