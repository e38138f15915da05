"""Light and dark: pictures are drawn for a light ground, and turned over for a dark one.

No drawing knows of it. What is pale becomes dark and the other way round, hues stay; strong
colours, which stand for somebody or for an alarm, only become brighter.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any, Literal, get_args

import numpy as np
from matplotlib.artist import Artist
from matplotlib.collections import Collection
from matplotlib.colors import to_rgba_array
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.text import Text
from numpy.typing import ArrayLike, NDArray

from fleet2d.errors import InputError

Theme = Literal["light", "dark"]
THEMES: tuple[Theme, ...] = get_args(Theme)
SCALE = "scale"
"""Label of an image whose colours stand for numbers: they are the same on any ground."""

# Lightness of Oklab: white becomes the page's dark ground, the darkest ink nearly white.
GROUND, INK, TURN = 0.207, 0.93, 0.31
# Chroma from which a colour counts as strong: its lightness is lifted, and keeps its order.
PALE, STRONG = 0.118, 0.14
LEAST, LIFT = 0.44, 0.5

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
    for theme in THEMES:
        if theme == name:
            return theme
    raise InputError(f"there is no theme {name!r}: choose light or dark")


@contextmanager
def themed(theme: Theme) -> Iterator[None]:
    """Have pictures written in a theme."""
    token = _theme.set(theme)
    try:
        yield
    finally:
        _theme.reset(token)


def finished(figure: Figure) -> Figure:
    """Turn a figure that is drawn over, once, if the theme of the moment is dark."""
    if _theme.get() == "dark":
        darken(figure)
    return figure


def darken(figure: Figure) -> None:
    """Turn the colours of a figure over, in place."""
    figure.draw_without_rendering()  # ticks and their labels exist only now
    for artist in figure.findobj():
        _darken_artist(artist)


def dark_colors(colors: ArrayLike) -> NDArray[np.float64]:
    """Return colours for a dark ground, (n, 4) in 0 to 1.

    Args:
        colors: What matplotlib takes for one colour or several.

    Example:
        >>> from matplotlib.colors import to_hex
        >>> [to_hex(color) for color in dark_colors(["white", "#2d3138"])]
        ['#181818', '#e2e7f1']
    """
    rgba: NDArray[np.float64] = to_rgba_array(colors).copy()
    rgba[:, :3] = _turned(rgba[:, :3])
    return rgba


def _turned(rgb: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return colours (n, 3) with their lightness turned over."""
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    lab = np.cbrt(linear @ _CONES.T) @ _LAB.T
    light, chroma = lab[:, 0], np.hypot(lab[:, 1], lab[:, 2])
    over = np.clip(GROUND + (1 - light) * (INK - GROUND) / (1 - TURN), 0, 1)
    strong = np.clip((chroma - PALE) / (STRONG - PALE), 0, 1)
    lab[:, 0] = (1 - strong) * over + strong * (LEAST + LIFT * light)
    linear = np.clip(np.linalg.solve(_CONES, np.linalg.solve(_LAB, lab.T) ** 3).T, 0, 1)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def _darken_artist(artist: Artist) -> None:
    if isinstance(artist, Patch):
        face, edge = artist.get_facecolor(), artist.get_edgecolor()
        artist.set_facecolor(_turned_or_none(face))
        artist.set_edgecolor(_turned_or_none(edge))
    elif isinstance(artist, Line2D):
        artist.set_color(_turned_or_none(artist.get_color()))
        artist.set_markerfacecolor(_turned_or_none(artist.get_markerfacecolor()))
        artist.set_markeredgecolor(_turned_or_none(artist.get_markeredgecolor()))
    elif isinstance(artist, Text):
        artist.set_color(_turned_or_none(artist.get_color()))
        if (box := artist.get_bbox_patch()) is not None:
            _darken_artist(box)
        for effect in artist.get_path_effects() or ():
            _darken_rim(effect)
    elif isinstance(artist, Collection):
        _darken_collection(artist)
    elif isinstance(artist, AxesImage):
        _darken_image(artist)


def _turned_or_none(color: Any) -> Any:
    """Return a colour turned over; one that is not drawn stays."""
    colors = dark_colors(color)
    return tuple(colors[0].tolist()) if len(colors) and colors[0, 3] else color


def _darken_rim(effect: Any) -> None:
    """Turn the colour over of a rim around words."""
    style = getattr(effect, "_gc", {})
    if "foreground" in style:
        style["foreground"] = _turned_or_none(style["foreground"])


def _darken_collection(lines: Collection) -> None:
    if lines.get_array() is not None:  # its colours stand for numbers
        return
    for get, put in (
        (lines.get_facecolor, lines.set_facecolor),
        (lines.get_edgecolor, lines.set_edgecolor),
    ):
        colors = np.asarray(get())
        if len(colors):
            put(dark_colors(colors))


def _darken_image(image: AxesImage) -> None:
    pixels = np.asarray(image.get_array())
    if pixels.ndim != 3 or image.get_label() == SCALE:
        return
    flat = pixels.reshape(-1, pixels.shape[2]).astype(np.float64)
    if pixels.dtype == np.uint8:
        flat /= 255
    kinds, which = np.unique(flat[:, :3], axis=0, return_inverse=True)
    flat[:, :3] = _turned(kinds)[which.ravel()]
    image.set_data(flat.reshape(pixels.shape))
