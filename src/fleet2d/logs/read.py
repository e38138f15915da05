"""Reading a log of any layout, which is recognized by its content."""

from collections.abc import Mapping
from itertools import islice
from pathlib import Path
from typing import Literal

from fleet2d.logs.casas import LINE as CASAS_LINE
from fleet2d.logs.casas import read_casas
from fleet2d.logs.homer import AGENDA, read_homer
from fleet2d.logs.log import ActivityLog, LogError, PositionLog, log_lines
from fleet2d.logs.uci_adl import HEAD, read_uci_adl
from fleet2d.logs.uci_adl import LINE as UCI_LINE

Layout = Literal["auto", "casas", "uci_adl", "homer", "positions"]
FIRST_LINES = 20


def read_log(
    path: str | Path,
    layout: Layout = "auto",
    *,
    id: str | None = None,  # noqa: A002 - the name of the column
    columns: Mapping[str, str] | None = None,
    time_zone: str | None = None,
    sort: bool = False,
) -> ActivityLog | PositionLog:
    """Read a log: a smart home's events, an activity script, or position fixes.

    Args:
        path: The file; or the folder, for a home that has several (uci_adl, homer).
        layout: The layout; "auto" recognizes it by its content.
        id: The tag to read, of positions; see `read_positions`.
        columns: The names of the columns of positions; see `read_positions`.
        time_zone: The time zone of the home, for positions; see `read_positions`.
        sort: Sort lines whose time runs backwards instead of refusing them.

    Raises:
        LogError: It is of no known layout, damaged, or contradicts itself.
    """
    path = Path(path)
    if not path.exists():
        raise LogError(f"no such file: {path}")
    layout = _recognize(path) if layout == "auto" else layout
    if layout == "positions":
        # Imported here, as no other layout needs pyarrow.
        from fleet2d.logs.positions import read_positions

        return read_positions(path, id=id, columns=columns, time_zone=time_zone, sort=sort)
    if id is not None or columns or time_zone is not None:
        raise LogError(
            f"{path} is of the layout {layout}: id, columns and time_zone are for positions"
        )
    if layout == "casas":
        return read_casas(path, sort=sort)
    return read_uci_adl(path, sort=sort) if layout == "uci_adl" else read_homer(path, sort=sort)


def _recognize(path: Path) -> Layout:
    """Return the layout of a file or folder.

    Raises:
        LogError: It is of no known layout.
    """
    if path.is_dir():
        files = sorted(path.glob("*.txt"))
        if any(file.name.endswith(("_ADLs.txt", "_Sensors.txt")) for file in files):
            return "uci_adl"
        if files and _recognize(files[0]) == "homer":
            return "homer"
        raise LogError(
            f"{path}: a folder holds the files of one home, as …_Sensors.txt and …_ADLs.txt, or the"
            " days of a HOMER+ household; for other layouts name the file"
        )
    if path.suffix.lower() in (".parquet", ".pq"):
        return "positions"
    for _, line in islice(log_lines(path), FIRST_LINES):
        if AGENDA.fullmatch(line):
            return "homer"
        if UCI_LINE.fullmatch(line) or HEAD.fullmatch(line):
            return "uci_adl"
        if CASAS_LINE.fullmatch(line):
            return "casas"
    if path.suffix.lower() == ".csv":
        return "positions"
    raise LogError(
        f"{path} has no known layout: give 'format' (casas, uci_adl, homer or positions)"
    )
