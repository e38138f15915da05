"""Converting configurations of the published Fleet2D: every key, every remark, every refusal."""

import errno
import math
import os
import sys
from datetime import datetime
from pathlib import Path

import pytest
import yaml
from tools.convert_published import convert_file, main

import fleet2d
from fleet2d.cli.__main__ import app
from fleet2d.configuration.documents import read_document
from fleet2d.entities.entity import Robot, User
from fleet2d.entities.meander import Meander
from fleet2d.errors import ArtifactError, FloorPlanError, InputError, ScenarioError
from fleet2d.scenario.load import load_scenario
from fleet2d.scenario.model import Scenario

PLAN = "658e5214673c7a4e25b458e56bdb6144.json"
OLD = """\
simulation:
  start_ts: !!timestamp '2010-11-17 13:12:11'
  duration:
    hours: 2
    days: 0
  delta:
    seconds: 1
    minutes: 0
  speedup: null
  seed: 4
  visualization:
    visualize: False
    every_n_steps: 100
  show_progress: True
  outputs:
    save: True
    every_n_steps: 600
    output_dir: 'somewhere'
    prefix: null

floorplan:
  type: he
  he:
    json_fpath: "plan.json"
    ppm: 20
    border_pad: 1

users:
  names: "user0,user1"
  user0:
    type: base
    base:
      radius: 0.2
      pose_config:
        init_pose:
          x: 8.0
          y: 3.0
          theta: 45
        meander_strategy:
          lin_speed: 0.1
          ang_speed: 15
      color: blue
  user1:
    type: base
    base:
      radius: 0.25
      pose_config:
        init_pose:
          x: 7.0
          y: 4.0
          theta: 150
        meander_strategy:
          lin_speed: 0.1
          ang_speed: 15
      color: green

robot:
  type: base
  base:
    radius: 0.1
    fov_config:
      distance: 3.0
      angle: 108
      load_fov_file: 'views.pickle'
      lazy_compute: True
    pose_config:
      init_pose:
        x: 4.0
        y: 2.0
        theta: 45
      meander_strategy:
        lin_speed: 0.1
        ang_speed: 15
    color: red
"""
NEW = """\
simulation: {start: '2010-11-17T13:12:11', duration: 2 h, step: 1 s, seed: 4, speedup: null}
floorplan: {type: houseexpo, path: plan.json, cell: 0.05}
users:
  user0:
    radius: 0.2
    start: [8.0, 3.0]
    start_heading_deg: 45.0
    color: blue
    type: meander
    speed: 0.1
    at_walls: stay
    turn_std_deg: 15.0
    turn_rate_deg: 75.0
  user1:
    radius: 0.25
    start: [7.0, 4.0]
    start_heading_deg: 150.0
    color: green
    type: meander
    speed: 0.1
    at_walls: stay
    turn_std_deg: 15.0
    turn_rate_deg: 75.0
robots:
  robot:
    radius: 0.1
    start: [4.0, 2.0]
    start_heading_deg: 45.0
    color: red
    type: meander
    speed: 0.1
    at_walls: stay
    turn_std_deg: 15.0
    turn_rate_deg: 75.0
    camera:
      range: [0.0, 3.0]
      angle_deg: 108.0
artifacts: {trajectories: 10 min}
"""
CASES = yaml.safe_load((Path(__file__).parent / "converted.yaml").read_text(encoding="utf-8"))
WALKS = ("users.user0.base", "users.user1.base", "robot.base")
USUAL = [
    "floorplan.he.ppm: the grid's cells are 0.05 m; walls and poses are not rounded to them",
    "floorplan.he.border_pad: left out: the grid has a margin of its own",
    f"{', '.join(f'{walk}.pose_config.meander_strategy.lin_speed' for walk in WALKS)}: metres per"
    " step there, a speed here, and the same rule of walking at this step, with at_walls: stay; a"
    " move across a wall is never made, where the published Fleet2D looked at the end of the move"
    " only",
    f"{', '.join(f'{walk}.pose_config.meander_strategy.ang_speed' for walk in WALKS)}: degrees"
    " per step there, per square root of a second here, and the same law at this step; turns"
    " are cut at 4.88 standard deviations, and turn_rate_deg, at 5, cuts none",
    "simulation.seed: the same seed draws other numbers here: the walks are of the same kind, not"
    " the same",
    "simulation.outputs.output_dir: left out: `fleet2d run --out DIR` says where a run is stored",
    "simulation.outputs.save, simulation.outputs.every_n_steps: poses are stored every 10 min,"
    " observations and events in full; the published Fleet2D wrote nothing",
    "robot.base.fov_config.load_fov_file, robot.base.fov_config.lazy_compute: not needed:"
    " fields of view are computed exactly, when needed",
]


@pytest.fixture
def folder(tmp_path, shared_data, monkeypatch):
    """A folder with the plan that the published Fleet2D ships with."""
    (tmp_path / "home").mkdir()
    (tmp_path / "home" / "plan.json").write_bytes((shared_data / "houseexpo" / PLAN).read_bytes())
    monkeypatch.chdir(tmp_path)
    return tmp_path / "home"


def written(folder: Path, *changes: tuple[str, str], text=OLD) -> Path:
    for before, after in changes:
        assert before in text
        text = text.replace(before, after, 1)
    (folder / "old.yaml").write_text(text)
    return folder / "old.yaml"


def converted(folder: Path, *changes: tuple[str, str]) -> tuple[list[str], Scenario]:
    remarks = convert_file(written(folder, *changes), folder / "new.yaml")
    return remarks, load_scenario(folder / "new.yaml")


def refused(folder: Path, *changes: tuple[str, str], text=OLD):
    with pytest.raises(InputError) as caught:
        convert_file(written(folder, *changes, text=text), folder / "new.yaml")
    assert ["old.yaml", "plan.json"] == sorted(path.name for path in folder.iterdir())
    return str(caught.value).replace(str(folder) + os.sep, "")


def walk(entity: User | Robot) -> Meander:
    (behavior,) = entity.behaviors
    return behavior


def plan_of(scenario: Scenario) -> tuple[str, Path, float]:
    plan = scenario.floorplan
    return plan.type_name, plan.path, plan.cell


# Every key


def test_whole_configuration_becomes_the_scenario_it_means(folder):
    remarks, _ = converted(folder)
    assert remarks == USUAL
    assert (folder / "new.yaml").read_text().endswith(f"\n\n{NEW}")


def test_remarks_are_in_the_new_file_as_comments(folder):
    remarks, _ = converted(folder, ("ppm: 20", 'ppm: 20\n    "odd\\nkey": 1'))
    lines = (folder / "new.yaml").read_text().splitlines()
    comment = " ".join(" ".join(line[2:] for line in lines if line.startswith("#")).split())
    assert comment.startswith(
        "Converted by `tools/convert_published.py` from old.yaml, a configuration of"
    )
    assert any("odd\nkey" in remark for remark in remarks)
    for remark in remarks:
        assert remark.replace("\n", "?") in comment


def test_walk_of_one_step_is_a_tenth_of_a_metre_and_turns_fifteen_degrees(folder):
    _, scenario = converted(folder)
    simulation = fleet2d.Simulation(scenario)
    moves, turns = [], []
    for _ in range(400):
        before = simulation.state["user0"]
        simulation.advance()
        after = simulation.state["user0"]
        moves.append(math.hypot(after["x"] - before["x"], after["y"] - before["y"]))
        if moves[-1]:  # no wall was in the way
            turns.append(math.remainder(after["heading"] - before["heading"], math.tau))
    assert 0.1 == pytest.approx(max(moves), abs=2e-3)
    std = math.degrees(math.sqrt(sum(turn**2 for turn in turns) / len(turns)))
    assert 15 == pytest.approx(std, rel=0.15)


@pytest.mark.parametrize("case", CASES, ids=[case["name"] for case in CASES])
def test_change_of_the_configuration_changes_the_scenario(folder, case):
    every_remark, _ = converted(folder, *case["change"].items())
    remarks = [
        remark.replace(str(folder), "home") for remark in every_remark if remark not in USUAL
    ]
    for key, value in case.get("becomes", {}).items():
        part = yaml.safe_load((folder / "new.yaml").read_text())
        for name in key.split("."):
            part = (part or {}).get(name)
        assert value == part, key
    if "among" in case:
        assert set(case["among"]) <= set(remarks)
    else:
        assert case.get("remarks", []) == remarks
    assert not any(case.get("lacks", "\0") in remark for remark in every_remark)


def test_path_counts_from_the_top_of_a_repository_above_the_file(folder):
    deep = folder / "src" / "configs"
    deep.mkdir(parents=True)
    (deep / "old.yaml").write_text(OLD)
    convert_file(deep / "old.yaml", deep / "new.yaml")
    assert "../../plan.json" == read_document(deep / "new.yaml").data["floorplan"]["path"]
    assert folder / "plan.json" == plan_of(load_scenario(deep / "new.yaml"))[1]


def test_path_of_no_file_is_kept_and_remarked(folder):
    old = written(folder, ('"plan.json"', '"f2d/he/gone.json"'))
    remarks = convert_file(old, folder / "new.yaml")
    assert [
        "floorplan.he.json_fpath: there is no file f2d/he/gone.json beside old.yaml, in the"
        " folders above it or in the current one; kept as written, it counts from the folder of"
        " new.yaml: put the plan there, or run with floorplan.path=PLAN.json. The starts of"
        " users and robot were not checked"
    ] == [remark for remark in remarks if remark not in USUAL]
    with pytest.raises(ScenarioError, match=r"floorplan\.path: no such file: .*gone\.json"):
        load_scenario(folder / "new.yaml")
    (folder / "f2d" / "he").mkdir(parents=True)
    (folder / "plan.json").rename(folder / "f2d" / "he" / "gone.json")
    assert 7200 == load_scenario(folder / "new.yaml").simulation.steps


def test_start_in_a_wall_moves_to_the_nearest_free_point(folder):
    remarks, scenario = converted(folder, ("x: 8.0", "x: -3.0"))
    (moved,) = [remark for remark in remarks if remark not in USUAL]
    start = scenario.users["user0"].start
    assert (
        "users.user0.base.pose_config.init_pose: [-3.0, 3.0] is in a wall or nearer to one than"
        f" its radius, 0.2 m: it starts at {list(start)}, the nearest free point"
    ) == moved
    fleet2d.Simulation(scenario)  # would refuse a start in a wall


def test_missing_parts_get_what_the_remarks_say(folder):
    text = """\
simulation: {duration: {hours: 2}}
floorplan: {type: he, he: {json_fpath: plan.json}}
users: {names: ana, ana: {base: {radius: 0, seed: 7}}}
robot: {base: {radius: 0.1, fov_config: {}}}
"""
    (folder / "old.yaml").write_text(text)
    remarks = convert_file(folder / "old.yaml", folder / "new.yaml")
    assert [
        "simulation.delta: missing; the step is 1 s",
        "floorplan.he.ppm: missing; the grid's cells are 0.05 m; walls and poses are not rounded"
        " to them",
        "users.ana.base.radius: missing or 0; a body has a radius, and this one has 0.01 m",
        "users.ana.base.pose_config.init_pose, robot.base.pose_config.init_pose: has no x and y;"
        " where it starts is drawn",
        "users.ana.base.seed: left out: each entity has its own random numbers, from"
        " simulation.seed",
        "users.ana.base.pose_config.meander_strategy, robot.base.pose_config.meander_strategy:"
        " missing; it stands still",
        "simulation.start_ts: missing; the run starts on 2026-01-05, a Monday, at 00:00",
        "robot.base.fov_config.distance: missing; 4.5 m is used",
        "robot.base.fov_config.angle: missing; the camera gets the angle that cameras have here",
    ] == remarks
    scenario = load_scenario(folder / "new.yaml")
    assert datetime(2026, 1, 5) == scenario.simulation.start
    assert 0.01 == scenario.users["ana"].radius
    assert 2 == len(fleet2d.Simulation(scenario).state)


# Refusals


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ("hours: 2", "month: 2", "old.yaml:3: simulation.duration: expected a mapping of days, ho"),
        ("hours: 2", "seconds: 0.5", "simulation.duration: 0.5 s is shorter than one step, delta:"),
        ("seconds: 1", "seconds: 0", "old.yaml:6: simulation.delta: expected a step longer than"),
        ("'2010-11-17 13:12:11'", "2010-02-31", "simulation.start_ts: expected a date and time l"),
        ("speedup: null", "speedup: 0", "simulation.speedup: expected a number above 0, got 0"),
        ("seed: 4", "seed: 0.5", "simulation.seed: expected a whole number of 0 or more, got 0"),
        ("every_n_steps: 600", "every_n_steps: 0", "every_n_steps: expected a whole number of 1"),
        ("type: he", "type: svg", "floorplan.type: expected he (HouseExpo), the only type"),
        ('"plan.json"', "null", "floorplan.he.json_fpath: missing: give the path of a HouseExpo J"),
        ("user0,user1", "user0,bob", "users.names: 'bob' has no section users.bob: add it, or remove"),
        ("type: base", "type: cat", "users.user0: its type is 'cat', and it has no section of tha"),
        ("radius: 0.2", "radius: wide", "radius: expected a number of 0 or more, 2 at most"),
        ("x: 8.0", "x: [1]", "users.user0.base.pose_config.init_pose.x: expected a number, got [1"),
        ("x: 8.0", "x: 8.0e+9", "can't be converted to a valid scenario: users.user0.start: expected"),
        ("lin_speed: 0.1", "lin_speed: 30", "lin_speed: 30 m in a step of 1 s is 30 m/s, more th"),
        ("ang_speed: 15", "ang_speed: 1.0e+9", "ang_speed: expected a number of -3600"),
        (
            "distance: 3.0",
            "distance: 3.0\n      min_distance: 3",
            "robot.base.fov_config: the camera would see from 3 m to 3 m: the farthest distance"
            " must",
        ),
        ("    base:\n      radius", "    base: 3\n    bass:\n      radius", "users.user0.base: ex"),
        ("!!timestamp", "!!python/name:os.sep", "a !!python tag runs code, so none is read"),
        ("seed: 4", "seed: [", "old.yaml:12: not valid YAML: "),
    ],
)  # fmt: skip
def test_wrong_value_is_refused(folder, before, after, message):
    assert message in refused(folder, (before, after))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "old.yaml is empty"),
        ("[1, 2]", "old.yaml: a scenario is a mapping"),
        ("floorplan: {type: he}", "and robot: there is no section simulation"),
        ("simulation: {duration: 1}", "old.yaml is not a configuration of the published Fleet2D"),
        (
            "simulation: {start: 2026-01-05}\nfloorplan: {}",
            "old.yaml is a scenario already: run it",
        ),
        ("simulation: {}\nfloorplan: {type: he, he: {json_fpath: plan.json}}", "duration: missing"),
    ],
)
def test_other_files_are_refused(folder, text, message):
    assert message in refused(folder, text=text)


def test_no_file_is_refused(folder):
    with pytest.raises(InputError, match=r"there is no file .*none\.yaml"):
        convert_file(folder / "none.yaml", folder / "new.yaml")


def test_plan_that_is_no_plan_is_refused(folder):
    (folder / "plan.json").write_text("{}")
    with pytest.raises(FloorPlanError, match="is not a floor plan that Fleet2D can read"):
        convert_file(written(folder), folder / "new.yaml")
    assert not (folder / "new.yaml").exists()


def test_existing_file_is_not_overwritten(folder):
    (folder / "new.yaml").write_text("mine")
    with pytest.raises(InputError, match="exists: choose another name, or remove it"):
        convert_file(written(folder), folder / "new.yaml")
    assert "mine" == (folder / "new.yaml").read_text()


@pytest.mark.parametrize(
    ("code", "kind", "message"),
    [
        (errno.ENOSPC, ArtifactError, "the disk is full: "),
        (errno.EROFS, InputError, "can't be written: Read-only file system; choose another place"),
    ],
)
def test_file_that_cannot_be_written_leaves_nothing(folder, monkeypatch, code, kind, message):
    def fail(descriptor):
        raise OSError(code, os.strerror(code))

    old = written(folder)
    monkeypatch.setattr(os, "fsync", fail)
    with pytest.raises(kind, match=message):
        convert_file(old, folder / "new.yaml")
    assert ["old.yaml", "plan.json"] == sorted(path.name for path in folder.iterdir())


# The command line


def call(monkeypatch: pytest.MonkeyPatch, *arguments):
    monkeypatch.setattr(sys, "argv", ["convert_published.py", *arguments])
    return main()


def test_script_converts_and_the_scenario_is_valid(folder, monkeypatch, capsys):
    from typer.testing import CliRunner

    written(folder)
    assert 0 == call(monkeypatch, "home/old.yaml", "home/new.yaml")
    output = capsys.readouterr().out.splitlines()
    assert [*(f"note: {remark}" for remark in USUAL), "home/new.yaml"] == output
    result = CliRunner().invoke(app, ["validate", "home/new.yaml"])
    assert 0 == result.exit_code
    assert result.output.startswith("ok: 2 users and 1 robot in ")


def test_script_says_what_is_wrong_in_a_line(folder, monkeypatch, capsys):
    assert 2 == call(monkeypatch, "home/old.yaml", "home/new.yaml")
    assert "error: there is no file home/old.yaml.\n" == capsys.readouterr().err
