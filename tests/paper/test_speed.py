"""Watching a run: frames show who is where, and only what moved changes."""

import numpy as np
from matplotlib.colors import to_rgb

from fleet2d.engine.simulation import Simulation
from fleet2d.kernels import U8
from fleet2d.palette import ROBOT_COLORS, USER_COLORS
from fleet2d.paper.speed import LiveView, time_frames


def at_hour(hour: int) -> Simulation:
    simulation = Simulation("bundled:base", "simulation.duration=1 d", seed=4)
    simulation.advance(hour * 3600)
    return simulation


def count_pixels(frame: U8, color: str) -> int:
    """Return the number of pixels that have almost a colour."""
    rgb = np.array(to_rgb(color)) * 255
    return int((np.abs(frame[..., :3] - rgb).max(axis=-1) < 6).sum())


def test_a_frame_shows_everybody_at_home_and_nobody_away() -> None:
    simulation = at_hour(3)
    view = LiveView(simulation, width=800)
    night = view.frame().copy()
    assert not simulation.state["ana"]["away"]
    assert count_pixels(night, USER_COLORS[0]) > 20
    assert count_pixels(night, ROBOT_COLORS[0]) > 20
    simulation.advance(8 * 3600)
    assert simulation.state["ana"]["away"]
    assert 0 == count_pixels(view.frame(), USER_COLORS[0])


def test_a_frame_is_the_same_as_one_drawn_afresh() -> None:
    simulation = at_hour(6)
    view = LiveView(simulation, width=400)
    for _ in range(6):
        simulation.advance(900)
        frame = view.frame().copy()
        assert np.array_equal(LiveView(simulation, width=400).frame(), frame)


def test_watching_changes_nothing_in_the_run() -> None:
    unwatched = Simulation("bundled:base", "simulation.duration=2 h", seed=4).run()
    simulation = Simulation("bundled:base", "simulation.duration=2 h", seed=4)
    view = LiveView(simulation, width=200)
    while not simulation.done:
        simulation.advance(60)
        view.frame()
    assert unwatched.digest == simulation.finish().digest


def test_watching_counts_simulated_time_from_the_first_frame() -> None:
    timing = time_frames(60, 10, from_hour=1)
    assert 600 == round(timing["speedup"] * timing["seconds"])
