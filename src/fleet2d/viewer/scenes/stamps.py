"""Text on the frames of a film: each piece is drawn once, then pasted as a picture."""

import re
from typing import Any, NamedTuple

import numpy as np
from matplotlib.backends.backend_agg import RendererAgg
from matplotlib.text import Text
from numpy.typing import NDArray

from fleet2d.kernels import U8

_NUMBERS = re.compile(r"\d+|\D+")
EDGE = 2  # pixels around a text for its antialiased rim


class Stamp(NamedTuple):
    """The picture of a text, RGBA in 0 to 1, float32 (rows, columns, 4); its corner [pixels]."""

    picture: NDArray[np.float32]
    left: int
    top: int


class TextStamps:
    """Pastes texts on pictures of one size; drawing a text takes a hundred times as long."""

    def __init__(self, width: int, height: int, dpi: float) -> None:
        """Prepare for pictures of a size [pixels]."""
        self._renderer: Any = RendererAgg(width, height, dpi)
        self._height = height
        self._stamps: dict[tuple[str, object, float], Stamp | None] = {}
        self._advances: dict[tuple[str, float], float] = {}

    def paste(self, text: Text, pixels: U8) -> None:
        """Paste a text on a picture, at its position.

        Args:
            text: The text; nothing is pasted if it is invisible.
            pixels: uint8 (rows, columns, 4), changed in place.
        """
        if not text.get_visible() or not text.get_text():
            return
        x, y = self._place(text)
        content = text.get_text()
        # A clock shows many different times, but few different hours and minutes.
        is_left = text.get_horizontalalignment() == "left"
        parts = _NUMBERS.findall(content) if is_left else [content]
        for part in parts:
            text.set_text(part)
            self._paste_part(text, x, y, pixels)
            x += self._advance(text) if len(parts) > 1 else 0
        text.set_text(content)

    def _paste_part(self, text: Text, x: float, y: float, pixels: U8) -> None:
        key = (text.get_text(), text.get_color(), float(text.get_fontsize()))
        if key not in self._stamps:
            self._stamps[key] = self._stamp(text)
        stamp = self._stamps[key]
        if stamp is None:
            return
        rows, columns = stamp.picture.shape[:2]
        top, left = round(self._height - y) + stamp.top, round(x) + stamp.left
        low, high = max(0, top), min(pixels.shape[0], top + rows)
        begin, end = max(0, left), min(pixels.shape[1], left + columns)
        if low >= high or begin >= end:
            return
        part = stamp.picture[low - top : high - top, begin - left : end - left]
        target = pixels[low:high, begin:end, :3]
        opacity = part[..., 3:]
        target[...] = target * (1 - opacity) + 255 * part[..., :3] * opacity + 0.5

    @staticmethod
    def _place(text: Text) -> tuple[float, float]:
        x, y = text.get_transform().transform(text.get_position()).tolist()
        return x, y

    def _advance(self, text: Text) -> float:
        """Return the distance from the start of a text to the start of the next [pixels]."""
        content, font = text.get_text(), text.get_fontproperties()
        key = (content, float(text.get_fontsize()))
        if key not in self._advances:
            # Measured between bars: blanks at the end of a text have no width.
            with_text, without = (
                self._renderer.get_text_width_height_descent(f"|{part}|", font, False)[0]
                for part in (content, "")
            )
            self._advances[key] = with_text - without
        return self._advances[key]

    def _stamp(self, text: Text) -> Stamp | None:
        """Draw a text alone; return its picture, None if it is empty."""
        x, y = self._place(text)
        self._renderer.clear()
        text.draw(self._renderer)
        box = text.get_window_extent(self._renderer)
        left, right = max(0, int(box.x0) - EDGE), int(box.x1) + EDGE
        top, bottom = max(0, int(self._height - box.y1) - EDGE), int(self._height - box.y0) + EDGE
        pixels = np.asarray(self._renderer.buffer_rgba())[top:bottom, left:right]
        if not pixels.any():
            return None
        picture = (pixels / 255).astype(np.float32)
        return Stamp(picture, left - round(x), top - round(self._height - y))
