"""The figures of docs/results/routines.md and docs/results/estimators.md, computed again by the commands that they name.

All are drawn from fixed seeds, so that they must be equal to the digits that the pages print.
"""

import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from tests.pages import text_of
from tests.thorough import THOROUGH

import fleet2d
from fleet2d.studies.intervals import estimate

ROOT = Path(__file__).parents[1]
pytestmark = pytest.mark.skipif(
    not THOROUGH, reason="FLEET2D_THOROUGH=1 computes all figures again"
)
FOLDERS = {"CASAS AL": "casas_al", "UCI ADL A": "uci_adl_a", "HOMER+ A": "homer_plus_a"}
NUMBER = re.compile(r"\d[\d,]*\.?\d*")


def printed(script, *arguments):
    """Return the lines that a benchmark prints."""
    command = [sys.executable, f"{script}.py", *arguments]
    done = subprocess.run(
        command, cwd=ROOT / "benchmarks", capture_output=True, text=True, check=True
    )
    return done.stdout.splitlines()


def rows(page, head) -> Iterator[tuple[str, list[str]]]:
    """Yield the first cell and the others of the rows of the table whose heading begins so."""
    text = text_of(page)
    for line in text[text.index(head) :].split("\n\n", 1)[0].splitlines()[2:]:
        name, *cells = (cell.strip() for cell in line.strip("|").split("|"))
        yield name.replace("\\_", "_"), cells


def agrees(said, value, printed_to=0.0):
    """Whether a number of a page is a value, rounded to its digits; a percentage is a share."""
    number, unit = (said[:-1], 100) if said.endswith("%") else (said, 1)
    digits = len(number.strip().partition(".")[2])
    error = 0.5001 * 10**-digits + unit * printed_to / 2
    return abs(float(number) - unit * value) <= error


@pytest.fixture(scope="module")
def data(shared_data):
    return str(shared_data / "activity")


def test_measures_of_days_are_those_of_the_page(data):
    lines = printed("people", "measures", "--data", data)
    found = {re.split(r"  +", line)[0]: re.findall(r"\d+\.\d+|nan", line) for line in lines[4:23]}
    columns = (3, 4, 5, 6, 13, 14, 15, 16, 17, 18, 19, 20, 23)
    base = ""
    for name, cells in rows("routines", "| | short visits | changes"):
        is_without = name == "the same, without"
        base = base if is_without else name
        key = f"{base}, no short stays" if is_without else base
        for cell, column in zip(cells, columns, strict=True):
            assert not cell or agrees(cell, float(found[key][column]), 0.01), (key, column)


def test_begins_of_activities_are_as_likely_as_the_page_says(data):
    *_, last = printed("people", "held-out", "--data", f"{data}/atus_2022_2023")
    assert ["2.71", "2.83", "2.63"] == [f"{float(x):.2f}" for x in last.split()[1:]]


def test_visits_are_those_of_the_page(data):
    lines = printed("people", "visits", "--data", data)
    found = {line[:18].strip(): NUMBER.findall(line[18:]) for line in lines[3:14]}
    for name, cells in rows("routines", "| mean (lowest to highest day)"):
        assert found[name] == NUMBER.findall(" ".join(cells)), name


def test_the_population_is_as_near_to_the_survey_as_the_page_says():
    for options, said in (
        ((), ["0.012", "0.045"]),
        (("--people", "4000", "--weeks", "4"), ["0.003", "0.009"]),
    ):
        *_, last = printed("people", "compare", *options)
        assert said == [f"{float(value):.3f}" for value in last.split()[1:]]


def test_shares_of_rooms_are_as_near_as_the_page_says():
    lines = [line.split() for line in printed("people", "rooms")[1:]]
    errors = {int(day): [f"{float(x):.3f}" for x in found] for day, *found in lines}
    assert [
        ["0.080", "0.066"], ["0.037", "0.033"], ["0.017", "0.016"], ["0.008", "0.008"]
    ] == [errors[day] for day in (1, 4, 16, 64)]  # fmt: skip


def overlaps(*arguments):
    """Return the seconds on one place and of overlaps, and how often somebody gives way."""
    lines = (line.split() for line in printed("overlaps", *arguments)[1:])
    return {" ".join(words[1:-4]): words[-4:-1] for words in lines}


def test_people_are_in_each_others_way_as_often_as_the_page_says():
    found = overlaps()
    assert "225" == found["null"][1]
    assert ["48", "352"] == found["3 s"][1:]
    flat = "../examples/flatmates.yaml"
    own = [f"users.{name}.own_places=false" for name in ("ana", "ben", "cleo")]
    assert ["668", "368403"] == [overlaps(flat)["null"][0], overlaps(flat, *own)["null"][0]]


def test_patrols_that_stop_where_they_see_err_as_the_page_says(shared_data, tmp_path):
    shutil.copytree(ROOT / "examples/studies", tmp_path / "studies")
    (tmp_path / "studies/houseexpo").symlink_to(shared_data / "houseexpo")
    found = fleet2d.study(tmp_path / "studies/presence_views.yaml", tmp_path / "views").complete
    errors = []
    for stops, cells in rows("estimators", "| stops | `likelihood` | the worst home"):
        of_it = found.filter(found["stops"] == stops.removeprefix("in "))
        assert 8 == len(of_it), stops
        error = of_it["likelihood_error.ana.tv"]
        score = [of_it[f"hmm_score.ana.all.{key}"].mean() for key in ("log_loss", "top_1")]
        values = [error.mean(), error.max(), *score, of_it["distance.astro"].mean()]
        said = [cell.replace(",", "") for cell in cells]
        assert all(map(agrees, said, values)), (stops, values)
        errors.append(of_it.filter(of_it["home"].str.contains("6951eec7"))[error.name].item())
    assert ["0.468", "0.051"] == [f"{error:.3f}" for error in errors]


def test_after_events_of_a_year_estimators_err_as_the_page_says(tmp_path):
    found = fleet2d.study(ROOT / "examples/studies/presence_year.yaml", tmp_path / "year").complete
    columns = ("exposure_ratio", "exposure_ratio_14", "likelihood", "likelihood_14", "likelihood_5")
    for event, cells in rows("estimators", "| event | `exposure_ratio`"):
        of_it = found.filter(found["event"] == event)
        for column, cell in zip(columns, cells, strict=True):
            values = of_it[f"{column}_error.ana.tv"].to_list()
            mean = estimate(values, {"home": of_it["home"].to_list()})
            said = re.findall(r"-?\d\.\d+", cell)
            assert 5 == len(values)
            assert all(map(agrees, said, (mean.mean, mean.low, mean.high))), (event, column, mean)


def test_fitted_personas_are_as_near_to_their_logs_as_the_page_says(data, tmp_path):
    text = "\n".join(printed("fit", "--data", data, "--out", str(tmp_path)))
    logs = iter(text.split("\n## ")[1:])
    starts = {
        "persona": "  the persona ", "copies of whole days": "  copies of whole days ",
        "Markov chain": "  a first-order Markov chain ", "`--private`": "a private persona ",
        "the other days": "  the days they were fitted on ",
    }  # fmt: skip
    part = []
    for log, (name, *cells) in rows("routines", "| log (days) | |"):
        if log:
            part = next(logs).splitlines()
        of_it = [line for line in part if line.startswith(starts[name])]
        by_minute, by_second = (
            [float(value) for value in re.findall(r"\d+\.\d+", line)]
            for line in (of_it[0], of_it[-1])
        )
        values = [*by_minute, by_second[2], by_second[4]]
        assert all(map(agrees, cells, values)), (log, name, values)

    worse = re.findall(r"(\d\.\d+), copies (\d\.\d+)", text)
    page = text_of("routines")
    most = max(float(persona) - float(copies) for persona, copies in worse)
    assert f"worse than copies by up to {most:.3f}" in " ".join(page.split())

    for log, cells in rows("routines", "| log | persona | `--private`"):
        part = next(p for p in text.split("\n## ")[1:] if p.startswith(FOLDERS[log])).splitlines()
        counted = [
            re.findall(r"[\d.]+", line.partition(":")[2])
            for line in part
            if line.startswith(("the persona repeats", "a private one:", "days of the log, of"))
        ]
        assert [NUMBER.findall(cell) for cell in cells] == counted, log
