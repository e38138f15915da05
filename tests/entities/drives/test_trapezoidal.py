"""Trapezoidal speed: gathering speed, constant speed, braking; each leg from rest to rest."""

import numpy as np
import pytest
from tests.entities.drives.drives import driven

from fleet2d.entities.drives.trapezoidal import Trapezoidal


def along(acceleration: float, metres: float, pieces: int = 64) -> np.ndarray:
    """Time [s] and position [m] on a straight way."""
    drive = Trapezoidal(acceleration=acceleration, pieces=pieces)
    return np.array([(0, 0), *((s, x) for s, x, _, _ in driven(drive, [(0, 0), (metres, 0)]))])


def test_it_takes_speed_by_acceleration_longer_for_each_leg() -> None:
    rows = driven(Trapezoidal(acceleration=0.25, pieces=2))

    assert (
        [
            (1.0, 0.125, 0.0, 0.0),  # 0.5 m/s after two seconds and half a metre
            (2.0, 0.5, 0.0, 0.0),
            (6.0, 2.5, 0.0, 0.0),
            (7.0, 2.875, 0.0, 0.0),
            (8.0, 3.0, 0.0, 0.0),
            (9.0, 3.0, 0.0, 90.0),
        ]
        == rows[:6]
    )
    assert (15.0, 3.0, 2.0, 90.0) == rows[-1]  # 2 m / 0.5 m/s + 2 s


def test_on_a_short_leg_it_brakes_before_it_is_at_full_speed() -> None:
    rows = along(0.25, 0.36, pieces=2)

    assert [[0, 0], [0.6, 0.045], [1.2, 0.18], [1.8, 0.315], [2.4, 0.36]] == rows.tolist()


@pytest.mark.parametrize("metres", [0.01, 0.05, 1.0, 7.5])
def test_positions_and_speeds_are_those_of_the_profile(metres: float) -> None:
    time, x = along(0.5, metres, pieces=8).T

    ramp, left = min(0.5, metres) / 2, time[-1] - time
    rising = np.sqrt(2 * ramp / 0.5)
    steady = ramp + 0.5 * rising * (time - rising)
    exact = np.select(
        [time < rising, left < rising], [0.25 * time**2, metres - 0.25 * left**2], steady
    )
    assert exact == pytest.approx(x, abs=0.002)
    assert (np.diff(x) > 0).all()
    assert (np.diff(x) <= 0.5 * np.diff(time) + 0.002).all()


def test_it_thinks_that_ways_take_what_they_take() -> None:
    drive = Trapezoidal(acceleration=0.3)
    metres = np.array([0.0, 0.2, 0.8, 0.9, 5.0, np.inf])
    taken = [0.0, *(driven(drive, [(0, 0), (way, 0)])[-1][0] for way in metres[1:-1]), np.inf]

    assert taken == pytest.approx(drive.seconds(metres, 0.5).tolist(), abs=2e-3)
