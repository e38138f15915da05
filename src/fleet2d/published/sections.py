"""The sections of configurations of the published Fleet2D, read key by key and converted.

Its poses are metres in the plan's own coordinates and degrees counter-clockwise from +x, as here;
it uses pixels only to round walls and to look up free space.
"""

import math
import os
import re
from collections.abc import Iterable, Mapping
from contextlib import suppress
from datetime import date, datetime, time, timedelta
from fractions import Fraction
from itertools import chain, count
from pathlib import Path
from typing import Any

from pydantic_core import PydanticCustomError

from fleet2d.configuration.documents import Document, Keys
from fleet2d.configuration.problems import shown
from fleet2d.configuration.units import format_duration, micros, parse_duration
from fleet2d.errors import ScenarioError
from fleet2d.floorplan.lattice import MAX_CELL_M, MIN_CELL_M
from fleet2d.sight.camera import Camera

_HUGE = 1e300
_UNITS = {"weeks", "days", "hours", "minutes", "seconds", "milliseconds", "microseconds"}
_BOOLEANS = {"yes": True, "on": True, "no": False, "off": False}  # of YAML 1.1, as it is read there


class ConfigReader:
    """A reader of an old configuration: checks values, collects remarks, and notes unread keys."""

    def __init__(self, document: Document, shown_as: str) -> None:
        self.document = document
        self.shown_as = shown_as
        self._touched: set[Keys] = set()
        self._whole: set[Keys] = set()  # read together with all keys below them
        self._remarks: dict[str, list[str]] = {}

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

    def remark(self, keys: Keys, text: str, *also: Keys) -> None:
        """Add a remark on one or more keys; equal texts are reported once, with all their keys."""
        self._remarks.setdefault(text, []).extend(".".join(path) for path in (keys, *also))

    def finish(self) -> list[str]:
        """Return all remarks, with those about unknown keys last."""
        self._note_unknown(self.document.data, ())
        return [f"{', '.join(dict.fromkeys(k))}: {text}" for text, k in self._remarks.items()]

    def _note_unknown(self, data: Mapping[str, Any], above: Keys) -> None:
        for key, value in data.items():
            keys = (*above, key)
            if keys not in self._touched and keys not in self._whole:
                self.remark(keys, f"not known, left out ({self.document.place(keys)})")
            elif keys not in self._whole and isinstance(value, Mapping):
                self._note_unknown(value, keys)

    def wrong(self, keys: Keys, message: str) -> ScenarioError:
        """Return the error about a key."""
        return ScenarioError(f"{self.document.place(keys)}: {'.'.join(keys)}: {message}")

    def get(self, keys: Keys, *, whole: bool = False) -> Any:
        """Return a value, None if it is missing; with `whole`, all keys below it count as read."""
        data: Any = self.document.data
        for depth, key in enumerate(keys):
            if data is None:
                return None
            if not isinstance(data, Mapping):
                raise self.wrong(keys[:depth], f"expected a mapping of keys, got {shown(data)}")
            self._touched.add(keys[: depth + 1])
            data = data.get(key)
        if whole:
            self._whole.add(keys)
        return data

    def number(
        self,
        keys: Keys,
        above: float = -math.inf,
        minimum: float = -math.inf,
        maximum: float = math.inf,
    ) -> float | None:
        """Return a finite number within limits, or None."""
        value = self.get(keys)
        if value is None:
            return None
        expected = "a number"
        expected += f" above {above:g}" if above > -math.inf else ""
        expected += f" of {minimum:g} or more" if minimum > -math.inf else ""
        expected += f", {maximum:g} at most" if maximum < math.inf else ""
        is_number = isinstance(value, int | float) and not isinstance(value, bool)
        if not is_number or not (
            abs(value) < _HUGE and above < value <= maximum and value >= minimum
        ):
            raise self.wrong(keys, f"expected {expected}, got {shown(value)}")
        return float(value)

    def integer(self, keys: Keys, minimum: int, below: int = 2**63) -> int | None:
        """Return a whole number; None if the key is missing."""
        value = self.get(keys)
        if value is None:
            return None
        if isinstance(value, bool) or not isinstance(value, int) or not minimum <= value < below:
            raise self.wrong(
                keys, f"expected a whole number of {minimum} or more, got {shown(value)}"
            )
        return value

    def text(self, keys: Keys) -> str | None:
        """Return a text; None if it is missing or empty."""
        value = self.get(keys)
        if value is not None and not isinstance(value, str):
            raise self.wrong(keys, f"expected text, got {shown(value)}")
        return str(value) if value else None

    def boolean(self, keys: Keys) -> bool | None:
        """Return true or false, or None."""
        value = self.get(keys)
        value = _BOOLEANS.get(value.lower(), value) if isinstance(value, str) else value
        if value is not None and not isinstance(value, bool):
            raise self.wrong(keys, f"expected true or false, got {shown(value)}")
        return value

    def duration(self, keys: Keys) -> timedelta | None:
        """Return the sum of a mapping of units to numbers as a duration, or None."""
        value = self.get(keys, whole=True)
        if value is None:
            return None
        if not isinstance(value, Mapping) or not value.keys() <= _UNITS:
            raise self.wrong(
                keys, f"expected a mapping of {', '.join(sorted(_UNITS))}, got {shown(value)}"
            )
        try:
            return parse_duration(dict(value) or 0)
        except PydanticCustomError as error:
            raise self.wrong(keys, error.message()) from None


def tidy(value: float) -> float:
    """Return a computed number rounded to 12 significant digits."""
    return float(f"{value:.12g}")


_NOTHING_STORED = {
    "trajectories": "off",
    **dict.fromkeys(("key_frames", "observations", "events", "outputs"), False),
}
_SIMULATION: Keys = ("simulation",)
_PLAN: Keys = ("floorplan", "he")


def read_step(reader: ConfigReader) -> timedelta:
    """Return the length of a step."""
    keys = (*_SIMULATION, "delta")
    step = reader.duration(keys)
    if step is None:
        reader.remark(keys, "missing; the step is 1 s")
        return timedelta(seconds=1)
    if not step:
        raise reader.wrong(keys, "expected a step longer than 0, got 0")
    return step


def convert_simulation(reader: ConfigReader, step: timedelta) -> dict[str, Any]:
    """Return the section `simulation`: start, duration, step, seed and speedup."""
    duration_keys = (*_SIMULATION, "duration")
    duration = reader.duration(duration_keys)
    if duration is None:
        raise reader.wrong(duration_keys, "missing; add the duration of the run")
    if duration < step:
        raise reader.wrong(
            duration_keys,
            f"{format_duration(duration)} is shorter than one step, delta: {format_duration(step)}",
        )
    if duration % step:
        reader.remark(
            duration_keys,
            f"{format_duration(duration)} is not a multiple of delta, {format_duration(step)}:"
            " there, a run went one step beyond it; here it ends with the last full step within it",
        )
    start = _start(reader)
    result: dict[str, Any] = {"start": start.isoformat()} if start else {}
    seed = reader.integer((*_SIMULATION, "seed"), minimum=0)
    if seed is not None:
        reader.remark(
            (*_SIMULATION, "seed"),
            "the same seed draws other numbers here: the walks are of the same kind, not the same",
        )
    speedup = reader.number((*_SIMULATION, "speedup"), above=0)
    if speedup is not None:
        reader.remark(
            (*_SIMULATION, "speedup"),
            "kept to in full here; there, each step slept for its share of it on top of computing",
        )
    _windows(reader)
    return result | {
        "duration": format_duration(duration),
        "step": format_duration(step),
        "seed": seed,
        "speedup": speedup,
    }


def _start(reader: ConfigReader) -> datetime | None:
    keys = (*_SIMULATION, "start_ts")
    value = reader.get(keys)
    if value is None:
        reader.remark(keys, "missing; the run starts on 2026-01-05, a Monday, at 00:00")
        return None
    if isinstance(value, str):
        with suppress(ValueError):
            value = datetime.fromisoformat(value)
    if isinstance(value, date) and not isinstance(value, datetime):
        value = datetime.combine(value, time())
    if not isinstance(value, datetime):
        raise reader.wrong(
            keys, f"expected a date and time like 2026-01-05 08:00:00, got {shown(value)}"
        )
    if value.tzinfo is not None:
        reader.remark(
            keys, "its time zone is left out: time is that of the clock on the home's wall"
        )
    return value.replace(tzinfo=None)


def _windows(reader: ConfigReader) -> None:
    """Read the keys about watching a run, which have no place in a scenario."""
    picture: Keys = (*_SIMULATION, "visualization")
    every = reader.get((*picture, "every_n_steps"))
    if reader.boolean((*picture, "visualize")):
        reader.remark(
            (*picture, "visualize"),
            "left out: no window opens during a run; `fleet2d show RUN_DIR` draws a stored one",
            *([(*picture, "every_n_steps")] if every else []),
        )
    if reader.boolean((*_SIMULATION, "show_progress")) is False:
        reader.remark((*_SIMULATION, "show_progress"), "left out: `fleet2d run --quiet` shows none")


# The method of sight there that is one here, too: such a scenario sees what it saw there.
FLASHLIGHT = "Flashlight"


def convert_sight(reader: ConfigReader) -> dict[str, Any]:
    """Return the section `sight`: the method that corresponds to the old `fov_provider`."""
    keys: Keys = (*_SIMULATION, "fov_provider")
    provider = reader.text(keys)
    if provider == FLASHLIGHT:
        reader.remark(keys, "kept: sight.method is flashlight; left out, sight is exact")
        return {"method": {"type": "flashlight"}}
    if provider:
        reader.remark(keys, "left out: lines of sight are computed exactly here")
    return {}


def convert_outputs(reader: ConfigReader, step: timedelta) -> dict[str, Any]:
    """Return the section `artifacts`: what is stored, and how often."""
    keys: Keys = (*_SIMULATION, "outputs")
    for key in ("output_dir", "prefix"):
        if reader.text((*keys, key)):
            reader.remark(
                (*keys, key), "left out: `fleet2d run --out DIR` says where a run is stored"
            )
    every = reader.integer((*keys, "every_n_steps"), minimum=1)
    if reader.boolean((*keys, "save")) is False:
        reader.remark(
            (*keys, "save"), "every table is off; a run still makes a directory with its manifest"
        )
        return dict(_NOTHING_STORED)
    if every is None:
        return {}
    try:
        stored = "every step" if every == 1 else format_duration(parse_duration(every * step))
    except (PydanticCustomError, OverflowError):
        raise reader.wrong(
            (*keys, "every_n_steps"), "that many steps are over 1000 years"
        ) from None
    reader.remark(
        (*keys, "save"),
        f"poses are stored {stored if every == 1 else f'every {stored}'}, observations and events"
        " in full; the published Fleet2D wrote nothing",
        (*keys, "every_n_steps"),
    )
    return {"trajectories": stored}


def convert_floorplan(
    reader: ConfigReader, old: Path, new: Path
) -> tuple[dict[str, Any], Path | None]:
    """Return the section `floorplan`, and the plan's file if it exists."""
    kind = reader.get(("floorplan", "type"))
    if kind != "he":
        raise reader.wrong(
            ("floorplan", "type"),
            f"expected he (HouseExpo), the only type that is converted, got {shown(kind)}",
        )
    path_keys = (*_PLAN, "json_fpath")
    old_path = reader.text(path_keys)
    if old_path is None:
        raise reader.wrong(path_keys, "missing: give the path of a HouseExpo JSON file")
    # Paths there are relative to the top of its repository, some folders above the configuration.
    folders = dict.fromkeys([old.absolute().parent, Path.cwd(), *old.absolute().parents])
    file = next((p.resolve() for f in folders if (p := f / old_path).is_file()), None)
    if file is None:
        reader.remark(
            path_keys,
            f"there is no file {old_path} beside {old.name}, in the folders above it or in the"
            f" current one; kept as written, it counts from the folder of {new.name}: put the plan"
            " there, or run with floorplan.path=PLAN.json. The starts of users and robot were not"
            " checked",
        )
    ppm = reader.number((*_PLAN, "ppm"), above=0)
    cell = 0.05 if ppm is None else min(max(1 / ppm, MIN_CELL_M), MAX_CELL_M)
    reader.remark(
        (*_PLAN, "ppm"),
        f"{'missing; ' if ppm is None else ''}the grid's cells are {cell:.4g} m; walls and poses"
        " are not rounded to them",
    )
    if reader.get((*_PLAN, "border_pad")) is not None:
        reader.remark((*_PLAN, "border_pad"), "left out: the grid has a margin of its own")
    path = _path_from(new.absolute().parent.resolve(), file) if file else old_path
    return {"type": "houseexpo", "path": path, "cell": tidy(cell)}, file


def _path_from(folder: Path, file: Path) -> str:
    """Return the path of a file relative to a folder, or absolute if they only share the root."""
    try:
        shared = Path(os.path.commonpath([folder, file]))
    except ValueError:  # on two drives
        return str(file)
    return (
        str(file) if shared == Path(file.anchor) else Path(os.path.relpath(file, folder)).as_posix()
    )


# Random turns are cut at 4.88 standard deviations (kernels.numbers), so this limit has no effect.
_TURN_LIMIT_STD = 5
_FASTEST_TURN_DEG_S = 36_000
_WIDEST_TURN_DEG = 3600
_FASTEST_M_S = 20
_WIDEST_M = 2
_SLOWEST_M_S = 0.01


def convert_users(reader: ConfigReader, step: timedelta) -> tuple[dict[str, Any], dict[str, Keys]]:
    """Return the users by name, and the keys of each one's settings in the old file."""
    keys: Keys = ("users", "names")
    names = reader.get(keys, whole=True)
    if isinstance(names, str):
        names = names.split(",")
    if not isinstance(names, list | None) or not all(isinstance(n, str) for n in names or []):
        raise reader.wrong(keys, f"expected names separated by commas, got {shown(names)}")
    old_names = dict.fromkeys(stripped for name in names or [] if (stripped := name.strip()))
    if not old_names:
        reader.remark(keys, "no names; the scenario has no users")
    users: dict[str, Any] = {}
    paths: dict[str, Keys] = {}
    for old_name in old_names:
        if reader.get(("users", old_name)) is None:
            raise reader.wrong(
                keys, f"{old_name!r} has no section users.{old_name}: add it, or remove the name"
            )
        section = body_keys(reader, ("users", old_name))
        name = free_name(old_name, users)
        if name != old_name:
            reader.remark(("users", old_name), f"called {name}: names are letters, digits, _ and -")
        users[name], paths[name] = _body(reader, section, step), section
    for name in reader.get(("users",)) or {}:
        if name != "names" and name not in old_names:
            reader.get(("users", name), whole=True)
            reader.remark(
                ("users", name), "left out: users.names doesn't have it, so it was not used"
            )
    return users, paths


def body_keys(reader: ConfigReader, keys: Keys) -> Keys:
    """Return the keys of an entity's settings: those of the section that its `type` names."""
    kind = reader.text((*keys, "type")) or "base"
    if reader.get((*keys, kind)) is None:
        raise reader.wrong(keys, f"its type is {kind!r}, and it has no section of that name")
    if kind != "base":
        reader.remark(
            (*keys, "type"), f"{kind} is not a type of the published Fleet2D: read as base"
        )
    return (*keys, kind)


def _body(reader: ConfigReader, keys: Keys, step: timedelta) -> dict[str, Any]:
    """Return the keys that users and robots have in common."""
    result: dict[str, Any] = {}
    radius = reader.number((*keys, "radius"), minimum=0, maximum=_WIDEST_M)
    if radius:
        result["radius"] = radius
    else:
        result["radius"] = 0.01
        reader.remark(
            (*keys, "radius"), "missing or 0; a body has a radius, and this one has 0.01 m"
        )
    pose: Keys = (*keys, "pose_config", "init_pose")
    x, y, theta = (reader.number((*pose, key)) for key in ("x", "y", "theta"))
    if x is None or y is None:
        reader.remark(pose, "has no x and y; where it starts is drawn")
    else:
        result["start"] = [x, y]
    if theta is not None:
        result["start_heading_deg"] = theta
    color = reader.text((*keys, "color"))
    if color:
        result["color"] = color
    if reader.get((*keys, "seed")) is not None:
        reader.remark(
            (*keys, "seed"),
            "left out: each entity has its own random numbers, from simulation.seed",
        )
    return result | _walk(reader, (*keys, "pose_config", "meander_strategy"), step)


def _walk(reader: ConfigReader, keys: Keys, step: timedelta) -> dict[str, Any]:
    """Return the keys of the random walk."""
    if reader.get(keys) is None:
        reader.remark(keys, "missing; it stands still")
        return {}
    step_s = Fraction(micros(step), 10**6)
    speed = _speed(reader, (*keys, "lin_speed"), step_s)
    if speed is None:
        return {}
    return {
        "type": "meander",
        "speed": speed,
        "at_walls": "stay",
        **_turns(reader, (*keys, "ang_speed"), step_s),
    }


def _speed(reader: ConfigReader, keys: Keys, step_s: Fraction) -> float | None:
    """Return the speed [m/s], in metres per step in the old file; None: it stands still."""
    stride = reader.number(keys, minimum=0)
    speed = float(Fraction(repr(stride)) / step_s) if stride else 0.0
    if speed < _SLOWEST_M_S:
        reader.remark(keys, f"missing, 0 or below {_SLOWEST_M_S} m/s; it stands still")
        return None
    if speed > _FASTEST_M_S:
        raise reader.wrong(
            keys,
            f"{stride:g} m in a step of {float(step_s):g} s is {speed:g} m/s, more than the"
            f" limit of {_FASTEST_M_S} m/s",
        )
    reader.remark(
        keys,
        "metres per step there, a speed here, and the same rule of walking at this step, with"
        " at_walls: stay; a move across a wall is never made, where the published Fleet2D looked at"
        " the end of the move only",
    )
    return speed


def _turns(reader: ConfigReader, keys: Keys, step_s: Fraction) -> dict[str, float]:
    """Return the keys of random turns, whose deviation is in degrees per step in the old file."""
    deviation = abs(reader.number(keys, minimum=-_WIDEST_TURN_DEG, maximum=_WIDEST_TURN_DEG) or 0.0)
    if not deviation:
        return {"turn_std_deg": 0.0}
    limit = _TURN_LIMIT_STD * deviation / float(step_s)
    reader.remark(
        keys,
        "degrees per step there, per square root of a second here, and the same law at this step;"
        " turns are cut at 4.88 standard deviations, and turn_rate_deg, at 5, cuts none",
    )
    if limit > _FASTEST_TURN_DEG_S:
        limit = _FASTEST_TURN_DEG_S
        reader.remark(keys, f"turns are cut at {limit:g} deg/s, the fastest there is")
    return {"turn_std_deg": tidy(deviation / math.sqrt(step_s)), "turn_rate_deg": tidy(limit)}


def convert_robot(reader: ConfigReader, keys: Keys, step: timedelta) -> dict[str, Any]:
    """Return the robot whose settings are at `keys`."""
    return _body(reader, keys, step) | {"camera": _camera(reader, (*keys, "fov_config"))}


def _camera(reader: ConfigReader, keys: Keys) -> dict[str, Any]:
    """Return the camera; missing keys have the defaults of cameras here."""
    for key in ("load_fov_file", "lazy_compute"):
        if reader.get((*keys, key)) is not None:
            reader.remark(
                (*keys, key), "not needed: fields of view are computed exactly, when needed"
            )
    camera: dict[str, Any] = {"range": _range(reader, keys)}
    angle = reader.number((*keys, "angle"), above=0)
    if angle is None:
        reader.remark((*keys, "angle"), "missing; the camera gets the angle that cameras have here")
    else:
        camera["angle_deg"] = min(angle, 360.0)  # it saw in all directions from there on
    return camera


def _range(reader: ConfigReader, keys: Keys) -> list[float]:
    """Return the nearest and the farthest distance of the camera [m]."""
    distance = reader.number((*keys, "distance"), above=0)
    if distance is None:
        distance = Camera().range[1]
        reader.remark((*keys, "distance"), f"missing; {distance:g} m is used")
    limits = ("min_distance", "max_distance")
    lowest, highest = (reader.number((*keys, limit), minimum=0) for limit in limits)
    near, far = lowest or 0.0, distance if highest is None else highest
    if near >= far:
        raise reader.wrong(
            keys,
            f"the camera would see from {near:g} m to {far:g} m: the farthest distance must be"
            " beyond the nearest",
        )
    present = [(*keys, limit) for limit in limits if reader.get((*keys, limit)) is not None]
    if present and reader.text((*_SIMULATION, "fov_provider")) == FLASHLIGHT:
        reader.remark(
            present[0],
            f"left out, as they were ignored there: it sees from 0 to distance, {distance:g} m; for"
            f" these limits write camera.range: [{near:g}, {far:g}]",
            *present[1:],
        )
        return [0.0, distance]
    if present:
        reader.remark(
            present[0],
            f"accepted and ignored there, where it saw from 0 to distance, {distance:g} m; here"
            f" they hold, and camera.range is [{near:g}, {far:g}]",
            *present[1:],
        )
    return [near, far]


def free_name(name: str, used: Iterable[str]) -> str:
    """Return a valid name for an entity that is not used, as similar to `name` as possible."""
    valid = re.sub(r"[^A-Za-z0-9_-]", "_", name)
    valid = valid if valid[0].isalpha() else f"user_{valid}"
    numbered = (f"{valid}_{number}" for number in count(2))
    return next(candidate for candidate in chain([valid], numbered) if candidate not in used)
