"""The figures of docs/people.md and docs/fit.md, computed again by the commands that they name.

All are drawn from fixed seeds, so that they must be equal to the digits that the pages print.
"""

import re
import subprocess
import sys
from collections.abc import Iterator
from datetime import timedelta
from pathlib import Path

import numpy as np
import pytest
from tests.thorough import THOROUGH

import fleet2d

ROOT = Path(__file__).parents[1]
pytestmark = pytest.mark.skipif(
    not THOROUGH, reason="FLEET2D_THOROUGH=1 computes all figures again"
)
NUMBER = re.compile(r"\d[\d,]*\.?\d*")


def printed(script: str, *arguments: str) -> list[str]:
    """Return the lines that a benchmark prints."""
    command = [sys.executable, f"{script}.py", *arguments]
    done = subprocess.run(
        command, cwd=ROOT / "benchmarks", capture_output=True, text=True, check=True
    )
    return done.stdout.splitlines()


def rows(page: str, head: str) -> Iterator[tuple[str, list[str]]]:
    """Yield the first cell and the others of the rows of the table whose heading begins so."""
    text = (ROOT / "docs" / f"{page}.md").read_text(encoding="utf-8")
    for line in text[text.index(head) :].split("\n\n", 1)[0].splitlines()[2:]:
        name, *cells = (cell.strip() for cell in line.strip("|").split("|"))
        yield name.replace("\\_", "_"), cells


def agrees(said: str, value: float, printed_to: float = 0.0) -> bool:
    """Whether a number of a page is a value, rounded to its digits; a percentage is a share."""
    number, unit = (said[:-1], 100) if said.endswith("%") else (said, 1)
    digits = len(number.strip().partition(".")[2])
    error = 0.5001 * 10**-digits + unit * printed_to / 2
    return abs(float(number) - unit * value) <= error


@pytest.fixture(scope="module")
def data(shared_data: Path) -> str:
    return str(shared_data / "activity")


def test_measures_of_days_are_those_of_the_page(data: str) -> None:
    lines = printed("people", "measures", "--data", data)
    found = {re.split(r"  +", line)[0]: re.findall(r"\d+\.\d+|nan", line) for line in lines[3:21]}
    columns = (3, 4, 5, 6, 13, 15, 16)
    base = ""
    for name, cells in rows("people", "| | short visits | changes"):
        base = name if name != "the same, with `short_stays`" else base
        key = base if name == base else f"{base}, short_stays"
        for cell, column in zip(cells, columns, strict=True):
            assert not cell or agrees(cell, float(found[key][column]), 0.01), (key, column)


def test_visits_are_those_of_the_page(data: str) -> None:
    lines = printed("people", "visits", "--data", data)
    found = {line[:18].strip(): NUMBER.findall(line[18:]) for line in lines[3:14]}
    for name, cells in rows("people", "| mean (lowest to highest day)"):
        assert found[name] == NUMBER.findall(" ".join(cells)), name


def test_the_population_is_as_near_to_the_survey_as_the_page_says() -> None:
    *_, last = printed("people", "compare")
    assert ["0.012", "0.045"] == [f"{float(value):.3f}" for value in last.split()[1:]]


def test_shares_of_rooms_are_as_near_as_the_page_says() -> None:
    lines = [line.split() for line in printed("people", "rooms")[1:]]
    errors = {int(day): f"{float(error):.3f}" for day, error, _ in lines}
    assert ["0.080", "0.037", "0.017", "0.008"] == [errors[day] for day in (1, 4, 16, 64)]


def overlaps(*arguments: str) -> dict[str, list[str]]:
    """Return the seconds on one place and of overlaps, and how often somebody gives way."""
    lines = (line.split() for line in printed("overlaps", *arguments)[1:])
    return {" ".join(words[1:-4]): words[-4:-1] for words in lines}


def test_people_are_in_each_others_way_as_often_as_the_page_says() -> None:
    found = overlaps()
    assert "203" == found["null"][1]
    assert ["49", "308"] == found["3 s"][1:]
    flat = "../examples/flatmates.yaml"
    own = [f"users.{name}.own_places=false" for name in ("ana", "ben", "cleo")]
    assert ["1955", "380950"] == [overlaps(flat)["null"][0], overlaps(flat, *own)["null"][0]]


def test_a_patrol_that_never_saw_the_beds_errs_as_the_page_says(shared_data: Path) -> None:
    """The worst of the eight homes of `presence_views.yaml`, without and with stops that see."""
    (home,) = (shared_data / "houseexpo").glob("6951eec7*.json")
    errors = []
    for stop_at in ("middle", "view"):
        patrol = {"type": "patrol", "dwell": "5 min", "stop_at": stop_at}
        stored = fleet2d.run(
            str(ROOT / "examples/studies/base/presence_rounds.yaml"),
            floorplan={"type": "houseexpo", "path": str(home), "furnish": True},
            robots={"astro": {"behaviors": [patrol]}},
            seed=1,
        )
        errors.append(f"{stored.metrics['likelihood_error']['ana']['tv']:.3f}")
    assert ["0.450", "0.013"] == errors


def test_the_robot_of_the_readme_sees_her_as_often_as_it_says_and_enters_no_bedroom(
    tmp_path: Path,
) -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    scenario = text.split("```yaml title=home.yaml\n")[1].split("```")[0]
    (tmp_path / "home.yaml").write_text(scenario, encoding="utf-8")
    run = fleet2d.run(tmp_path / "home.yaml")
    said = re.search(r"sees Ana during (\d+) % of her time", text)
    assert said is not None
    assert said[1] == f"{100 * run.metrics['sightings']['ana']:.0f}"

    private = [r.index for r in fleet2d.load_floorplan().rooms if r.type in {"bedroom", "bathroom"}]
    path = run.path("astro", every=timedelta(seconds=1))
    assert not np.isin(path.room, private).any()


def test_after_events_of_a_year_estimators_err_as_the_page_says(tmp_path: Path) -> None:
    found = fleet2d.study(ROOT / "examples/studies/presence_year.yaml", tmp_path / "year").complete
    columns = ("exposure_ratio", "exposure_ratio_14", "likelihood", "likelihood_14", "likelihood_5")
    for event, cells in rows("presence", "| event | `exposure_ratio`"):
        for column, cell in zip(columns, cells, strict=True):
            values = [
                row[f"{column}_error.ana.tv"]
                for row in found.iter_rows(named=True)
                if row["event"] == event
            ]
            assert 5 == len(values)
            assert agrees(cell.split()[0], sum(values) / 5), (event, column)


def test_fitted_personas_are_as_near_to_their_logs_as_the_page_says(
    data: str, tmp_path: Path
) -> None:
    text = "\n".join(printed("fit", "--data", data, "--out", str(tmp_path)))
    logs = iter(text.split("\n## ")[1:])
    starts = {
        "persona": "  the persona ", "copies of whole days": "  copies of whole days ",
        "Markov chain": "  a first-order Markov chain ", "`--private`": "a private persona ",
        "the other days": "  the days they were fitted on ", "`--model laws`": "laws ",
    }  # fmt: skip
    part: list[str] = []
    for log, (name, *cells) in rows("fit", "| log (days) | |"):
        if log:
            part = next(logs).splitlines()
        of_it = [line for line in part if line.startswith(starts[name])]
        by_minute, by_second = (
            [float(value) for value in re.findall(r"\d+\.\d+", line)]
            for line in (of_it[0], of_it[-1])
        )
        values = [*by_minute, by_second[2], by_second[4]]
        assert all(map(agrees, cells, values)), (log, name, values)
