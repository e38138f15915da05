"""Conversion of configurations of the published Fleet2D to scenarios, with remarks on changes."""

import os
import textwrap
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from fleet2d.configuration.documents import Document, read_document
from fleet2d.errors import ArtifactError, InputError, ScenarioError
from fleet2d.floorplan.formats.houseexpo import read_houseexpo
from fleet2d.floorplan.home import Home
from fleet2d.published.sections import (
    ConfigReader,
    body_of,
    convert_floorplan,
    convert_outputs,
    convert_robot,
    convert_sight,
    convert_simulation,
    convert_users,
    free_name,
    read_step,
)
from fleet2d.scenario.model import Scenario, load_scenario
from fleet2d.storage.files import is_disk_full, write_atomically


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
    home = Home(read_houseexpo(plan, data["floorplan"]["cell"]))
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


# The new file


def _header(old: Path, remarks: list[str]) -> str:
    """Return the comment at the top: the source of the scenario, and all remarks."""
    text = (
        f"Converted by `fleet2d convert` from {old.name}, a configuration of the published Fleet2D."
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
