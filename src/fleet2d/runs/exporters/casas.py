"""The readings of a run's sensors as a text file in the layout of the CASAS smart homes."""

from pathlib import Path

from fleet2d.errors import RunDirectoryError
from fleet2d.runs.run import Run

# The activity that CASAS writes where none is known.
OTHER = "Other_Activity"


def export(run: Run, path: Path) -> str:
    """Write a line per reading: date, time, room, sensor, state, activity.

    Spaces in names become underscores, because spaces separate the columns.

    Args:
        run: A run whose scenario has sensors.
        path: The file to write.

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
    rows = run.tables["sensors"].to_pylist()
    lines = [
        f"{row['time']:%Y-%m-%d %H:%M:%S.%f} {_word(row['room'])} {_word(row['sensor'])}"
        f" {row['state']} {_word(row['activity']) or OTHER}\n"
        for row in rows
    ]
    try:
        path.write_text("".join(lines), encoding="utf-8")
    except OSError as error:
        raise RunDirectoryError(f"{path} can't be written: {error.strerror}") from error
    return f"{len(lines)} readings in {path}"


def _word(name: str) -> str:
    return "_".join(name.split())
