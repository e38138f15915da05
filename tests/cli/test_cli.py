"""The command line: what each command prints, stores and returns."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import jsonschema
import pyarrow.parquet as pq
import pytest
import yaml
from tests.scenes import every_step, everything, flat_path, fleet2d_process, scenario

import fleet2d as package
from fleet2d.cli import main
from fleet2d.configuration.built_in import COMPONENTS
from fleet2d.configuration.components import components
from fleet2d.configuration.documents import read_document
from fleet2d.scenario.compose import bundled_path

PNG = b"\x89PNG\r\n\x1a\n"
SUMMARY = {
    "run_dir": str, "steps": int, "simulated_s": float, "seed": int, "digest": str, "wall_s": dict,
    "speedup": float, "peak_rss_mb": float, "metrics": dict,
}  # fmt: skip


def written(content, name="home.yaml") -> Path:
    path = Path(name)
    path.write_text(yaml.safe_dump(content))
    return path


def small(**sections):
    return scenario(
        "5 min",
        users={"ana": {"type": "meander"}},
        robots={"astro": {"type": "patrol"}},
        metrics={"room_share": {}, "sightings": {}},
        **sections,
    )


# --- run ---------------------------------------------------------------------------------------


def test_json_is_exactly_one_object_with_the_documented_keys(fleet2d):
    code, out, err = fleet2d("run", written(small()), "--out", "run", "--json")
    assert (0, 1) == (code, out.count("\n"))
    summary = json.loads(out)
    assert SUMMARY.keys() == summary.keys()
    for key, kind in SUMMARY.items():
        assert isinstance(summary[key], kind), key
    wall = summary["wall_s"]
    assert {"setup", "simulate", "save", "total"} == wall.keys()
    assert (300, 300.0, 4) == tuple(summary[k] for k in ("steps", "simulated_s", "seed"))
    assert Path("run").resolve() == Path(summary["run_dir"]).resolve()
    phases = wall["setup"] + wall["simulate"] + wall["save"]
    assert summary["speedup"] == pytest.approx(300 / phases)
    assert phases < wall["total"]
    assert 10 < summary["peak_rss_mb"] < 10_000
    stored = package.open_run("run")
    assert (stored.digest, stored.metrics) == (summary["digest"], summary["metrics"])
    assert {"room_share", "sightings"} == summary["metrics"].keys()
    assert "Traceback" not in err


def test_a_summary_for_people_names_what_matters(fleet2d):
    code, out, _ = fleet2d("run", written(small()), "--out", "run")
    stored = package.open_run("run")
    assert 0 == code
    for word in (
        "x real time",
        "room_share",
        "sightings",
        "ana",
        "seed 4",
        (stored.digest or "")[:16],
        "stored in",
    ):
        assert word in out
    assert "more numbers" not in out
    with pytest.raises(json.JSONDecodeError):
        json.loads(out)


def test_the_table_shows_what_matters_of_many_numbers_and_json_all(fleet2d):
    content = small(algorithms={"rtp": {"type": "real_time_presence"}})
    content["metrics"] = {
        "rtp_score": {"of": "rtp", "period": "5 min"},
        "ltp_gap": {"of": "rtp", "period": "5 min"},
    }
    code, out, _ = fleet2d("run", written(content), "--out", "people", "--seed", 4)
    assert 0 == code
    everything = package.open_run("people").metrics
    gaps = everything["ltp_gap"]["ana"]
    rows = [line.split()[0] for line in out.splitlines() if line.startswith("  ")]
    scores = ["log_loss", "top_1", "ece", "skill"]
    worst = max((room for room in gaps if room != "mean"), key=lambda room: gaps[room])
    assert ["mean", worst, *scores] == rows  # anyone is ana
    scored = everything["rtp_score"]["ana"]
    hidden = sum(map(len, scored.values())) - 4 + 2 * len(gaps) - 2
    assert f"{hidden} more numbers are in the run" in out
    code, out, _ = fleet2d("run", written(content), "--out", "programs", "--seed", 4, "--json")
    assert everything == json.loads(out)["metrics"]


def test_quiet_prints_nothing_and_with_json_the_object_alone(fleet2d):
    assert (0, "", "") == fleet2d("run", written(small()), "--out", "quiet", "--quiet")
    code, out, err = fleet2d("run", written(small()), "--out", "run", "--quiet", "--json")
    assert (0, "") == (code, err)
    assert Path("run").resolve() == Path(json.loads(out)["run_dir"]).resolve()


def test_without_out_runs_are_numbered_by_the_name_of_their_scenario(fleet2d):
    scenario_file = written(small())
    named = written(small() | {"name": "quiet_week"}, "other.yaml")
    for file in (scenario_file, scenario_file, named):
        assert 0 == fleet2d("run", file, "--quiet")[0]
    Path("runs/home-004").mkdir()
    assert 0 == fleet2d("run", scenario_file, "--quiet")[0]
    assert 0 == fleet2d("run", scenario_file, "--quiet")[0]
    names = sorted(path.name for path in Path("runs").iterdir() if any(path.iterdir()))
    assert ["home-001", "home-002", "home-003", "home-005", "quiet_week-001"] == names


def test_without_a_scenario_the_family_runs_changed_as_told(fleet2d):
    arguments = [
        "simulation.duration.days=1",
        "metrics.ltp_error=null",
        "--seed",
        "7",
        "--json",
        "--out",
        "run",
    ]
    code, out, _ = fleet2d("run", *arguments)
    assert 0 == code
    summary = json.loads(out)
    assert (86400, 7) == (summary["steps"], summary["seed"])
    run = package.open_run("run")
    assert {"users": ["ana", "ben", "cleo"], "robots": ["astro"]} == run.manifest["entities"]
    assert "ltp_error" not in run.metrics
    assert "sightings" in run.metrics


def test_seed_wins_over_the_scenario_and_decides_the_run(fleet2d):
    scenario_file = written(small())
    digests = []
    for number, arguments in enumerate((["--seed", "9"], ["simulation.seed=9"], ["--seed", "0"])):
        code, out, _ = fleet2d("run", scenario_file, *arguments, "--json", "--out", f"run{number}")
        assert 0 == code
        digests.append(json.loads(out)["digest"])
    assert digests[0] == digests[1] != digests[2]


def test_progress_is_shown_on_a_terminal_only(fleet2d):
    done = fleet2d_process("run", str(written(small())), "--out", "run", cwd=Path.cwd())
    assert 0 == done.returncode
    assert "x real time" not in done.stderr
    assert "\x1b" not in done.stdout + done.stderr


# --- validate, schema, components --------------------------------------------------------------


def test_validate_says_what_would_run_and_writes_nothing(fleet2d):
    code, out, err = fleet2d("validate", written(small()), "simulation.step=2 s")
    assert (2, "") == (code, err)
    assert "\nwrong: a body of radius 0.15 m can't get to storage_1" in out
    for word in ("wrong", "1 user", "1 robot", "flat", "150 steps of 2 s", "2026-01-05 07:00"):
        assert word in out
    assert ["home.yaml"] == [path.name for path in Path().iterdir()]
    assert 0 == fleet2d("validate", "bundled:paper")[0]
    assert "can't get to storage_1" in fleet2d("validate", flat_path())[1]


def test_a_home_in_which_something_will_not_work_runs_unless_strict(fleet2d):
    file = written(small())
    code, out, err = fleet2d("run", file, "--out", "run")
    wrong = "wrong: a body of radius 0.15 m can't get to storage_1 (4.0 m2)"
    assert (0, f"{wrong}\n") == (code, err)
    assert f"note: {wrong}" in out
    assert wrong in json.loads(Path("run/manifest.json").read_text())["notes"]
    code, out, err = fleet2d("run", file, "--out", "other", "--strict")
    assert (2, "") == (code, out)
    assert f"{wrong}\nerror: flat: --strict refuses" in err


@pytest.fixture(scope="module")
def schema():
    from fleet2d.scenario.schema import schema as scenario_schema

    return scenario_schema()


@pytest.mark.slow
def test_the_schema_is_valid_and_says_which_it_is(fleet2d, schema):
    code, out, err = fleet2d("components", "--schema", "scenario")
    assert (0, "", schema) == (code, err, json.loads(out))
    jsonschema.validators.validator_for(schema).check_schema(schema)
    assert schema["$schema"].startswith("https://json-schema.org/")


def test_the_base_scenario_and_ours_fit_the_schema(schema):
    validator = jsonschema.validators.validator_for(schema)(schema)
    base = read_document(bundled_path("paper")).data
    for content in (base, small(), everything()):
        plain = json.loads(json.dumps(content, default=str))
        assert [] == [error.message for error in validator.iter_errors(plain)]


@pytest.mark.parametrize(
    "wrong",
    [
        {"users": {"ana": {"type": "meander", "turn_std": 3}}},
        {"robots": {"astro": {"camera": {"angle": 3}}}},
        {"simulation": {"durations": "1 h"}},
        {"users": {"ana": {"type": "meander", "speed": [3]}}},
        {
            "algorithms": {
                "x": {
                    "type": "long_term_presence",
                    "estimator": {"type": "likelihood", "stagez": 2},
                }
            }
        },
    ],
)
def test_what_is_wrong_does_not_fit_the_schema(schema, wrong):
    validator = jsonschema.validators.validator_for(schema)(schema)
    assert list(validator.iter_errors(small() | wrong))


@pytest.mark.slow
def test_components_lists_every_type_with_its_fields(fleet2d):
    code, out, _ = fleet2d("components")
    assert 0 == code
    for kind in COMPONENTS:
        for name, cls in components(kind).items():
            assert f"{kind}: {name}" in out
            for field in cls.model_fields:
                assert re.search(rf"^ +{field}:", out, re.MULTILINE), (name, field)
    assert "    and the keys of Behavior, BeliefBehavior\n" in out
    assert "shared: Behavior\n" in out
    for word in ("long_term_presence", "[deg", "dwell", "5 min"):
        assert word in out


def test_components_as_json_are_a_list(fleet2d):
    code, out, _ = fleet2d("components", "--json")
    assert 0 == code
    listed = {(entry["kind"], entry["type"]) for entry in json.loads(out)}
    types = {(kind, name) for kind in COMPONENTS for name in components(kind)}
    assert types == {entry for entry in listed if entry[0] in COMPONENTS}
    assert {("behavior", "schedule"), ("floorplan", "bundled"), ("metric", "distance")} <= listed
    assert {("presence_estimator", "fremen"), ("presence_model", "hmm")} <= listed


# --- show --------------------------------------------------------------------------------------


def test_show_draws_a_plan_and_says_where(fleet2d):
    assert (0, "flat.png\n") == fleet2d("show", flat_path())[:2]
    assert Path("flat.png").read_bytes().startswith(PNG)
    assert (0, "home.svg\n") == fleet2d("show", flat_path(), "--out", "home.svg")[:2]
    drawn = Path("home.svg").read_text()
    for word in ("<svg", "Kitchen", "Bedroom", "Bathroom"):
        assert word in drawn
    assert 2 == len(list(Path().iterdir()))


def test_show_without_a_plan_draws_the_bundled_home(fleet2d):
    assert (0, "family_home.png\n") == fleet2d("show")[:2]
    assert Path("family_home.png").read_bytes().startswith(PNG)


@pytest.mark.slow
def test_show_draws_a_run_in_its_home(fleet2d):
    assert 0 == fleet2d("run", written(small()), "--out", "run", "--quiet")[0]
    code, out, err = fleet2d("show", "run")
    assert (0, "") == (code, err)
    assert Path(out.strip()).read_bytes().startswith(PNG)
    assert 0 == fleet2d("show", "run", "--out", "run.svg")[0]
    drawn = Path("run.svg").read_text()
    for word in ("<svg", "ana", "astro"):
        assert word in drawn
    assert [] == package.open_run("run").verify()


def without_matplotlib(folder, *arguments):
    (folder / "matplotlib.py").write_text("raise ImportError('No module named matplotlib')")
    script = "import sys; sys.path.insert(0, sys.argv.pop(1)); from fleet2d.cli import main; main()"
    return subprocess.run(
        [sys.executable, "-c", script, str(folder), *arguments],
        capture_output=True, text=True, check=False,
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(folder), *sys.path])},
    )  # fmt: skip


@pytest.mark.parametrize("command", [["show"], ["show", "--checkup"]])
def test_picture_without_matplotlib_says_what_to_install(tmp_path, command):
    done = without_matplotlib(tmp_path, *command, "--out", str(tmp_path / "x.png"))

    assert done.returncode in (1, 2), done.stderr
    assert "Traceback" not in done.stderr
    for word in ("matplotlib", "fleet2d[viz]"):
        assert word in done.stderr


def test_validate_checks_a_floor_plan_without_matplotlib(tmp_path):
    done = without_matplotlib(tmp_path, "validate", "family_home")

    assert 0 == done.returncode, done.stderr
    assert "ok: nothing wrong" in done.stdout


# --- reproduce ---------------------------------------------------------------------------------


def test_reproduce_says_reproduced(fleet2d):
    assert 0 == fleet2d("run", written(everything("5 min")), "--out", "run", "--quiet")[0]
    code, out, err = fleet2d("verify", "run", "--again")
    assert (0, "") == (code, err)
    assert f"reproduced: digest {package.open_run('run').digest}" in out


def test_reproduce_fails_on_a_table_that_was_tampered_with(fleet2d):
    assert 0 == fleet2d("run", written(small()), "--out", "run", "--quiet")[0]
    file = Path("run/trajectories.parquet")
    rows = pq.read_table(file)
    x = rows["x"].to_numpy().copy()
    x[0] += 1e-9
    changed = rows.set_column(rows.column_names.index("x"), rows.schema.field("x"), [x])
    pq.write_table(changed, file)
    code, _, err = fleet2d("verify", "run", "--again")
    assert 1 == code
    assert "not reproduced" in err
    assert "trajectories" in err


# --- Interruption, help ------------------------------------------------------------------------


def interrupted(
    folder: Path, *arguments, ready: Callable[[], bool]
) -> subprocess.CompletedProcess[str]:
    """Run the command line in a process, and send it Ctrl-C once it is ready."""
    process = subprocess.Popen(
        [sys.executable, "-m", "fleet2d.cli", *arguments],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=folder,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
    )  # fmt: skip
    while not ready() and process.poll() is None:
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate()
    return subprocess.CompletedProcess(arguments, process.returncode, out, err)


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="signals are posix")
def test_ctrl_c_leaves_a_readable_run(tmp_path):
    (tmp_path / "home.yaml").write_text(yaml.safe_dump(every_step("300 d")))
    journal = tmp_path / "run" / "unfinished" / "journal"

    def has_rows():
        return journal.exists() and journal.stat().st_size > 1000

    done = interrupted(tmp_path, "run", "home.yaml", "--out", "run", "--json", ready=has_rows)
    assert 130 == done.returncode, done.stderr
    assert "" == done.stdout
    assert "interrupted at 2026-" in done.stderr
    assert "run" in done.stderr
    assert "Traceback" not in done.stderr
    stored = package.open_run(tmp_path / "run")
    assert "interrupted" == stored.status
    assert stored.manifest["steps"] > 0
    assert stored.tables["trajectories"].num_rows > 0
    assert [] == stored.verify()
    assert [] == list((tmp_path / "run").glob("*.partial"))


@pytest.mark.parametrize("command", ["run", "validate"])
def test_ctrl_c_during_set_up_exits_130(fleet2d, monkeypatch, command):
    def interrupt(*args, **kwargs):
        raise KeyboardInterrupt

    scenario_file = written(small())
    monkeypatch.setattr("fleet2d.engine.setup.Home", interrupt)
    code, out, err = fleet2d(command, scenario_file)
    assert (130, "") == (code, out)
    assert "Traceback" not in err
    assert ["home.yaml"] == [path.name for path in Path().iterdir()]


# What the bundled scenario doesn't use, and other scenarios or commands do.
UNUSED = (
    "fleet2d.algorithms.presence.exposure_ratio",
    "fleet2d.algorithms.presence.model",
    "fleet2d.engine.expectations",
    "fleet2d.engine.repeat",
    "fleet2d.entities.robots.search",
    "fleet2d.entities.users.scripted",
    "fleet2d.expectations",
    "fleet2d.learning.fit",
    "fleet2d.interventions.bodies",
    "fleet2d.interventions.home",
    "fleet2d.interventions.robots",
    "fleet2d.logs",
    "fleet2d.viewing.pictures",
    "fleet2d.studies",
    "fleet2d.testing",
    "fleet2d.viewing",
)
# The packages of others that a run needs, and what these need in turn.
USED = {
    "annotated_doc", "annotated_types", "cloudpickle", "cython_runtime", "numpy", "pyarrow", "pydantic", "pydantic_core", "shapely",
    "shellingham", "typer", "typing_extensions", "typing_inspection", "yaml",
}  # fmt: skip


def test_file_that_can_not_be_written_is_one_line(monkeypatch, capsys, tmp_path):
    def fail(**_):
        (tmp_path / "missing" / "table.csv").write_text("")

    monkeypatch.setattr("fleet2d.cli.__main__.app", fail)

    with pytest.raises(SystemExit) as end:
        main()

    expected = f"error: {tmp_path}/missing/table.csv can't be read or written: No such file"
    assert 1 == end.value.code
    assert capsys.readouterr().err.startswith(expected)


@pytest.mark.slow
def test_run_imports_only_what_its_scenario_needs(tmp_path):
    script = """
import json, sys
from fleet2d.cli import main
before = set(sys.modules)
try:
    main()
except SystemExit:
    print(json.dumps([sorted(sys.modules), sorted(before)]))
"""
    done = subprocess.run(
        [sys.executable, "-c", script, "run", "bundled:paper", "simulation.duration=1 min", "--quiet", "--seed", "1"],
        capture_output=True, text=True, check=True, cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
    )  # fmt: skip
    modules, before = map(set, json.loads(done.stdout))
    others = {m.partition(".")[0] for m in modules - before} - sys.stdlib_module_names - {"fleet2d"}

    assert [] == sorted(
        m for m in modules if m in UNUSED or m.startswith(tuple(f"{u}." for u in UNUSED))
    )
    assert set() == {name for name in others if not name.startswith("_")} - USED
    assert not {"typer", "pydantic", "numpy"} & before  # `main` sets what they read first


@pytest.mark.slow
def test_modules_are_imported_with_few_collections_of_garbage(tmp_path):
    """They were a tenth of the time until the first step."""
    script = """
import gc, sys
before, counts = gc.get_threshold(), [0, 0, 0]
def count(phase, info):
    counts[info["generation"]] += phase == "start"
gc.callbacks.append(count)
from fleet2d.cli import main
try:
    main()
except SystemExit:
    assert gc.get_threshold() == before
    print(counts)
"""
    done = subprocess.run(
        [sys.executable, "-c", script, "run", "bundled:paper", "simulation.duration=1 min", "--quiet", "--seed", "1"],
        capture_output=True, text=True, check=True, cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
    )  # fmt: skip
    young, middle, old = json.loads(done.stdout)
    assert young < 20  # 180 before
    assert (middle < 3, old) == (True, 0)


def test_importing_does_not_load_the_compiler():
    script = "import sys, fleet2d, fleet2d.cli; print(sorted({'numba', 'pyarrow', 'shapely', 'matplotlib'} & set(sys.modules)))"
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
    )  # fmt: skip
    assert "[]" == done.stdout.strip()
