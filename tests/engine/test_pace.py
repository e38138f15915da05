"""Running at a multiple of real time."""

import time
from typing import Any

import pytest
from tests.scenes import OWN, digests, run, scenario

import fleet2d
from fleet2d.engine.pace import Pace


def content(duration: str, speedup: float | None, **sections: Any) -> dict[str, Any]:
    return scenario(
        duration,
        users={"ana": {"type": "meander"}},
        robots={"astro": {"type": "patrol"}},
        simulation={"speedup": speedup},
        **sections,
    )


@pytest.mark.parametrize(("speedup", "duration_s"), [(100, 60), (3600, 3600), (10_000.5, 7200)])
def test_the_factor_is_held_within_two_percent(speedup: float, duration_s: int) -> None:
    simulation = fleet2d.Simulation(content(f"{duration_s} s", speedup))
    began = time.perf_counter()
    simulation.advance(10**9)
    took = time.perf_counter() - began
    assert duration_s / took == pytest.approx(speedup, rel=0.02)


def test_real_time_is_held_in_steps_longer_than_a_look_at_the_clock() -> None:
    simulation = fleet2d.Simulation(content("4 s", 8))
    began = time.perf_counter()
    simulation.advance(4)
    assert time.perf_counter() - began == pytest.approx(0.5, rel=0.02)


def test_the_pace_changes_no_table() -> None:
    assert digests(run(content("5 min", None))) == digests(run(content("5 min", 2000)))


def test_a_factor_out_of_reach_is_reported() -> None:
    tick = {"tick": {"type": f"{OWN}:Tick", "period": "1 s"}}
    stored = run(content("20 min", 1e9, algorithms=tick))
    (note,) = [note for note in stored.notes if "speedup" in note]
    for word in ("1e+09", "was reached"):
        assert word in note


def test_a_factor_that_is_held_is_not_reported() -> None:
    assert [] == [note for note in run(content("1 min", 200)).notes if "speedup" in note]


def test_a_pace_never_sleeps_when_it_is_behind() -> None:
    pace = Pace(1.0)
    began = time.perf_counter()
    pace.hold(0)
    pace.hold(-5)
    assert time.perf_counter() - began < 0.05
