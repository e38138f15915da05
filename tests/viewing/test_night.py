"""The light of the hour in Python's pictures: as the page's."""

from datetime import datetime
from functools import cache

import pytest
from matplotlib.figure import Figure
from matplotlib.image import AxesImage

import fleet2d
from fleet2d.viewing.night import sky_at
from fleet2d.viewing.stage import Stage

SKY = (5.0, 7.0, 18.0, 20.0)
HOUR = 3600


@cache
def evening():
    return fleet2d.run("bundled:paper", "simulation.duration=1 d", seed=4)


def opacity_of_rooms(run, step):
    """How dark the light is that lies on each room at a step."""
    stage = Stage(run, 0, run.manifest["steps"], figure=Figure(), stride=60)
    stage.show(step)
    light, _ = stage.light_artists
    assert isinstance(light, AxesImage)
    veil = light.get_array()
    assert veil is not None
    plan = run.plan
    return {room.name: float(veil[plan.room_of_cell == room.index, 3].max()) for room in plan.rooms}


def room_of(run, name, step):
    return str(run.plan.rooms[run.path(name).room[step // 60]].name)


def test_at_night_only_the_room_of_somebody_awake_is_bright():
    run = evening()
    step = 21 * HOUR

    dark = opacity_of_rooms(run, step)

    bright = {name for name, opacity in dark.items() if opacity == 0}
    assert bright == {room_of(run, "ana", step)}
    assert min(opacity for name, opacity in dark.items() if name not in bright) > 0.4


def test_who_sleeps_lies_in_the_dark_and_noon_is_bright_everywhere():
    run = evening()

    assert min(opacity_of_rooms(run, 2 * HOUR).values()) > 0.4
    assert {0.0} == set(opacity_of_rooms(run, 12 * HOUR).values())


def test_a_run_that_switches_lights_is_lit_by_them():
    changes = {
        "extends": "bundled:paper",
        "simulation": {"duration": "22 h", "seed": 4},
        "users": {"ana": {"lights": "18:00-23:00"}},
    }
    run = fleet2d.run(changes)
    switches = [r for r in run.tables["events"].to_pylist() if r["event"].startswith("light_")]
    step = 21 * HOUR
    state = {r["detail"]: r["event"] == "light_on" for r in switches if r["step"] <= step}

    dark = opacity_of_rooms(run, step // 60 * 60)

    assert {name for name, is_on in state.items() if is_on} == {
        name for name, opacity in dark.items() if opacity == 0
    }


@pytest.mark.parametrize(
    ("hour", "day", "dusk"), [(3, 0, 0), (6, 0.5, 0.5), (12, 1, 0), (19, 0.5, 0.5), (23, 0, 0)]
)
def test_the_sky_is_bright_by_day_and_red_when_the_sun_rises_and_sets(hour, day, dusk):
    start = datetime(2026, 1, 5)
    assert sky_at([SKY], start.replace(hour=hour), start) == pytest.approx((day, dusk))
