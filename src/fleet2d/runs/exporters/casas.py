"""The readings of a run's sensors as a text file in the layout of the CASAS smart homes."""

from pathlib import Path

from fleet2d.errors import RunDirectoryError
from fleet2d.runs.exporters import Records, Selection, new_file
from fleet2d.runs.run import Run

# The activity that CASAS writes where none is known.
OTHER = "Other_Activity"


def export(run: Run, path: Path, part: Selection) -> str:
    """Write a line per reading: date, time, room, sensor, state, activity.

    Spaces in names become underscores, because spaces separate the columns.

    Args:
        run: A run whose scenario has sensors.
        path: The file to write.
        part: The part of the run.

    Returns:
        A line with the number of readings.

    Raises:
        RunDirectoryError: The run has no sensors, or the file can't be written.
    """
    if "sensors" not in run.tables:
        raise RunDirectoryError(
            "the run has no table of sensors: add objects that sense to its scenario, such as"
            " hall: {type: motion_sensor, at: [1, 2]}"
        )
    records = Records(run, part).chunks(poses=False, tables=["sensors"])
    rows = [row for chunk in records for row in chunk.rows["sensors"]]
    lines = [
        f"{row['time']:%Y-%m-%d %H:%M:%S.%f} {_word(row['room'])} {_word(row['sensor'])}"
        f" {row['state']} {_word(row['activity']) or OTHER}\n"
        for row in rows
    ]
    with new_file(path) as file:
        file.write("".join(lines).encode())
    return f"{len(lines)} readings in {path}"


def _word(name: str) -> str:
    return "_".join(name.split())
