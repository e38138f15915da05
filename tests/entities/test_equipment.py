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
    every_us = int(settings.corrected_every.total_seconds() * 10**6)
    interval, elapsed_us = divmod(step * 10**6, every_us)

    def draw(purpose):
        return random_bell(stream_key(4, "robots.astro", f"localization: {purpose}"), interval)

    def key(purpose):
        return stream_key(4, "robots.astro", f"localization: {purpose}")

    def noise(value):
        return round(value / 209.0215299915 * 65536)

    def grown(value):
        return value * (elapsed_us // 1000) // 60_000

    hours = settings.corrected_every.total_seconds() / 3600
    jumps = random_uniform(key("jumps"), interval) < settings.jumps_per_hour * hours
    jumped = jumps and elapsed_us >= random_below(key("when"), interval, every_us)
    offset = []
    for axis in "xy":
        value = draw(f"left {axis}") * noise(settings.left * units)
        value += draw(f"jump {axis}") * noise(settings.jump * units) if jumped else 0
        value += grown(draw(f"drift {axis}") * noise(settings.drift * units))
        offset.append(value // 65536)
    turn = grown(draw("turn") * noise(settings.drift_deg / 360 * TURN)) // 65536
    return offset[0], offset[1], turn


def test_the_error_is_that_of_its_slow_twin():
    settings = Localization.model_validate(WRONG)
    drift = Drift(settings, 1280, 10**6, 4, "robots.astro")
    steps = np.array([0, 1, 100, 239, 240, 241, 3600, 86_399, 10**7, 17])
    fast = drift.at(steps)
    slow = [slow_offset(settings, step) for step in steps.tolist()]
    assert slow == list(zip(*(column.tolist() for column in fast), strict=True))


def test_points_are_put_where_its_slow_twin_puts_them():
    settings = Localization.model_validate(WRONG)
    drift = Drift(settings, 1280, 10**6, 4, "robots.astro")
    steps = np.arange(0, 5000, 97)
    draws = np.random.default_rng(1).integers(0, 20_000, (4, len(steps)))
    placed = np.stack(drift.misplace(*draws, steps), axis=1).tolist()
    for step, (x, y, at_x, at_y), point in zip(
        steps.tolist(), draws.T.tolist(), placed, strict=True
    ):
        off_x, off_y, turn = slow_offset(settings, step)
        along, up, half = cosine(turn % TURN), sine(turn % TURN), UNIT // 2
        dx, dy = x - at_x, y - at_y
        assert point == [
            at_x + off_x + (dx * along - dy * up + half) // UNIT,
            at_y + off_y + (dx * up + dy * along + half) // UNIT,
        ]


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
