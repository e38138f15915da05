"""Maps of the ROS `map_server`: a YAML file, and an image that says what is free and occupied."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fleet2d.configuration.units import InputPath
from fleet2d.errors import FloorPlanError, InputError
from fleet2d.floorplan.files import (
    MAX_COORDINATE_M,
    in_file,
    parse_yaml,
    read_yaml,
    shown_value,
)
from fleet2d.floorplan.lattice import MAX_CELL_M
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.homes.formats.cleaning import OccupancyMap, turn_by
from fleet2d.homes.formats.occupancy import PictureSource
from fleet2d.homes.formats.raster import GreyPicture, grey_picture
from fleet2d.inputs import input_path
from fleet2d.kernels import Bool

_KEYS = {
    "image": "image: map.pgm",
    "resolution": "resolution: 0.05",
    "origin": "origin: [0.0, 0.0, 0.0]",
    "negate": "negate: 0",
    "occupied_thresh": "occupied_thresh: 0.65",
    "free_thresh": "free_thresh: 0.196",
}


class Ros(PictureSource):
    """A map of the ROS map_server.

    Attributes:
        path: The map's YAML file; it names the image.
    """

    path: InputPath

    @classmethod
    def usual_cell(cls, settings: Mapping[str, Any]) -> float:
        """Return the map's resolution."""
        return _settings(read_yaml(settings["path"]), settings["scale"]).resolution

    def files(self) -> list[Path]:
        """Return the YAML file and the image."""
        content = read_yaml(self.path)
        with in_file(self.path):
            settings = _settings(content, self.scale or 1.0)
            return [self.path, _image_file(settings.image, self.path)]

    def read(self, files: Mapping[Path, bytes]) -> FloorPlan:
        """Read the map.

        Raises:
            FloorPlanError: A file can't be read, isn't such a map, or has no free space.
        """
        content = parse_yaml(files[self.path], self.path)
        with in_file(self.path):
            settings = _settings(content, self.scale or 1.0)
            *_, (file, image) = files.items()
            notes = _note_image(settings.image, file, self.path)
            if is_nan(content["origin"][2]):
                notes.append("origin has no yaw, as older map_savers write it: 0 is taken")
            picture = grey_picture(image, file)
            free = self.home(self._occupancy(settings, picture, notes), picture, notes)
            return self.build(free, settings.resolution, f"ROS map, {self.path.name}", notes)

    def _occupancy(
        self, settings: "_MapSettings", picture: GreyPicture, notes: list[str]
    ) -> OccupancyMap:
        """Divide pixels into free, occupied and unknown ones as map_server does."""
        shades = np.arange(picture.white + 1) / picture.white
        chance = shades if settings.negate else 1 - shades
        if settings.raw:  # percent; values above 100 are unknown
            percent = np.rint(shades * 255)
            chance = np.where(percent <= 100, percent / 100, np.nan)
        occupied = _opaque(chance > settings.occupied_thresh, picture)
        free = _opaque(chance < settings.free_thresh, picture)
        if not (settings.negate or settings.raw):
            free = self.known(picture, free, settings.resolution, notes, saved=True)
        x, y, yaw = settings.origin
        return OccupancyMap(free[::-1], occupied[::-1], settings.resolution, (x, y), turn_by(yaw))


# --- The YAML file -----------------------------------------------------------------------------


@dataclass(frozen=True)
class _MapSettings:
    """The settings in the YAML file; lengths in metres, the angle in radians."""

    image: str
    resolution: float
    origin: tuple[float, float, float]
    negate: bool
    occupied_thresh: float
    free_thresh: float
    raw: bool


def _settings(content: dict[str, Any], scale: float) -> _MapSettings:
    for key, line in _KEYS.items():
        if key not in content:
            raise FloorPlanError(
                f"not a ROS map: the key {key!r} is missing; write it like `{line}`"
            )
    image = content["image"]
    if not isinstance(image, str) or not image:
        raise FloorPlanError(
            f"image is {shown_value(image)}: the name of a PGM or PNG file is expected"
        )
    resolution = _number(content["resolution"], "resolution") * scale
    if not 0 < resolution <= MAX_CELL_M:
        raise FloorPlanError(
            f"resolution is {resolution:g} m per pixel: above 0 and at most"
            f" {MAX_CELL_M:g} m is expected (0.05 is usual); floorplan.scale multiplies it"
        )
    free, occupied = (_threshold(content, key) for key in ("free_thresh", "occupied_thresh"))
    if free > occupied:
        raise FloorPlanError(
            f"free_thresh, {free:g}, is above occupied_thresh, {occupied:g}: they are the wrong way"
            " round"
        )
    mode = content.get("mode", "trinary")
    if mode not in ("trinary", "scale", "raw"):
        raise FloorPlanError(f"mode is {shown_value(mode)}: trinary, scale or raw is expected")
    negate = content["negate"]
    if negate not in (0, 1):
        raise FloorPlanError(f"negate is {shown_value(negate)}: 0 or 1 is expected")
    if negate and mode == "raw":
        raise FloorPlanError(
            "negate is 1 in mode raw, which ROS 1 and ROS 2 take differently: save the map with"
            " negate 0, or as trinary"
        )
    x, y, yaw = _origin(content["origin"])
    origin = (x * scale, y * scale, yaw)
    return _MapSettings(image, resolution, origin, bool(negate), occupied, free, mode == "raw")


def _number(value: object, key: str) -> float:
    """Return a finite number; also from a text like 5e-2, which YAML doesn't read as a number."""
    try:
        if isinstance(value, bool) or not isinstance(value, int | float | str):
            raise ValueError
        number = float(value)
    except (ValueError, OverflowError):
        raise FloorPlanError(f"{key} is {shown_value(value)}: a number is expected") from None
    if not math.isfinite(number):
        raise FloorPlanError(f"{key} is {number}: a finite number is expected")
    return number


def is_nan(value: object) -> bool:
    """Return whether a yaw is not a number, as older versions of `map_saver` write it for none.

    >>> is_nan("-nan"), is_nan(float("nan")), is_nan(0), is_nan("north")
    (True, True, False, False)
    """
    return str(value).strip().lower().lstrip("+-.") == "nan"


def _threshold(content: dict[str, Any], key: str) -> float:
    value = _number(content[key], key)
    if not 0 <= value <= 1:
        raise FloorPlanError(f"{key} is {value:g}: a probability from 0 to 1 is expected")
    return value


def _origin(value: object) -> tuple[float, float, float]:
    if not isinstance(value, list) or len(value) != 3:
        raise FloorPlanError(f"origin is {shown_value(value)}: a list [x, y, yaw] is expected")
    x, y = (_number(value[k], f"origin[{k}]") for k in (0, 1))
    yaw = 0.0 if is_nan(value[2]) else _number(value[2], "origin[2]")
    if max(abs(x), abs(y)) > MAX_COORDINATE_M:
        raise FloorPlanError(
            f"origin is {shown_value(value)}: too far out for coordinates in metres"
        )
    if abs(yaw) > 2 * math.pi:
        raise FloorPlanError(
            f"origin turns the map by {yaw:g} radians, which is more than a whole turn:"
            f" {math.radians(yaw):.6g} if it is in degrees"
        )
    return x, y, yaw


# --- The image ---------------------------------------------------------------------------------


def _image_file(image: str, path: Path) -> Path:
    """Return the image's file."""
    file = path.parent / image
    if _is_file(file):
        return file
    # A map that was copied from another computer may name its image by an absolute path.
    beside = path.parent / image.replace("\\", "/").rpartition("/")[2]
    if _is_file(beside):
        return beside
    raise FloorPlanError(
        f"there is no image {file}: put it there, or correct `image`, which is relative to the"
        " YAML file"
    )


def _note_image(image: str, file: Path, path: Path) -> list[str]:
    """Return a note if the image isn't where the YAML file says."""
    if file == path.parent / image:
        return []
    return [f"there is no image {image}: {file.name} beside {path.name} is used instead"]


def _is_file(path: Path) -> bool:
    try:
        return input_path(path).is_file()
    except (OSError, InputError):  # there is none, or it may not be opened
        return False


def _opaque(shades: Bool, picture: GreyPicture) -> Bool:
    """Return the opaque pixels of some shades, bool (rows, columns)."""
    pixels: Bool = shades[picture.values]
    return pixels if picture.clear is None else pixels & ~picture.clear
