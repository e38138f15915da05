"""Draw the check-up of a home: its floor plan, a number at each finding, and the findings below."""

import textwrap
from collections.abc import Sequence
from pathlib import Path
from types import MappingProxyType

import shapely
from matplotlib.axes import Axes
from shapely.geometry.base import BaseGeometry

from fleet2d.floorplan.checkup import Finding
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.kernels import F64
from fleet2d.palette import TEXT_COLOR
from fleet2d.pictures.floorplan import check_picture, figure_size, floorplan_axes, picture

COLORS = MappingProxyType({"unlivable": "#8b1a1a", "wrong": "#c8452f", "odd": "#d08a1d"})
LINE_IN = 0.17
LETTERS_PER_IN = 13


def draw_checkup(plan: FloorPlan, findings: Sequence[Finding], path: Path) -> None:
    """Draw a floor plan with its findings to a PNG or SVG file.

    Args:
        plan: The home.
        findings: Its findings, which are numbered from 1.
        path: The file, whose name ends with `.png`, `.svg` or `.pdf`. An existing file is replaced.

    Raises:
        InputError: The file name has another suffix, or the file can't be written.
    """
    check_picture(path)
    width, height = figure_size(plan)
    lines = _lines(findings, int(width * LETTERS_PER_IN))
    below = LINE_IN * (len(lines) + 2)
    with picture(path, width, height + below) as figure:
        axes = figure.add_axes((0, below / (height + below), 1, height / (height + below)))
        floorplan_axes(plan, axes)
        for number, finding in enumerate(findings, start=1):
            _mark(axes, number, finding)
        for row, (text, color) in enumerate(lines):
            y = (below - LINE_IN * (row + 1)) / (height + below)
            figure.text(0.03, y, text, fontsize=8, color=color, va="center")


def _lines(findings: Sequence[Finding], letters: int) -> list[tuple[str, str]]:
    """Return the findings as numbered lines of text, each with its colour."""
    if not findings:
        return [("nothing wrong or odd was found", TEXT_COLOR)]
    lines = []
    for number, finding in enumerate(findings, start=1):
        for i, line in enumerate(textwrap.wrap(finding.text, letters)):
            lines.append((f"{number:>3}  {line}" if i == 0 else f"     {line}", finding.severity))
    return [(text, COLORS[severity]) for text, severity in lines]


def _mark(axes: Axes, number: int, finding: Finding) -> None:
    color = COLORS[finding.severity]
    for line in _outlines(finding.shape):
        axes.plot(line[:, 0], line[:, 1], color=color, lw=1.2, zorder=5.5)
    if finding.at is not None:
        box = {"boxstyle": "circle,pad=0.25", "facecolor": color, "edgecolor": "white", "lw": 0.8}
        axes.text(
            *finding.at, str(number), fontsize=7, color="white", ha="center", va="center",
            zorder=6, bbox=box,
        )  # fmt: skip


def _outlines(shape: BaseGeometry | None) -> list[F64]:
    if shape is None:
        return []
    lines = []
    for part in shapely.get_parts(shape).tolist():
        rings = [part.exterior, *part.interiors] if part.geom_type == "Polygon" else [part]
        lines += [shapely.get_coordinates(ring) for ring in rings]
    return lines
