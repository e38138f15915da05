"""The light of the hour over the picture of a home, by the rules of the page.

At night only rooms in which somebody is awake are bright or, where a run switches lights, those
whose lights are on.
"""

from bisect import bisect_right
from datetime import datetime
from types import MappingProxyType
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.image import AxesImage
from matplotlib.patches import PathPatch

from fleet2d.floorplan.plan import FloorPlan
from fleet2d.kernels import F64
from fleet2d.runs.run import Run
from fleet2d.runtime.events import EventKind
from fleet2d.viewing.contract import BodyFacts
from fleet2d.viewing.look import DUSK, NIGHT
from fleet2d.viewing.pictures.floorplan import draw_cells, outline_of, walls_of
from fleet2d.viewing.run_facts import skies_of, starts_unlit

SWITCHES = MappingProxyType({EventKind.LIGHT_ON: True, EventKind.LIGHT_OFF: False})
ASLEEP = "sleep"
UNLIT_BY_DAY = 0.25
"""By day a room whose light is off is only a little darker than others."""
SHADES = 20
"""The number of steps from day to night."""

Key = tuple[float, float, frozenset[int]]


class Light:
    """The light of a run: of the sky, and in its rooms.

    Attributes:
        key: The shade, redness and lit rooms that were drawn last.
        image: The veil over the rooms.
        walls: The veil over the walls.
    """

    def __init__(self, run: Run, plan: FloorPlan, bodies: list[BodyFacts], axes: Axes) -> None:
        """Read the hours, activities and switches on which the light depends.

        Args:
            run: The run.
            plan: Its home.
            bodies: Its bodies; of these, people who are awake light rooms.
            axes: The axes to draw on, over a floor plan.
        """
        self._clock = run.clock
        self._skies = skies_of(run.manifest["scenario"], run.clock)
        self._plan = plan
        self._people = [body["name"] for body in bodies if not body["robot"]]
        self._starts_unlit = starts_unlit(run.manifest["scenario"])
        self._switched: dict[str, tuple[list[int], list[Any]]] = {}
        rows = _events(run) if bodies else []
        for row in rows:
            is_activity = row["event"] == EventKind.ACTIVITY
            key = row["entity"] if is_activity else f"light of {row['detail']}"
            steps, values = self._switched.setdefault(key, ([], []))
            steps.append(row["step"])
            values.append(row["detail"] if is_activity else SWITCHES[row["event"]])
        self._has_lights = self._starts_unlit or any(row["event"] in SWITCHES for row in rows)
        self.key: Key = (0.0, 0.0, frozenset())
        self._veil = np.zeros((*plan.free.shape, 4))
        self.image: AxesImage = draw_cells(
            plan, self._veil, axes, interpolation="nearest", zorder=1.95
        )
        self.image.set_clip_path(outline_of(plan), transform=axes.transData)
        self.walls = PathPatch(walls_of(plan), edgecolor="none", zorder=1.95)
        axes.add_patch(self.walls)

    def show(self, step: int, rooms: dict[str, int]) -> None:
        """Draw the light of a step; `rooms` has the room of each body that is at home."""
        day, dusk = sky_at(self._skies, self._clock.time(step), self._clock.start)
        shade = round(SHADES * (1 - day)) / SHADES
        lit: frozenset[int] = frozenset()
        if self._has_lights:
            lit = frozenset(room.index for room in self._plan.rooms if self._is_on(room.name, step))
            shade = max(shade, UNLIT_BY_DAY)
        elif shade:
            awake = [name for name in self._people if self._last(name, step) != ASLEEP]
            lit = frozenset(rooms[name] for name in awake if rooms.get(name, -1) >= 0)
        key = (shade, round(10 * dusk) / 10, lit)
        if key != self.key:
            self.key = key
            self._draw(*key)

    def _draw(self, shade: float, dusk: float, lit: frozenset[int]) -> None:
        self.image.set_visible(shade > 0 or dusk > 0)
        dark = np.array(to_rgba(NIGHT[0], NIGHT[1] * shade))
        red = np.array(to_rgba(DUSK[0], DUSK[1] * dusk))
        self._veil[:] = _over(red, dark)
        if lit:
            self._veil[np.isin(self._plan.room_of_place, sorted(lit))] = red
        self.image.set_data(self._veil)
        self.walls.set_facecolor(tuple(_over(red, dark).tolist()))
        self.walls.set_visible(self.image.get_visible())

    def _is_on(self, room: str, step: int) -> bool:
        is_on = self._last(f"light of {room}", step)
        return not self._starts_unlit if is_on is None else bool(is_on)

    def _last(self, key: str, step: int) -> Any:
        """Return the value of a key's last event up to a step; None if there is none yet."""
        steps, values = self._switched.get(key, ([], []))
        number = bisect_right(steps, step) - 1
        return None if number < 0 else values[number]


def sky_at(
    skies: list[tuple[float, float, float, float]], moment: datetime, start: datetime
) -> tuple[float, float]:
    """Return how bright the sky is, from 0 at night to 1 by day, and how red.

    Args:
        skies: The hours of each day around which it gets light and dark, see `skies_of`.
        moment: The local time.
        start: The local time at which the run starts.

    Example:
        >>> sky = (5.0, 7.0, 18.0, 20.0)
        >>> [sky_at([sky], datetime(2026, 1, 5, hour), datetime(2026, 1, 5)) for hour in (3, 6, 12)]
        [(0.0, 0.0), (0.5, 0.5), (1.0, 0.0)]
    """
    day = moment.toordinal() - start.toordinal()
    dark_until, light_from, light_until, dark_from = skies[min(day, len(skies) - 1)]
    hour = moment.hour + moment.minute / 60 + moment.second / 3600
    rise = (hour - dark_until) / (light_from - dark_until)
    fall = (hour - light_until) / (dark_from - light_until)
    risen = min(max(rise, 0.0), 1.0)
    fallen = min(max(fall, 0.0), 1.0)
    bright = risen * (1 - fallen)
    # Half an hour from sunrise or sunset the sky is redder than an hour away.
    away = min(abs(rise - 0.5), abs(fall - 0.5))
    return bright, 0.5 * max(0.0, 1 - away / 0.7)


def _over(upper: F64, lower: F64) -> F64:
    """Return the colour of two veils (red, green, blue, opacity), one over the other."""
    seen_below = lower[3] * (1 - upper[3])
    opacity = upper[3] + seen_below
    if not opacity:
        return np.zeros(4)
    mixed = upper[:3] * upper[3] + lower[:3] * lower[3] * (1 - upper[3])
    return np.append(mixed / opacity, opacity)


def _events(run: Run) -> list[dict[str, Any]]:
    """Return the activities of people and the switches of lights, in order."""
    if "events" not in run.tables:
        return []
    from pyarrow import compute

    from fleet2d.artifacts.arrow import string_array

    table = run.tables["events"].select(["step", "entity", "event", "detail"])
    kinds = string_array([EventKind.ACTIVITY, *SWITCHES])
    rows: list[dict[str, Any]] = table.filter(
        compute.is_in(compute.cast(table["event"], "string"), kinds)
    ).to_pylist()
    return rows
