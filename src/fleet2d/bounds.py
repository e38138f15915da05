"""Bounds on what is read from files, so that no file can exhaust a machine's memory or time.

Each is far beyond what real homes, logs and scenarios need. The message that refuses a file names
the environment variable that raises the bound.
"""

import os
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fleet2d.errors import Fleet2DError, InputError
from fleet2d.inputs import input_path, open_input


@dataclass(frozen=True)
class Bound:
    """An upper bound on something in a file.

    Attributes:
        name: The name of the environment variable that raises the bound, without `FLEET2D_MAX_`.
        default: The bound without that variable.
        noun: The counted things, for messages.

    Example:
        >>> Bound("DEPTH", 64, "lists in lists").check(100, "home.yaml")
        Traceback (most recent call last):
        fleet2d.errors.InputError: home.yaml has 100 lists in lists, and at most 64 are read; to \
read more, set FLEET2D_MAX_DEPTH=100 in the environment
    """

    name: str
    default: int
    noun: str

    @property
    def variable(self) -> str:
        """The name of the environment variable that raises the bound."""
        return f"FLEET2D_MAX_{self.name}"

    @property
    def limit(self) -> int:
        """The present bound.

        Raises:
            InputError: The variable is not a whole number above 0.
        """
        text = os.environ.get(self.variable, "")
        if not text:
            return self.default
        if not (text.isascii() and text.isdigit() and len(text) < 19 and int(text) > 0):
            raise InputError(f"{self.variable}: expected a whole number above 0, got {text[:40]!r}")
        return int(text)

    def check(
        self,
        amount: int,
        subject: object,
        error: type[Fleet2DError] = InputError,
        *,
        prefix: str = "",
    ) -> None:
        """Refuse an amount beyond the bound.

        Args:
            amount: The amount.
            subject: The file or object that has it, for the message.
            error: The type of the error.
            prefix: Text before an amount that was not counted to its end, such as "more than ".

        Raises:
            Fleet2DError: The amount is beyond the bound; an error of the type `error`.
        """
        if amount > self.limit:
            enough = amount * (2 if prefix else 1)
            raise error(
                f"{subject} has {prefix}{amount} {self.noun}, and at most {self.limit} are read; to"
                f" read more, set {self.variable}={enough} in the environment"
            )


FILE_BYTES = Bound("FILE_BYTES", 64 << 20, "bytes")
"""Size of a YAML, JSON or GeoJSON file."""
PICTURE_BYTES = Bound("PICTURE_BYTES", 256 << 20, "bytes")
"""Size of a picture of a floor plan."""
LOG_BYTES = Bound("LOG_BYTES", 1 << 30, "bytes")
"""Size of a log."""
DEPTH = Bound("DEPTH", 64, "lists in lists")
"""Depth of YAML."""
YAML_VALUES = Bound("VALUES", 200_000, "values")
"""Values in a YAML text, or in a scenario and all that it extends; those of an anchor count again
for each alias."""
EXTENDED_FILES = Bound("EXTENDED_FILES", 100, "files")
"""Files of a scenario, or of a persona: its own and those that they extend."""
ENTRIES = Bound("ENTRIES", 2_500, "entries")
"""Entries of a section of a scenario, such as its users."""
MEMBERS = Bound("MEMBERS", 100, "members")
"""Members of a household, each of whom depends on all others."""
PERSONA_VALUES = Bound("PERSONA_VALUES", 500_000, "values in the personas of its users")
"""Values of personas that are read from files or extend others. They count for each user: for a
member of a household, with its file and those of all its members. A long text counts for each 64
characters."""
ITEMS = Bound("ITEMS", 20_000, "entries")
"""Entries of a list of mappings or texts, such as a script."""
JSON_VALUES = Bound("JSON_VALUES", 3_000_000, "values")
"""Values in a JSON text."""
PIXELS = Bound("PIXELS", 1 << 24, "pixels")
"""Pixels of a picture of a floor plan."""
POLYGONS = Bound("POLYGONS", 5_000, "polygons and lines")
"""Polygons of a floor plan: rooms, furniture, features, doorways."""
ROOMS = Bound("ROOMS", 500, "rooms")
"""Rooms that the file of a floor plan names, each of which takes time of its own."""
CORNERS = Bound("CORNERS", 25_000, "corners")
"""Corners of the free space and the furniture of a floor plan, or of all polygons of a drawing."""
ROOM_CORNERS = Bound("ROOM_CORNERS", 100_000, "corners of rooms")
"""Corners of the rooms of a floor plan, which in a map are the corners of pixels on both sides."""
CROSSINGS = Bound("CROSSINGS", 10_000, "places where it crosses itself")
"""Crossings of the outline of one room, wall or home with itself, which are repaired; and parts of
the free space that meet."""
LOG_ROWS = Bound("LOG_ROWS", 5_000_000, "rows")
"""Rows of a log of rooms, activities or detections."""
FIXES = Bound("FIXES", 20_000_000, "fixes")
"""Rows of a log of positions."""
LOG_DAYS = Bound("LOG_DAYS", 3_660, "days from its first to its last row")
"""Days from the first to the last row of a log: ten years."""
LEARNED_BYTES = Bound("LEARNED_BYTES", 256 << 20, "bytes when unpacked")
"""Size of what an algorithm has learned, unpacked."""
WEIGHTS_BYTES = Bound("WEIGHTS_BYTES", 1 << 20, "bytes when unpacked")
"""Size of the weights of a network, unpacked."""
TABLE_BYTES = Bound("TABLE_BYTES", 2 << 30, "bytes when unpacked")
"""Size of a table, unpacked, that is read at once."""
READ_SECONDS = Bound("READ_SECONDS", 6, "seconds")
"""Processor time to read a floor plan in the child process."""
BAG_SECONDS = Bound("BAG_SECONDS", 60, "seconds")
"""Processor time to read a log in a bag in the child process."""
READ_MB = Bound("READ_MB", 800, "MB")
"""Memory to read a floor plan or a bag in the child process."""
VARIANTS = Bound("VARIANTS", 1_000_000, "values")
"""Values of one axis of a study, and replicates."""

BOUNDS = tuple(bound for bound in list(globals().values()) if isinstance(bound, Bound))
"""All bounds."""


def read_bytes(path: Path, bound: Bound, error: type[Fleet2DError] = InputError) -> bytes:
    """Return the content of a regular file of a bounded size.

    Raises:
        OSError: The file can't be read.
        Fleet2DError: It is larger than the bound, or `open_input` refuses it; of the type `error`.
    """
    check_file(path, bound, error)
    with open_input(path, error) as file:
        content = file.read(bound.limit + 1)
    bound.check(len(content), path, error)  # the file may have grown in the meantime
    return content


def check_file(path: Path, bound: Bound, error: type[Fleet2DError] = InputError) -> None:
    """Refuse a file that is larger than a bound or that `input_path` refuses.

    Raises:
        OSError: There is no such file.
        Fleet2DError: The file is refused; of the type `error`.
    """
    bound.check(input_path(path, error).stat().st_size, path, error)


def unpacked_bytes(file: Any, group: int | None = None) -> int:
    """Estimate the bytes that a Parquet file, or one of its row groups, takes in memory.

    The file states its unpacked size, but an encoded value may stand for many rows; so it is at
    least the size of the rows.

    Args:
        file: A `pyarrow.parquet.ParquetFile`.
        group: Number of the row group; None for all.
    """
    groups = range(file.num_row_groups) if group is None else (group,)
    metadata = [file.metadata.row_group(number) for number in groups]
    stated = sum(int(row_group.total_byte_size) for row_group in metadata)
    row_bytes = sum(_width_of(kind) for kind in file.schema_arrow.types)
    return max(stated, sum(int(row_group.num_rows) for row_group in metadata) * row_bytes)


def _width_of(kind: Any) -> int:
    """Return the minimum number of bytes of a value of an Arrow type."""
    try:
        return max(1, int(kind.bit_width) // 8)
    except ValueError:  # a text or a list takes at least its offset
        return 4


def unique_keys(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return the JSON object of some keys and values, as an `object_pairs_hook` of `json`.

    Raises:
        ValueError: A key is there twice: `json` would keep the second value and drop the first.
    """
    result = dict(pairs)
    if len(result) < len(pairs):
        [(repeated_key, _)] = Counter(key for key, _ in pairs).most_common(1)
        raise ValueError(f"the key {one_line(repeated_key)!r} is given twice in an object")
    return result


def one_line(value: object, most: int = 60) -> str:
    r"""Return text from a file for a message: on one line, and shortened if it is long.

    Example:
        >>> one_line("a\nb"), one_line("x" * 100, 12)
        ('a b', 'xxxxxxxxx...')
    """
    text = value if isinstance(value, str) else str(value)
    text = " ".join(text[: 4 * most].split())
    return text if len(text) <= most else f"{text[: most - 3]}..."
