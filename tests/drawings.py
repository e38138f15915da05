"""Drawings of plans as people make them, in which the plan is the truth."""

from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import numpy as np
import shapely
from shapely import Polygon, affinity

from fleet2d.floorplan.plan import FloorPlan

WALL_M = 0.2
MARGIN_M = 2.4
WINDOW_M = 1.5
LINE_M = 0.02
DARK = 20
STYLES = {"solid": DARK, "grey": 175, "outlined grey": 200, "hatched": 250, "outlined": 250}
"""The shade inside walls by the style of a drawing."""


class Drawing:
    """A picture of a plan with thin lines, text, doors, windows, furniture and dimensions.

    Attributes:
        picture: The picture, of Pillow.
        pixel: Side of a pixel [m].
        truth: The free space [m], in coordinates from the lower left corner of the picture.
    """

    def __init__(self, plan: FloorPlan, style: str = "solid", pixel: float = 0.0125) -> None:
        from PIL import Image, ImageDraw

        x0, y0, x1, y1 = plan.bounds
        self._shift = (MARGIN_M - x0, MARGIN_M - y0)
        self.pixel = pixel
        self.truth = affinity.translate(plan.free_space, *self._shift)
        size = round((x1 - x0 + 2 * MARGIN_M) / pixel), round((y1 - y0 + 2 * MARGIN_M) / pixel)
        self.picture: Any = Image.new("L", size, 250)
        self._pen: Any = ImageDraw.Draw(self.picture)
        self._width = max(round(LINE_M / pixel), 1)
        rooms = self.truth.buffer(-0.5, join_style="mitre").buffer(0.5, join_style="mitre")
        home = rooms.buffer(WALL_M, join_style="mitre")
        filled = Polygon(shapely.union_all(shapely.get_parts(home)).exterior)
        holes = list(self._windows(filled))
        walls = filled.difference(shapely.union_all([self.truth, *holes]))
        self._walls(walls, style)
        for hole in holes:
            self._outline(hole)
            a, b, c, d = np.asarray(hole.exterior.coords)[:4]
            self.line((a + d) / 2, (b + c) / 2)
        for door in plan.doorways:
            self._door(*(np.array(end) + self._shift for end in (door.start, door.end)))
        for number, room in enumerate(plan.rooms):
            self._furniture(np.array(room.anchor_xy) + self._shift, number)
            self._text(np.array(room.anchor_xy) + self._shift, f"{room.type} {room.area_m2:.1f} m2")
        self._dimensions(*filled.bounds)

    def _at(self, place: Any) -> tuple[float, float]:
        return place[0] / self.pixel, self.picture.height - place[1] / self.pixel

    def line(self, *places: Any) -> None:
        """Draw a thin line through places [m]."""
        self._pen.line([self._at(p) for p in places], fill=DARK, width=self._width)

    def _outline(self, shape: Any) -> None:
        for part in shapely.get_parts(shape):
            for ring in shapely.get_rings(part):
                self.line(*np.asarray(ring.coords))

    def _walls(self, walls: Any, style: str) -> None:
        for part in sorted(shapely.get_parts(walls), key=lambda part: -Polygon(part.exterior).area):
            self._pen.polygon([self._at(p) for p in part.exterior.coords], fill=STYLES[style])
            for hole in part.interiors:
                self._pen.polygon([self._at(p) for p in hole.coords], fill=250)
        if style in ("hatched", "outlined", "outlined grey"):
            self._outline(walls)
        if style == "hatched":
            x0, y0, x1, y1 = walls.bounds
            for k in np.arange(x0 - (y1 - y0), x1, 0.1):
                stripe = shapely.LineString([(k, y0), (k + y1 - y0, y1)])
                for part in shapely.get_parts(stripe.intersection(walls)):
                    self.line(*np.asarray(part.coords))

    def _windows(self, filled: Polygon) -> Iterator[Polygon]:
        """Yield the rectangles of windows in long outer walls."""
        corners = np.asarray(filled.exterior.coords)
        for a, b in pairwise(corners):
            length = float(np.hypot(*(b - a)))
            if length > 2.5:
                along, middle = (b - a) / length, (a + b) / 2
                into = np.array([-along[1], along[0]])
                if not filled.contains(shapely.Point(middle + into * 0.05)):
                    into = -into
                half = along * min(WINDOW_M, length / 3) / 2
                hole = Polygon(
                    [
                        middle - half,
                        middle + half,
                        middle + half + into * WALL_M,
                        middle - half + into * WALL_M,
                    ]
                )
                if self.truth.distance(hole) < 0.01 and hole.buffer(-0.01).disjoint(self.truth):
                    yield hole

    def _door(self, start: Any, end: Any) -> None:
        """Draw the leaf of an open door and its arc."""
        way = end - start
        width = float(np.hypot(*way))
        if width > 1.3:
            return
        first = np.arctan2(way[1], way[0])
        angles = first + np.linspace(0, np.pi / 2, 20)
        arc = start + width * np.stack([np.cos(angles), np.sin(angles)], axis=1)
        self.line(start, arc[-1])
        self.line(*arc)

    def _furniture(self, at: Any, number: int) -> None:
        """Draw a bed or a table with chairs as outlines."""
        width, depth = (1.6, 2.0) if number % 2 else (1.2, 0.8)
        box = shapely.box(at[0] + 0.2, at[1] - depth, at[0] + 0.2 + width, at[1] - 0.2)
        if self.truth.contains(box):
            self._outline(box)
            self._outline(box.buffer(-0.1))
            self.line(*np.asarray(box.exterior.coords)[[0, 2]])

    def _text(self, at: Any, text: str) -> None:
        from PIL import ImageFont

        self._pen.text(self._at(at), text, DARK, ImageFont.load_default(0.25 / self.pixel), "ms")

    def _dimensions(self, x0: float, y0: float, x1: float, y1: float) -> None:
        """Draw dimension lines that touch the walls, a frame, and a title."""
        y, x = y0 - 0.8, x0 - 0.8
        self.line((x0, y), (x1, y))
        self.line((x, y0), (x, y1))
        for k in np.linspace(x0, x1, 4):
            self.line((k, y0), (k, y - 0.2))
            self._text((k + 0.5, y + 0.1), "3.20")
        for k in np.linspace(y0, y1, 4):
            self.line((x0, k), (x - 0.2, k))
        width, height = self.picture.width * self.pixel, self.picture.height * self.pixel
        self._outline(shapely.box(0.1, 0.1, width - 0.1, height - 0.1))
        self._text((width / 2, 0.6), "Ground floor, 1:50")
