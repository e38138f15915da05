"""A home with everybody in it at a step of a run: a still picture, or one frame of a film."""

from collections.abc import Iterator
from dataclasses import dataclass
from datetime import timedelta
from typing import Any

import numpy as np
import shapely
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray

from fleet2d.floorplan.geometry.lattice import Lattice
from fleet2d.kernels.mesh import Mesh
from fleet2d.palette import ACCENT_COLOR, TEXT_COLOR, VIEW_COLOR, VIEW_EDGE
from fleet2d.runs.run import Run
from fleet2d.runs.trajectory import Trajectory
from fleet2d.view.floorplan import floorplan_axes
from fleet2d.view.life import RIM_COLOR, field_of_view
from fleet2d.view.page import QUIET_COLOR
from fleet2d.viewer.contract import BodyFacts
from fleet2d.viewer.part import part_of_run
from fleet2d.viewer.run_facts import bodies_of
from fleet2d.viewer.strip import draw_strip, strip_rows
from fleet2d.viewer.walls import WallsHistory, doors_of

BEFORE = timedelta(minutes=1)
LEAST_RADIUS_M = 0.2
NOSE = 1.6  # radii
STRIP_ROWS = 6
ABOVE_M = 0.6  # the plan


class Walled:
    """What ends sight, as regions are found in it."""

    def __init__(self, mesh: Mesh, lattice: Lattice) -> None:
        """Join both."""
        self.mesh, self.lattice = mesh, lattice


@dataclass
class Player:
    """A body on the stage: what is known of it, its poses, and what draws it."""

    facts: BodyFacts
    path: Trajectory
    spot: Circle
    nose: Any
    name: Any
    views: list[PolyCollection]
    view_key: object = None


class Stage:
    """A home with everybody in it, from one step of a run to another.

    Attributes:
        figure: What everything is drawn on.
        moving: What changes from step to step.
        every: Steps between two poses that are known.
    """

    def __init__(
        self,
        run: Run,
        first: int,
        end: int,
        axes: Axes | None = None,
        *,
        figure: Figure | None = None,
        every: int = 1,
    ) -> None:
        """Draw what stands still.

        Args:
            run: The whole run.
            first: First step that can be shown.
            end: The step before which to end.
            axes: Where to draw the plan, and nothing else; or
            figure: an empty figure, for the plan over a strip of the time between both steps.
            every: Steps between two moments that can be shown.

        Raises:
            ArtifactError: The run stored no key frames or no floor plan.
        """
        self.every, self._first = every, first
        self._run, self._plan = run, run.plan
        self._part = part_of_run(run, first, end)
        self._step_us = run.manifest["step_us"]
        self._walls = WallsHistory(run, doors_of(run))
        self._change_steps = [change["step"] for change in self._walls.changes]
        self._strip: Axes | None = None
        if axes is None:
            assert figure is not None
            axes, self._strip = self._lay_out(figure)
        self._axes, self.figure = axes, axes.figure
        floorplan_axes(self._plan, self._axes, title=False)
        _, _, _, top = self._plan.bounds
        self._axes.set_ylim(top=top + ABOVE_M)
        bodies = bodies_of(run.manifest["scenario"], run.manifest["entities"])
        self.players = [self._player(facts) for facts in bodies]
        self._ways = LineCollection([], lw=1.6, alpha=0.7, zorder=3.4)
        self._sightings = LineCollection([], lw=1.0, ls=(0, (2, 1.5)), color=VIEW_EDGE, zorder=3.6)
        for lines in (self._ways, self._sightings):
            self._axes.add_collection(lines, autolim=False)
        self._clock, self._aside = self._write_head(axes)
        self._cursor = None if self._strip is None else self._fill_strip(self._strip)
        self._seen = _Observations(self._part)
        self._scene: object = None

    @property
    def moving(self) -> list[tuple[Axes, Artist]]:
        """What bodies, their ways and their sight are drawn with, in the order of drawing."""
        parts: list[Artist] = [view for player in self.players for view in player.views]
        parts += [self._ways, self._sightings]
        for player in self.players:
            parts += [player.spot, player.nose, player.name]
        return [(self._axes, part) for part in parts]

    @property
    def ticking(self) -> list[tuple[Axes | None, Artist]]:
        """What goes on while everybody rests: the cursor of the strip, and the words above."""
        cursor = [] if self._cursor is None else [(self._strip, self._cursor)]
        return [*cursor, (None, self._clock), (None, self._aside)]

    def show(self, step: int) -> bool:
        """Move everything to where it was at a step of the run; return whether anybody moved."""
        index = (step - self._first) // self.every
        before = self._scene
        poses = [self._place(player, index, step) for player in self.players]
        views = [player.view_key for player in self.players]
        lines = [way.tobytes() for way in self._draw_ways(index)]
        self._scene = (poses, views, lines, self._draw_sightings(step, index))
        path = self.players[0].path if self.players else None
        if path is not None:
            when = path.time[index]
            if self._cursor is not None:
                self._cursor.set_xdata([when, when])
            moment = when.astype(object)
            self._clock.set_text(f"{moment:%a} {moment.day} {moment:%b %H:%M}")
        away = [p.facts["name"] for p in self.players if p.path.away[index]]
        self._aside.set_text(f"away: {', '.join(away)}" if away else "")
        return self._scene != before

    def changes(self) -> NDArray[np.bool_]:
        """Return at which moments anything is other than at the one before, bool (moments,)."""
        if not self.players:
            return np.ones(1, np.bool_)
        changed = np.zeros(len(self.players[0].path.step), np.bool_)
        for player in self.players:
            path = player.path
            for values in (path.x, path.y, path.heading, path.away):
                changed[1:] |= values[1:] != values[:-1]
        minute = self.players[0].path.time.astype("M8[m]")
        changed[1:] |= minute[1:] != minute[:-1]
        changed[0] = True
        return changed

    def _write_head(self, axes: Axes) -> tuple[Any, Any]:
        """Return the texts above the plan: the clock, and who is away."""
        write, style, high = self.figure.text, dict[str, Any](va="top"), 0.975
        if self._strip is None:
            write, high = axes.text, 1.0
            style = {"va": "bottom", "transform": axes.transAxes}
        clock = write(0.02, high, "", fontsize=13, weight="bold", color=TEXT_COLOR, **style)
        aside = write(0.98, high, "", fontsize=9, color=QUIET_COLOR, ha="right", **style)
        return clock, aside

    def _fill_strip(self, strip: Axes) -> Any:
        """Draw the strip; return its cursor."""
        shown = [(player.facts["name"], player.facts["color"]) for player in self.players]
        rows = strip_rows(self._part, shown[:STRIP_ROWS])
        draw_strip(self._part, self._plan, rows, strip)
        return strip.axvline(0, color=ACCENT_COLOR, lw=1.2, zorder=4)

    def _lay_out(self, figure: Figure) -> tuple[Axes, Axes]:
        rows = len(self._run.manifest["entities"]["users"])
        rows += len(self._run.manifest["entities"]["robots"])
        height = 0.075 + 0.032 * min(rows, STRIP_ROWS)
        plan = figure.add_axes((0.0, height, 1.0, 0.94 - height))
        strip = figure.add_axes((0.09, 0.055, 0.88, height - 0.06))
        return plan, strip

    def _player(self, facts: BodyFacts) -> Player:
        every = timedelta(microseconds=self._step_us * self.every)
        path = self._part.path(facts["name"], every)
        color = facts["color"]
        radius = max(facts["radius"], LEAST_RADIUS_M)
        spot = Circle((0, 0), radius, facecolor=color, edgecolor="white", lw=0.9, zorder=4.3)
        self._axes.add_patch(spot)
        (nose,) = self._axes.plot([], [], color=color, lw=2.2, zorder=4.2, solid_capstyle="round")
        name = self._axes.text(0, 0, facts["name"], fontsize=8.5, weight="bold", color=color)
        name.set(ha="center", va="bottom", zorder=5, clip_on=True)
        name.set_path_effects([withStroke(linewidth=2.0, foreground=RIM_COLOR)])
        views = [PolyCollection([], facecolors=VIEW_COLOR, alpha=0.4, zorder=2.2) for _ in range(2)]
        views[1].set(facecolor="none", edgecolor=VIEW_EDGE, lw=0.8, alpha=1.0, zorder=3.2)
        for view in views if facts["cameras"] else ():
            self._axes.add_collection(view, autolim=False)
        return Player(facts, path, spot, nose, name, views if facts["cameras"] else [])

    def _place(self, player: Player, index: int, step: int) -> tuple[float, float, float] | None:
        """Move a body to where it is; return its pose, None while it is away."""
        path = player.path
        x, y, heading = float(path.x[index]), float(path.y[index]), float(path.heading[index])
        there = not bool(path.away[index])
        for part in (player.spot, player.nose, player.name, *player.views):
            part.set_visible(there)
        if not there:
            return None
        radius = player.spot.get_radius()
        player.spot.center = (x, y)
        player.nose.set_data(
            [x, x + NOSE * radius * np.cos(heading)], [y, y + NOSE * radius * np.sin(heading)]
        )
        player.name.set_position((x, y + 1.5 * radius))
        if player.views:
            self._look(player, (x, y, heading), step)
        return x, y, heading

    def _look(self, player: Player, pose: tuple[float, float, float], step: int) -> None:
        """Draw what the cameras of a body have in view, if that changed."""
        number = int(np.searchsorted(self._change_steps, step, side="right")) - 1
        walls = self._walls.changes[max(0, number)]["walls"]
        key = (pose, walls, self._pans(player.facts, step))
        if key == player.view_key:
            return
        player.view_key = key
        walled = Walled(self._walls.mesh(walls), self._plan.lattice)
        outlines = list(self._outlines(player.facts, pose, walled, step))
        for view in player.views:
            view.set_verts(outlines)

    def _pans(self, facts: BodyFacts, step: int) -> tuple[float, ...]:
        return tuple(
            camera["pan"][step * self._step_us // camera["pan_us"] % len(camera["pan"])]
            if camera["pan"]
            else 0.0
            for camera in facts["cameras"]
        )

    def _outlines(
        self, facts: BodyFacts, pose: tuple[float, float, float], walled: Walled, step: int
    ) -> Iterator[NDArray[np.float64]]:
        x, y, heading = pose
        pans = self._pans(facts, step)
        for camera, pan in zip(facts["cameras"], pans, strict=True):
            forward, left = camera["forward"], camera["left"]
            eye = np.array(
                [
                    x + forward * np.cos(heading) - left * np.sin(heading),
                    y + forward * np.sin(heading) + left * np.cos(heading),
                ]
            )
            reach = {
                "range": (camera["near"], camera["far"]),
                "angle_deg": float(np.rad2deg(camera["angle"])),
            }
            seen = field_of_view(walled, eye, heading + camera["heading"] + pan, reach)
            for part in shapely.get_parts(seen):
                yield shapely.get_coordinates(part.exterior)

    def _draw_ways(self, index: int) -> list[NDArray[np.float64]]:
        """Draw the ways of the last minute; return them."""
        back = max(1, BEFORE // timedelta(microseconds=self._step_us * self.every))
        begin = max(0, index - back)
        ways, colors = [], []
        for player in self.players:
            path = player.path
            here = ~path.away[begin : index + 1]
            xy = np.stack([path.x[begin : index + 1], path.y[begin : index + 1]], axis=1)[here]
            if len(xy) > 1 and (xy != xy[0]).any():
                ways.append(xy)
                colors.append(player.spot.get_facecolor())
        self._ways.set_segments(ways)
        self._ways.set_color(colors or "none")
        return ways

    def _draw_sightings(self, step: int, index: int) -> list[Any]:
        """Draw lines from robots to whom they notice; return them."""
        at = {p.facts["name"]: (p.path.x[index], p.path.y[index]) for p in self.players}
        seen = self._seen.between(step - self._first, step - self._first + self.every)
        lines = [[at[robot], xy] for robot, xy in seen if robot in at]
        self._sightings.set_segments(lines)
        return lines


class _Observations:
    """What robots noticed, by step."""

    def __init__(self, part: Run) -> None:
        self._step = np.zeros(0, np.int64)
        if "observations" not in part.tables:
            return
        table = part.tables["observations"]
        self._step = table["step"].to_numpy()
        self._robot = table["robot"].cast("string").to_numpy(zero_copy_only=False)
        self._xy = np.stack([table["x"].to_numpy(), table["y"].to_numpy()], axis=1)

    def between(self, first: int, end: int) -> list[tuple[str, tuple[float, float]]]:
        """Return robot and perceived place of the observations from one step to before another."""
        low, high = np.searchsorted(self._step, [first, end]).tolist()
        places = {
            (str(self._robot[i]), round(float(self._xy[i, 0]), 2), round(float(self._xy[i, 1]), 2))
            for i in range(low, high)
        }
        return [(robot, (x, y)) for robot, x, y in sorted(places)]
