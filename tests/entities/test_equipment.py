"""Localization: where a robot believes to be, and where it puts what it sees."""

import numpy as np
import pytest
from tests.scenes import digests, path, run, scenario, table

import fleet2d
from fleet2d import Algorithm
from fleet2d.entities.equipment import Drift, Localization
from fleet2d.errors import InputError
from fleet2d.kernels import (
    TURN,
    UNIT,
    cosine,
    random_bell,
    random_below,
    random_uniform,
    sine,
)
from fleet2d.runtime.determinism import stream_key

WRONG = {
    "drift": "5 cm", "drift_deg": 1, "jump": "50 cm", "jumps_per_hour": 10,
    "corrected_every": "4 min", "left": "3 cm",
}  # fmt: skip


def lost(duration="30 min", camera=None, **localization):
    """A robot that goes about and sees Ana, who walks."""
    robot = {"type": "meander", "camera": camera or {"angle_deg": 360, "range": [0, 8]}}
    if localization:
        robot["localization"] = localization
    return scenario(duration, users={"ana": {"type": "meander"}}, robots={"astro": robot})


def slow_offset(settings, step, units=1280):
    """The error at a step, draw by draw."""
    every_s = settings.corrected_every.total_seconds()
    interval, elapsed_s = divmod(step, int(every_s))

    def key(purpose):
        return stream_key(4, "robots.astro", f"localization: {purpose}")

    def noise(purpose, value):
        return random_bell(key(purpose), interval) * round(value / 209.0215299915 * 65536)

    def grown(value):
        return value * elapsed_s * 1000 // 60_000

    is_off = random_uniform(key("jumps"), interval) < settings.jumps_per_hour * every_s / 3600
    when_us = random_below(key("when"), interval, int(every_s) * 10**6)
    is_off = is_off and elapsed_s * 10**6 >= when_us
    offset = []
    for axis in "xy":
        value = noise(f"left {axis}", settings.left * units)
        value += noise(f"jump {axis}", settings.jump * units) if is_off else 0
        value += grown(noise(f"drift {axis}", settings.drift * units))
        offset.append(value // 65536)
    return (*offset, grown(noise("turn", settings.drift_deg / 360 * TURN)) // 65536)


def test_the_error_is_that_of_its_slow_twin():
    settings = Localization.model_validate(WRONG)
    drift = Drift(settings, 1280, 10**6, 4, "robots.astro")
    steps = np.array([0, 1, 100, 239, 240, 241, 3600, 86_399, 10**7, 17, *range(30, 5000, 97)])
    slow = np.array([slow_offset(settings, step) for step in steps.tolist()])
    assert slow.tolist() == np.stack(drift.at(steps), axis=1).tolist()

    x, y, at_x, at_y = np.random.default_rng(1).integers(0, 20_000, (4, len(steps)))
    along, up = (np.array([f(turn % TURN) for turn in slow[:, 2].tolist()]) for f in (cosine, sine))
    dx, dy, half = x - at_x, y - at_y, UNIT // 2
    placed = drift.misplace(x, y, at_x, at_y, steps)
    assert (
        placed[0].tolist() == (at_x + slow[:, 0] + (dx * along - dy * up + half) // UNIT).tolist()
    )
    assert (
        placed[1].tolist() == (at_y + slow[:, 1] + (dx * up + dy * along + half) // UNIT).tolist()
    )


def test_what_is_seen_is_off_as_the_robot_is():
    stored = run(lost(left="40 cm", corrected_every="5 min"))
    rows = table(stored, "observations")
    assert len(rows["step"]) > 100
    off = np.stack([rows["x"] - rows["true_x"], rows["y"] - rows["true_y"]], axis=1)
    interval = rows["step"] // 300
    for number in np.unique(interval):  # no turn, no drift: the same for all of an interval
        assert np.ptp(off[interval == number], axis=0).max() < 2e-3
    assert 0.05 < np.hypot(*off.T).mean() < 1.5


@pytest.mark.parametrize("camera", [None, {"angle_deg": 360, "range": [0, 8], "latency": "7 s"}])
def test_spans_do_not_show(camera):
    content = lost("20 min", camera, **WRONG)
    first, *others = (digests(run(content, max_span=span)) for span in (None, 61, 1))
    assert all(first == other for other in others)


def test_nobody_moves_otherwise_and_off_is_as_if_it_were_not_there():
    without, errs = run(lost()), run(lost(**WRONG))
    for name in ("ana", "astro"):
        assert np.array_equal(path(without, name).x, path(errs, name).x)
    exact, inexact = table(without, "observations"), table(errs, "observations")
    assert np.array_equal(exact["step"], inexact["step"])
    assert "true_x" not in exact
    assert np.array_equal(exact["x"], inexact["true_x"])
    content = lost()
    content["robots"]["astro"]["localization"] = None
    assert digests(without) == digests(run(content))


class Watch(Algorithm):
    """Tells where the robot believed to be at first."""

    def update(self, history, state):
        return {"x": float(history.poses("astro").x[0])}


def test_algorithms_are_told_where_the_robot_believes_to_be():
    content = lost(left="50 cm", corrected_every="10 min")
    content["algorithms"] = {"watch": {"type": f"{__file__}:Watch", "period": "10 min"}}
    stored = run(content)
    off = table(stored, "watch")["x"] - path(stored, "astro").x[[0, 600, 1200]]
    drift = Drift(Localization(left="50 cm"), 1280, 10**6, 4, "robots.astro")
    assert drift.at(np.array([0, 600, 1200])).x / 1280 == pytest.approx(off, abs=1e-3)
    assert np.abs(off).min() > 0


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"jumps_per_hour": 20}, "at most one"),
        ({"corrected_every": "2 d"}, "at most a day"),
        ({"drift": -1}, "localization.drift"),
        ({"drifts": 1}, "Did you mean|did you mean|Allowed"),
    ],
)
def test_bad_settings_are_refused(fields, words):
    with pytest.raises(InputError, match=words):
        fleet2d.load_scenario(lost(**fields))
