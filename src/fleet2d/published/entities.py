"""Conversion of the users and the robot of the published Fleet2D.

Its poses are metres in the plan's own coordinates and degrees counter-clockwise from +x, as here;
it uses pixels only to round walls and to look up free space.
"""

import math
import re
from collections.abc import Iterable
from datetime import timedelta
from fractions import Fraction
from itertools import chain, count
from typing import Any

from fleet2d.configuration.documents import Keys
from fleet2d.configuration.problems import shown
from fleet2d.configuration.units import micros
from fleet2d.published.reader import ConfigReader, tidy
from fleet2d.sight.camera import Camera

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
    radius = reader.number((*keys, "radius"), least=0, most=_WIDEST_M)
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
    stride = reader.number(keys, least=0)
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
    deviation = abs(reader.number(keys, least=-_WIDEST_TURN_DEG, most=_WIDEST_TURN_DEG) or 0.0)
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
    lowest, highest = (reader.number((*keys, limit), least=0) for limit in limits)
    near, far = lowest or 0.0, distance if highest is None else highest
    if near >= far:
        raise reader.wrong(
            keys,
            f"the camera would see from {near:g} m to {far:g} m: the farthest distance must be"
            " beyond the nearest",
        )
    present = [(*keys, limit) for limit in limits if reader.get((*keys, limit)) is not None]
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
