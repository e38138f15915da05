"""Raw maps of vacuums with rand256's firmware, converted to maps of Valetudo."""

from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, TypeAdapter

from fleet2d.floorplan.files import Listed, Point, validate
from fleet2d.kernels import F64

MAP_CLASS = "ValetudoMap"
MAX_PIXEL_NUMBER = 2**20

# Its places are in millimetres; the whole map is 1024 x 1024 pixels of 5 cm.
MM_PER_CM = 10
PIXEL_CM = 5
SIDE_CM = 5120
# Names that wrap the map in a file, the first with pixels from the top, the second from the bottom.
WRAPPERS = ("rand256", "rand25")

PixelNumber = Annotated[int, Field(strict=True, ge=0, le=MAX_PIXEL_NUMBER)]


class _RawModel(BaseModel):
    model_config = ConfigDict(defer_build=True)


class _RawPosition(_RawModel):
    top: int = Field(ge=-MAX_PIXEL_NUMBER, le=MAX_PIXEL_NUMBER)
    left: int = Field(ge=-MAX_PIXEL_NUMBER, le=MAX_PIXEL_NUMBER)


class _RawDimensions(_RawModel):
    width: int = Field(ge=1, le=MAX_PIXEL_NUMBER)


class _RawPixels(_RawModel):
    floor: Listed[PixelNumber] = []
    walls: Listed[PixelNumber] = []


class _RawImage(_RawModel):
    position: _RawPosition
    dimensions: _RawDimensions
    pixels: _RawPixels
    segments: dict[str, Any] = {}


class _RawPath(_RawModel):
    points: Listed[Point] = []


class _RawMap(_RawModel):
    image: _RawImage
    path: _RawPath = _RawPath.model_construct(points=[])
    charger: Point | None = None
    forbidden_zones: Listed[Listed[float]] = []
    virtual_walls: Listed[Listed[float]] = []


_MAP = TypeAdapter(_RawMap)
_SEGMENT = TypeAdapter(Listed[PixelNumber])


def raw_map(content: dict[str, Any]) -> dict[str, Any] | None:
    """Return the raw map in a file, or None for another file."""
    for key in WRAPPERS:
        inner = content.get(key)
        if isinstance(inner, dict):
            return raw_map(inner.get("full_data", inner))
    image = content.get("image")
    is_raw = isinstance(image, dict) and {"position", "dimensions", "pixels"} <= image.keys()
    return content if is_raw else None


def as_valetudo(content: dict[str, Any]) -> dict[str, Any]:
    """Return a raw map as the content of a Valetudo map.

    Raises:
        FloorPlanError: The content is damaged.
    """
    file = validate(_MAP, content)
    image = file.image
    layers: list[tuple[str, list[int], dict[str, str]]] = [
        ("floor", image.pixels.floor, {}),
        ("wall", image.pixels.walls, {}),
    ]
    for key, values in image.segments.items():
        if key.startswith("pixels_seg_"):
            pixels = validate(_SEGMENT, values, f"image.segments.{key}")
            layers.append(("segment", pixels, {"segmentId": key.removeprefix("pixels_seg_")}))
    places = [("path", np.array(file.path.points, np.float64))]
    places += [("charger_location", np.array([file.charger]))] if file.charger else []
    places += [("no_go_area", _pairs(zone)) for zone in file.forbidden_zones]
    places += [("virtual_wall", _pairs(wall)) for wall in file.virtual_walls]
    return {
        "__class": MAP_CLASS,
        "pixelSize": PIXEL_CM,
        "layers": [
            {"type": kind, "metaData": meta, "pixels": _absolute(pixels, image)}
            for kind, pixels, meta in layers
        ],
        "entities": [{"type": kind, "points": _from_top(xy)} for kind, xy in places if len(xy)],
    }


def _pairs(values: list[float]) -> F64:
    return np.array(values[: len(values) // 2 * 2], np.float64).reshape(-1, 2)


def _from_top(xy: F64) -> list[float]:
    """Return places [mm] from the lower left corner as x, y, … [cm] from the upper left one."""
    return np.abs(xy / MM_PER_CM - (0, SIDE_CM)).ravel().tolist()


def _absolute(numbers: list[int], image: _RawImage) -> list[int]:
    """Return pixels that are numbered by rows of the image as x, y, x, y, … of the whole map."""
    row, column = np.divmod(np.array(numbers, np.int64), image.dimensions.width)
    xy = np.stack([column + image.position.left, row + image.position.top], axis=1)
    return xy.ravel().tolist()
