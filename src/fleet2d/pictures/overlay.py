"""Text and legends over a whole figure, at positions in inches."""

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
SPACE_IN = 0.17
QUIET_COLOR = "#6b7078"
HATCH_COLOR = "#cfd2d6"


class Chip(NamedTuple):
    """An entry of a legend: a small picture and its label."""

    kind: Literal["room", "away", "seen", "spot", "way", "ring", "view"]
    color: Any
    label: str


class Overlay:
    """Transparent axes over a whole figure, in inches from its lower left corner."""

    def __init__(self, figure: Figure) -> None:
        """Add the axes to the figure."""
        self._figure = figure
        self._canvas = FigureCanvasAgg(figure)
        self.axes: Axes = figure.add_axes((0, 0, 1, 1), zorder=10)
        self.axes.set_axis_off()
        self.resize(*figure.get_size_inches().tolist())

    def resize(self, width: float, height: float) -> None:
        """Change the size of the figure [in]."""
        self._figure.set_size_inches(width, height)
        self.axes.set(xlim=(0, width), ylim=(0, height))

    def write(self, x: float, y: float, line: str, size: float, **style: Any) -> float:
        """Write a line of text, with its baseline at y; return the x of its end."""
        style = {"color": TEXT_COLOR, "va": "baseline", **style}
        text = self.axes.text(x, y, line, fontsize=size, **style)
        return x + self.width(text)

    def width(self, text: Text) -> float:
        """Return the width of a text [in]."""
        extent = text.get_window_extent(self._canvas.get_renderer())
        return float(extent.width) / float(self._figure.dpi)

    def fit(self, line: str, size: float, width: float) -> str:
        """Return a line, shortened if it is wider than `width` inches."""
        text = self.axes.text(0, 0, line, fontsize=size)
        end = len(line)
        while self.width(text) > width and end > 1:
            end -= 1
            text.set_text(line[:end].rstrip() + "…")
        text.remove()
        return line if end == len(line) else line[:end].rstrip() + "…"

    def wrap(self, parts: Sequence[str], separator: str, size: float, width: float) -> list[str]:
        """Return parts joined to lines of at most `width` inches; a longer part is shortened."""
        lines: list[str] = []
        for part in parts:
            longer = f"{lines[-1]}{separator}{part}" if lines else part
            if lines and self.fit(longer, size, width) == longer:
                lines[-1] = longer
            else:
                lines.append(self.fit(part, size, width))
        return lines

    def lines(self, width: float, chips: Sequence[Chip], size: float) -> list[list[Chip]]:
        """Return the chips of each line of a legend, for a width [in]."""
        lines: list[list[Chip]] = [[]]
        used = 0.0
        for entry in chips:
            label_width = width - _picture_width(entry)
            chip = entry._replace(label=self.fit(entry.label, size, label_width))
            chip_width = self._chip_width(chip, size)
            if lines[-1] and used + chip_width > width:
                lines.append([])
                used = 0.0
            lines[-1].append(chip)
            used += chip_width + SPACE_IN
        return lines

    def legend(self, x: float, y: float, lines: Sequence[Sequence[Chip]], size: float) -> None:
        """Draw lines of chips from (x, y) downwards."""
        for number, chips in enumerate(lines):
            left, middle = x, y - number * LINE_IN
            for chip in chips:
                self._picture(chip, left, middle)
                style = {"color": QUIET_COLOR, "va": "center_baseline"}
                self.write(left + _picture_width(chip), middle, chip.label, size, **style)
                left += self._chip_width(chip, size) + SPACE_IN

    def _chip_width(self, chip: Chip, size: float) -> float:
        text = self.axes.text(0, 0, chip.label, fontsize=size)
        width = self.width(text)
        text.remove()
        return _picture_width(chip) + width

    def _picture(self, chip: Chip, x: float, y: float) -> None:
        """Draw the picture of a chip, its left middle at (x, y)."""
        side, axes = CHIP_IN, self.axes
        low = y - side / 2
        middle = (x + side / 2, y)
        if chip.kind in ("room", "seen"):
            axes.add_patch(Rectangle((x, low), side, side, facecolor=chip.color, lw=0))
        if chip.kind == "seen":
            for bar, share in enumerate((0.2, 0.7, 0.45)):
                corner = (x + (0.1 + 0.3 * bar) * side, low)
                box = Rectangle(corner, 0.2 * side, share * side, facecolor=TEXT_COLOR, lw=0)
                axes.add_patch(box)
        if chip.kind == "away":
            style: dict[str, Any] = {
                "facecolor": "white",
                "edgecolor": HATCH_COLOR,
                "hatch": "////////",
                "lw": 0.5,
            }
            axes.add_patch(Rectangle((x, low), side, side, **style))
        if chip.kind == "spot":
            for part, alpha in ((0.62, 0.2), (0.42, 0.35), (0.24, 0.8)):
                axes.add_patch(Circle(middle, part * side, facecolor=chip.color, alpha=alpha, lw=0))
        if chip.kind == "way":
            line = [np.array([[x, y], [x + 1.6 * side, y]])]
            axes.add_collection(LineCollection(line, colors=chip.color, lw=1.3), autolim=False)
        if chip.kind == "ring":
            axes.add_patch(Circle(middle, 0.26 * side, fill=False, edgecolor=chip.color, lw=0.7))
        if chip.kind == "view":
            corner = (x + 0.1 * side, y)
            style = {"facecolor": VIEW_COLOR, "edgecolor": VIEW_EDGE, "lw": 0.7, "alpha": 0.8}
            axes.add_patch(Wedge(corner, 0.9 * side, -40, 40, **style))


def _picture_width(chip: Chip) -> float:
    """Return the width of the picture of a chip and of the space after it [in]."""
    return CHIP_IN * (1.6 if chip.kind == "way" else 1.0) + 0.06
