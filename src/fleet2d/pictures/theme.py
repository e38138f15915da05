"""Light and dark themes: pictures are drawn for a light background, then converted to a dark one.

Drawing code needn't know the theme. Pale colours become dark and dark ones pale, with the same hue;
strong colours, which identify bodies and alarms, only become brighter.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any, Literal, cast, get_args

import numpy as np
from matplotlib.artist import Artist
from matplotlib.collections import Collection
from matplotlib.colors import to_rgba_array
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.text import Text
from numpy.typing import ArrayLike

from fleet2d.configuration.problems import check_known
from fleet2d.errors import InputError
from fleet2d.kernels import F64

Theme = Literal["light", "dark"]
THEMES: tuple[Theme, ...] = get_args(Theme)
SCALE = "scale"
"""Label of an image whose colours stand for numbers: they are the same in both themes."""

# Lightness of Oklab: white becomes the dark background of the page, the darkest ink almost white.
BACKGROUND = 0.207
INK = 0.93
DARKEST = 0.31
# Colours between these chromas are blended: below they are inverted, above they become brighter.
PALE = 0.118
STRONG = 0.14
LEAST = 0.44
LIFT = 0.5

# Björn Ottosson, "A perceptual color space for image processing" (2020).
_CONES = np.array(
    [
        [0.4122214708, 0.5363325363, 0.0514459929],
        [0.2119034982, 0.6806995451, 0.1073969566],
        [0.0883024619, 0.2817188376, 0.6299787005],
    ]
)
_LAB = np.array(
    [
        [0.2104542553, 0.7936177850, -0.0040720468],
        [1.9779984951, -2.4285922050, 0.4505937099],
        [0.0259040371, 0.7827717662, -0.8086757660],
    ]
)

_theme: ContextVar[Theme] = ContextVar("theme", default="light")


def check_theme(name: str) -> Theme:
    """Return a theme by its name.

    Raises:
        InputError: There is no such theme.
    """
    check_known(name, "theme", THEMES, InputError)
    return cast("Theme", name)


@contextmanager
def themed(theme: Theme) -> Iterator[None]:
    """Draw pictures in a theme within a block."""
    token = _theme.set(theme)
    try:
        yield
    finally:
        _theme.reset(token)


def apply_theme(figure: Figure) -> Figure:
    """Convert a finished figure to the current theme, in place; return it. Call it only once."""
    if _theme.get() == "dark":
        darken(figure)
    return figure


def darken(figure: Figure) -> None:
    """Convert the colours of a figure to the dark theme, in place."""
    figure.draw_without_rendering()  # creates ticks and their labels
    for artist in figure.findobj():
        _darken_artist(artist)


def dark_colors(colors: ArrayLike) -> F64:
    """Return colours of the dark theme: RGBA in 0 to 1, float64 (n, 4).

    Args:
        colors: One colour or several, in any form of matplotlib.

    Example:
        >>> from matplotlib.colors import to_hex
        >>> [to_hex(color) for color in dark_colors(["white", "#2d3138"])]
        ['#181818', '#e2e7f1']
    """
    rgba: F64 = to_rgba_array(colors).copy()
    rgba[:, :3] = _dark(rgba[:, :3])
    return rgba


def _dark(rgb: F64) -> F64:
    """Convert colours of the light theme to the dark one: RGB, float64 (n, 3)."""
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    lab = np.cbrt(linear @ _CONES.T) @ _LAB.T
    light = lab[:, 0]
    chroma = np.hypot(lab[:, 1], lab[:, 2])
    inverted = np.clip(BACKGROUND + (1 - light) * (INK - BACKGROUND) / (1 - DARKEST), 0, 1)
    strong = np.clip((chroma - PALE) / (STRONG - PALE), 0, 1)
    lab[:, 0] = (1 - strong) * inverted + strong * (LEAST + LIFT * light)
    linear = np.clip(np.linalg.solve(_CONES, np.linalg.solve(_LAB, lab.T) ** 3).T, 0, 1)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


_COLORS: tuple[tuple[type[Artist], tuple[str, ...]], ...] = (
    (Patch, ("facecolor", "edgecolor")),
    (Line2D, ("color", "markerfacecolor", "markeredgecolor")),
    (Text, ("color",)),
)
"""The properties that are colours, by the class of an artist."""


def _darken_artist(artist: Artist) -> None:
    for kind, names in _COLORS:
        if isinstance(artist, kind):
            colors = {name: getattr(artist, f"get_{name}")() for name in names}
            artist.set(**{name: _dark_or_transparent(color) for name, color in colors.items()})
    if isinstance(artist, Text):
        if (box := artist.get_bbox_patch()) is not None:
            _darken_artist(box)
        for effect in artist.get_path_effects() or ():  # outlines
            style = getattr(effect, "_gc", {})
            if "foreground" in style:
                style["foreground"] = _dark_or_transparent(style["foreground"])
    elif isinstance(artist, Collection):
        _darken_collection(artist)
    elif isinstance(artist, AxesImage):
        _darken_image(artist)


def _dark_or_transparent(color: Any) -> Any:
    """Convert a colour of the light theme to the dark one; a transparent one stays as it is."""
    colors = dark_colors(color)
    return tuple(colors[0].tolist()) if len(colors) and colors[0, 3] else color


def _darken_collection(artist: Collection) -> None:
    if artist.get_array() is not None:  # its colours stand for numbers
        return
    colors = {"facecolor": artist.get_facecolor(), "edgecolor": artist.get_edgecolor()}
    artist.set(**{name: dark_colors(value) for name, value in colors.items() if len(value)})


def _darken_image(image: AxesImage) -> None:
    pixels = np.asarray(image.get_array())
    if pixels.ndim != 3 or image.get_label() == SCALE:
        return
    flat = pixels.reshape(-1, pixels.shape[2]).astype(np.float64)
    if pixels.dtype == np.uint8:
        flat /= 255
    colors, color_of_pixel = np.unique(flat[:, :3], axis=0, return_inverse=True)
    flat[:, :3] = _dark(colors)[color_of_pixel.ravel()]
    image.set_data(flat.reshape(pixels.shape))
