"""What the tests of drives share."""

import copy
from typing import Any, ClassVar

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.entities.robots.robots import assert_same_for_every_max_span, events, home_with
from tests.scenes import digests, path, run, table
from tests.thorough import some

import fleet2d
from fleet2d import Drive, Moment
from fleet2d.configuration.components import components
from fleet2d.entities.drive import Differential, breakpoints, estimate
from fleet2d.entities.robots.approach import way_seconds
from fleet2d.entities.robots.drives import Holonomic, Trapezoidal
from fleet2d.errors import ComponentError, ScenarioError
from fleet2d.kernels import TURN, time_route
from fleet2d.scenario.compose import compose

CORNER = [(0, 0), (3, 0), (3, 2)]
"""A route that turns left after three metres [m]."""


def driven(drive, points=CORNER, heading_deg=0.0):
    """The breakpoints of a robot of 0.5 m/s and 90 degrees/s: s, x and y [m], heading [degrees]."""
    route = np.round(np.array(points) * 1000).astype(np.int64)  # a unit is a millimetre
    heading = round(heading_deg / 360 * TURN)
    rows = breakpoints(drive, route, heading, (500.0, TURN / 4), 1000.0)
    assert not rows[:, 4].any()
    numbers = rows[:, :4] / [1e6, 1000, 1000, TURN / 360]
    return [tuple(row) for row in np.round(numbers, 3).tolist()]


OTHERS = sorted(set(components("drive")) - {"differential"})
BATTERY = {"driving": "4 min", "standing": "20 min", "charging": "2 min", "charger": [1.0, 3.0]}
GO = {"type": "patrol", "waypoints": [[4.0, 3.0]], "dwell": "1 d", "look_around": False}


class Returned(Drive):
    """Returns moments that a test sets."""

    moments_of_test: ClassVar[Any] = ()

    def moments(self, route):
        if isinstance(self.moments_of_test, Exception):
            raise self.moments_of_test
        return [Moment(*moment) for moment in self.moments_of_test]


class Flight(Drive):
    """Drives at ten times its speed, and mentions only the end."""

    def moments(self, route):
        metres = sum(leg.length for leg in route.legs)
        return [Moment(metres / route.speed / 10, metres, route.legs[-1].direction)]


def busy(drive):
    """Robots that do all that robots do, and are in each other's and in people's way."""
    behaviors = [
        {"type": "dock", "until": "40 %"},
        "come",
        {"type": "find", "user": "ana", "every": "4 min"},
        {"type": "opportunistic", "interaction": "10 s", "again": "5 min"},
        {"type": "follow", "when": "07:10-07:12", "longest": "1 min"},
        {"type": "patrol", "when": "07:12-07:13", "dwell": "5 s"},
        {"type": "hangout", "period": "2 min", "explore": "50 %"},
    ]
    content = home_with(
        behaviors,
        "15 min",
        {"type": "routine", "persona": "works_from_home"},
        astro={"drive": drive, "battery": BATTERY, "gives_way": {"patience": "3 s"}},
        simulation={"people_block": "3 s"},
        script=[
            {"call": "astro", "to": "bedroom", "at": "07:08"},
            {"put": "bolt", "to": "kitchen", "at": "07:04:05"},
        ],
        artifacts={"trajectories": "every step"},
    )
    content["users"]["ben"] = {"type": "meander"}
    content["robots"]["bolt"] = {"type": "patrol", "dwell": "5 s", "drive": drive}
    return content


@pytest.mark.slow
@pytest.mark.parametrize("drive", some(list(OTHERS), 2))
def test_a_run_is_the_same_for_every_span_and_continues_from_a_copy_and_from_a_file(
    drive, tmp_path
):
    content = busy(drive)
    whole = assert_same_for_every_max_span(content, 600, 7, 1)
    kinds = {name for _, name, _ in events(whole)}
    assert {"docks", "find_begins", "relocates", "gives_way", "called"} <= kinds
    for robot in ("astro", "bolt"):
        rows, rebuilt = table(whole, "trajectories", entity=robot), path(whole, robot)
        assert rows["x"].tolist() == rebuilt.x.tolist()
        assert rows["heading"].tolist() == rebuilt.heading.tolist()

    simulation = fleet2d.Simulation(content)
    simulation.advance(537)
    branch = copy.deepcopy(simulation)
    simulation.save(tmp_path / "half.sim")
    assert digests(whole) == digests(branch.run())
    assert digests(whole) == digests(fleet2d.Simulation.load(tmp_path / "half.sim").run())


def test_a_drive_of_ones_own_passes_corners_that_it_does_not_mention():
    assert [(0.6, 3.0, 0.0), (1.0, 3.0, 2.0)] == [row[:3] for row in driven(Flight())]
    assert [54.0, 90.0] == pytest.approx([row[3] for row in driven(Flight())], abs=0.1)


def test_a_drive_of_ones_own_in_a_file_beside_the_scenario(tmp_path):
    (tmp_path / "mine.py").write_text(
        "from fleet2d import Drive, Moment, Route\n"
        "class Slow(Drive):\n"
        "    '''Drives slowly.'''\n"
        "    factor: float = 0.5\n"
        "    def moments(self, route: Route) -> list[Moment]:\n"
        "        metres = sum(leg.length for leg in route.legs)\n"
        "        return [Moment(metres / route.speed / self.factor, metres, route.heading)]\n"
    )
    content = home_with([GO], "1 min", astro={"drive": {"type": f"{tmp_path}/mine:Slow"}})
    ways = [
        path(run(content, f"robots.astro.drive.factor={factor}"), "astro").x for factor in (1, 0.25)
    ]

    assert [6, 21] == [int(np.argmax(way > 3.99)) + 1 for way in ways]


@pytest.mark.parametrize(
    ("moments", "words"),
    [
        ([(1, 3, 0)], "ended after 3 m of a route of 5 m"),
        ([], "ended after 0 m of a route of"),
        ([(1, 3, 0), (0.5, 5, 0)], "returned Moment(seconds=0.5, metres=5, heading=0) after"),
        ([(1, 3, 0), (2, 2, 0)], "neither seconds (10 days at most) nor metres may fall"),
        ([(1, 5.1, 0)], "no moment may be past the end"),
        ([(float("nan"), 5, 0)], "returned Moment(seconds=nan"),
        ([(1e9, 5, 0)], "10 days at most"),
        ([(1, 5, 0.5)], "headings are whole numbers"),
    ],
    ids=["too short", "nothing", "back in time", "back", "too far", "nan", "years", "half"],
)
def test_nonsense_is_refused(moments, words, monkeypatch):
    monkeypatch.setattr(Returned, "moments_of_test", moments)
    with pytest.raises(ComponentError) as caught:
        driven(Returned(), CORNER)
    assert words in str(caught.value)


class Hopes(Returned):
    """Estimates what a test sets."""

    estimate: float | list[float]

    def seconds(self, metres, speed):
        return np.array(self.estimate)


@pytest.mark.parametrize("seconds", [2.0, [1.0], [-1.0, 1.0], [float("nan"), 0.0]])
def test_estimates_that_are_no_times_are_refused(seconds):
    drive = Hopes.model_construct(estimate=seconds)
    with pytest.raises(ComponentError, match=r"Hopes estimated .* of shape \(2,\)"):
        estimate(drive, np.array([1.0, 2.0]), 0.6)


@pytest.mark.parametrize(
    ("moments", "words"),
    [
        ([], "the drive tests.entities.test_drive:Returned ended after"),
        (KeyError("wheel"), "KeyError: 'wheel'"),
    ],
)
def test_errors_name_robot_drive_and_step(moments, words, monkeypatch):
    monkeypatch.setattr(Returned, "moments_of_test", moments)
    with pytest.raises(ComponentError) as caught:
        run(home_with([GO], "1 min", astro={"drive": Returned()}))
    assert str(caught.value).startswith("robots.astro.drive failed at step 0: ")
    assert words in str(caught.value)


def test_robots_think_that_a_way_takes_what_their_drive_takes():
    times = {}
    for drive in ("differential", "holonomic", "trapezoidal"):
        simulation = fleet2d.Simulation(home_with([], "1 min", astro={"drive": drive}))
        actor = simulation._state.actors[-1]
        times[drive] = way_seconds(actor, actor.point((1, 3)), actor.point((1, 1)))
        assert way_seconds(actor, actor.point((1, 3)), actor.point((1, 3))) == 0
        assert [0, times[drive]] == pytest.approx(
            actor.seconds(np.array([0.0, 2.0])).tolist(), abs=1e-3
        )
    assert times == pytest.approx(
        {"differential": 2 / 0.6, "holonomic": 2 / 0.6, "trapezoidal": 2 / 0.6 + 0.6 / 0.5},
        abs=1e-3,
    )


def test_another_type_in_an_override_replaces_the_keys_of_the_old_one():
    base = {"robots": {"astro": {"drive": {"type": "trapezoidal", "acceleration": 0.2}}}}

    def drive(*overrides):
        return compose(base, overrides).data["robots"]["astro"]["drive"]

    assert {"type": "holonomic"} == drive("robots.astro.drive=holonomic")
    assert {"type": "holonomic"} == drive("robots.astro.drive.type=holonomic")
    assert {"type": "trapezoidal", "acceleration": 1} == drive("robots.astro.drive.acceleration=1")


def test_an_unknown_drive_is_refused_with_the_names_of_all():
    with pytest.raises(ScenarioError) as caught:
        fleet2d.load_scenario("bundled:paper", "robots.astro.drive=holonomc")
    assert "did you mean 'holonomic'" in str(caught.value)


def test_people_have_no_drive():
    with pytest.raises(ScenarioError) as caught:
        fleet2d.load_scenario("bundled:paper", "users.ana.drive=holonomic")
    assert "drive" in str(caught.value)


POINTS = st.lists(st.tuples(*[st.integers(-5000, 5000)] * 2), min_size=1, max_size=6)


@pytest.mark.parametrize(
    ("drive", "points", "heading_deg", "expected"),
    [
        # A quarter turn takes a second, half a metre.
        (Holonomic(), CORNER, 0, [(6, 3, 0, 0), (7, 3, 0.5, 90), (10, 3, 2, 90)]),
        (Holonomic(), [(0, 0), (0.25, 0)], 270, [(0.5, 0.25, 0, 315)]),
        (Holonomic(), [(0, 0), (0, 0.25), (0, 0.5)], 0, [(0.5, 0, 0.25, 45), (1, 0, 0.5, 90)]),
        (Holonomic(turns=False), CORNER, 45, [(6, 3, 0, 45), (10, 3, 2, 45)]),
        (
            Trapezoidal(acceleration=0.25, pieces=2),
            CORNER,
            0,
            [
                (1, 0.125, 0, 0), (2, 0.5, 0, 0),  # 0.5 m/s after two seconds and half a metre
                (6, 2.5, 0, 0), (7, 2.875, 0, 0), (8, 3, 0, 0), (9, 3, 0, 90),
                (10, 3, 0.125, 90), (11, 3, 0.5, 90), (13, 3, 1.5, 90), (14, 3, 1.875, 90),
                (15, 3, 2, 90),  # 2 m / 0.5 m/s + 2 s
            ],
        ),
    ],
    ids=["turns while it drives", "as far as the way lasts", "the shorter way", "never turns", "speeds up on each leg"],
)  # fmt: skip
def test_a_robot_drives_as_its_drive_has_it(drive, points, heading_deg, expected):
    assert expected == driven(drive, points, heading_deg)


@given(POINTS, st.integers(0, TURN - 1), st.floats(1, 5000), st.floats(1, TURN))
def test_it_is_the_same_as_in_the_core(points, heading, speed, turn_rate):
    route = np.array(points, np.int64)
    core = time_route(route, 0, heading, speed, turn_rate)[1:]
    rows = breakpoints(Differential(), route, heading, (speed, turn_rate), 1280.0)

    assert core[:, 1:].tolist() == rows[:, 1:4].tolist()
    late = core[:, 0] - rows[:, 0]  # the core rounds the time of each turn and leg up
    assert ((late >= -1) & (late <= 1 + np.arange(len(late)))).all()


@pytest.mark.parametrize("metres", [0.01, 0.05, 0.36, 1.0, 7.5])
def test_positions_and_speeds_are_those_of_the_profile(metres):
    rows = driven(Trapezoidal(acceleration=0.5, pieces=8), [(0, 0), (metres, 0)])
    time, x = np.array([(0, 0), *(row[:2] for row in rows)]).T

    ramp, left = min(0.5, metres) / 2, time[-1] - time
    rising = np.sqrt(2 * ramp / 0.5)
    steady = ramp + 0.5 * rising * (time - rising)
    exact = np.select(
        [time < rising, left < rising], [0.25 * time**2, metres - 0.25 * left**2], steady
    )
    assert exact == pytest.approx(x, abs=0.002)
    assert (np.diff(x) > 0).all()


def test_it_thinks_that_ways_take_what_they_take():
    drive = Trapezoidal(acceleration=0.3)
    metres = np.array([0.0, 0.2, 0.8, 0.9, 5.0, np.inf])
    taken = [0.0, *(driven(drive, [(0, 0), (way, 0)])[-1][0] for way in metres[1:-1]), np.inf]

    assert taken == pytest.approx(drive.seconds(metres, 0.5).tolist(), abs=2e-3)
