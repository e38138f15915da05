"""Conversion of `simulation` and `floorplan` in configurations of the paper's simulator."""

import os
from contextlib import suppress
from datetime import date, datetime, time, timedelta
from pathlib import Path
from typing import Any

from pydantic_core import PydanticCustomError

from fleet2d.configuration.documents import Keys
from fleet2d.configuration.problems import shown
from fleet2d.configuration.units import format_duration, parse_duration
from fleet2d.floorplan.lattice import MAX_CELL_M, MIN_CELL_M
from fleet2d.published.reader import ConfigReader, tidy

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
    seed = reader.integer((*_SIMULATION, "seed"), least=0)
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


def convert_sight(reader: ConfigReader) -> dict[str, Any]:
    """Return the section `sight`: the method that corresponds to the old `fov_provider`."""
    keys: Keys = (*_SIMULATION, "fov_provider")
    provider = reader.text(keys)
    if provider == "Flashlight":
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
    every = reader.integer((*keys, "every_n_steps"), least=1)
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
