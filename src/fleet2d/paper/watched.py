"""Drawing frames of a running simulation, without a window: a frame is an array of pixels.

The floor plan is drawn once and stored as pixels. A frame copies it, and draws the bodies and the
regions that robots see on it.
"""

import time
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from fleet2d.errors import extra

if TYPE_CHECKING:
    from fleet2d.engine.simulation import Simulation
    from fleet2d.kernels import F64, U8

SECONDS_PER_HOUR = 3600


@dataclass(frozen=True)
class FrameSeries:
    """The frames of the bundled base scenario to draw.

    Attributes:
        unit: The simulated time between two frames, as a noun.
        period_s: The same [s].
        count: The number of frames.
        from_hour: The hour of the first day at which they start.
    """

    unit: str
    period_s: int
    count: int
    from_hour: int = 0

    def shorter(self) -> "FrameSeries":
        """Return the series with 100 frames."""
        return replace(self, count=100)


# An evening hour, second by second; and two days, minute by minute.
FRAMES = (FrameSeries("second", 1, 3600, from_hour=18), FrameSeries("minute", 60, 2880))


class LiveView:
    """Pictures of the home with everybody in it, at the current step of a simulation.

    Example:
        >>> from fleet2d.engine.simulation import Simulation
        >>> simulation = Simulation("bundled:base", "simulation.duration=1 h", seed=4)
        >>> view = LiveView(simulation, width=320)
        >>> simulation.advance(60)
        >>> view.frame().shape[1:]
        (320, 4)
    """

    def __init__(self, simulation: "Simulation", width: int = 960) -> None:
        """Draw the floor plan.

        Args:
            simulation: The simulation to draw.
            width: The width of the picture [pixels].

        Raises:
            InputError: matplotlib is missing.
        """
        with extra("viz", "drawing needs matplotlib"):
            from matplotlib.backends.backend_agg import FigureCanvasAgg
            from matplotlib.figure import Figure
        from fleet2d.pictures.floorplan import figure_size, floorplan_axes

        self.simulation = simulation
        plan = simulation.home.plan
        size = figure_size(plan)
        figure = Figure(figsize=size, dpi=width / size[0])
        self._canvas: Any = FigureCanvasAgg(figure)
        self._axes: Any = figure.add_axes((0, 0, 1, 1))
        floorplan_axes(plan, self._axes, title=False)
        self._canvas.draw()
        self._background = self._canvas.copy_from_bbox(figure.bbox)
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
        self._poses: dict[str, tuple[float, float, float]] = {}

    def frame(self) -> "U8":
        """Return the picture of the current step: RGBA, uint8 (height, width, 4)."""
        self._canvas.restore_region(self._background)
        state = self.simulation.state
        for name, view in self._views.items():
            robot = state[name]
            pose = (robot["x"], robot["y"], robot["heading"])
            if self._poses.get(name) != pose:  # the region changes with the pose only
                self._poses[name] = pose
                view.set_xy(self._outline(name, *pose))
            if not robot["away"]:
                self._axes.draw_artist(view)
        for name, body in self._bodies.items():
            if not state[name]["away"]:
                body.center = (state[name]["x"], state[name]["y"])
                self._axes.draw_artist(body)
        return np.asarray(self._canvas.buffer_rgba())

    def _outline(self, name: str, x: float, y: float, heading: float) -> "F64":
        """Return the outline of the largest visible part, float64 (n, 2) [m]."""
        import shapely

        from fleet2d.pictures.life import SightWalls, field_of_view

        home = self.simulation.home
        camera = self.simulation.scenario.robots[name].camera
        assert camera is not None
        lens = {"range": camera.range, "angle_deg": camera.angle_deg}
        region = field_of_view(SightWalls.of(home), np.array([x, y]), heading, lens)
        parts = shapely.get_parts(region).tolist()
        if not parts:
            return np.zeros((3, 2))
        largest = max(parts, key=lambda part: float(part.area))
        return shapely.get_coordinates(largest.exterior)


def time_frames(series: FrameSeries) -> dict[str, float]:
    """Draw frames of the base scenario; return the wall time and simulated over wall time.

    Set-up and simulated time before the first frame don't count.
    """
    from fleet2d.engine.simulation import Simulation

    duration_s = series.from_hour * SECONDS_PER_HOUR + series.count * series.period_s
    simulation = Simulation("bundled:base", f"simulation.duration={max(duration_s, 60)} s", seed=4)
    simulation.advance(series.from_hour * SECONDS_PER_HOUR)
    view = LiveView(simulation)
    view.frame()
    start_s = time.perf_counter()
    for _ in range(series.count):
        simulation.advance(series.period_s)
        view.frame()
    seconds = time.perf_counter() - start_s
    simulation.finish("interrupted")
    return {"seconds": seconds, "speedup": series.count * series.period_s / seconds}
