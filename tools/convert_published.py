"""Turns a configuration of the published Fleet2D into a scenario, and lists what changed.

    python tools/convert_published.py OLD.yaml NEW.yaml

Its poses are metres in the plan's own coordinates and degrees counter-clockwise from +x, as here;
it uses pixels only to round walls and to look up free space.
"""

import argparse
import math
import os
import re
import sys
import textwrap
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from datetime import date, datetime, time, timedelta
from fractions import Fraction
from itertools import chain, count
from pathlib import Path
from typing import Any, Self

import yaml
from pydantic_core import PydanticCustomError

from fleet2d.configuration.documents import Document, Keys, read_document
from fleet2d.configuration.problems import shown
from fleet2d.configuration.units import format_duration, micros, parse_duration
from fleet2d.errors import ArtifactError, Fleet2DError, InputError, ScenarioError
from fleet2d.floorplan.home import Home
from fleet2d.floorplan.lattice import MAX_CELL_M, MIN_CELL_M
from fleet2d.floorplan.load import load_floorplan
from fleet2d.scenario.load import load_scenario
from fleet2d.scenario.model import Scenario
from fleet2d.sight.camera import Camera
from fleet2d.storage.files import is_disk_full, write_atomically

_HUGE = 1e300
_UNITS = {"weeks", "days", "hours", "minutes", "seconds", "milliseconds", "microseconds"}
_BOOLEANS = {"yes": True, "on": True, "no": False, "off": False}  # of YAML 1.1, as it is read there


@dataclass
class ConfigReader:
    """A reader of an old configuration, or of a section of it, whose keys its methods take.

    It checks values, collects remarks, and notes which keys are read.

    Attributes:
        document: The configuration.
        shown_as: Its name in messages.
        keys: The section that it reads.
    """

    document: Document
    shown_as: str
    keys: Keys = ()
    _touched: set[Keys] = field(default_factory=set)
    _whole: set[Keys] = field(default_factory=set)  # read together with all keys below them
    _remarks: dict[str, list[str]] = field(default_factory=dict)

    def at(self, *names: str) -> Self:
        """Return the reader of a section of this one."""
        return replace(self, keys=(*self.keys, *names))

    def check_kind(self) -> None:
        """Raise ScenarioError unless this looks like a configuration of the published Fleet2D."""
        sections = ("simulation", "floorplan")
        wrong = [s for s in sections if not isinstance(self.document.data.get(s), Mapping)]
        if wrong:
            raise ScenarioError(
                f"{self.shown_as} is not a configuration of the published Fleet2D, whose sections"
                f" are simulation, floorplan, users and robot: there is no section {wrong[0]}"
            )
        if "start" in self.document.data["simulation"] or "path" in self.document.data["floorplan"]:
            raise ScenarioError(
                f"{self.shown_as} is a scenario already: run it with `fleet2d run {self.shown_as}`"
            )

    def remark(self, text: str, *names: str) -> None:
        """Add a remark on a key; equal texts are reported once, with all their keys."""
        self._remarks.setdefault(text, []).append(".".join((*self.keys, *names)))

    def finish(self) -> list[str]:
        """Return all remarks, with those about unknown keys last."""
        self._note_unknown(self.document.data, ())
        return [f"{', '.join(dict.fromkeys(k))}: {text}" for text, k in self._remarks.items()]

    def _note_unknown(self, data: Mapping[str, Any], above: Keys) -> None:
        for key, value in data.items():
            keys = (*above, key)
            if keys not in self._touched and keys not in self._whole:
                self.remark(f"not known, left out ({self.document.place(keys)})", *keys)
            elif keys not in self._whole and isinstance(value, Mapping):
                self._note_unknown(value, keys)

    def wrong(self, message: str, *names: str) -> ScenarioError:
        """Return the error about a key."""
        keys = (*self.keys, *names)
        return ScenarioError(f"{self.document.place(keys)}: {'.'.join(keys)}: {message}")

    def get(self, *names: str, whole: bool = False) -> Any:
        """Return a value, None if it is missing; with `whole`, all keys below it count as read."""
        data: Any = self.document.data
        keys = (*self.keys, *names)
        for depth, key in enumerate(keys):
            if data is None:
                return None
            if not isinstance(data, Mapping):
                section = replace(self, keys=keys[:depth])
                raise section.wrong(f"expected a mapping of keys, got {shown(data)}")
            self._touched.add(keys[: depth + 1])
            data = data.get(key)
        if whole:
            self._whole.add(keys)
        return data

    def _checked(self, name: str, is_valid: Callable[[Any], bool], expected: str) -> Any:
        """Return a value that is valid, or None."""
        value = self.get(name)
        if value is not None and not is_valid(value):
            raise self.wrong(f"expected {expected}, got {shown(value)}", name)
        return value

    def number(
        self,
        name: str,
        above: float = -math.inf,
        minimum: float = -math.inf,
        maximum: float = math.inf,
    ) -> float | None:
        """Return a finite number within limits, or None."""
        expected = "a number"
        expected += f" above {above:g}" if above > -math.inf else ""
        expected += f" of {minimum:g} or more" if minimum > -math.inf else ""
        expected += f", {maximum:g} at most" if maximum < math.inf else ""

        def is_valid(value: Any) -> bool:
            is_number = isinstance(value, int | float) and not isinstance(value, bool)
            return (
                is_number and abs(value) < _HUGE and value > above and minimum <= value <= maximum
            )

        value = self._checked(name, is_valid, expected)
        return None if value is None else float(value)

    def integer(self, name: str, minimum: int) -> int | None:
        """Return a whole number; None if the key is missing."""
        value: int | None = self._checked(
            name,
            lambda value: type(value) is int and minimum <= value < 2**63,
            f"a whole number of {minimum} or more",
        )
        return value

    def text(self, name: str) -> str | None:
        """Return a text; None if it is missing or empty."""
        value = self._checked(name, lambda value: isinstance(value, str), "text")
        return str(value) if value else None

    def boolean(self, name: str) -> bool | None:
        """Return true or false, or None."""
        value = self.get(name)
        value = _BOOLEANS.get(value.lower(), value) if isinstance(value, str) else value
        if value is not None and not isinstance(value, bool):
            raise self.wrong(f"expected true or false, got {shown(value)}", name)
        return value

    def duration(self, name: str) -> timedelta | None:
        """Return the sum of a mapping of units to numbers as a duration, or None."""
        value = self.get(name, whole=True)
        if value is None:
            return None
        if not isinstance(value, Mapping) or not value.keys() <= _UNITS:
            units = ", ".join(sorted(_UNITS))
            raise self.wrong(f"expected a mapping of {units}, got {shown(value)}", name)
        try:
            return parse_duration(dict(value) or 0)
        except PydanticCustomError as error:
            raise self.wrong(error.message(), name) from None


def main() -> int:
    """Convert the file that the command line names; return the exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("old", type=Path, help="A configuration of the published Fleet2D.")
    parser.add_argument("new", type=Path, help="The scenario to write, which must not exist.")
    arguments = parser.parse_args()
    try:
        remarks = convert_file(arguments.old, arguments.new)
    except Fleet2DError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    for remark in remarks:
        print(f"note: {remark}")
    print(arguments.new)
    return 0


def convert_file(old: Path, new: Path) -> list[str]:
    """Write a configuration of the published Fleet2D as a scenario.

    Args:
        old: The configuration, a YAML file with `simulation`, `floorplan`, `users`, `robot`.
        new: The scenario to write; it must not exist.

    Returns:
        Remarks on what could not be converted or has another meaning now, each beginning with the
        old key.

    Raises:
        InputError: `old` can't be read or isn't such a configuration, or `new` exists or can't be
            written.
        ArtifactError: The disk is full. After any error, there is no file `new`.
    """
    old, new = Path(old), Path(new)
    _check_target(new)
    reader = ConfigReader(_read(old), str(old))
    reader.check_kind()
    data = _convert(reader, old, new)
    remarks = reader.finish()
    style: dict[str, Any] = {"sort_keys": False, "default_flow_style": None, "width": 100}
    _write_new(new, _header(old, remarks) + yaml.safe_dump(data, allow_unicode=True, **style))
    return remarks


def _read(old: Path) -> Document:
    try:
        return read_document(old)
    except ScenarioError as error:
        hint = "; a !!python tag runs code, so none is read: write the value itself"
        raise ScenarioError(f"{error}{hint if ':python/' in str(error) else ''}") from None


def _convert(reader: ConfigReader, old: Path, new: Path) -> dict[str, Any]:
    """Return the scenario as plain data; starts in or near walls are moved to free points."""
    simulation = reader.at("simulation")
    step = read_step(simulation)
    floorplan, plan_file = convert_floorplan(reader.at("floorplan"), old, new)
    users, bodies = convert_users(reader.at("users"), step)
    data: dict[str, Any] = {
        "simulation": convert_simulation(simulation, step),
        "floorplan": floorplan,
        "users": users,
        "robots": {},
        "sight": convert_sight(simulation),
        "artifacts": convert_outputs(simulation.at("outputs"), step),
    }
    if reader.get("robot") is None:
        reader.remark("missing; the scenario has no robot", "robot")
    else:
        name = free_name("robot", users)
        if name != "robot":
            reader.remark(f"called {name}: there is a user robot", "robot")
        bodies[name] = body_of(reader.at("robot"))
        data["robots"][name] = convert_robot(bodies[name], step, data["sight"])
    scenario = _validate(data, plan_file, reader.shown_as)
    if plan_file:
        _move_starts(data, scenario, plan_file, bodies)
    return {key: value for key, value in data.items() if value}


def _validate(data: dict[str, Any], plan_file: Path | None, shown_as: str) -> Scenario:
    """Validate the scenario; if its plan file is missing, use the bundled plan."""
    plan = {"type": "houseexpo", "path": str(plan_file)} if plan_file else {"type": "bundled"}
    try:
        return load_scenario({**data, "floorplan": {**plan, "cell": data["floorplan"]["cell"]}})
    except ScenarioError as error:
        raise ScenarioError(f"{shown_as} can't be converted to a valid scenario: {error}") from None


def _move_starts(
    data: dict[str, Any], scenario: Scenario, plan: Path, bodies: Mapping[str, ConfigReader]
) -> None:
    """Move every start at which its body doesn't fit to the nearest point at which it does."""
    home = Home(load_floorplan(plan, data["floorplan"]["cell"]))
    lattice = home.plan.lattice
    for name, entity in [*scenario.users.items(), *scenario.robots.items()]:
        start = data["users" if name in data["users"] else "robots"][name].get("start")
        if start is None:
            continue
        try:
            space = home.space(entity.radius)
        except InputError as error:
            raise bodies[name].wrong(str(error), "radius") from None
        x, y = lattice.point_at(start)
        near = space.nearest(x, y, 0)
        if space.part_at(x, y) >= 0 or near is None:
            continue
        free = [round(value, 4) for value in lattice.to_metres(near).tolist()]
        bodies[name].at("pose_config", "init_pose").remark(
            f"{start} is in a wall or nearer to one than its radius, {entity.radius:g} m: it starts"
            f" at {free}, the nearest free point"
        )
        start[:] = free


# The sections of the new scenario


def tidy(value: float) -> float:
    """Return a computed number rounded to 12 significant digits."""
    return float(f"{value:.12g}")


_NOTHING_STORED = {
    "trajectories": "off",
    **dict.fromkeys(("key_frames", "observations", "events", "outputs"), False),
}


def read_step(reader: ConfigReader) -> timedelta:
    """Return the length of a step; the reader is of the section `simulation`."""
    step = reader.duration("delta")
    if step is None:
        reader.remark("missing; the step is 1 s", "delta")
        return timedelta(seconds=1)
    if not step:
        raise reader.wrong("expected a step longer than 0, got 0", "delta")
    return step


def convert_simulation(reader: ConfigReader, step: timedelta) -> dict[str, Any]:
    """Return the section `simulation`: start, duration, step, seed and speedup."""
    duration = reader.duration("duration")
    if duration is None:
        raise reader.wrong("missing; add the duration of the run", "duration")
    length = format_duration(duration)
    step_length = format_duration(step)
    if duration < step:
        raise reader.wrong(f"{length} is shorter than one step, delta: {step_length}", "duration")
    if duration % step:
        reader.remark(
            f"{length} is not a multiple of delta, {step_length}: there, a run went one step beyond"
            " it; here it ends with the last full step within it",
            "duration",
        )
    start = _start(reader)
    result: dict[str, Any] = {"start": start.isoformat()} if start else {}
    seed = reader.integer("seed", minimum=0)
    if seed is not None:
        reader.remark(
            "the same seed draws other numbers here: the walks are of the same kind, not the same",
            "seed",
        )
    speedup = reader.number("speedup", above=0)
    if speedup is not None:
        reader.remark(
            "kept to in full here; there, each step slept for its share of it on top of computing",
            "speedup",
        )
    _windows(reader)
    return result | {"duration": length, "step": step_length, "seed": seed, "speedup": speedup}


def _start(reader: ConfigReader) -> datetime | None:
    value = reader.get("start_ts")
    if value is None:
        reader.remark("missing; the run starts on 2026-01-05, a Monday, at 00:00", "start_ts")
        return None
    if isinstance(value, str):
        with suppress(ValueError):
            value = datetime.fromisoformat(value)
    if isinstance(value, date) and not isinstance(value, datetime):
        value = datetime.combine(value, time())
    if not isinstance(value, datetime):
        expected = "a date and time like 2026-01-05 08:00:00"
        raise reader.wrong(f"expected {expected}, got {shown(value)}", "start_ts")
    if value.tzinfo is not None:
        words = "its time zone is left out: time is that of the clock on the home's wall"
        reader.remark(words, "start_ts")
    return value.replace(tzinfo=None)


def _windows(reader: ConfigReader) -> None:
    """Read the keys about watching a run, which have no place in a scenario."""
    picture = reader.at("visualization")
    every = picture.get("every_n_steps")
    if picture.boolean("visualize"):
        for name in ("visualize", "every_n_steps") if every else ("visualize",):
            picture.remark(
                "left out: no window opens during a run; `fleet2d show RUN_DIR` draws a stored one",
                name,
            )
    if reader.boolean("show_progress") is False:
        reader.remark("left out: `fleet2d run --quiet` shows none", "show_progress")


# The method of sight there that is one here, too: such a scenario sees what it saw there.
FLASHLIGHT = "Flashlight"


def convert_sight(reader: ConfigReader) -> dict[str, Any]:
    """Return the section `sight`: the method that corresponds to the old `fov_provider`."""
    provider = reader.text("fov_provider")
    if provider == FLASHLIGHT:
        words = "kept: sight.method is flashlight; left out, sight is exact"
        reader.remark(words, "fov_provider")
        return {"method": {"type": "flashlight"}}
    if provider:
        reader.remark("left out: lines of sight are computed exactly here", "fov_provider")
    return {}


def convert_outputs(reader: ConfigReader, step: timedelta) -> dict[str, Any]:
    """Return the section `artifacts`: what is stored, and how often."""
    for key in ("output_dir", "prefix"):
        if reader.text(key):
            reader.remark("left out: `fleet2d run --out DIR` says where a run is stored", key)
    every = reader.integer("every_n_steps", minimum=1)
    if reader.boolean("save") is False:
        words = "every table is off; a run still makes a directory with its manifest"
        reader.remark(words, "save")
        return dict(_NOTHING_STORED)
    if every is None:
        return {}
    try:
        stored = "every step" if every == 1 else format_duration(parse_duration(every * step))
    except (PydanticCustomError, OverflowError):
        raise reader.wrong("that many steps are over 1000 years", "every_n_steps") from None
    for key in ("save", "every_n_steps"):
        reader.remark(
            f"poses are stored {stored if every == 1 else f'every {stored}'}, observations and"
            " events in full; the published Fleet2D wrote nothing",
            key,
        )
    return {"trajectories": stored}


def convert_floorplan(
    reader: ConfigReader, old: Path, new: Path
) -> tuple[dict[str, Any], Path | None]:
    """Return the section `floorplan`, and the plan's file if it exists."""
    kind = reader.get("type")
    if kind != "he":
        expected = "he (HouseExpo), the only type that is converted"
        raise reader.wrong(f"expected {expected}, got {shown(kind)}", "type")
    reader = reader.at("he")
    old_path = reader.text("json_fpath")
    if old_path is None:
        raise reader.wrong("missing: give the path of a HouseExpo JSON file", "json_fpath")
    # Paths there are relative to the top of its repository, some folders above the configuration.
    folders = dict.fromkeys([old.absolute().parent, Path.cwd(), *old.absolute().parents])
    file = next((p.resolve() for f in folders if (p := f / old_path).is_file()), None)
    if file is None:
        reader.remark(
            f"there is no file {old_path} beside {old.name}, in the folders above it or in the"
            f" current one; kept as written, it counts from the folder of {new.name}: put the plan"
            " there, or run with floorplan.path=PLAN.json. The starts of users and robot were not"
            " checked",
            "json_fpath",
        )
    ppm = reader.number("ppm", above=0)
    cell = 0.05 if ppm is None else min(max(1 / ppm, MIN_CELL_M), MAX_CELL_M)
    reader.remark(
        f"{'missing; ' if ppm is None else ''}the grid's cells are {cell:.4g} m; walls and poses"
        " are not rounded to them",
        "ppm",
    )
    if reader.get("border_pad") is not None:
        reader.remark("left out: the grid has a margin of its own", "border_pad")
    path = _path_from(new.absolute().parent.resolve(), file) if file else old_path
    return {"type": "houseexpo", "path": path, "cell": tidy(cell)}, file


def _path_from(folder: Path, file: Path) -> str:
    """Return the path of a file relative to a folder, or absolute if they only share the root."""
    with suppress(ValueError):  # they are on two drives
        if Path(os.path.commonpath([folder, file])) != Path(file.anchor):
            return Path(os.path.relpath(file, folder)).as_posix()
    return str(file)


# Random turns are cut at 4.88 standard deviations (kernels.numbers), so this limit has no effect.
_TURN_LIMIT_STD = 5
_FASTEST_TURN_DEG_S = 36_000
_WIDEST_TURN_DEG = 3600
_FASTEST_M_S = 20
_WIDEST_M = 2
_SLOWEST_M_S = 0.01


def convert_users(
    reader: ConfigReader, step: timedelta
) -> tuple[dict[str, Any], dict[str, ConfigReader]]:
    """Return the users by name, and the reader of each one's settings in the old file."""
    names = reader.get("names", whole=True)
    if isinstance(names, str):
        names = names.split(",")
    if not isinstance(names, list | None) or not all(isinstance(n, str) for n in names or []):
        raise reader.wrong(f"expected names separated by commas, got {shown(names)}", "names")
    old_names = dict.fromkeys(stripped for name in names or [] if (stripped := name.strip()))
    if not old_names:
        reader.remark("no names; the scenario has no users", "names")
    users: dict[str, Any] = {}
    bodies: dict[str, ConfigReader] = {}
    for old_name in old_names:
        if reader.get(old_name) is None:
            raise reader.wrong(
                f"{old_name!r} has no section users.{old_name}: add it, or remove the name", "names"
            )
        body = body_of(reader.at(old_name))
        name = free_name(old_name, users)
        if name != old_name:
            reader.remark(f"called {name}: names are letters, digits, _ and -", old_name)
        users[name], bodies[name] = _body(body, step), body
    for name in reader.get() or {}:
        if name != "names" and name not in old_names:
            reader.get(name, whole=True)
            reader.remark("left out: users.names doesn't have it, so it was not used", name)
    return users, bodies


def body_of(reader: ConfigReader) -> ConfigReader:
    """Return the reader of an entity's settings: those of the section that its `type` names."""
    kind = reader.text("type") or "base"
    if reader.get(kind) is None:
        raise reader.wrong(f"its type is {kind!r}, and it has no section of that name")
    if kind != "base":
        reader.remark(f"{kind} is not a type of the published Fleet2D: read as base", "type")
    return reader.at(kind)


def _body(reader: ConfigReader, step: timedelta) -> dict[str, Any]:
    """Return the keys that users and robots have in common."""
    result: dict[str, Any] = {}
    radius = reader.number("radius", minimum=0, maximum=_WIDEST_M)
    if not radius:
        reader.remark("missing or 0; a body has a radius, and this one has 0.01 m", "radius")
    result["radius"] = radius or 0.01
    pose = reader.at("pose_config", "init_pose")
    x, y, theta = (pose.number(key) for key in ("x", "y", "theta"))
    if x is None or y is None:
        pose.remark("has no x and y; where it starts is drawn")
    else:
        result["start"] = [x, y]
    if theta is not None:
        result["start_heading_deg"] = theta
    color = reader.text("color")
    if color:
        result["color"] = color
    if reader.get("seed") is not None:
        words = "left out: each entity has its own random numbers, from simulation.seed"
        reader.remark(words, "seed")
    return result | _walk(reader.at("pose_config", "meander_strategy"), step)


def _walk(reader: ConfigReader, step: timedelta) -> dict[str, Any]:
    """Return the keys of the random walk."""
    if reader.get() is None:
        reader.remark("missing; it stands still")
        return {}
    step_s = Fraction(micros(step), 10**6)
    speed = _speed(reader, step_s)
    if speed is None:
        return {}
    walk = {"type": "meander", "speed": speed, "at_walls": "stay"}
    return walk | _turns(reader, step_s)


def _speed(reader: ConfigReader, step_s: Fraction) -> float | None:
    """Return the speed [m/s], in metres per step in the old file; None: it stands still."""
    stride = reader.number("lin_speed", minimum=0)
    speed = float(Fraction(repr(stride)) / step_s) if stride else 0.0
    if speed < _SLOWEST_M_S:
        reader.remark(f"missing, 0 or below {_SLOWEST_M_S} m/s; it stands still", "lin_speed")
        return None
    if speed > _FASTEST_M_S:
        raise reader.wrong(
            f"{stride:g} m in a step of {float(step_s):g} s is {speed:g} m/s, more than the"
            f" limit of {_FASTEST_M_S} m/s",
            "lin_speed",
        )
    reader.remark(
        "metres per step there, a speed here, and the same rule of walking at this step, with"
        " at_walls: stay; a move across a wall is never made, where the published Fleet2D looked at"
        " the end of the move only",
        "lin_speed",
    )
    return speed


def _turns(reader: ConfigReader, step_s: Fraction) -> dict[str, float]:
    """Return the keys of random turns, whose deviation is in degrees per step in the old file."""
    widest = _WIDEST_TURN_DEG
    deviation = abs(reader.number("ang_speed", minimum=-widest, maximum=widest) or 0.0)
    if not deviation:
        return {"turn_std_deg": 0.0}
    limit = _TURN_LIMIT_STD * deviation / float(step_s)
    reader.remark(
        "degrees per step there, per square root of a second here, and the same law at this step;"
        " turns are cut at 4.88 standard deviations, and turn_rate_deg, at 5, cuts none",
        "ang_speed",
    )
    if limit > _FASTEST_TURN_DEG_S:
        limit = _FASTEST_TURN_DEG_S
        reader.remark(f"turns are cut at {limit:g} deg/s, the fastest there is", "ang_speed")
    return {"turn_std_deg": tidy(deviation / math.sqrt(step_s)), "turn_rate_deg": tidy(limit)}


def convert_robot(reader: ConfigReader, step: timedelta, sight: dict[str, Any]) -> dict[str, Any]:
    """Return the robot; `sight` is the section that `convert_sight` returned."""
    body = _body(reader, step)
    return body | {"camera": _camera(reader.at("fov_config"), ignores_limits=bool(sight))}


def _camera(reader: ConfigReader, *, ignores_limits: bool) -> dict[str, Any]:
    """Return the camera; missing keys have the defaults of cameras here."""
    for key in ("load_fov_file", "lazy_compute"):
        if reader.get(key) is not None:
            reader.remark("not needed: fields of view are computed exactly, when needed", key)
    camera: dict[str, Any] = {"range": _range(reader, ignores_limits=ignores_limits)}
    angle = reader.number("angle", above=0)
    if angle is None:
        reader.remark("missing; the camera gets the angle that cameras have here", "angle")
    else:
        camera["angle_deg"] = min(angle, 360.0)  # it saw in all directions from there on
    return camera


def _range(reader: ConfigReader, *, ignores_limits: bool) -> list[float]:
    """Return the nearest and the farthest distance of the camera [m]."""
    distance = reader.number("distance", above=0)
    if distance is None:
        distance = Camera().range[1]
        reader.remark(f"missing; {distance:g} m is used", "distance")
    limits = ("min_distance", "max_distance")
    lowest, highest = (reader.number(limit, minimum=0) for limit in limits)
    near = lowest or 0.0
    far = distance if highest is None else highest
    if near >= far:
        raise reader.wrong(
            f"the camera would see from {near:g} m to {far:g} m: the farthest distance must be"
            " beyond the nearest"
        )
    words = (
        f"accepted and ignored there, where it saw from 0 to distance, {distance:g} m; here"
        f" they hold, and camera.range is [{near:g}, {far:g}]"
    )
    if ignores_limits:
        words = (
            f"left out, as they were ignored there: it sees from 0 to distance, {distance:g} m; for"
            f" these limits write camera.range: [{near:g}, {far:g}]"
        )
    for limit in limits:
        if reader.get(limit) is not None:
            reader.remark(words, limit)
    return [0.0, distance] if ignores_limits else [near, far]


def free_name(name: str, used: Iterable[str]) -> str:
    """Return a valid name for an entity that is not used, as similar to `name` as possible."""
    valid = re.sub(r"[^A-Za-z0-9_-]", "_", name)
    valid = valid if valid[0].isalpha() else f"user_{valid}"
    numbered = (f"{valid}_{number}" for number in count(2))
    return next(candidate for candidate in chain([valid], numbered) if candidate not in used)


# The new file


def _header(old: Path, remarks: list[str]) -> str:
    """Return the comment at the top: the source of the scenario, and all remarks."""
    text = (
        f"Converted by `tools/convert_published.py` from {old.name}, a configuration of the"
        " published Fleet2D."
    )
    lines = [text, *(["What changed:"] if remarks else []), *(f"- {remark}" for remark in remarks)]
    # Only printable characters, as a line break in a key would end the comment.
    printable = ("".join(c if c.isprintable() else "?" for c in line) for line in lines)
    wrapper = textwrap.TextWrapper(98, break_long_words=False, break_on_hyphens=False)
    wrapped = []
    for line in printable:
        wrapper.subsequent_indent = "  " * line.startswith("- ")
        wrapped += wrapper.wrap(line)
    return "".join(f"# {line}\n" for line in wrapped) + "\n"


def _check_target(new: Path) -> None:
    if os.path.lexists(new):
        raise InputError(f"{new} exists: choose another name, or remove it")
    if not new.absolute().parent.is_dir():
        raise InputError(f"{new} can't be written: there is no folder {new.absolute().parent}")


def _write_new(new: Path, text: str) -> None:
    """Write a file that must not exist, completely or not at all."""
    try:
        write_atomically(new, text.encode())
    except OSError as error:
        if is_disk_full(error):
            full = f"the disk is full: {new} can't be written; free some space"
            raise ArtifactError(full) from error
        raise InputError(
            f"{new} can't be written: {error.strerror or error}; choose another place"
        ) from error


if __name__ == "__main__":
    sys.exit(main())
