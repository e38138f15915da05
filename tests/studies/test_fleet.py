"""Fleets: percentiles with intervals that hold, the worst robots, and groups found and tested."""

import re

import numpy as np
import polars as pl
import pytest
from scipy.stats import binom
from tests.studies.scenes import run
from tests.studies.test_population import fleet

from fleet2d.errors import InputError
from fleet2d.studies.fleet import find_groups, quantile_ranks
from fleet2d.studies.report import write_report


def features(generator: np.random.Generator, count):
    """Features as fleets have them: numbers and texts, some of them missing."""
    people = generator.integers(1, 5, count).tolist()
    area = generator.uniform(30, 250, count).tolist()
    regions = generator.choice(["north", "south", "west"], count).tolist()
    return {"people": people, "area_m2": area, "region": [None, *regions[1:]]}


def test_groups_that_differ_are_found_with_intervals_that_hold():
    misses = 0
    for seed in range(40):
        generator = np.random.default_rng(seed)
        columns = features(generator, 600)
        means = np.where(np.array(columns["people"]) <= 2, 1.0, 2.0)
        means += np.where((means > 1) & (np.array(columns["region"]) == "west"), 1.0, 0.0)
        found = find_groups(means + generator.exponential(1, 600), columns, range(600))
        texts = [" and ".join(map(str, group.conditions)) for group in found]
        assert any(text.startswith("people ≤ 2") for text in texts)
        assert "people > 2 and region is west" in texts
        true = [2.0 if t.startswith("people ≤") else 3.0 + t.endswith("is west") for t in texts]
        holds = (g.low < mean < g.high for g, mean in zip(found, true, strict=True))
        misses += not all(holds)
    assert misses <= 6  # 95 % of 40 are 38: with more than 6 misses it would be less


def test_where_nothing_differs_hardly_ever_a_group_is_found():
    found = 0
    for seed in range(100):
        generator = np.random.default_rng(seed)
        values = generator.lognormal(0, 1, 300)
        found += bool(find_groups(values, features(generator, 300), range(300)))
    assert found <= 11  # of 5 expected


def test_robots_of_one_home_are_not_split_between_finding_and_testing():
    homes = np.repeat(np.arange(60), 10)
    values = np.random.default_rng(1).normal(0, 1, 60)[homes]  # by home alone
    rooms = (homes % 7).tolist()
    assert [] == find_groups(values, {"rooms": rooms}, homes.tolist())


@pytest.mark.parametrize("count", [0, 1, 40])
def test_few_or_equal_robots_have_no_groups(count):
    columns = {"people": [*range(count)]}
    assert [] == find_groups(np.ones(count), columns, range(count))


@pytest.mark.parametrize(("count", "share"), [(400, 0.05), (2000, 0.01), (300, 0.5)])
def test_intervals_of_percentiles_hold_in_95_percent_of_fleets(count, share):
    low, high = quantile_ranks(count, share)
    assert 0.95 <= binom.cdf(high, count, share) - binom.cdf(low, count, share) <= 0.98


def test_too_few_robots_have_no_bound_for_a_rare_percentile():
    assert None is quantile_ranks(30, 0.01)[0]
    assert (None, None) == quantile_ranks(1, 0.5)


@pytest.fixture(scope="module")
def small_fleet(tmp_path_factory):
    study = fleet(6)
    study["base"] = {**study["base"], "simulation": {"duration": "30 min"}}
    study["axes"]["robots.astro.speed"] = [0.3, 0.6]
    return run(study, tmp_path_factory.mktemp("fleet") / "fleet")[1]


def test_the_worst_robot_is_told_with_the_command_that_runs_it_again(small_fleet):
    robots = small_fleet.complete.group_by("robot").agg(pl.col("sightings.ana").mean())
    (row,) = small_fleet.worst("sightings.ana").to_dicts()
    assert row["value"] == pytest.approx(robots["sightings.ana"].min())
    assert row["command"].startswith(f"fleet2d study rerun {small_fleet.location} {row['variant']}")


def test_the_answer_of_a_fleet_compares_settings_and_not_what_was_drawn(small_fleet):
    text = str(small_fleet.answer)
    assert "robots.astro.speed = 0.6 against 0.3" in text
    assert "household =" not in text
    assert "Percentiles and groups take 116 robots or more." in text


def test_a_fleet_of_many_robots_is_told_by_percentiles_groups_and_its_worst(
    small_fleet, monkeypatch
):
    monkeypatch.setattr("fleet2d.studies.fleet.FEWEST", 6)
    text = " ".join(small_fleet.answer.sentences)
    assert "Of 6 robots half have a sightings.ana up to" in text
    assert "No group of homes or people was found" in text
    assert re.search(r"The worst 1 % \(1 robot\): variant \d+. `fleet2d study rerun", text)


def test_the_report_has_percentiles_and_the_worst(small_fleet, tmp_path):
    page = write_report(small_fleet, tmp_path).read_text(encoding="utf-8")
    assert "sightings.ana" in page
    assert "the worst 1 %" in page
    assert (tmp_path / "tables" / "fleet_sightings_ana_worst.csv").is_file()


def test_a_metric_without_a_better_side_has_no_worst(small_fleet):
    with pytest.raises(InputError, match="better than another"):
        small_fleet.worst("distance.ana")


def test_one_home_is_a_fleet_whose_answer_says_so(tmp_path):
    _, study = run(fleet(1), tmp_path / "fleet")
    assert "It holds for 1 home and 1 robot only." in str(study.answer)
    (median,) = study.percentiles("distance.astro").filter(percent=50).to_dicts()
    assert (None, None, "1 robots are too few") == (median["low"], median["high"], median["doubt"])


def test_a_fleet_alone_compares_nothing_not_even_its_seeds(tmp_path, monkeypatch):
    _, study = run(fleet(2), tmp_path / "fleet")
    assert {"p1", "p99"}.isdisjoint(study.answer.table[0])
    monkeypatch.setattr("fleet2d.studies.fleet.FEWEST", 2)
    assert "There is nothing to compare: the table has the means." in study.answer.sentences
    assert {"p1", "p99"} <= {*study.answer.table[0]}


def test_a_study_without_a_fleet_has_no_robots_to_rank(tmp_path):
    from tests.studies.scenes import small

    _, study = run(small(replicates=1), tmp_path / "study")
    with pytest.raises(InputError, match="has no fleet"):
        study.percentiles("distance.astro")
