"""The commands: what they print, write and return."""

import json
import re
from pathlib import Path

import pytest
import yaml
from tests.studies.scenes import SPEED, base, small


@pytest.fixture
def fleet2d(fleet2d):
    """The command line in a folder with a study."""
    Path("speeds.yaml").write_text(yaml.safe_dump(small(replicates=2)))
    return fleet2d


SERIAL = ("--executor", "serial")


def test_a_study_is_run_and_stored_by_its_name(fleet2d):
    code, out, err = fleet2d("study", "run", "speeds.yaml", *SERIAL)
    assert (0, "") == (code, err)
    assert out.startswith("4 of 4 variants complete in studies/speeds\n\nspeeds\n")
    assert "It took 4 runs: 8.0 min simulated in" in out
    assert Path("studies/speeds/variants.parquet").exists()


def test_json_is_one_object(fleet2d):
    code, out, _ = fleet2d("study", "run", "speeds.yaml", *SERIAL, "--out", "here", "--json")
    content = json.loads(out)
    answer = content.pop("answer")
    assert ["question", "sentences", "table"] == list(answer)
    assert (0, {"study": "here", "total": 4, "complete": 4, "failed": 0, "missing": 0}) == (
        code, content,
    )  # fmt: skip
    assert (0, json.dumps(content) + "\n", "") == fleet2d("study", "status", "here", "--json")
    told = "speeds: 4 of 4 variants complete, 0 failed, 0 to run\n"
    assert (0, told, "") == fleet2d("study", "status", "here")


@pytest.mark.slow
def test_a_dry_run_prints_axes_and_variants_and_writes_nothing(fleet2d):
    code, out, _ = fleet2d("study", "run", "speeds.yaml", "--dry-run", "--workers", "2")
    assert 0 == code
    assert f"{SPEED}: 0.3, 0.6" in out
    assert f"variant 3 ({SPEED} = 0.6, seed = 1)" in out
    assert "\n4 variants, 1 home, 8.0 min of simulated time\n\nWhat can speeds tell?\n" in out
    assert "By a pilot of 4 runs, its 4 runs take" in out
    assert re.search(r"a difference of \S+ \[share of time at home] in sightings.ana between", out)
    assert ["speeds.yaml"] == [path.name for path in Path().iterdir()]


def test_a_variant_is_run_again_and_compared(fleet2d):
    fleet2d("study", "run", "speeds.yaml", *SERIAL)
    code, out, _ = fleet2d("study", "rerun", "studies/speeds", "2", "--out", "run")
    assert 0 == code
    assert f"variant 2: {SPEED} = 0.6, seed = 0\nstored in run\nreproduced: digest" in out
    code, _, err = fleet2d("study", "rerun", "studies/speeds", "9")
    assert 2 == code
    assert "give a number from 0 to 3" in err


def test_a_variant_whose_metric_differs_is_not_reproduced(fleet2d):
    """With a metric that had been changed since it was said to be reproduced: the digest has none."""
    Path("own.py").write_text(
        "from pathlib import Path\nfrom fleet2d import Metric\n\nclass Own(Metric):\n"
        "    def update(self, *_): ...\n    def result(self):\n"
        f"        return {{'all': int(Path({str(Path('number').absolute())!r}).read_text())}}\n"
    )
    Path("number").write_text("3")
    study = yaml.safe_load(Path("speeds.yaml").read_text())
    study["axes"]["metrics.own"] = [{"type": "own:Own"}]
    study["keep"] = {"metrics": ["own.*"]}
    study.pop("compare", None)
    Path("own.yaml").write_text(yaml.safe_dump(study))
    code, _, err = fleet2d("study", "run", "own.yaml", "--out", "own", *SERIAL)
    assert 0 == code, err

    assert 0 == fleet2d("study", "rerun", "own", "2", "--trust")[0]
    Path("number").write_text("4")
    code, out, err = fleet2d("study", "rerun", "own", "2", "--trust")
    assert 1 == code
    assert "reproduced" not in out
    assert "not reproduced: the digest is the same, but own.all is 4.0 instead of 3.0" in err


@pytest.mark.slow
def test_a_report_is_written_beside_the_study(fleet2d):
    fleet2d("study", "run", "speeds.yaml", *SERIAL)
    code, out, err = fleet2d("study", "report", "studies/speeds")
    assert (0, "") == (code, err)
    assert out.endswith("\n\nstudies/speeds/report/report.html\n")
    assert Path("studies/speeds/report/report.html").exists()


def test_failures_are_printed_and_end_in_one(fleet2d):
    Path("mine.py").write_text(
        "from fleet2d import Algorithm\n"
        "class Fails(Algorithm):\n"
        "    def update(self, history, state):\n        raise ValueError('no more')\n"
    )
    content = small(base=base(), replicates=1)
    content["base"]["algorithms"] = {"own": {"type": "mine:Fails", "period": "1 min"}}
    Path("speeds.yaml").write_text(yaml.safe_dump(content))
    code, out, err = fleet2d("study", "run", "speeds.yaml", *SERIAL)
    assert 1 == code
    assert "0 of 2 variants complete" in out
    assert "variants 0, 1 failed: algorithms.own failed" in err
    assert err.count("failed:") == 1
    assert "no more" in err
    _, _, err = fleet2d("study", "report", "studies/speeds")
    assert "no complete variant: 2 failed, see fleet2d study status" in err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("run", "sped.yaml"), "there is no file sped.yaml: did you mean 'speeds.yaml'?"),
        (("status", "nowhere"), "nowhere holds no study"),
        (("rerun", "nowhere", "1"), "nowhere holds no study"),
        (("report", "nowhere"), "nowhere holds no study"),
    ],
)
def test_wrong_input_ends_in_two(fleet2d, arguments, message):
    code, _, err = fleet2d("study", *arguments)
    assert (2, True) == (code, message in err)


def test_a_search_prints_what_it_found_and_how_it_does_elsewhere(fleet2d):
    content = small(
        axes={"radius": {"key": "robots.astro.radius", "values": [0.1, 0.12, 0.15]}},
        replicates=2,
        tune={
            "search": {"speed": {"key": SPEED, "low": 0.2, "high": 1.0}},
            "objective": {"distance.astro": "maximize"},
            "trials": 3,
            "held_out": {"radius": [0.15]},
        },
    )
    Path("speeds.yaml").write_text(yaml.safe_dump(content))
    code, out, err = fleet2d("study", "tune", "speeds.yaml", *SERIAL)
    assert (0, "") == (code, err)
    assert "trials: 3 complete, 0 fail" in out
    assert f"  {SPEED}=" in out
    assert "distance.astro on the homes held out:" in out


def test_power_says_how_many_seeds_detect_an_effect(fleet2d):
    fleet2d("study", "run", "speeds.yaml", *SERIAL)
    against = ("--against", f"{SPEED}=0.3")
    arguments = ("study", "power", "studies/speeds", "distance.astro", *against)
    code, out, _ = fleet2d(*arguments, "--effect", "10")
    first, *rows = out.splitlines()
    assert (0, "distance.astro [m a day]: to detect 10, with a power of 80 %; – is never") == (
        code, first,
    )  # fmt: skip
    assert [SPEED, "seed"] == rows[0].split()
    code, out, _ = fleet2d(*arguments)
    assert (0, [SPEED, "seed", "detectable"]) == (code, out.splitlines()[1].split())
    assert ["0.6", "29"] == out.splitlines()[2].split()[:2]
    power = ("study", "power", "studies/speeds", "distance.astro")
    assert "give --against AXIS=VALUE" in fleet2d(*power)[2]
    assert "There are: 0.3, 0.6" in fleet2d(*power, "--against", f"{SPEED}=3")[2]
    assert "did you mean" in fleet2d(*power, "--against", "robots.astro.spede=0.3")[2]
