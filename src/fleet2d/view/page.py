"""A page to write on in inches: words, and the chips that a legend is made of."""

from collections.abc import Sequence
from typing import Any, Literal, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle, Wedge
from matplotlib.text import Text

from fleet2d.palette import TEXT_COLOR, VIEW_COLOR, VIEW_EDGE

CHIP_IN = 0.15
LINE_IN = 0.215
BETWEEN_IN = 0.17
QUIET_COLOR = "#6b7078"
HATCH_COLOR = "#cfd2d6"


class Chip(NamedTuple):
    """An entry of a legend: a small picture, and what it stands for."""

    kind: Literal["room", "away", "seen", "spot", "way", "ring", "view"]
    color: Any
    words: str


class Page:
    """The whole of a figure as one layer, in inches from its lower left corner."""

    def __init__(self, figure: Figure) -> None:
        """Lay the page over the figure."""
        self._figure = figure
        self._canvas = FigureCanvasAgg(figure)
        self.axes: Axes = figure.add_axes((0, 0, 1, 1), zorder=10)
        self.axes.set_axis_off()
        self.resize(*figure.get_size_inches().tolist())

    def resize(self, width: float, height: float) -> None:
        """Change the size of the figure [in]."""
        self._figure.set_size_inches(width, height)
        self.axes.set(xlim=(0, width), ylim=(0, height))

    def write(self, x: float, y: float, words: str, size: float, **style: Any) -> float:
        """Write a line, y at its baseline; return where it ends."""
        style = {"color": TEXT_COLOR, "va": "baseline", **style}
        text = self.axes.text(x, y, words, fontsize=size, **style)
        return x + self.width(text)

    def width(self, text: Text) -> float:
        """Return how wide a text is [in]."""
        extent = text.get_window_extent(self._canvas.get_renderer())
        return float(extent.width) / float(self._figure.dpi)

    def fit(self, words: str, size: float, width: float) -> str:
        """Return words cut so that they are at most `width` inches wide."""
        text = self.axes.text(0, 0, words, fontsize=size)
        whole = words
        while self.width(text) > width and len(words) > 1:
            words = words[:-1]
            text.set_text(words.rstrip() + "…")
        text.remove()
        return words if words == whole else words.rstrip() + "…"

    def wrap(self, parts: Sequence[str], between: str, size: float, width: float) -> list[str]:
        """Return parts joined to lines of at most `width` inches; a longer part is cut."""
        lines: list[str] = []
        for part in parts:
            longer = f"{lines[-1]}{between}{part}" if lines else part
            if lines and self.fit(longer, size, width) == longer:
                lines[-1] = longer
            else:
                lines.append(self.fit(part, size, width))
        return lines

    def lines(self, width: float, chips: Sequence[Chip], size: float) -> list[list[Chip]]:
        """Return the chips of each line of a legend of a width [in]."""
        lines: list[list[Chip]] = [[]]
        taken = 0.0
        for entry in chips:
            most = width - _picture_width(entry)
            chip = entry._replace(words=self.fit(entry.words, size, most))
            needed = self._needed(chip, size)
            if lines[-1] and taken + needed > width:
                lines.append([])
                taken = 0.0
            lines[-1].append(chip)
            taken += needed + BETWEEN_IN
        return lines

    def legend(self, x: float, y: float, lines: Sequence[Sequence[Chip]], size: float) -> None:
        """Lay out lines of chips from (x, y) down."""
        for number, chips in enumerate(lines):
            at, middle = x, y - number * LINE_IN
            for chip in chips:
                self._picture(chip, at, middle)
                style = {"color": QUIET_COLOR, "va": "center_baseline"}
                self.write(at + _picture_width(chip), middle, chip.words, size, **style)
                at += self._needed(chip, size) + BETWEEN_IN

    def _needed(self, chip: Chip, size: float) -> float:
        text = self.axes.text(0, 0, chip.words, fontsize=size)
        width = self.width(text)
        text.remove()
        return _picture_width(chip) + width

    def _picture(self, chip: Chip, x: float, y: float) -> None:
        """Draw the picture of a chip, its left middle at (x, y)."""
        side, draw = CHIP_IN, self.axes
        low = y - side / 2
        middle = (x + side / 2, y)
        if chip.kind in ("room", "seen"):
            draw.add_patch(Rectangle((x, low), side, side, facecolor=chip.color, lw=0))
        if chip.kind == "seen":
            for bar, share in enumerate((0.2, 0.7, 0.45)):
                corner = (x + (0.1 + 0.3 * bar) * side, low)
                box = Rectangle(corner, 0.2 * side, share * side, facecolor=TEXT_COLOR, lw=0)
                draw.add_patch(box)
        if chip.kind == "away":
            style: dict[str, Any] = {
                "facecolor": "white",
                "edgecolor": HATCH_COLOR,
                "hatch": "////////",
                "lw": 0.5,
            }
            draw.add_patch(Rectangle((x, low), side, side, **style))
        if chip.kind == "spot":
            for part, alpha in ((0.62, 0.2), (0.42, 0.35), (0.24, 0.8)):
                draw.add_patch(Circle(middle, part * side, facecolor=chip.color, alpha=alpha, lw=0))
        if chip.kind == "way":
            line = [np.array([[x, y], [x + 1.6 * side, y]])]
            draw.add_collection(LineCollection(line, colors=chip.color, lw=1.3), autolim=False)
        if chip.kind == "ring":
            draw.add_patch(Circle(middle, 0.26 * side, fill=False, edgecolor=chip.color, lw=0.7))
        if chip.kind == "view":
            corner = (x + 0.1 * side, y)
            style = {"facecolor": VIEW_COLOR, "edgecolor": VIEW_EDGE, "lw": 0.7, "alpha": 0.8}
            draw.add_patch(Wedge(corner, 0.9 * side, -40, 40, **style))


def _picture_width(chip: Chip) -> float:
    """Return how wide the picture of a chip is, with the space after it [in]."""
    return CHIP_IN * (1.6 if chip.kind == "way" else 1.0) + 0.06
