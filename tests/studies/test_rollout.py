"""Rollouts: stages, guards, and intervals that hold on all days however often one looks."""

import re
from typing import Any

import numpy as np
import pytest
from benchmarks.rollouts import rollout as simulated
from tests.studies.scenes import run
from tests.studies.test_population import fleet

from fleet2d.errors import Fleet2DError, InputError
from fleet2d.studies.design import build_design
from fleet2d.studies.driver import check_study
from fleet2d.studies.intervals import two_sample_interval
from fleet2d.studies.report import write_report
from fleet2d.studies.rollout import RolloutAnswer, looks_of
from fleet2d.studies.sentences import number
from fleet2d.studies.simulator import execute
from fleet2d.studies.specification import Bounds, Rollout, read_specification

SLOWER = {"configure": "astro", "behavior": "hangout", "keys": {"tau": "5 min"}}
STAGES = {"2026-01-06": "30 %", "2026-01-07": "all"}


def rollout(count=6, days=4, **keys):
    """A study of a rollout."""
    study = fleet(count, households=[["retired"]])
    simulation = {"start": "2026-01-05", "duration": f"{days} d"}
    study["base"] = {**study["base"], "simulation": simulation}
    settings = {"change": SLOWER, "stages": STAGES, "watch": ["distance.astro"]}
    return {**study, "rollout": {**settings, **keys}}


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    guards = {"sightings.ana": {"least": -0.5}}
    return run(rollout(guards=guards), tmp_path_factory.mktemp("rollout") / "study")[1]


@pytest.mark.slow
def test_robots_do_the_same_until_their_stage_and_something_else_then(small):
    rows = small.polars("daily").filter(metric="distance.astro").collect()
    stages = dict(small.variants.select("robot", "stage").iter_rows())
    changed = 0
    for robot, stage in stages.items():
        one, other = (
            rows.filter(robot=robot, rollout=side).sort("day")["value"].to_numpy()
            for side in ("without", "with")
        )
        first = {"2026-01-06": 1, "2026-01-07": 2}[stage]
        assert (one[:first] == other[:first]).all()
        changed += bool((one != other).any())
    assert changed >= len(stages) - 1
    assert {"2026-01-06", "2026-01-07"} == {*stages.values()}


def test_the_answer_tells_stages_guards_and_the_truth(small):
    text = str(small.answer)
    assert "The change reaches" in text
    assert "of 6 robots" in text
    assert "The guard of sightings.ana can't be told on any day" in text
    assert "The simulator knows that it is" in text
    found = RolloutAnswer(small)
    assert "sightings.ana" in found.looks
    assert {"number", "truth", "mean without it"} <= {*found.table.columns}


def test_a_stop_is_told_beside_what_would_have_been(small):
    found = RolloutAnswer(small)
    guards = {"distance.astro": Bounds(most=5)}
    found.settings = found.settings.model_copy(update={"guards": guards})
    found.stop = "distance.astro", found.looks["distance.astro"][0]
    text = " ".join(found.sentences)
    assert "It is stopped after 2026-01-06 by the guard of distance.astro" in text
    assert "and at most +5 is allowed" in text
    (gone_on,) = re.findall(r"Had it gone on, distance.astro would be (.*) (\w+) on (.*) for", text)
    rows = small.polars("daily").filter(metric="distance.astro", day=3).collect()
    with_it, without = (rows.filter(rollout=side)["value"].mean() for side in ("with", "without"))
    size = number(abs(with_it - without))
    side = "higher" if with_it > without else "lower"
    assert (size, side, "2026-01-08") == gone_on


def test_where_all_robots_have_the_change_none_are_compared(small):
    found = RolloutAnswer(small)
    found._begins = np.full(6, 1)
    found.days = [1]
    assert "On 2026-01-06 all 6 robots with a distance.astro have the change: none to compare." in (
        " ".join(found.sentences)
    )


def test_the_report_has_one_figure_of_the_rollout(small, tmp_path):
    page = write_report(small, tmp_path)
    assert "day by day" in page.read_text(encoding="utf-8")
    assert (tmp_path / "figures" / "rollout.svg").is_file()


def test_numbers_of_each_day_end_as_the_run_ends_and_change_nothing():
    scenario = build_design(read_specification(rollout(1))).scenario(0)
    plain = execute(scenario, ("*",), ())
    daily = execute(scenario, ("*",), (), ("distance.astro",))
    rows = daily.tables["daily"].to_pylist()
    assert plain.digest == daily.digest
    assert [0, 1, 2, 3] == [row["day"] for row in rows]
    assert plain.metrics["distance.astro"] == rows[-1]["value"]


def world(robots, effect) -> tuple[Any, Any, Any]:
    """Numbers of robots whose days differ, and that change by an effect on half of them."""
    generator = np.random.default_rng(3)
    without = generator.normal(10, 1, (robots, 1)) + generator.normal(0, 0.5, (robots, 8))
    begins = np.where(np.arange(robots) % 2, 3, 1 << 40)
    return without, without + effect * (np.arange(8) >= begins[:, None]), begins


def test_a_guard_stops_on_the_first_day_that_is_clear_and_none_that_is_not():
    harm = looks_of(*world(200, 2.0), 0.999, range(3, 8))
    none = looks_of(*world(200, 0.0), 0.999, range(3, 8))
    few = looks_of(*world(40, 2.0), 0.999, range(3, 8))

    assert harm[0].breaks(Bounds(most=1.0))
    assert not any(look.breaks(Bounds(least=-1.0, most=1.0)) for look in none)
    assert harm[0].breaks(Bounds(least=5.0))
    assert all(np.isnan(look.low) and not look.breaks(Bounds(most=0.0)) for look in few)
    assert 2.0 == pytest.approx(harm[-1].truth)
    assert harm[-1].low < 2.0 < harm[-1].high


def test_a_constant_or_missing_metric_has_no_interval():
    without = np.ones((80, 3))
    begins = np.where(np.arange(80) % 2, 1, 1 << 40)
    (look,) = looks_of(without, without, begins, 0.99, [2])
    assert 0.0 == look.difference == look.truth
    assert np.isnan(look.low)
    (missing,) = looks_of(without * np.nan, without, begins, 0.99, [2])
    assert 0 == missing.treated == missing.others


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"stages": {"2026-01-06": "30 %", "2026-01-07": "10 %"}}, "each stage must reach more"),
        ({"stages": {"2026-01-06": "0 %"}}, "each stage must reach more"),
        ({"stages": {}}, "stages"),
        ({"guards": {"distance.astro": {}}}, "give least or most"),
        ({"watch": []}, "metrics to watch, or guards"),
        ({"watch": ["distanc.astro"]}, "did you mean 'distance'"),
        ({"change": {"configur": "astro"}}, "configur"),
        ({"change": []}, "change"),
    ],
)
def test_mistakes_are_told_before_the_first_run(keys, words):
    with pytest.raises(Fleet2DError, match=words):
        check_study(rollout(1, **keys))


def test_a_rollout_needs_a_fleet():
    settings = {"change": SLOWER, "stages": STAGES, "watch": ["distance.astro"]}
    with pytest.raises(InputError, match="needs a fleet"):
        read_specification({"rollout": settings})


def test_a_stage_that_reaches_few_leaves_out_the_runs_of_all_others():
    design = build_design(read_specification(rollout(40, stages={"2026-01-06": 0.2})))
    rows = [design.parameters(i) for i in range(len(design))]
    treated = [row for row in rows if row["rollout"] == "with"]
    assert 40 == len(rows) - len(treated)
    assert 2 <= len(treated) <= 16
    assert {"2026-01-06"} == {row["stage"] for row in treated}


def test_a_robot_joins_at_the_same_stage_in_a_larger_fleet():
    settings = Rollout(change=[SLOWER], stages=STAGES, watch=["distance.astro"])
    assert "2026-01-06" == settings.stage_of(0.29)
    assert "2026-01-07" == settings.stage_of(0.3)


def test_intervals_of_two_samples_are_wider_on_the_skewed_side():
    generator = np.random.default_rng(0)
    first, second = generator.lognormal(0, 1, 60), generator.normal(0, 1, 60)
    low, high = two_sample_interval(first, second)
    middle = first.mean() - second.mean()
    assert high - middle > middle - low > 0


@pytest.mark.slow
@pytest.mark.parametrize("shape", ["lognormal", "one in ten is eight times the others"])
def test_intervals_hold_on_all_days_together(shape):
    held = [simulated(shape, 400, seed, sums=True)[0] for seed in range(100)]
    assert sum(held) >= 90  # 95 expected; fewer than 90 has a probability of 1 %
