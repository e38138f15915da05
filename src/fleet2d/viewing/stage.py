"""A home with everyone in it at a step of a run, and a strip of time with a row for each body."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import timedelta
from operator import itemgetter
from typing import Any, NamedTuple

import matplotlib.dates as mdates
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import Collection, LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from matplotlib.text import Text
from numpy.typing import NDArray

from fleet2d.floorplan.plan import FloorPlan
from fleet2d.interactions.interaction import Outcome
from fleet2d.kernels import F64, I64, Bool
from fleet2d.palette import ACCENT_COLOR, TEXT_COLOR, VIEW_COLOR, VIEW_EDGE, deep_color
from fleet2d.runs.moments import part_of_run
from fleet2d.runs.run import Run
from fleet2d.runs.trajectory import Trajectory
from fleet2d.runtime.clock import Clock
from fleet2d.runtime.events import EventKind
from fleet2d.runtime.local_time import rules_of
from fleet2d.viewing.contract import BodyFacts, CameraFacts
from fleet2d.viewing.home_facts import WallsHistory
from fleet2d.viewing.look import body_label, room_labels
from fleet2d.viewing.night import Key, Light
from fleet2d.viewing.pictures.floorplan import (
    CENTERED,
    LETTER_WIDTH,
    directions,
    floorplan_axes,
    points_per_m,
)
from fleet2d.viewing.pictures.life import (
    HATCH_COLOR,
    QUIET_COLOR,
    RIM_COLOR,
    SightWalls,
    field_of_view,
    outlines_of,
)
from fleet2d.viewing.postures import Postures
from fleet2d.viewing.run_facts import bodies_of, sightings_of

Corners = list[tuple[float, float]]

AWAY_COLOR = "#f1f2f4"
SEEN_PART = 0.22  # height of the marks of sightings at the foot of a row, as a share of it
ROW_PART = 0.86
MAX_SAMPLES = 100_000
LABEL_PART = 0.05  # stretches longer than this share of the strip have the name of their room


def draw_strip(run: Run, plan: FloorPlan, bodies: Sequence[BodyFacts], axes: Axes) -> None:
    """Draw a strip of time: a row for each body, coloured by the room that it is in.

    Long stretches have the names of their rooms.

    Args:
        run: The run, or a part of one.
        plan: Its home.
        bodies: The bodies.
        axes: The axes to draw on; their limits are set.

    Raises:
        ArtifactError: The run stored no key frames.
    """
    clock = run.clock
    interval = timedelta(microseconds=clock.step_us * -(-clock.steps // MAX_SAMPLES))
    begin, end = mdates.date2num(clock.stamps(np.array([0, clock.steps]))).tolist()
    boxes: list[Corners] = []
    colors: list[str] = []
    labels = room_labels(plan.rooms)
    for number, body in enumerate(bodies):
        path = run.path(body["name"], interval)
        for start, stop, room in _stretches(path, clock, end):
            boxes.append(_corners(start, number, stop, number + ROW_PART))
            colors.append(deep_color(plan.rooms[room].type) if room >= 0 else AWAY_COLOR)
            if room >= 0 and stop - start > LABEL_PART * (end - begin):
                style = {**CENTERED, "color": TEXT_COLOR, "fontsize": 6.5, "clip_on": True}
                axes.text((start + stop) / 2, number + 0.42, labels[room], **style)
    rows = PolyCollection(boxes, facecolors=colors, lw=0, zorder=1)
    axes.add_collection(rows, autolim=False)
    _mark_sightings(run, [body["name"] for body in bodies], axes)
    axes.set(xlim=(begin, end), ylim=(len(bodies), -0.05))
    _label(axes, bodies, clock)


def _corners(left: float, low: float, right: float, high: float) -> Corners:
    return [(left, low), (right, low), (right, high), (left, high)]


def _stretches(path: Trajectory, clock: Clock, end: float) -> list[tuple[float, float, int]]:
    """Return start, end and room, -1 while away, of the stretches in rooms; matplotlib's times."""
    cuts = np.append(0, np.flatnonzero(np.diff(path.room)) + 1)
    begins = mdates.date2num(clock.stamps(path.step[cuts])).tolist()
    ends = [*begins[1:], end]
    return list(zip(begins, ends, path.room[cuts].tolist(), strict=True))


def _mark_sightings(run: Run, names: Sequence[str], axes: Axes) -> None:
    """Mark at the foot of a user's row when robots noticed the user."""
    start = run.clock.stamp(0)
    step = np.timedelta64(run.manifest["step_us"], "us")
    boxes = []
    for lane in sightings_of(run):
        if lane["user"] not in names:
            continue
        foot = names.index(lane["user"]) + ROW_PART
        begins = mdates.date2num(start + np.array(lane["first"]) * step)
        ends = mdates.date2num(start + (np.array(lane["last"]) + 1) * step)
        for begin, end in zip(begins.tolist(), ends.tolist(), strict=True):
            boxes.append(_corners(begin, foot - SEEN_PART, end, foot))
    marks = PolyCollection(boxes, facecolors=TEXT_COLOR, lw=0, zorder=2)
    axes.add_collection(marks, autolim=False)


def _label(axes: Axes, bodies: Sequence[BodyFacts], clock: Clock) -> None:
    zone = clock.zone and rules_of(clock.zone.label)
    locator = mdates.AutoDateLocator(tz=zone, minticks=3, maxticks=10)
    axes.xaxis.set_major_locator(locator)
    axes.xaxis.set_major_formatter(mdates.ConciseDateFormatter(locator, tz=zone))
    axes.xaxis.get_offset_text().set_visible(False)
    names = [body_label(body["name"]) for body in bodies]
    axes.set_yticks(np.arange(len(bodies)) + ROW_PART / 2, names)
    axes.tick_params(length=0, labelsize=7.5, labelcolor=QUIET_COLOR, pad=3)
    for label, body in zip(axes.get_yticklabels(), bodies, strict=True):
        label.set(color=body["color"], fontweight="bold")
    axes.spines[:].set_visible(False)
    axes.grid(axis="x", color=HATCH_COLOR, lw=0.4, zorder=0)


TAIL = timedelta(minutes=1)  # length of the paths behind bodies
MIN_RADIUS_M = 0.2
CIRCLE = directions(np.linspace(0, 2 * np.pi, 48, endpoint=False))  # a unit circle
LYING = 2.6  # length of somebody who lies, as a share of the width
NOSE = 1.6  # length of the line of the heading [radii]
STRIP_ROWS = 6
ABOVE_M = 0.6  # space above the plan
NAME_PT = 8.5
BOLD_WIDTH = 0.72  # the width of a bold letter, as a share of its size
LINE_HEIGHT = 1.2  # a share of the size of the letters

Box = tuple[float, float, float, float]
"""Left, bottom, right and top of a text [m]."""


# The outcomes of requests and questions as they are shown.
SHOWN_AS = {
    Outcome.ACCEPTED: Outcome.ACCEPTED,
    Outcome.DEFERRED: Outcome.DEFERRED,
    Outcome.DECLINED: Outcome.DECLINED,
    Outcome.SENT_AWAY: "sent away",
    Outcome.BANNED: "sent away",
    Outcome.SWITCHED_OFF: "sent away",
}
# Events that end the time of a robot with the person whom it addressed.
ENDS_TALK = frozenset(
    {EventKind.DELIVERED, EventKind.COLLECTS, EventKind.WITHDRAWS, EventKind.INTERACTION_OVER}
)


class AskedTime(NamedTuple):
    """A time at which a robot addressed a person.

    Attributes:
        robot: The robot.
        text: The interaction and the person meant.
        step: The step at which it did.
        answer: The outcome in words.
        answered: The step of the answer; None without one.
        end: The step at which the robot had carried it out or withdrew; None if it did neither.
    """

    robot: str
    text: str
    step: int
    answer: str
    answered: int | None = None
    end: int | None = None


def asked_of(run: Run) -> list[AskedTime]:
    """Return the times that robots addressed people, by the events.

    Example:
        >>> import fleet2d
        >>> asked_of(fleet2d.run("simulation.duration=1 h"))
        []
    """
    events = run.tables["events"]
    asked: list[AskedTime] = []
    open_ones: dict[str, AskedTime] = {}  # keys are robots
    columns = (events[name].to_pylist() for name in ("step", "entity", "event", "detail"))
    rows = sorted(zip(*columns, strict=True), key=itemgetter(0))
    for step, robot, event, detail in rows:
        if event in ENDS_TALK and robot in open_ones:
            asked.append(open_ones.pop(robot)._replace(end=step))
        elif event == EventKind.ASKS:
            if robot in open_ones:
                asked.append(open_ones.pop(robot))
            open_ones[robot] = AskedTime(robot, detail, step, "no answer")
        elif event in SHOWN_AS and robot in open_ones and open_ones[robot].answered is None:
            open_ones[robot] = open_ones[robot]._replace(answer=SHOWN_AS[event], answered=step)
    return [*asked, *open_ones.values()]


@dataclass
class BodyArtists:
    """A body on the stage: its facts, its path, its name, and the outlines of what it sees [m].

    All bodies are drawn by the same few artists: each artist costs more than what it draws.
    """

    facts: BodyFacts
    path: Trajectory
    radius: float
    name: Any
    views: list[F64]
    place: tuple[float, float] = (0.0, 0.0)
    view_key: object = None
    lies: bool = False


class Stage:
    """A home with everybody in it, from one step of a run to another.

    Attributes:
        figure: The figure.
        stride: The number of steps between consecutive frames.
        bodies: The users and robots.
    """

    def __init__(
        self,
        run: Run,
        first: int,
        end: int,
        axes: Axes | None = None,
        *,
        figure: Figure | None = None,
        stride: int = 1,
    ) -> None:
        """Draw everything that doesn't move.

        Args:
            run: The whole run.
            first: The first step that can be shown.
            end: The step after the last that can be shown.
            axes: Axes for the plan alone; None with a figure.
            figure: An empty figure for the plan and a strip of the time between both steps.
            stride: The number of steps between consecutive frames.

        Raises:
            ArtifactError: The run stored no key frames or no floor plan.
        """
        self.stride = stride
        self._first = first
        self._run = run
        self._plan = run.plan
        self._part = part_of_run(run, first, end)
        self._step_us = run.manifest["step_us"]
        self._walls = WallsHistory(run)
        self._change_steps = [change["step"] for change in self._walls.changes]
        self._strip: Axes | None = None
        if axes is None:
            assert figure is not None
            axes, self._strip = self._lay_out(figure)
        self._axes = axes
        self.figure = axes.figure
        floorplan_axes(self._plan, self._axes, title=False)
        _, _, _, top = self._plan.bounds
        self._axes.set_ylim(top=top + ABOVE_M)
        self._letter_m = NAME_PT / points_per_m(self._axes)
        self._room_names = [_box_of(text, self._letter_m / NAME_PT) for text in self._axes.texts]
        facts_of_bodies = bodies_of(run.manifest["scenario"], run.manifest["entities"])
        self.bodies = [self._artists(facts) for facts in facts_of_bodies]
        self._postures = Postures(run, self._plan)
        self._light = Light(run, self._plan, facts_of_bodies, self._axes)
        self._views = PolyCollection([], facecolors=VIEW_COLOR, alpha=0.4, zorder=2.2)
        self._edges = PolyCollection(
            [], facecolors="none", edgecolors=VIEW_EDGE, lw=0.8, zorder=3.2
        )
        self._paths = LineCollection([], lw=1.6, alpha=0.7, zorder=3.4)
        self._sightings = LineCollection([], lw=1.0, ls=(0, (2, 1.5)), color=VIEW_EDGE, zorder=3.6)
        self._noses = LineCollection([], lw=2.2, zorder=4.2, capstyle="round")
        self._discs = PolyCollection([], edgecolors="white", lw=0.9, zorder=4.3)
        for artist in self._collections:
            self._axes.add_collection(artist, autolim=False)
        self._clock, self._away = self._write_head(axes)
        self._cursor = None if self._strip is None else self._fill_strip(self._strip)
        self._observed = _observations(self._part)
        has_talks = bool(run.manifest["scenario"].get("interactions"))
        self._talks = [each for each in asked_of(run) if each.step < end] if has_talks else []
        self._scene: object = None

    @property
    def _collections(self) -> list[Collection]:
        """The artists of all bodies, except their names, in the order of drawing."""
        below = [self._views, self._edges, self._paths, self._sightings]
        return [*below, self._noses, self._discs]

    @property
    def body_artists(self) -> list[Artist]:
        """The artists of bodies, of their paths and views, as they are drawn over the light."""
        return [*self._collections, *(body.name for body in self.bodies)]

    @property
    def light_artists(self) -> list[Artist]:
        """The artists of the light, which changes less often than bodies move."""
        return [self._light.image, self._light.walls]

    @property
    def light_key(self) -> Key:
        """The key of the light that is shown."""
        return self._light.key

    @property
    def clock_artists(self) -> list[Artist]:
        """The artists that change while nobody moves: the cursor of the strip, and the texts."""
        return [*filter(None, [self._cursor]), self._clock, self._away]

    def show(self, step: int) -> bool:
        """Show a step of the run; return whether any body, path or view differs from before."""
        index = (step - self._first) // self.stride
        last_scene = self._scene
        names = [self._name(body, step) for body in self.bodies]
        poses = [self._place(body, index, step) for body in self.bodies]
        self._draw_bodies(poses)
        self._place_names()
        here = {body.facts["name"]: int(body.path.room[index]) for body in self.bodies}
        self._light.show(step, here)
        views = [body.view_key for body in self.bodies]
        lines = [line.tobytes() for line in self._draw_paths(index)]
        sightings = self._draw_sightings(step, index)
        self._scene = (names, poses, views, lines, sightings, self._light.key)
        path = self.bodies[0].path if self.bodies else None
        if path is not None:
            time = path.time[index]
            if self._cursor is not None:
                self._cursor.set_xdata([time, time])
            moment = time.astype(object)
            self._clock.set_text(f"{moment:%a} {moment.day} {moment:%b %H:%M}")
        away = [body_label(body.facts["name"]) for body in self.bodies if body.path.away[index]]
        self._away.set_text(f"away: {', '.join(away)}" if away else "")
        return self._scene != last_scene

    def changes(self) -> Bool:
        """Return whether each moment differs from the one before: bool (moments,)."""
        if not self.bodies:
            return np.ones(1, np.bool_)
        changed = np.zeros(len(self.bodies[0].path.step), np.bool_)
        for body in self.bodies:
            path = body.path
            for values in (path.x, path.y, path.heading, path.away):
                changed[1:] |= values[1:] != values[:-1]
        minute = self.bodies[0].path.time.astype("M8[m]")
        changed[1:] |= minute[1:] != minute[:-1]
        for talk in self._talks:
            for step in (talk.step, talk.answered, self._end_of(talk) + 1):
                # The first moment that is not before the step.
                if step is not None and 0 <= (number := -((self._first - step) // self.stride)):
                    changed[number : number + 1] = True
        changed[0] = True
        return changed

    def _write_head(self, axes: Axes) -> tuple[Any, Any]:
        """Return the texts above the plan: the clock, and the names of those who are away."""
        write = self.figure.text
        style = dict[str, Any](va="top")
        high = 0.975
        if self._strip is None:
            write = axes.text
            high = 1.0
            style = {"va": "bottom", "transform": axes.transAxes}
        clock = write(0.02, high, "", fontsize=13, weight="bold", color=TEXT_COLOR, **style)
        away = write(0.98, high, "", fontsize=9, color=QUIET_COLOR, ha="right", **style)
        return clock, away

    def _fill_strip(self, strip: Axes) -> Any:
        """Draw the strip; return its cursor."""
        bodies = [body.facts for body in self.bodies[:STRIP_ROWS]]
        draw_strip(self._part, self._plan, bodies, strip)
        return strip.axvline(0, color=ACCENT_COLOR, lw=1.2, zorder=4)

    def _lay_out(self, figure: Figure) -> tuple[Axes, Axes]:
        rows = sum(map(len, self._run.manifest["entities"].values()))
        height = 0.075 + 0.032 * min(rows, STRIP_ROWS)
        plan = figure.add_axes((0.0, height, 1.0, 0.94 - height))
        strip = figure.add_axes((0.09, 0.055, 0.88, height - 0.06))
        return plan, strip

    def _artists(self, facts: BodyFacts) -> BodyArtists:
        interval = timedelta(microseconds=self._step_us * self.stride)
        path = self._part.path(facts["name"], interval)
        name = self._axes.text(0, 0, body_label(facts["name"]), fontsize=NAME_PT, weight="bold")
        name.set(color=facts["color"], ha="center", va="bottom", zorder=5, clip_on=True)
        name.set_path_effects([withStroke(linewidth=2.0, foreground=RIM_COLOR)])
        return BodyArtists(facts, path, max(facts["radius"], MIN_RADIUS_M), name, [])

    def _name(self, body: BodyArtists, step: int) -> str:
        """Write what a robot asks, and what is answered, beside its name; return the text."""
        name = body.facts["name"]
        label = body_label(name)
        text = label
        for talk in self._talks:
            if talk.robot == name and talk.step <= step <= self._end_of(talk):
                is_answered = talk.answered is not None and talk.answered <= step
                answer = f", {talk.answer}" if is_answered else "?"
                text = f"{label}: {talk.text}{answer}"
        body.name.set_text(text)
        return text

    def _end_of(self, talk: AskedTime) -> int:
        """Return the last step of a talk; without an end, that a minute after its last word."""
        if talk.end is not None:
            return talk.end
        last = talk.step if talk.answered is None else talk.answered
        return last + 60_000_000 // self._step_us

    def _place(self, body: BodyArtists, index: int, step: int) -> tuple[float, float, float] | None:
        """Move the name of a body; return its pose, None while it is away."""
        path = body.path
        x = float(path.x[index])
        y = float(path.y[index])
        heading = float(path.heading[index])
        is_home = not bool(path.away[index])
        body.name.set_visible(is_home)
        if not is_home:
            body.views = []
            body.view_key = None
            return None
        rest = self._postures.at(body.facts["name"], step * self._step_us)
        body.lies = rest is not None and rest["posture"] == "lie"
        if rest is not None:
            x = rest["x"]
            y = rest["y"]
            heading = rest["heading"]
        body.place = (x, y)
        if body.facts["cameras"]:
            self._look(body, (x, y, heading), step)
        return x, y, heading

    def _place_names(self) -> None:
        """Write each name where it covers no body and no other name: above, else around it."""
        here = [body for body in self.bodies if body.name.get_visible()]
        taken = [*self._room_names]
        for body in here:
            x, y = body.place
            r = body.radius
            taken.append((x - r, y - r, x + r, y + r))
        tall = LINE_HEIGHT * self._letter_m
        for body in here:
            x, y = body.place
            half_wide = BOLD_WIDTH * len(body.name.get_text()) * self._letter_m / 2
            off = 1.4 * body.radius
            beside = off + half_wide
            places = [
                (x, y + off),
                (x, y - off - tall),
                (x + beside, y - tall / 2),
                (x - beside, y - tall / 2),
                (x, y + off + tall),
            ]
            boxes = [(px - half_wide, py, px + half_wide, py + tall) for px, py in places]
            free = (number for number, box in enumerate(boxes) if _is_free(box, taken))
            chosen = next(free, 0)
            body.name.set_position(places[chosen])
            taken.append(boxes[chosen])

    def _draw_bodies(self, poses: Sequence[tuple[float, float, float] | None]) -> None:
        """Draw bodies at their poses, and what they see; None for those who are away."""
        here = [(body, pose) for body, pose in zip(self.bodies, poses, strict=True) if pose]
        colors = [body.facts["color"] for body, _ in here] or "none"
        radius = np.array([body.radius for body, _ in here]).reshape(-1, 1, 1)
        place = np.array([pose for _, pose in here]).reshape(-1, 1, 3)
        facing = directions(place[..., 2])
        centre = place[..., :2]
        tips = centre + NOSE * radius * facing
        self._noses.set(segments=np.append(centre, tips, axis=1))
        self._noses.set_color(colors)
        lengths = [LYING if body.lies else 1.0 for body, _ in here]
        stretch = np.array(lengths).reshape(-1, 1, 1)
        beside = np.stack([-facing[..., 1], facing[..., 0]], axis=2)
        around = CIRCLE[:, :1] * stretch * facing + CIRCLE[:, 1:] * beside
        self._discs.set(verts=centre + radius * around, facecolor=colors)
        outlines = [outline for body in self.bodies for outline in body.views]
        for artist in (self._views, self._edges):
            artist.set_verts(outlines)

    def _look(self, body: BodyArtists, pose: tuple[float, float, float], step: int) -> None:
        """Set the regions that the cameras of a body see, if they changed."""
        number = int(np.searchsorted(self._change_steps, step, side="right")) - 1
        walls = self._walls.changes[max(0, number)]["walls"]
        pans = tuple(self._pan(camera, step) for camera in body.facts["cameras"])
        key = (pose, walls, pans)
        if key == body.view_key:
            return
        body.view_key = key
        body.views = []
        sight = SightWalls(self._walls.mesh(walls), self._plan.lattice)
        x, y, heading = pose
        ahead = np.array([np.cos(heading), np.sin(heading)])
        beside = np.array([-ahead[1], ahead[0]])
        for camera, pan in zip(body.facts["cameras"], pans, strict=True):
            eye = np.array([x, y]) + camera["forward"] * ahead + camera["left"] * beside
            angle_deg = float(np.rad2deg(camera["angle"]))
            lens = {"range": (camera["near"], camera["far"]), "angle_deg": angle_deg}
            region = field_of_view(sight, eye, heading + camera["heading"] + pan, lens)
            body.views += outlines_of(region)

    def _pan(self, camera: CameraFacts, step: int) -> float:
        """Return how far a camera is turned from its middle [rad]."""
        pans = camera["pan"]
        if not pans:
            return 0.0
        turns = step * self._step_us // camera["pan_us"]
        return pans[turns % len(pans)]

    def _draw_paths(self, index: int) -> list[F64]:
        """Draw the paths of the last minute; return them, each float64 (n, 2) [m]."""
        moments = max(1, TAIL // timedelta(microseconds=self._step_us * self.stride))
        span = slice(max(0, index - moments), index + 1)
        lines = []
        colors = []
        for body in self.bodies:
            path = body.path
            every = np.stack([path.x[span], path.y[span]], axis=1)
            xy = every[~path.away[span]]
            if len(xy) > 1 and (xy != xy[0]).any():
                lines.append(xy)
                colors.append(body.facts["color"])
        self._paths.set_segments(lines)
        self._paths.set_color(colors or "none")
        return lines

    def _draw_sightings(self, step: int, index: int) -> list[Any]:
        """Draw lines from robots to the places where they notice users; return them."""
        xy = {b.facts["name"]: (b.path.x[index], b.path.y[index]) for b in self.bodies}
        steps, robots, places = self._observed
        begin = step - self._first
        first, end = np.searchsorted(steps, [begin, begin + self.stride]).tolist()
        seen_at = map(tuple, places[first:end].round(2).tolist())
        seen = set(zip(robots[first:end], seen_at, strict=True))
        lines = [[xy[robot], place] for robot, place in sorted(seen) if robot in xy]
        self._sightings.set_segments(lines)
        return lines


def _box_of(text: Text, point_m: float) -> Box:
    """Return the box of a text in the middle of its place, for a size of a point [m]."""
    x, y = text.get_position()
    lines = text.get_text().split("\n")
    size = float(text.get_fontsize()) * point_m
    half_wide = LETTER_WIDTH * max(map(len, lines)) * size / 2
    half_tall = LINE_HEIGHT * len(lines) * size / 2
    return x - half_wide, y - half_tall, x + half_wide, y + half_tall


def _is_free(box: Box, taken: Iterable[Box]) -> bool:
    """Return whether a box overlaps no other one."""
    left, bottom, right, top = box
    return not any(
        left < other_right and other_left < right and bottom < other_top and other_bottom < top
        for other_left, other_bottom, other_right, other_top in taken
    )


def _observations(part: Run) -> tuple[I64, NDArray[Any], F64]:
    """Return the steps of robots' observations, in order, the robots, and the places (n, 2) [m]."""
    if "observations" not in part.tables:
        return np.zeros(0, np.int64), np.zeros(0, object), np.zeros((0, 2))
    from fleet2d.artifacts.arrow import values_of

    table = part.tables["observations"]
    places = np.stack([values_of(table["x"]), values_of(table["y"])], axis=1)
    return values_of(table["step"]), values_of(table["robot"]), places
