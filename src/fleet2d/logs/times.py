"""Times of logs: local wall time, as microseconds since the midnight of a first day."""

import re
from datetime import date, datetime, timedelta
from pathlib import Path

from fleet2d.bounds import one_line
from fleet2d.logs.log import LogError

_TIME = re.compile(r"(\d{4})-(\d{1,2})-(\d{1,2})[ T](\d{1,2}):(\d{2})(?::(\d{2})(?:\.(\d{1,9}))?)?")
MICROSECOND = timedelta(microseconds=1)


def parse_time(text: str, path: Path, line: int) -> datetime:
    """Read a local time like '2011-06-15 01:03:39.14962', exact to the microsecond.

    Raises:
        LogError: The text is not a time, or there is no such day or hour.

    Example:
        >>> parse_time("2011-06-15 01:03:39.14962", Path("log"), 1).isoformat()
        '2011-06-15T01:03:39.149620'
    """
    match = _TIME.fullmatch(text.strip())
    if match is None:
        raise LogError(
            f"{path}, line {line}: expected a time like '2011-06-15 01:03:39', got"
            f" {one_line(text)!r}"
        )
    year, month, day, hour, minute = (int(match[i]) for i in range(1, 6))
    micros = int((match[7] or "").ljust(6, "0")[:6])
    try:
        return datetime(year, month, day, hour, minute, int(match[6] or 0), micros)
    except ValueError as error:
        raise LogError(f"{path}, line {line}: {one_line(text)!r} is not a time: {error}") from None


def since(first_day: date, moment: datetime) -> int:
    """Return the microseconds from the midnight that begins a day to a moment."""
    return (moment - datetime.combine(first_day, datetime.min.time())) // MICROSECOND
