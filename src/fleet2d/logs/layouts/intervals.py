"""What layouts with sensors and activities share: labelling one by the other."""

from bisect import bisect_right
from collections.abc import Sequence

from fleet2d.logs.log import AWAY, Reading

LEAVING = frozenset(
    {"leaving", "leave_home", "leave-house", "leave_house", "away", "out", "going_out"}
)
"""Activities during which somebody is out of the home."""


def is_leaving(activity: str) -> bool:
    """Return whether an activity means to be out of the home.

    Example:
        >>> is_leaving("Leave-house"), is_leaving("Going out"), is_leaving("Cooking")
        (True, True, False)
    """
    return activity.strip().lower().replace(" ", "_") in LEAVING


def label_by_activities(sensors: Sequence[Reading], activities: Sequence[Reading]) -> list[Reading]:
    """Label readings of sensors by the concurrent activity, and add readings for absences."""
    begins = [activity.begin_us for activity in activities]
    readings = [reading for reading in activities if reading.room == AWAY]
    for sensor in sensors:
        number = bisect_right(begins, sensor.begin_us) - 1
        is_part = number >= 0 and sensor.begin_us <= activities[number].end_us
        readings.append(sensor._replace(activity=activities[number].activity if is_part else ""))
    # Of readings with the same begin, being out comes last, so that it holds.
    return sorted(readings, key=lambda reading: (reading.begin_us, reading.room == AWAY))
