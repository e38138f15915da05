"""Watching a run live: the simulation goes on by a frame, and the scene is drawn anew.

The floor plan is drawn once and kept as pixels; a frame copies it, and draws bodies and what robots
see on it. Nothing needs a window: a frame is an array of pixels.
"""

import time
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from fleet2d.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from fleet2d.engine.simulation import Simulation

SECONDS_PER_HOUR = 3600


@dataclass(frozen=True)
class Watching:
    """Which frames of the bundled base scenario are drawn.

    Attributes:
        words: Simulated time from frame to frame, in words.
        every_s: The same [s].
        frames: How many.
        from_hour: The hour of the first day at which watching begins.
    """

    words: str
    every_s: int
    frames: int
    from_hour: int = 0

    def shorter(self) -> "Watching":
        """Return the same of few frames."""
        return replace(self, frames=100)


# An evening hour, second by second; and two days, minute by minute.
FRAMES = (Watching("second", 1, 3600, from_hour=18), Watching("minute", 60, 2880))


class LiveView:
    """The home with everybody in it, redrawn as a simulation goes on.

    Example:
        >>> from fleet2d.engine.simulation import Simulation
        >>> simulation = Simulation("bundled:base", "simulation.duration=1 h", seed=4)
        >>> view = LiveView(simulation, width=320)
        >>> simulation.advance(60)
        >>> view.frame().shape[1:]
        (320, 4)
    """

    def __init__(self, simulation: "Simulation", width: int = 960) -> None:
        """Draw what stands still.

        Args:
            simulation: What is watched.
            width: Of the picture [pixels].

        Raises:
            InputError: matplotlib is missing.
        """
        try:
            from matplotlib.backends.backend_agg import FigureCanvasAgg
            from matplotlib.figure import Figure
        except ImportError:
            raise InputError('watching needs matplotlib: pip install "fleet2d[viz]"') from None
        from fleet2d.view.floorplan import figure_size, floorplan_axes

        self.simulation = simulation
        plan = simulation.home.plan
        wide, high = figure_size(plan)
        figure = Figure(figsize=(wide, high), dpi=width / wide)
        self._canvas: Any = FigureCanvasAgg(figure)
        self._axes: Any = figure.add_axes((0, 0, 1, 1))
        floorplan_axes(plan, self._axes, title=False)
        self._canvas.draw()
        self._ground = self._canvas.copy_from_bbox(figure.bbox)
        self._add_bodies()

    def _add_bodies(self) -> None:
        from matplotlib.patches import Circle, Polygon

        from fleet2d.palette import ROBOT_COLORS, USER_COLORS, VIEW_COLOR

        scenario = self.simulation.scenario
        self._robots = [name for name in scenario.robots if scenario.robots[name].camera]
        self._bodies, self._views = {}, {}
        for bucket, colors in ((scenario.users, USER_COLORS), (scenario.robots, ROBOT_COLORS)):
            for number, (name, entity) in enumerate(bucket.items()):
                color = colors[number % len(colors)]
                radius = max(float(entity.radius), 0.13)
                self._bodies[name] = Circle((0, 0), radius, fc=color, ec="white", lw=0.9)
        for name in self._robots:
            self._views[name] = Polygon(np.zeros((3, 2)), fc=VIEW_COLOR, ec="none", alpha=0.5)
        for artist in (*self._views.values(), *self._bodies.values()):
            artist.set_animated(True)
            self._axes.add_patch(artist)
        self._posed: dict[str, tuple[float, float, float]] = {}

    def frame(self) -> "NDArray[np.uint8]":
        """Return the picture of the present step: uint8 (height, width, 4), red to opacity."""
        self._canvas.restore_region(self._ground)
        state = self.simulation.state
        for name, view in self._views.items():
            now = state[name]
            pose = (now["x"], now["y"], now["heading"])
            if self._posed.get(name) != pose:  # what stands sees the same
                self._posed[name] = pose
                view.set_xy(self._outline(name, *pose))
            if not now["away"]:
                self._axes.draw_artist(view)
        for name, body in self._bodies.items():
            if not state[name]["away"]:
                body.center = (state[name]["x"], state[name]["y"])
                self._axes.draw_artist(body)
        pixels: NDArray[np.uint8] = np.asarray(self._canvas.buffer_rgba())
        return pixels

    def _outline(self, name: str, x: float, y: float, heading: float) -> "NDArray[np.float64]":
        """Return the largest piece of what a robot's camera sees: float64 (n, 2) [m]."""
        import shapely

        from fleet2d.view.life import field_of_view

        home = self.simulation.home
        camera = self.simulation.scenario.robots[name].camera
        assert camera is not None
        lens = {"range": camera.range, "angle_deg": camera.angle_deg}
        seen = field_of_view(_Standing(home), np.array([x, y]), heading, lens)
        pieces = shapely.get_parts(seen).tolist()
        if not pieces:
            return np.zeros((3, 2))
        largest = max(pieces, key=lambda piece: float(piece.area))
        outline: NDArray[np.float64] = shapely.get_coordinates(largest.exterior)
        return outline


class _Standing:
    """A home as sight meets it: shut doors and tall furniture count as walls."""

    def __init__(self, home: Any) -> None:
        self.mesh, self.lattice = home.walls, home.plan.lattice


def watch(watching: Watching) -> dict[str, float]:
    """Watch the base scenario; return the seconds it took and how many times real time that is.

    Set-up and what comes before the first frame don't count.
    """
    from fleet2d.engine.simulation import Simulation

    lasts = watching.from_hour * SECONDS_PER_HOUR + watching.frames * watching.every_s
    simulation = Simulation("bundled:base", f"simulation.duration={max(lasts, 60)} s", seed=4)
    simulation.advance(watching.from_hour * SECONDS_PER_HOUR)
    view = LiveView(simulation)
    view.frame()
    began = time.perf_counter()
    for _ in range(watching.frames):
        simulation.advance(watching.every_s)
        view.frame()
    seconds = time.perf_counter() - began
    simulation.finish("interrupted")
    return {"seconds": seconds, "speedup": watching.frames * watching.every_s / seconds}
