"""Running at a multiple of real time."""

import time

import pytest
from tests.scenes import OWN, digests, run, scenario

import fleet2d
from fleet2d.engine.loop import Pace


def content(duration, speedup, **sections):
    return scenario(
        duration,
        users={"ana": {"type": "meander"}},
        robots={"astro": {"type": "patrol"}},
        simulation={"speedup": speedup},
        **sections,
    )


class Wall:
    """A clock on the wall that only moves when somebody sleeps or looks at it."""

    def __init__(self, look_s=0.0):
        self.now, self.look_s = 0.0, look_s

    def perf_counter(self):
        self.now += self.look_s  # what computing costs
        return self.now

    def sleep(self, seconds):
        self.now += seconds


@pytest.fixture
def wall(monkeypatch):
    clock = Wall()
    monkeypatch.setattr("fleet2d.engine.loop.time", clock)
    return clock


@pytest.mark.parametrize("look_s", [0.0, 0.01])
@pytest.mark.parametrize(("speedup", "duration_s"), [(100, 60), (3600, 3600), (10_000.5, 7200)])
def test_the_factor_is_held_within_two_percent(wall, speedup, duration_s, look_s):
    wall.look_s = look_s
    simulation = fleet2d.Simulation(content(f"{duration_s} s", speedup))
    began = wall.now
    simulation.advance(10**9)
    # Setting up, going on, and the last nap each take a look or two.
    slack = 6 * look_s
    assert duration_s / speedup == pytest.approx(wall.now - began, rel=0.02, abs=slack)


def test_real_time_is_held_in_steps_longer_than_a_look_at_the_clock(wall):
    fleet2d.Simulation(content("4 s", 8)).advance(4)
    assert 0.5 == pytest.approx(wall.now)


def test_a_pause_between_two_calls_is_not_caught_up(wall):
    simulation = fleet2d.Simulation(content("20 s", 2))
    simulation.advance(10)
    wall.now += 100
    simulation.advance(10)
    assert 110 == pytest.approx(wall.now)


def test_it_is_never_faster_than_asked():
    simulation = fleet2d.Simulation(content("60 s", 200))
    began = time.perf_counter()
    simulation.advance(10**9)
    assert time.perf_counter() - began >= 60 / 200


def test_the_pace_changes_no_table():
    assert digests(run(content("5 min", None))) == digests(run(content("5 min", 2000)))


def test_a_factor_out_of_reach_is_reported():
    tick = {"tick": {"type": f"{OWN}:Tick", "period": "1 s"}}
    stored = run(content("20 min", 1e9, algorithms=tick))
    (note,) = [note for note in stored.notes if "speedup" in note]
    for word in ("1e+09", "was reached"):
        assert word in note


def test_a_factor_that_is_held_is_not_reported(wall):
    assert [] == [note for note in run(content("1 min", 200)).notes if "speedup" in note]


def test_a_pace_never_sleeps_when_it_is_behind(wall):
    pace = Pace(1.0)
    pace.hold(0)
    pace.hold(-5)
    assert 0 == wall.now
