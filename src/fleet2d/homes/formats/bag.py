"""Maps in ROS bags: the last OccupancyGrid of a topic."""

import math
from collections import deque
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from fleet2d.bounds import PIXELS
from fleet2d.configuration.problems import suggest
from fleet2d.configuration.units import InputFileOrFolder
from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.files import MAX_COORDINATE_M
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.homes.formats.cleaning import OccupancyMap, turn_by
from fleet2d.homes.formats.occupancy import OccupancySource
from fleet2d.storage.apart import apart
from fleet2d.storage.bags import check_bag, headings_of, numbers_of, open_bag

GRID = "nav_msgs/msg/OccupancyGrid"
# Chances of being occupied, in percent, as map_server divides them.
FREE_BELOW = 20
OCCUPIED_ABOVE = 65


class BagMap(OccupancySource):
    """The map in a bag of ROS 1 or ROS 2: the last OccupancyGrid, as a SLAM robot publishes it.

    Cells of less than 20 % are free, of more than 65 % wall; those between, and unknown ones, are
    neither. The floor plan has the frame of the map.

    Attributes:
        path: The bag: a file, or the folder of a ROS 2 bag.
        topic: The topic of the map, if the bag has several maps and none on `/map`.
    """

    suffixes = (".bag", ".mcap", ".db3")

    path: InputFileOrFolder
    topic: str | None = None

    @classmethod
    def usual_cell(cls, settings: Mapping[str, Any]) -> float:
        """Return the map's resolution."""
        path = Path(settings["path"])
        topic = settings.get("topic")
        check_bag(path, FloorPlanError)
        return apart(path, _pixel, path, topic, settings["scale"])

    def files(self) -> list[Path]:
        """Return the files of the bag."""
        if not self.path.is_dir():
            return [self.path]
        return sorted(file for file in self.path.iterdir() if file.is_file())

    def contents(self) -> dict[Path, bytes]:
        """Return nothing: the child opens the bag, which is too large to be read as a whole."""
        check_bag(self.path, FloorPlanError)
        return {}

    def read(self, _: Mapping[Path, bytes]) -> FloorPlan:
        """Read the map.

        Raises:
            FloorPlanError: The bag can't be read, or has no map, or the map has no home.
        """
        raw, note = _read(self.path, self.topic, self.scale or 1.0)
        notes: list[str] = []
        home = self.clean(raw, notes)
        return self.build(home, raw.pixel, f"map of a bag, {self.path.name}", [*notes, note])


def _pixel(path: Path, topic: str | None, scale: float) -> float:
    return _read(path, topic, scale)[0].pixel


def _read(path: Path, topic: str | None, scale: float) -> tuple[OccupancyMap, str]:
    """Return the last map of a topic, and a note about it.

    Raises:
        FloorPlanError: The bag can't be read, or has no such map; or its map is damaged.
    """
    with open_bag(path, FloorPlanError) as reader:
        topics = {c.topic: c for c in reader.connections if c.msgtype == GRID and c.msgcount}
        usual = ["/map"] if "/map" in topics else list(topics)
        if topic is None and len(usual) == 1:
            topic = usual[0]
        if topic is None or topic not in topics:
            if not topics:
                names = ", ".join(sorted({c.topic for c in reader.connections})[:20])
                raise FloorPlanError(f"{path} has no map, no {GRID} among {names}")
            which = f"no map {topic!r}{suggest(topic, topics)}" if topic else "several maps"
            raise FloorPlanError(f"{path} has {which}: select one by 'topic': {', '.join(topics)}")
        connection = topics[topic]
        (_, _, data), *_ = deque(reader.messages([connection]), maxlen=1)
        message = reader.deserialize(data, connection.msgtype)
    info = message.info
    rows = int(info.height)
    columns = int(info.width)
    side = float(np.float32(info.resolution)) * scale
    cells = np.asarray(message.data, np.int8)
    if len(cells) != rows * columns or not rows * columns or not 0 < side <= 1:
        raise FloorPlanError(
            f"{path}: the map of {topic} is damaged: {len(cells)} cells for {columns} × {rows} of"
            f" {side:g} m"
        )
    PIXELS.check(rows * columns, f"{path}: the map of {topic}", FloorPlanError)
    corner = numbers_of(info.origin.position, info.origin.orientation)
    heading = float(np.nan_to_num(headings_of(np.array([corner[3:]])))[0])  # many leave it out
    x = corner[0] * scale
    y = corner[1] * scale
    if not max(abs(x), abs(y)) <= MAX_COORDINATE_M:
        raise FloorPlanError(
            f"{path}: the map of {topic} is damaged: its corner is at ({corner[0]:g},"
            f" {corner[1]:g}) m"
        )
    side = round(side, 6)
    percent = cells.reshape(rows, columns)
    free = (percent >= 0) & (percent < FREE_BELOW)
    return OccupancyMap(free, percent > OCCUPIED_ABOVE, side, (x, y), turn_by(heading)), (
        f"{topic}: the last of {connection.msgcount} maps, {columns} × {rows} cells of {side:g} m,"
        f" its corner at ({x:.2f}, {y:.2f}) m turned by {math.degrees(heading):.1f} degrees"
    )
