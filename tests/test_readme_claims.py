"""What the README claims: its numbers, what it says never happens, and its pictures."""

import json
import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from tests.entities.robots.robots import rooms_of
from tests.test_docs import blocks, write_titled_blocks
from tests.viewing.browser import chromium
from tests.viewing.test_pictures import LARGE, MEAN, SHARE

import fleet2d
from fleet2d.routines.persona import bundled_names

ROOT = Path(__file__).parents[1]
README = ROOT / "README.md"
IMAGES = ROOT / "docs" / "images"
PRIVATE = {"bedroom", "bathroom"}


@cache
def family(days, seed=4) -> fleet2d.Run:
    return fleet2d.run("bundled:family", f"simulation.duration={days} d", seed=seed)


def kinds_visited(run: fleet2d.Run):
    """The kinds of rooms that the robot was in, at any second."""
    kinds = {room.name: room.type for room in run.plan.rooms}
    return {kinds.get(name, "") for name in rooms_of(run)}


def text():
    return README.read_text(encoding="utf-8")


def test_it_has_at_most_700_words_of_prose():
    prose = re.sub(r"^```.*?^```$", "", text(), flags=re.MULTILINE | re.DOTALL)
    prose = re.sub(r"^\|.*$", "", prose, flags=re.MULTILINE)
    prose = re.sub(r"!\[[^\]]*\]\([^)]*\)|\]\([^)]*\)", "", prose)
    assert len(prose.split()) <= 700


def test_its_first_two_commands_set_up_and_test():
    first, second = blocks(README, "sh")[:2]
    assert 'pip install -e ".[viz,view,pandas]"' in first.text
    assert "fleet2d run --out month" in first.text
    assert "pytest -n auto" in second.text


def test_the_family_is_as_described():
    run = family(1)
    assert {"users": ["ana", "ben", "cleo"], "robots": ["astro"]} == run.manifest["entities"]
    tables = re.search(r"Parquet file per table\s*\(([^)]*)\)", text())
    assert set(run.tables) == set(re.findall(r"`(\w+)`", tables[1]))


def test_there_are_as_many_personas_as_it_says():
    assert {7: "seven"}[len(bundled_names())] in text()


def test_the_family_s_robot_enters_neither_bedrooms_nor_bathrooms_on_its_first_day():
    assert not PRIVATE & kinds_visited(family(1))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(12))
def test_the_family_s_robot_enters_neither_bedrooms_nor_bathrooms(seed):
    assert not PRIVATE & kinds_visited(family(7, seed))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(12))
def test_the_robot_of_the_scenario_never_enters_a_bedroom_or_a_bathroom(tmp_path, seed):
    write_titled_blocks(README, tmp_path)
    run = fleet2d.run(tmp_path / "home.yaml", "simulation.duration.days=7", seed=seed)
    assert not PRIVATE & kinds_visited(run)
    assert run.manifest["expectations"]["stays_out"]["holds"]


@pytest.mark.slow
def test_the_robot_of_the_scenario_sees_ana_as_often_as_it_says(tmp_path):
    write_titled_blocks(README, tmp_path)
    run = fleet2d.run(tmp_path / "home.yaml")
    said = re.search(r"sees Ana during (\d+) % of her time", text())
    assert said[1] == f"{100 * run.metrics['sightings']['ana']:.0f}"


def test_times_are_those_of_the_page_on_speed():
    rows = re.findall(r"^\| `bundled:paper`.*\| ([\d.]+) \|$", text(), re.MULTILINE)
    measured = (ROOT / "docs/results/speed.md").read_text(encoding="utf-8")
    assert 4 == len(rows)
    assert [] == [seconds for seconds in rows if f"| {seconds} s |" not in measured]


def test_each_picture_has_a_digest():
    digests = json.loads((IMAGES / "digests.json").read_text(encoding="utf-8"))
    assert set(re.findall(r"docs/images/([\w.]+)\)", text())) == set(digests)


@pytest.mark.slow
def test_film_and_pictures_show_the_family_s_month_of_today():
    digests = json.loads((IMAGES / "digests.json").read_text(encoding="utf-8"))
    assert {family(30).digest} == set(digests.values()), "run python -m tools.pictures"


@pytest.mark.slow
def test_the_film_lasts_20_seconds_is_wide_and_looks_as_the_page_does_today():
    with chromium():  # or the test is skipped
        from tools import pictures
    views = pictures.film_views(family(30))
    chosen = range(0, len(views), 45)

    drawn = pictures.pictures_of(family(30), [views[i] for i in chosen], pictures.FILM, ".plans")

    with Image.open(IMAGES / "day.webp") as film:
        assert len(views) == film.n_frames == 20 * pictures.FRAMES_PER_S
        assert film.width >= 1000
        for number, picture in zip(chosen, drawn, strict=True):
            film.seek(number)
            assert picture.size == film.size
            small = [np.asarray(im.convert("RGB").reduce(4), int) for im in (picture, film)]
            difference = np.abs(small[0] - small[1]).max(axis=2)
            # WebP changes each colour a little, the more so of dark rooms.
            assert difference.mean() < 2 * MEAN, f"frame {number}: run python -m tools.pictures"
            assert (difference > LARGE).mean() < SHARE, number
