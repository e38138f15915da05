"""`fleet2d test`, and what `fleet2d run` says of what was expected."""

import json
import shlex
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest
import yaml
from tests.scenes import scenario


def written(name="home.yaml", **expect) -> Path:
    content = scenario(
        "5 min",
        users={"ana": {"type": "meander"}},
        robots={"astro": {"type": "patrol", "dwell": "10 s"}},
        expect=expect,
    )
    path = Path(name)
    path.write_text(yaml.safe_dump(content))
    return path


HOLDS = "always(distance(ana, astro) > 0)"
FAILS = "never(moving(astro))"


def test_what_holds_exits_with_0(fleet2d):
    code, out, _ = fleet2d("test", written(apart=HOLDS), "--seeds", "3")

    assert code == 0
    assert "apart" in out
    assert "3 of 3" in out
    assert "\n1 of 1 expectation held.\n" in out


@pytest.mark.slow
def test_what_fails_is_told_kept_and_drawn(fleet2d):
    code, out, _ = fleet2d(
        "test", written(apart=HOLDS, still=FAILS), "--seeds", "2", "--junit", "out/results.xml",
        "--out", "kept",
    )  # fmt: skip

    assert code == 1
    assert "failed in 2 of 2 trials, worst in seed 4: still is violated: never(moving" in out
    assert "see it: fleet2d show kept/home-seed-4 --at 'step " in out
    assert Path("kept/home-seed-4-still.png").read_bytes().startswith(b"\x89PNG")
    assert {"home-seed-4", "home-seed-5"} == {p.name for p in Path("kept").iterdir() if p.is_dir()}
    (suite,) = ET.parse("out/results.xml").getroot()
    assert ("2", "1", "0") == tuple(suite.get(key) for key in ("tests", "failures", "errors"))
    (failed,) = [test for test in suite if test.find("failure") is not None]
    numbers = {each.get("name"): each.get("value") for each in failed.iter("property")}
    assert failed.get("name") == "still"
    assert ("2", "0", "2") == (numbers["trials"], numbers["held"], numbers["failed"])


@pytest.mark.slow
def test_the_command_that_is_printed_shows_the_moment_again(fleet2d):
    _, out, _ = fleet2d("test", written(still=FAILS), "simulation.duration=2 min")
    line = next(line for line in out.splitlines() if "see it" in line)
    run, show = line.partition(": ")[2].split("; ")

    assert fleet2d(*shlex.split(run)[1:])[0] == 1
    assert fleet2d(*shlex.split(show)[1:])[0] == 0


def test_json_has_every_verdict(fleet2d):
    code, out, _ = fleet2d("test", written(apart=HOLDS, still=FAILS), "--json", "--seed", "9")
    gate = json.loads(out)
    (case,) = gate["trials"]

    assert "1 of 2 expectations fails" == gate["verdict"]
    assert (code, case["seed"], case["holds"]) == (1, 9, False)
    assert case["expectations"]["apart"]["holds"]
    assert case["expectations"]["still"]["robustness"] is None


def test_a_run_that_breaks_is_an_error_and_not_a_crash(fleet2d):
    path = written(apart=HOLDS, missing="at_end(metric(distance.nobody) > 0)")
    code, out, _ = fleet2d("test", path, "metrics.distance={}", "--junit", "results.xml")

    assert code == 1
    assert "there is no 'nobody' in it" in out
    (suite,) = ET.parse("results.xml").getroot()
    assert suite.get("errors") == "1"


def test_a_scenario_that_expects_nothing_is_refused(fleet2d):
    code, out, err = fleet2d("test", written(), written("other.yaml", apart=HOLDS))

    assert (code, out) == (2, "")
    assert "home.yaml has no expectations" in err


def test_a_wrong_expectation_is_refused_before_anything_runs(fleet2d):
    wrong = written("wrong.yaml", apart="always(distance(an, astro) > 0)")
    code, out, err = fleet2d("test", written(apart=HOLDS), wrong)

    assert (code, out) == (2, "")
    assert "wrong.yaml:" in err
    assert "did you mean 'ana'" in err


def test_run_says_what_held_and_what_was_violated(fleet2d):
    path = written(apart=HOLDS, still=FAILS)
    code, out, _ = fleet2d("run", path, "--out", "run")

    lines = out.splitlines()
    assert code == 0
    assert lines[0].startswith("1 of 2 expectations violated: still at Mon 05 Jan 07:00:0")
    assert lines[1].startswith("still is violated: never(moving")
    assert "apart held by" in out
    assert 1 == out.count("still is violated")
    _, out, _ = fleet2d("run", path, "--out", "again", "--json")
    assert lines[0] == json.loads(out)["verdict"]
    assert "verdict" == next(iter(json.loads(out)))
    assert json.loads(out)["expectations"]["still"]["holds"] is False
    _, out, err = fleet2d("show", "run")
    assert lines[:2] == err.splitlines()
    assert "run/picture.png" == out.strip()


def test_run_that_did_as_expected_says_so_first_and_one_without_says_nothing(fleet2d):
    _, out, _ = fleet2d("run", written(apart=HOLDS), "--out", "run")
    assert "1 expectation: 1 held" == out.splitlines()[0]
    _, out, _ = fleet2d("run", written(), "--out", "none")
    assert "x real time" in out.splitlines()[0]
    assert "verdict" not in json.loads(fleet2d("run", written(), "--out", "c", "--json")[1])


def test_one_file_runs_over_a_folder_of_homes(fleet2d):
    path = written(apart=HOLDS, out="never(room(astro) == office)")
    plans = Path("plans")
    plans.mkdir()
    flat = Path(scenario()["floorplan"]["path"])
    for name in ("one", "other"):
        (plans / f"{name}.json").write_text(flat.read_text())
    code, out, _ = fleet2d("test", path, "--homes", "plans", "--seeds", "2", "--json")

    cases = json.loads(out)["trials"]
    assert code == 0
    assert [("one", 4), ("one", 5), ("other", 4), ("other", 5)] == [
        (c["home"], c["seed"]) for c in cases
    ]
    assert cases[0]["expectations"]["out"]["notes"] == ['room("astro"): this home has no office']
    code, out, _ = fleet2d("test", path, "simulation.duration=1 min", "--homes", "3")
    assert "3 of 3" in out
    assert 'note: room("astro"): this home has no office' in out


def test_what_was_not_tested_is_shown_and_fails_unless_it_may(fleet2d):
    waits = "after(events(called, astro), moving(astro), within=1 min)"
    code, out, _ = fleet2d("test", written(waits=waits, apart=HOLDS), "--junit", "results.xml")

    assert code == 1
    assert "waits is untested in 1 of 1 trial: its trigger never happened." in out
    assert "untested  0 of 1, 1 untested" in out
    (suite,) = ET.parse("results.xml").getroot()
    assert ("1", "0") == (suite.get("failures"), suite.get("skipped"))
    code, out, _ = fleet2d("test", written(waits=waits, apart=HOLDS), "--json")
    verdict = json.loads(out)["trials"][0]["expectations"]["waits"]
    assert (None, 0) == (verdict["holds"], verdict["occasions"])
    assert verdict["untested"] == "its trigger never happened"
    path = written(waits=f"may_be_untested({waits})", apart=HOLDS)
    code, out, _ = fleet2d("test", path, "--junit", "results.xml")
    assert code == 0
    assert "waits was never put to the test, which it may be" in out
    (suite,) = ET.parse("results.xml").getroot()
    assert ("0", "1") == (suite.get("failures"), suite.get("skipped"))
