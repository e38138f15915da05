"""What layouts with sensors and activities share: labelling one by the other."""

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
    """Label readings of sensors by the concurrent activity, and add readings for absences.

    Of several it is the one that began last: whoever gets up at night sleeps on afterwards.

    Args:
        sensors: The readings, in any order.
        activities: The activities, in order of their beginnings.
    """
    readings = [reading for reading in activities if reading.room == AWAY]
    begun: list[Reading] = []
    coming = iter(activities)
    following = next(coming, None)
    for sensor in sorted(sensors, key=lambda reading: reading.begin_us):
        while following is not None and following.begin_us <= sensor.begin_us:
            begun.append(following)
            following = next(coming, None)
        while begun and begun[-1].end_us < sensor.begin_us:
            begun.pop()
        readings.append(sensor._replace(activity=begun[-1].activity if begun else ""))
    # Of readings with the same begin, being out comes last, so that it holds.
    return sorted(readings, key=lambda reading: (reading.begin_us, reading.room == AWAY))
