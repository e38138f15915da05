"""Nights in which clocks change, in forty time zones, as the standard library knows them."""

from datetime import UTC, datetime, timedelta
from functools import cache
from typing import NamedTuple
from zoneinfo import ZoneInfo

MINUTE = timedelta(minutes=1)
DAY = timedelta(days=1)

# With a change at each hour of the night and at midnight, of half an hour and of two hours, with
# minutes in the offset, and from 23:01; and with no change at all.
ZONES = (
    *("Africa/Cairo", "Africa/Casablanca", "Africa/Johannesburg", "America/Adak"),
    *("America/Anchorage", "America/Asuncion", "America/Bogota", "America/Chicago"),
    *("America/Denver", "America/Halifax", "America/Havana", "America/Los_Angeles"),
    *("America/Miquelon", "America/New_York", "America/Nuuk", "America/Santiago"),
    *("America/Sao_Paulo", "America/St_Johns", "Antarctica/Troll", "Asia/Amman"),
    *("Asia/Beirut", "Asia/Gaza", "Asia/Jerusalem", "Asia/Kathmandu", "Asia/Kolkata"),
    *("Asia/Tehran", "Asia/Tokyo", "Atlantic/Azores", "Australia/Adelaide"),
    *("Australia/Lord_Howe", "Australia/Sydney", "Etc/GMT+12", "Europe/Berlin", "Europe/Dublin"),
    *("Europe/Lisbon", "Pacific/Apia", "Pacific/Auckland", "Pacific/Chatham"),
    *("Pacific/Kiritimati", "UTC"),
)


class Night(NamedTuple):
    """A time zone, and a moment to begin at, in UTC, half a day before its clock changes."""

    zone: str
    begin: datetime

    def reading(self, minute: int) -> datetime:
        """Return the local time of a minute, by the standard library; with offset and fold."""
        return (self.begin + minute * MINUTE).astimezone(ZoneInfo(self.zone))


@cache
def nights(zone: str, year: int = 2025) -> list[Night]:
    """Return the nights of a year in which a clock changes; without one, that of New Year."""
    begin = datetime(year, 1, 1, tzinfo=UTC)
    hours = [begin + timedelta(hours=h) for h in range(366 * 24)]
    offsets = [hour.astimezone(ZoneInfo(zone)).utcoffset() for hour in hours]
    changes = [i for i in range(1, len(hours)) if offsets[i] != offsets[i - 1]]
    middles = [hours[i] for i in changes] or [datetime(year + 1, 1, 1, tzinfo=UTC)]
    return [Night(zone, middle - DAY / 2) for middle in middles]


# A year in which a zone's rules changed, with the change that is told of it.
CHANGED_RULES = (
    ("America/St_Johns", 2010),  # from 00:01 to 23:01 of the day before
    ("Pacific/Apia", 2011),  # without the thirtieth of December
    ("Asia/Pyongyang", 2015),  # by half an hour, for good
    ("Europe/Istanbul", 2016),  # summer time for good
    ("America/Caracas", 2007),  # by half an hour, at 03:00
)
