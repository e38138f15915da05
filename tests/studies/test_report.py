"""The report of a study: one page that explains its numbers, its figures, and its tables as files."""

import html
import re
from datetime import datetime, timedelta
from types import SimpleNamespace

import polars as pl
import pytest
from tests.scenes import OWN
from tests.studies.scenes import SPEED, base, run, small

from fleet2d.studies.figures import over_time
from fleet2d.studies.report import short_names, write_report

SIGHTINGS = "sightings.ana"
LONG = "a_home_with_a_name_that_is_too_long_"


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """Two speeds and two dwells in two homes of long names, with three seeds."""
    folder = tmp_path_factory.mktemp("study")
    home = base()["floorplan"]
    homes = {
        LONG + name: {"floorplan": home, "users.ana.radius": r}
        for name, r in (("a", 0.2), ("b", 0.25))
    }
    keys = {
        "axes": {
            SPEED: [0.3, 0.6],
            "dwell": {"key": "robots.astro.dwell", "values": [0, "1 min"]},
            "home": {"options": homes, "population": True},
        },
        "base": {**base(), "metrics": {**base()["metrics"], "visited": {"type": f"{OWN}:Visited"}}},
        "keep": {"tables": ["room_share"]},
        "compare": [
            {"metric": SIGHTINGS, "against": {SPEED: 0.3}},
            {"metric": "distance.astro", "against": {SPEED: 0.3}, "within": ["dwell"]},
            {"metric": "room_share.ana.kitchen_1", "against": {SPEED: 0.3}},
        ],
        "description": "Does a fast robot see more?",
        "tags": ["speed", "pilot"],
        "notes": "The camera has no noise.",
    }
    return run(small(**keys), folder / "speeds")[1]


@pytest.fixture(scope="module")
def page(study, tmp_path_factory):
    return write_report(study, tmp_path_factory.mktemp("report"))


@pytest.mark.slow
def test_a_report_is_one_page_with_its_figures(study, page, tmp_path):
    text = page.read_text()
    assert "Does a fast robot see more?" in text
    assert "against 0.3" in text
    assert "There are only 3 values of seed" in text
    assert "http" not in text.replace("http://www.w3.org", "")
    figures = {path.stem for path in (page.parent / "figures").iterdir()}
    assert {"compare-1", "compare-1-home", "compare-2", "compare-2-home"} <= figures
    assert "room_share_ana_kitchen_1-time" in figures
    assert text == write_report(study, tmp_path / "again").read_text()
    for path in page.parent.rglob("*.*"):
        assert (
            path.read_bytes() == (tmp_path / "again" / path.relative_to(page.parent)).read_bytes()
        )


def test_a_report_says_what_is_measured_in_which_unit_and_how(page):
    text = page.read_text()
    assert "<td class=text>sightings.ana [share of time at home]</td>" in text
    assert "distance.astro [m a day]" in (page.parent / "figures/compare-2.svg").read_text()
    assert "2 values of home and 3 values of seed: 24 runs of 0:02:00" in text
    assert "Those of the 4 comparisons of this report" in text
    assert "Hall&#x27;s (1992)" in text
    assert "speed, pilot" in text
    assert "The camera has no noise." in text


def test_homes_have_a_picture_within_each_value_of_another_axis(page):
    figure = (page.parent / "figures/compare-2-home.svg").read_text()
    assert figure.count("dwell = 0") == figure.count("dwell = 1 min") > 0
    assert "dwell" not in (page.parent / "figures/compare-1-home.svg").read_text()


def test_shares_that_overlap_say_so(study, page):
    overlapping = [m for m in study.metrics if study.shares(m)["share"].sum() > 1.01]
    assert ["visited.ana"] == overlapping  # of half of the variants only
    assert 1 == page.read_text().count("Shares overlap")


def test_homes_of_long_names_have_short_ones_that_are_listed(page):
    text = page.read_text()
    assert f"<td class=text>…long_a</td><td class=text>{LONG}a</td>" in text


def test_the_answer_comes_first_and_all_numbers_stand_in_one_table(study, page):
    text = page.read_text()
    answer = study.answer
    assert 2 <= len(answer.sentences) <= 6
    assert html.escape(answer.sentences[0]) in text.partition("<h2>")[0]
    numbers = pl.read_csv(page.parent / "tables/numbers.csv")
    assert {f"{SPEED} = 0.3", "dwell = 1 min", "all"} <= set(numbers["in"])
    assert len(study.metrics) == numbers["number"].n_unique()
    assert 1 == text.count("<h2>All numbers</h2>")


def test_only_differences_that_are_clear_after_correction_are_bold(study, page):
    text = page.read_text()
    tables = [pl.read_csv(page.parent / f"tables/compare-{n}.csv") for n in (1, 2, 3)]
    rows = [row for table in tables for row in table.to_dicts()]
    bold = re.findall("<b>(.*?)</b>", text)
    assert [html.escape(row["verdict"]) for row in rows if row["p_holm"] < 0.05] == bold
    # Two homes leave out too much to tell by how much.
    assert not re.search(r"<td>[^<]* to [^<]*</td>", text)
    assert "<td>can&#x27;t tell</td>" in text


def test_short_names_are_unique():
    names = short_names(["658e5214673c7a4e25b458e5", "658e5214673d7a4e25b458e6", "short"])
    assert ["…b458e5", "…b458e6", "…short"] == list(names.values())


def test_a_metric_over_time_is_by_the_time_since_the_start():
    """Of each two days from six in the morning, its first value stood at a quarter of a day."""
    steps = [2 * 1440 - 1, 4 * 1440 - 1]
    times = [datetime(2026, 1, 5, 6) + timedelta(minutes=step) for step in steps]
    rows = pl.DataFrame({"variant": 0, "step": steps, "time": times, "user": "ana", "tv": [0.5, 1]})
    study = SimpleNamespace(tables=["error"], columns=(), polars=lambda name: rows.lazy())

    found = over_time(study, "error.ana.tv")
    assert [2, 4] == found["day"].round(2).to_list()
    assert [0.5, 1] == found["value"].to_list()
