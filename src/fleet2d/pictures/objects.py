"""Draw the objects of a floor plan: doorways, furniture, and no-go areas of robots."""

from types import MappingProxyType
from typing import Any

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PathCollection
from matplotlib.path import Path as Outline

from fleet2d.floorplan.objects import PlacedObject
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.kernels import F64
from fleet2d.palette import DOOR_COLOR

EDGE_COLOR = "#6d737c"
FILL_COLORS = MappingProxyType({"nothing": "none", "path": "#fbfaf7", "sight": "#c9c6bf"})
LABEL_COLOR = "#6d737c"
NO_GO_COLOR = "#c8452f"

LABEL_PT = (2.6, 5.0)
# Width of a letter of the font, as a share of its size.
LETTER = 0.62
# Corners of a circle, and of a door's quarter of one.
CIRCLE = 24
SWING = 12

# Symbols of architectural plans, in shares of the width of a footprint (-0.5 is the right side, 0.5
# the left) and of its depth (-0.5 is the back): boxes (x0, y0, x1, y1), and circles (x, y, radius)
# with the radius as a share of the smaller of both.
_BED = ((-0.5, -0.14, 0.5, -0.14),)
_FRONT = ((-0.5, 0.3, 0.5, 0.3),)
SYMBOLS: MappingProxyType[str, tuple[tuple[float, ...], ...]] = MappingProxyType(
    {
        "bed": (*_BED, (-0.45, -0.46, -0.05, -0.22), (0.05, -0.46, 0.45, -0.22)),
        "single_bed": (*_BED, (-0.38, -0.46, 0.38, -0.24)),
        "sofa": ((-0.42, -0.22, 0.42, 0.5), (0.0, -0.22, 0.0, 0.5)),
        "armchair": ((-0.3, -0.22, 0.3, 0.5),),
        "chair": ((-0.5, -0.3, 0.5, -0.3),),
        "stove": tuple((x, y, 0.17) for x in (-0.24, 0.24) for y in (-0.24, 0.24)),
        "sink": ((-0.35, -0.3, 0.35, 0.35), (0.0, 0.0, 0.06)),
        "washbasin": ((-0.35, -0.25, 0.35, 0.38), (0.0, 0.0, 0.08)),
        "toilet": ((-0.5, -0.2, 0.5, -0.2), (0.0, 0.12, 0.4)),
        "shower": ((-0.5, -0.5, 0.5, 0.5), (0.0, 0.0, 0.08)),
        "bathtub": ((-0.44, -0.36, 0.44, 0.36),),
        "washing_machine": ((0.0, 0.0, 0.34),),
        "wardrobe": (_FRONT[0], (0.0, -0.5, 0.0, 0.3)),
        "fridge": _FRONT,
        "bookshelf": tuple((x, -0.5, x, 0.5) for x in (-0.25, 0.0, 0.25)),
        "shelf": ((0.0, -0.5, 0.0, 0.5),),
        "tv": ((-0.4, -0.1, 0.4, 0.2),),
        "desk": ((-0.2, -0.3, 0.2, -0.15),),
        "nightstand": ((0.0, 0.0, 0.2),),
        "charger": ((-0.3, -0.1, 0.3, 0.5),),
        "treadmill": ((-0.35, -0.3, 0.35, 0.45),),
    }
)

# Their symbols are well known, and leave no space for text.
UNLABELLED = frozenset(
    ("chair", "nightstand", "toilet", "washbasin", "sink", "stove", "shower", "charger")
)


def draw_objects(plan: FloorPlan, axes: Axes) -> None:
    """Draw furniture with its symbols, doorways, and no-go areas of robots, in metres."""
    for blocks, fill in FILL_COLORS.items():
        outlines = [
            Outline(shapely.get_coordinates(item.footprint.exterior), closed=True)
            for item in plan.objects
            if item.blocks == blocks
        ]
        dashes = "--" if blocks == "nothing" else "-"
        style: dict[str, Any] = {"facecolor": fill, "edgecolor": EDGE_COLOR, "zorder": 1.6}
        axes.add_collection(PathCollection(outlines, linewidths=0.6, linestyles=dashes, **style))
    lines = [line for item in plan.objects for line in _symbol(item)]
    axes.add_collection(LineCollection(lines, lw=0.4, color=EDGE_COLOR, zorder=1.65))
    _draw_no_go(plan, axes)
    _draw_doorways(plan, axes)


def label_objects(plan: FloorPlan, axes: Axes) -> None:
    """Write the type of each object on it, where it is large enough."""
    axes.apply_aspect()  # needed for the transform to pixels
    pixels = axes.transData.transform([(0.0, 0.0), (1.0, 0.0)])
    points_per_m = float(pixels[1, 0] - pixels[0, 0]) * 72 / axes.figure.dpi
    for item in plan.objects:
        x0, y0, x1, y1 = item.footprint.bounds
        label = item.type.replace("_", " ")
        across, up = x1 - x0, y1 - y0
        flat = min(across / (LETTER * len(label)), up / 1.2) * points_per_m
        upright = min(up / (LETTER * len(label)), across / 1.2) * points_per_m
        size = min(max(flat, upright), LABEL_PT[1])
        if size < LABEL_PT[0] or item.type in UNLABELLED:
            continue
        middle = item.footprint.centroid
        style: dict[str, Any] = {"ha": "center", "va": "center", "color": LABEL_COLOR}
        rotation = 90 * (upright > flat)
        axes.text(middle.x, middle.y, label, fontsize=size, rotation=rotation, zorder=4, **style)


def _symbol(item: PlacedObject) -> list[F64]:
    """Return the lines inside a footprint [m]."""
    forward = np.array([np.cos(item.heading), np.sin(item.heading)])
    left = np.array([-forward[1], forward[0]])
    corners = shapely.get_coordinates(item.footprint)
    along, across = corners @ forward, corners @ left
    width, depth = float(np.ptp(across)), float(np.ptp(along))
    middle = (across.min() + width / 2) * left + (along.min() + depth / 2) * forward
    lines = []
    for shape in SYMBOLS.get(item.type, ()):
        if len(shape) == 4:
            x0, y0, x1, y1 = shape
            points = np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1), (x0, y0)]) * (width, depth)
        else:
            angles = np.linspace(0, 2 * np.pi, CIRCLE + 1)
            ring = np.stack([np.cos(angles), np.sin(angles)], axis=1)
            points = np.array(shape[:2]) * (width, depth) + ring * shape[2] * min(width, depth)
        lines.append(middle + points[:, :1] * left + points[:, 1:] * forward)
    return lines


def _draw_doorways(plan: FloorPlan, axes: Axes) -> None:
    """Draw doors with their swing, as plans do, and openings without a door as dotted lines."""
    leaves, swings, openings = [], [], []
    for door in plan.doorways:
        start, end = np.array(door.start), np.array(door.end)
        if not door.leaf:
            openings.append(np.stack([start, end]))
            continue
        across = end - start
        left = np.array([-across[1], across[0]])
        angles = np.linspace(0, np.pi / 2, SWING)[:, None]
        swings.append(start + across * np.cos(angles) + left * np.sin(angles))
        leaves.append(np.stack([start, start + left]))
    style: dict[str, Any] = {"color": DOOR_COLOR, "zorder": 1.7}
    axes.add_collection(LineCollection(leaves, lw=1.2, **style))
    axes.add_collection(LineCollection(swings, lw=0.4, **style))
    axes.add_collection(LineCollection(openings, lw=0.9, ls=(0, (1, 2)), **style))


def _draw_no_go(plan: FloorPlan, axes: Axes) -> None:
    areas = [Outline(shapely.get_coordinates(area.exterior), closed=True) for area in plan.no_go]
    style: dict[str, Any] = {"facecolor": "none", "edgecolor": NO_GO_COLOR, "zorder": 1.75}
    axes.add_collection(PathCollection(areas, hatch="////", linewidths=0.5, **style))
